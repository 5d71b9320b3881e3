/* Sine of a phase in turns, from one table of a quarter turn.
 * Table: src/fx/tables/sine.inc, 257 decimal integers, one per line with a comma:
 * S[i] = round(sin(pi/2 * i/256) * 2^16), i = 0..256; 17 bits unsigned (only S[256] = 2^16 needs the 17th).
 *
 *   q = phase within its half turn, folded at the quarter: 0..2^14;  i = q >> 6;  low = q & 63
 *   p = S[i] + (((S[i+1] - S[i]) * low + 32) >> 6)          Q.16 (rise < 2^9, product < 2^15)
 *   result = +- rshift_round(p, 2)                          Q1.14; minus in the second half turn
 * Mirror: rtl/sf_waves.sv */
#include "src/fx/unit.h"
#include "src/fx/round.h"
#include "src/fx/nofloat.h"

enum { TABLE_FRAC = 16, LOW_BITS = 6, QUARTER = 1 << (FX_PHASE_BITS - 2), HALF = 2 * QUARTER };

static const int32_t sine_table[257] = {
#include "fx/tables/sine.inc"
};

int32_t fx_sine(uint32_t phase)
{
  const int32_t within = (int32_t)(phase & (HALF - 1)), q = within > QUARTER ? HALF - within : within;
  const int32_t i = q >> LOW_BITS, low = q & ((1 << LOW_BITS) - 1);
  const int32_t rise = low ? sine_table[i + 1] - sine_table[i] : 0;
  const int32_t p = sine_table[i] + ((rise * low + (1 << (LOW_BITS - 1))) >> LOW_BITS);
  const int32_t size = (int32_t)fx_rshift_round(p, TABLE_FRAC - FX_UNIT_FRAC);
  return phase & HALF ? -size : size;
}
