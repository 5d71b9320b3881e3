/* Activations and integrators, one sample to a lane; the arithmetic is that of exp2.c, sigmoid.c and integrate.c. */
#ifndef SF_FX_INTEGRATE_ISA_H
#define SF_FX_INTEGRATE_ISA_H
#include "src/fx/kernels.h"
#include "src/fx/unit.h"
#include "src/fx/vec_isa.h"

enum { COLOURS = 3 };
_Static_assert(FX_BLOCK % WIDTH == 0, "a block is whole vectors");

static const int32_t exp2_table[257] = {
#include "fx/tables/exp2.inc"
};
static const int32_t sigmoid_table[257] = {
#include "fx/tables/sigmoid.inc"
};

/* Rounded in two shifts: the product alone takes 32 bits. */
static INLINE vec argument(vec current, const fx_scale *scale, int bits)
{
  const vec product = V(mullo_epi32)(current, v_set(scale->mul)), one = v_set(1);
  const __m128i twice = _mm_cvtsi32_si128(scale->shift - 1);
  const vec y = scale->shift == 0 ? product : V(srai_epi32)(V(add_epi32)(V(sra_epi32)(product, twice), one), 1);
  return v_clamp(V(add_epi32)(y, v_set(scale->bias)), -(1 << (bits - 1)), (1 << (bits - 1)) - 1);
}

/* a + (((b - a) * low + half) >> n) of neighbours in a table */
static INLINE vec interpolate(const int32_t *table, vec i, vec low, int n)
{
  const vec a = v_gather(table, i), b = v_gather(table + 1, i);
  return V(add_epi32)(a, v_shift_round(V(mullo_epi32)(V(sub_epi32)(b, a), low), n));
}

/* fx_exp2 for |y| < 32.0. Shifts by more than 31 or by negative counts give 0, so one of the two is the result, or, for
 * a shift by 0, both are. */
static INLINE vec exp2_of(vec y)
{
  enum { LOW = SF_LOG_FRAC - 8 }; /* below the table's index */
  const vec fraction = V_BITS(and)(y, v_set((1 << SF_LOG_FRAC) - 1));
  const vec t =
      interpolate(exp2_table, V(srli_epi32)(fraction, LOW), V_BITS(and)(fraction, v_set((1 << LOW) - 1)), LOW);
  const vec right = V(sub_epi32)(v_set(24 - SF_SIGMA_FRAC), V(srai_epi32)(y, SF_LOG_FRAC)),
            left = V(sub_epi32)(v_set(0), right);
  const vec half = V(srli_epi32)(V(sllv_epi32)(v_set(1), right), 1);
  const vec e = V_BITS(or)(V(srlv_epi32)(V(add_epi32)(t, half), right), V(sllv_epi32)(t, left));
  const vec below = V(sub_epi32)(y, v_set((SF_SIGMA_BITS - SF_SIGMA_FRAC) << SF_LOG_FRAC)); /* negative: in range */
  return v_select_negative(below, e, v_set((1 << SF_SIGMA_BITS) - 1));
}

static INLINE vec sigmoid_of(vec x)
{
  const vec m = V(min_epi32)(V(abs_epi32)(x), v_set(32767));
  const vec p = interpolate(sigmoid_table, V(srli_epi32)(m, 7), V_BITS(and)(m, v_set(127)), 7);
  return v_select_negative(x, V(sub_epi32)(v_set(65536), p), p);
}

/* rshift_round(d * k, LEAK_FRAC) for |d| < 2^29 */
static INLINE vec leak_wide(vec d, vec k)
{
  const vec low = V(mullo_epi32)(V_BITS(and)(d, v_set(FX_LEAK_ONE - 1)), k);
  return V(add_epi32)(V(mullo_epi32)(V(srai_epi32)(d, SF_LEAK_FRAC), k), v_shift_round(low, SF_LEAK_FRAC));
}

static INLINE void integrate(uint32_t *acc, vec in, int32_t k, int mode, bool first, int bits, uint32_t *saturated)
{
  const vec a = first ? v_set(0) : v_load(acc);
  if (mode == FX_HYBRID && first) {
    v_store(acc, in);
  } else if (mode != FX_NODECAY) {
    v_store(acc, V(add_epi32)(a, leak_wide(V(sub_epi32)(in, a), v_set(k))));
  } else {
    const vec exact = V(add_epi32)(V(sub_epi32)(a, leak_wide(a, v_set(k))), in);
    const vec kept = v_clamp(exact, 0, (1 << bits) - 1);
    const uint32_t differ = v_differ(exact, kept);
    for (int i = 0; i < WIDTH; i++) saturated[i] += differ >> i & 1;
    v_store(acc, kept);
  }
}

/* The densities of samples i..i + WIDTH - 1, counted where they are at their limit. */
static INLINE vec densities_of(vec y, fx_block *b, int i)
{
  const vec e = exp2_of(y);
  const uint32_t below = v_differ(e, v_set((1 << SF_SIGMA_BITS) - 1));
  for (uint32_t rest = ~below & (((uint32_t)1 << WIDTH) - 1); rest; rest &= rest - 1)
    b->saturated[FX_D2][i + __builtin_ctz(rest)]++;
  return e;
}

static INLINE void integrate_densities(const fx_net *net, fx_block *b, fx_scratch *s, int i, int mode, bool first,
                                       int t)
{
  const vec e = densities_of(argument(v_load(&s->argument[t][0][i]), &net->exp_in, FX_EXP2_BITS), b, i);
  integrate(&s->acc[0][i], e, net->layer[FX_D2].k, mode, first, SF_SIGMA_BITS, &b->saturated[FX_D2][i]);
}

static INLINE void integrate_step(const fx_net *net, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  for (int i = 0; i < b->n; i += WIDTH) {
    if (!fx_net_decodes(net)) integrate_densities(net, b, s, i, mode, first, t);
    for (int o = 1; o <= COLOURS; o++)
      integrate(&s->acc[o][i], sigmoid_of(argument(v_load(&s->argument[t][o][i]), &net->sigmoid_in, FX_SIGMOID_BITS)),
                net->layer[FX_C3].k, mode, first, SF_COLOUR_BITS, &b->saturated[FX_C3][i]);
  }
}

/* The argument of output `at` (0: the density) for samples i..i + WIDTH - 1: the sum of all steps. The product
 * takes 40 bits, so this part is scalar: it happens once per sample. */
static INLINE vec weighed_argument(const fx_scratch *s, int i, int at, const fx_scale *scale)
{
  _Alignas(64) int32_t y[WIDTH];
  for (int l = 0; l < WIDTH; l++) {
    const int32_t sum = s->argument[0][at][i + l];
    y[l] = at ? fx_sigmoid_argument(sum, scale) : fx_exp2_argument(sum, scale);
  }
  return v_load(y);
}

/* Radix: tables are read once. */
static INLINE void read_weighed(const fx_net *net, fx_block *b, fx_scratch *s)
{
  const fx_scale density = fx_net_scale(net, &net->exp_in), colour = fx_net_scale(net, &net->sigmoid_in);
  for (int i = 0; i < b->n; i += WIDTH) {
    if (!fx_net_decodes(net)) v_store(&s->acc[0][i], densities_of(weighed_argument(s, i, 0, &density), b, i));
    for (int o = 1; o <= COLOURS; o++) v_store(&s->acc[o][i], sigmoid_of(weighed_argument(s, i, o, &colour)));
  }
}
#endif
