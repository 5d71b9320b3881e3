/* A window of a view through the fixed-point core. */
#include "spikefield/golden.h"

typedef struct picture {
  const sf_golden_job *job;
  sf_golden *golden;
  double step_length; /* between samples, world units */
} picture;

static sf_status render_pixel(const picture *p, sf_probe *probe, int x, int y)
{
  const sf_golden_job *job = p->job;
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(sf_pixel_ray(job->scene, job->camera, job->window.x + x, job->window.y + y, &ray));
  sf_probe_begin(probe);
  SF_TRY(fx_render_ray(job->scene, &ray, sf_probe_net, probe, &pixel, &probe->core));
  sf_golden_set(p->golden, (size_t)y * (size_t)job->window.width + (size_t)x, &pixel, &probe->core, p->step_length);
  return sf_ok();
}

/* A block is one row of the window. */
static sf_status render_block(const picture *p, int y, fx_counts *sum)
{
  sf_probe probe = {.net = &p->job->scene->net};
  for (int x = 0; x < p->job->window.width; x++) {
    SF_TRY(render_pixel(p, &probe, x, y));
    fx_counts_add(sum, &probe.core);
  }
  return sf_ok();
}

sf_status sf_golden_fixed(const sf_golden_job *job, sf_golden *golden)
{
  const picture p = {job, golden, sf_golden_step_length(job)};
  sf_status failed = sf_ok();
  int failed_row = job->window.height;
  bool stop = false;
#pragma omp parallel for schedule(dynamic)
  for (int y = 0; y < job->window.height; y++) {
    fx_counts sum = {0};
    bool skip;
#pragma omp atomic read
    skip = stop;
    if (skip) continue;
    sf_status status = render_block(&p, y, &sum);
#pragma omp critical(sf_golden_fixed)
    {
      if (status.code != SF_OK && y < failed_row) failed = status, failed_row = y;
      fx_counts_add(&golden->counts, &sum);
      if (job->tick && !stop && !job->tick(job->user, (size_t)job->window.width)) {
#pragma omp atomic write
        stop = true;
      }
    }
  }
  if (failed.code == SF_OK && stop) return sf_golden_stopped(job);
  return failed;
}
