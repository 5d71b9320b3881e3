#include "src/fx/cache.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

enum { HALF_DEPTH = FX_WAYS_MAX / 2 };

static bool power_of_two(int32_t n)
{
  return n > 0 && (n & (n - 1)) == 0;
}

sf_status fx_cache_check(const fx_cache_shape *shape)
{
  if (!power_of_two(shape->bytes) || shape->bytes < FX_CACHE_BYTES_MIN || shape->bytes > FX_CACHE_BYTES_MAX)
    return sf_fail(SF_E_RANGE, "cache of %d bytes: expected a power of two from %d to %d", shape->bytes,
                   FX_CACHE_BYTES_MIN, FX_CACHE_BYTES_MAX);
  if (!power_of_two(shape->ways) || shape->ways > FX_WAYS_MAX)
    return sf_fail(SF_E_RANGE, "cache of %d ways: expected 1, 2, 4 or %d", shape->ways, FX_WAYS_MAX);
  return sf_ok();
}

sf_status fx_cache_open(fx_cache *cache, const fx_cache_shape *shape)
{
  *cache = (fx_cache){.shape = *shape};
  SF_TRY(fx_cache_check(shape));
  cache->sets = (uint32_t)(shape->bytes / (FX_LINE * shape->ways));
  cache->depth = shape->ways > HALF_DEPTH ? FX_WAYS_MAX : HALF_DEPTH;
  cache->line = sf_aligned_alloc((size_t)cache->sets * (size_t)cache->depth * sizeof *cache->line);
  if (!cache->line) return sf_fail(SF_E_MEMORY, "no memory for a cache of %d bytes", shape->bytes);
  fx_cache_empty(cache);
  return sf_ok();
}

void fx_cache_close(fx_cache *cache)
{
  free(cache->line);
  *cache = (fx_cache){.line = NULL};
}

/* All bits set: no field has a line of that number. */
void fx_cache_empty(fx_cache *cache)
{
  memset(cache->line, 0xff, (size_t)cache->sets * (size_t)cache->depth * sizeof *cache->line);
}

static bool look_up(fx_cache *cache, uint32_t line)
{
  uint32_t *set = cache->line + (size_t)(line & (cache->sets - 1)) * (size_t)cache->depth;
  const int ways = cache->shape.ways;
  int at = 0;
  while (at < ways && set[at] != line) at++;
  const bool hit = at < ways;
  for (int i = hit ? at : ways - 1; i > 0; i--) set[i] = set[i - 1];
  set[0] = line;
  return hit;
}

uint64_t fx_cache_look_up(fx_cache *cache, const uint32_t *line, int n)
{
  uint64_t misses = 0;
  for (int i = 0; i < n; i++) misses += !look_up(cache, line[i]);
  return misses;
}
