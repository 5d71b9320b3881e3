/* The one matrix kernel of the trainer, its operands and their transpose, for the vector width of this build.
 * Included by kernels_isa.c only.
 *
 * Operands are words along the summed dimension: a float each, or, where the CPU multiplies bfloat16 pairs
 * (VDPBF16PS: products and sums in fp32), two bfloat16 numbers. PAIR says how many numbers a word holds. */
#ifndef SF_SNN_GEMM_ISA_H
#define SF_SNN_GEMM_ISA_H
#include <stdint.h>
#include <string.h>

#if defined(__AVX512F__)
enum { VL = 16, TILE_M = 6, TILE_V = 4 };
#elif defined(__AVX2__)
enum { VL = 8, TILE_M = 6, TILE_V = 2 };
#else
enum { VL = 4, TILE_M = 4, TILE_V = 2 };
#endif
typedef float vf __attribute__((vector_size(4 * VL), aligned(4), may_alias));
typedef int vi __attribute__((vector_size(4 * VL)));

#if defined(__AVX2__)
#include <immintrin.h>
#endif
#if defined(__AMX_BF16__) || defined(__AMXBF16__) /* clang 14's name */
#define SF_AMX
#endif
#if defined(__AVX512BF16__)
enum { PAIR = 2 };
typedef uint32_t word;
typedef uint32_t vw __attribute__((vector_size(4 * VL), aligned(4), may_alias));
static inline __attribute__((always_inline)) vf dot(vf sum, word a, vw b)
{
  return (vf)_mm512_dpbf16_ps((__m512)sum, (__m512bh)_mm512_set1_epi32((int)a), (__m512bh)b);
}
#else
enum { PAIR = 1 };
typedef float word;
typedef vf vw;
static inline __attribute__((always_inline)) vf dot(vf sum, word a, vw b)
{
  return sum + a * b;
}
#endif

/* Working memory as what it holds now. */
static inline word *words(void *memory)
{
  return memory;
}

static inline const word *operands(const void *memory)
{
  return memory;
}

static inline float *floats(void *memory)
{
  return memory;
}

static inline vf load(const void *from)
{
  return *(const vf *)from;
}

static inline void store(void *to, vf x)
{
  *(vf *)to = x;
}

/* The word of a (low half) and b; bfloat16 rounds to nearest, halves away from zero. One number per word: a. */
static inline word pair(float a, float b)
{
#if defined(__AVX512BF16__)
  union {
    float f;
    uint32_t i;
  } x = {a}, y = {b};
  return (x.i + 0x8000u) >> 16 | ((y.i + 0x8000u) & 0xFFFF0000u);
#else
  return (void)b, a;
#endif
}

/* The value of a number as an operand holds it. */
static inline float operand(float a)
{
#if defined(__AVX512BF16__)
  union {
    uint32_t i;
    float f;
  } x = {pair(0, a)};
  return x.f;
#else
  return a;
#endif
}

/* Two spikes of a word. */
static inline word spike_pair(float a, float b, float theta)
{
#if defined(__AVX512BF16__)
  return (a >= theta ? 0x3F80u : 0u) | (b >= theta ? 0x3F800000u : 0u);
#else
  return (void)b, a >= theta ? 1.0f : 0.0f;
#endif
}

/* c[M][V*VL] = init + sum_p a[m][p] . b[p][V*VL]; init NULL = zero. Constant M and V unroll into registers. */
static inline __attribute__((always_inline)) void gemm_tile(int M, int V, const word *a, int lda, int k, const word *b,
                                                            int ldb, const float *init, int ldi, float *c, int ldc)
{
  vf acc[6][4];
#pragma GCC unroll 6
  for (int m = 0; m < M; m++)
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) acc[m][v] = init ? *(const vf *)(init + m * ldi + v * VL) : (vf){0};
  for (int p = 0; p < k; p++) {
    vw row[4];
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) row[v] = *(const vw *)(b + (size_t)p * ldb + v * VL);
#pragma GCC unroll 6
    for (int m = 0; m < M; m++) {
      word s = a[m * lda + p];
#pragma GCC unroll 4
      for (int v = 0; v < V; v++) acc[m][v] = dot(acc[m][v], s, row[v]);
    }
  }
#pragma GCC unroll 6
  for (int m = 0; m < M; m++)
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) *(vf *)(c + m * ldc + v * VL) = acc[m][v];
}

