/* Hash grid to int8, one power-of-two scale per level; all levels share the LSB of the features. */
#include "src/quant/internal.h"
#include <math.h>
#include <string.h>

enum { ENTRY_MAX = 127, FEATURE_LIMIT = (1 << (SF_INPUT_BITS - 1)) - 1, PRODUCT_FRAC = 16, TRIALS = 4 };

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

static int64_t fill_level(fx_grid *grid, const float *value, int level, int exponent)
{
  const double scale = ldexp(1, -exponent);
  const int64_t begin = grid->offset[level] * FX_GRID_FEATURES, end = level_end(grid, level) * FX_GRID_FEATURES;
  int64_t clipped = 0;
  for (int64_t i = begin; i < end; i++) {
    const double q = nearbyint(value[i] * scale);
    grid->table[i] = (int8_t)clipped_to(q, ENTRY_MAX);
    clipped += fabs(q) > ENTRY_MAX;
  }
  return clipped;
}

/* Smallest exponent that holds the level's largest entry, within what the shifter offers. */
static int widest_exponent(const fx_grid *grid, const float *value, int level)
{
  double largest = 0;
  const int64_t end = level_end(grid, level) * FX_GRID_FEATURES;
  for (int64_t i = grid->offset[level] * FX_GRID_FEATURES; i < end; i++) largest = fmax(largest, fabs(value[i]));
  return largest > 0 ? (int)ceil(log2(largest / ENTRY_MAX)) : -1000;
}

static int usable_exponent(int exponent, int feature)
{
  const int low = feature + PRODUCT_FRAC - 31, high = feature + PRODUCT_FRAC;
  return exponent < low ? low : exponent > high ? high : exponent;
}

/* Squared error of each level's features on the calibration positions with the table as it stands. */
static void level_errors(const fx_grid *grid, const sf_calibration *c, double lsb, double error[FX_LEVELS_MAX])
{
  int16_t f[FX_LEVELS_MAX * FX_GRID_FEATURES];
  memset(error, 0, FX_LEVELS_MAX * sizeof *error);
  for (int sample = 0; sample < c->samples; sample++) {
    fx_grid_features(grid, c->pos + sample * 3, f, NULL);
    for (int i = 0; i < c->features; i++) {
      const double d = c->f[(size_t)sample * (size_t)c->features + (size_t)i] - f[i] * lsb;
      error[i / FX_GRID_FEATURES] += d * d;
    }
  }
}

static int64_t fill_all(fx_grid *grid, const float *value, const int *exponent, int feature)
{
  int64_t clipped = 0;
  for (int l = 0; l < grid->levels; l++) {
    grid->shift[l] = PRODUCT_FRAC + feature - exponent[l];
    clipped += fill_level(grid, value, l, exponent[l]);
  }
  return clipped;
}

/* Each trial halves the scale of every level at once; each level keeps its own best one. */
static void choose_exponents(fx_grid *grid, const float *value, const sf_calibration *c, int feature, int *best)
{
  int widest[FX_LEVELS_MAX];
  double best_error[FX_LEVELS_MAX];
  for (int l = 0; l < grid->levels; l++) widest[l] = widest_exponent(grid, value, l), best_error[l] = INFINITY;
  for (int trial = 0; trial < TRIALS; trial++) {
    int exponent[FX_LEVELS_MAX];
    double error[FX_LEVELS_MAX];
    for (int l = 0; l < grid->levels; l++) exponent[l] = usable_exponent(widest[l] - trial, feature);
    fill_all(grid, value, exponent, feature);
    level_errors(grid, c, ldexp(1, feature), error);
    for (int l = 0; l < grid->levels; l++)
      if (error[l] < best_error[l]) best[l] = exponent[l], best_error[l] = error[l];
  }
}

static double relative_error(const fx_scene *scene, const sf_calibration *c)
{
  double error[FX_LEVELS_MAX], sum = 0, energy = 0;
  level_errors(&scene->grid, c, scene->feature_scale, error);
  for (int l = 0; l < scene->grid.levels; l++) sum += error[l];
  for (size_t i = 0; i < (size_t)c->samples * (size_t)c->features; i++) energy += (double)c->f[i] * c->f[i];
  return energy > 0 ? sqrt(sum / energy) : 0;
}

sf_status sf_quantise_grid(fx_scene *scene, const sf_model *model, const char *name, const sf_calibration *calibration,
                           sf_quant_report *report)
{
  const float *value = sf_model_param(model, SF_P_GRID);
  const int feature = feature_exponent(calibration);
  if (feature < -500 || feature > 100)
    return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': features need an LSB of 2^%d, beyond 2^-500..2^100", name,
                   model->param[SF_P_GRID].name, feature);
  int exponent[FX_LEVELS_MAX];
  scene->feature_scale = ldexp(1, feature);
  choose_exponents(&scene->grid, value, calibration, feature, exponent);
  report->grid_clipped = fill_all(&scene->grid, value, exponent, feature);
  report->feature_scale = scene->feature_scale;
  report->feature_error = relative_error(scene, calibration);
  return sf_ok();
}
