/* Float to fixed: the only bridge between the float model and src/fx. */
#ifndef SF_QUANT_QUANT_H
#define SF_QUANT_QUANT_H
#include "fx/fx.h"
#include "snn/model.h"
#include "scene/scene.h"

/* Bits of what a scene holds; 0 = those that the model was fine-tuned for, else the widest, which is what the core
 * takes. A narrower scene runs on the unchanged core, and hardware of these widths computes the same bits: nothing that
 * it would have to clip can occur (see fx_grid_features: a feature is a convex combination of entries; the sums of D2's
 * columns bound h; harmonics are below 3/4). */
typedef struct sf_quant_widths {
  int weight_bits;  /* 2..SF_WEIGHT_BITS: |w| < 2^(bits-1) */
  int feature_bits; /* 8..SF_INPUT_BITS: inputs of D1 and C1 (f, d, h), |x| < 2^(bits-1); hash grids alone */
  int leak_bits;    /* 4..SF_LEAK_FRAC: fraction bits of k; the others are 0 */
  int grid_bits;    /* 2..SF_GRID_BITS: entries of a grid, of planes and lines, |e| < 2^(bits-1) */
} sf_quant_widths;

typedef struct sf_quant_options {
  int steps;           /* 0 = the model's t_r; else 1..T */
  float background[3]; /* 0..1 */
  uint64_t seed;
  sf_quant_widths widths;
} sf_quant_options;

/* Quantises field and nets. Scales are chosen by the error of each layer's currents on calibration positions
 * drawn from occupied cells. Refuses what the hardware cannot represent (NaN, Inf, layer sizes, theta or scale that
 * rounds out of range, widths out of range), naming file and tensor. The result passes fx_scene_check. Spiking nets
 * only. */
sf_status sf_quantise(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options);

/* What quantisation cost, measured on calibration samples that took no part in the fit. */
typedef struct sf_quant_layer {
  double unit;     /* value of one LSB of the layer's current */
  double error;    /* RMS error of the currents / RMS of the currents; 0 when the layer is silent */
  int32_t clipped; /* weights beyond the largest that weight_bits hold */
} sf_quant_layer;
typedef struct sf_quant_report {
  sf_quant_layer layer[SF_LAYERS];
  double feature_error;   /* as above, for the field's features */
  int64_t grid_clipped;   /* entries of the field beyond the largest that grid_bits hold */
  int32_t samples;        /* calibration samples */
  sf_quant_widths widths; /* as used: no zeros */
  sf_scales scales;       /* as chosen, or the model's own if it was fine-tuned for these widths */
  sf_quant_widths unused; /* that it was fine-tuned for, where those above are others; else zeros */
  int64_t packed_bytes;   /* sf_packed_bytes */
} sf_quant_report;
sf_status sf_quantise_report(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options,
                             sf_quant_report *report);

/* Weights, grid and occupancy at these widths (no zeros) without padding. */
int64_t sf_packed_bytes(const fx_scene *scene, const sf_quant_widths *widths);

/* ---- trimming: a scene without the parts that it does not need ---- */

enum { SF_CELL_CLASSES = 16 };
typedef enum { SF_OF_DENSITY, SF_OF_APPEARANCE, SF_FACTORS } sf_factors_id; /* of TensoRF's planes and lines */

/* Of TensoRF's field. low, high: grid points of the scene at the ends of the box; from one to the other there are
 * `points` on an axis. */
typedef struct sf_trim_planes {
  bool component[SF_FACTORS][FX_PAIRS][FX_COMPONENTS_MAX];
  bool feature[FX_APPEARANCE_MAX]; /* with its sines and cosines */
  int32_t feature_freqs, view_freqs;
  int32_t low[3], high[3], points[3];
  int32_t stride_q16; /* distance of samples in the scene's, 65536 = as it is */
  int32_t weight_stop;
} sf_trim_planes;

/* Which parts of a scene stay. All time steps, thresholds and weights keep their meaning, so the result is an ordinary
 * scene. */
typedef struct sf_trim {
  bool neuron[SF_LAYERS][SF_LANES]; /* D1, C1, C2; of D2 the outputs: [0] is the density and always stays */
  bool level[FX_LEVELS_MAX];        /* of the grid, with their two features */
  int32_t log2_size[FX_LEVELS_MAX]; /* -1: the level's table as it is; else hashed into this many entries */
  int32_t directions;               /* leading spherical harmonics, >= 1 unless the scene has none */
  sf_trim_planes planes;
  int32_t steps, trans_stop;   /* as in fx_net, fx_scene */
  bool cells[SF_CELL_CLASSES]; /* occupancy cells by class (sf_cell_class): all of a class stay or go */
} sf_trim;
static inline int sf_count_kept(const bool *kept, int n)
{
  int sum = 0;
  for (int i = 0; i < n; i++) sum += kept[i];
  return sum;
}

