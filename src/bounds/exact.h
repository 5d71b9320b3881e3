/* Inside src/bounds: the fixed-point core once more in double precision, where each block can be the fixed one or the
 * one of real numbers. All values are in LSB of the fixed formats; with no block exact every bit is the core's. */
#ifndef SF_BOUNDS_EXACT_H
#define SF_BOUNDS_EXACT_H
#include "bounds/bounds.h"
#include <math.h>

/* Entry of a corner of a cell: bit 0 of `corner` = x + 1, bit 1 = y + 1, bit 2 = z + 1. */
static inline int64_t sf_exact_entry(const fx_grid *grid, int level, const uint32_t base[3], uint32_t corner)
{
  const uint32_t x = base[0] + (corner & 1), y = base[1] + (corner >> 1 & 1), z = base[2] + (corner >> 2 & 1);
  const uint64_t s = (uint64_t)grid->stride[level], hash = x ^ y * 2654435761u ^ z * 805459861u;
  return grid->offset[level] + (int64_t)(s ? x + s * y + s * s * z : hash % (1u << grid->log2_size[level]));
}

enum { SF_EXACT_DIRECTIONS = 3 + 6 * FX_FREQS_MAX > FX_SH ? 3 + 6 * FX_FREQS_MAX : FX_SH };
struct sf_exact_planes; /* of TensoRF: exact_planes.c */

/* One choice of blocks. Weights in the units of the integer ones: float weight * LSB of its input / LSB of the current.
 */
typedef struct sf_exact {
  const fx_scene *scene;
  const sf_model *model;
  uint32_t mask;                         /* bit per sf_exact_id */
  double k[SF_LAYERS], theta[SF_LAYERS]; /* U1.12; membrane LSB */
  sf_steps steps;                        /* of the float model's rays */
  double *w[SF_LAYERS];                  /* [fx_layer_rows][SF_LANES], owned */
  struct sf_exact_planes *planes;        /* owned; NULL: a hash grid */
  double weight_stop;                    /* TensoRF: a sample of at most this weight is not decoded, LSB of Q.20 */
} sf_exact;

typedef struct sf_exact_out {
  double sigma, colour[3];
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS];
} sf_exact_out;

static inline bool sf_exact_is(const sf_exact *e, sf_exact_id id)
{
  return e->mask >> id & 1;
}

static inline double sf_exact_round(double x)
{
  return floor(x + 0.5);
}

static inline double sf_exact_clamp(double x, double low, double high)
{
  return fmin(fmax(x, low), high);
}

/* The scene's weights of a layer are the model's, rounded and, where inputs are silent, clipped: a quarter of their
 * power apart at most. */
bool sf_exact_resembles(const fx_scene *scene, const sf_model *model, int layer);
sf_status sf_exact_open(sf_exact *exact, const fx_scene *scene, const sf_model *model, uint32_t mask);
void sf_exact_close(sf_exact *exact);
/* Current into C1 of its constant inputs x[fx_net_constants] and of its bias, base[SF_LANES]. */
void sf_exact_direction(const sf_exact *exact, const double *x, double *base);
/* f[n_feature] in LSB of the features; a decoder reads none. */
void sf_exact_sample(const sf_exact *exact, const double *f, const double *base, sf_exact_out *out);
/* Transmittance (LSB of Q.20) behind sample n of a ray. */
double sf_exact_behind(const sf_exact *exact, int32_t n, double transmittance, double sigma);
/* Where the middle of interval n lies behind that of interval 0, and how long it is, Q0.24 of the box: of the float
 * model, whatever the blocks. */
double sf_exact_distance(const sf_exact *exact, int32_t n);
double sf_exact_length(const sf_exact *exact, int32_t n);

/* ---- fields: pos[3] in Q0.24 ---- */

/* Hash grid: f[n_feature]. */
void sf_exact_features(const sf_exact *exact, const double pos[3], double *f);

/* TensoRF. sf_exact_planes_open is sf_exact_open's part. */
sf_status sf_exact_planes_open(sf_exact *exact);
void sf_exact_planes_close(sf_exact *exact);
/* Density, U16.12 per box edge. */
double sf_exact_planes_sigma(const sf_exact *exact, const double pos[3]);
/* A direction's inputs of the decoder in LSB: itself, sines, cosines. Returns how many, at most
 * SF_EXACT_DIRECTIONS. */
int sf_exact_planes_direction(const sf_exact *exact, const double unit[3], double *direction);
/* All inputs of the decoder, those of the direction given: x[fx_tensorf_inputs]. */
void sf_exact_planes_inputs(const sf_exact *exact, const double pos[3], const double *direction, double *x);
#endif
