/* The one matrix kernel of the trainer and its transpose, for the vector width of this build.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_GEMM_ISA_H
#define SF_SNN_GEMM_ISA_H
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

typedef struct gemm_a {
  const float *at;
  int row, col; /* strides in floats */
} gemm_a;

/* c[M][V*VL] = init + sum_k a[m][k] * b[k][V*VL]; init NULL = zero. Constant M and V unroll into registers. */
static inline __attribute__((always_inline)) void gemm_tile(int M, int V, gemm_a a, int k, const float *b, int ldb,
                                                            const float *init, int ldi, float *c, int ldc)
{
  vf acc[6][4];
#pragma GCC unroll 6
  for (int m = 0; m < M; m++)
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) acc[m][v] = init ? *(const vf *)(init + m * ldi + v * VL) : (vf){0};
  for (int p = 0; p < k; p++) {
    vf row[4];
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) row[v] = *(const vf *)(b + (size_t)p * ldb + v * VL);
#pragma GCC unroll 6
    for (int m = 0; m < M; m++) {
      float s = a.at[m * a.row + p * a.col];
#pragma GCC unroll 4
      for (int v = 0; v < V; v++) acc[m][v] += s * row[v];
    }
  }
#pragma GCC unroll 6
  for (int m = 0; m < M; m++)
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) *(vf *)(c + m * ldc + v * VL) = acc[m][v];
}

static inline __attribute__((always_inline)) void gemm_rows(int V, gemm_a a, int m, int k, const float *b, int ldb,
                                                            const float *init, int ldi, float *c, int ldc)
{
  int i = 0;
  for (; i + TILE_M <= m; i += TILE_M)
    gemm_tile(TILE_M, V, (gemm_a){a.at + i * a.row, a.row, a.col}, k, b, ldb, init ? init + i * ldi : NULL, ldi,
              c + i * ldc, ldc);
  for (; i + 4 <= m; i += 4)
    gemm_tile(4, V, (gemm_a){a.at + i * a.row, a.row, a.col}, k, b, ldb, init ? init + i * ldi : NULL, ldi, c + i * ldc,
              ldc);
  for (; i < m; i++)
    gemm_tile(1, V, (gemm_a){a.at + i * a.row, a.row, a.col}, k, b, ldb, init ? init + i * ldi : NULL, ldi, c + i * ldc,
              ldc);
}

/* c[m][n] = init + a[m][k] b[k][n]; n a multiple of 16. c may be init. */
static void gemm(gemm_a a, int m, int k, const float *b, int ldb, int n, const float *init, int ldi, float *c, int ldc)
{
  int j = 0;
  for (; j + TILE_V * VL <= n; j += TILE_V * VL)
    gemm_rows(TILE_V, a, m, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
  for (; j + 2 * VL <= n; j += 2 * VL) gemm_rows(2, a, m, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
  for (; j < n; j += VL) gemm_rows(1, a, m, k, b + j, ldb, init ? init + j : NULL, ldi, c + j, ldc);
}

static inline vf interleave(vf a, vf b, int high)
{
  vi mask = {0};
  for (int i = 0; i < VL; i++) mask[i] = (i & 1 ? VL : 0) + i / 2 + (high ? VL / 2 : 0);
  return __builtin_shuffle(a, b, mask);
}

/* VL x VL transpose: log2(VL) perfect shuffles of rows i and i + VL/2. */
static inline void transpose_tile(const vf *in, float *out, int ldo)
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
  for (int i = 0; i < VL; i++) *(vf *)(out + (size_t)i * ldo) = x[i];
}

/* out[SF_BLOCK][ldo] = transpose of in[rows][SF_BLOCK]; rows a multiple of VL. */
static void transpose(const float *in, int rows, float *out, int ldo)
{
  for (int r = 0; r < rows; r += VL)
    for (int s = 0; s < SF_BLOCK; s += VL) {
      vf tile[VL];
      for (int i = 0; i < VL; i++) tile[i] = *(const vf *)(in + (size_t)(r + i) * SF_BLOCK + s);
      transpose_tile(tile, out + (size_t)s * ldo + r, ldo);
    }
}
#endif
