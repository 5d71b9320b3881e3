/* Leaky integrators of the output layers: no threshold, no reset.
 * Mirror: rtl/sf_integrate.sv (fx_integrate_*), rtl/sf_scale.sv (fx_*_argument), rtl/sf_c1_inputs.sv (fx_weighed_h)
 *
 *   hybrid, first step    a = in
 *   hybrid, decay         a = a + rshift_round((in - a) * k, 12)     between a and in: exact
 *   no-decay              a = usat(a - rshift_round(a * k, 12) + in)
 *   radix                 a = in, which comes once, behind the last step; the currents before it are in fx_weigh's sum
 */
#include "src/fx/unit.h"
#include "src/fx/round.h"
#include "src/fx/nofloat.h"

fx_scale fx_net_scale(const fx_net *net, const fx_scale *scale)
{
  const int64_t parts = (1 << net->steps) - 1;
  fx_scale s = *scale;
  if (net->mode != FX_RADIX) return s;
  /* The finest shift that leaves the factor 16 bits. */
  int64_t mul = (s.mul + parts / 2) / parts;
  for (int more = 1; scale->shift + more <= 31; more++) {
    const int64_t finer = (((int64_t)scale->mul << more) + parts / 2) / parts;
    if (finer > 65535) break;
    mul = finer, s.shift = scale->shift + more;
  }
  s.mul = (int32_t)mul;
  return s;
}

int32_t fx_net_theta(const fx_net *net, int layer)
{
  const int64_t theta = net->layer[layer].theta;
  if (net->mode != FX_RADIX || layer != FX_C2) return (int32_t)theta;
  return (int32_t)fx_rshift_round(theta * ((1 << net->steps) - 1), net->steps);
}

int32_t fx_weighed_h(int32_t sum, int steps)
{
  _Static_assert(SF_T_MAX == 8, "2^(15 + T) / (2^T - 1), rounded, for every T");
  static const int32_t mean_of[SF_T_MAX + 1] = {0, 65536, 43691, 37449, 34953, 33825, 33288, 33026, 32897};
  return (int32_t)fx_rshift_round((int64_t)sum * mean_of[steps], 15) >> (SF_H_SHIFT + steps);
}

int32_t fx_exp2_argument(int32_t current, const fx_scale *scale)
{
  const int64_t y = fx_rshift_round((int64_t)current * scale->mul, scale->shift) + scale->bias;
  return (int32_t)fx_sat(y, FX_EXP2_BITS);
}

int32_t fx_sigmoid_argument(int32_t current, const fx_scale *scale)
{
  const int64_t x = fx_rshift_round((int64_t)current * scale->mul, scale->shift) + scale->bias;
  return (int32_t)fx_sat(x, FX_SIGMOID_BITS);
}

static uint32_t integrate(uint32_t acc, uint32_t in, int32_t k, int32_t mode, bool first, int bits, uint64_t *saturated)
{
  const int64_t a = first ? 0 : acc, x = in;
  if (mode == FX_RADIX || (mode == FX_HYBRID && first)) return in;
  if (mode != FX_NODECAY) return (uint32_t)(a + fx_rshift_round((x - a) * k, SF_LEAK_FRAC));
  const int64_t exact = a - fx_rshift_round(a * k, SF_LEAK_FRAC) + x, kept = fx_usat(exact, bits);
  *saturated += kept != exact;
  return (uint32_t)kept;
}

uint32_t fx_integrate_density(uint32_t acc, uint32_t e, int32_t k, int32_t mode, bool first, uint64_t *saturated)
{
  return integrate(acc, e, k, mode, first, SF_SIGMA_BITS, saturated);
}

uint32_t fx_integrate_colour(uint32_t acc, uint32_t s, int32_t k, int32_t mode, bool first, uint64_t *saturated)
{
  return integrate(acc, s, k, mode, first, SF_COLOUR_BITS, saturated);
}
