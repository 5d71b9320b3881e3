/* TensoRF's field in sf_ray_top against the fixed-point core, bit for bit: sample positions in; pixels, the nets'
 * counters and the field's look-ups and misses out. Fields of random sizes, entries and scales, their extremes more
 * often than chance would; stalls, slow memories, tiles, rays that go on after their end, resets, illegal programming.
 */
#include "ck_run.h"
#include "energy/energy.h"
#include "firmware/sf_ray_driver.h"
#include "quant/quant.h"
#include "tests/dut_fixture.h"
#include "tests/fx_fixture.h"
#include "tests/random_planes.h"

enum { RAYS = 8 };

static fx_ray ray[RAYS];
static uint64_t tile[RAYS];
static sf_ray_sample sample[RAYS][SF_RAY_SAMPLES_MAX];
static sf_ray_request request[RAYS];
static fx_pixel expected[RAYS], actual[RAYS];
static fx_counts counts;
static fx_memory memory;

/* ---- the core's rays, and the accelerator's ---- */

static void core_reads(void *user, fx_read what, const uint32_t pos[3])
{
  fx_memory_read(user, what, pos);
}

static void expect_core(const fx_scene *scene, uint64_t seed)
{
  const fx_watch watch = {core_reads, &memory};
  memset(&counts, 0, sizeof counts);
  ck_ok(fx_memory_open(&memory, scene, &(fx_cache_shape){SF_CACHE_BYTES, SF_CACHE_WAYS}));
  for (uint64_t i = 0; i < RAYS; i++) {
    ray[i] = random_ray(scene, seed, i);
    if (i % 5 == 4) ray[i].count = 0; /* misses the box */
    tile[i] = i == 0 ? 7 : tile[i - 1] + (i * seed % 3 == 0);
    fx_memory_ray(&memory, tile[i]);
    ck_ok(fx_render_watched(scene, &ray[i], NULL, NULL, &watch, &expected[i], &counts));
    request[i] = sf_ray_request_as(scene, &ray[i], &expected[i], sample[i]);
  }
  fx_memory_close(&memory);
}

static void same_pixels(void)
{
  for (int i = 0; i < RAYS; i++) {
    const fx_pixel *e = &expected[i], *a = &actual[i];
    ck_assert_uint_eq(a->transmittance, e->transmittance);
    ck_assert_uint_eq(a->weight_sum, e->weight_sum);
    ck_assert_uint_eq(a->depth, e->depth);
    ck_assert_uint_eq(a->samples, e->samples);
    for (int o = 0; o < 3; o++) ck_assert_uint_eq(a->colour[o], e->colour[o]);
  }
}

static void run(sf_ray_dut *rays)
{
  for (int i = 0; i < RAYS; i++) request[i].new_tile = sf_ray_dut_new_tile(rays, tile[i]);
  ck_ok(sf_ray_dut_run(rays, request, RAYS, actual));
  same_pixels();
}

static void same_counts(sf_ray_dut *rays)
{
  fx_counts nets;
  sf_field_counters field;
  ck_ok(sf_dut_counts(rays->dut, &nets, NULL, NULL, NULL));
  ck_ok(sf_counts_compare(&counts, "core", &nets, "accelerator"));
  ck_ok(sf_ray_dut_field(rays, &field));
  ck_ok(sf_compare_field(&memory.counts, &field));
  ck_assert_uint_eq(rays->memory.asked, field.fills);
}

/* All rays of the march in place of those that the core took: the accelerator has to find their end. */
static void send_all(const fx_scene *scene)
{
  for (int i = 0; i < RAYS; i++) {
    uint32_t pos[3];
    int n = 0;
    for (int32_t at = -1; (at = fx_march_next(scene, &ray[i], at + 1, pos, NULL)) >= 0;) n++;
    ck_assert_int_le(n, SF_RAY_SAMPLES_MAX);
    sf_ray_samples(scene, &ray[i], sample[i], n);
    request[i] = (sf_ray_request){&ray[i], sample[i], n, false, false};
  }
}

LOOP_TEST(random_fields, 40)
{
  const uint64_t seed = 2000 + (uint64_t)_i;
  const sf_dut_options options = {.seed = seed, .stall_percent = _i % 4 * 25, .memory_latency = _i % 3 * 40};
  OWNED(fx_scene) scene = random_planes(seed, _i % 3 > 0);
  OWNED(sf_ray_dut) *rays = NULL;
  expect_core(&scene, seed);
  ck_assert_uint_gt(memory.counts.lookups, 0);
  ck_ok(sf_ray_dut_open(&rays, &scene, &options));
  run(rays);
  same_counts(rays);
  send_all(&scene);
  run(rays);
}

