/* Both nets for a block of samples, layer by layer and step by step; 16 or 8 neurons to a vector.
 *
 * The leak product in 32-bit lanes, L = LEAK_FRAC: with d = h * 2^(L+1) + l, -2^L <= l < 2^L,
 *   rshift_round(d * k, L) = h * 2k + rshift_round(l * k, L)
 * and rshift_round(l * k, L) is what one rounding 16-bit multiplication gives of l << (15 - L) and k. So d << (15 - L),
 * split at bit 16, holds both parts, and one 16-bit dot product adds h * 2k + l' * 1 to the membrane. |d| < 2^25. */
#include "src/fx/core.h"
#include "src/fx/unit.h"
#include "src/fx/vec_isa.h"

enum { VECTORS = SF_LANES / WIDTH, COLOURS = 3, GANG = 3 };
_Static_assert(FX_BLOCK % GANG == 0 && FX_BLOCK % WIDTH == 0, "a block is whole gangs and whole vectors");
enum { GROUP = 4, GROUPS = SF_LANES / GROUP + 1 }; /* rows added at once; the most of one sample */
enum { C2_DENSE_PERCENT = 40 }; /* firing rate of C1 at which rows for spikes cost as much as all rows */

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

/* One vector of neurons; the spikes as bits. */
static INLINE uint32_t fire(const neurons *n, int32_t *v, vec current, uint32_t *saturated)
{
  vec membrane = charge(n->first ? v_set(0) : v_load(v), current, n->k, n->mode, n->first, saturated);
  const uint32_t spikes = v_fire(&membrane, n->theta);
  if (!n->last) v_store(v, membrane);
  return spikes;
}

static INLINE void put_spikes(uint64_t bits[2], int vector, uint32_t spikes)
{
  bits[vector * WIDTH / 64] |= (uint64_t)spikes << vector * WIDTH % 64;
}

/* ---- dense products: GANG samples at once, in a function of their own, where the compiler keeps all sums in
 * registers. A gang of three loads 11 vectors for 24 products; CPUs load fewer than they multiply. ---- */

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

/* out[k][o] = sum of w[q][o] . x[k][q], quads of weights and of bytes 0 or 1. */
static __attribute__((noinline)) void quad_products(const int8_t *w, const uint8_t (*x)[SF_LANES], int32_t *out)
{
  vec acc[GANG][TILE];
  EACH(k, j) acc[k][j] = v_set(0);
  for (int q = 0; q < SF_LANES / 4; q++) {
    vec in[GANG];
#pragma GCC unroll 3
    for (int k = 0; k < GANG; k++) in[k] = v_word(x[k] + 4 * q);
#pragma GCC unroll 8
    for (int j = 0; j < TILE; j++) {
      const vec row = v_load(w + 4 * (q * SF_LANES + j * WIDTH));
#pragma GCC unroll 3
      for (int k = 0; k < GANG; k++) acc[k][j] = v_dot4(acc[k][j], in[k], row);
    }
  }
  EACH(k, j) v_store(out + k * SF_LANES + j * WIDTH, acc[k][j]);
}

static void d1_currents(const fx_words *words, const fx_block *b, fx_scratch *s)
{
  for (int i = 0; i < b->n; i += GANG)
    for (int first = 0; first < VECTORS; first += TILE)
      pair_products(words->d1[0][first * WIDTH], SF_FEATURE_MAX / 2,
                    (const int16_t *const[]){b->f[i], b->f[i + 1], b->f[i + 2]}, NULL,
                    &s->d1_current[i][first * WIDTH]);
}

static void c1_currents(const fx_words *words, const fx_block *b, fx_scratch *s)
{
  for (int i = 0; i < b->n; i += GANG)
    for (int first = 0; first < VECTORS; first += TILE) {
      const int at = first * WIDTH;
      pair_products(words->c1_h[0][at], SF_OUT_MAX / 2,
                    (const int16_t *const[]){s->d2_current[i], s->d2_current[i + 1], s->d2_current[i + 2]},
                    (const int32_t *const[]){b->base[i] + at, b->base[i + 1] + at, b->base[i + 2] + at},
                    &s->current[i][at]);
    }
}

