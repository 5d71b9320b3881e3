/* Fewer points on an axis: the nearest function in the least-squares sense, against an elimination without structure
 * whose integrals are sums over a fine grid. */
#include "ck_run.h"
#include "base/rng.h"
#include "src/quant/internal.h"
#include <math.h>

enum { FINE = 240 /* parts of an old interval; Simpson's rule is exact on them */, MOST = 40 };

static double hat(double x, double middle, double width)
{
  return fmax(0, 1 - fabs(x - middle) / width);
}

/* Integral over [low, high] of two hats. */
static double product(double m, double w, double n, double v, int low, int high)
{
  double sum = 0;
  const int parts = (high - low) * FINE;
  for (int i = 0; i < parts; i++)
    for (int k = 0; k < 3; k++) {
      const double x = low + (i + k / 2.0) / FINE;
      sum += (k == 1 ? 4 : 1) * hat(x, m, w) * hat(x, n, v);
    }
  return sum / 6 / FINE;
}

/* x[n_to][n_from]: what each old point gives to each new one. */
static void oracle(int low, int high, int n_to, double x[MOST][MOST])
{
  const int n_from = high - low + 1;
  const double step = (double)(high - low) / (n_to - 1);
  double m[MOST][MOST];
  for (int j = 0; j < n_to; j++) {
    for (int k = 0; k < n_to; k++) m[j][k] = product(low + j * step, step, low + k * step, step, low, high);
    for (int i = 0; i < n_from; i++) x[j][i] = product(low + j * step, step, low + i, 1, low, high);
  }
  for (int p = 0; p < n_to; p++)
    for (int j = 0; j < n_to; j++) {
      if (j == p) continue;
      const double f = m[j][p] / m[p][p];
      for (int k = 0; k < n_to; k++) m[j][k] -= f * m[p][k];
      for (int i = 0; i < n_from; i++) x[j][i] -= f * x[p][i];
    }
  for (int j = 0; j < n_to; j++)
    for (int i = 0; i < n_from; i++) x[j][i] /= m[j][j];
}

/* What lies beyond the reach of six new points is 0.27^6 = 4e-4 of the middle, on both sides. */
TEST(weights_are_those_of_least_squares)
{
  static const int rows[][3] = {{0, 30, 25}, {0, 30, 16}, {0, 30, 8}, {3, 27, 19}, {5, 36, 11}, {0, 6, 3}, {0, 2, 2}};
  for (int r = 0; r < COUNT(rows); r++) {
    const int low = rows[r][0], high = rows[r][1], n_to = rows[r][2];
    double x[MOST][MOST];
    sf_taps taps;
    oracle(low, high, n_to, x);
    ck_ok(sf_taps_make(&taps, low, high, n_to));
    ck_assert_int_eq(taps.n_to, n_to);
    ck_assert_int_le(taps.width, high - low + 1);
    for (int j = 0; j < n_to; j++) {
      double sum = 0;
      ck_assert_int_ge(taps.first[j], low);
      ck_assert_int_le(taps.first[j] + taps.width - 1, high);
      for (int i = low; i <= high; i++) {
        const int at = i - taps.first[j];
        const double weight = at >= 0 && at < taps.width ? (double)taps.weight[j * taps.width + at] : 0;
        sum += weight;
        ck_assert_msg(fabs(weight - x[j][i - low]) < 1.5e-3, "%d..%d to %d: new %d, old %d: %g instead of %g", low,
                      high, n_to, j, i, weight, x[j][i - low]);
      }
      ck_assert_double_eq_tol(sum, 1, 1e-6); /* a constant stays one */
    }
    sf_taps_free(&taps);
    ck_assert_ptr_null(taps.weight);
  }
}

/* However fine the old points are, a weight depends on no more than six new ones on each side. */
TEST(the_reach_is_limited)
{
  sf_taps taps;
  ck_ok(sf_taps_make(&taps, 0, 299, 150));
  ck_assert_int_ge(taps.width, 2 * 12);
  ck_assert_int_le(taps.width, 2 * 12 + 3);
  const int middle = taps.first[75] + taps.width / 2;
  ck_assert_int_le(abs(middle - (int)lrint(75 * 299.0 / 149)), 1);
  sf_taps_free(&taps);
}

TEST(as_many_points_are_the_same_points)
{
  sf_taps taps;
  ck_ok(sf_taps_make(&taps, 4, 9, 6));
  ck_assert_int_eq(taps.width, 1);
  for (int j = 0; j < 6; j++) {
    ck_assert_int_eq(taps.first[j], 4 + j);
    ck_assert_float_eq(taps.weight[j], 1);
  }
  sf_taps_free(&taps);
  ck_ok(sf_taps_make(&taps, 7, 7, 1)); /* a single one */
  ck_assert_int_eq(taps.first[0], 7);
  ck_assert_float_eq(taps.weight[0], 1);
  sf_taps_free(&taps);
}

/* from[rows][n_from][n] to to[rows][n_to][n], each number by the sum that its weights say. */
TEST(taps_are_applied_along_one_axis)
{
  enum { ROWS = 3, FROM = 12, TO = 7, N = 5 };
  float from[ROWS * FROM * N], to[ROWS * TO * N];
  sf_taps taps;
  ck_ok(sf_taps_make(&taps, 2, 10, TO));
  for (int i = 0; i < ROWS * FROM * N; i++) from[i] = 200 * sf_random_float(3, 0, (uint64_t)i) - 100;
  sf_taps_apply(&taps, from, ROWS, FROM, N, to);
  for (int row = 0; row < ROWS; row++)
    for (int j = 0; j < TO; j++)
      for (int k = 0; k < N; k++) {
        double sum = 0;
        for (int i = 0; i < taps.width; i++)
          sum += (double)taps.weight[j * taps.width + i] * (double)from[(row * FROM + taps.first[j] + i) * N + k];
        ck_assert_double_eq_tol((double)to[(row * TO + j) * N + k], sum, 1e-4);
      }
  sf_taps_free(&taps);
}