/* Rows of the next register tile: 6 or 4 for every multiple of 16 rows, so that pairs of rows stay together. */
static inline int tile_rows(int left)
{
  if (TILE_M == 6 && (left > 8 || left % 6 == 0)) return 6;
  return left >= 4 ? 4 : 1;
}

static inline __attribute__((always_inline)) void gemm_columns(int V, int m, const word *a, int lda, int k,
                                                               const word *b, int ldb, const float *init, int ldi,
                                                               float *c, int ldc)
{
  for (int i = 0, n; i < m; i += n) {
    n = tile_rows(m - i);
    const float *from = init ? init + i * ldi : NULL;
    if (n == 6)
      gemm_tile(6, V, a + i * lda, lda, k, b, ldb, from, ldi, c + i * ldc, ldc);
    else if (n == 4)
      gemm_tile(4, V, a + i * lda, lda, k, b, ldb, from, ldi, c + i * ldc, ldc);
    else
      gemm_tile(1, V, a + i * lda, lda, k, b, ldb, from, ldi, c + i * ldc, ldc);
  }
}

static void gemm_vectors(const word *a, int lda, int m, int k, const word *b, int ldb, int n, const float *init,
                         int ldi, float *c, int ldc)
{
  int j = 0;
  for (; j + TILE_V * VL <= n; j += TILE_V * VL)
    gemm_columns(TILE_V, m, a, lda, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
  for (; j + 2 * VL <= n; j += 2 * VL)
    gemm_columns(2, m, a, lda, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
  for (; j < n; j += VL) gemm_columns(1, m, a, lda, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
}

/* layer_rows: rows of the next product of a layer, at most LAYER_ROWS, which are worked on while they are in the
 * first-level cache. */
#if defined(SF_AMX)
#include "snn/amx_isa.h"
#else
enum { LAYER_ROWS = TILE_M };

static inline int layer_rows(int left)
{
  return tile_rows(left);
}

static inline void tiles_begin(void) {}

static inline void tiles_end(void) {}
#endif

/* c[m][n] = init + a[m][k] b[k][n], k in words; n a multiple of 16. c may be init. */
static void gemm(const word *a, int lda, int m, int k, const word *b, int ldb, int n, const float *init, int ldi,
                 float *c, int ldc)
{
#if defined(SF_AMX)
  const int whole = k % TILE_HALF ? 0 : m / TILE_SIDE * TILE_SIDE;
  if (whole) gemm_tiles(a, lda, whole, k, b, ldb, n, init, ldi, c, ldc);
  if (whole == m) return;
  a += whole * lda, m -= whole, c += whole * ldc, init = init ? init + whole * ldi : NULL;
#endif
  gemm_vectors(a, lda, m, k, b, ldb, n, init, ldi, c, ldc);
}

static inline vf interleave(vf a, vf b, int high)
{
#ifdef __clang__ /* which has no shuffle by a vector of indices */
  vf mixed = {0};
  for (int i = 0; i < VL; i++) mixed[i] = (i & 1 ? b : a)[i / 2 + (high ? VL / 2 : 0)];
  return mixed;
#else
  vi mask = {0};
  for (int i = 0; i < VL; i++) mask[i] = (i & 1 ? VL : 0) + i / 2 + (high ? VL / 2 : 0);
  return __builtin_shuffle(a, b, mask);
#endif
}

/* VL x VL transpose: log2(VL) perfect shuffles of rows i and i + VL/2. */
static inline void transpose_tile(const vf *in, word *out, int ldo)
{
  vf x[VL], y[VL];
  memcpy(x, in, sizeof x);
  for (int stage = 1; stage < VL; stage *= 2) {
#pragma GCC unroll 8
    for (int i = 0; i < VL / 2; i++) {
      y[2 * i] = interleave(x[i], x[i + VL / 2], 0);
      y[2 * i + 1] = interleave(x[i], x[i + VL / 2], 1);
    }
    memcpy(x, y, sizeof x);
  }
  for (int i = 0; i < VL; i++) store(out + (size_t)i * ldo, x[i]);
}

/* out[columns][ldo] = transpose of in[rows][columns], words; both multiples of VL. */
static void transpose(const word *in, int rows, int columns, word *out, int ldo)
{
  for (int r = 0; r < rows; r += VL)
    for (int s = 0; s < columns; s += VL) {
      vf tile[VL];
      for (int i = 0; i < VL; i++) tile[i] = load(in + (size_t)(r + i) * columns + s);
      transpose_tile(tile, out + (size_t)s * ldo + r, ldo);
    }
}
#endif
