/* Adam (Kingma & Ba 2015), bias corrected; memory bound. A parameter without a gradient stays as it is, moments
 * included (instant-ngp's rule for hash tables): most entries of the fine levels are not read in an iteration, and
 * sixteen that are not cost one load.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_ADAM_ISA_H
#define SF_SNN_ADAM_ISA_H
#include "snn/kernels.h"
#include <math.h>
#include <string.h>

enum { ADAM_CHUNK = 16 };

typedef struct adam_factors {
  float b1, b2, rate, root, eps, l1;
} adam_factors;

static inline bool any_gradient(const float *g)
{
  uint32_t bits[ADAM_CHUNK], all = 0;
  memcpy(bits, g, sizeof bits);
#pragma omp simd reduction(| : all)
  for (int i = 0; i < ADAM_CHUNK; i++) all |= bits[i] << 1; /* -0 is no gradient */
  return all != 0;
}

static inline __attribute__((always_inline)) void adam_chunk(adam_factors a, size_t n, float *restrict value,
                                                             float *restrict grad, float *restrict m, float *restrict v)
{
#pragma omp simd
  for (size_t j = 0; j < n; j++) {
    const float g = grad[j];
    const bool touched = g != 0; /* NaN too */
    const float first = a.b1 * m[j] + (1 - a.b1) * g, second = a.b2 * v[j] + (1 - a.b2) * g * g;
    const float step = a.rate * first / (sqrtf(second) * a.root + a.eps);
    value[j] -= touched ? step : 0;
    m[j] = touched ? first : m[j];
    v[j] = touched ? second : v[j];
    grad[j] = 0;
  }
}

static void adam_update(const sf_adam *adam, size_t n, float *value, float *grad, float *m, float *v)
{
  const double c1 = 1 - pow(adam->beta1, (double)adam->step), c2 = 1 - pow(adam->beta2, (double)adam->step);
  const adam_factors a = {(float)adam->beta1,    (float)adam->beta2,   (float)(adam->lr / c1),
                          (float)(1 / sqrt(c2)), (float)adam->epsilon, adam->l1};
  size_t i = 0;
  if (a.l1 > 0)
    for (size_t j = 0; j < n; j++) grad[j] += value[j] > 0 ? a.l1 : value[j] < 0 ? -a.l1 : 0;
  for (; i + ADAM_CHUNK <= n; i += ADAM_CHUNK)
    if (any_gradient(grad + i)) adam_chunk(a, ADAM_CHUNK, value + i, grad + i, m + i, v + i);
  adam_chunk(a, n - i, value + i, grad + i, m + i, v + i);
}
#endif
