#include "spikefield/audit.h"
#include "spikefield/quant.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

void sf_probe_begin(sf_probe *probe)
{
  const fx_net *net = probe->net;
  fx_trace *trace = probe->trace;
  *probe = (sf_probe){.net = net, .trace = trace};
}

static sf_status recount_and_compare(sf_probe *probe, bool first)
{
  sf_recount_sample(probe->net, (const uint64_t(*)[SF_T_MAX][2])probe->trace->spikes, first, &probe->recount);
  if (memcmp(probe->core.layer, probe->recount.layer, sizeof probe->core.layer) == 0) return sf_ok();
  sf_status difference = sf_counts_compare(&probe->core, "core", &probe->recount, "recount");
  return sf_fail(difference.code, "sample %llu: %s", (unsigned long long)probe->sample, difference.message);
}

sf_status sf_probe_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  sf_probe *probe = user;
  if (first) fx_net_direction(probe->net, ray->dir, probe->base, &probe->core);
  fx_net_sample(probe->net, f, probe->base, out, probe->trace, &probe->core);
  if (probe->trace) SF_TRY(recount_and_compare(probe, first));
  probe->sample++;
  return sf_ok();
}

sf_status sf_pixel_ray(const fx_scene *scene, const sf_dataset *data, const sf_view *view, int x, int y, fx_ray *ray)
{
  float origin[3], direction[3];
  sf_dataset_ray(data, view, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  return sf_fx_ray_make(scene, origin, direction, ray);
}

typedef struct failure {
  uint64_t ray; /* lowest ray that failed, so that the message does not depend on the threads */
  sf_status status;
} failure;

static sf_status measure_ray(const sf_measure_job *job, uint64_t index, sf_probe *probe)
{
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(job->ray(job->user, index, &ray));
  sf_probe_begin(probe);
  sf_status status = fx_render_ray(job->scene, &ray, sf_probe_net, probe, &pixel, &probe->core);
  if (status.code == SF_E_DIFFERENCE)
    return sf_fail(status.code, "ray %llu, %s", (unsigned long long)index, status.message);
  return status;
}

static void add_ray(sf_measure *sum, const sf_probe *probe, uint64_t index)
{
  fx_counts_add(&sum->core, &probe->core);
  fx_counts_add(&sum->recount, &probe->recount);
  if (probe->core.samples == 0) return;
#pragma omp atomic
  sum->hit[index / 8] |= (uint8_t)(1u << index % 8);
}

static void merge(sf_measure *sum, const sf_measure *part)
{
  fx_counts_add(&sum->core, &part->core);
  fx_counts_add(&sum->recount, &part->recount);
}

/* Blocks of rays keep the shared counter and the tick cheap. */
enum { BLOCK = 64 };

typedef struct shared {
  const sf_measure_job *job;
  sf_measure *sum;
  failure failed;
  uint64_t done;
  bool stopped;
} shared;

static void run_block(shared *s, uint64_t block, sf_probe *probe, sf_measure *part)
{
  const sf_measure_job *job = s->job;
  uint64_t end = (block + 1) * BLOCK < job->rays ? (block + 1) * BLOCK : job->rays;
  for (uint64_t i = block * BLOCK; i < end; i++) {
    sf_status status = measure_ray(job, i, probe);
    if (status.code == SF_OK) {
      add_ray(part, probe, i);
      continue;
    }
#pragma omp critical(sf_measure_failure)
    if (i < s->failed.ray) s->failed = (failure){i, status};
    return;
  }
}

static void note_progress(shared *s, uint64_t block)
{
#pragma omp critical(sf_measure_tick)
  {
    uint64_t end = (block + 1) * BLOCK;
    s->done += end < s->job->rays ? BLOCK : s->job->rays - block * BLOCK;
    if (!s->stopped && s->job->tick && !s->job->tick(s->job->user, s->done)) {
#pragma omp atomic write
      s->stopped = true;
    }
  }
}

static bool skip_block(shared *s, uint64_t block)
{
  bool skip;
#pragma omp atomic read
  skip = s->stopped;
  if (skip) return true;
#pragma omp critical(sf_measure_failure)
  skip = block * BLOCK > s->failed.ray;
  return skip;
}

static void run_all(shared *s)
{
#pragma omp parallel
  {
    sf_probe *probe = calloc(1, sizeof *probe);
    fx_trace *trace = calloc(1, sizeof *trace);
    sf_measure *part = calloc(1, sizeof *part);
    if (probe && trace && part) {
      probe->net = &s->job->scene->net, probe->trace = trace;
      part->hit = s->sum->hit;
    } else {
#pragma omp critical(sf_measure_failure)
      s->failed = (failure){0, sf_fail(SF_E_MEMORY, "audit: out of memory")};
    }
#pragma omp for schedule(dynamic)
    for (uint64_t block = 0; block < (s->job->rays + BLOCK - 1) / BLOCK; block++) {
      if (!probe || !trace || !part || skip_block(s, block)) continue;
      run_block(s, block, probe, part);
      note_progress(s, block);
    }
    if (part) {
#pragma omp critical(sf_measure_merge)
      merge(s->sum, part);
    }
    free(probe), free(trace), free(part);
  }
}

sf_status sf_measure_rays(const sf_measure_job *job, sf_measure *measure)
{
  *measure = (sf_measure){.rays = job->rays};
  if (job->rays > (uint64_t)1 << 36)
    return sf_fail(SF_E_RANGE, "audit: %llu rays are too many", (unsigned long long)job->rays);
  measure->hit = calloc(job->rays / 8 + 1, 1);
  if (!measure->hit) return sf_fail(SF_E_MEMORY, "audit: out of memory for %llu rays", (unsigned long long)job->rays);
  shared s = {.job = job, .sum = measure, .failed = {UINT64_MAX, sf_ok()}};
  run_all(&s);
  if (s.failed.status.code != SF_OK) {
    sf_measure_free(measure);
    return s.failed.status;
  }
  if (s.stopped) {
    sf_measure_free(measure);
    return sf_fail(SF_E_STOPPED, "stopped after %llu of %llu rays", (unsigned long long)s.done,
                   (unsigned long long)job->rays);
  }
  return sf_ok();
}

void sf_measure_free(sf_measure *measure)
{
  free(measure->hit);
  measure->hit = NULL;
}
