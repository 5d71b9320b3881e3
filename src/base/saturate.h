/* Sums and products of counts. UINT64_MAX absorbs: a total that overflowed once stays "too large". */
#ifndef SF_BASE_SATURATE_H
#define SF_BASE_SATURATE_H
#include <stdint.h>

static inline uint64_t sf_add_u64(uint64_t a, uint64_t b)
{
  uint64_t sum;
  return __builtin_add_overflow(a, b, &sum) ? UINT64_MAX : sum;
}

static inline uint64_t sf_multiply_u64(uint64_t a, uint64_t b)
{
  uint64_t product;
  if ((a == UINT64_MAX && b > 0) || (b == UINT64_MAX && a > 0)) return UINT64_MAX;
  return __builtin_mul_overflow(a, b, &product) ? UINT64_MAX : product;
}
#endif
