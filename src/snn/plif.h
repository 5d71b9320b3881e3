/* One PLIF step (SpikingJelly's parametric leaky integrate-and-fire; design equations in docs/model.md).
 * The scalar form, used by the oracle; src/snn/forward_isa.h holds the block form. */
#ifndef SF_SNN_PLIF_H
#define SF_SNN_PLIF_H
#include "snn/model.h"
#include <math.h>

enum { SF_SURROGATE_ALPHA = 8 };

/* Membrane after charging, before fire: previous membrane v, current i, leak k = 1/tau, step t. */
static inline float sf_plif_charge(sf_input_mode mode, int t, float k, float v, float i)
{
  if (mode == SF_RADIX) return 2 * v + i;
  if (mode == SF_NODECAY) return v - v * k + i;
  if (mode == SF_HYBRID && t == 0) return i;
  return v + (i - v) * k;
}

/* What a spike takes from the membrane. A weighted spike rounds to the nearest digit: it comes at half of what it is
 * worth. */
static inline float sf_plif_reset(sf_input_mode mode, float theta)
{
  return mode == SF_RADIX ? 2 * theta : theta;
}

/* Weighted spikes: the share of step t in the mean of steps 0..t, of which each weighs half of the one before. */
static inline float sf_step_share(int t)
{
  return 1.0f / (float)((2 << t) - 1);
}

/* An output that integrates without firing: o before, x comes in. Of weighted spikes it is the weighted mean. */
static inline float sf_plif_integrate(sf_input_mode mode, int t, float k, float o, float x)
{
  return mode == SF_RADIX ? o + (x - o) * sf_step_share(t) : sf_plif_charge(mode, t, k, o, x);
}

/* h as the accelerator sees it: current >> SF_H_SHIFT. Currents are multiples of step >> SF_H_SHIFT but for their
 * rounding, which half of that keeps from deciding. */
static inline float sf_round_h(float h, float step)
{
  return step * floorf(h / step + 0.5f / (1 << SF_H_SHIFT));
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
