/* A net, its samples and its counters in the accelerator's words. Needs no model of the accelerator. */
#include "sim/sim.h"
#include <string.h>

enum { VALUES = 4 };

sf_net_blob sf_dut_blob(const fx_net *net)
{
  const fx_scale density = fx_net_scale(net, &net->exp_in), colour = fx_net_scale(net, &net->sigmoid_in);
  sf_net_blob blob = {.mode = net->mode,
                      .steps = net->steps,
                      .exp_in = {density.mul, density.shift, density.bias},
                      .sigmoid_in = {colour.mul, colour.shift, colour.bias}};
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &net->layer[l];
    blob.layer[l] = (sf_layer_blob){layer->n_in, layer->n_out, layer->k, fx_net_theta(net, l), layer->bias, layer->w};
  }
  return blob;
}

static uint64_t pack(const int16_t *value, int n)
{
  uint64_t word = 0;
  for (int i = 0; i < n; i++) word |= (uint64_t)(uint16_t)value[i] << (16 * i);
  return word;
}

static int pack_all(uint64_t *words, const int16_t *value, int n)
{
  int beats = 0;
  for (int i = 0; i < n; i += VALUES) words[beats++] = pack(value + i, n - i < VALUES ? n - i : VALUES);
  return beats;
}

int sf_dut_packet(const fx_net *net, const sf_dut_sample *sample, uint64_t *words)
{
  const int beats = sample->first ? pack_all(words, sample->ray->dir, fx_net_harmonics(net)) : 0;
  return beats + pack_all(words + beats, sample->f, fx_net_inputs(net));
}

void sf_dut_counts_of(const sf_driver_counters *read, fx_counts *counts)
{
  memset(counts, 0, sizeof *counts);
  for (int l = 0; l < SF_LAYERS; l++)
    for (int e = 0; e < SF_EVENTS; e++)
      memcpy(counts->layer[l].event[e], read->event[e][l], sizeof counts->layer[l].event[e]);
  counts->samples = read->samples;
  counts->rays = read->rays;
}
