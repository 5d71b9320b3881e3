/* Lines of a position, four pairs of a level side by side, and look-ups, all lines of a set at once. The lines are
 * those of fx_grid_lines, the misses those of fx_cache_look_up. */
#ifndef SF_FX_CACHE_ISA_H
#define SF_FX_CACHE_ISA_H
#include "src/fx/kernels.h"
#include "src/fx/grid_isa.h"

enum { LINE_SHIFT = 3, GROUP_LEVELS = WIDTH / FX_LEVEL_PAIRS };
_Static_assert(1 << LINE_SHIFT == FX_LINE_ENTRIES, "entries of a line");

#if defined(__AVX512VNNI__)
static INLINE vec v_permute(vec x, vec index)
{
  return _mm512_permutexvar_epi32(index, x);
}

/* Appends x and next in turn, next only where it differs; returns the end. */
static INLINE uint32_t *append_pairs(uint32_t *list, vec x, vec next)
{
  const __m512i low = _mm512_unpacklo_epi32(x, next), high = _mm512_unpackhi_epi32(x, next);
  const __m512i both[2] = {_mm512_permutex2var_epi64(low, _mm512_set_epi64(11, 10, 3, 2, 9, 8, 1, 0), high),
                           _mm512_permutex2var_epi64(low, _mm512_set_epi64(15, 14, 7, 6, 13, 12, 5, 4), high)};
  for (int half = 0; half < 2; half++) {
    const __m512i first = _mm512_shuffle_epi32(both[half], 0xa0);
    const __mmask16 kept = _mm512_cmpneq_epi32_mask(both[half], first) | 0x5555;
    v_store(list, _mm512_maskz_compress_epi32(kept, both[half]));
    list += __builtin_popcount(kept);
  }
  return list;
}
#else
static INLINE vec v_permute(vec x, vec index)
{
  return _mm256_permutevar8x32_epi32(x, index);
}

static INLINE uint32_t *append_pairs(uint32_t *list, vec x, vec next)
{
  uint32_t first[WIDTH], second[WIDTH];
  v_store(first, x), v_store(second, next);
  for (int i = 0; i < WIDTH; i++) { /* without a branch: one in eight pairs is in two lines */
    list[0] = first[i], list[1] = second[i];
    list += 1 + (first[i] != second[i]);
  }
  return list;
}
#endif

/* Of WIDTH levels from `first` on: x of the cells, y and z times their factors. */
static INLINE void find_places(const fx_places *places, const uint32_t pos[3], int first, vec place[3])
{
  const vec scale = v_load(&places->scale[first]);
  for (int axis = 0; axis < 3; axis++) {
    const vec p = V(add_epi32)(high_rounded(scale, v_set((int32_t)pos[axis])), v_set(1 << (CELL_FRAC - 1)));
    place[axis] = V(srli_epi32)(p, CELL_FRAC);
  }
  place[1] = V(mullo_epi32)(place[1], v_load(&places->my[first]));
  place[2] = V(mullo_epi32)(place[2], v_load(&places->mz[first]));
}

static INLINE vec line_of(vec x, vec hash, vec sum, const fx_places *places, int at)
{
  const vec hashed = v_load(&places->hashed[at]), mask = v_load(&places->mask[at]);
  const vec of_hash = V_BITS(and)(V_BITS(xor)(x, hash), mask), dense = V(add_epi32)(x, sum);
  const vec index = V_BITS(or)(V_BITS(and)(hashed, of_hash), V_BITS(andnot)(hashed, dense));
  return V(srli_epi32)(V(add_epi32)(index, v_load(&places->offset[at])), LINE_SHIFT);
}

/* GROUP_LEVELS levels from `level` on, of places that begin at level `first`. */
static INLINE uint32_t *append_group(uint32_t *list, const fx_places *places, const vec place[3], int first, int level)
{
  int32_t lane[WIDTH];
  const int at = level * FX_LEVEL_PAIRS;
  for (int i = 0; i < WIDTH; i++) lane[i] = level - first + i / FX_LEVEL_PAIRS;
  const vec spread = v_load(lane), x = v_permute(place[0], spread);
  const vec y = V(add_epi32)(v_permute(place[1], spread), v_load(&places->add_y[at]));
  const vec z = V(add_epi32)(v_permute(place[2], spread), v_load(&places->add_z[at]));
  const vec hash = V_BITS(xor)(y, z), sum = V(add_epi32)(y, z);
  return append_pairs(list, line_of(x, hash, sum, places, at),
                      line_of(V(add_epi32)(x, v_set(1)), hash, sum, places, at));
}

/* What a group has beyond the last level is taken back: each of its pairs is one look-up there. */
static int lines(const fx_places *places, const uint32_t pos[3], uint32_t list[FX_LOOKUPS_ROOM])
{
  const int levels = places->grid->levels;
  uint32_t *end = list;
  for (int first = 0; first < levels; first += WIDTH) {
    vec place[3];
    find_places(places, pos, first, place);
#pragma GCC unroll 4
    for (int level = first; level < first + WIDTH; level += GROUP_LEVELS)
      if (level < levels) end = append_group(end, places, place, first, level);
  }
  const int beyond = (GROUP_LEVELS - levels % GROUP_LEVELS) % GROUP_LEVELS;
  return (int)(end - list) - beyond * FX_LEVEL_PAIRS;
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
