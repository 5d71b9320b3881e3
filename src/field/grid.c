/* Hash-grid features, sample by sample: the oracle of the grid kernels in src/snn/grid_isa.h. Mueller et al. 2022,
 * in torch-ngp's form: pos = x * scale + 1/2, dense levels x fastest, hashed levels xor of coordinate * prime. */
#include "field/model.h"
#include <math.h>

static uint32_t entry_index(const sf_grid_level *level, const uint32_t p[3])
{
  if (level->stride) return p[0] + level->stride * (p[1] + level->stride * p[2]);
  return (p[0] ^ p[1] * 2654435761u ^ p[2] * 805459861u) & (level->entries - 1);
}

void sf_grid_features(const sf_model *model, const float x[3], float *f)
{
  const float *table = sf_model_param(model, SF_P_GRID);
  for (int l = 0; l < model->config.levels; l++) {
    const sf_grid_level *level = &model->level[l];
    uint32_t cell[3];
    float part[3];
    for (int a = 0; a < 3; a++) {
      float pos = x[a] * level->scale + 0.5f;
      cell[a] = (uint32_t)floorf(pos);
      part[a] = pos - floorf(pos);
    }
    f[2 * l] = f[2 * l + 1] = 0;
    for (int c = 0; c < 8; c++) {
      const uint32_t p[3] = {cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)};
      const float *entry = table + 2 * (level->offset + entry_index(level, p));
      float weight = 1;
      for (int a = 0; a < 3; a++) weight *= c >> a & 1 ? part[a] : 1 - part[a];
      f[2 * l] += weight * entry[0];
      f[2 * l + 1] += weight * entry[1];
    }
  }
}
