/* Inside of sf_measure_rays: rays in chunks, over threads and ranks. */
#ifndef SF_ENERGY_MEASURING_H
#define SF_ENERGY_MEASURING_H
#include "energy/energy.h"

typedef struct sf_measure_failure {
  uint64_t ray; /* lowest ray that failed, so that the message does not depend on the threads */
  sf_status status;
} sf_measure_failure;

typedef struct sf_measuring {
  const sf_measure_job *job;
  fx_cache_shape cache;
  const fx_core *core;
  sf_measure *sum;
  uint8_t *hit; /* bits of the rays from hit_first on, a multiple of 8 */
  uint64_t hit_first;
  const uint64_t *index; /* of the rays to be checked; NULL: all rays are measured */
  uint64_t count;
  sf_measure_failure failed;
  uint64_t done;
  bool stopped;
} sf_measuring;

/* What a unit of rays, measured somewhere, came to beside its counts. */
typedef struct sf_measure_outcome {
  sf_measure_failure failed;
  uint64_t done;
  bool stopped;
} sf_measure_outcome;

/* ---- rays.c: through the vector core ---- */

/* Those of [first, end), of whose chunks the last may go on behind the end; their counts are added to sum and memory.
 */
sf_status sf_measure_list(sf_measuring *m, uint64_t first, uint64_t end, fx_counts *sum, fx_memory_counts *memory);
/* All rays, by all ranks; the sum is on rank 0. */
sf_status sf_measure_all(sf_measuring *m);
/* Deals out m->count rays in units of so many. work and take as sf_deal's, with m as user: work measures with a copy of
 * m, take adds up. */
sf_status sf_measure_deal(sf_measuring *m, uint64_t unit, size_t result_size,
                          void (*work)(void *m, uint64_t unit, void *result),
                          bool (*take)(void *m, uint64_t unit, const void *result));
sf_measure_outcome sf_measure_came(const sf_measuring *part);
bool sf_measure_took(sf_measuring *m, const sf_measure_outcome *outcome); /* false: no more units */

void sf_measure_fail(sf_measuring *m, uint64_t ray, sf_status status);
void sf_measure_progress(sf_measuring *m, uint64_t rays);
bool sf_measure_skips(sf_measuring *m, uint64_t i); /* stopped, or behind a failure */
uint64_t sf_measure_index(const sf_measuring *m, uint64_t i);
uint64_t sf_measure_tile(const sf_measuring *m, uint64_t i);
/* A chunk begins where a tile does, and ends where the next chunk begins. The first ray of the chunk that lies in
 * [first, limit); limit where there is none. */
uint64_t sf_measure_begin(const sf_measuring *m, uint64_t first, uint64_t limit);
/* Whether ray i belongs to the chunk that began before `limit`. */
bool sf_measure_has(const sf_measuring *m, uint64_t i, uint64_t limit);
uint64_t sf_measure_limit(const sf_measuring *m, uint64_t first, uint64_t size);

/* ---- check.c: seeded rays through the portable core, and recounted ---- */

sf_status sf_measure_check(sf_measuring *m);
#endif
