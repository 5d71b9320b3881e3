#include "sim/studio.h"
#include <string.h>

typedef struct rtl_eval {
  sf_dut *dut;
  sf_probe core;
} rtl_eval;

static sf_status rtl_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  rtl_eval *e = user;
  fx_out core;
  unsigned long long sample = e->core.sample;
  SF_TRY(sf_probe_net(&e->core, ray, first, f, &core));
  SF_TRY(sf_dut_net(e->dut, ray, first, f, out));
  const uint32_t expected[4] = {core.sigma, core.colour[0], core.colour[1], core.colour[2]};
  const uint32_t actual[4] = {out->sigma, out->colour[0], out->colour[1], out->colour[2]};
  static const char *const name[4] = {"density", "red", "green", "blue"};
  for (int i = 0; i < 4; i++)
    if (expected[i] != actual[i])
      return sf_fail(SF_E_DIFFERENCE, "sample %llu: %s is %u in the core, %u in the accelerator, cycle %llu", sample,
                     name[i], expected[i], actual[i], (unsigned long long)sf_dut_cycle(e->dut));
  return sf_ok();
}

static sf_status rtl_pixel(const sf_golden_job *job, rtl_eval *e, int x, int y, sf_golden *golden)
{
  fx_ray ray;
  fx_pixel pixel;
  fx_counts rtl = {0}, counts;
  uint64_t cycles, busy, stalls;
  SF_TRY(sf_pixel_ray(job->scene, job->camera, job->window.x + x, job->window.y + y, &ray));
  sf_probe_begin(&e->core);
  SF_TRY(sf_dut_clear_counts(e->dut));
  SF_TRY(fx_render_ray(job->scene, &ray, rtl_net, e, &pixel, &e->core.core));
  if (pixel.samples > 0) SF_TRY(sf_dut_counts(e->dut, &rtl, &cycles, &busy, &stalls));
  SF_TRY(sf_counts_compare(&e->core.core, "core", &rtl, "accelerator"));
  counts = e->core.core;
  memcpy(counts.layer, rtl.layer, sizeof counts.layer);
  const fx_cost cost = sf_cost_of(&counts);
  sf_golden_set(golden, (size_t)y * (size_t)job->window.width + (size_t)x, &pixel, &cost, sf_golden_step_length(job));
  fx_counts_add(&golden->counts, &counts);
  return sf_ok();
}

sf_status sf_golden_rtl(const sf_golden_job *job, sf_dut *dut, sf_golden *golden)
{
  rtl_eval e = {.dut = dut, .core = {.net = &job->scene->net}};
  for (int y = 0; y < job->window.height; y++)
    for (int x = 0; x < job->window.width; x++) {
      sf_status status = rtl_pixel(job, &e, x, y, golden);
      if (status.code == SF_E_DIFFERENCE)
        return sf_fail(status.code, "pixel (%d, %d) of view %s, %s", job->window.x + x, job->window.y + y, job->view,
                       status.message);
      SF_TRY(status);
      if (job->tick && !job->tick(job->user, 1)) return sf_golden_stopped(job);
    }
  return sf_ok();
}
