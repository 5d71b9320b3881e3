/* A window of a view through the fixed-point core. */
#include "golden/golden.h"
#include <stdlib.h>

enum { ROWS = 4 }; /* of a block: rays enough to keep the core's block of samples full */

typedef struct picture {
  const sf_golden_job *job;
  fx_core *core;
  sf_golden *golden;
  double step_length; /* between samples, units of Z */
} picture;

typedef struct block {
  fx_ray *ray;
  fx_pixel *pixel;
  fx_cost *cost;
} block;

static sf_status render_rows(const picture *p, int y, int rows, const block *b, fx_counts *sum)
{
  const sf_golden_job *job = p->job;
  const size_t width = (size_t)job->window.width, n = width * (size_t)rows, first = width * (size_t)y;
  for (size_t i = 0; i < n; i++)
    SF_TRY(sf_pixel_ray(job->scene, job->data, job->view, job->window.x + (int)(i % width),
                        job->window.y + y + (int)(i / width), &b->ray[i]));
  SF_TRY(fx_render_rays(p->core, b->ray, n, b->pixel, b->cost, sum));
  for (size_t i = 0; i < n; i++) sf_golden_set(p->golden, first + i, &b->pixel[i], &b->cost[i], p->step_length);
  return sf_ok();
}

static sf_status render_block(const picture *p, int y, fx_counts *sum)
{
  const sf_window *window = &p->job->window;
  const int rows = window->height - y < ROWS ? window->height - y : ROWS;
  const size_t n = (size_t)window->width * (size_t)rows;
  const block b = {malloc(n * sizeof *b.ray), malloc(n * sizeof *b.pixel), malloc(n * sizeof *b.cost)};
  const sf_status status =
      b.ray && b.pixel && b.cost ? render_rows(p, y, rows, &b, sum) : sf_fail(SF_E_MEMORY, "no memory for %zu rays", n);
  free(b.ray), free(b.pixel), free(b.cost);
  return status;
}

static sf_status render_window(const picture *p)
{
  const sf_golden_job *job = p->job;
  sf_status failed = sf_ok();
  int failed_row = job->window.height;
  bool stop = false;
#pragma omp parallel for schedule(dynamic)
  for (int y = 0; y < job->window.height; y += ROWS) {
    const int rows = job->window.height - y < ROWS ? job->window.height - y : ROWS;
    fx_counts sum = {0};
    bool skip;
#pragma omp atomic read
    skip = stop;
    if (skip) continue;
    sf_status status = render_block(p, y, &sum);
#pragma omp critical(sf_golden_fixed)
    {
      if (status.code != SF_OK && y < failed_row) failed = status, failed_row = y;
      fx_counts_add(&p->golden->counts, &sum);
      if (job->tick && !stop && !job->tick(job->user, (size_t)job->window.width * (size_t)rows)) {
#pragma omp atomic write
        stop = true;
      }
    }
  }
  if (failed.code == SF_OK && stop) return sf_golden_stopped(job);
  return failed;
}

sf_status sf_golden_fixed(const sf_golden_job *job, sf_golden *golden)
{
  picture p = {.job = job, .golden = golden, .step_length = sf_golden_step_length(job)};
  SF_TRY(fx_core_open(&p.core, job->scene, job->kernels));
  const sf_status status = render_window(&p);
  fx_core_close(p.core);
  return status;
}
