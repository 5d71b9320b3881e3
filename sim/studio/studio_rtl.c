#include "sim/compare.h"
#include "sim/studio/studio.h"
#include <string.h>

typedef struct rtl_eval {
  sf_ray_dut *rays;
  fx_memory memory;
  sf_memory_recount lines;
  sf_observer core;
  sf_ray_sample sample[SF_RAY_SAMPLES_MAX];
} rtl_eval;

static sf_status run_ray(const fx_scene *scene, const fx_ray *ray, uint64_t tile, rtl_eval *e, fx_pixel *pixel,
                         fx_counts *rtl)
{
  sf_dut *dut = e->rays->dut;
  sf_field_counters field;
  fx_pixel core;
  uint64_t cycles, busy, stalls;
  SF_TRY(sf_observer_ray(&e->core, scene, ray, tile, sf_observer_net, &e->core, &core));
  sf_ray_request request = sf_ray_request_as(scene, ray, &core, e->sample);
  request.new_tile = sf_ray_dut_new_tile(e->rays, tile);
  SF_TRY(sf_dut_clear_counts(dut));
  SF_TRY(sf_ray_dut_run(e->rays, &request, 1, pixel));
  SF_TRY(sf_compare_pixel(&core, pixel, sf_dut_cycle(dut)));
  SF_TRY(sf_dut_counts(dut, rtl, &cycles, &busy, &stalls));
  SF_TRY(sf_compare_ray_counts(e->core.net, &e->core.core, rtl));
  SF_TRY(sf_ray_dut_field(e->rays, &field));
  return sf_compare_field(&e->memory.counts, &field);
}

static sf_status rtl_pixel(const sf_golden_job *job, rtl_eval *e, int x, int y, sf_golden *golden)
{
  fx_ray ray;
  fx_pixel pixel;
  fx_counts rtl = {0}, counts;
  const int across = job->window.x + x, down = job->window.y + y;
  const uint64_t tile = sf_tile_number(across, down);
  SF_TRY(sf_pixel_ray(job->scene, job->data, job->view, across, down, &ray));
  SF_TRY(run_ray(job->scene, &ray, tile, e, &pixel, &rtl));
  counts = e->core.core;
  memcpy(counts.layer, rtl.layer, sizeof counts.layer);
  const fx_cost cost = sf_cost_of(&counts);
  sf_golden_set(golden, (size_t)y * (size_t)job->window.width + (size_t)x, &pixel, &cost, sf_golden_step_length(job));
  fx_counts_add(&golden->counts, &counts);
  return sf_ok();
}

static sf_status named_pixel(const sf_golden_job *job, rtl_eval *e, int x, int y, sf_golden *golden)
{
  const sf_status status = rtl_pixel(job, e, x, y, golden);
  if (status.code == SF_E_DIFFERENCE)
    return sf_fail(status.code, "pixel (%d, %d) of view %s, %s", job->window.x + x, job->window.y + y, job->view->name,
                   status.message);
  SF_TRY(status);
  return job->tick && !job->tick(job->user, 1) ? sf_golden_stopped(job) : sf_ok();
}

static sf_status pixels_of_tile(const sf_golden_job *job, const sf_window *tile, void *user, sf_golden *golden)
{
  for (int y = tile->y; y < tile->y + tile->height; y++)
    for (int x = tile->x; x < tile->x + tile->width; x++) SF_TRY(named_pixel(job, user, x, y, golden));
  return sf_ok();
}

sf_status sf_golden_rtl(const sf_golden_job *job, sf_ray_dut *rays, sf_golden *golden)
{
  rtl_eval e = {.rays = rays, .core = {.net = &job->scene->net, .memory = &e.memory, .lines = &e.lines}};
  const fx_cache_shape cache = sf_ray_dut_cache(rays);
  sf_status status = fx_memory_open(&e.memory, job->scene, &cache);
  if (status.code == SF_OK) status = sf_memory_recount_open(&e.lines, job->scene, &cache);
  if (status.code == SF_OK) {
    rays->in_tile = false;
    sf_ray_driver_clear(sf_dut_driver_bus(rays->dut));
    status = sf_each_tile(job, pixels_of_tile, &e, golden);
  }
  fx_memory_close(&e.memory), sf_memory_recount_close(&e.lines);
  return status;
}
