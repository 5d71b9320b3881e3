/* Inside src/quant. */
#ifndef SF_QUANT_INTERNAL_H
#define SF_QUANT_INTERNAL_H
#include "quant/quant.h"

/* Calibration samples: positions with random directions, and what the float field and nets do there. A row of a layer's
 * data is one step of one sample; where C1 has no input that changes with the step, its row is the sample.
 * Of radix every layer has one row of a sample: a spike train is a number below 2^steps, and the target of a layer that
 * gets them is the sum of its currents with the digits' weights as whole numbers, as fx_weigh adds up. */
typedef struct sf_calibration {
  int samples, steps;
  int features, constants; /* of the field; inputs of C1 that come with the sample: harmonics, or all of a decoder's */
  int digits;              /* of a spike train: steps of radix, else 0 */
  int per_sample[SF_LAYERS];  /* rows of a sample; 0: the net has no such layer */
  uint32_t *pos;              /* [samples][3] Q0.24 */
  float *f, *constant;        /* [samples][features], [samples][constants] */
  float *target[SF_LAYERS];   /* [rows][n_out] currents of the float nets */
  uint8_t *spikes[SF_LAYERS]; /* [samples * steps, of radix samples][n_out] of D1, C1, C2 */
} sf_calibration;
sf_status sf_calibrate(sf_calibration *calibration, const sf_model *model, int steps, uint64_t seed);
void sf_calibration_free(sf_calibration *calibration);

/* What is particular to a field; the rest of the quantiser is one for all. report->widths are the widths to keep to. */
typedef struct sf_field_quantiser {
  uint64_t direction_stream; /* of sf_random */
  int tried, coarsest; /* LSBs 2^n of directions and encodings: finer ones than `tried` all compete, coarser ones up to
                          `coarsest` while they help */
  int (*features)(const sf_model *model);                      /* that a position has */
  sf_status (*check)(const sf_model *model, const char *name); /* NULL: nothing to refuse */
  /* Sizes of the field in the scene, before it is allocated; then the place of the box and the steps in it. */
  sf_status (*set_sizes)(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_widths *widths);
  void (*set_scalars)(fx_scene *scene, const sf_model *model);
  /* Positions of all samples; then one sample through field and nets: f, constant, trace. */
  sf_status (*draw)(sf_calibration *calibration, const sf_model *model, uint64_t seed);
  void (*sample)(const sf_model *model, const float x[3], const float direction[3], int steps, float *f,
                 float *constant, sf_net_trace *trace);
  /* The field's numbers, and units.feature_scale; in report->scales what only the field knows. */
  sf_status (*quantise)(fx_scene *scene, const sf_model *model, const char *name, const sf_calibration *calibration,
                        sf_quant_report *report);
  /* The LSBs that C1's inputs got, of features and of encodings; NULL: no C1 input is the field's own. */
  void (*set_inputs)(fx_scene *scene, double feature, double encoding);
} sf_field_quantiser;
extern const sf_field_quantiser sf_grid_quantiser, sf_tensorf_quantiser;

static inline const sf_field_quantiser *sf_field_quantiser_of(const sf_model *model)
{
  return sf_model_decodes(model) ? &sf_tensorf_quantiser : &sf_grid_quantiser;
}

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
                    widths->feature_bits == SF_INPUT_BITS && widths->grid_bits == model->scales.grid_bits;
  return same ? &model->scales : NULL;
}

/* factor = mul / 2^shift with 16 significant bits where a shifter of at most shift_max allows; false when factor is too
 * large. */
bool sf_quant_scale(double factor, int shift_max, int bias, fx_scale *scale);

/* Chooses the unit and the int8 weights q[n_in][SF_LANES] that minimise the squared error of the currents.
 * `refine` false stops after the search for the unit. */
sf_status sf_fit_layer(const sf_fit_data *data, const sf_fit_weights *weights, bool refine, int8_t *q,
                       sf_quant_layer *result);

/* The hash grid's geometry alone: what fx_scene_allocate needs; then its tables and the LSB of each level's features.
 */
void sf_quantise_levels(fx_grid *grid, const sf_model *model);
sf_status sf_quantise_grid(fx_scene *scene, const sf_model *model, const char *name, const sf_calibration *calibration,
                           sf_quant_report *report);

/* Planes, lines, and the scales from their products to density and features. */
sf_status sf_quantise_factors(fx_scene *scene, const sf_model *model, const char *name,
                              const sf_calibration *calibration, sf_quant_report *report);

/* Layers in order; the field is ready. */
sf_status sf_quantise_layers(fx_scene *scene, const sf_model *model, const char *name,
                             const sf_calibration *calibration, sf_quant_report *report);

