#include "sim/ray/ray.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { PATIENCE = 200000, QUIET = 16, STREAM_RAYS = 40, STREAM_PIXELS };
static const sf_error_source ray_error = {SF_CSR_RAY_ERROR, sf_ray_driver_error_text};

sf_status sf_ray_dut_load(sf_ray_dut *rays)
{
  sf_dut *dut = rays->dut;
  rays->in_tile = false;
  const sf_ray_blob blob = sf_ray_blob_of(rays->scene, rays->memory.base);
  SF_TRY(sf_dut_load(dut, &rays->scene->net));
  const sf_planes_blob planes = sf_ray_planes_of(&rays->scene->tensorf);
  const bool tensorf = rays->scene->backbone == FX_TENSORF;
  const sf_driver_code code = sf_ray_driver_load(sf_dut_driver_bus(dut), &blob, tensorf ? &planes : NULL);
  if (code == SF_DRIVER_OK) dut->bus.write(dut->bus.context, SF_CSR_RAY_IRQ_ENABLE, ~0u);
  return sf_dut_driver_status(dut, code, "load rays", &ray_error);
}

sf_status sf_ray_dut_open(sf_ray_dut **out, const fx_scene *scene, const sf_dut_options *options)
{
  *out = NULL;
  sf_ray_dut *rays = calloc(1, sizeof *rays);
  if (!rays) return sf_fail(SF_E_MEMORY, "accelerator: out of memory");
  rays->scene = scene;
  sf_status status = sf_dut_open_pins(&rays->dut, options, sf_pins_open_rays);
  if (status.code == SF_OK) {
    rays->memory =
        (sf_memory){.dut = rays->dut, .base = sf_memory_base(options->seed), .latency = options->memory_latency};
    status = sf_memory_fill(&rays->memory, scene);
    rays->dut->each_cycle = sf_memory_cycle, rays->dut->each_cycle_context = &rays->memory;
    if (status.code == SF_OK) status = sf_ray_dut_load(rays);
  }
  if (status.code == SF_OK)
    *out = rays;
  else
    sf_ray_dut_close(rays);
  return status;
}

void sf_ray_dut_close(sf_ray_dut *rays)
{
  if (!rays) return;
  sf_dut_close(rays->dut);
  free(rays->memory.planes);
  free(rays);
}

bool sf_ray_dut_new_tile(sf_ray_dut *rays, uint64_t tile)
{
  const bool same = rays->in_tile && rays->tile == tile;
  rays->in_tile = true, rays->tile = tile;
  return !same;
}

fx_cache_shape sf_ray_dut_cache(sf_ray_dut *rays)
{
  uint32_t bytes, ways;
  sf_ray_driver_cache(sf_dut_driver_bus(rays->dut), &bytes, &ways);
  return (fx_cache_shape){(int32_t)bytes, (int32_t)ways};
}

sf_status sf_ray_dut_field(sf_ray_dut *rays, sf_field_counters *field)
{
  sf_ray_driver_field(sf_dut_driver_bus(rays->dut), field);
  return sf_dut_driver_status(rays->dut, SF_DRIVER_OK, "counters of the field", &ray_error);
}

typedef struct run {
  sf_dut *dut;
  const sf_memory *memory;
  const sf_ray_request *request;
  fx_pixel *pixel;
  int n, sent, at;
  uint64_t progress; /* cycle of the last beat */
  bool waits;        /* a pixel was shown and not taken */
  uint64_t waiting[6];
} run;

static void offer(run *r)
{
  sf_pins_in *in = &r->dut->in;
  if (in->ray_valid || r->sent == r->n || sf_dut_stalls(r->dut, STREAM_RAYS)) return;
  const sf_ray_request *request = &r->request[r->sent];
  if (request->stops && r->at == request->n && r->dut->received <= r->sent) return; /* its pixel comes first */
  in->ray_valid = true;
  const sf_ray_beat beat = sf_ray_beat_of(request, r->at);
  memcpy(in->ray_data, beat.data, sizeof in->ray_data);
  in->ray_user = beat.user, in->ray_last = beat.last;
}

static void accept_input(run *r)
{
  if (!r->dut->in.ray_valid || !r->dut->out.ray_ready) return;
  r->dut->in.ray_valid = false;
  r->progress = r->dut->cycle;
  if (!r->dut->in.ray_last) {
    r->at++;
    return;
  }
  r->at = 0;
  r->sent++;
}

