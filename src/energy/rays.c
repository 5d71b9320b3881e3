/* Rays of an audit through the vector core. */
#include "energy/measuring.h"
#include <stdlib.h>

/* Rays of one call: enough to keep the core's blocks full, few enough to share out among threads. */
enum { CHUNK = 1600, ROOM = CHUNK + FX_TILE * FX_TILE };

typedef struct chunk {
  fx_ray ray[ROOM];
  uint64_t tile[ROOM];
  fx_pixel pixel[ROOM];
  fx_counts counts; /* of the thread */
  fx_memory memory;
} chunk;

void sf_measure_fail(sf_measuring *s, uint64_t ray, sf_status status)
{
#pragma omp critical(sf_measure_failure)
  if (ray < s->failed.ray) s->failed = (sf_measure_failure){ray, status};
}

uint64_t sf_measure_index(const sf_measuring *s, uint64_t i)
{
  return s->index ? s->index[i] : i;
}

uint64_t sf_measure_tile(const sf_measuring *s, uint64_t i)
{
  const uint64_t index = sf_measure_index(s, i);
  return s->job->tile ? s->job->tile(s->job->user, index) : index;
}

static bool tile_begins(const sf_measuring *s, uint64_t i)
{
  return i == 0 || sf_measure_tile(s, i) != sf_measure_tile(s, i - 1);
}

uint64_t sf_measure_begin(const sf_measuring *s, uint64_t first, uint64_t limit)
{
  while (first < limit && !tile_begins(s, first)) first++;
  return first;
}

bool sf_measure_has(const sf_measuring *s, uint64_t i, uint64_t limit)
{
  return i < s->count && (i < limit || !tile_begins(s, i));
}

uint64_t sf_measure_limit(const sf_measuring *s, uint64_t first, uint64_t size)
{
  return first + size < s->count ? first + size : s->count;
}

static bool make_rays(sf_measuring *s, uint64_t first, uint64_t n, chunk *c)
{
  for (uint64_t i = 0; i < n; i++) {
    const uint64_t index = sf_measure_index(s, first + i);
    const sf_status status = s->job->ray(s->job->user, index, &c->ray[i]);
    c->tile[i] = sf_measure_tile(s, first + i);
    if (status.code == SF_OK) continue;
    sf_measure_fail(s, index, status);
    return false;
  }
  return true;
}

static bool render_rays(sf_measuring *s, uint64_t first, uint64_t n, chunk *c)
{
  if (!make_rays(s, first, n, c)) return false;
  const sf_status status = fx_render_list(s->core, &c->memory, c->tile, c->ray, n, c->pixel, NULL, &c->counts);
  if (status.code != SF_OK) sf_measure_fail(s, sf_measure_index(s, first), status);
  for (uint64_t i = 0; i < n && !s->index && status.code == SF_OK; i++)
    if (c->pixel[i].samples > 0) {
#pragma omp atomic
      s->hit[(first + i - s->hit_first) / 8] |= (uint8_t)(1u << (first + i) % 8);
    }
  return status.code == SF_OK;
}

/* Of several ranks, rank 0 tells of progress from where it takes results. */
static bool goes_on(const sf_measuring *s)
{
  if (sf_ranks_size(s->job->ranks) > 1 && sf_ranks_stop(s->job->ranks)) return false;
  return sf_ranks_size(s->job->ranks) > 1 || !s->job->tick || s->job->tick(s->job->user, s->done);
}

/* The checked rays have been counted before. */
void sf_measure_progress(sf_measuring *s, uint64_t rays)
{
#pragma omp critical(sf_measure_tick)
  {
    if (!s->index) s->done += rays;
    if (!s->stopped && !goes_on(s)) {
#pragma omp atomic write
      s->stopped = true;
    }
  }
}

bool sf_measure_skips(sf_measuring *s, uint64_t first)
{
  bool skip;
#pragma omp atomic read
  skip = s->stopped;
  if (skip) return true;
#pragma omp critical(sf_measure_failure)
  skip = sf_measure_index(s, first) > s->failed.ray;
  return skip;
}

static void render_chunk(sf_measuring *s, uint64_t first, chunk *c)
{
  const uint64_t limit = sf_measure_limit(s, first, CHUNK);
  uint64_t at = sf_measure_begin(s, first, limit);
  if (at == limit) return;
  fx_memory_begin(&c->memory);
  for (uint64_t n; sf_measure_has(s, at, limit); at += n) {
    for (n = 1; n < ROOM && sf_measure_has(s, at + n, limit);) n++;
    if (sf_measure_skips(s, at) || !render_rays(s, at, n, c)) return;
    sf_measure_progress(s, n);
  }
}