/* Every product at its rail, of as many components as there can be: the widest sums. */
LOOP_TEST(largest_sums, 4)
{
  const uint64_t seed = 2900 + (uint64_t)_i;
  OWNED(fx_scene) scene = make_planes(seed, true, FX_COMPONENTS_MAX);
  OWNED(sf_ray_dut) *rays = NULL;
  fx_tensorf *f = &scene.tensorf;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const size_t n = FX_COMPONENTS_MAX * 4, m = FX_COMPONENTS_MAX * 2;
    memset(f->density.plane[pair], 127, n), memset(f->appearance.plane[pair], 127, n);
    memset(f->density.line[pair], _i & 1 ? -127 : 127, m), memset(f->appearance.line[pair], _i & 2 ? -127 : 127, m);
  }
  memset(f->basis, _i & 2 ? 127 : -127, 3 * FX_COMPONENTS_MAX * FX_APPEARANCE_MAX);
  f->density_in = (fx_scale){100, 24, _i & 1 ? 1220000 : -1220000}, f->sigma_out = (fx_scale){40000, 20, 0};
  f->weight_stop = 0;
  expect_core(&scene, seed);
  ck_assert_uint_gt(counts.samples, 0);
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = seed}));
  run(rays);
  same_counts(rays);
}

/* ---- resets, order, programming ---- */

static fx_scene long_rays(uint64_t seed)
{
  for (;; seed += 100) {
    fx_scene scene = random_planes(seed, true);
    scene.trans_stop = 1, scene.max_samples = 1024, scene.tensorf.weight_stop = 20;
    memset(scene.occupancy, 0xff, 64);
    expect_core(&scene, seed);
    if (counts.samples > 40) return scene; /* decoded ones */
    fx_scene_free(&scene);
  }
}

static void works(sf_ray_dut *rays)
{
  rays->dut->in.ray_valid = rays->dut->in.pixel_ready = false;
  ck_ok(sf_ray_dut_load(rays));
  ck_ok(sf_dut_clear_counts(rays->dut));
  sf_ray_driver_clear(&rays->dut->bus);
  rays->memory.asked = rays->memory.answered = 0;
  expect_core(rays->scene, 3);
  run(rays);
  same_counts(rays);
}

/* A bus that leaves writes out: that of a word of the field's programming, or the driver's own reset. */
static struct {
  sf_bus real;
  uint32_t word, left_out; /* 0: none */
  bool without_reset;
} writes;

static uint32_t read_through(void *context, uint32_t offset)
{
  (void)context;
  return writes.real.read(writes.real.context, offset);
}

static void leave_out(void *context, uint32_t offset, uint32_t value)
{
  (void)context;
  if (writes.without_reset && offset == SF_CSR_CTRL && value == SF_CSR_CTRL_SOFT_RESET) return;
  if (offset == SF_CSR_ENCODER_ADDRESS)
    writes.word = value;
  else if (offset == SF_CSR_ENCODER_DATA && writes.word++ == writes.left_out)
    offset = SF_CSR_ENCODER_ADDRESS, value = writes.word;
  writes.real.write(writes.real.context, offset, value);
}

static void begin_leaving_out(sf_dut *dut, uint32_t word, bool the_reset)
{
  writes.real = dut->bus, writes.left_out = word, writes.without_reset = the_reset;
  dut->bus = (sf_bus){read_through, leave_out, NULL};
}

static void reset(sf_dut *dut)
{
  dut->in.rst_n = false;
  sf_dut_tick(dut);
  dut->in.rst_n = true;
}

/* The request of the ray that takes most of its light from samples: they are decoded. */
static const sf_ray_request *most_decoded(void)
{
  int best = 0;
  for (int i = 1; i < RAYS; i++)
    if (expected[i].weight_sum > expected[best].weight_sum) best = i;
  return &request[best];
}

/* _i: by one command; by the pin alone. Of the second scene, a decoded sample that lacks a part spikes otherwise. */
LOOP_TEST(reset_in_mid_ray, 4)
{
  OWNED(fx_scene) scene = long_rays(_i / 2 ? 3128 : 3100);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 4, .stall_percent = 10}));
  for (int cycles = 1; cycles < 4000; cycles = cycles * 13 / 12 + 1) {
    cut_off(rays->dut, most_decoded(), cycles);
    if (_i % 2)
      reset(rays->dut);
    else
      put(rays->dut, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
    begin_leaving_out(rays->dut, 0, true);
    works(rays);
    rays->dut->bus = writes.real;
  }
}

TEST(beats_out_of_order_are_refused)
{
  OWNED(fx_scene) scene = long_rays(3200);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 5}));
  for (int user = 0; user < 2; user++) {
    works(rays);
    ck_assert_int_gt(beats_out_of_order(rays->dut, user, 400), 150);
  }
  works(rays);
}

