#include "energy/energy.h"
#include <inttypes.h>
#include <math.h>

static const char *const not_modelled[] = {
    "marching and the occupancy test, which the host does",
    "spike bitmaps, sums while they grow, queues and buffers between units; rows of DRAM that a burst opens",
    "control, clock tree, interconnect, stalls and leakage power",
    "transfers to and from the accelerator but for the pixels; training",
    "zeros: ReLU's zeros are not skipped in the twin, as spikes that do not come are in the spiking net",
    "reuse of weights over samples but for the ledgers where 16 share: elsewhere rows are read anew for every sample "
    "in "
    "both nets (the direction's of C1 once per ray where the net computes them so)",
    NULL};

static const char *const criticism[] = {
    "in the paper ledger 4.6 pJ is an fp32 multiply and add, 0.9 pJ an fp32 add (45 nm); a fixed-point add of these "
    "widths costs 0.03-0.1 "
    "pJ: see the width-correct ledger",
    "in the paper ledger memory traffic is left out, and on real hardware it dominates: see the ledger with memory",
    "in the paper ledger neuron updates are left out, although every neuron is updated at every step whether it fires "
    "or not: see the ledger with everything",
    "the first, real-valued layers are priced as MACs here; a reading that leaves them out flatters the spiking net",
    "in the paper ledger the twin multiplies the direction of a ray by its weights at every sample, the spiking net "
    "once per ray; a twin that does so once per ray too (a hoisted twin) is beside it, and the integer twins all do",
    NULL};

static cJSON *steps_json(const fx_layer_counts *layer, int event, int steps)
{
  cJSON *list = cJSON_CreateArray();
  for (int t = 0; t < steps; t++) {
    char digits[24];
    snprintf(digits, sizeof digits, "%" PRIu64, layer->event[event][t]);
    cJSON_AddItemToArray(list, cJSON_CreateRaw(digits));
  }
  return list;
}

static double firing_rate(const fx_layer_counts *layer, int t)
{
  return layer->updates[t] ? (double)layer->spikes[t] / (double)layer->updates[t] : 0;
}

static cJSON *layer_json(const fx_net *net, const fx_counts *counts, int l)
{
  cJSON *layer = cJSON_CreateObject();
  cJSON_AddStringToObject(layer, "name", fx_layer_name(l));
  cJSON_AddNumberToObject(layer, "n_in", net->layer[l].n_in);
  cJSON_AddNumberToObject(layer, "n_out", net->layer[l].n_out);
  for (int e = 0; e < SF_EVENTS; e++)
    cJSON_AddItemToObject(layer, sf_events[e].name, steps_json(&counts->layer[l], e, net->steps));
  if (fx_layer_fires(l)) {
    cJSON *rate = cJSON_AddArrayToObject(layer, "firing_rate");
    for (int t = 0; t < net->steps; t++)
      cJSON_AddItemToArray(rate, cJSON_CreateNumber(firing_rate(&counts->layer[l], t)));
  }
  sf_json_add_u64(layer, "saturated", counts->saturated[l]);
  return layer;
}

cJSON *sf_counts_json(const fx_net *net, const fx_counts *counts)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "samples", counts->samples);
  sf_json_add_u64(json, "rays", counts->rays);
  cJSON_AddNumberToObject(json, "steps", net->steps);
  cJSON *total = cJSON_AddObjectToObject(json, "total");
  for (int e = 0; e < SF_EVENTS; e++) sf_json_add_u64(total, sf_events[e].name, sf_event_total(counts, e));
  cJSON *layers = cJSON_AddArrayToObject(json, "layers");
  for (int l = 0; l < SF_LAYERS; l++) cJSON_AddItemToArray(layers, layer_json(net, counts, l));
  sf_json_add_u64(json, "grid_bytes", counts->grid_bytes);
  sf_json_add_u64(json, "march_steps", counts->march_steps);
  sf_json_add_u64(json, "saturated_features", counts->saturated_features);
  if (counts->field_samples) {
    sf_json_add_u64(json, "field_samples", counts->field_samples);
    sf_json_add_u64(json, "field_mac", counts->field_mac);
  }
  return json;
}