sf_status sf_measure_list(sf_measuring *s, uint64_t from, uint64_t end, fx_counts *sum, fx_memory_counts *memory)
{
  s->failed = (sf_measure_failure){UINT64_MAX, sf_ok()};
#pragma omp parallel
  {
    chunk *c = calloc(1, sizeof *c);
    const sf_status opened =
        c ? fx_memory_open(&c->memory, s->job->scene, &s->cache) : sf_fail(SF_E_MEMORY, "audit: out of memory");
    if (opened.code != SF_OK) sf_measure_fail(s, 0, opened);
#pragma omp for schedule(dynamic)
    for (uint64_t first = from; first < end; first += CHUNK)
      if (opened.code == SF_OK && !sf_measure_skips(s, first)) render_chunk(s, first, c);
    if (c) {
#pragma omp critical(sf_measure_merge)
      fx_counts_add(sum, &c->counts), fx_memory_counts_add(memory, &c->memory.counts);
      fx_memory_close(&c->memory);
    }
    free(c);
  }
  return s->failed.status;
}

/* ---- by ranks ---- */

/* Units of rays: chunks enough for the threads of a rank. OVERLAP: rays behind its end that its last chunk may have. */
enum { SLICE = 8 * CHUNK, OVERLAP = FX_TILE * FX_TILE };
_Static_assert(SLICE % 8 == 0, "a slice's bits begin with a byte");

typedef struct slice {
  fx_counts counts;
  fx_memory_counts memory;
  sf_measure_outcome outcome;
  uint8_t hit[(SLICE + OVERLAP) / 8 + 1];
} slice;

static void measure_slice(void *measuring, uint64_t unit, void *result)
{
  sf_measuring part = *(const sf_measuring *)measuring;
  slice *to = result;
  const uint64_t first = unit * SLICE;
  part.hit = to->hit, part.hit_first = first, part.done = 0;
  sf_measure_list(&part, first, sf_measure_limit(&part, first, SLICE), &to->counts, &to->memory);
  to->outcome = sf_measure_came(&part);
}

static bool add_slice(void *measuring, uint64_t unit, const void *result)
{
  sf_measuring *s = measuring;
  const slice *from = result;
  const uint64_t first = unit * SLICE / 8, all = s->count / 8 + 1;
  fx_counts_add(&s->sum->core, &from->counts), fx_memory_counts_add(&s->sum->memory, &from->memory);
  for (uint64_t i = 0; i < sizeof from->hit && first + i < all; i++) s->sum->hit[first + i] |= from->hit[i];
  return sf_measure_took(s, &from->outcome);
}

sf_measure_outcome sf_measure_came(const sf_measuring *part)
{
  return (sf_measure_outcome){part->failed, part->done, part->stopped};
}

bool sf_measure_took(sf_measuring *s, const sf_measure_outcome *outcome)
{
  s->failed = outcome->failed;
  s->stopped |= outcome->stopped;
  if (!s->index) s->done += outcome->done;
  return s->failed.status.code == SF_OK && !s->stopped;
}

static void tick(void *measuring)
{
  const sf_measuring *s = measuring;
  if (s->job->tick) (void)s->job->tick(s->job->user, s->done);
}

sf_status sf_measure_deal(sf_measuring *s, uint64_t unit, size_t result_size, void (*work)(void *, uint64_t, void *),
                          bool (*take)(void *, uint64_t, const void *))
{
  const sf_deal deal = {.end = (s->count + unit - 1) / unit,
                        .result_size = result_size,
                        .work = work,
                        .take = take,
                        .tick = tick,
                        .user = s};
  s->failed = (sf_measure_failure){UINT64_MAX, sf_ok()};
  const sf_status dealt = sf_ranks_deal(s->job->ranks, &deal);
  s->stopped |= dealt.code == SF_E_STOPPED;
  if (sf_ranks_lost(s->job->ranks)) return dealt;
  return sf_ranks_agree(s->job->ranks, s->failed.status.code == SF_OK && !s->stopped ? dealt : s->failed.status);
}

/* Rays drawn from a small picture may stay in one tile for longer than a slice's bits reach. */
static bool can_be_dealt(const sf_measuring *s)
{
  for (uint64_t first = SLICE; first < s->count; first += SLICE) {
    const uint64_t limit = sf_measure_limit(s, first, OVERLAP);
    if (limit < s->count && sf_measure_begin(s, first, limit + 1) > limit) return false;
  }
  return true;
}

sf_status sf_measure_all(sf_measuring *s)
{
  const bool first = sf_ranks_rank(s->job->ranks) == 0;
  if (sf_ranks_size(s->job->ranks) > 1 && can_be_dealt(s))
    return sf_measure_deal(s, SLICE, sizeof(slice), measure_slice, add_slice);
  return sf_ranks_agree(s->job->ranks,
                        first ? sf_measure_list(s, 0, s->count, &s->sum->core, &s->sum->memory) : sf_ok());
}
