/* Three numbers. */
#ifndef SF_SCENE_VEC_H
#define SF_SCENE_VEC_H
#include <math.h>

static inline double vec_dot(const double a[3], const double b[3])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double vec_length(const double a[3])
{
  return sqrt(vec_dot(a, a));
}

static inline void vec_normalise(double a[3])
{
  const double length = vec_length(a);
  for (int i = 0; i < 3 && length > 0; i++) a[i] /= length;
}

static inline void vec_cross(const double a[3], const double b[3], double out[3])
{
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

/* a * x = b for a symmetric, positive a[9]: Cramer's rule. */
static inline void vec_solve(const double a[9], const double b[3], double x[3])
{
  double c[3][3];
  for (int i = 0; i < 3; i++) vec_cross(a + 3 * ((i + 1) % 3), a + 3 * ((i + 2) % 3), c[i]);
  const double det = vec_dot(a, c[0]);
  for (int i = 0; i < 3; i++) x[i] = (b[0] * c[0][i] + b[1] * c[1][i] + b[2] * c[2][i]) / det;
}
#endif
