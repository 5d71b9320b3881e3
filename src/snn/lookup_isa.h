/* Products with spikes in builds without AVX-512: the method of the four Russians. Four spikes select one of 16 sums
 * of four rows, which are looked up; an addition does the work of four multiply-adds, at any firing rate.
 * Source: V. L. Arlazarov, E. A. Dinic, M. A. Kronrod, I. A. Faradzev, "On economical construction of the transitive
 * closure of an oriented graph", Soviet Math. Dokl. 11 (1970). Oracle: the dense products.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_LOOKUP_ISA_H
#define SF_SNN_LOOKUP_ISA_H
#include "snn/bits_isa.h"
#include "snn/kernels.h"

/* Sums are kept for 16 columns at a time, two slices: those of 64 rows take half of the first-level cache. */
enum { LOOKUP = 1, SLICE = 8, WIDTH = 2 * SLICE, GROUP = 4, SUMS = 1 << GROUP, WORD = 64 / GROUP * SUMS * WIDTH };
typedef float slice __attribute__((vector_size(4 * SLICE), aligned(4), may_alias));

/* to[SUMS][WIDTH]: the sums of every subset of four rows, which are `stride` apart. */
static inline void group_sums(const float *rows, int stride, float *to)
{
  for (int c = 0; c < WIDTH; c += SLICE, to += SLICE) {
    *(slice *)to = (slice){0};
#pragma GCC unroll 16
    for (int i = 1; i < SUMS; i++)
      *(slice *)(to + i * WIDTH) =
          *(slice *)(to + (i & (i - 1)) * WIDTH) + *(const slice *)(rows + __builtin_ctz(i) * stride + c);
  }
}

/* rows[count][columns] (stride ld) as sums [columns / WIDTH][count / GROUP][SUMS][WIDTH]. */
static void prepare_spikes(const float *rows, int ld, int count, int columns, float *sums)
{
  for (int c = 0; c < columns; c += WIDTH)
    for (int r = 0; r < count; r += GROUP, sums += SUMS * WIDTH) group_sums(rows + r * ld + c, ld, sums);
}

/* Of group g of 16: the sum that its four bits of `spikes` select. */
static inline __attribute__((always_inline)) const slice *selected(const float *sums, uint64_t spikes, int g)
{
  const uint64_t times_width = g ? spikes >> (GROUP * g - 4) : spikes << 4; /* WIDTH is 2^4 */
  return (const slice *)(sums + g * SUMS * WIDTH + (times_width & (SUMS - 1) * WIDTH));
}

/* a[2] += what the spikes select of `groups` groups, 4, 8, 12 or 16. */
static inline __attribute__((always_inline)) void select_sums(const float *sums, uint64_t spikes, int groups, slice *a)
{
  slice b[2] = {{0}};
  if (groups == 16) {
#pragma GCC unroll 8
    for (int g = 0; g < 16; g += 2) {
      const slice *x = selected(sums, spikes, g), *y = selected(sums, spikes, g + 1);
      a[0] += x[0], a[1] += x[1], b[0] += y[0], b[1] += y[1];
    }
  } else {
    for (int g = 0; g < groups; g++) {
      const slice *x = selected(sums, spikes, g);
      a[0] += x[0], a[1] += x[1];
    }
  }
  a[0] += b[0], a[1] += b[1];
}

/* Perfect shuffle of the lower or the upper halves of a and b. */
static inline __attribute__((always_inline)) void shuffle_slices(const slice *a, const slice *b, slice *low,
                                                                 slice *high)
{
#ifdef __clang__ /* which has no shuffle by a vector of indices */
  const slice x = *a, y = *b;
  for (int i = 0; i < SLICE; i++) {
    (*low)[i] = i & 1 ? y[i / 2] : x[i / 2];
    (*high)[i] = i & 1 ? y[i / 2 + SLICE / 2] : x[i / 2 + SLICE / 2];
  }
#else
  typedef int indices __attribute__((vector_size(4 * SLICE)));
  const indices lower = {0, 8, 1, 9, 2, 10, 3, 11}, upper = {4, 12, 5, 13, 6, 14, 7, 15};
  *low = __builtin_shuffle(*a, *b, lower);
  *high = __builtin_shuffle(*a, *b, upper);
#endif
}

/* out[SLICE][SF_BLOCK] (+)= eight slices, transposed. */
static inline __attribute__((always_inline)) void put_transposed(slice x[SLICE], bool add, float *out)
{
  slice y[SLICE];
#pragma GCC unroll 3
  for (int stage = 0; stage < 3; stage++) {
#pragma GCC unroll 4
    for (int i = 0; i < SLICE / 2; i++) shuffle_slices(&x[i], &x[i + SLICE / 2], &y[2 * i], &y[2 * i + 1]);
    memcpy(x, y, sizeof y);
  }
#pragma GCC unroll 8
  for (int i = 0; i < SLICE; i++) {
    slice *to = (slice *)(out + i * SF_BLOCK);
    if (add) x[i] += *to;
    *to = x[i];
  }
}

/* out[steps][columns][SF_BLOCK] = the rows of prepare_spikes x spikes[steps][SF_LANES], a bit per lane. The sums are
 * read once for all steps. */
static void spike_currents(const float *sums, int rows, int columns, int steps, uint64_t (*spikes)[SF_LANES],
                           float *out)
{
  uint64_t bits[SF_LANES / 64][SF_T_MAX][64] = {{{0}}}; /* a bit per row, for each lane */
  for (int t = 0; t < steps; t++)
    for (int r = 0; r < rows; r += 64) {
      memcpy(bits[r / 64][t], spikes[t] + r, (size_t)(rows - r < 64 ? rows - r : 64) * sizeof **spikes);
      transpose_bits(bits[r / 64][t]);
    }
  for (int c = 0; c < columns; c += WIDTH)
    for (int r = 0, groups; r < rows; r += 64, sums += groups * SUMS * WIDTH) {
      groups = (rows - r < 64 ? rows - r : 64) / GROUP;
      for (int t = 0; t < steps; t++)
        for (int l = 0; l < SF_BLOCK; l += SLICE) {
          slice low[SLICE], high[SLICE];
          for (int i = 0; i < SLICE; i++) {
            slice a[2] = {{0}};
            select_sums(sums, bits[r / 64][t][l + i], groups, a);
            low[i] = a[0], high[i] = a[1];
          }
          float *to = out + (t * columns + c) * SF_BLOCK + l;
          put_transposed(low, r > 0, to);
          put_transposed(high, r > 0, to + SLICE * SF_BLOCK);
        }
    }
}

/* Whether the functions of this file are worth it: always. */
static bool by_spikes(const sf_net_view *net, const uint64_t *spikes, direction pass)
{
  (void)spikes, (void)pass;
  return !net->relu;
}

/* grad[rows][columns] += spikes[rows] x dy[SF_BLOCK][columns]. */
static void spike_outer(float *grad, int rows, int columns, const uint64_t *spikes, const float *dy)
{
  float sums[WORD] __attribute__((aligned(64)));
  for (int c = 0; c < columns; c += WIDTH) {
    prepare_spikes(dy + c, columns, SF_BLOCK, WIDTH, sums);
    for (int r = 0; r < rows; r++) {
      slice *to = (slice *)(grad + r * columns + c);
      slice a[2] = {to[0], to[1]};
      select_sums(sums, spikes[r], SF_BLOCK / GROUP, a);
      to[0] = a[0], to[1] = a[1];
    }
  }
}
#endif
