/* The field's cache and memory of sf_ray_top: look-ups, misses and lines as the core counts them, a build without the
 * cache that a program asks for, a memory that fails, and the rules that the harness holds the block to. */
#include "ck_run.h"
#include "quant/quant.h"
#include "sim/ray/ray.h"
#include "tests/dut_fixture.h"
#include "tests/fx_fixture.h"
#include "tests/random_net.h"

enum { RAYS = 24, SAMPLES_MAX = 1024 };

static fx_ray ray[RAYS];
static uint64_t tile[RAYS];
static sf_ray_sample sample[RAYS][SAMPLES_MAX];
static sf_ray_request request[RAYS];
static fx_pixel expected[RAYS], actual[RAYS];

static void core_reads(void *user, fx_read what, const uint32_t pos[3])
{
  fx_memory_read(user, what, pos);
}

/* Tiles of one ray and of several, some without a sample; the core's pixels and what it asks of the memory. */
static void draw_list(const fx_scene *scene, uint64_t seed, fx_memory *memory)
{
  const fx_watch watch = {core_reads, memory};
  fx_counts counts = {0};
  for (uint64_t i = 0; i < RAYS; i++) {
    ray[i] = random_ray(scene, seed, i);
    if (i % 5 == 4) ray[i].count = 0; /* misses the box */
    tile[i] = i == 0 ? 7 : tile[i - 1] + (i * seed % 3 == 0);
    fx_memory_ray(memory, tile[i]);
    ck_ok(fx_render_watched(scene, &ray[i], NULL, NULL, &watch, &expected[i], &counts));
    request[i] = sf_ray_request_as(scene, &ray[i], &expected[i], sample[i]);
  }
}

static void run_list(sf_ray_dut *rays)
{
  for (int i = 0; i < RAYS; i++) request[i].new_tile = sf_ray_dut_new_tile(rays, tile[i]);
  ck_ok(sf_ray_dut_run(rays, request, RAYS, actual));
  for (int i = 0; i < RAYS; i++) ck_assert_mem_eq(&actual[i], &expected[i], offsetof(fx_pixel, samples));
}

static fx_scene dense_scene(uint64_t seed)
{
  fixture_sizes sizes = fixture_ingp;
  fx_scene scene = fixture_scene(&sizes, seed);
  scene.step_q24 = 1 << 19;
  memset(scene.occupancy, 0xff, 64);
  return scene;
}

/* Whatever the memory's time: the same counts, and more cycles with a slow one. */
LOOP_TEST(counts_of_tiles, 4)
{
  OWNED(fx_scene) scene = dense_scene(800 + (uint64_t)_i);
  fx_memory memory;
  uint64_t stalls[3];
  static const int latency[3] = {1, 0, 150};
  ck_ok(fx_memory_open(&memory, &scene, &(fx_cache_shape){SF_CACHE_BYTES, SF_CACHE_WAYS}));
  draw_list(&scene, 800 + (uint64_t)_i, &memory);
  ck_assert_uint_gt(memory.counts.misses, 100);
  ck_assert_uint_gt(memory.counts.lookups, 2 * memory.counts.misses);
  for (int i = 0; i < 3; i++) {
    const sf_dut_options options = {.seed = 5, .stall_percent = _i % 2 * 40, .memory_latency = latency[i]};
    OWNED(sf_ray_dut) *rays = NULL;
    sf_field_counters field;
    ck_ok(sf_ray_dut_open(&rays, &scene, &options));
    run_list(rays);
    ck_ok(sf_ray_dut_field(rays, &field));
    ck_ok(sf_compare_field(&memory.counts, &field));
    stalls[i] = field.stalls;
    ck_assert_uint_eq(rays->memory.asked, field.fills);
    sf_ray_driver_clear(&rays->dut->bus);
    ck_ok(sf_ray_dut_field(rays, &field));
    ck_assert(field.lookups == 0 && field.misses == 0 && field.fills == 0 && field.stalls == 0);
    field.misses++;
    ck_assert_int_eq(sf_compare_field(&memory.counts, &field).code, SF_E_DIFFERENCE);
  }
  ck_assert_uint_gt(stalls[2], 2 * stalls[0]);
  fx_memory_close(&memory);
}

/* Without the flag the cache keeps what it has: the counts are those of one tile. */
TEST(the_flag_alone_empties_the_cache)
{
  OWNED(fx_scene) scene = dense_scene(810);
  fx_memory memory;
  ck_ok(fx_memory_open(&memory, &scene, &(fx_cache_shape){SF_CACHE_BYTES, SF_CACHE_WAYS}));
  draw_list(&scene, 810, &memory);
  const uint64_t in_tiles = memory.counts.misses;
  for (int i = 0; i < RAYS; i++) tile[i] = 1;
  OWNED(sf_ray_dut) *rays = NULL;
  sf_field_counters field;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 6}));
  run_list(rays);
  ck_ok(sf_ray_dut_field(rays, &field));
  ck_assert_uint_eq(field.lookups, memory.counts.lookups);
  ck_assert_uint_lt(field.misses, in_tiles);
  fx_memory_close(&memory);
}

