#include "spikefield/fx.h"
#include "src/fx/nofloat.h"

enum { RAY_FRAC = 40 };

static int log2_exact(int32_t power_of_two)
{
  return __builtin_ctz((unsigned)power_of_two);
}

static bool occupied(const fx_scene *scene, const int64_t *p, int bits)
{
  const int drop = RAY_FRAC - bits;
  const uint32_t cell = (uint32_t)((((p[2] >> drop << bits) + (p[1] >> drop)) << bits) + (p[0] >> drop));
  return scene->occupancy[cell >> 3] >> (cell & 7) & 1;
}

/* Tests every lattice point from n on, one after the other; march_steps is the number tested. */
int32_t fx_march_next(const fx_scene *scene, const fx_ray *ray, int32_t n, uint32_t *pos, fx_counts *counts)
{
  const int bits = log2_exact(scene->occ_res);
  int64_t p[3];
  for (int axis = 0; axis < 3; axis++) p[axis] = ray->origin[axis] + n * ray->step[axis];
  int32_t at = n;
  while (at < ray->count && !occupied(scene, p, bits)) {
    for (int axis = 0; axis < 3; axis++) p[axis] += ray->step[axis];
    at++;
  }
  const bool found = at < ray->count;
  if (counts && n < ray->count) counts->march_steps += (uint64_t)(at - n + found);
  if (!found) return -1;
  for (int axis = 0; axis < 3; axis++) pos[axis] = (uint32_t)(p[axis] >> (RAY_FRAC - SF_POS_FRAC));
  return at;
}
