/* What is read and written outside the nets: the field's tables, the frame; exp(-x) of compositing. */
#include "energy/energy.h"

_Static_assert(sizeof(fx_pixel) == SF_PIXEL_BYTES, "a pixel leaves the accelerator as it lies in memory");
const sf_event sf_traffic_events[SF_TRAFFIC_EVENTS] = {
    {"table_bytes", "field bytes read"}, {"exp_neg", "exp(-x) of compositing"}, {"frame_bytes", "frame bytes written"}};

enum { CORNERS = 8, PLANE_READS = 4, LINE_READS = 2 }; /* of a component: int8 each */

/* Samples whose light was attenuated: TensoRF composites before it decodes. */
static uint64_t composited(const fx_counts *counts)
{
  return counts->field_samples ? counts->field_samples : counts->samples;
}

sf_traffic sf_traffic_of(const fx_counts *counts, uint64_t pixels)
{
  return (sf_traffic){{counts->grid_bytes, composited(counts), pixels * SF_PIXEL_BYTES}};
}

static uint64_t factors_read(const fx_factors *factors)
{
  uint64_t bytes = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) bytes += (uint64_t)factors->components[pair] * (PLANE_READS + LINE_READS);
  return bytes;
}

sf_traffic sf_traffic_recount(const fx_scene *scene, const fx_counts *recount, uint64_t field_samples, uint64_t pixels)
{
  const uint64_t frame = pixels * SF_PIXEL_BYTES;
  if (scene->backbone == FX_TENSORF)
    return (sf_traffic){{field_samples * factors_read(&scene->tensorf.density) +
                             recount->samples * factors_read(&scene->tensorf.appearance),
                         field_samples, frame}};
  const uint64_t entry = FX_GRID_FEATURES * sizeof *scene->grid.table;
  return (sf_traffic){{recount->samples * (uint64_t)scene->grid.levels * CORNERS * entry, recount->samples, frame}};
}

sf_status sf_traffic_compare(const sf_traffic *a, const char *a_name, const sf_traffic *b, const char *b_name)
{
  for (int e = 0; e < SF_TRAFFIC_EVENTS; e++)
    if (a->event[e] != b->event[e])
      return sf_fail(SF_E_DIFFERENCE, "%s: %s %llu, %s %llu", sf_traffic_events[e].title, a_name,
                     (unsigned long long)a->event[e], b_name, (unsigned long long)b->event[e]);
  return sf_ok();
}

/* Three planes and three lines: pair p spans two axes and the line the third, so together each axis once. */
static uint64_t factors_size(const fx_factors *factors, const int32_t res[3])
{
  static const int axes[FX_PAIRS][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  uint64_t bytes = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const uint64_t u = (uint64_t)res[axes[pair][0]], v = (uint64_t)res[axes[pair][1]], w = (uint64_t)res[axes[pair][2]];
    bytes += (uint64_t)factors->components[pair] * (u * v + w);
  }
  return bytes;
}

uint64_t sf_table_size(const fx_scene *scene)
{
  if (scene->backbone == FX_TENSORF)
    return factors_size(&scene->tensorf.density, scene->tensorf.res) +
           factors_size(&scene->tensorf.appearance, scene->tensorf.res);
  return (uint64_t)scene->grid.entries * FX_GRID_FEATURES * sizeof *scene->grid.table;
}