/* What the samples of a set of rays used. Counts of samples x steps but where it says otherwise. */
typedef struct sf_trim_use {
  uint64_t samples, steps;                                     /* through the nets; samples x steps */
  uint64_t fired[SF_LAYERS][SF_LANES];                         /* spikes; of D2: outputs h that were not 0 */
  uint64_t feature[SF_FEATURE_MAX];                            /* samples in which the feature was not 0 */
  int64_t input[SF_DIR_MAX];                                   /* of a decoder: sum over the samples */
  uint64_t component[SF_FACTORS][FX_PAIRS][FX_COMPONENTS_MAX]; /* samples to which its product gave something */
  uint64_t power[SF_FACTORS][FX_PAIRS][FX_COMPONENTS_MAX];     /* sum of weight and squared product */
  uint64_t *entry;            /* [entries] sum over the samples that read the entry of compositing weight + 1 LSB */
  int64_t cells;              /* of all cascades */
  uint64_t *visits, *weight2; /* [cells] samples; sum of their squared compositing weights, Q.40 */
  fx_scene *shaped;           /* sf_trim_apply's own: the planes last resampled, and for which box and points */
  sf_trim_planes shape;
} sf_trim_use;
sf_status sf_trim_use_create(sf_trim_use *use, const fx_scene *scene);
void sf_trim_use_free(sf_trim_use *use);
/* One sample, from many threads at once. net: f[fx_net_inputs] and what they caused; place: weight is what it
 * contributed to its ray, Q.TRANS_FRAC; factors: the products at a position. */
void sf_trim_use_net(sf_trim_use *use, const fx_net *net, const int16_t *f, const fx_trace *trace);
void sf_trim_use_place(sf_trim_use *use, const fx_scene *scene, const uint32_t pos[3], int64_t cell, uint32_t weight);
void sf_trim_use_factors(sf_trim_use *use, const fx_tensorf *field, sf_factors_id which, const uint32_t pos[3],
                         uint32_t weight);

/* Mean squared weight of a cell's samples by octave, as if one more had been seen whole (Laplace's rule of
 * succession): few samples are no proof that a cell is empty. 0: 1.0 or no samples. */
int sf_cell_class(const sf_trim_use *use, int64_t cell);

/* Everything stays. */
void sf_trim_all(const fx_scene *scene, sf_trim *trim);
/* Then without what changes nothing on the rays of `use`: neurons that never fired or have no weights to what stays,
 * harmonics, levels, components, features and sines likewise. At least one of each kind stays. */
void sf_trim_exact(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim);
/* A scene of its own (fx_scene_free). Entries that meet in a smaller table are averaged by their use. Where a layer has
 * a bias, what goes of its inputs leaves its mean there. */
sf_status sf_trim_apply(const fx_scene *scene, const sf_trim *trim, sf_trim_use *use, const char *name,
                        fx_scene *result);

/* Outputs that must stay in a layer: one, and one h where C1 has no other input. */
int sf_trim_least(const sf_trim *trim, int layer);
/* log2 of the next smaller table of a level under this trim; -1 at one entry. */
int sf_trim_smaller(const fx_scene *scene, const sf_trim *trim, int level);
int64_t sf_grid_level_entries(const fx_grid *grid, int level);

/* Of planes; each says whether anything went. Of `parts` parts of an axis' points one goes; the box down to the cells
 * that stay; the least used components of a pair, as many as fill its last line of memory. */
bool sf_trim_points(sf_trim *trim, int axis, int parts);
bool sf_trim_box(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim);
bool sf_trim_line(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, sf_factors_id which, int pair);

/* Zeroes the entries of the field, or all components of points of planes and lines, that no position in an occupied
 * cell reads: no ray sees a difference. SF_E_MEMORY. */
sf_status sf_trim_zero_unread(fx_scene *scene, const char *name);

/* sf_dataset_load at the scale that the scene was trained at; where the scene does not tell, as the options say.
 * Options with another scale are refused, and another scene's data (sf_space_check): SF_E_RANGE. Of a scene that does
 * not say what data it learned from, another scale or bound is a warning. name: the scene's file, for messages. */
sf_status sf_fx_dataset_load(sf_dataset *data, const fx_scene *scene, const char *name, const char *dir,
                             const char *split, const sf_dataset_options *options);
/* A world ray (sf_camera_ray already in model units) to box units and integer spherical harmonics. Non-finite input
 * is refused, and a ray whose first point is 32768 lattice steps away or farther: no first_q16 could tell. */
sf_status sf_fx_ray_make(const fx_scene *scene, const float origin[3], const float direction[3], fx_ray *ray);
/* The direction alone, of any length > 0: unit and dir of the ray, whose other fields become 0, and unit in doubles. */
sf_status sf_fx_direction_make(const fx_scene *scene, const float direction[3], fx_ray *ray, double unit[3]);
/* dir_scale as the shift that fx_sh takes: 2^-frac. */
int sf_fx_dir_frac(const fx_scene *scene);
/* A point in model units to the box, Q0.24. SF_E_RANGE when it is outside or not finite. */
sf_status sf_fx_position_make(const fx_scene *scene, const float position[3], uint32_t box[3]);

/* Fixed values back to units for comparison: per model unit, 0..1. */
double sf_fx_sigma_value(const fx_scene *scene, uint32_t sigma);
double sf_fx_colour_value(uint32_t colour);
#endif
