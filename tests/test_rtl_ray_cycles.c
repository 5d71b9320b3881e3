/* The cycle model of TensoRF's rays against sf_ray_top, to the cycle: lines that are found in the cache or come from a
 * memory of constant latency, tiles, rays that end early or are empty, decoders that the field waits for. */
#include "ck_run.h"
#include "cycles/planes.h"
#include "sim/ray/ray.h"
#include "tests/dut_fixture.h"
#include "tests/random_planes.h"

enum { RAYS = 24, TILES = 3, TILE_RAYS = RAYS / TILES };
static const fx_cache_shape cache = {SF_CACHE_BYTES, SF_CACHE_WAYS};

static fx_ray ray[RAYS];
static sf_ray_sample sample[RAYS][SF_RAY_SAMPLES_MAX];
static sf_ray_request request[RAYS];
static fx_pixel pixel[RAYS];
static fx_counts core;
static sf_planes_record record[TILES];

/* The samples that the core reads; some rays have none. */
static void draw_rays(const fx_scene *scene, uint64_t seed)
{
  for (uint64_t i = 0; i < RAYS; i++) {
    ray[i] = random_ray(scene, seed, i);
    if (i % 5 == 4) ray[i].count = 0; /* misses the box */
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &pixel[i], &core));
    request[i] = sf_ray_request_as(scene, &ray[i], &pixel[i], sample[i]);
    request[i].stops = false, request[i].new_tile = i % TILE_RAYS == 0;
    ck_ok(sf_planes_record_ray(&record[i / TILE_RAYS], scene, &ray[i]));
  }
}

static uint64_t cycles_of(sf_ray_dut *rays, int n)
{
  const uint64_t begin = sf_dut_cycle(rays->dut);
  ck_ok(sf_ray_dut_run(rays, request, n, pixel));
  return sf_dut_cycle(rays->dut) - begin;
}

static void compare(const fx_scene *scene, uint64_t seed, int latency)
{
  OWNED(sf_ray_dut) *rays = NULL;
  sf_planes_model *model;
  fx_counts counts;
  sf_field_counters field;
  uint64_t active;
  draw_rays(scene, seed);
  ck_ok(sf_ray_dut_open(&rays, scene, &(sf_dut_options){.seed = seed, .memory_latency = latency}));
  const uint64_t around = cycles_of(rays, 0), cycles = cycles_of(rays, RAYS) - around;
  ck_ok(sf_dut_counts(rays->dut, &counts, &active, NULL, NULL));
  ck_ok(sf_ray_dut_field(rays, &field));
  ck_ok(sf_planes_model_open(&model, scene, &sf_engine_default, &cache, latency));
  for (int i = 0; i < TILES; i++) sf_planes_model_add(model, &record[i], true), sf_planes_record_free(&record[i]);
  sf_planes_model_drain(model);
  const sf_planes_totals *t = sf_planes_model_totals(model);
  const sf_cycle_totals *engine = sf_planes_model_engine(model);
  ck_assert_uint_eq(t->rays, RAYS);
  ck_assert_uint_eq(t->densities, core.field_samples);
  ck_assert_uint_eq(t->decoded, core.samples);
  ck_assert_uint_eq(t->lookups, field.lookups);
  ck_assert_uint_eq(t->misses, field.misses);
  ck_assert_uint_eq(engine->samples, core.samples);
  ck_assert_uint_eq(engine->cycles, active);
  for (int l = 0; l < SF_LAYERS; l++) ck_assert_uint_eq(engine->busy[l], sf_dut_layer_busy(rays->dut)[l]);
  ck_assert_uint_eq(t->cycles, cycles);
  sf_planes_model_close(model);
}

LOOP_TEST(random_fields_to_the_cycle, 60)
{
  static const int latency[] = {1, 2, 20, 64, 150};
  const uint64_t seed = 5000 + (uint64_t)_i;
  OWNED(fx_scene) scene = make_planes(seed, _i % 3 > 0, 0);
  compare(&scene, seed, latency[_i % (int)COUNT(latency)]);
}

/* Of 64 components per pair, so that the queue of look-ups is full; and of so few lines that sets meet in the tags. */
LOOP_TEST(many_lines_and_few, 8)
{
  const uint64_t seed = 5200 + (uint64_t)_i;
  OWNED(fx_scene) scene = make_planes(seed, true, _i % 2 ? FX_COMPONENTS_MAX : 1);
  compare(&scene, seed, _i < 4 ? 1 : 200);
}

/* Everything is decoded, so that the decoder is what a frame waits for; or all of it is dark, and items wait. */
LOOP_TEST(all_and_none_decoded, 8)
{
  const uint64_t seed = 5300 + (uint64_t)_i;
  OWNED(fx_scene) scene = make_planes(seed, true, 0);
  scene.tensorf.weight_stop = _i % 2 ? 0 : 1 << 19, scene.trans_stop = 1;
  scene.max_samples = 1024, scene.net.steps = 1 + _i;
  compare(&scene, seed, 10);
}
