/* Shading and exact fog along one ray. */
#include "base/rng.h"
#include "src/scene/stage.h"
#include "src/scene/vec.h"
#include <math.h>
#include <stddef.h>

static const double light[3] = {0.48, -0.36, 0.80}; /* towards the key light, exactly unit */
#define KEY 0.80
#define SKY 0.42
#define GROUND 0.20
#define SURFACE_GAP 1e-6 /* a shadow ray starts off its own surface */

/* 0..1 of the chip that holds a point: one of a lattice of cubes that stands across every face. */
static double chip(const double p[3], double side, uint64_t size)
{
  static const double turn[3][3] = {{0.66, 0.66, -0.36}, {-0.74, 0.50, -0.45}, {-0.12, 0.56, 0.82}};
  uint64_t cell[3];
  for (int i = 0; i < 3; i++) cell[i] = (uint64_t)(int64_t)floor(vec_dot(turn[i], p) / side);
  return (double)sf_random_float(cell[0], cell[1] + (size << 32), cell[2]);
}

static void terrazzo(const sf_material *m, const double p[3], double colour[3])
{
  static const double finer[3] = {1, 0.45, 0.2};
  double value[3];
  for (int i = 0; i < 3; i++) value[i] = chip(p, m->period * finer[i], (uint64_t)i);
  const double light = (0.4 + 0.6 * value[1]) * (0.6 + 0.4 * value[2]);
  for (int i = 0; i < 3; i++) colour[i] = light * m->colour[(int)(3 * value[0])][i];
}

static const double *pattern_colour(const sf_shape *shape, const sf_hit *hit)
{
  static const double white[3] = {0.94, 0.93, 0.90};
  const sf_material *m = shape->material;
  const double *p = hit->local;
  switch (m->pattern) {
  case SF_CHECKER:
    if (vec_dot(hit->normal, shape->axes + 6) < 0.5) return m->colour[2];
    return m->colour[((long)floor(p[0] / m->period) + (long)floor(p[1] / m->period)) & 1];
  case SF_STRIPES:
    return m->colour[(long)floor(p[0] / m->period) & 1];
  case SF_SECTORS: {
    if (fabs(p[2]) > 0.94 * shape->size[0]) return white;
    int sector = (int)floor((atan2(p[1], p[0]) + M_PI) * (3 / M_PI));
    return sector & 1 || sector > 5 ? white : m->colour[sector / 2];
  }
  case SF_PLAIN:
  case SF_SKY:
  case SF_TERRAZZO:
    break;
  }
  return m->colour[0];
}

/* Optical depth of all fogs from the origin to `far`. */
static double optical_depth(const sf_stage *stage, const sf_stage_ray *ray, double far)
{
  double depth = 0, enter, leave;
  for (int i = 0; i < stage->fogs; i++) {
    if (!sf_shape_interval(&stage->fog[i].region, ray, &enter, &leave)) continue;
    enter = fmax(enter, 0), leave = fmin(leave, far);
    if (leave > enter) depth += stage->fog[i].density * (leave - enter);
  }
  return depth;
}

/* Share of the key light that arrives: 0 behind a shape, dimmed exactly by fog. */
static double light_arriving(const sf_stage *stage, const double at[3], const double normal[3])
{
  sf_stage_ray ray;
  for (int i = 0; i < 3; i++) ray.origin[i] = at[i] + SURFACE_GAP * normal[i], ray.direction[i] = light[i];
  for (int i = 0; i < stage->shapes; i++) {
    sf_hit hit = {.t = INFINITY};
    if (stage->shape[i].material->pattern == SF_SKY) continue;
    if (sf_shape_near(&stage->shape[i], &ray, 0) && sf_shape_hit(&stage->shape[i], &ray, SURFACE_GAP, &hit)) return 0;
  }
  return stage->fogs ? exp(-optical_depth(stage, &ray, INFINITY)) : 1;
}

static void shade_sky(const sf_shape *sky, const sf_hit *hit, double colour[3])
{
  const double *p = hit->local, height = p[2] / sky->size[0];
  const double wave = 0.5 + 0.5 * sin(6 * atan2(p[1], p[0])) * cos(9 * height), pale = 0.6 * fmax(height, 0);
  for (int i = 0; i < 3; i++) {
    const double *low = sky->material->colour[0], *high = sky->material->colour[1];
    colour[i] = (1 - pale) * (low[i] + wave * (high[i] - low[i])) + pale;
  }
}

