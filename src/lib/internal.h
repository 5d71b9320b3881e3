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

/* Of a trace: rows that a layer added up (D2, C2, C3), a membrane after reset. Of counts: a place of the window. */
typedef const uint64_t (*lib_spikes)[SF_T_MAX][SF_SPIKE_WORDS];
typedef const int32_t (*lib_membranes)[SF_T_MAX][SF_LANES];
void lib_rows(const fx_net *net, lib_spikes spikes, int layer, int step, uint64_t rows[SF_SPIKE_WORDS]);
int32_t lib_membrane(const fx_net *net, lib_spikes spikes, lib_membranes membrane, int layer, int step, int neuron);
uint64_t lib_counter(const fx_counts *counts, int at);
#endif
