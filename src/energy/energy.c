#include "energy/energy.h"
#include "base/saturate.h"
#include <math.h>

const sf_event sf_events[SF_EVENTS] = {
#define EVENT(id, name, title, unit, fj) {#name, title},
    SF_EVENT_TABLE(EVENT)
#undef EVENT
};

static uint64_t layer_total(const fx_layer_counts *layer, int event)
{
  uint64_t sum = 0;
  for (int t = 0; t < SF_T_MAX; t++) sum = sf_add_u64(sum, layer->event[event][t]);
  return sum;
}

uint64_t sf_event_total(const fx_counts *counts, int event)
{
  uint64_t sum = 0;
  for (int l = 0; l < SF_LAYERS; l++) sum = sf_add_u64(sum, layer_total(&counts->layer[l], event));
  return sum;
}

uint64_t sf_cost_fj(const fx_cost *cost)
{
  return sf_add_u64(sf_multiply_u64(cost->macs, SF_MAC_FJ), sf_multiply_u64(cost->sops, SF_SOP_FJ));
}

fx_cost sf_cost_of(const fx_counts *counts)
{
  return (fx_cost){sf_event_total(counts, SF_EVENT_MAC), sf_event_total(counts, SF_EVENT_SOP),
                   sf_event_total(counts, SF_EVENT_SPIKES)};
}

uint64_t sf_energy_fj(const fx_counts *counts)
{
  const fx_cost cost = sf_cost_of(counts);
  return sf_cost_fj(&cost);
}

static uint64_t synapses(const fx_net *net)
{
  uint64_t sum = 0;
  for (int l = 0; l < SF_LAYERS; l++) sum += (uint64_t)net->layer[l].n_in * (uint64_t)net->layer[l].n_out;
  return sum;
}

uint64_t sf_energy_ann_fj(const fx_net *net, uint64_t samples)
{
  return sf_multiply_u64(sf_multiply_u64(synapses(net), samples), SF_MAC_FJ);
}

static uint64_t direction_synapses(const fx_net *net)
{
  return (uint64_t)fx_net_harmonics(net) * (uint64_t)net->layer[FX_C1].n_out;
}

/* round(a * b / c) without losing bits; a <= UINT64_MAX, b <= c. */
static uint64_t scale_round(uint64_t a, uint64_t b, uint64_t c)
{
  __extension__ typedef unsigned __int128 u128;
  return c == 0 ? 0 : (uint64_t)(((u128)a * b + c / 2) / c);
}

static uint64_t spiking_neurons(const fx_counts *counts, int event)
{
  uint64_t sum = 0;
  for (int s = 0; s < FX_SPIKING; s++) sum = sf_add_u64(sum, layer_total(&counts->layer[fx_spiking_layers[s]], event));
  return sum;
}

/* Updates that may fire. Radix: not those at which C2 adds up all sums but the last. */
static uint64_t firing_updates(const fx_net *net, const fx_counts *counts)
{
  const uint64_t updates = spiking_neurons(counts, SF_EVENT_UPDATES);
  const uint64_t sums = (uint64_t)net->layer[FX_C2].n_out * (uint64_t)(net->steps - 1);
  const uint64_t others = net->mode == FX_RADIX ? sf_multiply_u64(sums, counts->samples) : 0;
  return updates > others ? updates - others : 0;
}

sf_status sf_ledger_make(const fx_net *net, const fx_counts *counts, sf_ledger *ledger)
{
  uint64_t mac = sf_event_total(counts, SF_EVENT_MAC), sop = sf_event_total(counts, SF_EVENT_SOP);
  uint64_t c1_mac = layer_total(&counts->layer[FX_C1], SF_EVENT_MAC);
  uint64_t d_mac = sf_multiply_u64(direction_synapses(net), counts->rays);
  if (d_mac > c1_mac || net->steps < 1)
    return sf_fail(SF_E_RANGE, "audit: C1 counts %llu MACs, fewer than the direction's %llu",
                   (unsigned long long)c1_mac, (unsigned long long)d_mac);
  const bool radix = net->mode == FX_RADIX; /* which multiplies h once, not at every step */
  const uint64_t h_mac = fx_net_constants_per_sample(net) ? 0 : c1_mac - d_mac, steps = (uint64_t)net->steps;
  const uint64_t h_once = radix ? h_mac : h_mac / steps, h_steps = radix ? sf_multiply_u64(h_mac, steps) : h_mac;
  const uint64_t h_sop = scale_round(h_steps, spiking_neurons(counts, SF_EVENT_SPIKES), firing_updates(net, counts));

  *ledger = (sf_ledger){.mac_fj = sf_multiply_u64(mac, SF_MAC_FJ), .sop_fj = sf_multiply_u64(sop, SF_SOP_FJ)};
  ledger->spiking_fj = sf_energy_fj(counts);
  ledger->h_once_fj = sf_add_u64(sf_multiply_u64(mac - h_mac + h_once, SF_MAC_FJ), ledger->sop_fj);
  ledger->h_spikes_fj =
      sf_add_u64(sf_multiply_u64(mac - h_mac, SF_MAC_FJ), sf_multiply_u64(sf_add_u64(sop, h_sop), SF_SOP_FJ));
  ledger->ann_fj = sf_energy_ann_fj(net, counts->samples);
  ledger->ann_hoisted_fj =
      sf_add_u64(sf_multiply_u64(sf_multiply_u64(synapses(net) - direction_synapses(net), counts->samples), SF_MAC_FJ),
                 sf_multiply_u64(d_mac, SF_MAC_FJ));
  if (mac == UINT64_MAX || ledger->spiking_fj == UINT64_MAX || ledger->ann_fj == UINT64_MAX ||
      ledger->h_spikes_fj == UINT64_MAX || ledger->ann_hoisted_fj == UINT64_MAX)
    return sf_fail(SF_E_RANGE, "audit: the energy of %llu samples does not fit in 64 bits of fJ; audit fewer views",
                   (unsigned long long)counts->samples);
  return sf_ok();
}

double sf_saving_percent(uint64_t spiking_fj, uint64_t ann_fj)
{
  return ann_fj == 0 ? NAN : 100 * (1 - (double)spiking_fj / (double)ann_fj);
}
