#include "image/image.h"
#include <math.h>
#include <stdlib.h>

double sf_psnr(const float *a, const float *b, size_t n)
{
  double sum = 0;
  for (size_t i = 0; i < n; i++) {
    double d = (double)a[i] - b[i];
    sum += d * d;
  }
  return n ? -10 * log10(sum / (double)n) : NAN;
}

enum { WINDOW = 11, MAPS = 5 };

static void gaussian(double weight[WINDOW])
{
  double sum = 0;
  for (int i = 0; i < WINDOW; i++) sum += weight[i] = exp(-(i - 5) * (i - 5) / (2 * 1.5 * 1.5));
  for (int i = 0; i < WINDOW; i++) weight[i] /= sum;
}

/* Means of a, b, aa, bb, ab along one row: [width - 10][MAPS]. */
static void filter_row(const float *a, const float *b, int width, int stride, const double weight[WINDOW], double *out)
{
  for (int x = 0; x + WINDOW <= width; x++, out += MAPS) {
    double m[MAPS] = {0};
    for (int k = 0; k < WINDOW; k++) {
      double p = a[(size_t)(x + k) * stride], q = b[(size_t)(x + k) * stride];
      m[0] += weight[k] * p, m[1] += weight[k] * q;
      m[2] += weight[k] * p * p, m[3] += weight[k] * q * q, m[4] += weight[k] * p * q;
    }
    for (int k = 0; k < MAPS; k++) out[k] = m[k];
  }
}

static double window_ssim(const double *column, size_t row, const double weight[WINDOW])
{
  const double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  double m[MAPS] = {0};
  for (int k = 0; k < WINDOW; k++)
    for (int i = 0; i < MAPS; i++) m[i] += weight[k] * column[(size_t)k * row + i];
  double va = m[2] - m[0] * m[0], vb = m[3] - m[1] * m[1], cov = m[4] - m[0] * m[1];
  return (2 * m[0] * m[1] + c1) * (2 * cov + c2) / ((m[0] * m[0] + m[1] * m[1] + c1) * (va + vb + c2));
}

/* Rows are independent and summed in order: the result does not depend on the number of threads. */
static double channel_sum(const float *a, const float *b, int width, int height, int channels, double *filtered,
                          double *row_sum)
{
  double weight[WINDOW], sum = 0;
  size_t row = (size_t)(width - WINDOW + 1) * MAPS;
  int windows = height - WINDOW + 1;
  gaussian(weight);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; y++) {
    size_t start = (size_t)y * width * channels;
    filter_row(a + start, b + start, width, channels, weight, filtered + (size_t)y * row);
  }
#pragma omp parallel for schedule(static)
  for (int y = 0; y < windows; y++) {
    row_sum[y] = 0;
    for (size_t x = 0; x < row; x += MAPS) row_sum[y] += window_ssim(filtered + (size_t)y * row + x, row, weight);
  }
  for (int y = 0; y < windows; y++) sum += row_sum[y];
  return sum;
}

double sf_ssim(const float *a, const float *b, int width, int height, int channels)
{
  if (width < WINDOW || height < WINDOW || channels < 1) return NAN;
  size_t columns = (size_t)(width - WINDOW + 1), windows = columns * (size_t)(height - WINDOW + 1);
  double *filtered = malloc(columns * (size_t)height * MAPS * sizeof *filtered);
  double *row_sum = malloc((size_t)height * sizeof *row_sum);
  double sum = filtered && row_sum ? 0 : NAN;
  for (int c = 0; c < channels && !isnan(sum); c++)
    sum += channel_sum(a + c, b + c, width, height, channels, filtered, row_sum);
  free(filtered);
  free(row_sum);
  return sum / ((double)windows * channels);
}
