/* Inside src/bounds: one choice of blocks, and the fields with it. pos[3] in Q0.24. */
#ifndef SF_BOUNDS_EXACT_FIELD_H
#define SF_BOUNDS_EXACT_FIELD_H
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
