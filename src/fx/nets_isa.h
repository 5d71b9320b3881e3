/* Both nets for a block of samples, layer by layer and step by step; 16 or 8 neurons to a vector.
 *
 * The leak product in 32-bit lanes: with d = h * 2^13 + l, -2^12 <= l < 2^12,
 *   rshift_round(d * k, 12) = h * 2k + rshift_round(l * k, 12)
 * and rshift_round(l * k, 12) is what one rounding 16-bit multiplication gives of 8 l and k. So d << 3 split at bit 16
 * holds h and 8 l, and one 16-bit dot product adds h * 2k + l' * 1 to the membrane. |d| < 2^25: d << 3 fits. */
#include "src/fx/core.h"
#include "src/fx/unit.h"
#include "src/fx/vec_isa.h"

enum { VECTORS = SF_LANES / WIDTH, COLOURS = 3 };
enum { GROUP = 4, GROUPS = SF_LANES / GROUP + 1 }; /* rows added at once; the most of one sample */
enum { C2_DENSE_PERCENT = 42 }; /* firing rate of C1 at which rows for spikes cost as much as all rows */

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
  const vec shifted = V(slli_epi32)(d, 3), split = V(add_epi32)(shifted, v_set(0x8000));
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

/* acc[sample][vector] += pairs of rows times pairs of inputs, for two samples and the TILE vectors from w on. */
static INLINE void dot_tile(vec acc[2][TILE], const int16_t *w, const int16_t *x0, const int16_t *x1, int pairs)
{
  for (int p = 0; p < pairs; p++) {
    const vec a = v_word(x0 + 2 * p), b = v_word(x1 + 2 * p);
#pragma GCC unroll 8
    for (int i = 0; i < TILE; i++) {
      const vec row = v_load(w + 2 * (p * SF_LANES + i * WIDTH));
      acc[0][i] = v_dot(acc[0][i], a, row);
      acc[1][i] = v_dot(acc[1][i], b, row);
    }
  }
}

static void d1_currents(const fx_words *words, const fx_block *b, fx_scratch *s)
{
  for (int i = 0; i < b->n; i += 2)
    for (int first = 0; first < VECTORS; first += TILE) {
      vec acc[2][TILE];
      for (int j = 0; j < TILE; j++) acc[0][j] = acc[1][j] = v_set(0);
      dot_tile(acc, words->d1[0][first * WIDTH], b->f[i], b->f[i + 1], SF_FEATURE_MAX / 2);
      for (int j = 0; j < TILE; j++) {
        v_store(&s->d1_current[i][(first + j) * WIDTH], acc[0][j]);
        v_store(&s->d1_current[i + 1][(first + j) * WIDTH], acc[1][j]);
      }
    }
}

/* The spikes of one layer of a block at one step, sample after sample, in groups of GROUP rows: a loop over all groups
 * has no branch per sample. A sample's last group is filled up with SF_LANES, the row of zeros; a silent sample has one
 * such. */
typedef struct events {
  int groups;
  uint8_t row[FX_BLOCK * (SF_LANES + GROUP) + 64];
  uint8_t sample[FX_BLOCK * GROUPS + 64],
      go_on[FX_BLOCK * GROUPS + 64]; /* go_on: 255 = the sample of the group before */
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
    for (int at = 0; at < GROUPS; at += 4 * WIDTH) { /* what is written too far, the next sample overwrites */
      v_store(e->sample + e->groups + at, V(set1_epi8)((char)i));
      v_store(e->go_on + e->groups + at, V(set1_epi8)(-1));
    }
    e->go_on[e->groups] = 0;
    e->groups += count ? (count + GROUP - 1) / GROUP : 1;
  }
}

/* sum[sample] = sum of its rows of 16. */
static INLINE void add_rows16(const events *e, const int16_t (*w)[SF_OUT_MAX], int16_t (*sum)[SF_OUT_MAX])
{
  __m256i acc = _mm256_setzero_si256();
  for (int g = 0; g < e->groups; g++) {
    const uint8_t *row = e->row + g * GROUP;
    const __m256i a =
        _mm256_add_epi16(_mm256_load_si256((const __m256i *)w[row[0]]), _mm256_load_si256((const __m256i *)w[row[1]]));
    const __m256i b =
        _mm256_add_epi16(_mm256_load_si256((const __m256i *)w[row[2]]), _mm256_load_si256((const __m256i *)w[row[3]]));
    acc = _mm256_add_epi16(_mm256_and_si256(acc, _mm256_set1_epi8((char)e->go_on[g])), _mm256_add_epi16(a, b));
    _mm256_storeu_si256((__m256i *)sum[e->sample[g]], acc);
  }
}

/* sum[sample] = sum of its rows of SF_LANES; exact in 16 bits. */
static INLINE void add_rows(const events *e, const int16_t (*w)[SF_LANES], int16_t (*sum)[SF_LANES])
{
  enum { HALVES = SF_LANES / (2 * WIDTH) };
  vec acc[HALVES];
#pragma GCC unroll 8
  for (int j = 0; j < HALVES; j++) acc[j] = v_set(0);
  for (int g = 0; g < e->groups; g++) {
    const uint8_t *row = e->row + g * GROUP;
    const vec go_on = V(set1_epi8)((char)e->go_on[g]);
    int16_t *to = sum[e->sample[g]];
#pragma GCC unroll 8
    for (int j = 0; j < HALVES; j++) {
      const int at = j * 2 * WIDTH;
      const vec a = V(add_epi16)(v_load(w[row[0]] + at), v_load(w[row[1]] + at)),
                b = V(add_epi16)(v_load(w[row[2]] + at), v_load(w[row[3]] + at));
      acc[j] = V(add_epi16)(V_BITS(and)(acc[j], go_on), V(add_epi16)(a, b));
      v_store(to + at, acc[j]);
    }
  }
}

