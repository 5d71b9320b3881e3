/* The checked rays of an audit: portable core, recount. */
#include "energy/measuring.h"
#include <stdlib.h>
#include <string.h>

enum { STREAM_CHECK = 16, CHECK_CHUNK = 16 };

/* Of one thread. */
typedef struct checker {
  sf_observer observer;
  fx_trace trace;
  fx_memory memory;
  sf_memory_recount lines;
  fx_counts core, recount;
} checker;

static sf_status checker_open(checker **checker_, const sf_measuring *s)
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

static sf_status check_ray(const sf_measuring *s, uint64_t i, checker *c)
{
  const uint64_t index = sf_measure_index(s, i);
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(s->job->ray(s->job->user, index, &ray));
  sf_status status =
      sf_observer_ray(&c->observer, s->job->scene, &ray, sf_measure_tile(s, i), sf_observer_net, &c->observer, &pixel);
  fx_counts_add(&c->core, &c->observer.core);
  fx_counts_add(&c->recount, &c->observer.recount);
  if (status.code == SF_E_DIFFERENCE)
    return sf_fail(status.code, "ray %llu, %s", (unsigned long long)index, status.message);
  return status;
}

static void check_chunk(sf_measuring *s, uint64_t first, checker *c)
{
  const uint64_t limit = sf_measure_limit(s, first, CHECK_CHUNK);
  uint64_t at = sf_measure_begin(s, first, limit);
  if (at == limit) return;
  fx_memory_begin(&c->memory), sf_memory_recount_begin(&c->lines);
  for (; sf_measure_has(s, at, limit); at++) {
    if (sf_measure_skips(s, at)) return;
    const sf_status status = check_ray(s, at, c);
    if (status.code != SF_OK) sf_measure_fail(s, s->index[at], status);
    sf_measure_progress(s, 1);
  }
}

/* Counts of checked rays. */
typedef struct sums {
  fx_counts core, recount;
  fx_memory_counts memory;
} sums;

static sf_status check_list(sf_measuring *s, uint64_t from, uint64_t end, sums *sum)
{
  s->failed = (sf_measure_failure){UINT64_MAX, sf_ok()};
#pragma omp parallel
  {
    checker *c;
    const sf_status opened = checker_open(&c, s);
    if (opened.code != SF_OK) sf_measure_fail(s, 0, opened);
#pragma omp for schedule(dynamic)
    for (uint64_t first = from; first < end; first += CHECK_CHUNK)
      if (opened.code == SF_OK && !sf_measure_skips(s, first)) check_chunk(s, first, c);
    if (opened.code == SF_OK) {
#pragma omp critical(sf_measure_merge)
      {
        fx_counts_add(&sum->core, &c->core);
        fx_counts_add(&sum->recount, &c->recount);
        fx_memory_counts_add(&sum->memory, &c->memory.counts);
      }
    }
    checker_close(c);
  }
  return s->failed.status;
}

/* ---- by ranks ---- */

enum { SLICE = 4 * CHECK_CHUNK };

typedef struct slice {
  sums sum;
  sf_measure_outcome outcome;
} slice;

static void add_sums(sf_measure *to, const sums *sum)
{
  fx_counts_add(&to->checked_core, &sum->core);
  fx_counts_add(&to->recount, &sum->recount);
  fx_memory_counts_add(&to->checked_memory, &sum->memory);
}

static void check_slice(void *measuring, uint64_t unit, void *result)
{
  sf_measuring part = *(const sf_measuring *)measuring;
  slice *to = result;
  check_list(&part, unit * SLICE, sf_measure_limit(&part, unit * SLICE, SLICE), &to->sum);
  to->outcome = sf_measure_came(&part);
}

static bool add_slice(void *measuring, uint64_t unit, const void *result)
{
  sf_measuring *s = measuring;
  const slice *from = result;
  (void)unit;
  add_sums(s->sum, &from->sum);
  return sf_measure_took(s, &from->outcome);
}

static sf_status check_all(sf_measuring *s)
{
  sums sum = {0};
  if (sf_ranks_size(s->job->ranks) > 1) return sf_measure_deal(s, SLICE, sizeof(slice), check_slice, add_slice);
  const sf_status status = check_list(s, 0, s->count, &sum);
  add_sums(s->sum, &sum);
  return status;
}

/* ---- the vector core's sums ---- */

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
static sf_status compare_ray(const sf_measuring *s, uint64_t i, fx_memory *vector, checker *c)
{
  const uint64_t tile = sf_measure_tile(s, i);
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
static sf_status find_ray(const sf_measuring *s, sf_status difference)
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

/* On rank 0. */
static sf_status compare_sums(sf_measuring *s)
{
  fx_counts vector = {0};
  fx_memory_counts memory = {0};
  SF_TRY(sf_measure_list(s, 0, s->count, &vector, &memory));
  if (s->stopped) return sf_fail(SF_E_STOPPED, "stopped while %llu rays were recounted", (unsigned long long)s->count);
  sf_status status = same_counts(&vector, &s->sum->checked_core);
  if (status.code == SF_OK) status = same_memory(&memory, &s->sum->checked_memory);
  return status.code == SF_E_DIFFERENCE ? find_ray(s, status) : status;
}

/* index[limit + 1]: of the rays, chosen where they are known. */
static sf_status choose(sf_measuring *s, uint64_t limit, uint64_t *index)
{
  sf_ranks *ranks = s->job->ranks;
  sf_status status = sf_ok();
  if (!sf_ranks_rank(ranks)) status = sf_measure_choose(s->sum, s->job->seed, STREAM_CHECK, limit, index, &s->count);
  SF_TRY(sf_ranks_agree(ranks, status));
  SF_TRY(sf_ranks_broadcast(ranks, &s->count, sizeof s->count));
  s->index = index, s->sum->checked = s->count;
  return sf_ranks_broadcast(ranks, index, (size_t)s->count * sizeof *index);
}

static sf_status check(sf_measuring *s, uint64_t limit, uint64_t *index)
{
  SF_TRY(choose(s, limit, index));
  SF_TRY(check_all(s));
  return sf_ranks_agree(s->job->ranks, sf_ranks_rank(s->job->ranks) ? sf_ok() : compare_sums(s));
}

sf_status sf_measure_check(sf_measuring *s)
{
  uint64_t limit = s->job->check < s->sum->core.rays ? s->job->check : s->sum->core.rays;
  SF_TRY(sf_ranks_broadcast(s->job->ranks, &limit, sizeof limit));
  uint64_t *index = calloc(limit + 1, sizeof *index);
  const sf_status there =
      index ? sf_ok() : sf_fail(SF_E_MEMORY, "audit: out of memory for %llu rays", (unsigned long long)limit);
  sf_status status = sf_ranks_agree(s->job->ranks, there);
  if (status.code == SF_OK) status = check(s, limit, index);
  free(index);
  s->index = NULL;
  return status;
}
