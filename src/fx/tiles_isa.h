/* Products on AMX tiles: 16 neurons for 16 samples at a time, the weights of all inputs in tiles 0 and 1, all samples
 * and steps of a block one tile after the other. Exact: spikes and 8-bit weights as bytes with 32-bit sums (TDPBUSD).
 * The inputs of D1 and C1 have 12 bits: x = high + low, a multiple of 16 and 0..15, each exact in bfloat16, as the
 * weight is; their products and the sums, below 2^24, are whole numbers in binary32 (TDPBF16PS), whatever their order.
 *
 * Per tile of 16 samples two loads and one store hide behind two products of 18 cycles; weights or biases loaded in
 * between, or rows that cross a cache line, do not hide. */
#ifndef SF_FX_TILES_ISA_H
#define SF_FX_TILES_ISA_H
#include "base/amx.h"
#include "src/fx/dense_isa.h"
#include "src/fx/integrate_isa.h"

enum { SIDE = 16, ROW = 64 /* bytes */ };
_Static_assert((int)FX_BLOCK == 3 * SIDE && (int)SF_OUT_MAX == SIDE && (int)WIDTH == SIDE, "a block is three tiles");
_Static_assert((int)SF_FEATURE_MAX == 2 * SIDE && SF_INPUT_BITS == 12, "D1 takes two tiles of inputs");
_Static_assert(2 * SIDE * (FX_INPUT_MAX + 1 + 15) * 127 < 1 << 24, "whole in binary32"); /* h: fx_scene_check */

static INLINE void tiles_begin(void)
{
  static const sf_tile_shapes shape = {
      .palette = 1, .bytes = {64, 64, 64, 64, 64, 64, 64, 64}, .rows = {16, 16, 16, 16, 16, 16, 16, 16}};
  _tile_loadconfig(&shape);
}

static INLINE void tiles_end(void)
{
  _tile_release();
}

/* One tile of samples: x of two tiles side by side, or of one (twice is false). */
#define PRODUCTS(acc, multiply)                                                                                        \
  if (more)                                                                                                            \
    _tile_loadd(acc, out, ROW);                                                                                        \
  else if (from)                                                                                                       \
    _tile_loadd(acc, from, 0);                                                                                         \
  else                                                                                                                 \
    _tile_zero(acc);                                                                                                   \
  _tile_loadd(2, x, ldx);                                                                                              \
  multiply(acc, 2, 0);                                                                                                 \
  if (twice) {                                                                                                         \
    _tile_loadd(3, x + ROW, ldx);                                                                                      \
    multiply(acc, 3, 1);                                                                                               \
  }                                                                                                                    \
  _tile_stored(acc, out, ROW);                                                                                         \
  x += SIDE * ldx, out += SIDE;

/* out[i][o] = sum of w . x[i] of 16 neurons, for `blocks` blocks of samples, more than from[o], or, for more, than
 * out[i][o] before; from: 16 sums, or NULL. */
#define GROUP_OF(name, multiply)                                                                                       \
  static INLINE void name(const void *w, int ldw, bool twice, const uint8_t *x, int ldx, const int32_t *from,          \
                          bool more, int blocks, int32_t(*out)[SIDE])                                                  \
  {                                                                                                                    \
    __asm__ volatile("" ::: "memory"); /* GCC's tile loads do not say that they read memory */                         \
    _tile_loadd(0, w, ldw);                                                                                            \
    if (twice) _tile_loadd(1, (const uint8_t *)w + SIDE * ldw, ldw);                                                   \
    for (int block = 0; block < blocks; block++) {                                                                     \
      PRODUCTS(4, multiply)                                                                                            \
      PRODUCTS(5, multiply)                                                                                            \
      PRODUCTS(6, multiply)                                                                                            \
    }                                                                                                                  \
    __asm__ volatile("" ::: "memory");                                                                                 \
  }
GROUP_OF(byte_products, _tile_dpbusd)
GROUP_OF(input_products, _tile_dpbf16ps)

/* Of all spikes; w: quads of 16 outputs, ldw bytes from one to the next. */
static INLINE void spike_products(const int8_t (*w)[4], int ldw, const uint8_t (*x)[SF_LANES], const int32_t *from,
                                  int steps, int32_t (*out)[SIDE])
{
  for (int k = 0; k < SF_LANES; k += 2 * ROW)
    byte_products((const int8_t *)w + k / 4 * ldw, ldw, true, x[0] + k, SF_LANES, from, k > 0, steps, out);
}

/* Bytes 0 or 1 of every neuron of a spiking layer, all steps. */
static INLINE void spike_rows(const fx_block *b, int spiking, int steps, uint8_t (*x)[SF_LANES])
{
  for (int t = 0; t < steps; t++)
    for (int i = 0; i < b->n; i++) spike_bytes(b->spikes[spiking][t][i], x[t * FX_BLOCK + i]);
}

/* Blocks of rows that a layer has: its steps, or of radix one. */
static INLINE int blocks_of(const fx_net *net, int mode)
{
  return mode == FX_RADIX ? 1 : net->steps;
}

