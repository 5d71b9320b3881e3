#include "src/fx/count.h"
#include "src/fx/nofloat.h"

enum { MEMBRANE_BYTES = (SF_MEMBRANE_BITS + 7) / 8, INTEGRATOR_BYTES = 4 };

/* Every member of fx_layer_counts is an array of SF_T_MAX 64-bit sums, so both structs are flat arrays of them. */
_Static_assert(sizeof(fx_counts) % sizeof(uint64_t) == 0, "fx_counts holds only 64-bit counters");

void fx_counts_add(fx_counts *sum, const fx_counts *more)
{
  uint64_t *to = (uint64_t *)sum;
  const uint64_t *from = (const uint64_t *)more;
  for (size_t i = 0; i < sizeof *sum / sizeof *to; i++) to[i] += from[i];
}

static uint64_t direction_macs(const fx_net *net)
{
  return (uint64_t)fx_net_constants(net) * (uint64_t)net->layer[FX_C1].n_out;
}

/* Bytes of the biases' row, read as often as the constant inputs. */
static uint64_t bias_bytes(const fx_layer *layer)
{
  return layer->bias ? (uint64_t)layer->n_out : 0;
}

static uint64_t feature_macs(const fx_net *net)
{
  return (uint64_t)net->layer[FX_D1].n_in * (uint64_t)net->layer[FX_D1].n_out;
}

static uint64_t h_macs(const fx_net *net)
{
  return (uint64_t)fx_net_h(net) * (uint64_t)net->layer[FX_C1].n_out;
}

/* Steps at which C1 multiplies h. */
static uint64_t h_products(const fx_net *net)
{
  return net->mode == FX_RADIX ? 1 : (uint64_t)net->steps;
}

uint64_t fx_macs_of_ray(const fx_net *net)
{
  return fx_net_constants_per_sample(net) ? 0 : direction_macs(net);
}

uint64_t fx_macs_of_sample(const fx_net *net)
{
  return feature_macs(net) + h_products(net) * h_macs(net) + direction_macs(net) - fx_macs_of_ray(net);
}

static void count_constants(fx_counts *counts, const fx_net *net, uint64_t times)
{
  counts->layer[FX_C1].mac[0] += times * direction_macs(net);
  counts->layer[FX_C1].weight[0] += times * (direction_macs(net) + bias_bytes(&net->layer[FX_C1]));
}

void fx_count_rays(fx_counts *counts, const fx_net *net, uint64_t rays)
{
  counts->rays += rays;
  if (!fx_net_constants_per_sample(net)) count_constants(counts, net, rays);
}

/* A row of weights is held for as long as it has products to give: it is read once, at the first step. */
static void count_products(fx_layer_counts *c, int t, uint64_t macs)
{
  c->mac[t] += macs;
  if (t == 0) c->weight[t] += macs;
}

/* `times` updates of `states` each; the first one at step 0 reads nothing. */
static void count_updates(fx_layer_counts *c, int t, uint64_t states, uint64_t times, uint64_t bytes)
{
  c->updates[t] += states * times;
  c->state_w[t] += states * times * bytes;
  c->state_r[t] += states * (times - (t == 0)) * bytes;
}

/* Integrators of D2: what is weighed is all of its outputs. */
static uint64_t d2_states(const fx_net *net)
{
  return net->mode == FX_RADIX ? (uint64_t)net->layer[FX_D2].n_out : 1;
}

/* Of radix, C2's neurons add up the sums of all steps, and with the last one they fire for the first time. */
static uint64_t c2_updates(const fx_net *net, int t)
{
  return net->mode == FX_RADIX && t < net->steps - 1 ? 2 : 1;
}

/* A layer fed by spikes reads the row of a neuron once per sample: at the first step at which it fires. */
static void count_synapses(fx_layer_counts *c, const fx_layer *layer, int t, uint64_t spikes, uint64_t rows_read)
{
  c->sop[t] += spikes * (uint64_t)layer->n_out;
  c->weight[t] += rows_read * (uint64_t)layer->n_out;
}

void fx_count_firing(fx_counts *counts, const fx_net *net, const fx_firing *firing)
{
  enum { D1, C1, C2 };
  const fx_layer *layer = net->layer;
  const uint64_t n = firing->samples, densities = fx_net_decodes(net) ? 0 : n;
  fx_layer_counts *c = counts->layer;
  counts->samples += n;
  count_products(&c[FX_D1], 0, n * feature_macs(net));
  if (fx_net_constants_per_sample(net)) count_constants(counts, net, n);
  c[FX_C2].weight[0] += n * bias_bytes(&layer[FX_C2]);
  c[FX_C3].weight[0] += n * bias_bytes(&layer[FX_C3]);
  for (int t = 0; t < net->steps; t++) {
    c[FX_D1].spikes[t] += firing->spikes[D1][t];
    c[FX_C1].spikes[t] += firing->spikes[C1][t];
    c[FX_C2].spikes[t] += firing->spikes[C2][t];
    if (t < (int)h_products(net)) count_products(&c[FX_C1], t, n * h_macs(net));
    count_synapses(&c[FX_D2], &layer[FX_D2], t, firing->spikes[D1][t], firing->fresh[D1][t]);
    count_synapses(&c[FX_C2], &layer[FX_C2], t, firing->spikes[C1][t], firing->fresh[C1][t]);
    count_synapses(&c[FX_C3], &layer[FX_C3], t, firing->spikes[C2][t], firing->fresh[C2][t]);
    count_updates(&c[FX_D1], t, n * (uint64_t)layer[FX_D1].n_out, 1, MEMBRANE_BYTES);
    count_updates(&c[FX_C1], t, n * (uint64_t)layer[FX_C1].n_out, 1, MEMBRANE_BYTES);
    count_updates(&c[FX_C2], t, n * (uint64_t)layer[FX_C2].n_out, c2_updates(net, t), MEMBRANE_BYTES);
    count_updates(&c[FX_D2], t, densities * d2_states(net), 1, INTEGRATOR_BYTES);
    count_updates(&c[FX_C3], t, n * (uint64_t)layer[FX_C3].n_out, 1, INTEGRATOR_BYTES);
    if (!fx_net_reads_tables(net, t)) continue;
    c[FX_D2].special[t] += densities;
    c[FX_C3].special[t] += n * (uint64_t)layer[FX_C3].n_out;
  }
}
