/* Parametric leaky integrate-and-fire neuron with soft reset.
 * Mirror: rtl/sf_plif.sv
 *
 * In hybrid and decay mode the new membrane lies between v and the current, ends included: with d = I - v and
 * 0 <= k <= 2^12, d * k / 2^12 lies between 0 and d, both integers, and so does its rounding. A reset leaves
 * v >= 0. So s24 holds every membrane whose currents fit s24, and only the other two modes need its saturation.
 *
 * Radix: v = 2 v + I, and the current comes at the first step alone, so the spikes are the binary digits of
 * I / (2 theta), the most significant first. Rails change no spike: with theta < 2^22 a membrane at the upper one keeps
 * at least 2^22 behind its spike and is there again at the next step; one at the lower never fires. */
#include "src/fx/unit.h"
#include "src/fx/round.h"
#include <string.h>
#include "src/fx/nofloat.h"

/* rshift_round(d * k, LEAK_FRAC) in 32 bits: the high part of d times k is a multiple of 2^LEAK_FRAC, so only the low
 * part is rounded. The RTL multiplies 25 x 13 bits. */
static inline int32_t leak_product(int32_t d, int32_t k)
{
  const int32_t high = d >> SF_LEAK_FRAC, low = d & (FX_LEAK_ONE - 1);
  return high * k + ((low * k + FX_LEAK_ONE / 2) >> SF_LEAK_FRAC);
}

static inline int32_t charge_leaky(int32_t v, int32_t current, int32_t k)
{
  return v + leak_product(current - v, k);
}

static inline int32_t charge_nodecay(int32_t v, int32_t current, int32_t k)
{
  return v - leak_product(v, k) + current;
}

static inline int32_t charge_radix(int32_t v, int32_t current)
{
  return 2 * v + current;
}

/* Hybrid's first step is v = I, which is the leaky form with k = 1. */
static inline int32_t effective_leak(int32_t k, int32_t mode, bool first)
{
  return mode == FX_HYBRID && first ? FX_LEAK_ONE : k;
}

static inline int32_t clamp_membrane(int32_t u)
{
  return u > FX_MEMBRANE_MAX ? FX_MEMBRANE_MAX : u < -FX_MEMBRANE_MAX - 1 ? -FX_MEMBRANE_MAX - 1 : u;
}

fx_plif fx_plif_step(int32_t v, int32_t current, int32_t k, int32_t theta, int32_t mode, bool first)
{
  const int32_t old = first ? 0 : v;
  const int32_t exact = mode == FX_RADIX     ? charge_radix(old, current)
                        : mode == FX_NODECAY ? charge_nodecay(old, current, k)
                                             : charge_leaky(old, current, effective_leak(k, mode, first));
  const int32_t membrane = clamp_membrane(exact);
  const bool spike = membrane >= theta;
  return (fx_plif){
      .v = membrane - (spike ? theta : 0), .membrane = membrane, .spike = spike, .saturated = membrane != exact};
}

static void charge_layer(int32_t *restrict v, const int32_t *restrict current, int n, int32_t k)
{
  for (int o = 0; o < n; o++) v[o] = charge_leaky(v[o], current[o], k);
}

/* The modes that saturate. */
static int charge_layer_limited(int32_t *restrict v, const int32_t *restrict current, int n, int32_t k, int32_t mode)
{
  int saturated = 0;
  for (int o = 0; o < n; o++) {
    const int32_t exact = mode == FX_RADIX ? charge_radix(v[o], current[o]) : charge_nodecay(v[o], current[o], k);
    v[o] = clamp_membrane(exact);
    saturated += v[o] != exact;
  }
  return saturated;
}

static void fire_layer(int32_t *restrict v, int n, int32_t theta, uint64_t spikes[SF_SPIKE_WORDS])
{
  uint8_t fired[SF_LANES] = {0};
  for (int o = 0; o < n; o++) {
    const int32_t spike = v[o] >= theta;
    v[o] -= -spike & theta;
    fired[o] = (uint8_t)spike;
  }
  for (int word = 0; word < SF_SPIKE_WORDS; word++) {
    uint64_t bits = 0;
    for (int b = 0; b < 64; b++) bits |= (uint64_t)fired[word * 64 + b] << b;
    spikes[word] = bits;
  }
}

int fx_plif_layer(int32_t *v, const int32_t *current, int n, const fx_layer *layer, int32_t mode, bool first,
                  uint64_t spikes[SF_SPIKE_WORDS], int32_t *membrane)
{
  int saturated = 0;
  if (first) memset(v, 0, (size_t)n * sizeof *v);
  if (mode == FX_RADIX || mode == FX_NODECAY)
    saturated = charge_layer_limited(v, current, n, layer->k, mode);
  else
    charge_layer(v, current, n, effective_leak(layer->k, mode, first));
  if (membrane)
    for (int o = 0; o < n; o++) membrane[o] = v[o];
  fire_layer(v, n, layer->theta, spikes);
  return saturated;
}
