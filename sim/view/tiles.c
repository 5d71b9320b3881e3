/* Tiles of a picture, by each of its sources. */
#include "sim/view/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static size_t pixels_of(const sf_tile *tile)
{
  return (size_t)tile->across * (size_t)tile->down;
}

static void place_of(const sf_tile *tile, size_t i, int *x, int *y)
{
  *x = tile->x + (int)(i % (size_t)tile->across) * tile->stride;
  *y = tile->y + (int)(i / (size_t)tile->across) * tile->stride;
}

/* ---- fixed ---- */

enum { BLOCK = 1024 }; /* rays of one call: enough to fill the core's blocks, few enough to share out */

typedef struct drawing {
  sf_viewer *v;
  const sf_sight *sight;
  const fx_scene *scene;
  const fx_core *core;
  int map;
  sf_tile *tile;
} drawing;

static void put_pixel(const drawing *d, size_t i, const fx_pixel *pixel)
{
  uint32_t rgba[4];
  fx_pixel_rgba(pixel, rgba);
  for (size_t c = 0; c < 3; c++) d->tile->rgb[3 * i + c] = (float)rgba[c] / 65535;
}

static sf_status make_ray(const drawing *d, size_t i, fx_ray *ray)
{
  int x, y;
  place_of(d->tile, i, &x, &y);
  return sf_pixel_ray(d->scene, &d->sight->data, &d->sight->view, x, y, ray);
}

typedef struct block {
  fx_ray ray[BLOCK];
  fx_pixel pixel[BLOCK];
  fx_cost cost[BLOCK];
} block;

/* Pixels from..end together. */
static sf_status draw_block(const drawing *d, size_t from, size_t end, block *b, fx_counts *counts)
{
  for (size_t i = from; i < end; i++) SF_TRY(make_ray(d, i, &b->ray[i - from]));
  SF_TRY(fx_render_rays(d->core, b->ray, end - from, b->pixel, b->cost, counts));
  for (size_t i = from; i < end; i++) {
    put_pixel(d, i, &b->pixel[i - from]);
    if (d->tile->value) d->tile->value[i] = (float)sf_map_of_cost(d->map, &b->pixel[i - from], &b->cost[i - from]);
  }
  return sf_ok();
}

static sf_status draw_together(const drawing *d)
{
  const size_t n = pixels_of(d->tile);
  const size_t size = n > 8 * BLOCK ? BLOCK : BLOCK / 8;
  sf_status failed = sf_ok();
#pragma omp parallel for schedule(dynamic)
  for (size_t from = 0; from < n; from += size) {
    fx_counts counts = {0};
    block *b = malloc(sizeof *b);
    const sf_status status = b ? draw_block(d, from, from + size < n ? from + size : n, b, &counts)
                               : sf_fail(SF_E_MEMORY, "no memory for %d rays", BLOCK);
    free(b);
#pragma omp critical(sf_view_tile)
    {
      if (status.code != SF_OK) failed = status;
      fx_counts_add(&d->tile->counts, &counts);
    }
  }
  return failed;
}

/* The view's tiles that lie in this one, ray by ray. */
static sf_status draw_list(const drawing *d, int left, fx_memory *memory, fx_counts *sum)
{
  const sf_tile *t = d->tile;
  const int right = left + FX_TILE < t->x + t->across * t->stride ? left + FX_TILE : t->x + t->across * t->stride;
  fx_memory_begin(memory);
  for (int y = 0; y < t->down; y++)
    for (int x = (left - t->x) / t->stride; x * t->stride + t->x < right; x++) {
      const size_t i = (size_t)y * (size_t)t->across + (size_t)x;
      const uint64_t tile = sf_tile_number(t->x + x * t->stride, t->y + y * t->stride);
      fx_memory_counts own = memory->counts;
      fx_counts counts = {0};
      fx_pixel pixel;
      fx_ray ray;
      SF_TRY(make_ray(d, i, &ray));
      SF_TRY(fx_render_list(d->core, memory, &tile, &ray, 1, &pixel, NULL, &counts));
      own = (fx_memory_counts){memory->counts.lookups - own.lookups,
                               memory->counts.misses - own.misses,
                               memory->counts.groups - own.groups,
                               {memory->counts.rows[0] - own.rows[0], memory->counts.rows[1] - own.rows[1],
                                memory->counts.rows[2] - own.rows[2]}};
      put_pixel(d, i, &pixel);
      t->value[i] =
          t->stride > 1 && sf_map_lists(d->map) ? NAN : (float)sf_map_of_counts(d->v, d->scene, d->map, &counts, &own);
      fx_counts_add(sum, &counts);
    }
  return sf_ok();
}

