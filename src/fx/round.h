/* The one rounding, the one saturation. Mirror: rtl/sf_round.svh */
#ifndef SF_FX_ROUND_H
#define SF_FX_ROUND_H
#include <stdint.h>

/* x / 2^n, round half up; arithmetic shift. 0 <= n <= 62; the caller's width proof covers x + 2^(n-1). */
static inline int64_t fx_rshift_round(int64_t x, int n)
{
  return n == 0 ? x : (x + ((int64_t)1 << (n - 1))) >> n;
}

/* Clamp to a signed number of `bits` bits. */
static inline int64_t fx_sat(int64_t x, int bits)
{
  const int64_t high = ((int64_t)1 << (bits - 1)) - 1;
  return x > high ? high : x < -high - 1 ? -high - 1 : x;
}

/* Clamp to an unsigned number of `bits` bits. */
static inline int64_t fx_usat(int64_t x, int bits)
{
  const int64_t high = ((int64_t)1 << bits) - 1;
  return x > high ? high : x < 0 ? 0 : x;
}
#endif