TEST(a_cache_that_the_build_lacks)
{
  static const struct {
    uint32_t bytes, ways;
    bool there;
  } want[] = {{0, 0, true},
              {SF_CACHE_BYTES, 0, true},
              {0, SF_CACHE_WAYS, true},
              {SF_CACHE_BYTES, SF_CACHE_WAYS, true},
              {2 * SF_CACHE_BYTES, SF_CACHE_WAYS, false},
              {SF_CACHE_BYTES, 2 * SF_CACHE_WAYS, false},
              {1, 0, false}};
  OWNED(fx_scene) scene = dense_scene(820);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 7}));
  const sf_bus *bus = &rays->dut->bus;
  for (int i = 0; i < COUNT(want); i++) {
    const sf_ray_blob blob = {.levels = (uint32_t)scene.grid.levels,
                              .n_dir = (uint32_t)fx_net_constants(&scene.net),
                              .max_samples = 1,
                              .cache_bytes = want[i].bytes,
                              .cache_ways = want[i].ways};
    put(rays->dut, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
    const sf_driver_code code = sf_ray_driver_load(bus, &blob, NULL);
    ck_assert_int_eq(code, want[i].there ? SF_DRIVER_OK : SF_DRIVER_CACHE);
    ck_assert_uint_eq(get(rays->dut, SF_CSR_RAY_STATUS), want[i].there ? SF_CSR_RAY_STATUS_RUNNING : 0);
  }
  ck_assert(strstr(sf_driver_text(SF_DRIVER_CACHE), "cache"));
}

/* ---- the memory ---- */

static uint64_t fails_until; /* from line 20 on */
static uint8_t failure;
static void failing_memory(void *context)
{
  sf_memory *m = context;
  sf_memory_cycle(m);
  m->dut->in.r_resp = m->answered >= 20 && m->answered < fails_until ? failure : 0;
}

/* With SLVERR or DECERR, once; and with all that it was asked for, also behind the soft reset that drops those lines.
 */
LOOP_TEST(a_memory_that_answers_with_an_error, 3)
{
  fails_until = _i < 2 ? 21 : UINT64_MAX, failure = _i == 1 ? 3 : 2;
  OWNED(fx_scene) scene = dense_scene(830);
  fx_memory memory;
  ck_ok(fx_memory_open(&memory, &scene, &(fx_cache_shape){SF_CACHE_BYTES, SF_CACHE_WAYS}));
  draw_list(&scene, 830, &memory);
  fx_memory_close(&memory);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 8}));
  rays->dut->each_cycle = failing_memory;
  ck_bad(sf_ray_dut_run(rays, request, RAYS, actual), SF_E_DIFFERENCE, "rays: MEMORY: ", "");
  ck_ok(sf_ray_dut_load(rays)); /* a soft reset clears it */
  rays->dut->each_cycle = sf_memory_cycle, rays->dut->in.r_resp = 0;
  run_list(rays);
}

/* A block of the test's own, which breaks one rule. */
TEST(rules_of_the_memory_port)
{
  static const struct {
    const char *text;
    sf_pins_out first, second;
  } bad[] = {{NULL, {.ar_valid = true}, {.ar_valid = true}},
             {"changed or went", {.ar_valid = true}, {.ar_valid = false}},
             {"changed or went", {.ar_valid = true}, {.ar_valid = true, .ar_address = 16}},
             {"two beats", {.ar_valid = true, .ar_len = 3}, {.ar_valid = true}},
             {"two beats", {.ar_valid = true, .ar_size = 2}, {.ar_valid = true}},
             {"two beats", {.ar_valid = true, .ar_burst = 2}, {.ar_valid = true}},
             {"unprivileged", {.ar_valid = true, .ar_prot = 1}, {.ar_valid = true}},
             {"aligned", {.ar_valid = true, .ar_address = 8}, {.ar_valid = true}}};
  const uint8_t table[64] = {0};
  for (int i = 0; i < COUNT(bad); i++) {
    sf_dut dut = {.in.rst_n = true};
    sf_memory memory = {.dut = &dut, .contents = table, .bytes = sizeof table};
    for (int cycle = 0; cycle < 2; cycle++) {
      dut.out = cycle ? bad[i].second : bad[i].first;
      if (!dut.out.ar_len) dut.out.ar_len = 1;
      if (!dut.out.ar_size) dut.out.ar_size = 3;
      if (!dut.out.ar_burst) dut.out.ar_burst = 1;
      dut.in.ar_ready = false;
      sf_memory_cycle(&memory);
    }
    ck_assert_msg(bad[i].text ? memory.fault && strstr(memory.fault, bad[i].text) : !memory.fault, "%d: %s", i,
                  memory.fault ? memory.fault : "nothing");
  }
}

/* Lines inside, at the end, and beyond a table of 32 entries. */
TEST(requests_beyond_the_table)
{
  const uint8_t table[64] = {0};
  sf_dut dut = {.in.rst_n = true};
  sf_memory memory = {.dut = &dut, .contents = table, .bytes = 60, .base = 4096};
  static const uint32_t address[] = {4096, 4096 + 48, 4096 + 64, 4096 - 16};
  for (int i = 0; i < COUNT(address); i++) {
    dut.out = (sf_pins_out){
        .ar_valid = true, .ar_address = address[i], .ar_len = 1, .ar_size = 3, .ar_burst = 1, .r_ready = true};
    dut.in.ar_ready = true;
    sf_memory_cycle(&memory);
    dut.out.ar_valid = false;
    ck_assert_uint_eq(memory.outside, i < 2 ? 0 : (uint64_t)i - 1);
    ck_assert_ptr_null(memory.fault);
  }
}
