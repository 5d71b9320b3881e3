/* Samples for the model of planes, from rays through the portable core. */
#include "cycles/planes.h"
#include "fx/tensorf.h"
#include <stdlib.h>

static sf_status add(sf_planes_record *record, const sf_planes_read *read)
{
  if (record->count == record->room) {
    const size_t room = record->room ? 2 * record->room : 4096;
    sf_planes_read *larger = realloc(record->at, room * sizeof *larger);
    if (!larger) return sf_fail(SF_E_MEMORY, "no memory for %zu samples", room);
    record->at = larger, record->room = room;
  }
  record->at[record->count++] = *read;
  return sf_ok();
}

static sf_status decode(sf_planes_record *record, const fx_scene *scene, const fx_ray *ray, const uint32_t pos[3],
                        bool first)
{
  int16_t x[SF_DIR_MAX];
  int32_t base[SF_LANES];
  fx_out out;
  fx_trace *trace = malloc(sizeof *trace);
  if (!trace) return sf_fail(SF_E_MEMORY, "no memory for a sample");
  fx_tensorf_encode(&scene->tensorf, pos, ray->unit, x, NULL);
  fx_net_next(&scene->net, ray->dir, first, x, base, &out, trace, NULL);
  const sf_status status = sf_cycle_record_add(&record->nets, &scene->net, trace, first);
  free(trace);
  return status;
}

/* As fx_render_ray: a weight for every density until the ray ends, and FX_AHEAD densities more. */
sf_status sf_planes_record_ray(sf_planes_record *record, const fx_scene *scene, const fx_ray *ray)
{
  const size_t begin = record->count;
  fx_pixel pixel;
  int behind = 0;
  sf_planes_read read = {.first = true};
  fx_composite_begin(&pixel);
  for (int32_t at = -1; behind < FX_AHEAD && (at = fx_march_next(scene, ray, at + 1, read.pos, NULL)) >= 0;) {
    read.behind = read.behind || read.ends;
    read.decoded = read.ends = false;
    behind += read.behind;
    if (!read.behind) {
      read.decoded = fx_tensorf_weight(scene, &fx_vm_portable, ray, at, read.pos, &pixel, NULL) > 0;
      if (read.decoded) SF_TRY(decode(record, scene, ray, read.pos, pixel.samples++ == 0));
      read.ends = pixel.transmittance <= (uint32_t)scene->trans_stop || pixel.samples >= (uint32_t)scene->max_samples;
    }
    SF_TRY(add(record, &read));
    read.first = false;
  }
  if (record->count == begin) return add(record, &(sf_planes_read){.first = true, .last = true, .empty = true});
  record->at[record->count - 1].last = true;
  return sf_ok();
}

void sf_planes_record_free(sf_planes_record *record)
{
  free(record->at);
  sf_cycle_record_free(&record->nets);
  *record = (sf_planes_record){.at = NULL};
}
