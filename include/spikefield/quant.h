/* Float to fixed: the only bridge between the float model and src/fx. */
#ifndef SPIKEFIELD_QUANT_H
#define SPIKEFIELD_QUANT_H
#include "spikefield/fx.h"
#include "spikefield/model.h"
#include "spikefield/scene.h"

/* Bits of what a scene holds; 0 = the widest, which is what the core takes. A narrower scene runs on the unchanged
 * core, and hardware of these widths computes the same bits: nothing that it would have to clip can occur (see
 * fx_grid_features: a feature is a convex combination of entries; the sums of D2's columns bound h; harmonics are below
 * 3/4). */
enum { SF_GRID_BITS = 8 };
typedef struct sf_quant_widths {
  int weight_bits;  /* 2..SF_WEIGHT_BITS: |w| < 2^(bits-1); 0 = those that the model was fine-tuned for, if it was */
  int feature_bits; /* 8..SF_INPUT_BITS: inputs of D1 and C1 (f, d, h), |x| < 2^(bits-1) */
  int leak_bits;    /* 4..SF_LEAK_FRAC: fraction bits of k; the others are 0 */
  int grid_bits;    /* 2..SF_GRID_BITS: grid entries, |e| < 2^(bits-1) */
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
  double feature_error;   /* as above, for the grid features */
  int64_t grid_clipped;   /* grid entries beyond the largest that grid_bits hold */
  int32_t samples;        /* calibration samples */
  sf_quant_widths widths; /* as used: no zeros */
  sf_scales scales;       /* as chosen, or the model's own if it was fine-tuned for these widths */
  int64_t packed_bytes;   /* weights, grid and occupancy at these widths without padding; a few scalars are left out */
} sf_quant_report;
sf_status sf_quantise_report(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options,
                             sf_quant_report *report);

/* A world ray (sf_camera_ray already in model units) to box units and integer spherical harmonics. Non-finite input
 * is refused. */
sf_status sf_fx_ray_make(const fx_scene *scene, const float origin[3], const float direction[3], fx_ray *ray);
/* A point in model units to the box, Q0.24. SF_E_RANGE when it is outside or not finite. */
sf_status sf_fx_position_make(const fx_scene *scene, const float position[3], uint32_t box[3]);

/* Fixed values back to units for comparison: per model unit, 0..1. */
double sf_fx_sigma_value(uint32_t sigma);
double sf_fx_colour_value(uint32_t colour);
#endif