/* Hemisphere ambient, Lambert and Blinn-Phong in linear light; display value = square root (gamma 2). */
static void shade(const sf_stage *stage, const sf_shape *shape, const sf_stage_ray *ray, const sf_hit *hit,
                  double colour[3])
{
  if (shape->material->pattern == SF_SKY) {
    shade_sky(shape, hit, colour);
    return;
  }
  const double *albedo = pattern_colour(shape, hit), *n = hit->normal;
  double chips[3], at[3], half[3], length = 0;
  if (shape->material->pattern == SF_TERRAZZO) terrazzo(shape->material, hit->local, chips), albedo = chips;
  for (int i = 0; i < 3; i++) {
    at[i] = ray->origin[i] + hit->t * ray->direction[i];
    half[i] = light[i] - ray->direction[i];
    length += half[i] * half[i];
  }
  double facing = vec_dot(n, light);
  double key = facing > 0 ? light_arriving(stage, at, n) : 0;
  double diffuse = GROUND + (SKY - GROUND) * (0.5 + 0.5 * n[2]) + KEY * key * fmax(facing, 0);
  double shine = 0;
  if (key > 0 && shape->material->shine > 0) {
    shine = fmax(vec_dot(n, half) / sqrt(length), 0);
    for (int i = 0; i < shape->material->sharpness; i++) shine *= shine;
    shine *= shape->material->shine * key;
  }
  for (int i = 0; i < 3; i++) colour[i] = sqrt(fmin(albedo[i] * albedo[i] * diffuse + shine, 1));
}

/* Between two neighbouring boundaries the fog is homogeneous, so each piece has a closed form. */
static double add_fog(const sf_stage *stage, const sf_stage_ray *ray, double far, double rgb[3])
{
  double enter[SF_STAGE_FOGS], leave[SF_STAGE_FOGS], cut[2 * SF_STAGE_FOGS], through = 1;
  int cuts = 0;
  for (int i = 0; i < stage->fogs; i++) {
    if (!sf_shape_interval(&stage->fog[i].region, ray, &enter[i], &leave[i])) enter[i] = leave[i] = 0;
    enter[i] = fmax(enter[i], 0), leave[i] = fmin(leave[i], far);
    if (leave[i] <= enter[i]) continue;
    cut[cuts++] = enter[i], cut[cuts++] = leave[i];
  }
  for (int i = 1; i < cuts; i++)
    for (int k = i; k > 0 && cut[k] < cut[k - 1]; k--) {
      double swap = cut[k];
      cut[k] = cut[k - 1], cut[k - 1] = swap;
    }
  for (int k = 1; k < cuts; k++) {
    double middle = (cut[k - 1] + cut[k]) / 2, density = 0, glow[3] = {0};
    for (int i = 0; i < stage->fogs; i++) {
      if (middle <= enter[i] || middle >= leave[i]) continue;
      density += stage->fog[i].density;
      for (int c = 0; c < 3; c++) glow[c] += stage->fog[i].density * stage->fog[i].colour[c];
    }
    if (density <= 0) continue;
    double stopped = 1 - exp(-density * (cut[k] - cut[k - 1]));
    for (int c = 0; c < 3; c++) rgb[c] += through * stopped * glow[c] / density;
    through *= 1 - stopped;
  }
  return through;
}

void sf_stage_trace(const sf_stage *stage, const sf_stage_ray *ray, uint64_t candidates, double rgba[4])
{
  sf_hit hit = {.t = INFINITY};
  const sf_shape *nearest = NULL;
  for (uint64_t left = candidates; left; left &= left - 1) {
    const sf_shape *shape = &stage->shape[__builtin_ctzll(left)];
    if (sf_shape_hit(shape, ray, 0, &hit)) nearest = shape;
  }
  rgba[0] = rgba[1] = rgba[2] = 0;
  double through = stage->fogs ? add_fog(stage, ray, hit.t, rgba) : 1;
  if (nearest) {
    double colour[3];
    shade(stage, nearest, ray, &hit, colour);
    for (int i = 0; i < 3; i++) rgba[i] += through * colour[i];
    through = 0;
  }
  rgba[3] = 1 - through;
}
