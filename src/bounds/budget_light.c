/* Error budget: tables, and from density and colour to pixels. Derivations: docs/fixed-point.md. */
#include "quant/quant.h"
#include "bounds/budget_blocks.h"
#include "src/fx/tensorf.h"
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

/* ---- the density of TensoRF ---- */

/* Seen through ReLU and a scale of 1: shifted up, so that a negative argument is seen, too. */
void sf_budget_activation_argument(sf_budget_row *row, uint64_t samples)
{
  const int32_t up = 1 << 22;
  fx_tensorf field = {.activation = FX_RELU, .sigma_out = {1, FX_ACTIVATION_FRAC - SF_LOG_FRAC, 0}};
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const int64_t limit = ((int64_t)1 << budget_pick(62, i, 1, 31)) - 1;
    const int64_t sum = budget_pick(63, i, -limit, limit) * (i % 2 ? 1 : 127);
    field.density_in = (fx_scale){(int32_t)budget_pick(64, i, 0, 65535), (int32_t)budget_pick(65, i, 0, 40), up};
    const double exact = ldexp((double)sum * field.density_in.mul, -field.density_in.shift);
    if (fabs(exact) < up - 1) budget_add(row, (double)fx_tensorf_activate(&field, sum) - up - exact, 0.5);
  }
}

/* Interpolated between values 1/16 apart, convex: the second derivative s (1 - s) is largest at the end nearer to 0.
 * Table and product are rounded to 2^-24, the result to 2^-20; from 16 on the tail is left out. */
static double softplus_bound(double x)
{
  const double near = floor(fabs(x) * 16) / 16, s = 1 / (1 + exp(-near));
  const double tail = near < 16 ? 0 : exp(-near);
  return ldexp(s * (1 - s) / 2048 + tail, FX_ACTIVATION_FRAC) + 1.0 / 16 + 0.5;
}

void sf_budget_softplus(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (int32_t y = -(17 << SF_LOG_FRAC); y < 17 << SF_LOG_FRAC; y++) {
    const double x = ldexp(y, -SF_LOG_FRAC), exact = fmax(x, 0) + log1p(exp(-fabs(x)));
    budget_add(row, fx_softplus(y) - ldexp(exact, FX_ACTIVATION_FRAC), softplus_bound(x));
  }
}

void sf_budget_relu(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (int32_t y = -(1 << (FX_ACTIVATION_BITS - 1)); y < 1 << (FX_ACTIVATION_BITS - 1); y++)
    budget_add(row, fx_relu(y) - ldexp(fmax(y, 0), FX_ACTIVATION_FRAC - SF_LOG_FRAC), 0);
}

void sf_budget_activated(sf_budget_row *row, uint64_t samples)
{
  fx_tensorf field = {.activation = FX_SOFTPLUS, .density_in = {1, 0, 0}};
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const int64_t limit = (int64_t)1 << budget_pick(66, i, 10, FX_ACTIVATION_BITS - 1);
    const int32_t y = (int32_t)budget_pick(67, i, -limit, limit - 1);
    field.sigma_out = (fx_scale){(int32_t)budget_pick(68, i, 0, 65535), (int32_t)budget_pick(69, i, 0, 40), 0};
    const double exact = ldexp((double)fx_softplus(y) * field.sigma_out.mul, -field.sigma_out.shift);
    if (exact < ldexp(1, SF_SIGMA_BITS) - 1) budget_add(row, fx_tensorf_activate(&field, y) - exact, 0.5);
  }
}

/* ---- compositing ---- */

void sf_budget_weight(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const uint32_t sigma = (uint32_t)budget_pick(74, i, 0, ((int64_t)1 << budget_pick(75, i, 1, SF_SIGMA_BITS)) - 1);
    const int32_t delta = (int32_t)budget_pick(76, i, 1, (int64_t)1 << budget_pick(77, i, 1, SF_DELTA_FRAC));
    fx_pixel pixel = {.transmittance = i % 2 ? FX_TRANS_ONE : (uint32_t)budget_pick(78, i, 0, FX_TRANS_ONE)};
    const double left = pixel.transmittance, tau = ldexp(sigma, -SF_SIGMA_FRAC) * ldexp(delta, -SF_DELTA_FRAC);
    budget_add(row, fx_composite_weight(&pixel, sigma, delta, 0) + left * expm1(-tau),
               ldexp(left, -SF_TRANS_FRAC) * (EXP_NEG_BOUND + 0.5) + 0.5);
  }
}

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
