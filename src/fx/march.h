/* Inside src/fx: the cell of the occupancy grids at a point of a ray. */
#ifndef SF_FX_MARCH_H
#define SF_FX_MARCH_H
#include "fx/fx.h"

/* Places of all cascades follow from those of the finest cells counted from the middle of the box: cascade c halves
 * them c times, and the bits in use of the farthest one say which is the finest that holds it. */
static inline uint32_t fx_cell(const fx_scene *scene, const int64_t p[3], int32_t least)
{
  const int bits = __builtin_ctz((unsigned)scene->occ_res), fine = bits + scene->log2_bound;
  const int32_t middle = (int32_t)1 << (bits - 1), centre = (int32_t)1 << (fine - 1);
  int32_t at[3], farthest = 0, cascade = least;
  for (int axis = 0; axis < 3; axis++) {
    at[axis] = (int32_t)(p[axis] >> (FX_RAY_FRAC - fine)) - centre;
    farthest |= at[axis] ^ at[axis] >> 31;
  }
  while (farthest >> cascade >= middle) cascade++;
  uint32_t cell = (uint32_t)cascade;
  for (int axis = 2; axis >= 0; axis--) cell = (cell << bits) + (uint32_t)((at[axis] >> cascade) + middle);
  return cell;
}

static inline bool fx_occupied(const fx_scene *scene, const int64_t p[3], int32_t n)
{
  const uint32_t cell = fx_cell(scene, p, scene->steps ? scene->steps->cascade[n] : 0);
  return scene->occupancy[cell >> 3] >> (cell & 7) & 1;
}

/* fx_scene_allocate's part. */
void fx_steps_fill(const fx_scene *scene, fx_steps *steps);
#endif
