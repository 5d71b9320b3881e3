#include "src/quant/internal.h"
#include <math.h>

bool sf_quant_scale(double factor, int shift_max, int bias, fx_scale *scale)
{
  int exponent;
  frexp(factor, &exponent);
  int shift = 16 - exponent;
  if (shift > shift_max) shift = shift_max;
  double mul = nearbyint(ldexp(factor, shift));
  if (mul > 65535) mul = nearbyint(ldexp(factor, --shift));
  if (shift < 0) return false;
  *scale = (fx_scale){.mul = (int32_t)mul, .shift = shift, .bias = bias};
  return true;
}