/* Words of the planes' programming: rtl/sf_planes.sv. */
TEST(sizes_that_do_not_fit_are_refused)
{
  static const struct {
    uint32_t word, value;
    bool fits;
  } programming[] = {{0x101, 0, false},      {0x101, 2049, false}, {0x101, 2048, true},   {0x102, 0, false},
                     {0x102, 4097, false},   {0x103, 0, false},    {0x103, ~0u, false},   {0x105, 1 << 20, false},
                     {0x105, 1048575, true}, {0x106, 0, false},    {0x106, 33, false},    {0x106, 32, true},
                     {0x107, 5, false},      {0x107, 4, true},     {0x108, 5, false},     {0x108, 4, true},
                     {0x109, 12, false},     {0x109, 11, true},    {0x110, 65536, false}, {0x110, 65535, true},
                     {0x111, 41, false},     {0x111, 40, true},    {0x112, 65536, false}, {0x113, 41, false},
                     {0x114, 65536, false},  {0x115, 41, false},   {0x116, 65536, false}, {0x117, 64, false},
                     {0x122, 0, false},      {0x122, 5, false},    {0x122, 4, true},      {0x126, 5, false},
                     {0x12a, 0, false},      {0x12e, 5, false},    {0x132, 0, false},     {0x136, 8, false}};
  OWNED(fx_scene) scene = long_rays(3300);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 6}));
  for (int i = 0; i < COUNT(programming); i++) {
    ck_ok(sf_ray_dut_load(rays));
    put(rays->dut, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
    put(rays->dut, SF_CSR_ENCODER_ADDRESS, programming[i].word);
    put(rays->dut, SF_CSR_ENCODER_DATA, programming[i].value);
    put(rays->dut, SF_CSR_RAY_CTRL, SF_CSR_RAY_CTRL_START);
    const uint32_t error = programming[i].fits ? 0 : SF_CSR_RAY_ERROR_VALUE;
    ck_assert_msg(get(rays->dut, SF_CSR_RAY_ERROR) == error, "word %x, %u", programming[i].word, programming[i].value);
    ck_assert_uint_eq(get(rays->dut, SF_CSR_RAY_STATUS) & SF_CSR_RAY_STATUS_RUNNING, !error);
  }
  works(rays);
}

/* Behind a reset a size or a scale that was not programmed is an illegal one. */
TEST(missing_sizes_are_refused)
{
  static const uint32_t words[] = {0x101, 0x102, 0x103, 0x105, 0x106, 0x107, 0x108, 0x109, 0x110, 0x111, 0x112,
                                   0x113, 0x114, 0x115, 0x116, 0x117, 0x122, 0x126, 0x12a, 0x12e, 0x132, 0x136};
  OWNED(fx_scene) scene = long_rays(3350);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 9}));
  for (int i = 0; i < COUNT(words); i++) {
    reset(rays->dut);
    begin_leaving_out(rays->dut, words[i], false);
    const sf_status status = sf_ray_dut_load(rays);
    rays->dut->bus = writes.real;
    ck_assert_msg(status.code != SF_OK, "without word %x", words[i]);
    ck_assert_uint_eq(get(rays->dut, SF_CSR_RAY_ERROR), SF_CSR_RAY_ERROR_VALUE);
  }
  works(rays);
}

/* A hash grid after planes, and planes after it, in one accelerator. */
TEST(from_one_field_to_the_other)
{
  OWNED(fx_scene) planes = long_rays(3400);
  static const fixture_sizes sizes = {4, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  OWNED(fx_scene) grid = fixture_scene(&sizes, 21);
  OWNED(sf_ray_dut) *rays = NULL;
  grid.step_q24 = 1 << 20;
  ck_ok(sf_ray_dut_open(&rays, &planes, &(sf_dut_options){.seed = 7, .stall_percent = 20}));
  for (int i = 0; i < 4; i++) {
    const fx_scene *scene = i % 2 ? &grid : &planes;
    free(rays->memory.planes);
    rays->scene = scene, rays->memory.planes = NULL;
    ck_ok(sf_memory_fill(&rays->memory, scene));
    works(rays);
  }
}

static uint32_t lacking; /* fields */
static uint32_t without_a_field(void *context, uint32_t offset)
{
  const sf_bus *real = context;
  const uint32_t value = real->read(real->context, offset);
  return offset == SF_CSR_FIELD_KINDS ? value & ~lacking : value;
}
static void write_through(void *context, uint32_t offset, uint32_t value)
{
  const sf_bus *real = context;
  real->write(real->context, offset, value);
}

static void refused(sf_ray_dut *rays, const fx_scene *scene, uint32_t field)
{
  sf_bus real = rays->dut->bus;
  lacking = field;
  rays->scene = scene;
  rays->dut->bus = (sf_bus){without_a_field, write_through, &real};
  const sf_status status = sf_ray_dut_load(rays);
  rays->dut->bus = real;
  ck_assert_int_eq(status.code, SF_E_UNSUPPORTED);
  ck_assert_msg(strstr(status.message, "has not the scene's kind of field"), "%s", status.message);
}

TEST(the_driver_refuses_what_a_build_lacks)
{
  static const fixture_sizes sizes = {4, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  OWNED(fx_scene) grid = fixture_scene(&sizes, 22);
  OWNED(fx_scene) scene = long_rays(3500);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 8}));
  ck_assert_uint_eq(get(rays->dut, SF_CSR_FIELD_KINDS), SF_CSR_FIELD_KINDS_GRID | SF_CSR_FIELD_KINDS_PLANES);
  refused(rays, &grid, SF_CSR_FIELD_KINDS_GRID);
  refused(rays, &scene, SF_CSR_FIELD_KINDS_PLANES);
  scene.tensorf.features++; /* more inputs than the decoder has */
  ck_assert(strstr(sf_ray_dut_load(rays).message, "are not the net's inputs"));
  scene.tensorf.features--;
  works(rays);
}
