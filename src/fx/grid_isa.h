/* Hash grid for a block of samples, level by level; one sample to a lane. The arithmetic is that of grid.c.
 *
 * A corner and its neighbour in x are often in one 32-bit word: in a dense level always, in a hashed one when x is
 * even, as the hash of x is x itself. */
#ifndef SF_FX_GRID_ISA_H
#define SF_FX_GRID_ISA_H
#include "src/fx/kernels.h"
#include "src/fx/unit.h"
#include "src/fx/vec_isa.h"

enum { CELL_FRAC = 8, CELL_ONE = 1 << CELL_FRAC };
static const int32_t HASH_Y = (int32_t)2654435761u, HASH_Z = 805459861;

/* High halves of (a * b + 2^31): rshift_round(a * b, 32), a unsigned. */
static INLINE vec high_rounded(vec a, vec b)
{
  const vec half = v_set64((int64_t)1 << 31);
  const vec even = V(add_epi64)(V(mul_epu32)(a, b), half);
  const vec odd = V(add_epi64)(V(mul_epu32)(V(srli_epi64)(a, 32), b), half);
#if defined(__AVX512VNNI__)
  return _mm512_mask_blend_epi32(0xaaaa, _mm512_srli_epi64(even, 32), odd);
#else
  return _mm256_blend_epi32(_mm256_srli_epi64(even, 32), odd, 0xaa);
#endif
}

/* Two entries, four bytes, at byte offset 2 * index. */
static INLINE vec gather_pair(const int8_t *table, vec index)
{
#if defined(__AVX512VNNI__)
  return _mm512_i32gather_epi32(index, table, 2);
#else
  return _mm256_i32gather_epi32((const int *)table, index, 2);
#endif
}

typedef struct pair_sum {
  vec f[2];
} pair_sum;

/* Adds weight * the entry in the low half of word. */
static INLINE void add_entry(pair_sum *sum, vec weight, vec word)
{
  const vec first = V(srai_epi32)(V(slli_epi32)(word, 24), 24), second = V(srai_epi32)(V(slli_epi32)(word, 16), 24);
  sum->f[0] = V(add_epi32)(sum->f[0], V(mullo_epi32)(weight, first));
  sum->f[1] = V(add_epi32)(sum->f[1], V(mullo_epi32)(weight, second));
}

/* Corners (x, row) and (x + 1, row) of a hashed level; row: hash of y and z. Words start at even entries. */
static INLINE void add_hashed(pair_sum *sum, const int8_t *table, vec x, vec row, vec mask, const vec weight[2])
{
  const vec one = v_set(1);
  for (int i = 0; i < 2; i++) {
    const vec index = V_BITS(and)(V_BITS(xor)(i ? V(add_epi32)(x, one) : x, row), mask);
    const vec word = gather_pair(table, V_BITS(andnot)(one, index));
    const vec entry = V(srlv_epi32)(word, V(slli_epi32)(V_BITS(and)(index, one), 4));
    add_entry(sum, weight[i], entry);
  }
}

static INLINE void add_dense(pair_sum *sum, const int8_t *table, vec index, const vec weight[2])
{
  const vec word = gather_pair(table, index);
  add_entry(sum, weight[0], word);
  add_entry(sum, weight[1], V(srli_epi32)(word, 16));
}

/* Cells of the lanes and their corners' weights; index bit 0 = x + 1, bit 1 = y + 1, bit 2 = z + 1. */
static INLINE void find_cells(const fx_block *b, int i, int32_t scale, vec base[3], vec weight[8])
{
  vec g[3];
  for (int axis = 0; axis < 3; axis++) {
    const vec p = V(add_epi32)(high_rounded(v_load(&b->pos[axis][i]), v_set(scale)), v_set(1 << (CELL_FRAC - 1)));
    base[axis] = V(srli_epi32)(p, CELL_FRAC);
    g[axis] = V_BITS(and)(p, v_set(CELL_ONE - 1));
  }
  const vec one = v_set(CELL_ONE);
  for (int corner = 0; corner < 4; corner++) {
    const vec x = corner & 1 ? g[0] : V(sub_epi32)(one, g[0]), y = corner & 2 ? g[1] : V(sub_epi32)(one, g[1]);
    const vec xy = V(mullo_epi32)(x, y), upper = v_shift_round(V(mullo_epi32)(xy, g[2]), CELL_FRAC);
    weight[corner] = V(sub_epi32)(xy, upper);
    weight[corner + 4] = upper;
  }
}

static INLINE pair_sum level_sums(const fx_grid *grid, int level, const fx_block *b, int i)
{
  const int8_t *table = grid->table + grid->offset[level] * FX_GRID_FEATURES;
  const int32_t stride = grid->stride[level];
  vec base[3], weight[8];
  pair_sum sum = {{v_set(0), v_set(0)}};
  find_cells(b, i, grid->scale_q16[level], base, weight);
  if (stride) {
    const vec xy = V(add_epi32)(base[0], V(mullo_epi32)(v_set(stride), base[1])),
              corner = V(add_epi32)(xy, V(mullo_epi32)(v_set(stride * stride), base[2]));
    for (int row = 0; row < 4; row++)
      add_dense(&sum, table, V(add_epi32)(corner, v_set((row & 1) * stride + (row >> 1) * stride * stride)),
                weight + 2 * row);
  } else {
    const vec mask = v_set((int32_t)((1u << grid->log2_size[level]) - 1));
    const vec y = V(mullo_epi32)(base[1], v_set(HASH_Y)), z = V(mullo_epi32)(base[2], v_set(HASH_Z));
    for (int row = 0; row < 4; row++)
      add_hashed(
          &sum, table, base[0],
          V_BITS(xor)(row & 1 ? V(add_epi32)(y, v_set(HASH_Y)) : y, row & 2 ? V(add_epi32)(z, v_set(HASH_Z)) : z), mask,
          weight + 2 * row);
  }
  return sum;
}

/* Pairs of features of a level, one 32-bit word per sample; the lanes that saturated as bits. */
static INLINE vec level_features(const pair_sum *sum, int shift, uint32_t *saturated, uint32_t lanes)
{
  vec f[2];
  for (int i = 0; i < FX_GRID_FEATURES; i++) {
    const vec exact = v_shift_round(sum->f[i], shift);
    f[i] = v_clamp(exact, -FX_INPUT_MAX, FX_INPUT_MAX);
    *saturated += (uint32_t)__builtin_popcount(v_differ(exact, f[i]) & lanes);
  }
  return V_BITS(or)(V_BITS(and)(f[0], v_set(0xffff)), V(slli_epi32)(f[1], 16));
}

static uint64_t features(const fx_grid *grid, fx_block *b)
{
  uint32_t pairs[FX_LEVELS_MAX][FX_BLOCK], saturated = 0;
  for (int axis = 0; axis < 3; axis++) /* lanes without a sample must stay inside the table too */
    for (int i = b->n; i % WIDTH; i++) b->pos[axis][i] = 0;
  for (int level = 0; level < grid->levels; level++)
    for (int i = 0; i < b->n; i += WIDTH) {
      const pair_sum sum = level_sums(grid, level, b, i);
      const uint32_t lanes = b->n - i >= WIDTH ? ((uint32_t)1 << WIDTH) - 1 : ((uint32_t)1 << (b->n - i)) - 1;
      v_store(&pairs[level][i], level_features(&sum, grid->shift[level], &saturated, lanes));
    }
  for (int i = 0; i < b->n; i++)
    for (int level = 0; level < grid->levels; level++) memcpy(&b->f[i][2 * level], &pairs[level][i], 4);
  return saturated;
}
#endif
