/* Products with spikes in builds for AVX-512: a few spikes add rows, where a dense product would multiply by zeros.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_EVENT_ISA_H
#define SF_SNN_EVENT_ISA_H
#include "snn/bits_isa.h"
#include "snn/kernels.h"

enum { LOOKUP = 0 };

/* The smallest type that counts the neurons of a layer, and a row of zeros. */
typedef __typeof__(__builtin_choose_expr(SF_LANES <= UINT8_MAX, (uint8_t)0, (uint16_t)0)) row_index;

/* Indices of the set bits of 64 rows, offset added, to list (64 places writable); how many. */
static inline int list_bits(uint64_t bits, uint8_t offset, row_index *list)
{
#if defined(__AVX512VBMI2__)
  uint8_t iota[64];
  for (int i = 0; i < 64; i++) iota[i] = (uint8_t)i;
  const __m512i index = _mm512_add_epi8(_mm512_loadu_si512(iota), _mm512_set1_epi8((char)offset));
  const __m512i set = _mm512_maskz_compress_epi8(bits, index);
  if (sizeof *list == 1) {
    _mm512_storeu_si512(list, set);
  } else {
    _mm512_storeu_si512(list, _mm512_cvtepu8_epi16(_mm512_castsi512_si256(set)));
    _mm512_storeu_si512(list + 32, _mm512_cvtepu8_epi16(_mm512_extracti64x4_epi64(set, 1)));
  }
#else
  int n = 0;
  for (uint64_t b = bits; b; b &= b - 1) list[n++] = (row_index)(offset + __builtin_ctzll(b));
#endif
  return __builtin_popcountll(bits);
}

/* Above these shares of neurons firing in a block, the dense products are faster (measured: make bench). */
#if defined(SF_AMX)
static const float dense_from[] = {0, 0};
#else
static const float dense_from[] = {0.25f, 0.45f};
#endif

static bool by_spikes(const sf_net_view *net, const uint64_t *spikes, direction pass)
{
  int count = 0;
  for (int r = 0; r < net->hidden; r++) count += __builtin_popcountll(spikes[r]);
  return !net->relu && (float)count < dense_from[pass] * (float)(net->hidden * SF_BLOCK);
}

/* rows[count][columns] (stride ld) as the operands' values [columns / 64][count + 1][64], the last row of a slice zero.
 * A slice fits the first-level cache and leaves room there. */
static void prepare_spikes(const float *rows, int ld, int count, int columns, float *slices)
{
  for (int c = 0; c < columns; c += 64, slices += (count + 1) * 64) {
    memset(slices, 0, (size_t)(count + 1) * 64 * sizeof *slices);
    for (int r = 0; r < count; r++)
      for (int i = 0; i < 64 && c + i < columns; i++) slices[r * 64 + i] = operand(rows[r * ld + c + i]);
  }
}

/* out[V*VL] = sum of the listed rows; pairs of rows, the list ends with a row of zeros where needed. */
static inline __attribute__((always_inline)) void add_rows(int V, const float *rows, int ld, const row_index *list,
                                                           int n, float *out)
{
  vf a[4], b[4];
#pragma GCC unroll 4
  for (int v = 0; v < V; v++) a[v] = b[v] = (vf){0};
  for (int i = 0; i < n; i += 2) {
    const float *x = rows + list[i] * ld, *y = rows + list[i + 1] * ld;
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) {
      a[v] += *(const vf *)(x + v * VL);
      b[v] += *(const vf *)(y + v * VL);
    }
  }
#pragma GCC unroll 4
  for (int v = 0; v < V; v++) *(vf *)(out + v * VL) = a[v] + b[v];
}

/* out[SF_BLOCK][columns] = spikes x the rows of prepare_spikes: per lane, those of the neurons that fire are added. */
static void spike_current(const float *slices, int rows, int columns, const uint64_t *spikes, float *out)
{
  row_index list[SF_BLOCK][SF_LANES + 64];
  int count[SF_BLOCK] = {0};
  for (int first = 0; first < rows; first += 64) {
    uint64_t bits[64] = {0};
    memcpy(bits, spikes + first, (size_t)(rows - first < 64 ? rows - first : 64) * sizeof *bits);
    transpose_bits(bits);
    for (int l = 0; l < SF_BLOCK; l++) count[l] += list_bits(bits[l], (uint8_t)first, list[l] + count[l]);
  }
  for (int l = 0; l < SF_BLOCK; l++) list[l][count[l]] = (row_index)rows;
  int c = 0;
  for (; c + 4 * VL <= columns; c += 4 * VL)
    for (int l = 0; l < SF_BLOCK; l++)
      add_rows(4, slices + c / 64 * (rows + 1) * 64 + c % 64, 64, list[l], count[l], out + l * columns + c);
  for (; c < columns; c += VL)
    for (int l = 0; l < SF_BLOCK; l++)
      add_rows(1, slices + c / 64 * (rows + 1) * 64 + c % 64, 64, list[l], count[l], out + l * columns + c);
}

/* out[steps][columns][SF_BLOCK] = the rows of prepare_spikes x spikes[steps][SF_LANES], a bit per lane. */
static void spike_currents(const float *slices, int rows, int columns, int steps, uint64_t (*spikes)[SF_LANES],
                           float *out)
{
  float sums[SF_BLOCK * SF_LANES];
  for (int t = 0; t < steps; t++) {
    spike_current(slices, rows, columns, spikes[t], sums);
    transpose((const word *)sums, SF_BLOCK, columns, (word *)out + (size_t)t * columns * SF_BLOCK, SF_BLOCK);
  }
}

/* grad[m][V*VL] += the rows of the lanes in which neuron m fires. */
static inline __attribute__((always_inline)) void add_lanes(int V, float *grad, uint64_t lanes, const float *rows,
                                                            int ld)
{
  vf a[8];
#pragma GCC unroll 8
  for (int v = 0; v < V; v++) a[v] = *(const vf *)(grad + v * VL);
  for (; lanes; lanes &= lanes - 1) {
    const float *x = rows + __builtin_ctzll(lanes) * ld;
#pragma GCC unroll 8
    for (int v = 0; v < V; v++) a[v] += *(const vf *)(x + v * VL);
  }
#pragma GCC unroll 8
  for (int v = 0; v < V; v++) *(vf *)(grad + v * VL) = a[v];
}

/* grad[rows][columns] += spikes[rows] x dy[SF_BLOCK][columns]. */
static void spike_outer(float *grad, int rows, int columns, const uint64_t *spikes, const float *dy)
{
  int c = 0;
  for (; c + 8 * VL <= columns; c += 8 * VL)
    for (int m = 0; m < rows; m++) add_lanes(8, grad + m * columns + c, spikes[m], dy + c, columns);
  for (; c < columns; c += VL)
    for (int m = 0; m < rows; m++) add_lanes(1, grad + m * columns + c, spikes[m], dy + c, columns);
}
#endif
