/* Neurons, 16 or 8 to a vector; the arithmetic is that of plif.c.
 *
 * The leak product in 32-bit lanes, L = LEAK_FRAC: with d = h * 2^(L+1) + l, -2^L <= l < 2^L,
 *   rshift_round(d * k, L) = h * 2k + rshift_round(l * k, L)
 * and rshift_round(l * k, L) is what one rounding 16-bit multiplication gives of l << (15 - L) and k. So d << (15 - L),
 * split at bit 16, holds both parts, and one 16-bit dot product adds h * 2k + l' * 1 to the membrane. |d| < 2^25. */
#ifndef SPIKEFIELD_FX_PLIF_ISA_H
#define SPIKEFIELD_FX_PLIF_ISA_H
#include "src/fx/core.h"
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

/* fx_plif_step up to the membrane. */
static INLINE vec charge(vec v, vec current, leak k, int mode, bool first, uint32_t *saturated)
{
  if (mode == FX_HYBRID && first) return current;
  if (first) v = v_set(0);
  if (mode != FX_NODECAY) return add_leak(v, V(sub_epi32)(current, v), k);
  const vec kept = first ? v : V(sub_epi32)(v, add_leak(v_set(0), v, k));
  const vec exact = V(add_epi32)(kept, current), membrane = v_clamp(exact, -FX_MEMBRANE_MAX - 1, FX_MEMBRANE_MAX);
  *saturated += (uint32_t)__builtin_popcount(v_differ(exact, membrane));
  return membrane;
}

/* What the neurons of a layer share at one step; mode and first are constants wherever it is used. */
typedef struct neurons {
  leak k;
  vec theta;
  int mode;
  bool first, last;
} neurons;

static INLINE neurons neurons_of(const fx_net *net, int layer, int mode, bool first, int t)
{
  return (neurons){leak_of(net->layer[layer].k), v_set(net->layer[layer].theta), mode, first, t + 1 == net->steps};
}

/* One vector of neurons with membranes v; the spikes as bits. */
static INLINE uint32_t fire(const neurons *n, vec *v, vec current, uint32_t *saturated)
{
  *v = charge(*v, current, n->k, n->mode, n->first, saturated);
  return v_fire(v, n->theta);
}

static INLINE void put_spikes(uint64_t bits[SF_SPIKE_WORDS], int vector, uint32_t spikes)
{
  bits[vector * WIDTH / 64] |= (uint64_t)spikes << vector * WIDTH % 64;
}
#endif
