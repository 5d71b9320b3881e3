/* One PLIF step (SpikingJelly's parametric leaky integrate-and-fire; design equations in docs/model.md).
 * The scalar form, used by the oracle; src/snn/forward_isa.h holds the block form. */
#ifndef SF_SNN_PLIF_H
#define SF_SNN_PLIF_H
#include "snn/model.h"
#include <math.h>

enum { SF_SURROGATE_ALPHA = 8 };

/* Membrane after charging, before fire: previous membrane v, current i, leak k = 1/tau, step t. In radix mode it takes
 * its current once, and doubles what is left. */
static inline float sf_plif_charge(sf_input_mode mode, int t, float k, float v, float i)
{
  if (mode == SF_RADIX) return t ? 2 * v : i;
  if (mode == SF_NODECAY) return v - v * k + i;
  if (mode == SF_HYBRID && t == 0) return i;
  return v + (i - v) * k;
}

/* Radix mode: what a spike of step t of `steps` is worth, its binary digit; all of them are worth 1. */
static inline float sf_digit(int t, int steps)
{
  return (float)(1 << (steps - 1 - t)) / (float)((1 << steps) - 1);
}

/* Radix mode: alpha of the sigmoids that smooth the ends of the ramp. It falls above a threshold of 5/3, where the ends
 * are far apart, so that exp(-2 alpha theta) is a number. */
static inline float sf_ramp_alpha(float theta)
{
  const float most = 20.0f / theta;
  return most < 12 ? most : 12;
}

/* h as the accelerator sees it: current >> SF_H_SHIFT, in radix mode with a current rounded to 2^-digits, in the other
 * modes (digits 0) with an integer one. The half of that is for its rounding, which must not decide there. */
static inline float sf_round_h(float h, float step, int digits)
{
  return step * floorf(h / step + 0.5f / (float)(1 << (SF_H_SHIFT + digits)));
}

/* A real-valued input as the accelerator sees it, a multiple of step in SF_INPUT_BITS; step 0: as it is. Adding and
 * taking away 1.5 2^23 rounds to the nearest integer, ties to even, in every lane of a vector. */
static inline float sf_round_input(float x, float step)
{
  const float limit = (1 << (SF_INPUT_BITS - 1)) - 1, q = step > 0 ? x / step : 0;
  const float within = q > limit ? limit : q < -limit ? -limit : q;
  return step > 0 ? step * ((within + 12582912.0f) - 12582912.0f) : x;
}

static inline float sf_sigmoid(float x)
{
  return 1.0f / (1.0f + expf(-x));
}

#endif
