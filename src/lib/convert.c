/* The core's types and the public ones: equal layouts, which the compiler proves; copied, so that neither header needs
 * the other. */
#include "energy/energy.h"
#include "spikefield/event.def"
#include "src/lib/internal.h"
#include <string.h>

_Static_assert((int)SPIKEFIELD_LAYERS == (int)SF_LAYERS, "arch.def and spikefield.h differ");
_Static_assert((int)SPIKEFIELD_STEPS_MAX == (int)SF_T_MAX, "arch.def and spikefield.h differ");
_Static_assert((int)SPIKEFIELD_LANES == (int)SF_LANES, "arch.def and spikefield.h differ");
_Static_assert((int)SPIKEFIELD_FEATURES_MAX == (int)SF_FEATURE_MAX, "arch.def and spikefield.h differ");
_Static_assert((int)SPIKEFIELD_COUNTERS == 64 * (int)SF_EVENTS, "event.def and spikefield.h differ");
_Static_assert((int)SPIKEFIELD_DIRECTIONS == (int)FX_SH, "arch.def and spikefield.h differ");
_Static_assert(SPIKEFIELD_INPUT_MAX == (1 << (SF_INPUT_BITS - 1)) - 1, "arch.def and spikefield.h differ");
_Static_assert((int)SPIKEFIELD_E_STOPPED == (int)SF_E_STOPPED && (int)SPIKEFIELD_E_USAGE == (int)SF_E_USAGE,
               "sf_code and spikefield_code differ");
_Static_assert(sizeof(spikefield_status) == sizeof(sf_status), "sf_status and spikefield_status differ");

#define SAME(type, core, member)                                                                                       \
  _Static_assert(offsetof(type, member) == offsetof(core, member) &&                                                   \
                     sizeof(((type *)0)->member) == sizeof(((core *)0)->member),                                       \
                 #type "." #member " differs from the core's")
#define SAME_EVENT(id, name, title, unit, fj) SAME(spikefield_layer_counts, fx_layer_counts, name);
SF_EVENT_TABLE(SAME_EVENT)
SAME(spikefield_counts, fx_counts, layer);
SAME(spikefield_counts, fx_counts, samples);
SAME(spikefield_counts, fx_counts, rays);
SAME(spikefield_counts, fx_counts, grid_bytes);
SAME(spikefield_counts, fx_counts, march_steps);
SAME(spikefield_counts, fx_counts, saturated);
SAME(spikefield_counts, fx_counts, saturated_samples);
SAME(spikefield_counts, fx_counts, saturated_features);
SAME(spikefield_counts, fx_counts, field_samples);
SAME(spikefield_counts, fx_counts, field_mac);
_Static_assert(sizeof(spikefield_counts) == sizeof(fx_counts), "spikefield_counts differs from the core's");
SAME(spikefield_trace, fx_trace, spikes);
SAME(spikefield_trace, fx_trace, membrane);
SAME(spikefield_trace, fx_trace, current);
_Static_assert(sizeof(spikefield_trace) == sizeof(fx_trace), "spikefield_trace differs from the core's");

const char *spikefield_version(void)
{
  return SPIKEFIELD_VERSION;
}

int32_t spikefield_lanes(void)
{
  return SPIKEFIELD_LANES;
}

spikefield_status lib_status(sf_status status)
{
  spikefield_status to;
  to.code = (spikefield_code)status.code;
  memcpy(to.message, status.message, sizeof to.message);
  return to;
}

void lib_add_counts(spikefield_counts *sum, const fx_counts *more)
{
  fx_counts total;
  if (!sum) return;
  memcpy(&total, sum, sizeof total);
  fx_counts_add(&total, more);
  memcpy(sum, &total, sizeof total);
}

void lib_pixel(spikefield_pixel *to, const fx_pixel *from)
{
  memcpy(to->colour, from->colour, sizeof to->colour);
  to->depth = from->depth, to->weight_sum = from->weight_sum, to->transmittance = from->transmittance;
  to->samples = from->samples;
  fx_pixel_rgba(from, to->rgba);
}

void lib_sample(spikefield_sample *to, const fx_out *from)
{
  to->density = from->sigma;
  memcpy(to->colour, from->colour, sizeof to->colour);
}

void spikefield_counts_add(spikefield_counts *sum, const spikefield_counts *more)
{
  fx_counts add;
  if (!more) return;
  memcpy(&add, more, sizeof add);
  lib_add_counts(sum, &add);
}

uint64_t spikefield_energy_fj(const spikefield_counts *counts)
{
  fx_counts copy;
  if (!counts) return 0;
  memcpy(&copy, counts, sizeof copy);
  return sf_energy_fj(&copy);
}

uint64_t spikefield_relu_energy_fj(const spikefield_scene *scene, uint64_t samples)
{
  return scene ? sf_energy_ann_fj(&scene->fx.net, samples) : 0;
}

double spikefield_pixel_distance(const spikefield_scene *scene, const spikefield_pixel *pixel)
{
  if (!scene || !pixel || !pixel->weight_sum) return 0;
  const double steps = (double)pixel->depth / (double)pixel->weight_sum / 65536;
  return steps * scene->fx.step_q24 / (1 << SF_DELTA_FRAC) / scene->fx.units.to_box_scale;
}
