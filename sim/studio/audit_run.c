#include "sim/studio/audit_run.h"
#include "base/sha256.h"
#include "quant/quant.h"
#include "base/rng.h"
#include "sim/ray/three_counts.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* Streams of the random numbers of one seed. */
enum { STREAM_VIEW = 1, STREAM_X, STREAM_Y, STREAM_SUBSET };

typedef struct place {
  int view, x, y;
} place;

/* ---- rays ---- */

static uint64_t smaller(uint64_t a, uint64_t b)
{
  return a < b ? a : b;
}

/* Pixels tile by tile: tiles from left to right and top to bottom, and pixels within a tile likewise. */
static place pixel_place(const sf_camera *camera, int view, uint64_t pixel)
{
  const uint64_t width = (uint64_t)camera->width, height = (uint64_t)camera->height;
  const uint64_t top = pixel / (width * FX_TILE) * FX_TILE, high = smaller(height - top, FX_TILE);
  const uint64_t left = (pixel - top * width) / (high * FX_TILE) * FX_TILE, wide = smaller(width - left, FX_TILE);
  const uint64_t at = pixel - top * width - left * high;
  return (place){view, (int)(left + at % wide), (int)(top + at / wide)};
}

static place ray_place(const sf_audit *a, uint64_t index)
{
  const sf_camera *camera = &a->data.view[0].camera;
  if (a->opt.rays == 0) {
    const int first = a->opt.view >= 0 ? a->opt.view : 0;
    return pixel_place(camera, first + (int)(index / a->pixels), index % a->pixels);
  }
  uint64_t seed = a->opt.seed;
  int view = a->opt.view >= 0 ? a->opt.view : (int)sf_random_below(seed, STREAM_VIEW, index, (uint64_t)a->data.count);
  return (place){view, (int)sf_random_below(seed, STREAM_X, index, (uint64_t)camera->width),
                 (int)sf_random_below(seed, STREAM_Y, index, (uint64_t)camera->height)};
}

static sf_status make_ray(void *user, uint64_t index, fx_ray *ray)
{
  const sf_audit *a = user;
  place p = ray_place(a, index);
  return sf_pixel_ray(&a->scene, &a->data, &a->data.view[p.view], p.x, p.y, ray);
}

static uint64_t ray_tile(void *user, uint64_t index)
{
  const place p = ray_place(user, index);
  return (uint64_t)p.view << 40 | (uint64_t)(p.y / FX_TILE) << 20 | (uint64_t)(p.x / FX_TILE);
}

static bool tick(const sf_audit *a, const char *what, uint64_t done, uint64_t total)
{
  return !a->opt.tick || a->opt.tick(a->opt.user, what, done, total);
}

static bool core_tick(void *user, uint64_t done)
{
  const sf_audit *a = user;
  return tick(a, "core", done, a->report.rays);
}

/* ---- files ---- */

static sf_status load(sf_audit *a)
{
  sf_audit_options *o = &a->opt;
  SF_TRY(fx_scene_load(&a->scene, o->scene));
  SF_TRY(sf_sha256_file(o->scene, a->hash));
  if (o->steps) a->scene.net.steps = o->steps;
  /* Random rays come from every view unless one is named; whole views are many rays, so one is the default. */
  if (o->views == 0 && o->view < 0 && o->rays == 0) o->views = 1;
  sf_dataset_options how = {
      .downscale = o->downscale, .scale = (float)o->scale, .limit = o->view >= 0 ? o->view + 1 : o->views};
  SF_TRY(sf_fx_dataset_load(&a->data, &a->scene, o->scene, o->data, o->split, &how));
  if (o->view >= a->data.count || o->views > a->data.count)
    return sf_fail(SF_E_USAGE, "%s %d is out of range: %s has %d %s views", o->view >= 0 ? "--view" : "--views",
                   o->view >= 0 ? o->view : o->views, o->data, a->data.count, o->split);
  const sf_camera *first = &a->data.view[0].camera;
  for (int i = 1; i < a->data.count; i++)
    if (a->data.view[i].camera.width != first->width || a->data.view[i].camera.height != first->height)
      return sf_fail(SF_E_FORMAT, "%s: view %s differs in size from view %s", o->data, a->data.view[i].name,
                     a->data.view[0].name);
  a->pixels = (uint64_t)first->width * (uint64_t)first->height;
  a->report.rays = o->rays ? o->rays : a->pixels * (uint64_t)(o->view >= 0 ? 1 : a->data.count);
  sf_audit_report *r = &a->report;
  r->scene = o->scene, r->data = o->data, r->split = o->split, r->sha256 = a->hash, r->net = &a->scene.net;
  r->seed = o->seed, r->random_rays = o->rays > 0, r->three.wanted = o->rtl_rays;
  r->views = (double)r->rays / (double)a->pixels;
  return sf_ok();
}

/* ---- the rays for the accelerator ---- */

