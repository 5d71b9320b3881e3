/* Error budget: sines and cosines, of features and of a direction, at the finest LSB that is exported.
 * Derivations: docs/fixed-point.md. */
#include "bounds/budget_small.h"
#include "src/fx/unit.h"

enum { FREQS = SMALL_FREQS, FRAC = SMALL_ENCODING_FRAC };
static const double TWO_PI = 6.283185307179586, SINE_BOUND = 0.828; /* LSB of Q1.14 */
/* Of a phase that follows from an axis: its rounding, and 41722 in place of 2^16 * 4 / (2 pi). LSB of Q.16. */
static const double AXIS_TURNS = 0.5 + 0.1218;

void sf_budget_sine(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (uint32_t phase = 0; phase < 1 << FX_PHASE_BITS; phase++)
    budget_add(row, fx_sine(phase) - ldexp(sin(TWO_PI * phase / (1 << FX_PHASE_BITS)), FX_UNIT_FRAC), SINE_BOUND);
}

/* Sine and cosine of 2^k angle, whose own error is `off` radians. */
static void add_waves(sf_budget_row *row, const int16_t *sine, const int16_t *cosine, double angle, double off)
{
  for (int k = 0; k < FREQS; k++) {
    const double a = ldexp(angle, k), e = ldexp(off, k), rounded = 0.5 + ldexp(SINE_BOUND, FRAC - FX_UNIT_FRAC);
    budget_add(row, sine[k] - ldexp(sin(a), FRAC), rounded + ldexp(e * fabs(cos(a)) + e * e / 2, FRAC));
    budget_add(row, cosine[k] - ldexp(cos(a), FRAC), rounded + ldexp(e * fabs(sin(a)) + e * e / 2, FRAC));
  }
}

void sf_budget_feature_waves(sf_budget_row *row, uint64_t samples)
{
  const int16_t unit[3] = {FX_UNIT_ONE, 0, 0};
  small_planes s;
  budget_make_planes(&s, SMALL_COMPONENTS, 1);
  const int n = s.field.features;
  for (uint64_t i = 0; row->inputs < samples; i++) {
    fx_scale *scale = &s.field.phase_in;
    uint32_t pos[3];
    int16_t x[SF_DIR_MAX];
    int32_t sum[FX_APPEARANCE_MAX];
    *scale = (fx_scale){(int32_t)budget_pick(140, i, 0, 65535), (int32_t)budget_pick(141, i, 14, 40), 0};
    budget_position(&s.field, i, pos);
    fx_vm_portable.features(&s.field, pos, sum);
    fx_tensorf_encode(&s.field, pos, unit, x, NULL);
    for (int f = 0; f < n; f++) {
      const double turns = ldexp((double)sum[f] * scale->mul, -scale->shift - FX_PHASE_BITS);
      const int16_t *sine = x + n + 3 + f * FREQS;
      add_waves(row, sine, sine + n * FREQS, TWO_PI * (turns - nearbyint(turns)), TWO_PI * 0x1p-17);
    }
  }
}

/* The three axes of a direction, or their sines and cosines. */
static void direction(sf_budget_row *row, uint64_t samples, bool encoded)
{
  const uint32_t pos[3] = {0};
  small_planes s;
  budget_make_planes(&s, 1, 1);
  const int n = s.field.features;
  for (uint64_t i = 0; row->inputs < samples; i++) {
    double v[3], length = 0;
    for (uint64_t a = 0; a < 3; a++) {
      v[a] = budget_uniform(150 + a, i) * (i % 4 == 1 + a ? 1 : i % 4 ? 0.01 : 1);
      length += v[a] * v[a];
    }
    if (length < 1e-6) continue;
    int16_t unit[3], x[SF_DIR_MAX];
    for (int a = 0; a < 3; a++) {
      v[a] /= sqrt(length);
      unit[a] = (int16_t)lrint(ldexp(v[a], FX_UNIT_FRAC));
    }
    fx_tensorf_encode(&s.field, pos, unit, x, NULL);
    const int16_t *axes = x + n, *waves = x + n + 3 + 2 * n * FREQS;
    for (int a = 0; a < 3; a++) {
      if (encoded)
        add_waves(row, waves + a * FREQS, waves + (3 + a) * FREQS, v[a], 0x1p-15 + AXIS_TURNS * TWO_PI * 0x1p-16);
      else
        budget_add(row, axes[a] - ldexp(v[a], FRAC), 0.5 + ldexp(0.5, FRAC - FX_UNIT_FRAC));
    }
  }
}

void sf_budget_axes(sf_budget_row *row, uint64_t samples)
{
  direction(row, samples, false);
}

void sf_budget_direction_waves(sf_budget_row *row, uint64_t samples)
{
  direction(row, samples, true);
}
