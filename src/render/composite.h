/* Volume rendering of one ray (Max 1995; NeRF eq. 3), forward and backward, for one prefix of the
 * unrolling. n samples front to back, intervals of length delta[n]. */
#ifndef SF_RENDER_COMPOSITE_H
#define SF_RENDER_COMPOSITE_H
#include <stddef.h>

/* alpha_s = 1 - exp(-sigma_s delta_s), w_s = alpha_s prod_{j<s} (1 - alpha_j). Returns the transmittance behind. */
float sf_composite_weights(int n, const float *sigma, const float *delta, float *weight);
/* rgb = sum w_s colour_s + transmittance * background. colour[n][3]. */
void sf_composite_colour(int n, const float *weight, const float *colour, float transmittance,
                         const float background[3], float rgb[3]);
/* Adds d/dsigma to dsigma[n], given g_s = dL/dw_s and the gradient of the transmittance behind. */
void sf_composite_backward(int n, const float *weight, float transmittance, const float *delta, const float *g,
                           float g_transmittance, float *dsigma);
#endif
