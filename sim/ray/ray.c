#include "sim/ray/ray.h"
#include "fx/tensorf.h"
#include "quant/quant.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { PATIENCE = 200000, QUIET = 16, STREAM_RAYS = 40, STREAM_PIXELS };
static const sf_error_source ray_error = {SF_CSR_RAY_ERROR, sf_ray_driver_error_text};

static sf_ray_blob blob_of(const fx_scene *scene, uint32_t base)
{
  const fx_grid *grid = &scene->grid;
  sf_ray_blob blob = {.levels = (uint32_t)grid->levels,
                      .n_dir = (uint32_t)fx_net_constants(&scene->net),
                      .dir_frac = (uint32_t)sf_fx_dir_frac(scene),
                      .trans_stop = (uint32_t)scene->trans_stop,
                      .max_samples = (uint32_t)scene->max_samples,
                      .table = base};
  for (int l = 0; l < grid->levels; l++)
    blob.level[l] =
        (sf_ray_level_blob){(uint32_t)grid->scale_q16[l], (uint32_t)grid->stride[l], (uint32_t)grid->log2_size[l],
                            (uint32_t)grid->offset[l], (uint32_t)grid->shift[l]};
  for (int o = 0; o < 3; o++) blob.background[o] = (uint32_t)scene->background[o];
  return blob;
}

sf_planes_blob sf_ray_planes(const fx_tensorf *field)
{
  const fx_scale *scale[SF_PLANES_SCALES] = {&field->density_in, &field->sigma_out, &field->feature_in,
                                             &field->phase_in};
  fx_factor_place place[2 * FX_PAIRS];
  sf_planes_blob blob = {.relu = field->activation == FX_RELU,
                         .weight_stop = (uint32_t)field->weight_stop,
                         .features = (uint32_t)field->features,
                         .feature_freqs = (uint32_t)field->feature_freqs,
                         .view_freqs = (uint32_t)field->view_freqs,
                         .frac = (uint32_t)field->encoding_frac,
                         .bias = field->density_in.bias,
                         .basis = field->basis};
  fx_tensorf_places(field, place);
  for (int i = 0; i < SF_PLANES_SCALES; i++)
    blob.scale[i] = (sf_planes_scale_blob){(uint32_t)scale[i]->mul, (uint32_t)scale[i]->shift};
  for (int i = 0; i < SF_PLANES_ARRAYS; i++)
    blob.array[i] = (sf_planes_array_blob){place[i].plane, place[i].line, place[i].point_lines};
  for (int axis = 0; axis < 3; axis++) {
    blob.res[axis] = (uint32_t)field->res[axis];
    blob.components[axis] = (uint32_t)field->appearance.components[axis];
  }
  return blob;
}