static INLINE void spike_bytes(const uint64_t bits[2], uint8_t bytes[SF_LANES])
{
#if defined(__AVX512VNNI__)
  for (int word = 0; word < 2; word++) v_store(bytes + 64 * word, _mm512_maskz_set1_epi8(bits[word], 1));
#else
  for (int i = 0; i < SF_LANES; i++) bytes[i] = bits[i / 64] >> i % 64 & 1;
#endif
}

static void c2_currents_dense(const fx_words *words, const uint64_t (*spikes)[2], int n, fx_scratch *s)
{
  for (int i = 0; i < n; i += GANG) {
    uint8_t x[GANG][SF_LANES];
    for (int k = 0; k < GANG; k++) spike_bytes(spikes[i + k], x[k]);
    for (int first = 0; first < VECTORS; first += TILE)
      quad_products(words->c2_quads[0][first * WIDTH], (const uint8_t(*)[SF_LANES])x, &s->current[i][first * WIDTH]);
  }
}

/* ---- products with spikes: rows for events ---- */

/* The spikes of one layer of a block at one step, sample after sample, in groups of GROUP rows: a loop over all groups
 * has no branch per sample. A sample's last group is filled up with SF_LANES, the row of zeros; a silent sample has one
 * such. */
typedef struct events {
  int groups;
  uint8_t row[FX_BLOCK * (SF_LANES + GROUP) + 64];
  uint8_t sample[FX_BLOCK * GROUPS + 64];
} events;

static INLINE void list_spikes(uint8_t *row, const uint64_t bits[2], int low)
{
#if defined(__AVX512VBMI2__)
  const vec iota = _mm512_set_epi64(0x3f3e3d3c3b3a3938, 0x3736353433323130, 0x2f2e2d2c2b2a2928, 0x2726252423222120,
                                    0x1f1e1d1c1b1a1918, 0x1716151413121110, 0x0f0e0d0c0b0a0908, 0x0706050403020100);
  v_store(row, _mm512_maskz_compress_epi8(bits[0], iota));
  v_store(row + low, _mm512_maskz_compress_epi8(bits[1], _mm512_or_si512(iota, _mm512_set1_epi8(64))));
#else
  (void)low;
  for (int word = 0; word < 2; word++)
    for (uint64_t rest = bits[word]; rest; rest &= rest - 1) *row++ = (uint8_t)(word * 64 + __builtin_ctzll(rest));
#endif
}

static INLINE void list_events(events *e, const uint64_t (*spikes)[2], int n)
{
  e->groups = 0;
  for (int i = 0; i < n; i++) {
    const int low = __builtin_popcountll(spikes[i][0]), count = low + __builtin_popcountll(spikes[i][1]);
    uint8_t *row = e->row + e->groups * GROUP;
    list_spikes(row, spikes[i], low);
    memset(row + count, SF_LANES, GROUP);
    for (int at = 0; at < GROUPS; at += 4 * WIDTH) /* what is written too far, the next sample overwrites */
      v_store(e->sample + e->groups + at, V(set1_epi8)((char)i));
    e->groups += count ? (count + GROUP - 1) / GROUP : 1;
  }
}

/* Group g: its rows, read with one load, and its sample. Returns -1 when it goes on with the sample of the group
 * before, or 0 when it starts a new one. */
static INLINE int32_t read_group(const events *e, int g, uint32_t row[GROUP], int *sample)
{
  uint32_t rows;
  const int before = *sample;
  memcpy(&rows, e->row + g * GROUP, sizeof rows);
  for (int i = 0; i < GROUP; i++) row[i] = rows >> 8 * i & 255;
  *sample = e->sample[g];
  return -(*sample == before);
}

static INLINE __m256i row16(const int16_t (*w)[SF_OUT_MAX], uint32_t i)
{
  return _mm256_load_si256((const __m256i *)w[i]);
}

/* sum[sample] = sum of its rows of 16. */
static INLINE void add_rows16(const events *e, const int16_t (*w)[SF_OUT_MAX], int16_t (*sum)[SF_OUT_MAX])
{
  __m256i acc = _mm256_setzero_si256();
  int sample = -1;
  for (int g = 0; g < e->groups; g++) {
    uint32_t row[GROUP];
    const __m256i go_on = _mm256_set1_epi32(read_group(e, g, row, &sample));
    const __m256i four = _mm256_add_epi16(_mm256_add_epi16(row16(w, row[0]), row16(w, row[1])),
                                          _mm256_add_epi16(row16(w, row[2]), row16(w, row[3])));
    acc = _mm256_add_epi16(_mm256_and_si256(acc, go_on), four);
    _mm256_storeu_si256((__m256i *)sum[sample], acc);
  }
}

