/* Hash grid to int8, one scale per level. The core only shifts the interpolated sum, so the scale need not be a power
 * of two: what is left of it after the shift is the LSB of the level's features, and goes into their rows of D1. */
#include "src/quant/internal.h"
#include <math.h>
#include <string.h>

enum { ENTRY_MAX = 127, FEATURE_LIMIT = (1 << (SF_INPUT_BITS - 1)) - 1, PRODUCT_FRAC = 16, SHIFT_MAX = 31 };
enum { TRIALS = 4, SCALE_TRIALS = 8 };
static const double NARROWER = 0.86;      /* 0.86^7 = 0.35 of the widest scale is the narrowest tried */
static const double SCALE_MIN = 0x1p-140; /* below every difference of two floats */

/* Geometry alone: what fx_scene_allocate needs. */
void sf_quantise_levels(fx_grid *grid, const sf_model *model)
{
  const sf_param *table = &model->param[SF_P_GRID];
  grid->levels = model->config.levels;
  grid->entries = (int64_t)(table->size / FX_GRID_FEATURES);
  for (int l = 0; l < grid->levels; l++) {
    const sf_grid_level *level = &model->level[l];
    grid->scale_q16[l] = (int32_t)nearbyint((double)level->scale * 65536);
    grid->stride[l] = (int32_t)level->stride;
    grid->log2_size[l] = level->stride ? 0 : model->config.log2_hash;
    grid->offset[l] = (int64_t)level->offset;
  }
}

static int64_t level_end(const fx_grid *grid, int level)
{
  return level + 1 < grid->levels ? grid->offset[level + 1] : grid->entries;
}

static double clipped_to(double value, double limit)
{
  return value > limit ? limit : value < -limit ? -limit : value;
}

/* exponent e of the features' LSB 2^e: least squared error with clipping, starting from the largest feature. */
static int feature_exponent(const sf_calibration *c)
{
  const size_t n = (size_t)c->samples * (size_t)c->features;
  double largest = 0, best_error = INFINITY;
  for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(c->f[i]));
  if (largest == 0) return -10;
  const int widest = (int)ceil(log2(largest / FEATURE_LIMIT));
  int best = widest;
  for (int trial = 0; trial < TRIALS; trial++) {
    const double lsb = ldexp(1, widest - trial);
    double error = 0;
    for (size_t i = 0; i < n; i++) {
      const double d = c->f[i] - lsb * clipped_to(nearbyint(c->f[i] / lsb), FEATURE_LIMIT);
      error += d * d;
    }
    if (error < best_error) best = widest - trial, best_error = error;
  }
  return best;
}

/* A level's scale (value of one LSB of its entries) sets its shift and the LSB of its features: the smallest one not
 * below `common`. Levels may differ because D1's weights take the difference up, row by row. */
static void set_level(fx_scene *scene, int level, double scale, double common)
{
  int shift = PRODUCT_FRAC + (int)ceil(log2(common / scale));
  if (shift < 0) shift = 0;
  if (shift > SHIFT_MAX) shift = SHIFT_MAX;
  scene->grid.shift[level] = shift;
  scene->feature_scale[level] = ldexp(scale, shift - PRODUCT_FRAC);
}

static int64_t fill_level(fx_grid *grid, const float *value, int level, double scale)
{
  const int64_t begin = grid->offset[level] * FX_GRID_FEATURES, end = level_end(grid, level) * FX_GRID_FEATURES;
  int64_t clipped = 0;
  for (int64_t i = begin; i < end; i++) {
    const double q = nearbyint(value[i] / scale);
    grid->table[i] = (int8_t)clipped_to(q, ENTRY_MAX);
    clipped += fabs(q) > ENTRY_MAX;
  }
  return clipped;
}

static int64_t fill_all(fx_scene *scene, const float *value, const double *scale, double common)
{
  int64_t clipped = 0;
  for (int l = 0; l < scene->grid.levels; l++) {
    set_level(scene, l, scale[l], common);
    clipped += fill_level(&scene->grid, value, l, scale[l]);
  }
  return clipped;
}

/* The scale that just holds the level's largest entry; a level without entries of its own gets any. */
static double widest_scale(const fx_grid *grid, const float *value, int level)
{
  double largest = 0;
  const int64_t end = level_end(grid, level) * FX_GRID_FEATURES;
  for (int64_t i = grid->offset[level] * FX_GRID_FEATURES; i < end; i++) largest = fmax(largest, fabs(value[i]));
  return fmax(largest / ENTRY_MAX, SCALE_MIN);
}

/* Squared error of each level's features on the calibration positions with the table as it stands. */
static void level_errors(const fx_scene *scene, const sf_calibration *c, double error[FX_LEVELS_MAX])
{
  int16_t f[FX_LEVELS_MAX * FX_GRID_FEATURES];
  memset(error, 0, FX_LEVELS_MAX * sizeof *error);
  for (int sample = 0; sample < c->samples; sample++) {
    fx_grid_features(&scene->grid, c->pos + sample * 3, f, NULL);
    for (int i = 0; i < c->features; i++) {
      const int level = i / FX_GRID_FEATURES;
      const double d = c->f[(size_t)sample * (size_t)c->features + (size_t)i] - f[i] * scene->feature_scale[level];
      error[level] += d * d;
    }
  }
}

/* Each trial narrows the scale of every level at once; each level keeps its own best one. */
static void choose_scales(fx_scene *scene, const float *value, const sf_calibration *c, double common, double *best)
{
  double widest[FX_LEVELS_MAX], best_error[FX_LEVELS_MAX];
  for (int l = 0; l < scene->grid.levels; l++)
    widest[l] = widest_scale(&scene->grid, value, l), best_error[l] = INFINITY;
  for (int trial = 0; trial < SCALE_TRIALS; trial++) {
    double scale[FX_LEVELS_MAX], error[FX_LEVELS_MAX];
    for (int l = 0; l < scene->grid.levels; l++) scale[l] = widest[l] * pow(NARROWER, trial);
    fill_all(scene, value, scale, common);
    level_errors(scene, c, error);
    for (int l = 0; l < scene->grid.levels; l++)
      if (error[l] < best_error[l]) best[l] = scale[l], best_error[l] = error[l];
  }
}

static double relative_error(const fx_scene *scene, const sf_calibration *c)
{
  double error[FX_LEVELS_MAX], sum = 0, energy = 0;
  level_errors(scene, c, error);
  for (int l = 0; l < scene->grid.levels; l++) sum += error[l];
  for (size_t i = 0; i < (size_t)c->samples * (size_t)c->features; i++) energy += (double)c->f[i] * c->f[i];
  return energy > 0 ? sqrt(sum / energy) : 0;
}

void sf_quantise_grid(fx_scene *scene, const sf_model *model, const sf_calibration *calibration,
                      sf_quant_report *report)
{
  const float *value = sf_model_param(model, SF_P_GRID);
  const double common = ldexp(1, feature_exponent(calibration));
  double scale[FX_LEVELS_MAX];
  for (int l = 0; l < FX_LEVELS_MAX; l++) scene->feature_scale[l] = common;
  choose_scales(scene, value, calibration, common, scale);
  report->grid_clipped = fill_all(scene, value, scale, common);
  report->feature_error = relative_error(scene, calibration);
}
