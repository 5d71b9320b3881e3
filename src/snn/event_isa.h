/* Event-driven products: a few spikes add rows, where a dense product would multiply by zeros.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_EVENT_ISA_H
#define SF_SNN_EVENT_ISA_H
#include "snn/words_isa.h"

/* Bit l: x[l] >= theta. */
static inline uint64_t spike_bits(const float *x, float theta)
{
  uint64_t bits = 0;
#if defined(__AVX512F__)
  for (int i = 0; i < 4; i++)
    bits |= (uint64_t)_mm512_cmp_ps_mask(_mm512_loadu_ps(x + 16 * i), _mm512_set1_ps(theta), _CMP_GE_OQ) << 16 * i;
#elif defined(__AVX2__)
  for (int i = 0; i < 8; i++)
    bits |= (uint64_t)_mm256_movemask_ps(_mm256_cmp_ps(_mm256_loadu_ps(x + 8 * i), _mm256_set1_ps(theta), _CMP_GE_OQ))
            << 8 * i;
#else
  for (int i = 0; i < 64; i++) bits |= (uint64_t)(x[i] >= theta) << i;
#endif
  return bits;
}

/* 64 x 64 bits, in place (Warren, Hacker's Delight, 7-3). */
static void transpose_bits(uint64_t a[64])
{
  uint64_t low = 0x00000000FFFFFFFFu;
  for (int j = 32; j; j >>= 1, low ^= low << j)
    for (int k = 0; k < 64; k += 2 * j)
      for (int i = k; i < k + j; i++) {
        const uint64_t t = (a[i] >> j ^ a[i + j]) & low;
        a[i] ^= t << j;
        a[i + j] ^= t;
      }
}

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
static const float dense_forward = 0, dense_backward = 0;
#else
static const float dense_forward = 0.25f, dense_backward = 0.45f;
#endif

static bool few_spikes(const uint64_t *spikes, int rows, float share)
{
  int count = 0;
  for (int r = 0; r < rows; r++) count += __builtin_popcountll(spikes[r]);
  return (float)count < share * (float)(rows * B);
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

/* Event-driven product: per lane, the rows of the neurons that fire are added. slice[..][hidden + 1][64], the last row
 * zero; spikes[hidden]; out[B][hidden]. A slice fits the first-level cache and leaves room there. */
static void event_current(const float slice[][(SF_LANES + 1) * 64], int hidden, const uint64_t *spikes, float *out)
{
  row_index list[B][SF_LANES + 64];
  int count[B] = {0};
  for (int first = 0; first < hidden; first += 64) {
    uint64_t bits[64] = {0};
    memcpy(bits, spikes + first, (size_t)(hidden - first < 64 ? hidden - first : 64) * sizeof *bits);
    transpose_bits(bits);
    for (int l = 0; l < B; l++) count[l] += list_bits(bits[l], (uint8_t)first, list[l] + count[l]);
  }
  for (int l = 0; l < B; l++) list[l][count[l]] = (row_index)hidden;
  int c = 0;
  for (; c + 4 * VL <= hidden; c += 4 * VL)
    for (int l = 0; l < B; l++) add_rows(4, slice[c / 64] + c % 64, 64, list[l], count[l], out + l * hidden + c);
  for (; c < hidden; c += VL)
    for (int l = 0; l < B; l++) add_rows(1, slice[c / 64] + c % 64, 64, list[l], count[l], out + l * hidden + c);
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

/* Event-driven weights' gradient: grad[hidden][hidden] (in, out) += spikes[hidden] x dy[B][hidden]. */
static void event_outer(float *grad, int hidden, const uint64_t *spikes, const float *dy)
{
  int c = 0;
  for (; c + 8 * VL <= hidden; c += 8 * VL)
    for (int m = 0; m < hidden; m++) add_lanes(8, grad + m * hidden + c, spikes[m], dy + c, hidden);
  for (; c < hidden; c += VL)
    for (int m = 0; m < hidden; m++) add_lanes(1, grad + m * hidden + c, spikes[m], dy + c, hidden);
}
#endif