/* a + b of 8-bit lanes as 16-bit lanes: low and high halves of each 128 bits; fx_words.c2 is ordered so that they are
 * neighbouring outputs. */
static INLINE void add_bytes(vec a, vec b, vec sum[2])
{
  const vec one = V(set1_epi8)(1);
  sum[0] = V(maddubs_epi16)(one, V(unpacklo_epi8)(a, b));
  sum[1] = V(maddubs_epi16)(one, V(unpackhi_epi8)(a, b));
}

/* sum[sample] = sum of its rows of SF_LANES; exact in 16 bits. */
static INLINE void add_rows(const events *e, const int8_t (*w)[SF_LANES], int16_t (*sum)[SF_LANES])
{
  enum { BYTES = 4 * WIDTH, PARTS = SF_LANES / BYTES };
  vec acc[PARTS][2];
  int sample = -1;
#pragma GCC unroll 4
  for (int j = 0; j < PARTS; j++) acc[j][0] = acc[j][1] = v_set(0);
  for (int g = 0; g < e->groups; g++) {
    uint32_t row[GROUP];
    const vec go_on = v_set(read_group(e, g, row, &sample));
#pragma GCC unroll 4
    for (int j = 0; j < PARTS; j++) {
      vec a[2], b[2];
      add_bytes(v_load(w[row[0]] + j * BYTES), v_load(w[row[1]] + j * BYTES), a);
      add_bytes(v_load(w[row[2]] + j * BYTES), v_load(w[row[3]] + j * BYTES), b);
#pragma GCC unroll 2
      for (int half = 0; half < 2; half++) {
        acc[j][half] = V(add_epi16)(V_BITS(and)(acc[j][half], go_on), V(add_epi16)(a[half], b[half]));
        v_store(sum[sample] + j * BYTES + half * BYTES / 2, acc[j][half]);
      }
    }
  }
}

static void c2_currents_events(const fx_words *words, const uint64_t (*spikes)[2], int n, fx_scratch *s)
{
  events e;
  list_events(&e, spikes, n);
  add_rows(&e, words->c2, s->c2_current);
}

/* ---- the steps ---- */

/* Every neuron of a spiking layer (0..FX_SPIKING-1) for all samples. halves: currents of C2 in 16 bits, else in 32. */
static INLINE void fire_layer(const neurons *n, int spiking, bool halves, int shift, const void *current, fx_block *b,
                              fx_scratch *s, int t)
{
  static const int layer[FX_SPIKING] = {FX_D1, FX_C1, FX_C2};
  for (int i = 0; i < b->n; i++) {
    uint64_t bits[2] = {0};
    const int16_t *half = (const int16_t *)current + i * SF_LANES;
    const int32_t *whole = (const int32_t *)current + i * SF_LANES;
#pragma GCC unroll 16
    for (int j = 0; j < VECTORS; j++) {
      const vec in = halves ? v_widen(half + j * WIDTH) : v_load(whole + j * WIDTH);
      put_spikes(bits, j,
                 fire(n, &s->v[spiking][i][j * WIDTH], V(slli_epi32)(in, shift), &b->saturated[layer[spiking]][i]));
    }
    memcpy(b->spikes[spiking][t][i], bits, sizeof bits);
  }
}

static INLINE void density_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_D1, mode, first, t);
  events e;
  fire_layer(&n, 0, false, 0, s->d1_current, b, s, t);
  list_events(&e, (const uint64_t(*)[2])b->spikes[0][t], b->n);
  add_rows16(&e, core->words.d2, s->d2_current);
  for (int i = 0; i < b->n; i++) {
    __m256i *current = (__m256i *)s->d2_current[i];
    s->argument[0][i] = s->d2_current[i][0];
    _mm256_storeu_si256(current, _mm256_srai_epi16(_mm256_loadu_si256(current), SF_H_SHIFT));
  }
}

static INLINE void c1_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_C1, mode, first, t);
  c1_currents(&core->words, b, s);
  fire_layer(&n, 1, false, 0, s->current, b, s, t);
}

static INLINE int spikes_of_block(const fx_block *b, int layer, int t)
{
  int sum = 0;
  for (int i = 0; i < b->n; i++)
    sum += __builtin_popcountll(b->spikes[layer][t][i][0]) + __builtin_popcountll(b->spikes[layer][t][i][1]);
  return sum;
}

