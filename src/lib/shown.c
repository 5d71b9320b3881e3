/* What the accelerator shows of a sample and of its counts: the beats of its tap, the window of its counters. */
#include "src/lib/internal.h"
#include <string.h>

enum { GLOBAL_LAYER = 7 }; /* of the counter window: samples and rays */

void lib_rows(const fx_net *net, lib_spikes spikes, int layer, int step, uint64_t rows[SF_SPIKE_WORDS])
{
  memset(rows, 0, SF_SPIKE_WORDS * sizeof *rows);
  if (!fx_layer_reads_spikes(layer)) return;
  const int presynaptic = fx_layer_table[layer].spikes_of;
  const int from = fx_layer_fires(layer) ? step : 0, to = fx_layer_fires(layer) ? step + 1 : net->steps;
  for (int t = from; t < to; t++)
    for (int word = 0; word < SF_SPIKE_WORDS; word++) rows[word] |= spikes[presynaptic][t][word];
}

int32_t lib_membrane(const fx_net *net, lib_spikes spikes, lib_membranes membrane, int layer, int step, int neuron)
{
  if (neuron < 0 || neuron >= net->layer[layer].n_out) return 0;
  const bool fired = spikes[layer][step][neuron / 64] >> (neuron % 64) & 1;
  return membrane[layer][step][neuron] - (fired ? fx_net_theta(net, layer) : 0);
}

uint64_t lib_counter(const fx_counts *counts, int at)
{
  const int event = at / 64, layer = at / 8 % 8, step = at % 8;
  if (at < 0 || event >= SF_EVENTS) return 0;
  if (layer == GLOBAL_LAYER && event == 0) return step == 0 ? counts->samples : step == 1 ? counts->rays : 0;
  return layer < SF_LAYERS ? counts->layer[layer].event[event][step] : 0;
}

static sf_status shown(const spikefield_scene *scene, const spikefield_options *options, const spikefield_trace *trace,
                       int32_t layer, int32_t step, spikefield_shown *to)
{
  fx_scene view;
  SF_TRY(lib_view(scene, options, &view));
  LIB_REQUIRE(trace);
  LIB_REQUIRE(to);
  if (layer < 0 || layer >= SF_LAYERS) return sf_fail(SF_E_RANGE, "layer is %d, expected 0..%d", layer, SF_LAYERS - 1);
  if (step < 0 || step >= view.net.steps)
    return sf_fail(SF_E_RANGE, "step is %d, expected 0..%d", step, view.net.steps - 1);
  const bool fires = fx_layer_fires(layer);
  memset(to, 0, sizeof *to);
  lib_rows(&view.net, trace->spikes, layer, step, to->rows);
  if (fires) memcpy(to->spikes, trace->spikes[layer][step], sizeof to->spikes);
  for (int n = 0; fires && n < SF_LANES; n++)
    to->membrane[n] = lib_membrane(&view.net, trace->spikes, trace->membrane, layer, step, n);
  return sf_ok();
}

spikefield_status spikefield_trace_shown(const spikefield_scene *scene, const spikefield_options *options,
                                         const spikefield_trace *trace, int32_t layer, int32_t step,
                                         spikefield_shown *to)
{
  return lib_status(shown(scene, options, trace, layer, step, to));
}

void spikefield_counter_window(const spikefield_scene *scene, const spikefield_counts *counts,
                               uint64_t window[SPIKEFIELD_COUNTERS])
{
  fx_counts copy;
  if (!scene || !counts || !window) return;
  memcpy(&copy, counts, sizeof copy);
  if (fx_net_constants_per_sample(&scene->fx.net)) copy.rays = 0;
  for (int at = 0; at < SPIKEFIELD_COUNTERS; at++) window[at] = lib_counter(&copy, at);
}
