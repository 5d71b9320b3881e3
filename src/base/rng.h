/* Counter-based random numbers: the value depends only on (seed, stream, index), never on the order of calls, so
 * results do not depend on the number of threads. Mixing function of SplitMix64 (Steele et al. 2014). */
#ifndef SF_BASE_RNG_H
#define SF_BASE_RNG_H
#include <stdint.h>

static inline uint64_t sf_mix64(uint64_t x)
{
  x ^= x >> 30, x *= 0xbf58476d1ce4e5b9u;
  x ^= x >> 27, x *= 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}
static inline uint64_t sf_random_u64(uint64_t seed, uint64_t stream, uint64_t index)
{
  uint64_t s = sf_mix64(seed + 0x9e3779b97f4a7c15u * (stream + 1));
  return sf_mix64(s + 0x9e3779b97f4a7c15u * (index + 1));
}
/* [0, 1), 24 bits. */
static inline float sf_random_float(uint64_t seed, uint64_t stream, uint64_t index)
{
  return (float)(sf_random_u64(seed, stream, index) >> 40) * 0x1p-24f;
}
/* 0 .. n-1, 1 <= n < 2^32; bias below n / 2^32. */
static inline uint64_t sf_random_below(uint64_t seed, uint64_t stream, uint64_t index, uint64_t n)
{
  return ((sf_random_u64(seed, stream, index) >> 32) * n) >> 32;
}
#endif
