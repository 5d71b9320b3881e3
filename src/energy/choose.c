/* A seeded choice of rays: those with the smallest keys. */
#include "energy/energy.h"
#include "base/rng.h"
#include <stdlib.h>

static int ascending(const void *a, const void *b)
{
  const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
  return x < y ? -1 : x > y;
}

typedef struct choice {
  uint64_t key, ray;
} choice;

/* A heap with the largest key at its root: the first to go. */
static void sink(choice *heap, uint64_t n, choice c)
{
  uint64_t at = 0;
  for (uint64_t child = 1; child < n; child = 2 * at + 1) {
    if (child + 1 < n && heap[child + 1].key > heap[child].key) child++;
    if (heap[child].key <= c.key) break;
    heap[at] = heap[child], at = child;
  }
  heap[at] = c;
}

static void rise(choice *heap, uint64_t at, choice c)
{
  for (; at > 0 && heap[(at - 1) / 2].key < c.key; at = (at - 1) / 2) heap[at] = heap[(at - 1) / 2];
  heap[at] = c;
}

sf_status sf_measure_choose(const sf_measure *measure, uint64_t seed, uint64_t stream, uint64_t limit, uint64_t *index,
                            uint64_t *count)
{
  uint64_t n = 0;
  if (limit > measure->core.rays) limit = measure->core.rays;
  choice *heap = calloc(limit + 1, sizeof *heap);
  if (!heap) return sf_fail(SF_E_MEMORY, "audit: out of memory for %llu rays", (unsigned long long)limit);
  for (uint64_t i = 0; i < measure->rays && limit > 0; i++) {
    if (!(measure->hit[i / 8] >> i % 8 & 1)) continue;
    const choice c = {sf_random_u64(seed, stream, i), i};
    if (n < limit)
      rise(heap, n, c), n++;
    else if (c.key < heap[0].key)
      sink(heap, n, c);
  }
  for (uint64_t i = 0; i < n; i++) index[i] = heap[i].ray;
  qsort(index, n, sizeof *index, ascending);
  free(heap);
  *count = n;
  return sf_ok();
}