/* What the layer behind gets: bytes 0 or 1 of every step, or of radix numbers. */
static INLINE void input_rows(const fx_net *net, const fx_block *b, int spiking, int mode, uint8_t (*x)[SF_LANES])
{
  if (mode != FX_RADIX)
    spike_rows(b, spiking, net->steps, x);
  else
    for (int i = 0; i < b->n; i++) number_bytes(b, spiking, net->steps, i, x[i]);
}

/* 16 biases as a block adds them, or NULL. */
static INLINE const int32_t *biases_of(const fx_net *net, int layer, int mode, const int32_t *bias, int32_t all[SIDE])
{
  if (!net->layer[layer].bias) return NULL;
  if (mode != FX_RADIX) return bias;
  all_digits(net->steps, bias, SIDE, all);
  return all;
}

/* 16 inputs as pairs of low, high. */
static INLINE void input_row(vec x, uint8_t *row)
{
  const vec low = V_BITS(and)(x, v_set(15)), high = V(sub_epi32)(x, low);
  const vec low32 = _mm512_castps_si512(_mm512_cvtepi32_ps(low)),
            high32 = _mm512_castps_si512(_mm512_cvtepi32_ps(high));
  v_store(row, V_BITS(or)(high32, V(srli_epi32)(low32, 16)));
}

/* The density is no h. */
static INLINE void h_row(vec current, int shift, uint8_t *row)
{
  input_row(_mm512_maskz_sra_epi32(0xfffe, current, _mm_cvtsi32_si128(shift)), row);
}

/* ---- the layers, all steps of a block ---- */

static INLINE void density_layers(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_words *words = &core->words;
  const fx_net *net = &core->scene->net;
  for (int i = 0; i < b->n; i++)
    for (int half = 0; half < 2; half++) input_row(v_widen(b->f[i] + SIDE * half), s->x[i] + ROW * half);
  for (int o = 0; o < SF_LANES; o += SIDE) {
    const currents c = {.kind = REALS, .from = s->sum, .sample = SIDE, .step = 0};
    input_products(words->d1_twice[o / SIDE], ROW, true, s->x[0], SF_LANES, NULL, false, 1, s->sum);
    fire_layer(net, 0, mode, &c, o, 1, 0, b->n, b);
  }
  const int blocks = blocks_of(net, mode), shift = mode == FX_RADIX ? 0 : SF_H_SHIFT;
  input_rows(net, b, 0, mode, s->x);
  spike_products(words->d2_quads[0], ROW, (const uint8_t(*)[SF_LANES])s->x, NULL, blocks, s->sum);
  for (int t = 0; t < blocks; t++)
    for (int i = 0; i < b->n; i++) {
      int32_t *const current = s->sum[t * FX_BLOCK + i];
      s->argument[t][0][i] = current[0];
      for (int o = 1; o < SF_OUT_MAX && mode == FX_RADIX; o++) current[o] = fx_weighed_h(current[o], net->steps);
      h_row(v_load(current), shift, s->x[t * FX_BLOCK + i]);
    }
}

static INLINE void c1_layer(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_words *words = &core->words;
  const fx_net *net = &core->scene->net;
  for (int o = 0; o < SF_LANES; o += SIDE) {
    const currents c = {.kind = REALS,
                        .from = s->sum,
                        .sample = SIDE,
                        .step = FX_BLOCK * SIDE, /* of radix step 0 is read alone */
                        .base = (const int32_t *const *)b->base};
    input_products(words->c1_h_twice[o / SIDE], ROW, false, s->x[0], SF_LANES, NULL, false, blocks_of(net, mode),
                   s->sum);
    fire_layer(net, 1, mode, &c, o, 1, 0, b->n, b);
  }
}

static INLINE void c2_layer(const fx_core *core, fx_block *b, fx_scratch *s, int mode)
{
  const fx_words *words = &core->words;
  const fx_net *net = &core->scene->net;
  input_rows(net, b, 1, mode, s->x);
  for (int o = 0; o < SF_LANES; o += SIDE) {
    const currents c = {
        .kind = WORDS, .from = s->sum, .sample = SIDE, .step = FX_BLOCK * SIDE, .shift = c2_shift(net, mode)};
    int32_t all[SIDE];
    spike_products(words->c2_tiles[o / SIDE][0], ROW, (const uint8_t(*)[SF_LANES])s->x,
                   biases_of(net, FX_C2, mode, words->c2_bias + o, all), blocks_of(net, mode), s->sum);
    fire_layer(net, 2, mode, &c, o, 1, 0, b->n, b);
  }
}

static INLINE void c3_layer(const fx_core *core, const fx_block *b, fx_scratch *s, int mode)
{
  const fx_words *words = &core->words;
  const fx_net *net = &core->scene->net;
  const int blocks = blocks_of(net, mode);
  int32_t all[SIDE];
  input_rows(net, b, 2, mode, s->x);
  spike_products(words->c3_quads[0], ROW, (const uint8_t(*)[SF_LANES])s->x,
                 biases_of(net, FX_C3, mode, words->c3_bias, all), blocks, s->sum);
  for (int t = 0; t < blocks; t++)
    for (int o = 0; o < COLOURS; o++)
      for (int i = 0; i < b->n; i++) s->argument[t][1 + o][i] = s->sum[t * FX_BLOCK + i][o];
}
#endif