/* Ray by ray, because events of single rays are wanted. A tile of the page is one row of tiles of the view. */
static sf_status draw_apart(const drawing *d)
{
  const sf_tile *t = d->tile;
  const int first = t->x / FX_TILE, last = (t->x + (t->across - 1) * t->stride) / FX_TILE;
  sf_status failed = sf_ok();
#pragma omp parallel for schedule(dynamic)
  for (int i = first; i <= last; i++) {
    const int left = i * FX_TILE < t->x ? t->x : t->x + (i * FX_TILE - t->x + t->stride - 1) / t->stride * t->stride;
    fx_memory memory;
    fx_counts counts = {0};
    sf_status status = fx_memory_open(&memory, d->scene, &sf_cache_built);
    if (status.code == SF_OK) status = draw_list(d, left, &memory, &counts);
    fx_memory_close(&memory);
#pragma omp critical(sf_view_tile)
    {
      if (status.code != SF_OK) failed = status;
      fx_counts_add(&d->tile->counts, &counts);
    }
  }
  return failed;
}

/* ---- other sources ---- */

sf_status sf_tile_float(sf_viewer *v, const sf_sight *sight, sf_tile *tile)
{
  const size_t n = pixels_of(tile);
  float *space = calloc(n * 9, sizeof *space), background[3];
  if (!space) return sf_fail(SF_E_MEMORY, "no memory for a tile");
  float *origin = space, *direction = origin + 3 * n, *depth = direction + 3 * n, *alpha = depth + n,
        *samples = alpha + n;
  for (int c = 0; c < 3; c++) background[c] = (float)v->fixed.scene.background[c] / 65536;
  for (size_t i = 0; i < n; i++) {
    int x, y;
    place_of(tile, i, &x, &y);
    sf_dataset_ray(&sight->data, &sight->view, (float)x + 0.5f, (float)y + 0.5f, origin + 3 * i, direction + 3 * i);
  }
  const sf_status status =
      sf_render_rays(&v->real.model, origin, direction, n, sight->steps, background, tile->rgb, depth, alpha, samples);
  for (size_t i = 0; i < n && status.code == SF_OK; i++) {
    if (tile->value) tile->value[i] = samples[i];
    tile->counts.samples += (uint64_t)samples[i], tile->counts.rays += samples[i] > 0;
  }
  free(space);
  return status;
}

static sf_status rtl_of(sf_viewer *v, int steps)
{
  if (v->rtl.scene_sha256[0] && v->rtl.scene.net.steps == steps) return sf_ok();
  const sf_studio_options how = {.backend = SF_BACKEND_RTL, .scene = v->options.scene, .steps = steps, .seed = 1};
  if (v->rtl.scene_sha256[0]) sf_studio_close(&v->rtl);
  const sf_status status = sf_studio_open(&v->rtl, &how);
  if (status.code != SF_OK) sf_studio_close(&v->rtl);
  return status;
}

