/* Heat maps: what each shows of a pixel. */
#include "sim/view/internal.h"
#include <math.h>
#include <string.h>

static const sf_map_text texts[SF_MAPS] = {
    [SF_MAP_NONE] = {"none", "Picture", "", "the colours alone"},
    [SF_MAP_SAMPLES] = {"samples", "Samples", "samples", "samples of the ray that went through the nets"},
    [SF_MAP_SPIKES] = {"spikes", "Spikes, all layers", "spikes", "spikes of all layers and steps"},
    [SF_MAP_SPIKES_D1] = {"spikes-d1", "Spikes of D1", "spikes", "spikes of layer D1, all steps"},
    [SF_MAP_SPIKES_C1] = {"spikes-c1", "Spikes of C1", "spikes", "spikes of layer C1, all steps"},
    [SF_MAP_SPIKES_C2] = {"spikes-c2", "Spikes of C2", "spikes", "spikes of layer C2, all steps"},
    [SF_MAP_SOPS] = {"sops", "Synaptic operations", "SOP", "additions of a weight that spikes caused"},
    [SF_MAP_SATURATED] = {"saturation", "Saturations", "events",
                          "membranes and accumulators that met their range's end"},
    [SF_MAP_MISSES] = {"misses", "Misses of the field's cache", "misses",
                       "lines that the field's cache had to fetch, tile by tile"},
    [SF_MAP_PHOTO] = {"photo-difference", "Difference to the photograph", "/ 255",
                      "largest difference of R, G and B to the data set's picture"},
    [SF_MAP_FLOAT] = {"float-difference", "Fixed - float", "/ 255",
                      "largest difference of R, G and B to the float field"},
    [SF_MAP_RTL] = {"rtl-difference", "Fixed - RTL", "/ 255",
                    "largest difference of R, G and B to the Verilog accelerator; a pixel that it gets wrong is 255"},
};

void sf_map_describe(int map, sf_map_text *text)
{
  static const char *const key[SF_SPIKING_LEDGERS] = {"energy-paper", "energy-width", "energy-memory", "energy-neuron",
                                                      "energy-shared"};
  *text = texts[map];
  if (map < SF_MAP_LEDGER || map >= SF_MAP_SATURATED) return;
  const sf_ledger_text *ledger = &sf_ledger_texts[map - SF_MAP_LEDGER];
  *text = (sf_map_text){key[map - SF_MAP_LEDGER], ledger->title, "nJ", ledger->meaning};
}

int sf_map_find(const char *key)
{
  sf_map_text text;
  for (int map = 0; map < SF_MAPS; map++) {
    sf_map_describe(map, &text);
    if (!strcmp(text.key, key)) return map;
  }
  return -1;
}

bool sf_map_lists(int map)
{
  return map == SF_MAP_MISSES || (map > SF_MAP_LEDGER + SF_LEDGER_WIDTH && map < SF_MAP_SATURATED);
}

bool sf_map_counts(int map)
{
  return map == SF_MAP_SPIKES_D1 || map == SF_MAP_SPIKES_C1 || map == SF_MAP_SPIKES_C2 || map == SF_MAP_SATURATED ||
         map == SF_MAP_LEDGER + SF_LEDGER_WIDTH || sf_map_lists(map);
}

double sf_map_of_cost(int map, const fx_pixel *pixel, const fx_cost *cost)
{
  switch (map) {
  case SF_MAP_SAMPLES:
    return pixel->samples;
  case SF_MAP_SPIKES:
    return (double)cost->spikes;
  case SF_MAP_SOPS:
    return (double)cost->sops;
  case SF_MAP_LEDGER + SF_LEDGER_PAPER:
    return (double)sf_cost_fj(cost) / 1e6;
  default:
    return (double)NAN;
  }
}

static double spikes_of(const fx_counts *counts, int layer)
{
  uint64_t sum = 0;
  for (int t = 0; t < SF_T_MAX; t++) sum += counts->layer[layer].spikes[t];
  return (double)sum;
}

static double saturations(const fx_counts *counts)
{
  uint64_t sum = counts->saturated_features;
  for (int l = 0; l < SF_LAYERS; l++) sum += counts->saturated[l];
  return (double)sum;
}

static double energy(const sf_viewer *v, const fx_scene *scene, int ledger, const fx_counts *counts,
                     const fx_memory_counts *memory)
{
  const sf_traffic traffic = sf_traffic_of(scene, counts, memory, 1);
  const sf_counted counted = {scene, counts, memory, &traffic, sf_cache_built};
  const uint64_t fj = sf_ledger_fj(&v->technology, &counted, ledger);
  return fj == UINT64_MAX ? (double)NAN : (double)fj / 1e6;
}

double sf_map_of_counts(const sf_viewer *v, const fx_scene *scene, int map, const fx_counts *counts,
                        const fx_memory_counts *memory)
{
  switch (map) {
  case SF_MAP_SPIKES_D1:
    return spikes_of(counts, FX_D1);
  case SF_MAP_SPIKES_C1:
    return spikes_of(counts, FX_C1);
  case SF_MAP_SPIKES_C2:
    return spikes_of(counts, FX_C2);
  case SF_MAP_SATURATED:
    return saturations(counts);
  case SF_MAP_MISSES:
    return (double)memory->misses;
  default:
    return energy(v, scene, map - SF_MAP_LEDGER, counts, memory);
  }
}
