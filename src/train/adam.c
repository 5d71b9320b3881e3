/* Adam (Kingma & Ba 2015), bias corrected; memory bound. A parameter without a gradient stays as it is, moments
 * included (instant-ngp's rule for hash tables): most entries of the fine levels are not read in an iteration, and
 * sixteen that are not cost one load. */
#include "train/internal.h"
#include <math.h>
#include <string.h>

enum { CHUNK = 16 };

static inline bool any(const float *g)
{
  uint32_t bits[CHUNK], all = 0;
  memcpy(bits, g, sizeof bits);
  for (int i = 0; i < CHUNK; i++) all |= bits[i] << 1; /* -0 is no gradient */
  return all != 0;
}

void sf_adam_update(const sf_adam *a, size_t n, float *value, float *grad, float *m, float *v)
{
  const float b1 = (float)a->beta1, b2 = (float)a->beta2, eps = (float)a->epsilon;
  const double c1 = 1 - pow(a->beta1, (double)a->step), c2 = 1 - pow(a->beta2, (double)a->step);
  const float rate = (float)(a->lr / c1), root = (float)(1 / sqrt(c2));
  for (size_t i = 0; i < n; i += CHUNK) {
    const size_t end = i + CHUNK < n ? i + CHUNK : n;
    for (size_t j = i; a->l1 > 0 && j < end; j++) grad[j] += value[j] > 0 ? a->l1 : value[j] < 0 ? -a->l1 : 0;
    if (end - i == CHUNK && !any(grad + i)) continue;
#pragma omp simd
    for (size_t j = i; j < end; j++) {
      const float g = grad[j];
      const bool touched = g != 0; /* NaN too */
      const float first = b1 * m[j] + (1 - b1) * g, second = b2 * v[j] + (1 - b2) * g * g;
      const float step = rate * first / (sqrtf(second) * root + eps);
      value[j] -= touched ? step : 0;
      m[j] = touched ? first : m[j];
      v[j] = touched ? second : v[j];
      grad[j] = 0;
    }
  }
}
