/* Rays of the training views through the core: what they lose, cost and use. */
#include "fit/fit.h"
#include "base/rng.h"
#include <stdlib.h>
#include <string.h>

enum { STREAM_VIEW = 201, STREAM_X, STREAM_Y, STREAM_TILE, BLOCK = 256, FEW = 512, OPAQUE = 65535 };
enum { TILE_RAYS = FX_TILE * FX_TILE };

/* ---- rays ---- */

void sf_fit_rays_free(sf_fit_rays *rays)
{
  free(rays->origin), free(rays->direction), free(rays->target);
  memset(rays, 0, sizeof *rays);
}

/* Straight alpha over the background, rounded to the nearest of 0..65535. */
static void set_target(const sf_view *view, int x, int y, const int32_t background[3], uint32_t *target)
{
  const uint16_t *p = view->image.rgba + 4 * ((size_t)y * (size_t)view->image.width + (size_t)x);
  for (int c = 0; c < 3; c++) {
    const uint64_t behind = background[c] > OPAQUE ? OPAQUE : (uint64_t)background[c];
    target[c] = (uint32_t)(((uint64_t)p[c] * p[3] + behind * (OPAQUE - (uint64_t)p[3]) + OPAQUE / 2) / OPAQUE);
  }
}

static void draw_ray(sf_fit_rays *rays, const sf_dataset *data, const int32_t background[3], uint64_t i, uint64_t seed)
{
  const sf_view *view = &data->view[sf_random_below(seed, STREAM_VIEW, i, (uint64_t)data->count)];
  const int x = (int)sf_random_below(seed, STREAM_X, i, (uint64_t)view->camera.width);
  const int y = (int)sf_random_below(seed, STREAM_Y, i, (uint64_t)view->camera.height);
  sf_dataset_ray(data, view, (float)x + 0.5f, (float)y + 0.5f, rays->origin + 3 * i, rays->direction + 3 * i);
  set_target(view, x, y, background, rays->target + 3 * i);
}

sf_status sf_fit_rays_draw(sf_fit_rays *rays, const sf_dataset *data, const int32_t background[3], uint64_t count,
                           uint64_t seed)
{
  memset(rays, 0, sizeof *rays);
  if (data->count < 1) return sf_fail(SF_E_FORMAT, "%s: no training views", data->path);
  for (int v = 0; v < data->count; v++) {
    const sf_view *view = &data->view[v];
    if (!view->image.rgba)
      return sf_fail(SF_E_FORMAT, "%s: view %s has no picture to compare with", data->path, view->name);
    rays->pixels += (double)view->camera.width * view->camera.height / data->count;
  }
  rays->count = count;
  rays->origin = calloc(count, 3 * sizeof(float));
  rays->direction = calloc(count, 3 * sizeof(float));
  rays->target = calloc(count, 3 * sizeof(uint32_t));
  if (!rays->origin || !rays->direction || !rays->target) {
    sf_fit_rays_free(rays);
    return sf_fail(SF_E_MEMORY, "fit: no memory for %llu rays", (unsigned long long)count);
  }
  for (uint64_t i = 0; i < count; i++) draw_ray(rays, data, background, i, seed);
  return sf_ok();
}

static int inside(int at, int size)
{
  return at < size ? at : size - 1;
}

static void draw_tile(sf_fit_rays *rays, const sf_dataset *data, uint64_t tile, uint64_t seed)
{
  const sf_view *view = &data->view[sf_random_below(seed, STREAM_TILE, 3 * tile, (uint64_t)data->count)];
  const int width = view->camera.width, height = view->camera.height;
  const uint64_t across = (uint64_t)(width + FX_TILE - 1) / FX_TILE, down = (uint64_t)(height + FX_TILE - 1) / FX_TILE;
  const int left = FX_TILE * (int)sf_random_below(seed, STREAM_TILE, 3 * tile + 1, across);
  const int top = FX_TILE * (int)sf_random_below(seed, STREAM_TILE, 3 * tile + 2, down);
  for (int i = 0; i < TILE_RAYS; i++) {
    const size_t at = 3 * (tile * TILE_RAYS + (uint64_t)i);
    const int x = inside(left + i % FX_TILE, width), y = inside(top + i / FX_TILE, height);
    sf_dataset_ray(data, view, (float)x + 0.5f, (float)y + 0.5f, rays->origin + at, rays->direction + at);
  }
}

sf_status sf_fit_tiles_draw(sf_fit_rays *rays, const sf_dataset *data, uint64_t tiles, uint64_t seed)
{
  memset(rays, 0, sizeof *rays);
  if (data->count < 1) return sf_fail(SF_E_FORMAT, "%s: no training views", data->path);
  rays->count = tiles * TILE_RAYS;
  rays->origin = calloc(rays->count, 3 * sizeof(float));
  rays->direction = calloc(rays->count, 3 * sizeof(float));
  if (!rays->origin || !rays->direction) {
    sf_fit_rays_free(rays);
    return sf_fail(SF_E_MEMORY, "fit: no memory for %llu tiles", (unsigned long long)tiles);
  }
  for (uint64_t i = 0; i < tiles; i++) draw_tile(rays, data, i, seed);
  return sf_ok();
}

