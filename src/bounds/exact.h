/* Inside src/bounds: the fixed-point core once more in double precision, where each block can be the fixed one or the
 * one of real numbers. All values are in LSB of the fixed formats; with no block exact every bit is the core's. */
#ifndef SF_BOUNDS_EXACT_H
#define SF_BOUNDS_EXACT_H
#include "bounds/exact_field.h"

typedef struct sf_exact_out {
  double sigma, colour[3];
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS];
} sf_exact_out;

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
#endif
