/* What is read and written outside the nets: the field's tables, the frame; exp(-x) of compositing. */
#include "energy/energy.h"

_Static_assert(sizeof(fx_pixel) == SF_PIXEL_BYTES, "a pixel leaves the accelerator as it lies in memory");
const sf_event sf_traffic_events[SF_TRAFFIC_EVENTS] = {
    {"table_bytes", "field bytes read"},        {"exp_neg", "exp(-x) of compositing"},
    {"frame_bytes", "frame bytes written"},     {"lookups", "field look-ups"},
    {"misses", "field lines missed"},           {"products", "products of the field"},
    {"places", "places in the field"},          {"field_special", "special functions of the field"},
    {"harmonics", "harmonics of the direction"}};

enum { CORNERS = 8, PLANE_READS = 4, LINE_READS = 2 }; /* of a component: int8 each */

/* Sines and cosines of a decoded sample. */
static uint64_t waves(const fx_tensorf *field)
{
  return 2 * (uint64_t)(field->features * field->feature_freqs + 3 * field->view_freqs);
}

/* Samples whose light was attenuated: TensoRF composites before it decodes. */
static uint64_t composited(const fx_counts *counts)
{
  return counts->field_samples ? counts->field_samples : counts->samples;
}

sf_traffic sf_traffic_of(const fx_scene *scene, const fx_counts *counts, const fx_memory_counts *memory,
                         uint64_t pixels)
{
  const uint64_t cells = counts->samples * (uint64_t)scene->grid.levels;
  sf_traffic t = {.table_bytes = counts->grid_bytes,
                  .exp_neg = composited(counts),
                  .frame_bytes = pixels * SF_PIXEL_BYTES,
                  .lookups = memory->lookups,
                  .misses = memory->misses};
  if (scene->backbone == FX_TENSORF) {
    t.products = counts->field_mac;
    t.places = counts->field_samples + counts->samples;
    t.special = counts->field_samples + counts->samples * waves(&scene->tensorf);
  } else {
    t.products = cells * CORNERS * FX_GRID_FEATURES;
    t.places = cells;
    t.harmonics = counts->rays;
  }
  return t;
}

static uint64_t factors_read(const fx_factors *factors)
{
  uint64_t bytes = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) bytes += (uint64_t)factors->components[pair] * (PLANE_READS + LINE_READS);
  return bytes;
}

/* Per component 4 products of the plane, 2 of the line, 1 of both; `features` more in the basis matrix. */
static uint64_t factors_products(const fx_factors *factors, int features)
{
  uint64_t components = 0;
  for (int pair = 0; pair < FX_PAIRS; pair++) components += (uint64_t)factors->components[pair];
  return components * (uint64_t)(PLANE_READS + LINE_READS + 1 + features);
}

sf_traffic sf_traffic_recount(const fx_scene *scene, const fx_counts *recount, const fx_memory_counts *memory,
                              uint64_t field_samples, uint64_t pixels)
{
  const fx_tensorf *field = &scene->tensorf;
  const uint64_t samples = recount->samples, entry = FX_GRID_FEATURES * sizeof *scene->grid.table;
  sf_traffic t = {.frame_bytes = pixels * SF_PIXEL_BYTES, .lookups = memory->lookups, .misses = memory->misses};
  if (scene->backbone == FX_TENSORF) {
    t.table_bytes = field_samples * factors_read(&field->density) + samples * factors_read(&field->appearance);
    t.exp_neg = field_samples;
    t.products = field_samples * factors_products(&field->density, 0) +
                 samples * factors_products(&field->appearance, field->features);
    t.places = field_samples + samples;
    t.special = field_samples + samples * waves(field);
  } else {
    const uint64_t places = samples * (uint64_t)scene->grid.levels;
    t.places = places;
    t.table_bytes = places * CORNERS * entry;
    t.products = places * CORNERS * FX_GRID_FEATURES;
    t.exp_neg = samples;
    t.harmonics = recount->rays;
  }
  return t;
}

sf_status sf_traffic_compare(const sf_traffic *a, const char *a_name, const sf_traffic *b, const char *b_name,
                             int events)
{
  for (int e = 0; e < events; e++)
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
