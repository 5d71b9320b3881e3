/* Error budget: tables, and from density and colour to pixels. Derivations: docs/fixed-point.md. */
#include "quant/quant.h"
#include "bounds/budget_blocks.h"
#include "src/fx/unit.h"
#include <string.h>

/* ---- tables ---- */

void sf_budget_argument(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const fx_scale scale = {(int32_t)budget_pick(60, i, 0, 65535), (int32_t)budget_pick(61, i, 0, 31), 0};
    for (int32_t c = -SF_LANES * 127; c <= SF_LANES * 127; c += 1 + (int32_t)(i % 64)) {
      const double exact = ldexp((double)c * scale.mul, -scale.shift);
      if (fabs(exact) < 32767) budget_add(row, fx_sigmoid_argument(c, &scale) - exact, 0.5);
      if (fabs(exact) < 131071) budget_add(row, fx_exp2_argument(c, &scale) - exact, 0.5);
    }
  }
}

static const double EXP2_RELATIVE = 9.77e-7;

static void exp2_all(sf_budget_row *row, uint64_t samples, bool high)
{
  (void)samples;
  for (int32_t y = -(1 << (FX_EXP2_BITS - 1)); y < 16 << SF_LOG_FRAC; y++) {
    const double exact = ldexp(exp2(ldexp(y, -SF_LOG_FRAC)), SF_SIGMA_FRAC), error = fx_exp2(y) - exact;
    if ((exact >= 0x1p20) != high) continue;
    const double bound = 0.5 + EXP2_RELATIVE * exact, unit = high ? exact * 1e-6 : 1;
    budget_add(row, error / unit, bound / unit);
  }
}

void sf_budget_exp2_low(sf_budget_row *row, uint64_t samples)
{
  exp2_all(row, samples, false);
}

void sf_budget_exp2_high(sf_budget_row *row, uint64_t samples)
{
  exp2_all(row, samples, true);
}

void sf_budget_sigmoid(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (int32_t x = -(1 << (FX_SIGMOID_BITS - 1)); x < 1 << (FX_SIGMOID_BITS - 1); x++)
    budget_add(row, fx_sigmoid(x) - 65536 / (1 + exp(-ldexp(x, -SF_LOG_FRAC))), 1.78);
}

static const double EXP_NEG_BOUND = 1.85;

void sf_budget_exp_neg(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (uint32_t tau = 0; tau <= 32u << SF_TRANS_FRAC; tau++)
    budget_add(row, fx_exp_neg(tau) - FX_TRANS_ONE * exp(-ldexp(tau, -SF_TRANS_FRAC)), EXP_NEG_BOUND);
}

/* ---- compositing ---- */

void sf_budget_alpha(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const fx_out out = {.sigma =
                            (uint32_t)budget_pick(70, i, 0, ((int64_t)1 << budget_pick(71, i, 1, SF_SIGMA_BITS)) - 1)};
    const int32_t delta = (int32_t)budget_pick(72, i, 1, (int64_t)1 << budget_pick(73, i, 1, SF_DELTA_FRAC));
    fx_pixel pixel;
    fx_composite_begin(&pixel);
    fx_composite_add(&pixel, &out, delta, 0);
    const double tau = ldexp(out.sigma, -SF_SIGMA_FRAC) * ldexp(delta, -SF_DELTA_FRAC);
    budget_add(row, pixel.weight_sum + FX_TRANS_ONE * expm1(-tau), EXP_NEG_BOUND + 0.5);
  }
}

/* One ray of up to 1024 samples; half of them thin and uniform, where errors of one sign add up. `bound` of the
 * transmittance runs along: e' = a e + (T + e) (1.85 + 0.5) + 0.5; of the colour it is sum e |c - c before|. */
static void composite(sf_budget_row *row, uint64_t i, bool colour)
{
  const bool thin = i & 1;
  const int n = thin ? 1024 : (int)budget_pick(80, i, 1, 300), bits = (int)budget_pick(81, i, 4, SF_SIGMA_BITS);
  const int32_t delta = (int32_t)budget_pick(82, i, 1, 1 << 18), white[3] = {65536, 65536, 65536};
  double trans = 1, sum = 0, e = 0, sum_bound = 0, before = 0;
  fx_out out = {.sigma = (uint32_t)budget_pick(83, i, 0, ((int64_t)1 << bits) - 1)};
  fx_pixel pixel;
  fx_composite_begin(&pixel);
  for (int s = 0; s < n; s++) {
    const uint64_t at = i << 10 | (uint64_t)s;
    if (!thin) out.sigma = (uint32_t)budget_pick(84, at, 0, ((int64_t)1 << bits) - 1);
    if (thin)
      out.sigma = (uint32_t)(ldexp((double)budget_pick(85, i, 1, 4000), 16 - 2) / delta); /* tau below 4000 LSB */
    out.colour[0] = thin ? (s < n / 2 ? 65535 : 0) : (uint32_t)budget_pick(86, at, 0, 65535);
    fx_composite_add(&pixel, &out, delta, 0);
    const double a = exp(-ldexp(out.sigma, -SF_SIGMA_FRAC) * ldexp(delta, -SF_DELTA_FRAC));
    const double c = ldexp(out.colour[0], -SF_COLOUR_FRAC);
    if (s > 0) sum_bound += e * fabs(c - before);
    e = a * e + (trans + ldexp(e, -SF_TRANS_FRAC)) * (EXP_NEG_BOUND + 0.5) + 0.5;
    sum += trans * (1 - a) * c, trans *= a, before = c;
  }
  fx_composite_end(&pixel, white);
  sum_bound += e * fabs(1 - before);
  if (colour)
    budget_add(row, ldexp((double)pixel.colour[0], -SF_TRANS_FRAC) - 65536 * (sum + trans), sum_bound / 16);
  else
    budget_add(row, pixel.transmittance - FX_TRANS_ONE * trans, e);
}

void sf_budget_transmittance(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; i < samples / 64 + 1; i++) composite(row, i, false);
}

void sf_budget_pixel(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; i < samples / 64 + 1; i++) composite(row, i, true);
}
