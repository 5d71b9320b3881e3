/* Products with spikes: a row of weights for every neuron that fired, or all rows where many did. */
#ifndef SF_FX_EVENT_ISA_H
#define SF_FX_EVENT_ISA_H
#include "src/fx/dense_isa.h"
#include "src/fx/integrate_isa.h"
#include <stdbool.h>

enum { GROUP = 4, GROUPS = SF_LANES / GROUP + 1 }; /* rows added at once; the most of one sample, biases included */

/* The smallest type that counts all rows. */
typedef __typeof__(__builtin_choose_expr(FX_BIAS_ROW <= UINT8_MAX, (uint8_t)0, (uint16_t)0)) row_index;
enum { ROW_BITS = 8 * sizeof(row_index) };

/* The spikes of one layer of a block at one step, sample after sample, in groups of GROUP rows: a loop over all groups
 * has no branch per sample. A sample's last group is filled up with the row of zeros; a silent sample has one such. The
 * biases are one more row of every sample. */
typedef struct events {
  int groups;
  row_index row[FX_BLOCK * (SF_LANES + GROUP) + 64];
  uint8_t sample[FX_BLOCK * GROUPS + 64];
} events;

#if !defined(__AVX512VBMI2__)
/* ones[b][k]: position of one k of byte b. Its place is the number of prefixes of b with at most k ones. */
#define PREFIX(b, n, k) (__builtin_popcount((b) & ((2 << (n)) - 1)) <= (k))
#define ONE(b, k)                                                                                                      \
  PREFIX(b, 0, k) + PREFIX(b, 1, k) + PREFIX(b, 2, k) + PREFIX(b, 3, k) + PREFIX(b, 4, k) + PREFIX(b, 5, k) +          \
      PREFIX(b, 6, k) + PREFIX(b, 7, k)
#define ONES(b)                                                                                                        \
  {                                                                                                                    \
    ONE(b, 0), ONE(b, 1), ONE(b, 2), ONE(b, 3), ONE(b, 4), ONE(b, 5), ONE(b, 6), ONE(b, 7)                             \
  }
#define ONES4(b) ONES(b), ONES((b) + 1), ONES((b) + 2), ONES((b) + 3)
#define ONES16(b) ONES4(b), ONES4((b) + 4), ONES4((b) + 8), ONES4((b) + 12)
#define ONES64(b) ONES16(b), ONES16((b) + 16), ONES16((b) + 32), ONES16((b) + 48)
static const uint8_t ones[256][8] = {ONES64(0), ONES64(64), ONES64(128), ONES64(192)};
#endif

static INLINE void list_spikes(row_index *row, const uint64_t bits[SF_SPIKE_WORDS])
{
#if defined(__AVX512VBMI2__)
  const vec iota = _mm512_set_epi64(0x3f3e3d3c3b3a3938, 0x3736353433323130, 0x2f2e2d2c2b2a2928, 0x2726252423222120,
                                    0x1f1e1d1c1b1a1918, 0x1716151413121110, 0x0f0e0d0c0b0a0908, 0x0706050403020100);
  for (int word = 0; word < SF_SPIKE_WORDS; word++) {
    const vec index = _mm512_or_si512(iota, _mm512_set1_epi8((char)(64 * word)));
    const vec fired = _mm512_maskz_compress_epi8(bits[word], index);
    if (ROW_BITS == 8) {
      v_store(row, fired);
    } else {
      v_store(row, _mm512_cvtepu8_epi16(_mm512_castsi512_si256(fired)));
      v_store(row + 32, _mm512_cvtepu8_epi16(_mm512_extracti64x4_epi64(fired, 1)));
    }
    row += __builtin_popcountll(bits[word]);
  }
#else
  for (int byte = 0; byte < 8 * SF_SPIKE_WORDS; byte++) {
    const uint8_t fired = ((const uint8_t *)bits)[byte]; /* little-endian */
    const __m128i index = _mm_add_epi8(_mm_loadl_epi64((const __m128i *)ones[fired]), _mm_set1_epi8((char)(8 * byte)));
    if (ROW_BITS == 8)
      _mm_storel_epi64((__m128i *)row, index);
    else
      _mm_storeu_si128((__m128i *)row, _mm_cvtepu8_epi16(index));
    row += __builtin_popcount(fired);
  }
#endif
}