sf_status sf_ray_dut_load(sf_ray_dut *rays)
{
  sf_dut *dut = rays->dut;
  rays->in_tile = false;
  const sf_ray_blob blob = blob_of(rays->scene, rays->memory.base);
  SF_TRY(sf_dut_load(dut, &rays->scene->net));
  const sf_planes_blob planes = sf_ray_planes(&rays->scene->tensorf);
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

void sf_ray_samples(const fx_scene *scene, const fx_ray *ray, sf_ray_sample *sample, int n)
{
  int32_t at = -1;
  for (int i = 0; i < n; i++) {
    at = fx_march_next(scene, ray, at + 1, sample[i].pos, NULL);
    sample[i].delta_q24 = fx_delta(scene, at);
    sample[i].distance_q16 = fx_distance(scene, ray, at);
  }
}

/* Samples of TensoRF's up to where the ray ends, and *behind: those behind it whose density is read as well. */
static int densities(const fx_scene *scene, const fx_ray *ray, int *behind)
{
  fx_pixel pixel;
  uint32_t pos[3];
  int n = 0;
  bool ended = false;
  *behind = 0;
  fx_composite_begin(&pixel);
  for (int32_t at = fx_march_next(scene, ray, 0, pos, NULL);
       at >= 0 && n + *behind < SF_RAY_SAMPLES_MAX && *behind < FX_AHEAD;
       at = fx_march_next(scene, ray, at + 1, pos, NULL)) {
    if (ended) {
      ++*behind;
      continue;
    }
    pixel.samples += fx_tensorf_weight(scene, &fx_vm_portable, ray, at, pos, &pixel, NULL) > 0;
    n++;
    ended = pixel.transmittance <= (uint32_t)scene->trans_stop || pixel.samples >= (uint32_t)scene->max_samples;
  }
  return n;
}

sf_ray_request sf_ray_request_as(const fx_scene *scene, const fx_ray *ray, const fx_pixel *core, sf_ray_sample *sample)
{
  const bool ends = core->transmittance <= (uint32_t)scene->trans_stop || core->samples >= (uint32_t)scene->max_samples;
  int behind = FX_AHEAD;
  const int n = scene->backbone == FX_INGP ? (int)core->samples : densities(scene, ray, &behind) + behind;
  const bool stops = ends && behind == FX_AHEAD; /* a ray of fewer samples ends with its last one */
  sf_ray_samples(scene, ray, sample, n);
  return (sf_ray_request){ray, sample, n, stops, false};
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

sf_status sf_compare_field(const fx_memory_counts *core, const sf_field_counters *rtl)
{
  const struct {
    const char *name;
    uint64_t core, rtl;
  } count[] = {{"look-ups of the field", core->lookups, rtl->lookups},
               {"field lines missed", core->misses, rtl->misses},
               {"field lines filled", core->misses, rtl->fills}};
  for (size_t i = 0; i < sizeof count / sizeof *count; i++)
    if (count[i].core != count[i].rtl)
      return sf_fail(SF_E_DIFFERENCE, "%s: core %" PRIu64 ", accelerator %" PRIu64, count[i].name, count[i].core,
                     count[i].rtl);
  return sf_ok();
}

typedef struct run {
  sf_dut *dut;
  const sf_memory *memory;
  const sf_ray_request *request;
  fx_pixel *pixel;
  int n, sent, at, received;
  uint64_t progress; /* cycle of the last beat */
  bool waits;        /* a pixel was shown and not taken */
  uint64_t waiting[6];
} run;

/* Direction and tile are those of the first beat. In later ones the accelerator ignores the bits: they are set to the
 * contrary. */
static void set_beat(sf_pins_in *in, const sf_ray_request *request, int at)
{
  const int16_t *d = request->ray->unit;
  memset(in->ray_data, 0, sizeof in->ray_data);
  in->ray_user = at == 0, in->ray_last = at >= request->n - !request->stops;
  if (request->new_tile) in->ray_data[3] = (uint64_t)1 << 49;
  if (request->n == 0) {
    in->ray_data[3] |= (uint64_t)1 << 48;
    return;
  }
  const sf_ray_sample *s = &request->sample[at < request->n ? at : 0]; /* beyond the last: dropped, whatever it is */
  in->ray_data[0] = (uint64_t)s->pos[1] << 32 | s->pos[0];
  in->ray_data[1] = (uint64_t)(uint32_t)s->delta_q24 << 32 | s->pos[2];
  in->ray_data[2] = s->distance_q16;
  in->ray_data[3] |= (uint64_t)(uint16_t)d[2] << 32 | (uint64_t)(uint16_t)d[1] << 16 | (uint16_t)d[0];
  if (at > 0) in->ray_data[3] ^= (((uint64_t)1 << 48) - 1) | (uint64_t)1 << 49;
}

static void offer(run *r)
{
  sf_pins_in *in = &r->dut->in;
  if (in->ray_valid || r->sent == r->n || sf_dut_stalls(r->dut, STREAM_RAYS)) return;
  const sf_ray_request *request = &r->request[r->sent];
  if (request->stops && r->at == request->n && r->received <= r->sent) return; /* its pixel comes first */
  in->ray_valid = true;
  set_beat(in, request, r->at);
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
  if (r->received == r->sent + (r->at > 0))
    return sf_fail(SF_E_DIFFERENCE, "accelerator: pixel without a ray at cycle %" PRIu64, r->dut->cycle);
  const uint64_t *w = out->pixel_data;
  r->pixel[r->received++] = (fx_pixel){.colour = {w[0], w[1], w[2]},
                                       .depth = w[3],
                                       .weight_sum = (uint32_t)w[4],
                                       .transmittance = (uint32_t)(w[4] >> 32),
                                       .samples = (uint32_t)w[5]};
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
                 what, cycle, r->sent, r->n, r->received, error, of_rays);
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

sf_status sf_ray_dut_run(sf_ray_dut *rays, const sf_ray_request *request, int n, fx_pixel *pixel)
{
  sf_dut *dut = rays->dut;
  sf_pins_dump(dut->pins);
  sf_status status = quiet(dut, 1);
  run r = {.dut = dut, .memory = &rays->memory, .request = request, .pixel = pixel, .n = n, .progress = dut->cycle};
  while ((r.received < n || r.sent < n) && status.code == SF_OK) status = step(&r);
  dut->in.ray_valid = dut->in.pixel_ready = false;
  return status.code == SF_OK ? quiet(dut, QUIET) : status;
}
