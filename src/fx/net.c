/* One sample through the density and the colour net.
 * Mirror: rtl/sf_core.sv (the order of the layers; the arithmetic is in the units) */
#include "src/fx/net.h"
#include "src/fx/count.h"
#include "src/fx/current.h"
#include "src/fx/round.h"
#include "src/fx/unit.h"
#include <string.h>
#include "src/fx/nofloat.h"

enum { STRIP = 16, COLOURS = 3 };

typedef struct state {
  int32_t d1_current[SF_LANES];
  int32_t v[SF_LAYERS][SF_LANES];
  int32_t current[SF_LANES]; /* of the layer at work, in its membrane's LSB for spiking layers */
  int16_t h[SF_OUT_MAX];
  fx_events events;
  fx_out acc;
} state;

/* A current in the 24 bits of a membrane; the number of lanes that did not fit. */
static int saturate(int32_t *current, int n)
{
  int saturated = 0;
  for (int o = 0; o < n; o++) {
    const int32_t kept = (int32_t)fx_sat(current[o], SF_MEMBRANE_BITS);
    saturated += kept != current[o];
    current[o] = kept;
  }
  return saturated;
}

/* Lanes beyond n_out have zero weights, hence no current, and theta >= 1: they stay silent. */
static int strips(int n)
{
  return (n + STRIP - 1) / STRIP * STRIP;
}

static void fire(state *s, const fx_net *net, int l, int t, const int32_t *current, fx_trace *trace)
{
  fx_layer layer = net->layer[l];
  int32_t *membrane = trace ? trace->membrane[l][t] : NULL;
  layer.theta = fx_net_theta(net, l);
  s->events.saturated[l] += (uint64_t)fx_plif_layer(s->v[l], current, strips(layer.n_out), &layer, net->mode, t == 0,
                                                    s->events.spikes[l][t], membrane);
}

static void keep_current(fx_trace *trace, int l, int t, const int32_t *current, int n)
{
  if (trace) memcpy(trace->current[l][t], current, (size_t)n * sizeof *current);
}

/* exp2 of D2's current into the density. */
static void read_density(state *s, const fx_net *net, int t, int32_t current)
{
  const fx_layer *d2 = &net->layer[FX_D2];
  const fx_scale scale = fx_net_scale(net, &net->exp_in);
  const uint32_t e = fx_exp2(fx_exp2_argument(current, &scale));
  s->events.saturated[FX_D2] += e == (1u << SF_SIGMA_BITS) - 1;
  s->acc.sigma = fx_integrate_density(s->acc.sigma, e, d2->k, net->mode, t == 0, &s->events.saturated[FX_D2]);
}

static void read_colour(state *s, const fx_net *net, int t, int o, int32_t current)
{
  const fx_scale scale = fx_net_scale(net, &net->sigmoid_in);
  const uint32_t value = fx_sigmoid(fx_sigmoid_argument(current, &scale));
  s->acc.colour[o] =
      fx_integrate_colour(s->acc.colour[o], value, net->layer[FX_C3].k, net->mode, t == 0, &s->events.saturated[FX_C3]);
}

/* D1's spikes and D2's currents of one step. */
static void density_currents(state *s, const fx_net *net, int t, const int32_t *current, fx_trace *trace)
{
  const fx_layer *d2 = &net->layer[FX_D2];
  keep_current(trace, FX_D1, t, s->d1_current, net->layer[FX_D1].n_out);
  fire(s, net, FX_D1, t, current, trace);
  fx_current_spikes(s->current, d2->w, s->events.spikes[FX_D1][t], NULL, strips(d2->n_out));
  keep_current(trace, FX_D2, t, s->current, d2->n_out);
}

static void density_step(state *s, const fx_net *net, int t, fx_trace *trace)
{
  density_currents(s, net, t, s->d1_current, trace);
  read_density(s, net, t, s->current[0]);
  if (trace) trace->membrane[FX_D2][t][0] = (int32_t)s->acc.sigma;
  for (int j = 0; j < fx_net_h(net); j++) s->h[j] = (int16_t)(s->current[1 + j] >> SF_H_SHIFT);
}

static const int8_t *bias_row(const fx_layer *layer)
{
  return layer->bias ? layer->w + (size_t)layer->n_in * SF_LANES : NULL;
}

