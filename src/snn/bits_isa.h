/* Spikes as bits.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_BITS_ISA_H
#define SF_SNN_BITS_ISA_H
#include "snn/gemm_isa.h"

typedef enum direction { FORWARD, BACKWARD } direction; /* of a product */

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
#endif
