/* The density activation of TensoRF: softplus(y) = log(1 + e^y) = max(y, 0) + log(1 + e^-|y|), the second term from
 * one table over [0, 16).
 * Table: src/fx/tables/softplus.inc, 257 decimal integers, one per line with a comma:
 * L[i] = round(log(1 + exp(-i/16)) * 2^24), i = 0..256; 24 bits unsigned.
 *
 *   m = |y|, Q.12;  i = m >> 8;  low = m & 255
 *   t = L[i] + (((L[i+1] - L[i]) * low + 128) >> 8)         Q.24 (fall < 2^19, product < 2^27); 0 from m = 16 on
 *   result = (max(y, 0) << 8) + rshift_round(t, 4)          Q.20, < 2^32
 * Mirror: rtl/sf_activation.sv */
#include "src/fx/unit.h"
#include "src/fx/round.h"
#include "src/fx/nofloat.h"

enum { TABLE_FRAC = 24, LOW_BITS = SF_LOG_FRAC - 4, ENTRIES = 256 };

static const int32_t softplus_table[ENTRIES + 1] = {
#include "fx/tables/softplus.inc"
};

static int64_t tail(int32_t m)
{
  const int32_t i = m >> LOW_BITS, low = m & ((1 << LOW_BITS) - 1);
  if (i >= ENTRIES) return 0;
  const int32_t fall = softplus_table[i + 1] - softplus_table[i];
  const int32_t t = softplus_table[i] + ((fall * low + (1 << (LOW_BITS - 1))) >> LOW_BITS);
  return fx_rshift_round(t, TABLE_FRAC - FX_ACTIVATION_FRAC);
}

uint32_t fx_softplus(int32_t y)
{
  return fx_relu(y) + (uint32_t)tail(y < 0 ? -y : y);
}

uint32_t fx_relu(int32_t y)
{
  return y > 0 ? (uint32_t)y << (FX_ACTIVATION_FRAC - SF_LOG_FRAC) : 0;
}