static INLINE int count_spikes(const uint64_t bits[SF_SPIKE_WORDS])
{
  int spikes = 0;
  for (int word = 0; word < SF_SPIKE_WORDS; word++) spikes += __builtin_popcountll(bits[word]);
  return spikes;
}

static INLINE void list_events(events *e, const uint64_t (*spikes)[SF_SPIKE_WORDS], bool bias, int n)
{
  e->groups = 0;
  for (int i = 0; i < n; i++) {
    const int fired = count_spikes(spikes[i]), count = fired + bias;
    row_index *row = e->row + e->groups * GROUP;
    list_spikes(row, spikes[i]);
    row[fired] = FX_BIAS_ROW;
    for (int pad = 0; pad < GROUP; pad++) row[count + pad] = FX_ZERO_ROW;
    for (int at = 0; at < GROUPS; at += 4 * WIDTH) /* what is written too far, the next sample overwrites */
      v_store(e->sample + e->groups + at, V(set1_epi8)((char)i));
    e->groups += count ? (count + GROUP - 1) / GROUP : 1;
  }
}

/* Group g: its rows, read with one load, and its sample. Returns -1 when it goes on with the sample of the group
 * before, or 0 when it starts a new one. */
static INLINE int32_t read_group(const events *e, int g, uint32_t row[GROUP], int *sample)
{
  uint64_t rows = 0;
  const int before = *sample;
  memcpy(&rows, e->row + g * GROUP, GROUP * sizeof(row_index));
  for (int i = 0; i < GROUP; i++) row[i] = (row_index)(rows >> ROW_BITS * i);
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

typedef const uint64_t (*bitmaps)[SF_SPIKE_WORDS];

static INLINE void d2_currents(const int16_t (*rows)[SF_OUT_MAX], bitmaps spikes, int n, int16_t (*sum)[SF_OUT_MAX])
{
  events e;
  list_events(&e, spikes, false, n);
  add_rows16(&e, rows, sum);
}

/* a + b of 8-bit lanes as 16-bit lanes: low and high halves of each 128 bits; fx_words.c2 is ordered so that they are
 * neighbouring outputs. */
static INLINE void add_bytes(vec a, vec b, vec sum[2])
{
  const vec one = V(set1_epi8)(1);
  sum[0] = V(maddubs_epi16)(one, V(unpacklo_epi8)(a, b));
  sum[1] = V(maddubs_epi16)(one, V(unpackhi_epi8)(a, b));
}

/* sum[sample] = sum of its rows of SF_LANES, of the vectors of bytes from `first` on; exact in 16 bits. */
enum { PARTS = SF_LANES / BYTES < 4 ? SF_LANES / BYTES : 4 /* that registers hold */ };
static INLINE void add_parts(const events *e, const int8_t (*w)[SF_LANES], int16_t (*sum)[SF_LANES], int first)
{
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
      const int at = (first + j) * BYTES;
      add_bytes(v_load(w[row[0]] + at), v_load(w[row[1]] + at), a);
      add_bytes(v_load(w[row[2]] + at), v_load(w[row[3]] + at), b);
#pragma GCC unroll 2
      for (int half = 0; half < 2; half++) {
        acc[j][half] = V(add_epi16)(V_BITS(and)(acc[j][half], go_on), V(add_epi16)(a[half], b[half]));
        v_store(sum[sample] + at + half * BYTES / 2, acc[j][half]);
      }
    }
  }
}

static void c2_currents_events(const fx_words *words, bitmaps spikes, bool bias, int n, int16_t (*sum)[SF_LANES])
{
  events e;
  list_events(&e, spikes, bias, n);
  for (int first = 0; first < SF_LANES / BYTES; first += PARTS) add_parts(&e, words->c2, sum, first);
}

