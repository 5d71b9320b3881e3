/* Powers of two from one table.
 * Mirror: rtl/sf_exp2.sv (fx_exp2)
 * Mirror: rtl/sf_exp_neg.sv (fx_exp_neg)
 * Table: src/fx/tables/exp2.inc, 257 decimal integers, one per line with a comma:
 * T[i] = round(2^(i/256) * 2^24), i = 0..256; 26 bits unsigned (only T[256] = 2^25 needs the 26th). */
#include "src/fx/unit.h"
#include "src/fx/round.h"
#include "src/fx/nofloat.h"

enum { TABLE_FRAC = 24, ARGUMENT_FRAC = 20, LOW_BITS = ARGUMENT_FRAC - 8 };
enum { LOG2E_Q24 = 24204406, TAU_MAX = 32 << SF_TRANS_FRAC };

static const int32_t exp2_table[257] = {
#include "fx/tables/exp2.inc"
};

/* 2^fraction in Q.24 for fraction Q0.20: 2^24 <= t < 2^25. With 12 significant fraction bits (low = low4 << 8) the
 * interpolation is T[i] + (((T[i+1] - T[i]) * low4 + 8) >> 4) bit for bit, which is what the RTL computes. */
static int32_t exp2_fraction(int32_t fraction)
{
  const int32_t i = fraction >> LOW_BITS, low = fraction & ((1 << LOW_BITS) - 1);
  const int32_t rise = exp2_table[i + 1] - exp2_table[i]; /* < 2^17, so rise * low is below 2^29 */
  return exp2_table[i] + ((rise * low + (1 << (LOW_BITS - 1))) >> LOW_BITS);
}

/* y = n + fraction, n = floor(y):  e = rshift_round(t, 12 - n)  for n <= 12   (0 for n <= -14: t < 2^25)
 *                                  e = t << (n - 12)            for n = 13, 14, 15   (< 2^28: exact)
 *                                  e = 2^28 - 1                 for n >= 16 */
uint32_t fx_exp2(int32_t y)
{
  const int32_t n = y >> SF_LOG_FRAC, fraction = y & ((1 << SF_LOG_FRAC) - 1);
  if (n >= SF_SIGMA_BITS - SF_SIGMA_FRAC) return (1u << SF_SIGMA_BITS) - 1;
  const int shift = TABLE_FRAC - SF_SIGMA_FRAC - n;
  if (shift > TABLE_FRAC + 1) return 0;
  const int32_t t = exp2_fraction(fraction << (ARGUMENT_FRAC - SF_LOG_FRAC));
  return shift >= 0 ? (uint32_t)fx_rshift_round(t, shift) : (uint32_t)t << -shift;
}

/* exp(-tau) = 2^-(tau log2 e). The 20 fraction bits of the argument keep the error of thin media below one LSB
 * of transmittance. exp(-32) is far below half an LSB, so larger tau may be clamped. */
uint32_t fx_exp_neg(uint64_t tau)
{
  const int64_t clamped = tau > TAU_MAX ? TAU_MAX : (int64_t)tau;
  const int64_t y = -fx_rshift_round(clamped * LOG2E_Q24, 24 + SF_TRANS_FRAC - ARGUMENT_FRAC); /* Q.20, 0 .. -46.2 */
  const int32_t n = (int32_t)(y >> ARGUMENT_FRAC), fraction = (int32_t)(y & ((1 << ARGUMENT_FRAC) - 1));
  return (uint32_t)fx_rshift_round(exp2_fraction(fraction), TABLE_FRAC - SF_TRANS_FRAC - n);
}
