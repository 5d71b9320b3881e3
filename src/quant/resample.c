/* Fewer points on an axis. Between points a field is linear, so it is a sum of hats; the new one is the sum of wider
 * hats that is nearest to the old one, integrated over the axis (least squares): M x = B y, where M holds the integrals
 * of products of two new hats and B those of a new and an old one. */
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double REACH = 6; /* the inverse of M falls by 0.27 a point: beyond this it is below half an LSB */

static double hat(double x, double middle, double width)
{
  const double h = 1 - fabs(x - middle) / width;
  return h > 0 ? h : 0;
}

static int by_value(const void *a, const void *b)
{
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Integral over [low, high] of a hat of half width `width` and one of half width 1. Between breaks the product is a
 * parabola, for which Simpson's rule is exact. */
static double overlap(double middle, double width, double old, double low, double high)
{
  double at[6] = {middle - width, middle, middle + width, old - 1, old, old + 1}, sum = 0;
  for (int i = 0; i < 6; i++) at[i] = fmin(fmax(at[i], low), high);
  qsort(at, 6, sizeof *at, by_value);
  for (int i = 0; i < 5; i++) {
    const double a = at[i], b = at[i + 1], m = (a + b) / 2;
    sum += (b - a) / 6 *
           (hat(a, middle, width) * hat(a, old, 1) + 4 * hat(m, middle, width) * hat(m, old, 1) +
            hat(b, middle, width) * hat(b, old, 1));
  }
  return sum;
}

/* B, [n_to][n_from]. */
static void fill_overlaps(double *b, int low, int high, int n_to)
{
  const int n_from = high - low + 1;
  const double step = (double)(high - low) / (n_to - 1);
  for (int j = 0; j < n_to; j++) {
    const double middle = low + j * step;
    const int first = (int)fmax(floor(middle - step) - 1, low), last = (int)fmin(ceil(middle + step) + 1, high);
    for (int i = first; i <= last; i++)
      b[(size_t)j * (size_t)n_from + (size_t)(i - low)] = overlap(middle, step, i, low, high);
  }
}

/* x = inverse of M times x, [n_to][n_from], by elimination: M has three diagonals. factor[n_to] is room. */
static void solve(double *x, double *factor, int n_to, int n_from, double step)
{
  const size_t n = (size_t)n_from;
  const double side = step / 6;
  for (int j = 0; j < n_to; j++) {
    const double middle = step * (j == 0 || j == n_to - 1 ? 1 : 2) / 3;
    const double pivot = middle - (j ? side * factor[j - 1] : 0);
    factor[j] = side / pivot;
    for (size_t i = 0; i < n; i++)
      x[(size_t)j * n + i] = (x[(size_t)j * n + i] - (j ? side * x[((size_t)j - 1) * n + i] : 0)) / pivot;
  }
  for (int j = n_to - 2; j >= 0; j--)
    for (size_t i = 0; i < n; i++) x[(size_t)j * n + i] -= factor[j] * x[((size_t)j + 1) * n + i];
}

/* The weights of one new point within reach; what is cut off goes to all of them: a constant stays one. */
static void set_taps(sf_taps *taps, const double *x, int low, int high, int j)
{
  const int n_from = high - low + 1;
  const double step = (double)(high - low) / (taps->n_to - 1);
  int first = (int)lrint(j * step) - taps->width / 2;
  first = first + taps->width > n_from ? n_from - taps->width : first;
  first = first < 0 ? 0 : first;
  double sum = 0;
  for (int i = 0; i < taps->width; i++) sum += x[first + i];
  for (int i = 0; i < taps->width; i++)
    taps->weight[(size_t)j * (size_t)taps->width + (size_t)i] = (float)(x[first + i] / sum);
  taps->first[j] = low + first;
}

sf_status sf_taps_make(sf_taps *taps, int low, int high, int n_to)
{
  const int n_from = high - low + 1;
  const double step = n_to > 1 ? (double)(high - low) / (n_to - 1) : 1;
  const int width = 2 * (int)ceil(REACH * step) + 1;
  const bool same = n_to == n_from;
  *taps = (sf_taps){.n_to = n_to, .width = same ? 1 : width < n_from ? width : n_from};
  taps->first = calloc((size_t)n_to, sizeof *taps->first);
  taps->weight = calloc((size_t)n_to * (size_t)taps->width, sizeof *taps->weight);
  double *x = calloc((size_t)n_to * (size_t)n_from, sizeof *x), *factor = calloc((size_t)n_to, sizeof *factor);
  const bool room = taps->first && taps->weight && x && factor;
  for (int j = 0; room && same && j < n_to; j++) taps->first[j] = low + j, taps->weight[j] = 1;
  if (room && !same) {
    fill_overlaps(x, low, high, n_to);
    solve(x, factor, n_to, n_from, step);
    for (int j = 0; j < n_to; j++) set_taps(taps, x + (size_t)j * (size_t)n_from, low, high, j);
  }
  free(x), free(factor);
  if (room) return sf_ok();
  sf_taps_free(taps);
  return sf_fail(SF_E_MEMORY, "fit: no memory for %d points", n_to);
}

void sf_taps_free(sf_taps *taps)
{
  free(taps->first), free(taps->weight);
  memset(taps, 0, sizeof *taps);
}

void sf_taps_apply(const sf_taps *taps, const float *from, size_t rows, size_t n_from, size_t n, float *to)
{
#pragma omp parallel for schedule(static)
  for (size_t row = 0; row < rows; row++)
    for (int j = 0; j < taps->n_to; j++) {
      float *sum = to + (row * (size_t)taps->n_to + (size_t)j) * n;
      memset(sum, 0, n * sizeof *sum);
      for (int k = 0; k < taps->width; k++) {
        const float *at = from + (row * n_from + (size_t)(taps->first[j] + k)) * n;
        const float weight = taps->weight[(size_t)j * (size_t)taps->width + (size_t)k];
        for (size_t i = 0; i < n; i++) sum[i] += weight * at[i];
      }
    }
}
