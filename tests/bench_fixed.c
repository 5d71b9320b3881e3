/* The fixed-point core: nets at a firing rate, nets with the grid, and a whole frame beside the float ReLU twin's. */
#include "bench.h"
#include "bench_rig.h"
#include "base/memory.h"
#include "sim/ray/three_counts.h"
#include "base/clock.h"
#include "quant/quant.h"
#include "base/rng.h"
#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RIG_BLOCKS = 64, FRAME = 800, CHUNK = 1600 };
static const double RIG_RATE = 0.1;

/* Samples per second of all threads. with_grid: each block at random positions of its own. */
static double nets(const rig *r, bool with_grid, double seconds)
{
  double total = 0;
#pragma omp parallel reduction(+ : total)
  {
    fx_block *blocks = sf_aligned_alloc(RIG_BLOCKS * sizeof *blocks);
    fx_scratch *scratch = sf_aligned_alloc(sizeof *scratch);
    for (int i = 0; i < RIG_BLOCKS; i++) {
      memcpy(&blocks[i], r->block, sizeof blocks[i]);
      rig_random_positions(&blocks[i], (uint64_t)(omp_get_thread_num() * RIG_BLOCKS + i));
    }
    double start = sf_seconds(), now = start;
    long done = 0;
    for (; now - start < seconds; now = sf_seconds())
      for (int i = 0; i < RIG_BLOCKS; i++, done++) {
        if (with_grid) r->core->kernels->features(&r->scene.grid, &blocks[i]);
        r->core->kernels->nets(r->core, with_grid ? &blocks[i] : &blocks[0], scratch);
      }
    total += (double)done * FX_BLOCK / (now - start);
    free(blocks), free(scratch);
  }
  return total;
}

/* Seconds of one sample with every product dense. Inputs of D1 and C1 have 12 bits: a product counts twice as one of 16
 * bits, four times as two of bfloat16 on tiles, whichever is faster. */
static double least_seconds(const ceilings *c, int steps)
{
  const double wide = 32 * 128 + steps * 16.0 * 128, spikes = steps * (128.0 * 16 + 128 * 128 + 128 * 3);
  return fmin(2 * wide / c->dot8, 4 * wide / c->spike) + spikes / c->spike;
}

static sf_status bench_parts(cJSON *json, const ceilings *c)
{
  rig fast, slow;
  SF_TRY(rig_open(&fast, NULL, RIG_RATE));
  SF_TRY(rig_open(&slow, "portable", RIG_RATE));
  const double most = 1 / least_seconds(c, RIG_STEPS), grid = 1 / (1 / most + 128 / c->reads);
  put(json, "fixed.nets.t3.f10", nets(&fast, false, 1), "samples/s", most, nets(&slow, false, 1));
  put(json, "fixed.nets_grid.t3", nets(&fast, true, 1), "samples/s", grid, nets(&slow, true, 1));
  rig_close(&fast);
  rig_close(&slow);
  return sf_ok();
}

/* ---- a frame ---- */

typedef struct frame {
  fx_scene scene;
  fx_core *core;
  sf_dataset data;
  sf_camera camera;
  sf_model twin;
} frame;

static sf_status chunk_rays(const frame *f, size_t first, fx_ray rays[CHUNK])
{
  for (size_t i = 0; i < CHUNK; i++) {
    float origin[3], direction[3];
    sf_camera_ray(&f->camera, (float)((first + i) % FRAME) + 0.5f, (float)((first + i) / FRAME) + 0.5f, origin,
                  direction);
    SF_TRY(sf_fx_ray_make(&f->scene, origin, direction, &rays[i]));
  }
  return sf_ok();
}