/* acc[k][o] = from[o] + sum of w[q][o] . x[k][q], quads of weights and of bytes; whole: of 8 bits, else of fewer. */
static INLINE void quad_sums(const int8_t *w, const uint8_t (*x)[SF_LANES], const int32_t *from, bool whole,
                             vec acc[GANG][TILE])
{
  EACH(k, j) acc[k][j] = v_load(from + j * WIDTH);
  for (int q = 0; q < SF_LANES / 4; q++) {
    vec in[GANG];
#pragma GCC unroll 3
    for (int k = 0; k < GANG; k++) in[k] = v_word(x[k] + 4 * q);
#pragma GCC unroll 8
    for (int j = 0; j < TILE; j++) {
      const vec row = v_load(w + 4 * (q * SF_LANES + j * WIDTH));
#pragma GCC unroll 3
      for (int k = 0; k < GANG; k++)
        acc[k][j] = whole ? v_dot4_whole(acc[k][j], in[k], row) : v_dot4(acc[k][j], in[k], row);
    }
  }
}

static __attribute__((noinline)) void quad_products(const int8_t *w, const uint8_t (*x)[SF_LANES], const int32_t *from,
                                                    int16_t *out)
{
  vec acc[GANG][TILE];
  quad_sums(w, x, from, false, acc);
  EACH(k, j) v_store_narrow(out + k * SF_LANES + j * WIDTH, acc[k][j]);
}

/* Of numbers. */
static __attribute__((noinline)) void number_products(const int8_t *w, const uint8_t (*x)[SF_LANES],
                                                      const int32_t *from, int bits, int32_t *out)
{
  vec acc[GANG][TILE];
  if (bits > DOT4_BITS)
    quad_sums(w, x, from, true, acc);
  else
    quad_sums(w, x, from, false, acc);
  EACH(k, j) v_store(out + k * SF_LANES + j * WIDTH, acc[k][j]);
}

/* The same for the SF_OUT_MAX outputs of D2 or C3. */
static INLINE void output_sums(const int8_t (*w)[SF_OUT_MAX][4], const uint8_t (*x)[SF_LANES], const int32_t *from,
                               bool whole, int32_t (*out)[SF_OUT_MAX])
{
  enum { PARTS16 = SF_OUT_MAX / WIDTH };
  vec acc[GANG][PARTS16];
  for (int k = 0; k < GANG; k++)
    for (int j = 0; j < PARTS16; j++) acc[k][j] = v_load(from + j * WIDTH);
  for (int q = 0; q < SF_LANES / 4; q++)
#pragma GCC unroll 3
    for (int k = 0; k < GANG; k++) {
      const vec in = v_word(x[k] + 4 * q);
#pragma GCC unroll 2
      for (int j = 0; j < PARTS16; j++) {
        const vec row = v_load(w[q][j * WIDTH]);
        acc[k][j] = whole ? v_dot4_whole(acc[k][j], in, row) : v_dot4(acc[k][j], in, row);
      }
    }
  for (int k = 0; k < GANG; k++)
    for (int j = 0; j < PARTS16; j++) v_store(out[k] + j * WIDTH, acc[k][j]);
}

static __attribute__((noinline)) void output_products(const int8_t (*w)[SF_OUT_MAX][4], const uint8_t (*x)[SF_LANES],
                                                      const int32_t *from, int bits, int32_t (*out)[SF_OUT_MAX])
{
  if (bits > DOT4_BITS)
    output_sums(w, x, from, true, out);
  else
    output_sums(w, x, from, false, out);
}

static INLINE void number_gang(const fx_block *b, int spiking, int steps, int gang, uint8_t (*x)[SF_LANES])
{
  for (int k = 0; k < GANG; k++) number_bytes(b, spiking, steps, gang + k, x[k]);
}

static void c2_currents_dense(const fx_words *words, bitmaps spikes, int n, int16_t (*sum)[SF_LANES])
{
  for (int i = 0; i < n; i += GANG) {
    uint8_t x[GANG][SF_LANES];
    for (int k = 0; k < GANG; k++) spike_bytes(spikes[i + k], x[k]);
    for (int first = 0; first < VECTORS; first += TILE)
      quad_products(words->c2_quads[0][first * WIDTH], (const uint8_t(*)[SF_LANES])x, words->c2_bias + first * WIDTH,
                    &sum[i][first * WIDTH]);
  }
}

static INLINE int spikes_of_block(bitmaps spikes, int n)
{
  int sum = 0;
  for (int i = 0; i < n; i++) sum += count_spikes(spikes[i]);
  return sum;
}

enum { C2_DENSE_PERCENT = 40 }; /* firing rate of C1 at which rows for spikes cost as much as all rows */

