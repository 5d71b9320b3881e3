/* What reaches the encoder of sf_ray_top: its words and nothing else; and when rays are at work there. */
#include "ck_run.h"
#include "tests/fx_fixture.h"
#include "tests/register_bus.h"

enum { RAYS = 4, SAMPLES_MAX = 1024 };

static sf_ray_sample samples[RAYS][SAMPLES_MAX];

static void renders(sf_ray_dut *rays, uint64_t seed)
{
  const fx_scene *scene = rays->scene;
  fx_ray ray[RAYS];
  fx_pixel expected, actual[RAYS];
  fx_counts counts = {0};
  sf_ray_request request[RAYS];
  uint64_t count = 0;
  for (uint64_t i = 0; i < RAYS; i++) {
    ray[i] = random_ray(scene, seed, i);
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &expected, &counts));
    sf_ray_samples(scene, &ray[i], samples[i], (int)expected.samples);
    request[i] = (sf_ray_request){&ray[i], samples[i], (int)expected.samples, false, i == 0};
    count += expected.samples;
  }
  ck_assert_uint_gt(count, 0);
  ck_ok(sf_ray_dut_run(rays, request, RAYS, actual));
  for (int i = 0; i < RAYS; i++) {
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &expected, &counts));
    ck_assert_mem_eq(actual[i].colour, expected.colour, sizeof expected.colour);
    ck_assert_uint_eq(actual[i].depth, expected.depth);
  }
}

/* Writes of the other registers, refused words, what a master shows while it is not valid: nothing of it gets there. */
TEST(the_encoder_is_programmed_by_its_words_alone)
{
  static const fixture_sizes sizes = {4, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 21);
  scene.step_q24 = 1 << 20;
  memset(scene.occupancy, 0xff, 64);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 240, .stall_percent = 10}));
  sf_dut *dut = rays->dut;
  for (uint32_t word = 0; word < 8 * 4; word++) { /* of the four levels, and at last the three behind them */
    const uint32_t address = word < 8 * 4 - 3 ? word : 0x80 + word - (8 * 4 - 3);
    put(dut, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
    put(dut, SF_CSR_ENCODER_ADDRESS, address);
    for (uint32_t o = 0; o < 3; o++) put(dut, SF_CSR_RAY_BACKGROUND_R + 4 * o, (uint32_t)scene.background[o]);
    put(dut, SF_CSR_RAY_MAX_SAMPLES, (uint32_t)scene.max_samples);
    put(dut, SF_CSR_RAY_TRANS_STOP, (uint32_t)scene.trans_stop);
    put_bytes(dut, SF_CSR_ENCODER_DATA, 1, 7);
    put(dut, SF_CSR_RAY_ERROR, ~0u);
    dut->each_cycle = show_any_access, dut->each_cycle_context = dut;
    for (int i = 0; i < 40; i++) sf_dut_tick(dut);
    dut->each_cycle = sf_memory_cycle, dut->each_cycle_context = &rays->memory;
    ck_assert_uint_eq(get(dut, SF_CSR_ENCODER_ADDRESS), address);
    ck_assert_int_eq(sf_driver_start(&dut->bus), SF_DRIVER_OK);
    put(dut, SF_CSR_RAY_CTRL, SF_CSR_RAY_CTRL_START);
    put(dut, SF_CSR_ENCODER_DATA, 1); /* while it runs */
    ck_assert_int_eq(dut->bus_response, SLVERR);
    put(dut, SF_CSR_RAY_ERROR, ~0u);
    renders(rays, word);
  }
}

/* From the first sample that is taken to the pixel that is taken, whoever works on it. */
TEST(active_until_the_pixel_has_left)
{
  enum { IDLE = SF_CSR_RAY_STATUS_RUNNING, BUSY = IDLE | SF_CSR_RAY_STATUS_ACTIVE };
  static const fixture_sizes sizes = {16, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 22);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 250}));
  sf_dut *dut = rays->dut;
  ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), IDLE);
  for (int empty = 0; empty < 2; empty++) {
    dut->in.ray_valid = dut->in.ray_user = dut->in.ray_last = true, dut->in.pixel_ready = false;
    memset(dut->in.ray_data, 0, sizeof dut->in.ray_data);
    dut->in.ray_data[3] = (uint64_t)empty << 48;
    sf_dut_tick(dut);
    ck_assert(dut->out.ray_ready);
    dut->in.ray_valid = false;
    int polls = 0;
    for (; !dut->out.pixel_valid; polls++) ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), BUSY);
    ck_assert_int_gt(polls, empty ? 0 : 20);
    for (int i = 0; i < 20; i++) ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), BUSY);
    dut->in.pixel_ready = true;
    sf_dut_tick(dut);
    ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), IDLE);
  }
}