void sf_counts_print(FILE *out, const fx_net *net, const fx_counts *counts)
{
  fprintf(out, "%-5s %4s %16s %16s %16s %16s %8s\n", "layer", "step", "MAC", "SOP", "neuron updates", "spikes", "rate");
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer_counts *c = &counts->layer[l];
    for (int t = 0; t < net->steps; t++) {
      fprintf(out, "%-5s %4d %16" PRIu64 " %16" PRIu64 " %16" PRIu64, fx_layer_name(l), t, c->mac[t], c->sop[t],
              c->updates[t]);
      if (fx_layer_fires(l))
        fprintf(out, " %16" PRIu64 " %7.2f%%\n", c->spikes[t], 100 * firing_rate(c, t));
      else
        fprintf(out, " %16s %8s\n", "-", "-");
    }
  }
  fprintf(out, "%-10s", "all");
  static const int column[4] = {SF_EVENT_MAC, SF_EVENT_SOP, SF_EVENT_UPDATES, SF_EVENT_SPIKES};
  for (int e = 0; e < 4; e++) fprintf(out, " %16" PRIu64, sf_event_total(counts, column[e]));
  fprintf(out, "\nalso counted:");
  for (int e = SF_EVENT_WEIGHT; e < SF_EVENTS; e++)
    fprintf(out, "%s %s %" PRIu64, e > SF_EVENT_WEIGHT ? "," : "", sf_events[e].title, sf_event_total(counts, e));
  fprintf(out, ",\n  %s %" PRIu64 ", occupancy tests %" PRIu64 "\n", sf_traffic_events[SF_TRAFFIC_TABLE].title,
          counts->grid_bytes, counts->march_steps);
  if (counts->field_samples)
    fprintf(out, "  densities read %" PRIu64 ", of which %.1f %% are decoded; products of the field %" PRIu64 "\n",
            counts->field_samples, 100 * (double)counts->samples / (double)counts->field_samples, counts->field_mac);
}

static void ledger_row(FILE *out, const char *name, uint64_t fj, double views, uint64_t ann_fj)
{
  fprintf(out, "%-52s %22" PRIu64 " %12.6g", name, fj, views > 0 ? (double)fj * 1e-12 / views : 0);
  if (ann_fj == 0)
    fprintf(out, " %9s\n", "-");
  else
    fprintf(out, " %8.2f%%\n", sf_saving_percent(fj, ann_fj));
}

void sf_ledger_print(FILE *out, const sf_ledger *l, double views)
{
  fprintf(out, "%-52s %22s %12s %9s\n", "paper ledger: MAC 4600 fJ, SOP 900 fJ", "fJ", "mJ per view", "saving");
  fprintf(out, "%-52s %22" PRIu64 "\n", "  MACs of real-valued inputs, h(t) at every step", l->mac_fj);
  fprintf(out, "%-52s %22" PRIu64 "\n", "  SOPs", l->sop_fj);
  ledger_row(out, "spiking net", l->spiking_fj, views, l->ann_fj);
  ledger_row(out, "ReLU twin: every synapse a MAC once per sample", l->ann_fj, views, 0);
  fprintf(out, "other readings of the paper's first layers:\n");
  ledger_row(out, "  R = D1 and C1: h(t) x W3 once per sample", l->h_once_fj, views, l->ann_fj);
  ledger_row(out, "  R = D1 (and d): h(t) x W3 as SOPs at the mean rate", l->h_spikes_fj, views, l->ann_fj);
  fprintf(out, "the paper ledger against a twin that multiplies the direction once per ray, too:\n");
  ledger_row(out, "  ReLU twin, d x W3 once per ray", l->ann_hoisted_fj, views, 0);
  ledger_row(out, "  spiking net", l->spiking_fj, views, l->ann_hoisted_fj);
}

static void add_saving(cJSON *json, const char *key, uint64_t spiking_fj, uint64_t ann_fj)
{
  sf_json_add_real(json, key, sf_saving_percent(spiking_fj, ann_fj));
}

cJSON *sf_ledger_json(const sf_ledger *l)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "mac_price_fj", SF_MAC_FJ);
  cJSON_AddNumberToObject(json, "sop_price_fj", SF_SOP_FJ);
  sf_json_add_u64(json, "mac_fj", l->mac_fj);
  sf_json_add_u64(json, "sop_fj", l->sop_fj);
  sf_json_add_u64(json, "spiking_fj", l->spiking_fj);
  sf_json_add_u64(json, "ann_fj", l->ann_fj);
  add_saving(json, "saving_percent", l->spiking_fj, l->ann_fj);
  sf_json_add_u64(json, "h_once_fj", l->h_once_fj);
  add_saving(json, "h_once_saving_percent", l->h_once_fj, l->ann_fj);
  sf_json_add_u64(json, "h_spikes_fj", l->h_spikes_fj);
  add_saving(json, "h_spikes_saving_percent", l->h_spikes_fj, l->ann_fj);
  sf_json_add_u64(json, "ann_hoisted_fj", l->ann_hoisted_fj);
  add_saving(json, "hoisted_saving_percent", l->spiking_fj, l->ann_hoisted_fj);
  return json;
}

void sf_limits_print(FILE *out)
{
  fprintf(out, "not modelled, by any ledger:\n");
  for (int i = 0; not_modelled[i]; i++) fprintf(out, "  - %s\n", not_modelled[i]);
  fprintf(out, "known criticism of the paper's metric:\n");
  for (int i = 0; criticism[i]; i++) fprintf(out, "  - %s\n", criticism[i]);
}

static void add_list(cJSON *object, const char *key, const char *const *text)
{
  cJSON *list = cJSON_AddArrayToObject(object, key);
  for (int i = 0; text[i]; i++) cJSON_AddItemToArray(list, cJSON_CreateString(text[i]));
}

void sf_limits_json(cJSON *object)
{
  add_list(object, "not_modelled", not_modelled);
  add_list(object, "criticism", criticism);
}
