/* The TensoRF backbone (Chen et al. 2022, VM decomposition): density and appearance of a point from three planes and
 * three lines, and a spiking colour decoder. What is particular to it; the model itself is an sf_model.
 *
 * A point x in [0,1]^3 of the field's box lies at x_a (resolution_a - 1) between the grid points of axis a, as
 * grid_sample with align_corners. Mode m has a plane over two axes and a line along the third:
 *   m = 0: plane (x, y), line z;   m = 1: plane (x, z), line y;   m = 2: plane (y, z), line x.
 * density feature = sum_m sum_c plane_m[c] line_m[c]; sigma = distance_scale * activation(feature)
 * products        = plane_m[c] line_m[c], m slowest;  appearance[features] = basis products
 * decoder input   = appearance | direction | sin, cos of appearance 2^f | sin, cos of direction 2^f
 *                   (each group: component slowest, f fastest; all sines, then all cosines) */
#ifndef SF_FIELD_TENSORF_H
#define SF_FIELD_TENSORF_H
#include "base/status.h"
#include <stdint.h>

struct sf_config;
struct sf_model;

typedef enum { SF_SOFTPLUS, SF_RELU } sf_activation;

typedef struct sf_tensorf {
  float box[2][3];       /* lowest and highest corner, model units */
  int32_t resolution[3]; /* grid points along x, y, z */
  int32_t density[3];    /* components per mode, multiples of 4, at most SF_COMPONENTS_MAX */
  int32_t appearance[3]; /* the same */
  int32_t features;      /* appearance features */
  int32_t feature_freqs; /* frequencies of their encoding, 0 = none */
  int32_t view_freqs;    /* of the direction's */
  int32_t activation;    /* sf_activation: log(1 + e^(feature + shift)), or max(feature + shift, 0) */
  float shift;
  float distance_scale; /* density per model unit = distance_scale * activation */
  float step_ratio;     /* distance of two samples over the mean edge of a voxel */
  float near, far;      /* samples lie at these distances from the origin of a ray, model units, within the box */
  int32_t ndc;          /* 1: rays come in normalised device coordinates (forward-facing scenes) */
  double weight_stop;   /* a sample of at most this weight takes its light, but is not decoded. 1e-6..0.05 */
} sf_tensorf;

#define SF_WEIGHT_STOP_MIN 1e-6 /* of weight_stop: fixed point holds 2^-20 */
#define SF_WEIGHT_STOP_MAX 0.05
#define SF_WEIGHT_STOP_FIRST 1e-4 /* TensoRF's, where a training begins; of files that do not say, too */
enum { SF_COMPONENTS_MAX = 48, SF_APPEARANCE_MAX = 32, SF_DECODER_MAX = 160, SF_FREQS_MAX = 4 };

/* Axes of mode m: the plane's columns, its rows, the line. */
extern const int sf_tensorf_axis[3][3];

/* A Blender scene of `scale` model units per world unit: box +-1.5 world units, 16 and 48 components, encodings 2/2;
 * or, with ndc, a forward-facing scene: 16,4,4 and 48,12,12 components, no encodings, ReLU. */
struct sf_config sf_tensorf_default(float scale, int ndc);
/* For a scene in units of its own: the box [-bound, bound]^3 model units, all of it seen from SF_NEAR on, and the
 * Blender scene's densities in its half edge. */
void sf_tensorf_bound(struct sf_config *config, int bound);
sf_status sf_tensorf_check(const sf_tensorf *field);
/* Grid points per axis of about `voxels` voxels, cubes, in the box. */
void sf_tensorf_resolution(float box[2][3], double voxels, int32_t resolution[3]);

static inline int sf_tensorf_products(const sf_tensorf *f)
{
  return f->appearance[0] + f->appearance[1] + f->appearance[2];
}

/* Inputs of the decoder: 150 with encodings 2/2, 30 without. */
static inline int sf_tensorf_inputs(const sf_tensorf *f)
{
  return f->features * (1 + 2 * f->feature_freqs) + 3 * (1 + 2 * f->view_freqs);
}

/* Distance of two samples of a ray, model units; a ray has at most 1024. */
float sf_tensorf_step(const sf_tensorf *field);

/* Scalar and obvious: the oracles of the kernels. x: position in [0,1]^3 of the box. */
float sf_tensorf_density_feature(const struct sf_model *model, const float x[3]);
/* Density per model unit of a density feature. */
float sf_tensorf_sigma(const sf_tensorf *field, float feature);
void sf_tensorf_appearance(const struct sf_model *model, const float x[3], float *features);
/* in[inputs] of appearance features and the unit direction of the ray. */
void sf_tensorf_encode(const sf_tensorf *field, const float *features, const float direction[3], float *in);
#endif
