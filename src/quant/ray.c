/* A ray in model units to the integer lattice of the box: the same lattice as sf_ray_lattice, in double precision. */
#include "quant/quant.h"
#include "snn/model.h"
#include <math.h>
#include <string.h>

static const double COUNT_MAX = 1 << 20; /* a step of one LSB would need 2^24: no scene has that */

typedef struct interval {
  double enter, leave; /* model units */
} interval;

/* The box is [0,1)^3 in box units: origin o, direction d per model unit of distance. */
static interval clip_to_box(const fx_scene *scene, const double o[3], const double d[3])
{
  const bool vm = scene->backbone == FX_TENSORF;
  interval hit = {vm ? scene->units.near : SF_NEAR, vm ? scene->units.far : INFINITY};
  for (int axis = 0; axis < 3; axis++) {
    if (d[axis] == 0) {
      if (o[axis] <= 0 || o[axis] >= 1) return (interval){0, -1};
      continue;
    }
    const double a = -o[axis] / d[axis], b = (1 - o[axis]) / d[axis];
    hit.enter = fmax(hit.enter, fmin(a, b));
    hit.leave = fmin(hit.leave, fmax(a, b));
  }
  return hit;
}

/* Box units of an axis over those of the longest. */
static double stretch(const fx_scene *scene, int axis)
{
  return scene->backbone == FX_TENSORF ? scene->units.stretch[axis] : 1;
}

static bool inside(const fx_scene *scene, const fx_ray *ray, int32_t n)
{
  for (int axis = 0; axis < 3; axis++) {
    const int64_t p = fx_ray_at(scene, ray, n, axis);
    if (p < 0 || p >= (int64_t)1 << FX_RAY_FRAC) return false;
  }
  return true;
}

/* Rounding may leave an end of the lattice just outside; the box is convex, so only ends can be. Where steps grow the
 * first point is moved in, by 2^-40: the table begins with it. Returns how many points went in front. */
static int32_t trim(const fx_scene *scene, fx_ray *ray)
{
  int32_t gone = 0;
  const int64_t last = ((int64_t)1 << FX_RAY_FRAC) - 1;
  for (int axis = 0; axis < 3 && scene->steps; axis++)
    ray->origin[axis] = ray->origin[axis] < 0 ? 0 : ray->origin[axis] > last ? last : ray->origin[axis];
  while (ray->count > 0 && !inside(scene, ray, 0)) {
    for (int axis = 0; axis < 3; axis++) ray->origin[axis] += ray->step[axis];
    ray->count--, gone++;
  }
  while (ray->count > 0 && !inside(scene, ray, ray->count - 1)) ray->count--;
  return gone;
}

/* Length of interval n in lattice steps. */
static double length_of(const fx_scene *scene, int32_t n)
{
  return (double)fx_delta(scene, n) / scene->step_q24;
}

/* Intervals that end within `depth` lattice steps. */
static double intervals_within(const fx_scene *scene, double depth)
{
  if (!scene->steps) return fmin(floor(depth), COUNT_MAX);
  int32_t n = 0;
  const double before = length_of(scene, 0) / 2; /* the middle of the first interval */
  while (n < scene->steps->count &&
         before + ldexp((double)scene->steps->at_q16[n], -16) + length_of(scene, n) / 2 <= depth)
    n++;
  return n;
}

static sf_status too_far(double first, double step)
{
  return sf_fail(SF_E_RANGE, "ray: its first point is %g model units away, %.6g lattice steps: expected at most %d",
                 first, first / step, INT32_MAX >> 16);
}

static sf_status set_lattice(const fx_scene *scene, fx_ray *ray, const double o[3], const double d[3], double step,
                             interval hit)
{
  const double first = hit.enter + step * length_of(scene, 0) / 2;
  const double count = intervals_within(scene, (hit.leave - hit.enter) / step);
  if (!(count >= 1)) return sf_ok();
  for (int axis = 0; axis < 3; axis++) {
    const double p = o[axis] + d[axis] * first;
    if (!(p > -1 && p < 2)) return too_far(first, step); /* the distance has no precision left */
    ray->origin[axis] = llrint(ldexp(p, FX_RAY_FRAC));
    ray->step[axis] = llrint(ldexp(d[axis] * step, FX_RAY_FRAC));
  }
  ray->count = (int32_t)count;
  const double first_q16 = nearbyint(first / step * 65536) + 65536.0 * trim(scene, ray);
  if (ray->count == 0) return sf_ok();
  if (first_q16 > INT32_MAX) return too_far(first, step);
  ray->first_q16 = (int32_t)first_q16;
  return sf_ok();
}

int sf_fx_dir_frac(const fx_scene *scene)
{
  return -ilogb(scene->units.dir_scale);
}

sf_status sf_fx_direction_make(const fx_scene *scene, const float direction[3], fx_ray *ray, double unit[3])
{
  const double x = (double)direction[0], y = (double)direction[1], z = (double)direction[2],
               length = sqrt(x * x + y * y + z * z);
  memset(ray, 0, sizeof *ray);
  if (!isfinite(length) || length == 0)
    return sf_fail(SF_E_RANGE, "ray: direction (%g, %g, %g): expected finite numbers and a nonzero direction", x, y, z);
  unit[0] = x / length, unit[1] = y / length, unit[2] = z / length;
  for (int axis = 0; axis < 3; axis++) ray->unit[axis] = (int16_t)lrint(ldexp(unit[axis], FX_UNIT_FRAC));
  fx_sh(ray->unit, sf_fx_dir_frac(scene), ray->dir);
  return sf_ok();
}

sf_status sf_fx_ray_make(const fx_scene *scene, const float origin[3], const float direction[3], fx_ray *ray)
{
  double unit[3], o[3], d[3];
  SF_TRY(sf_fx_direction_make(scene, direction, ray, unit));
  for (int axis = 0; axis < 3; axis++) {
    if (!isfinite(origin[axis]))
      return sf_fail(SF_E_RANGE, "ray: origin (%g, %g, %g): expected finite numbers", (double)origin[0],
                     (double)origin[1], (double)origin[2]);
    o[axis] = (origin[axis] * scene->units.to_box_scale + scene->units.to_box_offset[axis]) * stretch(scene, axis);
    d[axis] = unit[axis] * scene->units.to_box_scale * stretch(scene, axis);
  }
  const double step = ldexp(scene->step_q24, -SF_DELTA_FRAC) / scene->units.to_box_scale;
  return set_lattice(scene, ray, o, d, step, clip_to_box(scene, o, d));
}

/* As the points of a ray: the nearest Q40, cut to Q24. */
sf_status sf_fx_position_make(const fx_scene *scene, const float position[3], uint32_t box[3])
{
  for (int axis = 0; axis < 3; axis++) {
    const double p =
        (position[axis] * scene->units.to_box_scale + scene->units.to_box_offset[axis]) * stretch(scene, axis);
    const int64_t fixed = p >= 0 && p < 1 ? llrint(ldexp(p, FX_RAY_FRAC)) : -1;
    if (fixed < 0 || fixed >= (int64_t)1 << FX_RAY_FRAC)
      return sf_fail(SF_E_RANGE, "position (%g, %g, %g): axis %d is at %.9g of the scene box, expected 0 <= x < 1",
                     (double)position[0], (double)position[1], (double)position[2], axis, p);
    box[axis] = (uint32_t)(fixed >> (FX_RAY_FRAC - SF_POS_FRAC));
  }
  return sf_ok();
}