static INLINE void c2_currents(const fx_words *words, bitmaps spikes, bool bias, int n, int16_t (*sum)[SF_LANES])
{
  if (spikes_of_block(spikes, n) * 100 <= n * SF_LANES * C2_DENSE_PERCENT)
    c2_currents_events(words, spikes, bias, n, sum);
  else
    c2_currents_dense(words, spikes, n, sum);
}

/* ---- the layers, all steps of a block ---- */

/* D2 of radix, one gang: h in the place of the currents of step 0. */
static INLINE void d2_numbers(const fx_words *words, const fx_block *b, fx_scratch *s, int steps, int gang)
{
  static const int32_t none[SF_OUT_MAX];
  uint8_t x[GANG][SF_LANES];
  int32_t sum[GANG][SF_OUT_MAX];
  number_gang(b, 0, steps, gang, x);
  output_products(words->d2_quads, (const uint8_t(*)[SF_LANES])x, none, steps, sum);
  for (int k = 0; k < GANG; k++) {
    s->argument[0][0][gang + k] = sum[k][0];
    for (int o = 1; o < SF_OUT_MAX; o++) sum[k][o] = fx_weighed_h(sum[k][o], steps);
    for (int o = 0; o < SF_OUT_MAX; o += WIDTH) v_store_narrow(&s->d2_current[0][gang + k][o], v_load(&sum[k][o]));
  }
}

static INLINE void density_layers(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_words *words = &core->words;
  const fx_net *net = &core->scene->net;
  for (int i = 0; i < b->n; i += GANG) {
    int32_t current[GANG][SF_LANES];
    for (int at = 0; at < SF_LANES; at += TILE * WIDTH)
      pair_products(words->d1[0][at], SF_FEATURE_MAX / 2, (const int16_t *const[]){b->f[i], b->f[i + 1], b->f[i + 2]},
                    NULL, &current[0][at]);
    fire_gang(net, 0, mode, current[0], 0, 0, i, b);
    if (mode == FX_RADIX) d2_numbers(words, b, s, net->steps, i);
  }
  for (int t = 0; t < net->steps && mode != FX_RADIX; t++) {
    d2_currents(words->d2, (bitmaps)b->spikes[0][t], b->n, s->d2_current[t]);
    for (int i = 0; i < b->n; i++) {
      __m256i *current = (__m256i *)s->d2_current[t][i];
      s->argument[t][0][i] = s->d2_current[t][i][0];
      _mm256_storeu_si256(current, _mm256_srai_epi16(_mm256_loadu_si256(current), SF_H_SHIFT));
    }
  }
}

static INLINE void c1_layer(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_net *net = &core->scene->net;
  const int times = mode == FX_RADIX ? 1 : net->steps;
  for (int i = b->n; i % GANG; i++) b->base[i] = b->base[0]; /* the last gang may have members that nobody reads */
  for (int i = 0; i < b->n; i += GANG) {
    int32_t current[SF_T_MAX][GANG][SF_LANES];
    for (int at = 0; at < SF_LANES; at += TILE * WIDTH)
      for (int t = 0; t < times; t++) {
        const int16_t(*h)[SF_OUT_MAX] = (const int16_t(*)[SF_OUT_MAX])s->d2_current[t];
        pair_products(core->words.c1_h[0][at], SF_OUT_MAX / 2, (const int16_t *const[]){h[i], h[i + 1], h[i + 2]},
                      (const int32_t *const[]){b->base[i] + at, b->base[i + 1] + at, b->base[i + 2] + at},
                      &current[t][0][at]);
      }
    fire_gang(net, 1, mode, current[0][0], GANG * SF_LANES, 0, i, b);
  }
}

static INLINE void c2_numbers(const fx_words *words, const fx_net *net, fx_block *b)
{
  const int steps = net->steps;
  int32_t bias[SF_LANES], current[GANG][SF_LANES];
  all_digits(steps, words->c2_bias, SF_LANES, bias);
  for (int i = 0; i < b->n; i += GANG) {
    uint8_t x[GANG][SF_LANES];
    number_gang(b, 1, steps, i, x);
    for (int at = 0; at < SF_LANES; at += TILE * WIDTH)
      number_products(words->c2_quads[0][at], (const uint8_t(*)[SF_LANES])x, bias + at, steps, &current[0][at]);
    fire_gang(net, 2, FX_RADIX, current[0], 0, c2_shift(net, FX_RADIX), i, b);
  }
}