/* A pixel that is shown stays as it is until it is taken, as AXI4-Stream demands. */
static sf_status check_stable(run *r)
{
  const sf_pins_out *out = &r->dut->out;
  if (r->waits && (!out->pixel_valid || memcmp(out->pixel_data, r->waiting, sizeof r->waiting)))
    return sf_fail(SF_E_DIFFERENCE, "accelerator: pixel changed before it was taken at cycle %" PRIu64, r->dut->cycle);
  r->waits = out->pixel_valid && !r->dut->in.pixel_ready;
  memcpy(r->waiting, out->pixel_data, sizeof r->waiting);
  return sf_ok();
}

static sf_status accept_pixel(run *r)
{
  const sf_pins_out *out = &r->dut->out;
  SF_TRY(check_stable(r));
  if (!r->dut->in.pixel_ready || !out->pixel_valid) return sf_ok();
  if (r->dut->received == r->sent + (r->at > 0))
    return sf_fail(SF_E_DIFFERENCE, "accelerator: pixel without a ray at cycle %" PRIu64, r->dut->cycle);
  r->pixel[r->dut->received++] = sf_ray_pixel_of(out->pixel_data);
  r->progress = r->dut->cycle;
  return sf_ok();
}

static sf_status trouble(run *r, const char *what)
{
  sf_dut *dut = r->dut;
  const uint64_t cycle = dut->cycle;
  dut->in.ray_valid = dut->in.pixel_ready = false;
  const char *error = sf_dut_error_text(dut, &sf_dut_error), *of_rays = sf_dut_error_text(dut, &ray_error);
  return sf_fail(SF_E_DIFFERENCE, "accelerator: %s at cycle %" PRIu64 ", %d of %d rays in, %d pixels out: %s; rays: %s",
                 what, cycle, r->sent, r->n, r->dut->received, error, of_rays);
}

static sf_status step(run *r)
{
  sf_dut *dut = r->dut;
  offer(r);
  dut->in.pixel_ready = !sf_dut_stalls(dut, STREAM_PIXELS);
  sf_dut_tick(dut);
  if (dut->out.finished)
    return sf_fail(SF_E_DIFFERENCE, "accelerator: the simulation ended by itself at cycle %" PRIu64, dut->cycle);
  accept_input(r);
  SF_TRY(accept_pixel(r));
  if (dut->out.irq) return trouble(r, "interrupt");
  if (r->memory->fault) return trouble(r, r->memory->fault);
  if (r->memory->outside) return trouble(r, "line beyond the field");
  return dut->cycle - r->progress > PATIENCE ? trouble(r, "hang") : sf_ok();
}

static sf_status quiet(sf_dut *dut, int cycles)
{
  const sf_pins_out *out = &dut->out;
  const char *what = NULL;
  dut->in.pixel_ready = true;
  for (; cycles > 0 && !what; cycles--) {
    sf_dut_tick(dut);
    what = out->finished ? "end of the simulation" : out->pixel_valid ? "pixel" : out->irq ? "interrupt" : NULL;
  }
  dut->in.pixel_ready = false;
  if (!what) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "accelerator: %s without a ray at cycle %" PRIu64, what, dut->cycle);
}

sf_status sf_ray_dut_stream(sf_ray_dut *rays, const sf_ray_request *request, int n, fx_pixel *pixel)
{
  sf_dut *dut = rays->dut;
  sf_status status = sf_ok();
  run r = {.dut = dut, .memory = &rays->memory, .request = request, .pixel = pixel, .n = n, .progress = dut->cycle};
  dut->received = 0;
  while ((dut->received < n || r.sent < n) && status.code == SF_OK) status = step(&r);
  dut->in.ray_valid = dut->in.pixel_ready = false;
  return status;
}

sf_status sf_ray_dut_run(sf_ray_dut *rays, const sf_ray_request *request, int n, fx_pixel *pixel)
{
  sf_pins_dump(rays->dut->pins);
  SF_TRY(quiet(rays->dut, 1));
  SF_TRY(sf_ray_dut_stream(rays, request, n, pixel));
  return quiet(rays->dut, QUIET);
}
