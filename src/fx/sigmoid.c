/* Logistic function from one table over [0, 8), odd symmetry about (0, 1/2).
 * Mirror: rtl/sf_sigmoid.sv
 * Table: src/fx/tables/sigmoid.inc, 257 decimal integers, one per line with a comma:
 * S[i] = round(65536 / (1 + exp(-i/32))), i = 0..256; 16 bits unsigned.
 *
 *   m = min(|x|, 32767);  i = m >> 7;  low = m & 127
 *   p = S[i] + (((S[i+1] - S[i]) * low + 64) >> 7)          (rise < 2^9, product < 2^16)
 *   result = x < 0 ? 65536 - p : p                          (32768 <= p <= 65514: 16 bits without clamping) */
#include "src/fx/unit.h"
#include "src/fx/nofloat.h"

static const int32_t sigmoid_table[257] = {
#include "fx/tables/sigmoid.inc"
};

uint32_t fx_sigmoid(int32_t x)
{
  const int32_t magnitude = x < 0 ? -x : x, m = magnitude > 32767 ? 32767 : magnitude;
  const int32_t i = m >> 7, low = m & 127;
  const int32_t p = sigmoid_table[i] + (((sigmoid_table[i + 1] - sigmoid_table[i]) * low + 64) >> 7);
  return (uint32_t)(x < 0 ? 65536 - p : p);
}
