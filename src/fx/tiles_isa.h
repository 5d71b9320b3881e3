/* Products of spikes on AMX tiles of bytes (TDPBUSD: products and sums are exact): 16 samples, 64 neurons and 16
 * outputs at a time. Quads of weights (fx_words) lie as tiles want them. Faster than rows for spikes from a firing
 * rate of 10 % on, and no slower at higher ones. Every row is one cache line: two would cost two loads. */
#ifndef SPIKEFIELD_FX_TILES_ISA_H
#define SPIKEFIELD_FX_TILES_ISA_H
#include "base/amx.h"
#include "src/fx/core.h"
#include "src/fx/dense_isa.h"
#include <stdbool.h>

enum { SIDE = 16, TILE_BYTES = 64 };
_Static_assert((int)FX_BLOCK == 3 * SIDE && (int)SF_OUT_MAX == SIDE, "a block is three tiles");

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

/* Bytes 0 or 1 of every neuron. */
static INLINE void spike_rows(const uint64_t (*spikes)[SF_SPIKE_WORDS], int n, uint8_t (*x)[SF_LANES])
{
  for (int i = 0; i < n; i++) spike_bytes(spikes[i], x[i]);
}

/* out[i][o] = from[o] + sum of w[q][o] . x[i][q], quads, for the samples of a block and 16 outputs; ldw: quads from one
 * row to the next, ldo: outputs. */
static INLINE void tile_products(const int8_t (*w)[4], int ldw, const uint8_t (*x)[SF_LANES], const int32_t *from,
                                 int32_t *out, int ldo)
{
  __asm__ volatile("" ::: "memory"); /* GCC's tile loads do not say that they read memory */
  _tile_loadd(0, from, 0);
  _tile_loadd(1, from, 0);
  _tile_loadd(2, from, 0);
  for (int k = 0; k < SF_LANES; k += TILE_BYTES) {
    _tile_loadd(3, w + k / 4 * ldw, 4 * ldw);
    _tile_loadd(4, x[0] + k, SF_LANES);
    _tile_loadd(5, x[SIDE] + k, SF_LANES);
    _tile_loadd(6, x[2 * SIDE] + k, SF_LANES);
    _tile_dpbusd(0, 4, 3);
    _tile_dpbusd(1, 5, 3);
    _tile_dpbusd(2, 6, 3);
  }
  _tile_stored(0, out, 4 * ldo);
  _tile_stored(1, out + SIDE * ldo, 4 * ldo);
  _tile_stored(2, out + 2 * SIDE * ldo, 4 * ldo);
}

/* Currents of D2 or C3; rows: for the biases alone. */
static INLINE void small_currents(const int16_t (*rows)[SF_OUT_MAX], const int8_t (*quads)[SF_OUT_MAX][4],
                                  const uint64_t (*spikes)[SF_SPIKE_WORDS], bool bias, int n,
                                  int16_t (*sum)[SF_OUT_MAX])
{
  _Alignas(64) uint8_t x[FX_BLOCK][SF_LANES];
  _Alignas(64) int32_t from[SF_OUT_MAX], out[FX_BLOCK][SF_OUT_MAX];
  for (int o = 0; o < SF_OUT_MAX; o++) from[o] = bias ? rows[FX_BIAS_ROW][o] : 0;
  spike_rows(spikes, n, x);
  tile_products(quads[0], SF_OUT_MAX, (const uint8_t(*)[SF_LANES])x, from, out[0], SF_OUT_MAX);
  for (int i = 0; i < n; i++) _mm256_storeu_si256((__m256i *)sum[i], _mm512_cvtepi32_epi16(v_load(out[i])));
}

/* Currents of C2, in s->current: false. Biases are always added: they are zero where there are none. */
static INLINE bool c2_currents(const fx_words *words, const uint64_t (*spikes)[SF_SPIKE_WORDS], bool bias, int n,
                               fx_scratch *s)
{
  _Alignas(64) uint8_t x[FX_BLOCK][SF_LANES];
  (void)bias;
  spike_rows(spikes, n, x);
  for (int o = 0; o < SF_LANES; o += SIDE)
    tile_products(&words->c2_quads[0][o], SF_LANES, (const uint8_t(*)[SF_LANES])x, words->c2_bias + o,
                  &s->current[0][o], SF_LANES);
  return false;
}
#endif
