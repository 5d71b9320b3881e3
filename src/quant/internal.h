/* Inside src/quant. */
#ifndef SF_QUANT_INTERNAL_H
#define SF_QUANT_INTERNAL_H
#include "quant/quant.h"

/* Calibration samples: positions in occupied cells with random directions, and what the float nets do there.
 * Rows of a layer's data are samples x steps (D1: samples alone, its current is constant). */
typedef struct sf_calibration {
  int samples, steps, hidden, features;
  uint32_t *pos;              /* [samples][3] Q0.24 */
  float *f, *direction;       /* [samples][features], [samples][SF_DIR_FEATURES] */
  float *target[SF_LAYERS];   /* [rows][n_out] currents of the float nets */
  uint8_t *spikes[SF_LAYERS]; /* [rows][hidden] of D1, C1, C2 */
} sf_calibration;
sf_status sf_calibrate(sf_calibration *calibration, const sf_model *model, int steps, uint64_t seed);
void sf_calibration_free(sf_calibration *calibration);

/* Integer inputs of a layer against the currents they should cause. */
typedef struct sf_fit_data {
  int rows, n_in, n_out;
  const int16_t *x;    /* [rows][n_in] */
  const float *target; /* [rows][n_out] */
} sf_fit_data;

/* Float weights of one layer: w[o * stride + i]; lsb[i] is the value of one LSB of input i. */
typedef struct sf_fit_weights {
  const float *w;
  int stride;
  const double *lsb;
  double unit_min; /* the unit may not be smaller (theta must fit the membrane, h its input) */
  int weight_max;  /* |q| may not be larger */
  double unit;     /* settled: float weights are rounded to it and no more; 0: to be found */
} sf_fit_weights;

/* The scales that the model was fine-tuned for, if these widths are the ones; else NULL. */
static inline const sf_scales *sf_settled_scales(const sf_model *model, const sf_quant_widths *widths)
{
  const bool same = model->scales.weight_bits && model->scales.weight_bits == widths->weight_bits &&
                    widths->feature_bits == SF_INPUT_BITS && widths->grid_bits == SF_GRID_BITS;
  return same ? &model->scales : NULL;
}

/* The largest value of a symmetric signed number of `bits` bits. */
static inline int sf_symmetric_max(int bits)
{
  return (1 << (bits - 1)) - 1;
}

/* factor = mul / 2^shift with 16 significant bits where a shifter of at most shift_max allows; false when factor is too
 * large. */
bool sf_quant_scale(double factor, int shift_max, int bias, fx_scale *scale);

/* Chooses the unit and the int8 weights q[n_in][SF_LANES] that minimise the squared error of the currents.
 * `refine` false stops after the search for the unit. */
sf_status sf_fit_layer(const sf_fit_data *data, const sf_fit_weights *weights, bool refine, int8_t *q,
                       sf_quant_layer *result);

/* Grid tables and the LSB of each level's features. Writes scene->grid (allocated) and scene->units.feature_scale. Here
 * and below report->widths are the widths to keep to. */
void sf_quantise_levels(fx_grid *grid, const sf_model *model);
void sf_quantise_grid(fx_scene *scene, const sf_model *model, const sf_calibration *calibration,
                      sf_quant_report *report);

/* Layers in order; scene->units.feature_scale and the grid are ready. */
sf_status sf_quantise_layers(fx_scene *scene, const sf_model *model, const char *name,
                             const sf_calibration *calibration, sf_quant_report *report);

/* Entries that a position in [low, high] reads of a level: corners base[0..2] to last[0..2], inclusive. The same cell
 * rule as src/fx/grid.c. */
typedef struct sf_corners {
  uint32_t base[3], last[3];
} sf_corners;
sf_corners sf_grid_corners(const fx_grid *grid, int level, const uint32_t low[3], const uint32_t high[3]);
int64_t sf_grid_entry(const fx_grid *grid, int level, uint32_t x, uint32_t y, uint32_t z);
/* Copies a level into table `to` of 2^log2_size hashed entries (log2_size < 0: as it is). */
void sf_grid_copy_level(const fx_grid *grid, int level, int log2_size, const uint64_t *use, int8_t *to, double *sum);
#endif
