#include "src/fx/march.h"
#include "src/fx/round.h"
#include "src/fx/nofloat.h"

enum { GAMMA_FRAC = 24, ONE = 1 << 16 };

void fx_steps_fill(const fx_scene *scene, fx_steps *steps)
{
  const int cell_bits = __builtin_ctz((unsigned)scene->occ_res) + scene->log2_bound; /* of the finest cells */
  int64_t start = 0, first = 0;
  steps->count = FX_STEPS_MAX;
  for (int n = 0; n < FX_STEPS_MAX; n++) {
    int64_t length = fx_rshift_round((scene->near_q16 + start) * scene->gamma_q24, GAMMA_FRAC);
    length = length < ONE ? ONE : length > scene->longest_q16 ? scene->longest_q16 : length;
    if (n == 0) first = length;
    const int64_t edges_q40 = length * scene->step_q24;
    int cascade = 0;
    while (cascade < scene->log2_bound && edges_q40 >> (FX_RAY_FRAC - cell_bits + cascade)) cascade++;
    steps->at_q16[n] = start + ((length - first) >> 1);
    steps->cascade[n] = (uint8_t)cascade;
    steps->delta_q24[n] = (int32_t)fx_rshift_round(edges_q40, 16);
    start += length;
  }
}

int64_t fx_march_cell(const fx_scene *scene, const fx_ray *ray, int32_t n)
{
  int64_t p[3];
  for (int axis = 0; axis < 3; axis++) p[axis] = fx_ray_at(scene, ray, n, axis);
  return fx_cell(scene, p, scene->steps ? scene->steps->cascade[n] : 0);
}

/* Tests every lattice point from n on, one after the other; march_steps is the number tested. */
int32_t fx_march_next(const fx_scene *scene, const fx_ray *ray, int32_t n, uint32_t *pos, fx_counts *counts)
{
  int64_t p[3];
  int32_t at = n;
  bool found = false;
  for (; at < ray->count; at++) {
    for (int axis = 0; axis < 3; axis++) p[axis] = fx_ray_at(scene, ray, at, axis);
    found = fx_occupied(scene, p, at);
    if (found) break;
  }
  if (counts && n < ray->count) counts->march_steps += (uint64_t)(at - n + found);
  if (!found) return -1;
  for (int axis = 0; axis < 3; axis++) pos[axis] = (uint32_t)(p[axis] >> (FX_RAY_FRAC - SF_POS_FRAC));
  return at;
}
