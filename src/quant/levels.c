/* Hash grid to integers, one scale per level. The core only shifts the interpolated sum, so the scale need not be a
 * power of two: what is left of it after the shift is the LSB of the level's features, and goes into their rows of D1.
 */
#include "src/quant/internal.h"
#include <math.h>
#include <string.h>

enum { PRODUCT_FRAC = 16, SHIFT_MAX = 31, TRIALS = 4, SCALE_TRIALS = 8, SCALE_TRIALS_MAX = 20 };
enum { EXPONENT_MIN = -70 };         /* of the LSB of features: what is smaller is zero, and scales fit a file */
static const double NARROWER = 0.86; /* 0.86^7 = 0.35 of the widest scale is tried, and less where that pays */

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
static int feature_exponent(const sf_calibration *c, int feature_max)
{
  const size_t n = (size_t)c->samples * (size_t)c->features;
  double largest = 0, best_error = INFINITY;
  for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(c->f[i]));
  if (largest == 0) return -10;
  const int widest = (int)fmax(ceil(log2(largest / feature_max)), EXPONENT_MIN);
  int best = widest;
  for (int trial = 0; trial < TRIALS; trial++) {
    const double lsb = ldexp(1, widest - trial);
    double error = 0;
    for (size_t i = 0; i < n; i++) {
      const double d = c->f[i] - lsb * clipped_to(nearbyint(c->f[i] / lsb), feature_max);
      error += d * d;
    }
    if (error < best_error) best = widest - trial, best_error = error;
  }
  return best;
}

typedef struct format {
  int entry_max, shift_min;
  double common; /* no level's features have a smaller LSB */
} format;

/* A feature lies between the entries around it, so a shift that makes the largest possible entry fit makes every
 * feature fit. The core's own width needs none: it saturates there. */
static int smallest_shift(const sf_quant_widths *widths, int entry_max)
{
  int shift = 0;
  if (widths->feature_bits == SF_INPUT_BITS) return 0;
  while (nearbyint(ldexp(entry_max, PRODUCT_FRAC - shift)) > sf_symmetric_max(widths->feature_bits)) shift++;
  return shift;
}

static format choose_format(const sf_calibration *c, const sf_quant_widths *widths)
{
  const int entry_max = sf_symmetric_max(widths->grid_bits);
  return (format){.entry_max = entry_max,
                  .shift_min = smallest_shift(widths, entry_max),
                  .common = ldexp(1, feature_exponent(c, sf_symmetric_max(widths->feature_bits)))};
}

/* A level's scale (value of one LSB of its entries) sets its shift and the LSB of its features: the smallest one not
 * below `common`. Levels may differ because D1's weights take the difference up, row by row. */
static void set_level(fx_scene *scene, int level, double scale, const format *format)
{
  int shift = PRODUCT_FRAC + (int)ceil(log2(format->common / scale));
  if (shift < format->shift_min) shift = format->shift_min;
  if (shift > SHIFT_MAX) shift = SHIFT_MAX;
  scene->grid.shift[level] = shift;
  scene->units.feature_scale[level] = ldexp(scale, shift - PRODUCT_FRAC);
}

static int64_t fill_level(fx_grid *grid, const float *value, int level, double scale, int entry_max)
{
  const int64_t begin = grid->offset[level] * FX_GRID_FEATURES, end = level_end(grid, level) * FX_GRID_FEATURES;
  int64_t clipped = 0;
  for (int64_t i = begin; i < end; i++) {
    const double q = nearbyint(value[i] / scale);
    grid->table[i] = (int8_t)clipped_to(q, entry_max);
    clipped += fabs(q) > entry_max;
  }
  return clipped;
}

static int64_t fill_all(fx_scene *scene, const float *value, const double *scale, const format *format)
{
  int64_t clipped = 0;
  for (int l = 0; l < scene->grid.levels; l++) {
    set_level(scene, l, scale[l], format);
    clipped += fill_level(&scene->grid, value, l, scale[l], format->entry_max);
  }
  return clipped;
}

static int64_t fill_settled(fx_scene *scene, const float *value, const sf_scales *settled, int entry_max)
{
  int64_t clipped = 0;
  for (int l = 0; l < scene->grid.levels; l++) {
    const double ratio = (double)settled->lsb.feature[l] / settled->lsb.entry[l];
    const int shift = PRODUCT_FRAC + (int)nearbyint(log2(ratio));
    scene->grid.shift[l] = shift < 0 ? 0 : shift > SHIFT_MAX ? SHIFT_MAX : shift;
    scene->units.feature_scale[l] = settled->lsb.feature[l];
    clipped += fill_level(&scene->grid, value, l, settled->lsb.entry[l], entry_max);
  }
  return clipped;
}

/* The scale that just holds the level's largest entry, but not so fine that the largest shift leaves its features
 * below `common`: such a level says nothing, or is empty. */
static double widest_scale(const fx_grid *grid, const float *value, int level, const format *format)
{
  double largest = 0;
  const int64_t end = level_end(grid, level) * FX_GRID_FEATURES;
  for (int64_t i = grid->offset[level] * FX_GRID_FEATURES; i < end; i++) largest = fmax(largest, fabs(value[i]));
  return fmax(largest / format->entry_max, ldexp(format->common, PRODUCT_FRAC - SHIFT_MAX));
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
      const double d =
          c->f[(size_t)sample * (size_t)c->features + (size_t)i] - f[i] * scene->units.feature_scale[level];
      error[level] += d * d;
    }
  }
}

/* Each trial narrows the scale of every level at once; each level keeps its own best one. The last trial is one that
 * helped no level (few bits gain from clipping more). */
static void choose_scales(fx_scene *scene, const float *value, const sf_calibration *c, const format *format,
                          double *best)
{
  double widest[FX_LEVELS_MAX], best_error[FX_LEVELS_MAX];
  for (int l = 0; l < scene->grid.levels; l++)
    widest[l] = widest_scale(&scene->grid, value, l, format), best_error[l] = INFINITY;
  bool better = true;
  for (int trial = 0; trial < SCALE_TRIALS || (better && trial < SCALE_TRIALS_MAX); trial++) {
    double scale[FX_LEVELS_MAX], error[FX_LEVELS_MAX];
    better = false;
    for (int l = 0; l < scene->grid.levels; l++) scale[l] = widest[l] * pow(NARROWER, trial);
    fill_all(scene, value, scale, format);
    level_errors(scene, c, error);
    for (int l = 0; l < scene->grid.levels; l++)
      if (error[l] < best_error[l]) best[l] = scale[l], best_error[l] = error[l], better = true;
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

sf_status sf_quantise_grid(fx_scene *scene, const sf_model *model, const char *name, const sf_calibration *calibration,
                           sf_quant_report *report)
{
  (void)name;
  const float *value = sf_model_param(model, SF_P_GRID);
  const format format = choose_format(calibration, &report->widths);
  double scale[FX_LEVELS_MAX];
  for (int l = 0; l < FX_LEVELS_MAX; l++) scene->units.feature_scale[l] = format.common;
  const sf_scales *settled = sf_settled_scales(model, &report->widths);
  if (settled)
    report->grid_clipped = fill_settled(scene, value, settled, format.entry_max);
  else {
    choose_scales(scene, value, calibration, &format, scale);
    report->grid_clipped = fill_all(scene, value, scale, &format);
  }
  for (int l = 0; l < scene->grid.levels; l++)
    report->scales.lsb.entry[l] = ldexpf((float)scene->units.feature_scale[l], PRODUCT_FRAC - scene->grid.shift[l]);
  report->feature_error = relative_error(scene, calibration);
  return sf_ok();
}
