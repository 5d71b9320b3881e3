#include "energy/measuring.h"
#include "quant/quant.h"
#include <stdlib.h>

sf_status sf_pixel_ray(const fx_scene *scene, const sf_dataset *data, const sf_view *view, int x, int y, fx_ray *ray)
{
  float origin[3], direction[3];
  sf_dataset_ray(data, view, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  return sf_fx_ray_make(scene, origin, direction, ray);
}

static sf_status measure_and_check(sf_measuring *s)
{
  const sf_measure_job *job = s->job;
  SF_TRY(sf_measure_all(s));
  const sf_status status = s->stopped ? sf_fail(SF_E_STOPPED, "stopped after %llu of %llu rays",
                                                (unsigned long long)s->done, (unsigned long long)job->rays)
                                      : sf_ok();
  SF_TRY(sf_ranks_agree(job->ranks, status));
  return sf_measure_check(s);
}

sf_status sf_measure_rays(const sf_measure_job *job, sf_measure *measure)
{
  *measure = (sf_measure){.rays = job->rays};
  if (job->rays > (uint64_t)1 << 36)
    return sf_fail(SF_E_RANGE, "audit: %llu rays are too many", (unsigned long long)job->rays);
  fx_core *core;
  SF_TRY(fx_core_open(&core, job->scene, NULL));
  measure->hit = calloc(job->rays / 8 + 1, 1);
  sf_measuring s = {.job = job,
                    .cache = job->cache.bytes ? job->cache : sf_cache_built,
                    .core = core,
                    .sum = measure,
                    .hit = measure->hit,
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
