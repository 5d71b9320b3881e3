/* The cycle model of TensoRF's rays against sf_ray_top: to the cycle, whether lines are found in the cache or come from a
 * memory of constant latency. */
#include "ck_run.h"
#include "cycles/planes.h"
#include "sim/ray/ray.h"
#include "tests/dut_fixture.h"
#include "tests/random_planes.h"

enum { RAYS = 24 };

static fx_ray ray[RAYS];
static sf_ray_sample sample[RAYS][SF_RAY_SAMPLES_MAX];
static sf_ray_request request[RAYS];
static fx_pixel pixel[RAYS];
static sf_planes_record record;

/* The samples that the core reads; some rays have none. */
static void draw_rays(const fx_scene *scene, uint64_t seed)
{
  record = (sf_planes_record){.at = NULL};
  for (uint64_t i = 0; i < RAYS; i++) {
    ray[i] = random_ray(scene, seed, i);
    if (i % 5 == 4) ray[i].count = 0; /* misses the box */
    fx_pixel core;
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &core, NULL));
    request[i] = sf_ray_request_as(scene, &ray[i], &core, sample[i]);
    request[i].stops = false, request[i].new_tile = i == 0;
    ck_ok(sf_planes_record_ray(&record, scene, &ray[i]));
  }
}

static uint64_t cycles_of(sf_ray_dut *rays, int n)
{
  const uint64_t begin = sf_dut_cycle(rays->dut);
  ck_ok(sf_ray_dut_run(rays, request, n, pixel));
  return sf_dut_cycle(rays->dut) - begin;
}

static void compare(uint64_t seed, bool tame, int latency)
{
  OWNED(fx_scene) scene = make_planes(seed, tame, 0);
  OWNED(sf_ray_dut) *rays = NULL;
  sf_planes_model *model;
  fx_counts counts;
  uint64_t active;
  draw_rays(&scene, seed);
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = seed, .memory_latency = latency}));
  const uint64_t none = cycles_of(rays, 0), cycles = cycles_of(rays, RAYS) - none;
  ck_ok(sf_dut_counts(rays->dut, &counts, &active, NULL, NULL));
  ck_ok(sf_planes_model_open(&model, &scene, &sf_engine_default, &(fx_cache_shape){SF_CACHE_BYTES, SF_CACHE_WAYS}, latency));
  sf_planes_model_add(model, &record, true);
  sf_planes_model_drain(model);
  const sf_planes_totals *t = sf_planes_model_totals(model);
  fprintf(stderr, "seed %d lat %d: rtl %d model %d (%+.2f%%) active %d/%d dens %d dec %d/%d lookups %d misses %d\n", (int)seed, latency, (int)cycles, (int)t->cycles,
   100.0*((double)t->cycles-(double)cycles)/(double)cycles, (int)active, (int)sf_planes_model_engine(model)->cycles, (int)t->densities, (int)t->decoded, (int)counts.samples, (int)t->lookups, (int)t->misses);
  sf_planes_model_close(model);
  sf_planes_record_free(&record);
}

LOOP_TEST(frames, 20)
{
  compare(5000 + (uint64_t)_i, _i % 3 > 0, 1 + _i % 4 * 20);
}