/* The accelerator's pixels; one that differs from the core's, which sf_golden_rtl reports, is marked. */
static sf_status rtl_pixels(sf_viewer *v, const sf_sight *sight, sf_tile *tile)
{
  SF_TRY(rtl_of(v, sight->steps));
  for (size_t i = 0; i < pixels_of(tile); i++) {
    sf_golden golden;
    sf_golden_job job = {.scene = &v->rtl.scene, .data = &sight->data, .view = &sight->view};
    place_of(tile, i, &job.window.x, &job.window.y);
    job.window.width = job.window.height = 1;
    SF_TRY(sf_golden_create(&golden, 1, 1, SF_PLANES));
    const sf_status status = sf_golden_rtl(&job, v->rtl.rays, &golden);
    for (size_t c = 0; c < 3; c++)
      tile->rgb[3 * i + c] = status.code == SF_OK ? *sf_golden_real(&golden, SF_PLANE_R + (int)c) : NAN;
    if (tile->value) tile->value[i] = status.code == SF_OK ? (float)*sf_golden_int(&golden, SF_PLANE_SAMPLES) : NAN;
    fx_counts_add(&tile->counts, &golden.counts);
    sf_golden_free(&golden);
    if (status.code != SF_OK && status.code != SF_E_DIFFERENCE) return status;
  }
  return sf_ok();
}

sf_status sf_tile_rtl(sf_viewer *v, const sf_sight *sight, sf_tile *tile)
{
  pthread_mutex_lock(&v->rtl_turn);
  const sf_status status = rtl_pixels(v, sight, tile);
  pthread_mutex_unlock(&v->rtl_turn);
  return status;
}

static sf_status photo_pixels(sf_viewer *v, const sf_sight *sight, sf_tile *tile)
{
  const sf_shot *shot;
  if (sight->index < 0) return sf_fail(SF_E_RANGE, "a photograph is there of the data set's views alone");
  SF_TRY(sf_viewer_photo(v, sight->index, &shot));
  const sf_image *image = &shot->view->image;
  if (!image->rgba) return sf_fail(SF_E_RANGE, "view %s has no picture", shot->view->name);
  for (size_t i = 0; i < pixels_of(tile); i++) {
    int x, y;
    place_of(tile, i, &x, &y);
    const uint16_t *p = image->rgba + 4 * ((size_t)y * (size_t)image->width + (size_t)x);
    const float alpha = (float)p[3] / 65535;
    for (size_t c = 0; c < 3; c++)
      tile->rgb[3 * i + c] = (float)p[c] / 65535 * alpha + (float)v->fixed.scene.background[c] / 65536 * (1 - alpha);
    if (tile->value) tile->value[i] = NAN;
  }
  return sf_ok();
}

sf_status sf_tile_photo(sf_viewer *v, const sf_sight *sight, sf_tile *tile)
{
  pthread_mutex_lock(&v->photo_turn);
  const sf_status status = photo_pixels(v, sight, tile);
  pthread_mutex_unlock(&v->photo_turn);
  return status;
}

/* ---- with a map ---- */

static sf_status compare(sf_viewer *v, const sf_sight *sight, int map, sf_tile *tile)
{
  const size_t n = pixels_of(tile);
  sf_tile other = *tile;
  other.value = NULL, other.counts = (fx_counts){0};
  other.rgb = malloc(3 * n * sizeof *other.rgb);
  if (!other.rgb) return sf_fail(SF_E_MEMORY, "no memory for a tile");
  const sf_status status = map == SF_MAP_PHOTO   ? sf_tile_photo(v, sight, &other)
                           : map == SF_MAP_FLOAT ? sf_tile_float(v, sight, &other)
                                                 : sf_tile_rtl(v, sight, &other);
  for (size_t i = 0; i < n && status.code == SF_OK; i++) {
    float most = 0;
    for (size_t c = 0; c < 3; c++) most = fmaxf(most, fabsf(tile->rgb[3 * i + c] - other.rgb[3 * i + c]));
    tile->value[i] = isnan(other.rgb[3 * i]) ? 255 : 255 * most;
  }
  free(other.rgb);
  return status;
}

sf_status sf_tile_fixed(sf_viewer *v, const sf_sight *sight, int map, sf_tile *tile)
{
  fx_core *core;
  SF_TRY(sf_viewer_core(v, sight->steps, &core));
  const drawing d = {v, sight, &v->at[sight->steps - 1], core, map, tile};
  if (sf_map_counts(map)) return draw_apart(&d);
  SF_TRY(draw_together(&d));
  return map >= SF_MAP_PHOTO ? compare(v, sight, map, tile) : sf_ok();
}