static sf_status make_ray(const fx_scene *scene, const sf_fit_rays *rays, uint64_t i, fx_ray *ray)
{
  return sf_fx_ray_make(scene, rays->origin + 3 * i, rays->direction + 3 * i, ray);
}

/* ---- loss and cost ---- */

static void compare_pixel(const fx_pixel *pixel, const uint32_t target[3], uint32_t *picture, sf_fit_sum *sum)
{
  uint32_t rgba[4];
  fx_pixel_rgba(pixel, rgba);
  for (int c = 0; c < 3; c++) {
    const int64_t d = (int64_t)rgba[c] - target[c];
    sum->error += (uint64_t)(d * d);
  }
  if (picture) memcpy(picture, rgba, 3 * sizeof *rgba);
}

/* Rays at..end-1, at most BLOCK. */
static sf_status measure_block(const fx_core *core, const fx_scene *scene, const sf_fit_rays *rays, uint64_t at,
                               uint64_t end, uint32_t *picture, sf_fit_sum *sum)
{
  fx_ray ray[BLOCK] = {0};
  fx_pixel pixel[BLOCK];
  const uint64_t n = end - at;
  for (uint64_t i = 0; i < n; i++) SF_TRY(make_ray(scene, rays, at + i, &ray[i]));
  SF_TRY(fx_render_rays(core, ray, n, pixel, NULL, &sum->counts));
  for (uint64_t i = 0; i < n; i++)
    compare_pixel(&pixel[i], rays->target + 3 * (at + i), picture ? picture + 3 * i : NULL, sum);
  return sf_ok();
}

static void keep_first(sf_status *all, const sf_status *one)
{
#pragma omp critical(sf_fit_failure)
  if (all->code == SF_OK) *all = *one;
}

sf_status sf_fit_measure(const fx_scene *scene, const sf_fit_rays *rays, uint64_t begin, uint64_t end,
                         uint32_t *picture, sf_fit_sum *sum)
{
  sf_status all = sf_ok();
  fx_core *core;
  memset(sum, 0, sizeof *sum);
  SF_TRY(fx_core_open(&core, scene, NULL));
#pragma omp parallel if (end - begin > FEW) /* few rays are done before the threads have met */
  {
    sf_fit_sum part = {0};
#pragma omp for schedule(dynamic)
    for (uint64_t at = begin; at < end; at += BLOCK) {
      const uint64_t stop = at + BLOCK < end ? at + BLOCK : end;
      const sf_status status =
          measure_block(core, scene, rays, at, stop, picture ? picture + 3 * (at - begin) : NULL, &part);
      if (status.code != SF_OK) keep_first(&all, &status);
    }
#pragma omp critical(sf_fit_merge)
    {
      sum->error += part.error;
      fx_counts_add(&sum->counts, &part.counts);
    }
  }
  fx_core_close(core);
  return all;
}

/* ---- field ---- */

static sf_status measure_tile(const fx_core *core, const fx_scene *scene, const sf_fit_rays *rays, uint64_t first,
                              const fx_cache_shape *shape, fx_memory_counts *memory, fx_counts *counts)
{
  fx_ray ray[TILE_RAYS];
  fx_pixel pixel[TILE_RAYS];
  const uint64_t tile[TILE_RAYS] = {0};
  fx_memory cache;
  SF_TRY(fx_memory_open(&cache, scene, shape));
  sf_status status = sf_ok();
  for (uint64_t i = 0; i < TILE_RAYS && status.code == SF_OK; i++) status = make_ray(scene, rays, first + i, &ray[i]);
  fx_memory_begin(&cache);
  if (status.code == SF_OK) status = fx_render_list(core, &cache, tile, ray, TILE_RAYS, pixel, NULL, counts);
  fx_memory_counts_add(memory, &cache.counts);
  fx_memory_close(&cache);
  return status;
}

/* All tiles with one cache. */
static sf_status measure_tiles(const fx_core *core, const fx_scene *scene, const sf_fit_rays *tiles,
                               const fx_cache_shape *shape, fx_memory_counts *memory, fx_counts *counts)
{
  sf_status all = sf_ok();
#pragma omp parallel
  {
    fx_memory_counts part = {0};
    fx_counts part_counts = {0};
#pragma omp for schedule(dynamic)
    for (uint64_t first = 0; first < tiles->count; first += TILE_RAYS) {
      const sf_status status = measure_tile(core, scene, tiles, first, shape, &part, &part_counts);
      if (status.code != SF_OK) keep_first(&all, &status);
    }
#pragma omp critical(sf_fit_merge)
    {
      fx_memory_counts_add(memory, &part);
      fx_counts_add(counts, &part_counts);
    }
  }
  return all;
}