/* C1's current from h; only a decoder's, which does not change, can saturate. */
static void c1_currents(state *s, const fx_net *net, int t, const int32_t *base)
{
  const fx_layer *c1 = &net->layer[FX_C1];
  const int8_t *w = c1->w + (size_t)fx_net_constants(net) * SF_LANES;
  memcpy(s->current, base, sizeof s->current);
  fx_current_mac(s->current, w, s->h, fx_net_h(net), strips(c1->n_out));
  const int saturated = saturate(s->current, strips(c1->n_out));
  if (t == 0) s->events.saturated[FX_C1] += (uint64_t)saturated;
}

static void c2_currents(state *s, const fx_net *net, int t)
{
  const fx_layer *c2 = &net->layer[FX_C2];
  fx_current_spikes(s->current, c2->w, s->events.spikes[FX_C1][t], bias_row(c2), strips(c2->n_out));
}

static void hidden_step(state *s, const fx_net *net, int t, const int32_t *base, fx_trace *trace)
{
  const fx_layer *c1 = &net->layer[FX_C1], *c2 = &net->layer[FX_C2];
  c1_currents(s, net, t, base);
  keep_current(trace, FX_C1, t, s->current, c1->n_out);
  fire(s, net, FX_C1, t, s->current, trace);
  c2_currents(s, net, t);
  keep_current(trace, FX_C2, t, s->current, c2->n_out);
  for (int o = 0; o < strips(c2->n_out); o++) s->current[o] *= 1 << fx_layer_frac(FX_C2, net->mode);
  fire(s, net, FX_C2, t, s->current, trace);
}

static void c3_currents(state *s, const fx_net *net, int t, fx_trace *trace)
{
  const fx_layer *c3 = &net->layer[FX_C3];
  fx_current_spikes(s->current, c3->w, s->events.spikes[FX_C2][t], bias_row(c3), STRIP);
  keep_current(trace, FX_C3, t, s->current, c3->n_out);
}

static void colour_step(state *s, const fx_net *net, int t, fx_trace *trace)
{
  c3_currents(s, net, t, trace);
  for (int o = 0; o < COLOURS; o++) {
    read_colour(s, net, t, o, s->current[o]);
    if (trace) trace->membrane[FX_C3][t][o] = (int32_t)s->acc.colour[o];
  }
}

/* ---- radix: a layer begins when all steps of the one before are there ---- */

static const int32_t no_current[SF_LANES];

static void weigh(int32_t *sum, const int32_t *current, int n)
{
  for (int o = 0; o < n; o++) sum[o] = fx_weigh(sum[o], current[o]);
}

/* What a neuron is given at step t: its current comes once. */
static const int32_t *once(const int32_t *current, int t)
{
  return t == 0 ? current : no_current;
}

static void radix_density(state *s, const fx_net *net, fx_trace *trace)
{
  const int n = net->layer[FX_D2].n_out;
  int32_t sum[SF_OUT_MAX] = {0};
  for (int t = 0; t < net->steps; t++) {
    density_currents(s, net, t, once(s->d1_current, t), trace);
    weigh(sum, s->current, n);
    if (trace) trace->membrane[FX_D2][t][0] = sum[0];
  }
  read_density(s, net, 0, sum[0]);
  for (int j = 0; j < fx_net_h(net); j++) s->h[j] = (int16_t)(fx_weighed_h(sum[1 + j], net->steps));
}

/* C1; leaves C2's sum of all steps. */
static void radix_c1(state *s, const fx_net *net, const int32_t *base, int32_t sum[SF_LANES], fx_trace *trace)
{
  int32_t current[SF_LANES];
  c1_currents(s, net, 0, base);
  memcpy(current, s->current, sizeof current);
  memset(sum, 0, SF_LANES * sizeof *sum);
  for (int t = 0; t < net->steps; t++) {
    keep_current(trace, FX_C1, t, current, net->layer[FX_C1].n_out);
    fire(s, net, FX_C1, t, once(current, t), trace);
    c2_currents(s, net, t);
    weigh(sum, s->current, strips(net->layer[FX_C2].n_out));
  }
}

static void radix_c2(state *s, const fx_net *net, const int32_t sum[SF_LANES], fx_trace *trace)
{
  const int n = net->layer[FX_C2].n_out;
  int32_t current[SF_LANES];
  for (int o = 0; o < strips(n); o++) current[o] = sum[o] * (1 << (SF_T_MAX - net->steps));
  for (int t = 0; t < net->steps; t++) {
    keep_current(trace, FX_C2, t, sum, n);
    fire(s, net, FX_C2, t, once(current, t), trace);
  }
}

