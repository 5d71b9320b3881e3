/* The hash grid in double precision, each block fixed or real. */
#include "bounds/exact_field.h"
#include "src/fx/unit.h"

static void corner_weights(bool exact, const double g[3], double weight[8])
{
  for (uint32_t xy = 0; xy < 4; xy++) {
    const double w = (xy & 1 ? g[0] : 256 - g[0]) * (xy & 2 ? g[1] : 256 - g[1]), upper = w * g[2] / 256;
    weight[xy + 4] = exact ? upper : sf_exact_round(upper);
    weight[xy] = w - weight[xy + 4];
  }
}

static double entry_value(const sf_exact *e, int level, int64_t entry, int which)
{
  const fx_scene *s = e->scene;
  const size_t i = (size_t)entry * FX_GRID_FEATURES + (size_t)which;
  if (!sf_exact_is(e, SF_EXACT_ENTRIES)) return s->grid.table[i];
  return (double)sf_model_param(e->model, SF_P_GRID)[i] /
         ldexp(s->units.feature_scale[level], 16 - s->grid.shift[level]);
}

void sf_exact_features(const sf_exact *e, const double pos[3], double *f)
{
  const fx_grid *grid = &e->scene->grid;
  const bool exact = sf_exact_is(e, SF_EXACT_POSITION);
  for (int level = 0; level < grid->levels; level++) {
    uint32_t base[3];
    double g[3], weight[8], sum[FX_GRID_FEATURES] = {0};
    for (int a = 0; a < 3; a++) {
      const double product = ldexp(pos[a] * grid->scale_q16[level], -32); /* 1/256 of a cell */
      const double p = (exact ? product : sf_exact_round(product)) + 128;
      base[a] = (uint32_t)floor(p / 256), g[a] = p - 256.0 * base[a];
    }
    corner_weights(exact, g, weight);
    for (uint32_t corner = 0; corner < 8; corner++) {
      const int64_t entry = sf_exact_entry(grid, level, base, corner);
      for (int i = 0; i < FX_GRID_FEATURES; i++) sum[i] += weight[corner] * entry_value(e, level, entry, i);
    }
    for (int i = 0; i < FX_GRID_FEATURES; i++) {
      const double value = ldexp(sum[i], -grid->shift[level]);
      f[level * FX_GRID_FEATURES + i] =
          exact ? value : sf_exact_clamp(sf_exact_round(value), -FX_INPUT_MAX, FX_INPUT_MAX);
    }
  }
}
