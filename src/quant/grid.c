/* The hash grid as a field of the quantiser. */
#include "base/rng.h"
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>

enum { STREAM_CELL = 101, STREAM_JITTER, STREAM_DIRECTION };
enum { DIRECTION_TRIED = -4, DIRECTION_COARSEST = -1 };

static int features(const sf_model *model)
{
  return FX_GRID_FEATURES * model->config.levels;
}

static sf_status check(const sf_model *model, const char *name)
{
  if (model->config.levels >= 1 && model->config.levels <= FX_LEVELS_MAX) return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': %d levels, the accelerator has %d", name,
                 model->param[SF_P_GRID].name, model->config.levels, FX_LEVELS_MAX);
}

static sf_status set_sizes(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_widths *widths)
{
  (void)name, (void)widths;
  sf_quantise_levels(&scene->grid, model);
  scene->log2_bound = sf_config_cascades(&model->config) - 1;
  return sf_ok();
}

static void set_steps(fx_scene *scene, const sf_config *config)
{
  const double step = 2 * sqrt(3.0) / config->lattice; /* model units */
  scene->step_q24 = (int32_t)nearbyint(ldexp(step / (2 * config->bound), SF_DELTA_FRAC));
  if (!(config->dt_gamma > 0)) return;
  scene->gamma_q24 = (int32_t)nearbyint(ldexp((double)config->dt_gamma, 24));
  scene->near_q16 = (int32_t)nearbyint(ldexp(SF_NEAR / step, 16));
  scene->longest_q16 =
      (int32_t)nearbyint(fmax(1, (double)config->lattice * config->bound / config->occ_res) * (1 << 16));
}

static void set_scalars(fx_scene *scene, const sf_model *model)
{
  set_steps(scene, &model->config);
  scene->units.to_box_scale = 0.5 / model->config.bound;
  for (int axis = 0; axis < 3; axis++) scene->units.to_box_offset[axis] = 0.5;
}

/* ---- calibration: positions in occupied cells ---- */

/* The corner of a cell of the occupancy grids and its width in the box, Q0.24. */
static uint32_t cell_corner(const sf_config *config, uint64_t cell, uint32_t corner[3])
{
  const uint64_t res = (uint64_t)config->occ_res, cascade = cell / (res * res * res);
  const uint32_t edge = (1u << SF_POS_FRAC) / (uint32_t)config->bound << cascade;
  const uint64_t place[3] = {cell % res, cell / res % res, cell / res / res % res};
  for (int axis = 0; axis < 3; axis++)
    corner[axis] = (1u << (SF_POS_FRAC - 1)) - edge / 2 + (uint32_t)place[axis] * (edge / (uint32_t)res);
  return edge / (uint32_t)res;
}

/* Is it in a finer cascade, too? */
static bool is_covered(const sf_config *config, uint64_t cell)
{
  const uint64_t res = (uint64_t)config->occ_res;
  if (cell < res * res * res) return false;
  const uint64_t place[3] = {cell % res, cell / res % res, cell / res / res % res};
  for (int axis = 0; axis < 3; axis++)
    if (place[axis] < res / 4 || place[axis] >= res - res / 4) return false;
  return true;
}

/* Index of every occupied cell that samples look in (the middle of a coarse cascade is left to finer ones); of every
 * cell when none is occupied. */
static sf_status list_cells(const sf_model *model, uint32_t **list, uint64_t *count)
{
  const uint64_t cells = sf_config_cells(&model->config);
  uint32_t *cell = malloc(cells * sizeof *cell);
  if (!cell) return sf_fail(SF_E_MEMORY, "quantiser: no memory for %llu cells", (unsigned long long)cells);
  uint64_t n = 0;
  for (uint64_t i = 0; i < cells; i++)
    if (model->occupancy[i >> 3] >> (i & 7) & 1 && !is_covered(&model->config, i)) cell[n++] = (uint32_t)i;
  if (n == 0)
    for (; n < cells; n++) cell[n] = (uint32_t)n;
  *list = cell, *count = n;
  return sf_ok();
}

static void draw_in_cell(uint32_t *pos, uint32_t cell, const sf_config *config, uint64_t seed, int sample)
{
  uint32_t corner[3];
  const uint32_t side = cell_corner(config, cell, corner);
  for (int axis = 0; axis < 3; axis++)
    pos[axis] =
        corner[axis] + (uint32_t)sf_random_below(seed, STREAM_JITTER, (uint64_t)sample * 3 + (uint64_t)axis, side);
}

static sf_status draw(sf_calibration *c, const sf_model *model, uint64_t seed)
{
  uint32_t *cell = NULL;
  uint64_t cells = 0;
  SF_TRY(list_cells(model, &cell, &cells));
  for (int sample = 0; sample < c->samples; sample++) {
    const uint64_t pick = sf_random_below(seed, STREAM_CELL, (uint64_t)sample, cells);
    draw_in_cell(c->pos + sample * 3, cell[pick], &model->config, seed, sample);
  }
  free(cell);
  return sf_ok();
}

static void sample(const sf_model *model, const float x[3], const float direction[3], int steps, float *f,
                   float *constant, sf_net_trace *trace)
{
  float sigma[SF_T_MAX], colour[SF_T_MAX * 3];
  sf_sh4(direction, constant);
  sf_grid_features(model, x, f);
  sf_net_sample(model, f, constant, steps, sigma, colour, trace);
}

const sf_field_quantiser sf_grid_quantiser = {.direction_stream = STREAM_DIRECTION,
                                              .tried = DIRECTION_TRIED,
                                              .coarsest = DIRECTION_COARSEST,
                                              .features = features,
                                              .check = check,
                                              .set_sizes = set_sizes,
                                              .set_scalars = set_scalars,
                                              .draw = draw,
                                              .sample = sample,
                                              .quantise = sf_quantise_grid};
