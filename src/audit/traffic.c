/* What is read and written outside the nets: the field's tables, the frame; exp(-x) of compositing. */
#include "spikefield/audit.h"

_Static_assert(sizeof(fx_pixel) == SF_PIXEL_BYTES, "a pixel leaves the accelerator as it lies in memory");
enum { CORNERS = 8 };

sf_traffic sf_traffic_of(const fx_counts *counts, uint64_t pixels)
{
  return (sf_traffic){counts->grid_bytes, counts->samples, pixels * SF_PIXEL_BYTES};
}

sf_traffic sf_traffic_recount(const fx_scene *scene, const fx_counts *recount, uint64_t pixels)
{
  const uint64_t entry = FX_GRID_FEATURES * sizeof *scene->grid.table;
  return (sf_traffic){recount->samples * (uint64_t)scene->grid.levels * CORNERS * entry, recount->samples,
                      pixels * SF_PIXEL_BYTES};
}

sf_status sf_traffic_compare(const sf_traffic *a, const char *a_name, const sf_traffic *b, const char *b_name)
{
  const struct {
    const char *name;
    uint64_t a, b;
  } event[] = {{"field bytes read", a->table_bytes, b->table_bytes},
               {"exp(-x) of compositing", a->exp_neg, b->exp_neg},
               {"frame bytes written", a->frame_bytes, b->frame_bytes}};
  for (size_t i = 0; i < sizeof event / sizeof *event; i++)
    if (event[i].a != event[i].b)
      return sf_fail(SF_E_DIFFERENCE, "%s: %s %llu, %s %llu", event[i].name, a_name, (unsigned long long)event[i].a,
                     b_name, (unsigned long long)event[i].b);
  return sf_ok();
}

uint64_t sf_table_size(const fx_scene *scene)
{
  return (uint64_t)scene->grid.entries * FX_GRID_FEATURES * sizeof *scene->grid.table;
}
