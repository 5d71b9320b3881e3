#include "energy/energy.h"
#include "quant/quant.h"
#include "base/rng.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

void sf_observer_begin(sf_observer *observer)
{
  const fx_net *net = observer->net;
  fx_trace *trace = observer->trace;
  *observer = (sf_observer){.net = net, .trace = trace};
}

static sf_status recount_and_compare(sf_observer *observer, bool first)
{
  sf_recount_sample(observer->net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])observer->trace->spikes, first,
                    &observer->recount);
  if (memcmp(observer->core.layer, observer->recount.layer, sizeof observer->core.layer) == 0) return sf_ok();
  sf_status difference = sf_counts_compare(&observer->core, "core", &observer->recount, "recount");
  return sf_fail(difference.code, "sample %llu: %s", (unsigned long long)observer->sample, difference.message);
}

sf_status sf_observer_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  sf_observer *observer = user;
  fx_net_next(observer->net, ray->dir, first, f, observer->base, out, observer->trace, &observer->core);
  if (observer->trace) SF_TRY(recount_and_compare(observer, first));
  observer->sample++;
  return sf_ok();
}

sf_status sf_pixel_ray(const fx_scene *scene, const sf_dataset *data, const sf_view *view, int x, int y, fx_ray *ray)
{
  float origin[3], direction[3];
  sf_dataset_ray(data, view, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  return sf_fx_ray_make(scene, origin, direction, ray);
}

/* ---- all rays, vector core ---- */

/* Rays of one call: enough to keep the core's blocks full, few enough to share out among threads. */
enum { CHUNK = 1600 };

typedef struct failure {
  uint64_t ray; /* lowest ray that failed, so that the message does not depend on the threads */
  sf_status status;
} failure;

typedef struct shared {
  const sf_measure_job *job;
  const fx_core *core;
  sf_measure *sum;
  const uint64_t *index; /* of the rays to be checked; NULL: all rays are measured */
  uint64_t count;
  failure failed;
  uint64_t done;
  bool stopped;
} shared;

typedef struct chunk {
  fx_ray ray[CHUNK];
  fx_pixel pixel[CHUNK];
  fx_counts counts; /* of the thread */
} chunk;

static void note_failure(shared *s, uint64_t ray, sf_status status)
{
#pragma omp critical(sf_measure_failure)
  if (ray < s->failed.ray) s->failed = (failure){ray, status};
}

static uint64_t chunk_end(const shared *s, uint64_t first)
{
  return first + CHUNK < s->count ? first + CHUNK : s->count;
}

static uint64_t ray_index(const shared *s, uint64_t i)
{
  return s->index ? s->index[i] : i;
}

static void render_chunk(shared *s, uint64_t first, chunk *c)
{
  const uint64_t n = chunk_end(s, first) - first;
  for (uint64_t i = 0; i < n; i++) {
    const uint64_t index = ray_index(s, first + i);
    const sf_status status = s->job->ray(s->job->user, index, &c->ray[i]);
    if (status.code == SF_OK) continue;
    note_failure(s, index, status);
    return;
  }
  const sf_status status = fx_render_rays(s->core, c->ray, n, c->pixel, NULL, &c->counts);
  if (status.code != SF_OK) note_failure(s, ray_index(s, first), status);
  for (uint64_t i = 0; i < n && !s->index && status.code == SF_OK; i++)
    if (c->pixel[i].samples > 0) {
#pragma omp atomic
      s->sum->hit[(first + i) / 8] |= (uint8_t)(1u << (first + i) % 8);
    }
}

/* The checked rays have been counted before. */
static void note_progress(shared *s, uint64_t first)
{
#pragma omp critical(sf_measure_tick)
  {
    if (!s->index) s->done += chunk_end(s, first) - first;
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

/* The rays of s through the vector core; their counts are added to sum. */
static sf_status render_all(shared *s, fx_counts *sum)
{
  s->failed = (failure){UINT64_MAX, sf_ok()};
#pragma omp parallel
  {
    chunk *c = calloc(1, sizeof *c);
    if (!c) note_failure(s, 0, sf_fail(SF_E_MEMORY, "audit: out of memory"));
#pragma omp for schedule(dynamic)
    for (uint64_t first = 0; first < s->count; first += CHUNK) {
      if (!c || skip_chunk(s, first)) continue;
      render_chunk(s, first, c);
      note_progress(s, first);
    }
    if (c) {
#pragma omp critical(sf_measure_merge)
      fx_counts_add(sum, &c->counts);
    }
    free(c);
  }
  return s->failed.status;
}

/* ---- the checked rays: portable core, recount ---- */

static sf_status check_ray(const sf_measure_job *job, uint64_t index, sf_observer *observer)
{
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(job->ray(job->user, index, &ray));
  sf_observer_begin(observer);
  sf_status status = fx_render_ray(job->scene, &ray, sf_observer_net, observer, &pixel, &observer->core);
  if (status.code == SF_E_DIFFERENCE)
    return sf_fail(status.code, "ray %llu, %s", (unsigned long long)index, status.message);
  return status;
}

static sf_status check_all(shared *s)
{
  s->failed = (failure){UINT64_MAX, sf_ok()};
#pragma omp parallel
  {
    sf_observer *observer = calloc(1, sizeof *observer);
    fx_trace *trace = calloc(1, sizeof *trace);
    sf_measure *part = calloc(1, sizeof *part);
    const bool memory = observer && trace && part;
    if (memory)
      observer->net = &s->job->scene->net, observer->trace = trace;
    else
      note_failure(s, 0, sf_fail(SF_E_MEMORY, "audit: out of memory"));
#pragma omp for schedule(dynamic, 16)
    for (uint64_t i = 0; i < s->count; i++) {
      if (!memory || skip_chunk(s, i)) continue;
      const sf_status status = check_ray(s->job, s->index[i], observer);
      if (status.code != SF_OK) note_failure(s, s->index[i], status);
      fx_counts_add(&part->checked_core, &observer->core);
      fx_counts_add(&part->recount, &observer->recount);
      note_progress(s, i);
    }
    if (memory) {
#pragma omp critical(sf_measure_merge)
      {
        fx_counts_add(&s->sum->checked_core, &part->checked_core);
        fx_counts_add(&s->sum->recount, &part->recount);
      }
    }
    free(observer), free(trace), free(part);
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

/* The vector core's sums differ from the portable one's: which ray is the first? */
static sf_status find_ray(const shared *s, sf_status difference)
{
  for (uint64_t i = 0; i < s->count; i++) {
    fx_ray ray;
    fx_pixel pixel;
    fx_counts vector = {0}, portable = {0};
    SF_TRY(s->job->ray(s->job->user, s->index[i], &ray));
    SF_TRY(fx_render_rays(s->core, &ray, 1, &pixel, NULL, &vector));
    SF_TRY(fx_render_ray(s->job->scene, &ray, NULL, NULL, &pixel, &portable));
    const sf_status status = same_counts(&vector, &portable);
    if (status.code != SF_OK)
      return sf_fail(status.code, "ray %llu, %s", (unsigned long long)s->index[i], status.message);
  }
  return sf_fail(difference.code, "rays in blocks, %s", difference.message);
}

static int ascending(const void *a, const void *b)
{
  const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
  return x < y ? -1 : x > y;
}

enum { STREAM_CHECK = 16 };

static sf_status check(shared *s, uint64_t *index)
{
  fx_counts vector = {0};
  SF_TRY(sf_measure_choose(s->sum, s->job->seed, STREAM_CHECK, s->job->check, index, &s->count));
  s->index = index, s->sum->checked = s->count;
  SF_TRY(check_all(s));
  SF_TRY(render_all(s, &vector));
  if (s->stopped) return sf_fail(SF_E_STOPPED, "stopped while %llu rays were recounted", (unsigned long long)s->count);
  const sf_status status = same_counts(&vector, &s->sum->checked_core);
  return status.code == SF_E_DIFFERENCE ? find_ray(s, status) : status;
}

static sf_status measure_and_check(shared *s)
{
  const sf_measure_job *job = s->job;
  SF_TRY(render_all(s, &s->sum->core));
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
  shared s = {.job = job, .core = core, .sum = measure, .count = job->rays};
  sf_status status = measure->hit
                         ? measure_and_check(&s)
                         : sf_fail(SF_E_MEMORY, "audit: out of memory for %llu rays", (unsigned long long)job->rays);
  fx_core_close(core);
  if (status.code != SF_OK) sf_measure_free(measure);
  return status;
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

void sf_measure_free(sf_measure *measure)
{
  free(measure->hit);
  measure->hit = NULL;
}
