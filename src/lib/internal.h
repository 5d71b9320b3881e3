/* Inside src/lib: what the files behind the public header share. */
#ifndef SF_LIB_INTERNAL_H
#define SF_LIB_INTERNAL_H
#include "fx/fx.h"
#include "spikefield/spikefield.h"

struct spikefield_scene {
  fx_scene fx;
};

spikefield_status lib_status(sf_status status);

/* Refuses a NULL argument by its name, in a function that returns sf_status. */
#define LIB_REQUIRE(pointer)                                                                                           \
  do {                                                                                                                 \
    if (!(pointer)) return sf_fail(SF_E_USAGE, "%s is NULL", #pointer);                                                \
  } while (0)

/* A view of the scene with the options' time steps: shares weights, table and occupancy; nothing to free. */
sf_status lib_view(const spikefield_scene *scene, const spikefield_options *options, fx_scene *view);

void lib_add_counts(spikefield_counts *sum, const fx_counts *more); /* sum may be NULL */
void lib_pixel(spikefield_pixel *to, const fx_pixel *from);
void lib_sample(spikefield_sample *to, const fx_out *from);
#endif
