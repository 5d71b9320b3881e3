/* All caches at once, against one after the other. */
#include "ck_run.h"
#include "base/rng.h"
#include "cycles/places.h"

enum { LINES = 20000 };

/* Near lines, far lines, and lines of the same set. */
static uint32_t line_of(uint64_t i)
{
  const uint64_t kind = sf_random_below(3, 1, i, 4), value = sf_random_below(3, 2, i, 1 << 20);
  if (kind == 0) return (uint32_t)(value % 64);
  if (kind == 1) return (uint32_t)(value % 16 * 4096 + 5);
  return (uint32_t)(kind == 2 ? value % 3000 : value);
}

TEST(ranks_are_all_caches)
{
  static uint32_t line[LINES];
  for (uint64_t i = 0; i < LINES; i++) line[i] = line_of(i);
  for (int bytes = FX_CACHE_BYTES_MIN; bytes <= FX_CACHE_BYTES_MAX; bytes *= 2)
    for (int ways = 1; ways <= FX_WAYS_MAX; ways *= 2) {
      const fx_cache_shape shape = {bytes, ways};
      fx_cache cache;
      sf_places places;
      ck_ok(fx_cache_open(&cache, &shape));
      ck_ok(sf_places_open(&places, cache.sets));
      uint64_t misses = 0;
      for (int tile = 0; tile < 2; tile++) {
        fx_cache_empty(&cache), sf_places_empty(&places);
        misses += fx_cache_look_up(&cache, line + tile * LINES / 2, LINES / 2);
        sf_places_look_up(&places, line + tile * LINES / 2, LINES / 2);
      }
      ck_assert_uint_eq(places.asked, LINES);
      ck_assert_uint_eq(sf_places_misses(&places, ways), misses);
      ck_assert_uint_gt(misses, 0);
      ck_assert_uint_lt(misses, LINES);
      fx_cache_close(&cache), sf_places_close(&places);
    }
}
