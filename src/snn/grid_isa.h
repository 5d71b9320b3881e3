/* Hash grid of one level, forward and backward, a block of samples at a time. Oracle: src/field/grid.c.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_GRID_ISA_H
#define SF_SNN_GRID_ISA_H
#include "snn/words_isa.h"

/* Table index and trilinear weight of the 8 corners of every sample of a block. */
static void grid_corners(const sf_grid_level *level, const float *restrict x, int32_t index[8][B], float weight[8][B])
{
  const float scale = level->scale;
  const uint32_t stride = level->stride, mask = level->entries - 1;
  for (int l = 0; l < B; l++) {
    float px = x[l] * scale + 0.5f, py = x[B + l] * scale + 0.5f, pz = x[2 * B + l] * scale + 0.5f;
    int32_t cx = (int32_t)px, cy = (int32_t)py, cz = (int32_t)pz;
    float fx = px - (float)cx, fy = py - (float)cy, fz = pz - (float)cz;
#pragma GCC unroll 8
    for (int c = 0; c < 8; c++) {
      uint32_t ix = (uint32_t)cx + (c & 1), iy = (uint32_t)cy + (c >> 1 & 1), iz = (uint32_t)cz + (c >> 2);
      uint32_t dense = ix + stride * (iy + stride * iz);
      uint32_t hashed = (ix ^ iy * 2654435761u ^ iz * 805459861u) & mask;
      index[c][l] = (int32_t)(stride ? dense : hashed);
      weight[c][l] = (c & 1 ? fx : 1 - fx) * (c & 2 ? fy : 1 - fy) * (c & 4 ? fz : 1 - fz);
    }
  }
}

/* Entries are asked for so many samples ahead: tables do not fit the caches, and the sums would wait for one sample's
 * lines after another's. A whole block's lines would fill the first-level cache. */
enum { SAMPLES_AHEAD = 8 };

static inline void prefetch_corners(const float *entries, int32_t index[8][B], int sample)
{
#pragma GCC unroll 8
  for (int c = 0; c < 8; c++) __builtin_prefetch(entries + 2 * (size_t)index[c][sample]);
}

static void grid_forward(const sf_grid_level *level, const float *table, const float *x, float *restrict out)
{
  int32_t index[8][B];
  float weight[8][B];
  grid_corners(level, x, index, weight);
  const float *entries = table + 2 * level->offset;
  for (int l = 0; l < SAMPLES_AHEAD; l++) prefetch_corners(entries, index, l);
  for (int l = 0; l < B; l++) {
    if (l + SAMPLES_AHEAD < B) prefetch_corners(entries, index, l + SAMPLES_AHEAD);
    float a = 0, b = 0;
#pragma GCC unroll 8
    for (int c = 0; c < 8; c++) {
      const float *e = entries + 2 * (size_t)index[c][l];
      a += weight[c][l] * e[0];
      b += weight[c][l] * e[1];
    }
    out[l] = a;
    out[B + l] = b;
  }
}

static void grid_backward(const sf_grid_level *level, const float *x, const float *dout, float *dtable)
{
  int32_t index[8][B];
  float weight[8][B];
  grid_corners(level, x, index, weight);
  float *entries = dtable + 2 * level->offset;
  for (int l = 0; l < SAMPLES_AHEAD; l++) prefetch_corners(entries, index, l);
  for (int l = 0; l < B; l++) {
    if (l + SAMPLES_AHEAD < B) prefetch_corners(entries, index, l + SAMPLES_AHEAD);
    const float a = dout[l], b = dout[B + l];
    if (a == 0 && b == 0) continue;
#pragma GCC unroll 8
    for (int c = 0; c < 8; c++) {
      float *e = entries + 2 * (size_t)index[c][l];
      e[0] += weight[c][l] * a;
      e[1] += weight[c][l] * b;
    }
  }
}
#endif