/* Seconds for every `stride`-th chunk of the frame, rays included; batch: through the vector core. */
static double render_fixed(const frame *f, size_t stride, bool batch, fx_counts *counts)
{
  const double start = sf_seconds();
#pragma omp parallel for schedule(dynamic)
  for (size_t first = 0; first < FRAME * FRAME; first += CHUNK * stride) {
    fx_ray rays[CHUNK];
    fx_pixel pixel[CHUNK];
    fx_counts sum = {0};
    if (chunk_rays(f, first, rays).code) continue;
    if (batch)
      fx_render_rays(f->core, rays, CHUNK, pixel, NULL, &sum);
    else
      for (int i = 0; i < CHUNK; i++) fx_render_ray(&f->scene, &rays[i], NULL, NULL, &pixel[i], &sum);
#pragma omp critical(bench_counts)
    fx_counts_add(counts, &sum);
  }
  return sf_seconds() - start;
}

static double render_twin(const frame *f, uint64_t *taken)
{
  enum { ROWS = 8, N = ROWS * FRAME };
  static const float white[3] = {1, 1, 1};
  float *space = malloc(12 * N * sizeof *space);
  double sum = 0;
  const double start = sf_seconds();
  for (int y = 0; space && y < FRAME; y += ROWS) {
    float *origin = space, *direction = space + 3 * N, *samples = space + 11 * N;
    for (int i = 0; i < N; i++)
      sf_camera_ray(&f->camera, (float)(i % FRAME) + 0.5f, (float)(y + i / FRAME) + 0.5f, origin + 3 * i,
                    direction + 3 * i);
    if (sf_render_rays(&f->twin, origin, direction, N, 1, white, space + 6 * N, space + 9 * N, space + 10 * N, samples)
            .code)
      break;
    for (int i = 0; i < N; i++) sum += (double)samples[i];
  }
  free(space);
  *taken = (uint64_t)sum;
  return sf_seconds() - start;
}

/* ---- the audit of the frame ---- */

_Static_assert(FRAME % FX_TILE == 0, "whole tiles");
enum { RTL_RAYS = 16, RECOUNT_RAYS = 1000 }; /* the defaults of energy_audit */

