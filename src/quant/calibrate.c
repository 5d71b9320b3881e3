#include "base/rng.h"
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 4096, BLOCK = 32 };
enum { STREAM_CELL = 101, STREAM_JITTER, STREAM_DIRECTION };

static int layer_width(const sf_calibration *c, int layer)
{
  return layer == FX_D2 ? SF_DENSITY_OUT : layer == FX_C3 ? 3 : c->hidden;
}

static sf_status allocate(sf_calibration *c)
{
  const size_t samples = (size_t)c->samples, rows = samples * (size_t)c->steps;
  bool ok = (c->pos = calloc(samples * 3, sizeof *c->pos)) &&
            (c->f = calloc(samples, (size_t)c->features * sizeof *c->f)) &&
            (c->direction = calloc(samples * SF_DIR_FEATURES, sizeof *c->direction));
  for (int l = 0; l < SF_LAYERS && ok; l++) {
    ok = (c->target[l] = calloc(rows, (size_t)layer_width(c, l) * sizeof(float))) != NULL;
    if (ok && l != FX_D2 && l != FX_C3) ok = (c->spikes[l] = calloc(rows, (size_t)c->hidden)) != NULL;
  }
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "quantiser: no memory for %d calibration samples", c->samples);
}

void sf_calibration_free(sf_calibration *c)
{
  free(c->pos), free(c->f), free(c->direction);
  for (int l = 0; l < SF_LAYERS; l++) free(c->target[l]), free(c->spikes[l]);
  memset(c, 0, sizeof *c);
}

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

static void draw_position(uint32_t *pos, uint32_t cell, const sf_config *config, uint64_t seed, int sample)
{
  uint32_t corner[3];
  const uint32_t side = cell_corner(config, cell, corner);
  for (int axis = 0; axis < 3; axis++)
    pos[axis] =
        corner[axis] + (uint32_t)sf_random_below(seed, STREAM_JITTER, (uint64_t)sample * 3 + (uint64_t)axis, side);
}

static void draw_direction(float *direction, uint64_t seed, int sample)
{
  const float z = 2 * sf_random_float(seed, STREAM_DIRECTION, (uint64_t)sample * 2) - 1;
  const float angle = 6.2831853f * sf_random_float(seed, STREAM_DIRECTION, (uint64_t)sample * 2 + 1);
  const float r = sqrtf(fmaxf(0, 1 - z * z));
  direction[0] = r * cosf(angle), direction[1] = r * sinf(angle), direction[2] = z;
}

static void keep_trace(sf_calibration *c, const sf_net_trace *trace, int sample)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < c->steps; t++) {
      const size_t row = (size_t)sample * (size_t)c->steps + (size_t)t, width = (size_t)layer_width(c, l);
      memcpy(c->target[l] + row * width, trace->current[l][t], width * sizeof(float));
      if (c->spikes[l]) memcpy(c->spikes[l] + row * width, trace->spike[l][t], width);
    }
}

static void run_sample(sf_calibration *c, const sf_model *model, int sample, uint64_t seed, sf_net_trace *trace)
{
  float x[3], direction[3], sigma[SF_T_MAX], colour[SF_T_MAX * 3];
  float *f = c->f + (size_t)sample * (size_t)c->features, *sh = c->direction + (size_t)sample * SF_DIR_FEATURES;
  for (int axis = 0; axis < 3; axis++) x[axis] = (float)c->pos[sample * 3 + axis] * 0x1p-24f;
  draw_direction(direction, seed, sample);
  sf_sh4(direction, sh);
  sf_grid_features(model, x, f);
  memset(trace, 0, sizeof *trace);
  sf_net_sample(model, f, sh, c->steps, sigma, colour, trace);
  keep_trace(c, trace, sample);
}

static sf_status run_samples(sf_calibration *c, const sf_model *model, uint64_t seed)
{
  bool ok = true;
#pragma omp parallel
  {
    sf_net_trace *trace = malloc(sizeof *trace);
#pragma omp for schedule(static, BLOCK)
    for (int sample = 0; sample < c->samples; sample++)
      if (trace) run_sample(c, model, sample, seed, trace);
    if (!trace) {
#pragma omp atomic write
      ok = false;
    }
    free(trace);
  }
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "quantiser: no memory for a calibration trace");
}

sf_status sf_calibrate(sf_calibration *c, const sf_model *model, int steps, uint64_t seed)
{
  *c = (sf_calibration){
      .samples = SAMPLES, .steps = steps, .hidden = model->config.hidden, .features = 2 * model->config.levels};
  uint32_t *cell = NULL;
  uint64_t cells = 0;
  SF_TRY(allocate(c));
  SF_TRY(list_cells(model, &cell, &cells));
  for (int sample = 0; sample < c->samples; sample++) {
    const uint64_t pick = sf_random_below(seed, STREAM_CELL, (uint64_t)sample, cells);
    draw_position(c->pos + sample * 3, cell[pick], &model->config, seed, sample);
  }
  free(cell);
  return run_samples(c, model, seed);
}