static INLINE void c2_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_C2, mode, first, t);
  const uint64_t(*spikes)[2] = (const uint64_t(*)[2])b->spikes[1][t];
  if (spikes_of_block(b, 1, t) * 100 > b->n * SF_LANES * C2_DENSE_PERCENT) {
    c2_currents_dense(&core->words, spikes, b->n, s);
    fire_layer(&n, 2, false, SF_AC_FRAC, s->current, b, s, t);
  } else {
    c2_currents_events(&core->words, spikes, b->n, s);
    fire_layer(&n, 2, true, SF_AC_FRAC, s->c2_current, b, s, t);
  }
}

static INLINE void c3_step(const fx_core *core, fx_block *b, fx_scratch *s, int t)
{
  events e;
  list_events(&e, (const uint64_t(*)[2])b->spikes[2][t], b->n);
  add_rows16(&e, core->words.c3, s->c3_current);
  for (int o = 0; o < COLOURS; o++)
    for (int i = 0; i < b->n; i++) s->argument[1 + o][i] = s->c3_current[i][o];
}

/* ---- activations and integrators: one sample to a lane ---- */

static const int32_t exp2_table[257] = {
#include "spikefield/tables/exp2.inc"
};
static const int32_t sigmoid_table[257] = {
#include "spikefield/tables/sigmoid.inc"
};

static INLINE vec argument(vec current, const fx_scale *scale, int bits)
{
  const vec y = v_shift_round(V(mullo_epi32)(current, v_set(scale->mul)), scale->shift);
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

static INLINE void integrate_step(const fx_net *net, fx_block *b, fx_scratch *s, int mode, bool first)
{
  for (int i = 0; i < b->n; i += WIDTH) {
    const vec e = exp2_of(argument(v_load(&s->argument[0][i]), &net->exp_in, FX_EXP2_BITS));
    const uint32_t below = v_differ(e, v_set((1 << SF_SIGMA_BITS) - 1));
    for (uint32_t rest = ~below & (((uint32_t)1 << WIDTH) - 1); rest; rest &= rest - 1)
      b->saturated[FX_D2][i + __builtin_ctz(rest)]++;
    integrate(&s->acc[0][i], e, net->layer[FX_D2].k, mode, first, SF_SIGMA_BITS, &b->saturated[FX_D2][i]);
    for (int o = 1; o <= COLOURS; o++)
      integrate(&s->acc[o][i], sigmoid_of(argument(v_load(&s->argument[o][i]), &net->sigmoid_in, FX_SIGMOID_BITS)),
                net->layer[FX_C3].k, mode, first, SF_COLOUR_BITS, &b->saturated[FX_C3][i]);
  }
}

static INLINE void step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  density_step(core, b, s, mode, first, t);
  c1_step(core, b, s, mode, first, t);
  c2_step(core, b, s, mode, first, t);
  c3_step(core, b, s, t);
  integrate_step(&core->scene->net, b, s, mode, first);
}

static INLINE void nets_of_mode(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_net *net = &core->scene->net;
  memset(b->saturated, 0, sizeof b->saturated);
  for (int i = b->n; i % GANG; i++) b->base[i] = b->base[0]; /* the last gang may have members that nobody reads */
  d1_currents(&core->words, b, s);
  step(core, b, s, mode, true, 0);
  for (int t = 1; t < net->steps; t++) step(core, b, s, mode, false, t);
  fx_block_count(b, net->steps);
  for (int i = 0; i < b->n; i++) b->out[i] = (fx_out){s->acc[0][i], {s->acc[1][i], s->acc[2][i], s->acc[3][i]}};
}

static void nets_hybrid(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  nets_of_mode(core, block, scratch, FX_HYBRID);
}
static void nets_decay(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  nets_of_mode(core, block, scratch, FX_DECAY);
}
static void nets_nodecay(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  nets_of_mode(core, block, scratch, FX_NODECAY);
}

static void nets(const fx_core *core, fx_block *block, fx_scratch *scratch)
{
  switch (core->scene->net.mode) {
  case FX_HYBRID:
    nets_hybrid(core, block, scratch);
    break;
  case FX_DECAY:
    nets_decay(core, block, scratch);
    break;
  default:
    nets_nodecay(core, block, scratch);
  }
}
