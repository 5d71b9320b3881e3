/* Dense products: GANG samples at once, in functions of their own, where the compiler keeps all sums in registers. A
 * gang of three loads 11 vectors for 24 products; CPUs load fewer than they multiply. */
#ifndef SF_FX_DENSE_ISA_H
#define SF_FX_DENSE_ISA_H
#include "src/fx/plif_isa.h"

enum { GANG = 3 };
_Static_assert(FX_BLOCK % GANG == 0, "a block is whole gangs");

#define EACH(k, j)                                                                                                     \
  _Pragma("GCC unroll 3") for (int k = 0; k < GANG; k++) _Pragma("GCC unroll 8") for (int j = 0; j < TILE; j++)

/* out[k][o] = from[k][o] + sum of w[p][o] . x[k][p], pairs of 16-bit values, for TILE vectors of outputs, rows of
 * SF_LANES; from NULL: 0. */
static __attribute__((noinline)) void pair_products(const int16_t *w, int pairs, const int16_t *const x[GANG],
                                                    const int32_t *const *from, int32_t *out)
{
  vec acc[GANG][TILE];
  EACH(k, j) acc[k][j] = from ? v_load(from[k] + j * WIDTH) : v_set(0);
  for (int p = 0; p < pairs; p++) {
    vec in[GANG];
#pragma GCC unroll 3
    for (int k = 0; k < GANG; k++) in[k] = v_word(x[k] + 2 * p);
#pragma GCC unroll 8
    for (int j = 0; j < TILE; j++) {
      const vec row = v_load(w + 2 * (p * SF_LANES + j * WIDTH));
#pragma GCC unroll 3
      for (int k = 0; k < GANG; k++) acc[k][j] = v_dot(acc[k][j], in[k], row);
    }
  }
  EACH(k, j) v_store(out + k * SF_LANES + j * WIDTH, acc[k][j]);
}

/* Lanes beyond 24 bits become the nearest that fits; returns how many there were. */
static INLINE uint32_t saturate(int32_t *current)
{
  uint32_t saturated = 0;
  for (int j = 0; j < VECTORS; j++) {
    const vec exact = v_load(current + j * WIDTH), kept = v_clamp(exact, -FX_MEMBRANE_MAX - 1, FX_MEMBRANE_MAX);
    saturated += (uint32_t)__builtin_popcount(v_differ(exact, kept));
    v_store(current + j * WIDTH, kept);
  }
  return saturated;
}

/* Samples of a gang that the block has. */
static INLINE int members(const fx_block *b, int gang)
{
  return b->n - gang < GANG ? b->n - gang : GANG;
}

static INLINE void fire_gang(const fx_net *net, int spiking, int mode, const int32_t *current, int step, int shift,
                             int gang, fx_block *b)
{
  for (int at = 0; at < SF_LANES; at += TILE * WIDTH) {
    const currents c = {.kind = WORDS, .from = current + at, .sample = SF_LANES, .step = step, .shift = shift};
    fire_layer(net, spiking, mode, &c, at, TILE, gang, members(b, gang), b);
  }
}

/* From C2's currents, of radix the sum of all steps, to its membranes. */
static INLINE int c2_shift(const fx_net *net, int mode)
{
  return fx_layer_frac(FX_C2, mode) - (mode == FX_RADIX ? net->steps : 0);
}

/* C1 of a decoder: constant inputs and biases, once per sample. */
static INLINE void c1_constant_layer(const fx_core *core, fx_block *b, int mode)
{
  const fx_words *words = &core->words;
  const fx_net *net = &core->scene->net;
  for (int i = 0; i < b->n; i += GANG) {
    int32_t current[GANG][SF_LANES];
    for (int at = 0; at < SF_LANES; at += TILE * WIDTH) {
      const int32_t *bias = words->c1_bias + at;
      pair_products(words->c1_constant[0][at], (net->layer[FX_C1].n_in + 1) / 2,
                    (const int16_t *const[]){b->constant[i], b->constant[i + 1], b->constant[i + 2]},
                    (const int32_t *const[]){bias, bias, bias}, &current[0][at]);
    }
    for (int k = 0; k < members(b, i); k++) b->saturated[FX_C1][i + k] += saturate(current[k]);
    fire_gang(net, 1, mode, current[0], 0, 0, i, b);
  }
}

enum { BYTES = 4 * WIDTH };

/* Bytes 0 or 1 of the neurons from `at` on. */
static INLINE vec spike_vector(const uint64_t bits[SF_SPIKE_WORDS], int at)
{
#if defined(__AVX512VNNI__)
  return _mm512_maskz_set1_epi8(bits[at / 64], 1);
#else
  const vec eighth = _mm256_set_epi64x(0x0303030303030303, 0x0202020202020202, 0x0101010101010101, 0);
  const vec bit = v_set64((int64_t)0x8040201008040201);
  const vec byte = _mm256_shuffle_epi8(v_word((const uint8_t *)bits + at / 8), eighth);
  return _mm256_min_epu8(_mm256_and_si256(byte, bit), _mm256_set1_epi8(1));
#endif
}

static INLINE void spike_bytes(const uint64_t bits[SF_SPIKE_WORDS], uint8_t bytes[SF_LANES])
{
  for (int at = 0; at < SF_LANES; at += BYTES) v_store(bytes + at, spike_vector(bits, at));
}

/* Radix: the spikes of all steps as numbers below 2^steps. */
static INLINE void number_bytes(const fx_block *b, int spiking, int steps, int i, uint8_t bytes[SF_LANES])
{
  for (int at = 0; at < SF_LANES; at += BYTES) {
    vec number = spike_vector(b->spikes[spiking][0][i], at);
    for (int t = 1; t < steps; t++)
      number = V(add_epi8)(V(add_epi8)(number, number), spike_vector(b->spikes[spiking][t][i], at));
    v_store(bytes + at, number);
  }
}

/* biases[n]: what they add to the sum of all steps. */
static INLINE void all_digits(int steps, const int32_t *bias, int n, int32_t *sum)
{
  for (int o = 0; o < n; o++) sum[o] = bias[o] * ((1 << steps) - 1);
}
#endif