enum { C2_NUMBERS_PERCENT = 25 }; /* of the spikes of all steps; each step has a list of its own */

/* Radix: whether rows for the spikes of all steps cost as much as all rows once, for numbers. */
static INLINE bool many_spikes(const fx_block *b, int steps)
{
  const int percent = steps > DOT4_BITS ? 2 * C2_NUMBERS_PERCENT : C2_NUMBERS_PERCENT;
  int sum = 0;
  for (int t = 0; t < steps; t++) sum += spikes_of_block((bitmaps)b->spikes[1][t], b->n);
  return sum * 100 > b->n * SF_LANES * percent;
}

static INLINE void c2_layer(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_net *net = &core->scene->net;
  if (mode == FX_RADIX && many_spikes(b, net->steps)) {
    c2_numbers(&core->words, net, b);
    return;
  }
  for (int t = 0; t < net->steps; t++)
    c2_currents(&core->words, (bitmaps)b->spikes[1][t], net->layer[FX_C2].bias != 0, b->n, s->c2_current[t]);
  for (int at = 0; at < SF_LANES; at += TILE * WIDTH) {
    const currents c = {.kind = HALVES,
                        .from = &s->c2_current[0][0][at],
                        .sample = SF_LANES,
                        .step = FX_BLOCK * SF_LANES,
                        .weighed = mode == FX_RADIX ? net->steps : 0,
                        .shift = c2_shift(net, mode)};
    fire_layer(net, 2, mode, &c, at, TILE, 0, b->n, b);
  }
}

/* Three outputs are too few for a row of weights per spike: their weights stand input by input, beside the spikes as
 * bytes, and 16-bit sums hold all of them. Outputs twice over, halves that remain to be added. */
static INLINE __m256i c3_sums(const int8_t (*w)[SF_LANES], const uint8_t x[SF_LANES])
{
  __m256i sum[COLOURS];
#pragma GCC unroll 3
  for (int o = 0; o < COLOURS; o++) {
    sum[o] = _mm256_setzero_si256();
#pragma GCC unroll 4
    for (int at = 0; at < SF_LANES; at += 32)
      sum[o] = _mm256_add_epi16(sum[o], _mm256_maddubs_epi16(_mm256_load_si256((const __m256i *)(x + at)),
                                                             _mm256_load_si256((const __m256i *)(w[o] + at))));
    sum[o] = _mm256_madd_epi16(sum[o], _mm256_set1_epi16(1));
  }
  return _mm256_hadd_epi32(_mm256_hadd_epi32(sum[0], sum[1]), _mm256_hadd_epi32(sum[2], sum[2]));
}

static INLINE void c3_numbers(const fx_words *words, const fx_block *b, int steps, fx_scratch *s)
{
  int32_t bias[SF_OUT_MAX], sum[GANG][SF_OUT_MAX];
  all_digits(steps, words->c3_bias, SF_OUT_MAX, bias);
  for (int i = 0; i < b->n; i += GANG) {
    uint8_t x[GANG][SF_LANES];
    number_gang(b, 2, steps, i, x);
    output_products(words->c3_quads, (const uint8_t(*)[SF_LANES])x, bias, steps, sum);
    for (int k = 0; k < GANG; k++)
      for (int o = 0; o < COLOURS; o++) s->argument[0][1 + o][i + k] = sum[k][o];
  }
}

static INLINE void c3_layer(const fx_core *core, const fx_block *b, fx_scratch *s, int mode)
{
  const fx_words *words = &core->words;
  if (mode == FX_RADIX) {
    c3_numbers(words, b, core->scene->net.steps, s);
    return;
  }
  for (int t = 0; t < core->scene->net.steps; t++)
    for (int i = 0; i < b->n; i++) {
      _Alignas(64) uint8_t x[SF_LANES];
      int32_t half[2][4];
      spike_bytes(b->spikes[2][t][i], x);
      _mm256_storeu_si256((__m256i *)half, c3_sums(words->c3_inputs, x));
      for (int o = 0; o < COLOURS; o++) s->argument[t][1 + o][i] = half[0][o] + half[1][o] + words->c3_bias[o];
    }
}

static INLINE void tiles_begin(void) {}

static INLINE void tiles_end(void) {}
#endif
