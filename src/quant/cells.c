/* Which cells of the occupancy grids stay. */
#include "src/quant/internal.h"
#include <string.h>

int sf_cell_class(const sf_trim_use *use, int64_t cell)
{
  const uint64_t one = (uint64_t)1 << 2 * SF_TRANS_FRAC;
  if (!use->visits[cell]) return 0;
  const uint64_t mean = (use->weight2[cell] + one) / (use->visits[cell] + 1);
  const int octave = 2 * SF_TRANS_FRAC - (63 - __builtin_clzll(mean));
  return octave < SF_CELL_CLASSES ? octave : SF_CELL_CLASSES - 1;
}

void sf_trim_cells(const fx_scene *scene, const sf_trim *trim, const sf_trim_use *use, uint8_t *occupancy)
{
  memcpy(occupancy, scene->occupancy, (size_t)sf_cells_of(scene) / 8);
  for (int64_t cell = 0; cell < sf_cells_of(scene); cell++)
    if (scene->occupancy[cell >> 3] >> (cell & 7) & 1 && !trim->cells[sf_cell_class(use, cell)])
      occupancy[cell >> 3] &= (uint8_t) ~(1u << (cell & 7));
}
