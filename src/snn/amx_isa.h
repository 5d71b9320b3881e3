/* The matrix kernel on AMX tiles (TDPBF16PS: products and sums in fp32, denormals are zero). Operand words are laid out
 * as the tiles want them: 16 words of a row of a, 16 rows of words of b.
 * Included by gemm_isa.h only, in builds for AMX.
 *
 * Tiles are state of a thread: a kernel begins with tiles_begin and ends with tiles_end. Tiles 0..3 add up 16 x 16 of c
 * each; 4 and 5 are 16 words of a and b, 6 and 7 the same of 8 words, for what is left of k. */
#ifndef SF_SNN_AMX_ISA_H
#define SF_SNN_AMX_ISA_H
#include "base/amx.h"

enum { TILE_SIDE = 16, TILE_HALF = 8, LAYER_ROWS = TILE_SIDE };

static inline int layer_rows(int left)
{
  return left < LAYER_ROWS ? left : LAYER_ROWS;
}

static inline void tiles_begin(void)
{
  static const sf_tile_shapes shape = {
      .palette = 1, .bytes = {64, 64, 64, 64, 64, 64, 32, 64}, .rows = {16, 16, 16, 16, 16, 16, 16, 8}};
  _tile_loadconfig(&shape);
}

static inline void tiles_end(void)
{
  _tile_release();
}

/* Tiles are named by constants. */
#define EACH_TILE(V, what)                                                                                             \
  do {                                                                                                                 \
    what(0);                                                                                                           \
    if (V > 1) {                                                                                                       \
      what(1);                                                                                                         \
    }                                                                                                                  \
    if (V > 2) {                                                                                                       \
      what(2);                                                                                                         \
      what(3);                                                                                                         \
    }                                                                                                                  \
  } while (0)

/* 16 V columns of all rows of c, V = 1, 2 or 4. */
static inline __attribute__((always_inline)) void tiles_columns(int V, const word *a, int lda, int m, int k,
                                                                const word *b, int ldb, const float *init, int ldi,
                                                                float *c, int ldc)
{
  const int word_size = (int)sizeof(word);
  for (int i = 0; i < m; i += TILE_SIDE) {
    const word *row = a + i * lda;
    int p = 0;
#define BEGIN(v)                                                                                                       \
  if (init)                                                                                                            \
    _tile_loadd(v, init + i * ldi + TILE_SIDE * v, ldi * word_size);                                                   \
  else                                                                                                                 \
    _tile_zero(v)
#define ADD(v)                                                                                                         \
  _tile_loadd(5, b + p * ldb + TILE_SIDE * v, ldb * word_size);                                                        \
  _tile_dpbf16ps(v, 4, 5)
#define ADD_HALF(v)                                                                                                    \
  _tile_loadd(7, b + p * ldb + TILE_SIDE * v, ldb * word_size);                                                        \
  _tile_dpbf16ps(v, 6, 7)
#define END(v) _tile_stored(v, c + i * ldc + TILE_SIDE * v, ldc * word_size)
    EACH_TILE(V, BEGIN);
    for (; p + TILE_SIDE <= k; p += TILE_SIDE) {
      _tile_loadd(4, row + p, lda * word_size);
      EACH_TILE(V, ADD);
    }
    if (p < k) {
      _tile_loadd(6, row + p, lda * word_size);
      EACH_TILE(V, ADD_HALF);
    }
    EACH_TILE(V, END);
#undef BEGIN
#undef ADD
#undef ADD_HALF
#undef END
  }
}

/* c[m][n] = init + a[m][k] b[k][n]; m and n multiples of 16, k of 8. c may be init. */
static void gemm_tiles(const word *a, int lda, int m, int k, const word *b, int ldb, int n, const float *init, int ldi,
                       float *c, int ldc)
{
  __asm__ volatile("" ::: "memory"); /* GCC's tile loads do not say that they read memory */
  int j = 0;
  for (; j + 4 * TILE_SIDE <= n; j += 4 * TILE_SIDE)
    tiles_columns(4, a, lda, m, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
  for (; j + 2 * TILE_SIDE <= n; j += 2 * TILE_SIDE)
    tiles_columns(2, a, lda, m, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
  if (j < n) tiles_columns(1, a, lda, m, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
}
#endif