static void name_ray(void *user, uint64_t index, char *text, size_t size)
{
  const sf_audit *a = user;
  const place p = ray_place(a, index);
  snprintf(text, size, "ray %" PRIu64 " (view %s, pixel %d,%d)", index, a->data.view[p.view].name, p.x, p.y);
}

static bool rtl_tick(void *user, int done)
{
  const sf_audit *a = user;
  return tick(a, "accelerator", (uint64_t)done, (uint64_t)a->report.three.wanted);
}

static sf_status run_rtl(sf_audit *a)
{
  sf_three_counts *three = &a->report.three;
  uint64_t count = 0, *index = calloc((size_t)three->wanted + 1, sizeof *index);
  if (!index) return sf_fail(SF_E_MEMORY, "no memory for %d rays", three->wanted);
  sf_status status =
      sf_measure_choose(&a->report.measure, a->opt.seed, STREAM_SUBSET, (uint64_t)three->wanted, index, &count);
  const sf_three_job job = {.scene = &a->scene,
                            .index = index,
                            .rays = (int)count,
                            .ray = make_ray,
                            .name = name_ray,
                            .tick = rtl_tick,
                            .user = a,
                            .dut = {.seed = a->opt.seed, .stall_percent = a->opt.stall, .plusarg = a->opt.plusarg},
                            .cache = a->opt.cache,
                            .tile = ray_tile};
  if (status.code == SF_OK) status = sf_three_counts_run(&job, three);
  free(index);
  return status;
}

/* ---- a twin of its own ---- */

static void float_ray(void *user, uint64_t index, float origin[3], float direction[3])
{
  const sf_audit *a = user;
  const place p = ray_place(a, index);
  sf_dataset_ray(&a->data, &a->data.view[p.view], (float)p.x + 0.5f, (float)p.y + 0.5f, origin, direction);
}

static bool twin_tick(void *user, uint64_t done)
{
  const sf_audit *a = user;
  return tick(a, "twin", done, a->report.rays);
}

static sf_status count_twin(sf_audit *a)
{
  sf_audit_report *r = &a->report;
  if (!a->opt.twin) return sf_ok();
  const sf_twin_job job = {a->opt.twin, r->rays, float_ray, twin_tick, a};
  SF_TRY(sf_twin_count(&job, &r->twin));
  return sf_twin_price(&a->technology, r->ledgers.total[SF_LEDGER_PAPER], &r->twin);
}

/* ---- all of it ---- */

static sf_status same_rays(const sf_audit *a)
{
  char cameras[65] = "";
  const sf_space space = sf_dataset_space(&a->data);
  snprintf(cameras, sizeof cameras, "%d %d %d %x", a->data.count, a->data.downscale, space.views,
           (unsigned)space.poses);
  SF_TRY(sf_ranks_same(a->opt.ranks, "scene", a->hash));
  return sf_ranks_same(a->opt.ranks, "data set", cameras);
}

sf_status sf_audit_count(sf_audit *a)
{
  sf_audit_report *r = &a->report;
  const sf_measure_job job = {&a->scene,           r->rays,      make_ray, core_tick,   a, a->opt.seed,
                              a->opt.recount_rays, a->opt.cache, ray_tile, a->opt.ranks};
  SF_TRY(same_rays(a));
  const sf_status status = sf_measure_rays(&job, &r->measure);
  if (status.code == SF_E_DIFFERENCE) return sf_fail(status.code, "%s: %s", a->opt.scene, status.message);
  SF_TRY(status);
  if (sf_ranks_rank(a->opt.ranks)) return status;
  const fx_counts *counts = &r->measure.core;
  SF_TRY(sf_ledger_make(&a->scene.net, counts, &r->ledger));
  if (a->scene.backbone == FX_INGP) r->entries = counts->grid_bytes / FX_GRID_FEATURES;
  r->traffic = sf_traffic_of(&a->scene, counts, &r->measure.memory, r->rays);
  const sf_counted counted = {&a->scene, counts, &r->measure.memory, &r->traffic, r->cache};
  SF_TRY(sf_ledgers_make(&a->technology, &counted, &r->ledgers));
  SF_TRY(count_twin(a));
  return run_rtl(a);
}

sf_status sf_audit_open(sf_audit *audit, const sf_audit_options *options)
{
  *audit = (sf_audit){.opt = *options};
  if (!audit->opt.cache.bytes) audit->opt.cache.bytes = sf_cache_built.bytes;
  if (!audit->opt.cache.ways) audit->opt.cache.ways = sf_cache_built.ways;
  SF_TRY(fx_cache_check(&audit->opt.cache));
  audit->report.cache = audit->opt.cache;
  SF_TRY(sf_technology_find(&audit->technology, audit->opt.tech));
  return load(audit);
}

void sf_audit_close(sf_audit *audit)
{
  sf_measure_free(&audit->report.measure);
  sf_dataset_free(&audit->data);
  fx_scene_free(&audit->scene);
}
