/* What goes into sf_ray_top and comes out of it, wherever it is. Needs no model of the accelerator. */
#include "sim/ray/request.h"
#include "fx/tensorf.h"
#include "quant/quant.h"
#include <inttypes.h>

/* ---- programming ---- */

sf_ray_blob sf_ray_blob_of(const fx_scene *scene, uint32_t base)
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

sf_planes_blob sf_ray_planes_of(const fx_tensorf *field)
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

/* ---- rays ---- */

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

/* The accelerator takes direction and tile from the first beat. In later beats it has to ignore these bits, so they are
 * inverted there. */
sf_ray_beat sf_ray_beat_of(const sf_ray_request *request, int at)
{
  const int16_t *d = request->ray->unit;
  sf_ray_beat beat = {.user = at == 0, .last = at >= request->n - !request->stops};
  if (request->new_tile) beat.data[3] = (uint64_t)1 << 49;
  if (request->n == 0) {
    beat.data[3] |= (uint64_t)1 << 48;
    return beat;
  }
  const sf_ray_sample *s = &request->sample[at < request->n ? at : 0]; /* beyond the last: dropped, whatever it is */
  beat.data[0] = (uint64_t)s->pos[1] << 32 | s->pos[0];
  beat.data[1] = (uint64_t)(uint32_t)s->delta_q24 << 32 | s->pos[2];
  beat.data[2] = s->distance_q16;
  beat.data[3] |= (uint64_t)(uint16_t)d[2] << 32 | (uint64_t)(uint16_t)d[1] << 16 | (uint16_t)d[0];
  if (at > 0) beat.data[3] ^= (((uint64_t)1 << 48) - 1) | (uint64_t)1 << 49;
  return beat;
}

fx_pixel sf_ray_pixel_of(const uint64_t word[6])
{
  return (fx_pixel){.colour = {word[0], word[1], word[2]},
                    .depth = word[3],
                    .weight_sum = (uint32_t)word[4],
                    .transmittance = (uint32_t)(word[4] >> 32),
                    .samples = (uint32_t)word[5]};
}

/* ---- counters ---- */

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