/* A sample's position as the float field takes it. */
static inline void sf_calibration_position(const uint32_t pos[3], float x[3])
{
  for (int axis = 0; axis < 3; axis++) x[axis] = (float)pos[axis] * 0x1p-24f;
}

/* Entries that a position in [low, high] reads of a level: corners base[0..2] to last[0..2], inclusive. The same cell
 * rule as src/fx/grid.c. */
typedef struct sf_corners {
  uint32_t base[3], last[3];
} sf_corners;
sf_corners sf_grid_corners(const fx_grid *grid, int level, const uint32_t low[3], const uint32_t high[3]);
int64_t sf_grid_entry(const fx_grid *grid, int level, uint32_t x, uint32_t y, uint32_t z);
/* Copies a level into table `to` of 2^log2_size hashed entries (log2_size < 0: as it is). */
void sf_grid_copy_level(const fx_grid *grid, int level, int log2_size, const uint64_t *use, int8_t *to, double *sum);
void sf_grid_use_entries(sf_trim_use *use, const fx_grid *grid, const uint32_t pos[3], uint32_t weight);
/* Zeroes entries that no occupied cell reads; how many are zero then, or -1 without memory. */
int64_t sf_grid_zero_unread(fx_scene *scene);

/* What is particular to a field when a scene is trimmed; nets, time steps and occupancy are one for all. */
typedef struct sf_field_trimmer {
  sf_status (*use_create)(sf_trim_use *use, const fx_scene *scene);
  void (*all)(const fx_scene *scene, sf_trim *trim);
  void (*exact)(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim); /* neurons are settled */
  /* Of the inputs of the first layer those that stay. */
  void (*inputs)(const fx_scene *scene, const sf_trim *trim, bool *row);
  void (*set_sizes)(const fx_scene *scene, const sf_trim *trim, fx_scene *result);
  /* The field's numbers; result->occupancy holds the cells that stay, in the scene's box. */
  sf_status (*fill)(const fx_scene *scene, const sf_trim *trim, sf_trim_use *use, const char *name, fx_scene *result);
  int64_t (*zero_unread)(fx_scene *scene); /* returns how many entries are zero then, or -1 without memory */
} sf_field_trimmer;
extern const sf_field_trimmer sf_grid_trimmer, sf_planes_trimmer;

static inline int64_t sf_cells_of(const fx_scene *scene)
{
  return (int64_t)(scene->log2_bound + 1) * scene->occ_res * scene->occ_res * scene->occ_res;
}
/* The scene's cells that stay, in occupancy. */
void sf_trim_cells(const fx_scene *scene, const sf_trim *trim, const sf_trim_use *use, uint8_t *occupancy);

enum { SF_STRIDE_ONE = 1 << 16 };
static inline const fx_factors *sf_factors_of(const fx_tensorf *field, int which)
{
  return which == SF_OF_DENSITY ? &field->density : &field->appearance;
}
/* The trim's box: its place and what is measured in its longest edge; the cells of result, which are the scene's, in
 * it; the field in it, on the trim's points and with everything else. The last field is kept in `use`: of the many cuts
 * that are tried few change it. */
void sf_planes_set_box(const fx_scene *scene, const sf_trim_planes *p, fx_scene *result);
sf_status sf_planes_crop(const fx_scene *scene, const sf_trim_planes *p, const char *name, fx_scene *result);
sf_status sf_planes_shape(const fx_scene *scene, const sf_trim_planes *p, sf_trim_use *use, const char *name,
                          const fx_tensorf **field);
int64_t sf_planes_zero_unread(fx_scene *scene);

/* Whether a row of weights has one that is not 0, in columns that stay. */
static inline bool sf_row_matters(const fx_layer *layer, int row, const bool *column)
{
  for (int o = 0; o < layer->n_out; o++)
    if (column[o] && layer->w[(size_t)row * SF_LANES + (size_t)o]) return true;
  return false;
}

/* The function that is linear between n_from points low..high of from[rows][n_from][n], as the nearest one (least
 * squares) that is linear between n_to points: to[rows][n_to][n]. Taps are the matrix that does it. */
typedef struct sf_taps {
  int n_to, width;
  int *first;    /* [n_to] of the points that a new one is made of */
  float *weight; /* [n_to][width] */
} sf_taps;
sf_status sf_taps_make(sf_taps *taps, int low, int high, int n_to);
void sf_taps_free(sf_taps *taps);
/* An old axis of n_from points; what they have, n numbers, lies side by side. */
void sf_taps_apply(const sf_taps *taps, const float *from, size_t rows, size_t n_from, size_t n, float *to);
#endif
