#include "energy/energy.h"
#include "quant/quant.h"
#include "base/rng.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

sf_status sf_pixel_ray(const fx_scene *scene, const sf_dataset *data, const sf_view *view, int x, int y, fx_ray *ray)
{
  float origin[3], direction[3];
  sf_dataset_ray(data, view, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  return sf_fx_ray_make(scene, origin, direction, ray);
}

/* ---- all rays, vector core ---- */

/* Rays of one call: enough to keep the core's blocks full, few enough to share out among threads. A chunk begins where
 * a tile does, and ends where the next chunk begins. */
enum { CHUNK = 1600, ROOM = CHUNK + FX_TILE * FX_TILE, CHECK_CHUNK = 16 };

typedef struct failure {
  uint64_t ray; /* lowest ray that failed, so that the message does not depend on the threads */
  sf_status status;
} failure;

typedef struct shared {
  const sf_measure_job *job;
  fx_cache_shape cache;
  const fx_core *core;
  sf_measure *sum;
  const uint64_t *index; /* of the rays to be checked; NULL: all rays are measured */
  uint64_t count;
  failure failed;
  uint64_t done;
  bool stopped;
} shared;

typedef struct chunk {
  fx_ray ray[ROOM];
  uint64_t tile[ROOM];
  fx_pixel pixel[ROOM];
  fx_counts counts; /* of the thread */
  fx_memory memory;
} chunk;

static void note_failure(shared *s, uint64_t ray, sf_status status)
{
#pragma omp critical(sf_measure_failure)
  if (ray < s->failed.ray) s->failed = (failure){ray, status};
}

static uint64_t ray_index(const shared *s, uint64_t i)
{
  return s->index ? s->index[i] : i;
}

static uint64_t ray_tile(const shared *s, uint64_t i)
{
  const uint64_t index = ray_index(s, i);
  return s->job->tile ? s->job->tile(s->job->user, index) : index;
}

static bool tile_begins(const shared *s, uint64_t i)
{
  return i == 0 || ray_tile(s, i) != ray_tile(s, i - 1);
}

/* The first ray of the chunk that lies in [first, limit); limit where there is none. */
static uint64_t chunk_begin(const shared *s, uint64_t first, uint64_t limit)
{
  while (first < limit && !tile_begins(s, first)) first++;
  return first;
}

/* Whether ray i belongs to the chunk that began before `limit`. */
static bool chunk_has(const shared *s, uint64_t i, uint64_t limit)
{
  return i < s->count && (i < limit || !tile_begins(s, i));
}

static uint64_t chunk_limit(const shared *s, uint64_t first, uint64_t size)
{
  return first + size < s->count ? first + size : s->count;
}

static bool make_rays(shared *s, uint64_t first, uint64_t n, chunk *c)
{
  for (uint64_t i = 0; i < n; i++) {
    const uint64_t index = ray_index(s, first + i);
    const sf_status status = s->job->ray(s->job->user, index, &c->ray[i]);
    c->tile[i] = ray_tile(s, first + i);
    if (status.code == SF_OK) continue;
    note_failure(s, index, status);
    return false;
  }
  return true;
}

static bool render_rays(shared *s, uint64_t first, uint64_t n, chunk *c)
{
  if (!make_rays(s, first, n, c)) return false;
  const sf_status status = fx_render_list(s->core, &c->memory, c->tile, c->ray, n, c->pixel, NULL, &c->counts);
  if (status.code != SF_OK) note_failure(s, ray_index(s, first), status);
  for (uint64_t i = 0; i < n && !s->index && status.code == SF_OK; i++)
    if (c->pixel[i].samples > 0) {
#pragma omp atomic
      s->sum->hit[(first + i) / 8] |= (uint8_t)(1u << (first + i) % 8);
    }
  return status.code == SF_OK;
}

/* The checked rays have been counted before. */
static void note_progress(shared *s, uint64_t rays)
{
#pragma omp critical(sf_measure_tick)
  {
    if (!s->index) s->done += rays;
    if (!s->stopped && s->job->tick && !s->job->tick(s->job->user, s->done)) {
#pragma omp atomic write
      s->stopped = true;
    }
  }
}

static bool skip_chunk(shared *s, uint64_t first)
{
  bool skip;
#pragma omp atomic read
  skip = s->stopped;
  if (skip) return true;
#pragma omp critical(sf_measure_failure)
  skip = ray_index(s, first) > s->failed.ray;
  return skip;
}

static void render_chunk(shared *s, uint64_t first, chunk *c)
{
  const uint64_t limit = chunk_limit(s, first, CHUNK);
  uint64_t at = chunk_begin(s, first, limit);
  if (at == limit) return;
  fx_memory_begin(&c->memory);
  for (uint64_t n; chunk_has(s, at, limit); at += n) {
    for (n = 1; n < ROOM && chunk_has(s, at + n, limit);) n++;
    if (skip_chunk(s, at) || !render_rays(s, at, n, c)) return;
    note_progress(s, n);
  }
}

/* The rays of s through the vector core; their counts are added to sum and memory. */
static sf_status render_all(shared *s, fx_counts *sum, fx_memory_counts *memory)
{
  s->failed = (failure){UINT64_MAX, sf_ok()};
#pragma omp parallel
  {
    chunk *c = calloc(1, sizeof *c);
    const sf_status opened =
        c ? fx_memory_open(&c->memory, s->job->scene, &s->cache) : sf_fail(SF_E_MEMORY, "audit: out of memory");
    if (opened.code != SF_OK) note_failure(s, 0, opened);
#pragma omp for schedule(dynamic)
    for (uint64_t first = 0; first < s->count; first += CHUNK)
      if (opened.code == SF_OK && !skip_chunk(s, first)) render_chunk(s, first, c);
    if (c) {
#pragma omp critical(sf_measure_merge)
      fx_counts_add(sum, &c->counts), fx_memory_counts_add(memory, &c->memory.counts);
      fx_memory_close(&c->memory);
    }
    free(c);
  }
  return s->failed.status;
}

/* ---- the checked rays: portable core, recount ---- */

/* Of one thread. */
typedef struct checker {
  sf_observer observer;
  fx_trace trace;
  fx_memory memory;
  sf_memory_recount lines;
  fx_counts core, recount;
} checker;

static sf_status checker_open(checker **checker_, const shared *s)
{
  checker *c = *checker_ = calloc(1, sizeof *c);
  if (!c) return sf_fail(SF_E_MEMORY, "audit: out of memory");
  c->observer = (sf_observer){.net = &s->job->scene->net, .trace = &c->trace, .memory = &c->memory, .lines = &c->lines};
  SF_TRY(fx_memory_open(&c->memory, s->job->scene, &s->cache));
  return sf_memory_recount_open(&c->lines, s->job->scene, &s->cache);
}

static void checker_close(checker *c)
{
  if (!c) return;
  fx_memory_close(&c->memory);
  sf_memory_recount_close(&c->lines);
  free(c);
}

static sf_status check_ray(const shared *s, uint64_t i, checker *c)
{
  const uint64_t index = ray_index(s, i);
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(s->job->ray(s->job->user, index, &ray));
  sf_status status =
      sf_observer_ray(&c->observer, s->job->scene, &ray, ray_tile(s, i), sf_observer_net, &c->observer, &pixel);
  fx_counts_add(&c->core, &c->observer.core);
  fx_counts_add(&c->recount, &c->observer.recount);
  if (status.code == SF_E_DIFFERENCE)
    return sf_fail(status.code, "ray %llu, %s", (unsigned long long)index, status.message);
  return status;
}

static void check_chunk(shared *s, uint64_t first, checker *c)
{
  const uint64_t limit = chunk_limit(s, first, CHECK_CHUNK);
  uint64_t at = chunk_begin(s, first, limit);
  if (at == limit) return;
  fx_memory_begin(&c->memory), sf_memory_recount_begin(&c->lines);
  for (; chunk_has(s, at, limit); at++) {
    if (skip_chunk(s, at)) return;
    const sf_status status = check_ray(s, at, c);
    if (status.code != SF_OK) note_failure(s, s->index[at], status);
    note_progress(s, 1);
  }
}

static sf_status check_all(shared *s)
{
  s->failed = (failure){UINT64_MAX, sf_ok()};
#pragma omp parallel
  {
    checker *c;
    const sf_status opened = checker_open(&c, s);
    if (opened.code != SF_OK) note_failure(s, 0, opened);
#pragma omp for schedule(dynamic)
    for (uint64_t first = 0; first < s->count; first += CHECK_CHUNK)
      if (opened.code == SF_OK && !skip_chunk(s, first)) check_chunk(s, first, c);
    if (opened.code == SF_OK) {
#pragma omp critical(sf_measure_merge)
      {
        fx_counts_add(&s->sum->checked_core, &c->core);
        fx_counts_add(&s->sum->recount, &c->recount);
        fx_memory_counts_add(&s->sum->checked_memory, &c->memory.counts);
      }
    }
    checker_close(c);
  }
  return s->failed.status;
}

static sf_status same_counts(const fx_counts *vector, const fx_counts *portable)
{
  SF_TRY(sf_counts_compare(vector, "vector core", portable, "portable core"));
  if (memcmp(vector, portable, sizeof *vector) == 0) return sf_ok();
  if (vector->grid_bytes != portable->grid_bytes)
    return sf_fail(SF_E_DIFFERENCE, "grid bytes: vector core %llu, portable core %llu",
                   (unsigned long long)vector->grid_bytes, (unsigned long long)portable->grid_bytes);
  return sf_fail(SF_E_DIFFERENCE, "rays, lattice points or saturations differ between vector and portable core");
}

static sf_status same_memory(const fx_memory_counts *vector, const fx_memory_counts *portable)
{
  return sf_memory_compare(vector, "vector core", portable, "portable core");
}

/* Ray i of the checked ones, alone in its block, behind the rays before it. */
static sf_status compare_ray(const shared *s, uint64_t i, fx_memory *vector, checker *c)
{
  const uint64_t tile = ray_tile(s, i);
  fx_ray ray;
  fx_pixel pixel;
  fx_counts counts = {0};
  SF_TRY(s->job->ray(s->job->user, s->index[i], &ray));
  SF_TRY(fx_render_list(s->core, vector, &tile, &ray, 1, &pixel, NULL, &counts));
  SF_TRY(check_ray(s, i, c));
  SF_TRY(same_counts(&counts, &c->observer.core));
  return same_memory(&vector->counts, &c->memory.counts);
}

/* The vector core's sums differ from the portable one's: which ray is the first? */
static sf_status find_ray(const shared *s, sf_status difference)
{
  checker *c;
  fx_memory vector = {0};
  sf_status status = checker_open(&c, s);
  if (status.code == SF_OK) status = fx_memory_open(&vector, s->job->scene, &s->cache);
  for (uint64_t i = 0; i < s->count && status.code == SF_OK; i++) {
    status = compare_ray(s, i, &vector, c);
    if (status.code == SF_E_DIFFERENCE)
      status = sf_fail(status.code, "ray %llu, %s", (unsigned long long)s->index[i], status.message);
  }
  fx_memory_close(&vector);
  checker_close(c);
  return status.code == SF_OK ? sf_fail(difference.code, "rays in blocks, %s", difference.message) : status;
}

enum { STREAM_CHECK = 16 };

static sf_status check(shared *s, uint64_t *index)
{
  fx_counts vector = {0};
  fx_memory_counts memory = {0};
  SF_TRY(sf_measure_choose(s->sum, s->job->seed, STREAM_CHECK, s->job->check, index, &s->count));
  s->index = index, s->sum->checked = s->count;
  SF_TRY(check_all(s));
  SF_TRY(render_all(s, &vector, &memory));
  if (s->stopped) return sf_fail(SF_E_STOPPED, "stopped while %llu rays were recounted", (unsigned long long)s->count);
  sf_status status = same_counts(&vector, &s->sum->checked_core);
  if (status.code == SF_OK) status = same_memory(&memory, &s->sum->checked_memory);
  return status.code == SF_E_DIFFERENCE ? find_ray(s, status) : status;
}

static sf_status measure_and_check(shared *s)
{
  const sf_measure_job *job = s->job;
  SF_TRY(render_all(s, &s->sum->core, &s->sum->memory));
  if (s->stopped)
    return sf_fail(SF_E_STOPPED, "stopped after %llu of %llu rays", (unsigned long long)s->done,
                   (unsigned long long)job->rays);
  const uint64_t limit = job->check < s->sum->core.rays ? job->check : s->sum->core.rays;
  uint64_t *index = calloc(limit + 1, sizeof *index);
  if (!index) return sf_fail(SF_E_MEMORY, "audit: out of memory for %llu rays", (unsigned long long)limit);
  const sf_status status = check(s, index);
  free(index);
  return status;
}

sf_status sf_measure_rays(const sf_measure_job *job, sf_measure *measure)
{
  *measure = (sf_measure){.rays = job->rays};
  if (job->rays > (uint64_t)1 << 36)
    return sf_fail(SF_E_RANGE, "audit: %llu rays are too many", (unsigned long long)job->rays);
  fx_core *core;
  SF_TRY(fx_core_open(&core, job->scene, NULL));
  measure->hit = calloc(job->rays / 8 + 1, 1);
  shared s = {.job = job,
              .cache = job->cache.bytes ? job->cache : sf_cache_built,
              .core = core,
              .sum = measure,
              .count = job->rays};
  sf_status status = measure->hit
                         ? measure_and_check(&s)
                         : sf_fail(SF_E_MEMORY, "audit: out of memory for %llu rays", (unsigned long long)job->rays);
  fx_core_close(core);
  if (status.code != SF_OK) sf_measure_free(measure);
  return status;
}

void sf_measure_free(sf_measure *measure)
{
  free(measure->hit);
  measure->hit = NULL;
}
