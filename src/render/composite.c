#include "render/composite.h"
#include <math.h>

float sf_composite_weights(int n, const float *sigma, const float *delta, float *weight)
{
  float transmittance = 1;
  for (int s = 0; s < n; s++) {
    float behind = transmittance * expf(-sigma[s] * delta[s]);
    weight[s] = transmittance - behind;
    transmittance = behind;
  }
  return transmittance;
}

void sf_composite_colour(int n, const float *weight, const float *colour, float transmittance,
                         const float background[3], float rgb[3])
{
  for (int a = 0; a < 3; a++) rgb[a] = transmittance * background[a];
  for (int s = 0; s < n; s++)
    for (int a = 0; a < 3; a++) rgb[a] += weight[s] * colour[3 * s + a];
}

/* dL/dsigma_s = delta * (T_{s+1} g_s - sum_{j>s} w_j g_j - T_end g_end): no division by 1 - alpha. */
void sf_composite_backward(int n, const float *weight, float transmittance, const float *delta, const float *g,
                           float g_transmittance, float *dsigma)
{
  float behind = transmittance, tail = transmittance * g_transmittance;
  for (int s = n - 1; s >= 0; s--) {
    dsigma[s] += delta[s] * (behind * g[s] - tail);
    tail += weight[s] * g[s];
    behind += weight[s];
  }
}
