#include "sim/compare.h"
#include "sim/studio/studio.h"
#include <string.h>

enum { SAMPLES_MAX = 1024 }; /* fx_scene.max_samples */

typedef struct rtl_eval {
  sf_ray_dut *rays;
  sf_dut *dut; /* not NULL: the decoder alone */
  sf_observer core;
  sf_ray_sample sample[SAMPLES_MAX];
} rtl_eval;

static sf_status run_ray(const fx_scene *scene, const fx_ray *ray, rtl_eval *e, fx_pixel *pixel, fx_counts *rtl)
{
  sf_dut *dut = e->rays->dut;
  fx_pixel core;
  uint64_t cycles, busy, stalls;
  sf_observer_begin(&e->core);
  SF_TRY(fx_render_ray(scene, ray, sf_observer_net, &e->core, &core, &e->core.core));
  const sf_ray_request request = sf_ray_request_as(scene, ray, &core, e->sample);
  SF_TRY(sf_dut_clear_counts(dut));
  SF_TRY(sf_ray_dut_run(e->rays, &request, 1, pixel));
  SF_TRY(sf_compare_pixel(&core, pixel, sf_dut_cycle(dut)));
  SF_TRY(sf_dut_counts(dut, rtl, &cycles, &busy, &stalls));
  return sf_compare_ray_counts(e->core.net, &e->core.core, rtl);
}

/* The core's samples, the accelerator's colours. */
static sf_status run_decoder(const fx_scene *scene, const fx_ray *ray, rtl_eval *e, fx_pixel *pixel, fx_counts *rtl)
{
  fx_pixel core;
  uint64_t cycles, busy, stalls;
  sf_observer_begin(&e->core);
  SF_TRY(fx_render_ray(scene, ray, sf_observer_net, &e->core, &core, &e->core.core));
  SF_TRY(sf_dut_clear_counts(e->dut));
  SF_TRY(fx_render_ray(scene, ray, sf_dut_net, e->dut, pixel, NULL));
  SF_TRY(sf_compare_pixel(&core, pixel, sf_dut_cycle(e->dut)));
  SF_TRY(sf_dut_counts(e->dut, rtl, &cycles, &busy, &stalls));
  return sf_compare_ray_counts(e->core.net, &e->core.core, rtl);
}

static sf_status rtl_pixel(const sf_golden_job *job, rtl_eval *e, int x, int y, sf_golden *golden)
{
  fx_ray ray;
  fx_pixel pixel;
  fx_counts rtl = {0}, counts;
  SF_TRY(sf_pixel_ray(job->scene, job->data, job->view, job->window.x + x, job->window.y + y, &ray));
  SF_TRY((e->dut ? run_decoder : run_ray)(job->scene, &ray, e, &pixel, &rtl));
  counts = e->core.core;
  memcpy(counts.layer, rtl.layer, sizeof counts.layer);
  const fx_cost cost = sf_cost_of(&counts);
  sf_golden_set(golden, (size_t)y * (size_t)job->window.width + (size_t)x, &pixel, &cost, sf_golden_step_length(job));
  fx_counts_add(&golden->counts, &counts);
  return sf_ok();
}

static sf_status all_pixels(const sf_golden_job *job, rtl_eval *e, sf_golden *golden)
{
  for (int y = 0; y < job->window.height; y++)
    for (int x = 0; x < job->window.width; x++) {
      sf_status status = rtl_pixel(job, e, x, y, golden);
      if (status.code == SF_E_DIFFERENCE)
        return sf_fail(status.code, "pixel (%d, %d) of view %s, %s", job->window.x + x, job->window.y + y,
                       job->view->name, status.message);
      SF_TRY(status);
      if (job->tick && !job->tick(job->user, 1)) return sf_golden_stopped(job);
    }
  return sf_ok();
}

sf_status sf_golden_rtl(const sf_golden_job *job, sf_ray_dut *rays, sf_golden *golden)
{
  rtl_eval e = {.rays = rays, .core = {.net = &job->scene->net}};
  return all_pixels(job, &e, golden);
}

sf_status sf_golden_decoder(const sf_golden_job *job, sf_dut *dut, sf_golden *golden)
{
  rtl_eval e = {.dut = dut, .core = {.net = &job->scene->net}};
  return all_pixels(job, &e, golden);
}