/* Tile by tile. */
static sf_status frame_ray(void *user, uint64_t index, fx_ray *ray)
{
  enum { TILES = FRAME / FX_TILE, PIXELS = FX_TILE * FX_TILE };
  const frame *f = user;
  const uint64_t tile = index / PIXELS, pixel = index % PIXELS;
  const uint64_t x = tile % TILES * FX_TILE + pixel % FX_TILE, y = tile / TILES * FX_TILE + pixel / FX_TILE;
  float origin[3], direction[3];
  sf_camera_ray(&f->camera, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  return sf_fx_ray_make(&f->scene, origin, direction, ray);
}

static uint64_t frame_tile(void *user, uint64_t index)
{
  (void)user;
  return index / (FX_TILE * FX_TILE);
}

static void frame_ray_name(void *user, uint64_t index, char *text, size_t size)
{
  (void)user;
  snprintf(text, size, "ray %llu", (unsigned long long)index);
}

/* What energy_audit does but for reading the scene and printing: counts of all rays, recount and accelerator on a
 * sample of them, ledgers. */
static sf_status audit_frame(frame *f, const sf_technology *tech, const fx_counts *counts, double *seconds)
{
  uint64_t index[RTL_RAYS], n;
  sf_measure measure;
  sf_three_counts three = {.wanted = RTL_RAYS};
  sf_ledgers *ledgers = calloc(1, sizeof *ledgers);
  const sf_measure_job job = {.scene = &f->scene,
                              .rays = FRAME * FRAME,
                              .ray = frame_ray,
                              .user = f,
                              .seed = 1,
                              .check = RECOUNT_RAYS,
                              .tile = frame_tile};
  sf_three_job rtl = {.scene = &f->scene, .index = index, .ray = frame_ray, .name = frame_ray_name, .user = f};
  const double start = sf_seconds();
  sf_status status = ledgers ? sf_measure_rays(&job, &measure) : sf_fail(SF_E_MEMORY, "bench: out of memory");
  if (!status.code) status = sf_measure_choose(&measure, 1, 2, RTL_RAYS, index, &n);
  if (!status.code) rtl.rays = (int)n, status = sf_three_counts_run(&rtl, &three);
  if (!status.code) status = three.agreement;
  if (!status.code) {
    const sf_traffic traffic = sf_traffic_of(&f->scene, &measure.core, &measure.memory, FRAME * FRAME);
    const sf_counted counted = {&f->scene, &measure.core, &measure.memory, &traffic, sf_cache_built};
    status = sf_ledgers_make(tech, &counted, ledgers);
  }
  *seconds = sf_seconds() - start;
  if (!status.code && memcmp(&measure.core, counts, sizeof *counts))
    status = sf_fail(SF_E_DIFFERENCE, "bench: the audit's counts are not those of the rendering");
  free(ledgers);
  if (!status.code) sf_measure_free(&measure);
  return status;
}

static sf_status bench_audit(cJSON *json, frame *f, double rendering, const fx_counts *counts)
{
  sf_technology tech;
  double seconds;
  SF_TRY(sf_technology_load(&tech, "share/tech/45nm.tech"));
  SF_TRY(audit_frame(f, &tech, counts, &seconds));
  put(json, "audit.frame800", seconds, "s", rendering, NAN);
  printf("  its audit: %.2f times the time of the rendering (ceiling: the rendering), %d rays recounted, %d in the "
         "accelerator\n",
         seconds / rendering, RECOUNT_RAYS, RTL_RAYS);
  return sf_ok();
}

static sf_status load_frame(frame *f, const char *scene, const char *twin, const char *data)
{
  SF_TRY(fx_scene_load(&f->scene, scene));
  SF_TRY(fx_core_open(&f->core, &f->scene, NULL));
  SF_TRY(sf_model_load(&f->twin, twin));
  SF_TRY(
      sf_fx_dataset_load(&f->data, &f->scene, scene, data, "test", &(sf_dataset_options){.downscale = 1, .limit = 1}));
  f->camera = f->data.view[0].camera;
  const float zoom = (float)FRAME / (float)f->camera.width;
  f->camera.fx *= zoom, f->camera.fy *= zoom, f->camera.cx *= zoom, f->camera.cy *= zoom;
  f->camera.width = f->camera.height = FRAME;
  return sf_ok();
}

static sf_status bench_frame(cJSON *json, const ceilings *c, frame *f)
{
  enum { NAIVE_STRIDE = 20 };
  fx_counts counts = {0}, ignored = {0};
  uint64_t taken;
  const double seconds = render_fixed(f, 1, true, &counts);
  const double naive = NAIVE_STRIDE * render_fixed(f, NAIVE_STRIDE, false, &ignored);
  const double twin = render_twin(f, &taken);
  const double least = (double)counts.samples * (least_seconds(c, f->scene.net.steps) + 128 / c->reads);
  put(json, "fixed.frame800", seconds, "s", least, naive);
  put(json, "fixed.frame800.twin", twin, "s", NAN, NAN);
  printf("  frame of 800 x 800: t_r = %d, %llu samples, %llu lattice points; float ReLU twin: %llu samples, %.2f times "
         "the time\n",
         f->scene.net.steps, (unsigned long long)counts.samples, (unsigned long long)counts.march_steps,
         (unsigned long long)taken, twin / seconds);
  return bench_audit(json, f, seconds, &counts);
}

sf_status bench_fixed(cJSON *json, const ceilings *c, const char *scene, const char *twin, const char *data)
{
  SF_TRY(bench_parts(json, c));
  if (!scene) return sf_ok();
  frame f = {0};
  sf_status status = load_frame(&f, scene, twin, data);
  if (!status.code) status = bench_frame(json, c, &f);
  fx_core_close(f.core);
  fx_scene_free(&f.scene);
  sf_dataset_free(&f.data);
  sf_model_free(&f.twin);
  return status;
}
