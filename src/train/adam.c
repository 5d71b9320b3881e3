/* Adam (Kingma & Ba 2015), bias corrected; memory bound. */
#include "train/internal.h"
#include <math.h>

void sf_adam_update(const sf_adam *a, size_t n, float *value, float *grad, float *m, float *v)
{
  const float b1 = (float)a->beta1, b2 = (float)a->beta2, eps = (float)a->epsilon;
  const double c1 = 1 - pow(a->beta1, (double)a->step), c2 = 1 - pow(a->beta2, (double)a->step);
  const float rate = (float)(a->lr / c1), root = (float)(1 / sqrt(c2));
#pragma omp parallel for simd schedule(static)
  for (size_t i = 0; i < n; i++) {
    float g = grad[i];
    float first = b1 * m[i] + (1 - b1) * g, second = b2 * v[i] + (1 - b2) * g * g;
    value[i] -= rate * first / (sqrtf(second) * root + eps);
    m[i] = first;
    v[i] = second;
    grad[i] = 0;
  }
}
