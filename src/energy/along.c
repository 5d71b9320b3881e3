#include "energy/along.h"

static uint64_t synapses(const sf_model *m, int layer)
{
  return m->param[sf_layer_weights[layer]].size;
}

fx_cost sf_float_cost(const sf_model *m, const sf_ray_events *e)
{
  const uint64_t hidden = (uint64_t)m->config.hidden, samples = e->samples;
  const uint64_t harmonics = sf_model_decodes(m) ? 0 : SF_DIR_FEATURES * hidden;
  const uint64_t behind[3] = {sf_model_decodes(m) ? 0 : SF_DENSITY_OUT, hidden, 3}; /* a neuron of D1, C1, C2 */
  fx_cost cost = {.macs = samples * (synapses(m, 0) + synapses(m, 2) - harmonics) + e->rays * harmonics};
  for (int l = 0; l < 3; l++) cost.spikes += e->spikes[l], cost.sops += e->spikes[l] * behind[l];
  if (m->config.net != SF_NET_ANN) return cost;
  cost.macs = 0;
  for (int l = 0; l < SF_LAYERS; l++) cost.macs += samples * synapses(m, l);
  return cost;
}
