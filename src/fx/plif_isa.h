/* Neurons, 16 or 8 to a vector; the arithmetic is that of plif.c.
 *
 * The leak product in 32-bit lanes, L = LEAK_FRAC: with d = h * 2^(L+1) + l, -2^L <= l < 2^L,
 *   rshift_round(d * k, L) = h * 2k + rshift_round(l * k, L)
 * and rshift_round(l * k, L) is what one rounding 16-bit multiplication gives of l << (15 - L) and k. So d << (15 - L),
 * split at bit 16, holds both parts, and one 16-bit dot product adds h * 2k + l' * 1 to the membrane. |d| < 2^25. */
#ifndef SF_FX_PLIF_ISA_H
#define SF_FX_PLIF_ISA_H
#include "src/fx/kernels.h"
#include "src/fx/unit.h"
#include "src/fx/vec_isa.h"

_Static_assert(25 + 15 - SF_LEAK_FRAC <= 32 && SF_LEAK_FRAC <= 13, "d << (15 - L) fits 32 bits, 2k fits 16");

typedef struct leak {
  vec low, pair; /* k in 16-bit lanes; 2k and 1 to a 32-bit lane */
} leak;

static INLINE leak leak_of(int32_t k)
{
  return (leak){V(set1_epi16)((int16_t)k), v_set((int32_t)((uint32_t)k << 17 | 1))};
}

/* base + rshift_round(d * k, LEAK_FRAC) */
static INLINE vec add_leak(vec base, vec d, leak k)
{
  const vec shifted = V(slli_epi32)(d, 15 - SF_LEAK_FRAC), split = V(add_epi32)(shifted, v_set(0x8000));
  return v_dot(base, v_mulhrs_low(split, shifted, k.low), k.pair);
}

/* What the neurons of a layer share at one step; mode and first are constants wherever it is used. */
typedef struct neurons {
  leak k;
  vec theta;
  int mode;
  bool first;
} neurons;

static INLINE neurons neurons_of(const fx_net *net, int layer, int mode, bool first)
{
  return (neurons){leak_of(net->layer[layer].k), v_set(fx_net_theta(net, layer)), mode, first};
}

static INLINE vec clamp_membrane(vec exact, uint32_t *saturated)
{
  const vec membrane = v_clamp(exact, -FX_MEMBRANE_MAX - 1, FX_MEMBRANE_MAX);
  *saturated += (uint32_t)__builtin_popcount(v_differ(exact, membrane));
  return membrane;
}

/* fx_plif_step up to the membrane; of radix the current is read at the first step alone. */
static INLINE vec charge(const neurons *n, vec v, vec current, uint32_t *saturated)
{
  if (n->mode == FX_RADIX) {
    return n->first ? current : clamp_membrane(V(slli_epi32)(v, 1), saturated);
  }
  if (n->mode == FX_HYBRID && n->first) return current;
  if (n->first) v = v_set(0);
  if (n->mode != FX_NODECAY) return add_leak(v, V(sub_epi32)(current, v), n->k);
  const vec kept = n->first ? v : V(sub_epi32)(v, add_leak(v_set(0), v, n->k));
  return clamp_membrane(V(add_epi32)(kept, current), saturated);
}

/* Where the currents of all steps lie: of sample i, step t and vector j from[t * step + i * sample + j * WIDTH].
 * weighed: 0, or how many steps are weighed into one current, that of step 0. */
typedef struct currents {
  enum { WORDS, HALVES, REALS } kind; /* of 32 or 16 bits; whole numbers in binary32 */
  const void *from;
  int sample, step, weighed;
  int shift;                  /* to a membrane's LSB */
  const int32_t *const *base; /* what is added, of each sample; or NULL */
} currents;

static INLINE vec current_at(const currents *c, int at)
{
  const vec x = c->kind == HALVES ? v_widen((const int16_t *)c->from + at) : v_load((const int32_t *)c->from + at);
  return c->kind == REALS ? v_whole(x) : x;
}

static INLINE vec current_of(const currents *c, int i, int t, int j, int neuron)
{
  const int at = t * c->step + i * c->sample + j * WIDTH;
  vec x = current_at(c, at);
  for (int s = 1; s < c->weighed; s++) x = V(add_epi32)(V(slli_epi32)(x, 1), current_at(c, at + s * c->step));
  if (c->base) x = V(add_epi32)(x, v_load(c->base[i] + neuron + j * WIDTH));
  return c->shift ? V(slli_epi32)(x, c->shift) : x;
}

/* One step of some vectors of a sample's neurons. */
static INLINE void fire(const neurons *n, vec *v, int vectors, const currents *c, int i, int t, int neuron,
                        uint64_t spikes[SF_SPIKE_WORDS], uint32_t *saturated)
{
  uint64_t bits[SF_SPIKE_WORDS] = {0};
#pragma GCC unroll 8
  for (int j = 0; j < vectors; j++) {
    const bool takes = n->first || n->mode != FX_RADIX; /* there is a current of this step */
    v[j] = charge(n, v[j], takes ? current_of(c, i, t, j, neuron) : v_set(0), saturated);
    bits[j * WIDTH / 64] |= (uint64_t)v_fire(&v[j], n->theta) << j * WIDTH % 64;
  }
  memcpy((uint8_t *)spikes + neuron / 8, bits, (size_t)(vectors * WIDTH / 8)); /* little-endian */
}

enum { TOGETHER = 2 }; /* samples whose steps overlap */

/* All steps of `vectors` vectors of neurons of some samples, from i on of the currents. Membranes stay in registers. */
static INLINE void fire_samples(const neurons *first, const neurons *later, int steps, int spiking, const currents *c,
                                int neuron, int vectors, int sample, int i, int samples, fx_block *b)
{
  uint32_t *saturated = &b->saturated[fx_spiking_layers[spiking]][sample + i];
  vec v[TILE];
#pragma GCC unroll 8
  for (int j = 0; j < samples * vectors; j++) v[j] = v_set(0);
#pragma GCC unroll 8
  for (int s = 0; s < samples; s++)
    fire(first, v + s * vectors, vectors, c, i + s, 0, neuron, b->spikes[spiking][0][sample + i + s], saturated + s);
  for (int t = 1; t < steps; t++)
#pragma GCC unroll 8
    for (int s = 0; s < samples; s++)
      fire(later, v + s * vectors, vectors, c, i + s, t, neuron, b->spikes[spiking][t][sample + i + s], saturated + s);
}

/* The same of n samples from `sample` on, the first of which is sample 0 of the currents; vectors: TILE or 1. */
static INLINE void fire_layer(const fx_net *net, int spiking, int mode, const currents *c, int neuron, int vectors,
                              int sample, int n, fx_block *b)
{
  const int layer = fx_spiking_layers[spiking], together = vectors == 1 ? TOGETHER : 1;
  const neurons first = neurons_of(net, layer, mode, true), later = neurons_of(net, layer, mode, false);
  int i = 0;
  for (; i + together <= n; i += together)
    fire_samples(&first, &later, net->steps, spiking, c, neuron, vectors, sample, i, together, b);
  for (; i < n; i++) fire_samples(&first, &later, net->steps, spiking, c, neuron, vectors, sample, i, 1, b);
}
#endif
