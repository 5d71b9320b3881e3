/* The third, independent count: what the events of one sample must have been, from its spike bitmaps and the sizes of
 * the net alone. It mirrors the definitions in fx.h, not the code of src/fx. */
#include "energy/energy.h"

enum { SPIKING_STATE_BYTES = 3, INTEGRATOR_STATE_BYTES = 4 };

static uint64_t fired(const uint64_t bitmap[SF_SPIKE_WORDS])
{
  uint64_t neurons = 0;
  for (int word = 0; word < SF_SPIKE_WORDS; word++) neurons += (uint64_t)__builtin_popcountll(bitmap[word]);
  return neurons;
}

static void count_state(fx_layer_counts *c, int t, uint64_t neurons, uint64_t bytes)
{
  c->updates[t] += neurons;
  c->state_w[t] += neurons * bytes;
  /* cppcheck-suppress arrayIndexOutOfBoundsCond ; t < steps <= SF_T_MAX, checked by fx_scene_check */
  if (t > 0) c->state_r[t] += neurons * bytes;
}

/* A row of weights is held for as long as it has products to give: it is read once, at the first step. */
static void count_mac(fx_layer_counts *c, int t, int n_in, int n_out)
{
  uint64_t products = (uint64_t)n_in * (uint64_t)n_out;
  c->mac[t] += products;
  if (t == 0) c->weight[t] += products;
}

/* A row of a layer fed by spikes is read when its neuron fires for the first time in the sample. */
static void count_synapses(fx_layer_counts *c, int t, const uint64_t in[SF_SPIKE_WORDS], uint64_t seen[SF_SPIKE_WORDS],
                           uint64_t n_out)
{
  uint64_t new_rows[SF_SPIKE_WORDS];
  for (int word = 0; word < SF_SPIKE_WORDS; word++) new_rows[word] = in[word] & ~seen[word], seen[word] |= in[word];
  c->sop[t] += fired(in) * n_out;
  c->weight[t] += fired(new_rows) * n_out;
}

/* Radix asks the functions once. What it adds up is currents: of the density net all of them, h among them. */
static void count_integrators(const fx_net *net, fx_layer_counts *c, int t, uint64_t outputs, uint64_t currents)
{
  const bool radix = net->mode == FX_RADIX;
  if (!radix || t + 1 == net->steps) c->special[t] += outputs;
  count_state(c, t, radix ? currents : outputs, INTEGRATOR_STATE_BYTES);
}

/* Radix: C2's neurons first add up the sums of all steps; with the last one they fire for the first time. */
static void count_sums(const fx_net *net, fx_layer_counts *c, int t, uint64_t neurons)
{
  if (net->mode != FX_RADIX || t + 1 == net->steps) return;
  c->updates[t] += neurons;
  c->state_w[t] += neurons * SPIKING_STATE_BYTES;
  c->state_r[t] += neurons * SPIKING_STATE_BYTES;
}

/* A row of biases is read, but it is no MAC and no SOP. */
static void count_bias(fx_layer_counts *c, const fx_layer *layer)
{
  if (layer->bias) c->weight[0] += (uint64_t)layer->n_out;
}

void sf_recount_sample(const fx_net *net, const uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS], bool first_of_ray,
                       fx_counts *counts)
{
  const fx_layer *size = net->layer;
  fx_layer_counts *c = counts->layer;
  uint64_t seen[FX_SPIKING][SF_SPIKE_WORDS] = {0};
  const bool per_sample = fx_net_constants_per_sample(net);

  counts->samples++;
  counts->rays += first_of_ray && !per_sample;
  count_mac(&c[FX_D1], 0, size[FX_D1].n_in, size[FX_D1].n_out);
  if (first_of_ray || per_sample) {
    count_mac(&c[FX_C1], 0, fx_net_constants(net), size[FX_C1].n_out);
    count_bias(&c[FX_C1], &size[FX_C1]);
  }
  count_bias(&c[FX_C2], &size[FX_C2]);
  count_bias(&c[FX_C3], &size[FX_C3]);
  for (int t = 0; t < net->steps; t++) {
    for (int s = 0; s < FX_SPIKING; s++) {
      const int l = fx_spiking_layers[s];
      c[l].spikes[t] += fired(spikes[l][t]);
      count_state(&c[l], t, (uint64_t)size[l].n_out, SPIKING_STATE_BYTES);
    }
    count_sums(net, &c[FX_C2], t, (uint64_t)size[FX_C2].n_out);
    if (t == 0 || net->mode != FX_RADIX) count_mac(&c[FX_C1], t, fx_net_h(net), size[FX_C1].n_out);
    for (int s = 0; s < FX_SPIKING; s++) {
      const int fed = fx_spiking_layers[s] + 1; /* the layer behind */
      count_synapses(&c[fed], t, spikes[fx_spiking_layers[s]][t], seen[s], (uint64_t)size[fed].n_out);
    }
    count_integrators(net, &c[FX_D2], t, size[FX_D2].n_out > 0, (uint64_t)size[FX_D2].n_out);
    count_integrators(net, &c[FX_C3], t, 3, 3);
  }
}