static void radix_colour(state *s, const fx_net *net, fx_trace *trace)
{
  int32_t sum[COLOURS] = {0};
  for (int t = 0; t < net->steps; t++) {
    c3_currents(s, net, t, trace);
    weigh(sum, s->current, COLOURS);
    if (trace) memcpy(trace->membrane[FX_C3][t], sum, sizeof sum);
  }
  for (int o = 0; o < COLOURS; o++) read_colour(s, net, 0, o, sum[o]);
}

static void radix_layers(state *s, const fx_net *net, const int32_t *base, fx_trace *trace)
{
  int32_t c2_sum[SF_LANES];
  if (!fx_net_decodes(net)) radix_density(s, net, trace);
  radix_c1(s, net, base, c2_sum, trace);
  radix_c2(s, net, c2_sum, trace);
  radix_colour(s, net, trace);
}

/* ---- a sample ---- */

void fx_net_direction(const fx_net *net, const int16_t *dir, int32_t *base, fx_counts *counts)
{
  const fx_layer *c1 = &net->layer[FX_C1];
  memset(base, 0, SF_LANES * sizeof *base);
  fx_current_mac(base, c1->w, dir, fx_net_constants(net), strips(c1->n_out));
  if (c1->bias) fx_current_mac(base, bias_row(c1), (const int16_t[]){(int16_t)c1->bias}, 1, strips(c1->n_out));
  if (counts && !fx_net_constants_per_sample(net)) fx_count_rays(counts, net, 1);
}

void fx_net_events(const fx_net *net, const int16_t *f, const int32_t *base, fx_out *out, fx_events *events,
                   fx_trace *trace)
{
  const fx_layer *d1 = &net->layer[FX_D1];
  state s;
  memset(s.d1_current, 0, sizeof s.d1_current);
  memset(&s.events, 0, sizeof s.events);
  memset(&s.acc, 0, sizeof s.acc);
  if (trace) memset(trace, 0, sizeof *trace);
  fx_current_mac(s.d1_current, d1->w, f, d1->n_in, strips(d1->n_out));
  for (int t = 0; t < net->steps && net->mode != FX_RADIX; t++) {
    if (!fx_net_decodes(net)) density_step(&s, net, t, trace);
    hidden_step(&s, net, t, base, trace);
    colour_step(&s, net, t, trace);
  }
  if (net->mode == FX_RADIX) radix_layers(&s, net, base, trace);
  *out = s.acc;
  *events = s.events;
}

/* Adds one step of one neuron layer (0..FX_SPIKING-1); seen starts at 0. */
static void add_firing(fx_firing *sum, int layer, int t, const uint64_t now[SF_SPIKE_WORDS],
                       uint64_t seen[SF_SPIKE_WORDS])
{
  for (int word = 0; word < SF_SPIKE_WORDS; word++) {
    sum->spikes[layer][t] += (uint64_t)__builtin_popcountll(now[word]);
    sum->fresh[layer][t] += (uint64_t)__builtin_popcountll(now[word] & ~seen[word]);
    seen[word] |= now[word];
  }
}

static void count_events(const fx_net *net, const fx_events *events, fx_counts *counts)
{
  fx_firing firing = {.samples = 1};
  for (int l = 0; l < FX_SPIKING; l++) {
    uint64_t seen[SF_SPIKE_WORDS] = {0};
    for (int t = 0; t < net->steps; t++) add_firing(&firing, l, t, events->spikes[fx_spiking_layers[l]][t], seen);
  }
  fx_count_firing(counts, net, &firing);
  for (int l = 0; l < SF_LAYERS; l++) {
    counts->saturated[l] += events->saturated[l];
    counts->saturated_samples[l] += events->saturated[l] != 0;
  }
}

void fx_net_sample(const fx_net *net, const int16_t *f, const int32_t *base, fx_out *out, fx_trace *trace,
                   fx_counts *counts)
{
  fx_events events;
  fx_net_events(net, f, base, out, &events, trace);
  if (trace) memcpy(trace->spikes, events.spikes, sizeof events.spikes);
  if (counts) count_events(net, &events, counts);
}

void fx_net_next(const fx_net *net, const int16_t *dir, bool first, const int16_t *f, int32_t *base, fx_out *out,
                 fx_trace *trace, fx_counts *counts)
{
  const bool anew = fx_net_constants_per_sample(net);
  if (first || anew) fx_net_direction(net, anew ? f : dir, base, counts);
  fx_net_sample(net, f, base, out, trace, counts);
}