sf_status sf_fit_measure_field(const fx_scene *scene, const sf_fit_rays *tiles, const fx_cache_shape *shapes, int n,
                               sf_fit_field *field, uint64_t *misses)
{
  fx_core *core;
  SF_TRY(fx_core_open(&core, scene, NULL));
  sf_status status = sf_ok();
  for (int i = 0; i < n && status.code == SF_OK; i++) {
    fx_memory_counts memory = {0};
    memset(field, 0, sizeof *field);
    status = measure_tiles(core, scene, tiles, &shapes[i], &memory, &field->counts);
    field->lookups = memory.lookups, misses[i] = memory.misses;
  }
  fx_core_close(core);
  return status;
}

/* ---- use ---- */

/* What a sample of a ray is seen by. */
typedef struct observer {
  const fx_scene *scene;
  const fx_ray *ray;
  bool places;
  fx_trace *trace;
  sf_trim_use *use;
} observer;

/* Both: fx_render_ray, with a look at what every sample uses. n: the lattice point; true: the ray ends. */
static bool observe_grid(const observer *o, int32_t n, const uint32_t pos[3], int32_t *base, fx_pixel *pixel)
{
  const fx_scene *scene = o->scene;
  int16_t f[FX_LEVELS_MAX * FX_GRID_FEATURES];
  fx_out out;
  const uint32_t before = pixel->transmittance;
  fx_grid_features(&scene->grid, pos, f, NULL);
  fx_net_sample(&scene->net, f, base, &out, o->trace, NULL);
  fx_composite_add(pixel, &out, fx_delta(scene, n), 0);
  sf_trim_use_net(o->use, &scene->net, f, o->trace);
  if (o->places) sf_trim_use_place(o->use, scene, pos, fx_march_cell(scene, o->ray, n), before - pixel->transmittance);
  return pixel->samples >= (uint32_t)scene->max_samples;
}

static bool observe_planes(const observer *o, int32_t n, const uint32_t pos[3], int32_t *base, fx_pixel *pixel)
{
  const fx_scene *scene = o->scene;
  int16_t x[SF_DIR_MAX];
  fx_out out;
  const uint32_t sigma = fx_tensorf_density(&scene->tensorf, pos, NULL);
  const uint32_t weight = fx_composite_weight(pixel, sigma, fx_delta(scene, n), 0);
  sf_trim_use_factors(o->use, &scene->tensorf, SF_OF_DENSITY, pos, weight);
  if (o->places) sf_trim_use_place(o->use, scene, pos, fx_march_cell(scene, o->ray, n), weight);
  if (weight <= (uint32_t)scene->tensorf.weight_stop) return false;
  sf_trim_use_factors(o->use, &scene->tensorf, SF_OF_APPEARANCE, pos, weight);
  fx_tensorf_encode(&scene->tensorf, pos, o->ray->unit, x, NULL);
  fx_net_direction(&scene->net, x, base, NULL);
  fx_net_sample(&scene->net, NULL, base, &out, o->trace, NULL);
  fx_composite_colour(pixel, weight, out.colour);
  sf_trim_use_net(o->use, &scene->net, x, o->trace);
  return pixel->samples >= (uint32_t)scene->max_samples;
}

static sf_status observe_ray(const fx_scene *scene, const sf_fit_rays *rays, uint64_t i, bool places, fx_trace *trace,
                             sf_trim_use *use)
{
  const bool planes = scene->backbone == FX_TENSORF;
  fx_ray ray;
  const observer o = {scene, &ray, places, trace, use};
  fx_pixel pixel;
  int32_t base[SF_LANES];
  uint32_t pos[3];
  SF_TRY(make_ray(scene, rays, i, &ray));
  fx_composite_begin(&pixel);
  if (!planes) fx_net_direction(&scene->net, ray.dir, base, NULL);
  for (int32_t n = fx_march_next(scene, &ray, 0, pos, NULL); n >= 0; n = fx_march_next(scene, &ray, n + 1, pos, NULL)) {
    const bool full = planes ? observe_planes(&o, n, pos, base, &pixel) : observe_grid(&o, n, pos, base, &pixel);
    if (full || pixel.transmittance <= (uint32_t)scene->trans_stop) break;
  }
  return sf_ok();
}

sf_status sf_fit_observe(const fx_scene *scene, const sf_fit_rays *rays, uint64_t begin, uint64_t end, bool places,
                         sf_trim_use *use)
{
  sf_status all = sf_ok();
#pragma omp parallel
  {
    fx_trace *trace = malloc(sizeof *trace);
    const sf_status no_memory = sf_fail(SF_E_MEMORY, "fit: no memory for a trace");
#pragma omp for schedule(dynamic, 16)
    for (uint64_t i = begin; i < end; i++) {
      const sf_status status = trace ? observe_ray(scene, rays, i, places, trace, use) : no_memory;
      if (status.code != SF_OK) keep_first(&all, &status);
    }
    free(trace);
  }
  return all;
}