static INLINE void density_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_D1, mode, first, t);
  events e;
  for (int i = 0; i < b->n; i++) {
    uint64_t bits[2] = {0};
#pragma GCC unroll 16
    for (int j = 0; j < VECTORS; j++)
      put_spikes(bits, j,
                 fire(&n, &s->v[0][i][j * WIDTH], v_load(&s->d1_current[i][j * WIDTH]), &b->saturated[FX_D1][i]));
    memcpy(b->spikes[0][t][i], bits, sizeof bits);
  }
  list_events(&e, (const uint64_t(*)[2])b->spikes[0][t], b->n);
  add_rows16(&e, core->words.d2, s->d2_current);
  for (int i = 0; i < b->n; i++) {
    __m256i *current = (__m256i *)s->d2_current[i];
    s->argument[0][i] = s->d2_current[i][0];
    _mm256_storeu_si256(current, _mm256_srai_epi16(_mm256_loadu_si256(current), SF_H_SHIFT));
  }
}

static INLINE void c1_step(const fx_core *core, fx_block *b, fx_scratch *s, int mode, bool first_step, int t)
{
  const neurons n = neurons_of(&core->scene->net, FX_C1, mode, first_step, t);
  for (int i = 0; i < b->n; i += 2) {
    uint64_t bits[2][2] = {{0}};
    for (int first = 0; first < VECTORS; first += TILE) {
      vec acc[2][TILE];
      for (int j = 0; j < TILE; j++) {
        acc[0][j] = v_load(b->base[i] + (first + j) * WIDTH);
        acc[1][j] = v_load(b->base[i + 1] + (first + j) * WIDTH);
      }
      dot_tile(acc, core->words.c1_h[0][first * WIDTH], s->d2_current[i], s->d2_current[i + 1], SF_OUT_MAX / 2);
#pragma GCC unroll 2
      for (int k = 0; k < 2; k++)
#pragma GCC unroll 8
        for (int j = 0; j < TILE; j++)
          put_spikes(bits[k], first + j,
                     fire(&n, &s->v[1][i + k][(first + j) * WIDTH], acc[k][j], &b->saturated[FX_C1][i + k]));
    }
    memcpy(b->spikes[1][t][i], bits, sizeof bits);
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

static INLINE void fire_c2(const neurons *n, fx_block *b, fx_scratch *s, int i, int vector, uint64_t bits[2],
                           vec current)
{
  put_spikes(bits, vector,
             fire(n, &s->v[2][i][vector * WIDTH], V(slli_epi32)(current, SF_AC_FRAC), &b->saturated[FX_C2][i]));
}

static INLINE void c2_step_events(const fx_core *core, fx_block *b, fx_scratch *s, const neurons *n, int t)
{
  events e;
  list_events(&e, (const uint64_t(*)[2])b->spikes[1][t], b->n);
  add_rows(&e, core->words.c2, s->c2_current);
  for (int i = 0; i < b->n; i++) {
    uint64_t bits[2] = {0};
#pragma GCC unroll 16
    for (int j = 0; j < VECTORS; j++) fire_c2(n, b, s, i, j, bits, v_widen(&s->c2_current[i][j * WIDTH]));
    memcpy(b->spikes[2][t][i], bits, sizeof bits);
  }
}

static INLINE void c2_step_dense(const fx_core *core, fx_block *b, fx_scratch *s, const neurons *n, int t)
{
  for (int i = 0; i < b->n; i += 2) {
    uint64_t bits[2][2] = {{0}};
    uint8_t x[2][SF_LANES];
    for (int k = 0; k < 2; k++) spike_bytes(b->spikes[1][t][i + k], x[k]);
    for (int first = 0; first < VECTORS; first += TILE) {
      vec acc[2][TILE];
#pragma GCC unroll 8
      for (int j = 0; j < TILE; j++) acc[0][j] = acc[1][j] = v_set(0);
      for (int q = 0; q < SF_LANES / 4; q++) {
        const vec a = v_word(x[0] + 4 * q), c = v_word(x[1] + 4 * q);
#pragma GCC unroll 8
        for (int j = 0; j < TILE; j++) {
          const vec rows = v_load(core->words.c2_quads[q][(first + j) * WIDTH]);
          acc[0][j] = v_dot4(acc[0][j], a, rows);
          acc[1][j] = v_dot4(acc[1][j], c, rows);
        }
      }
#pragma GCC unroll 2
      for (int k = 0; k < 2; k++)
#pragma GCC unroll 8
        for (int j = 0; j < TILE; j++) fire_c2(n, b, s, i + k, first + j, bits[k], acc[k][j]);
    }
    memcpy(b->spikes[2][t][i], bits, sizeof bits);
  }
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
  const bool dense = spikes_of_block(b, 1, t) * 100 > b->n * SF_LANES * C2_DENSE_PERCENT;
  if (dense)
    c2_step_dense(core, b, s, &n, t);
  else
    c2_step_events(core, b, s, &n, t);
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
  const vec fraction = V_BITS(and)(y, v_set((1 << SF_LOG_FRAC) - 1));
  const vec t = interpolate(exp2_table, V(srli_epi32)(fraction, 4), V_BITS(and)(fraction, v_set(15)), 4);
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
  if (b->n % 2) b->base[b->n] = b->base[b->n - 1]; /* pairs of samples: the last may have a partner that is not read */
  d1_currents(&core->words, b, s);
  step(core, b, s, mode, true, 0);
  for (int t = 1; t < net->steps; t++) step(core, b, s, mode, false, t);
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
