/* Lines of a position, one level to a lane, and look-ups, all lines of a set at once. The lines are those of
 * fx_grid_lines, the misses those of fx_cache_look_up. */
#ifndef SF_FX_CACHE_ISA_H
#define SF_FX_CACHE_ISA_H
#include "src/fx/core.h"
#include "src/fx/grid_isa.h"

enum { PAIRS = 4, LINE_SHIFT = 3, PLACE_SHIFT = CELL_FRAC };
_Static_assert(1 << LINE_SHIFT == FX_LINE_ENTRIES, "entries of a line");

/* Of the levels from `first` on: [pair][x, x + 1][level]. */
static INLINE void level_lines(const fx_places *places, const uint32_t pos[3], int first,
                               uint32_t line[PAIRS][2][FX_LEVELS_MAX])
{
  const vec scale = v_load(&places->scale[first]), my = v_load(&places->my[first]), mz = v_load(&places->mz[first]);
  const vec mask = v_load(&places->mask[first]), hashed = v_load(&places->hashed[first]);
  const vec offset = v_load(&places->offset[first]), one = v_set(1);
  vec base[3];
  for (int axis = 0; axis < 3; axis++) {
    const vec p = V(add_epi32)(high_rounded(scale, v_set((int32_t)pos[axis])), v_set(1 << (CELL_FRAC - 1)));
    base[axis] = V(srli_epi32)(p, PLACE_SHIFT);
  }
  const vec y = V(mullo_epi32)(base[1], my), z = V(mullo_epi32)(base[2], mz);
  for (int pair = 0; pair < PAIRS; pair++) {
    const vec at_y = pair & 1 ? V(add_epi32)(y, my) : y, at_z = pair & 2 ? V(add_epi32)(z, mz) : z;
    const vec hash = V_BITS(xor)(at_y, at_z), sum = V(add_epi32)(at_y, at_z);
    for (int i = 0; i < 2; i++) {
      const vec x = i ? V(add_epi32)(base[0], one) : base[0];
      const vec of_hash = V_BITS(and)(V_BITS(xor)(x, hash), mask), dense = V(add_epi32)(x, sum);
      const vec index = V_BITS(or)(V_BITS(and)(hashed, of_hash), V_BITS(andnot)(hashed, dense));
      v_store(&line[pair][i][first], V(srli_epi32)(V(add_epi32)(index, offset), LINE_SHIFT));
    }
  }
}

static int lines(const fx_places *places, const uint32_t pos[3], uint32_t list[FX_LOOKUPS_ROOM])
{
  uint32_t line[PAIRS][2][FX_LEVELS_MAX];
  int n = 0;
  for (int first = 0; first < places->grid->levels; first += WIDTH) level_lines(places, pos, first, line);
  for (int level = 0; level < places->grid->levels; level++)
    for (int pair = 0; pair < PAIRS; pair++) { /* without a branch: one in eight pairs is in two lines */
      const uint32_t x = line[pair][0][level], next = line[pair][1][level];
      list[n] = x, list[n + 1] = next;
      n += 1 + (next != x);
    }
  return n;
}

/* Sets of four: whether the line was found up to each place moves the lines before it back by one. */
static uint64_t look_up4(fx_cache *cache, const uint32_t *line, int n)
{
  const uint32_t mask = cache->sets - 1;
  __m128i hits = _mm_setzero_si128();
  for (int i = 0; i < n; i++) {
    __m128i *set = (__m128i *)(cache->line + (size_t)(line[i] & mask) * 4);
    const __m128i wanted = _mm_set1_epi32((int32_t)line[i]), old = _mm_load_si128(set);
    __m128i found = _mm_cmpeq_epi32(old, wanted);
    found = _mm_or_si128(found, _mm_slli_si128(found, 4));
    found = _mm_or_si128(found, _mm_slli_si128(found, 8));
    hits = _mm_sub_epi32(hits, found);
    const __m128i moved = _mm_alignr_epi8(old, wanted, 12);
    _mm_store_si128(set, _mm_blendv_epi8(moved, old, _mm_slli_si128(found, 4)));
  }
  uint32_t hit[4];
  _mm_storeu_si128((__m128i *)hit, hits);
  return (uint64_t)n - hit[cache->shape.ways - 1];
}

static INLINE __m256i moved_up(__m256i x, int lanes) /* the low lanes keep what they hold */
{
  const __m256i from = lanes == 1   ? _mm256_set_epi32(6, 5, 4, 3, 2, 1, 0, 0)
                       : lanes == 2 ? _mm256_set_epi32(5, 4, 3, 2, 1, 0, 1, 0)
                                    : _mm256_set_epi32(3, 2, 1, 0, 3, 2, 1, 0);
  return _mm256_permutevar8x32_epi32(x, from);
}

static uint64_t look_up8(fx_cache *cache, const uint32_t *line, int n)
{
  const uint32_t mask = cache->sets - 1;
  const __m256i not_first = _mm256_set_epi32(-1, -1, -1, -1, -1, -1, -1, 0);
  const __m256i above2 = _mm256_set_epi32(-1, -1, -1, -1, -1, -1, 0, 0);
  const __m256i above4 = _mm256_set_epi32(-1, -1, -1, -1, 0, 0, 0, 0);
  __m256i hits = _mm256_setzero_si256();
  for (int i = 0; i < n; i++) {
    __m256i *set = (__m256i *)(cache->line + (size_t)(line[i] & mask) * 8);
    const __m256i wanted = _mm256_set1_epi32((int32_t)line[i]), old = _mm256_load_si256(set);
    __m256i found = _mm256_cmpeq_epi32(old, wanted);
    found = _mm256_or_si256(found, _mm256_and_si256(moved_up(found, 1), not_first));
    found = _mm256_or_si256(found, _mm256_and_si256(moved_up(found, 2), above2));
    found = _mm256_or_si256(found, _mm256_and_si256(moved_up(found, 4), above4));
    hits = _mm256_sub_epi32(hits, found);
    const __m256i moved = _mm256_blend_epi32(moved_up(old, 1), wanted, 1);
    const __m256i before = _mm256_and_si256(moved_up(found, 1), not_first);
    _mm256_store_si256(set, _mm256_blendv_epi8(moved, old, before));
  }
  uint32_t hit[8];
  _mm256_storeu_si256((__m256i *)hit, hits);
  return (uint64_t)n - hit[cache->shape.ways - 1];
}

static uint64_t look_up(fx_cache *cache, const uint32_t *line, int n)
{
  return cache->depth == 4 ? look_up4(cache, line, n) : look_up8(cache, line, n);
}
#endif
