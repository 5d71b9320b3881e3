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
  int32_t weighed[1 + COLOURS]; /* currents of the density and the colours, of weighted spikes */
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
  const fx_layer *layer = &net->layer[l];
  int32_t *membrane = trace ? trace->membrane[l][t] : NULL;
  s->events.saturated[l] += (uint64_t)fx_plif_layer(s->v[l], current, strips(layer->n_out), layer, net->mode, t == 0,
                                                    s->events.spikes[l][t], membrane);
}

static void keep_current(fx_trace *trace, int l, int t, const int32_t *current, int n)
{
  if (trace) memcpy(trace->current[l][t], current, (size_t)n * sizeof *current);
}

/* What the table of output `at` (0: the density, 1..3: colours) is asked for at step t. */
static int32_t table_current(state *s, const fx_net *net, int at, int32_t current)
{
  if (net->mode != FX_RADIX) return current;
  return s->weighed[at] = fx_weigh(s->weighed[at], current);
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

/* An output's state for the trace. */
static int32_t integrated(const state *s, const fx_net *net, int at, uint32_t acc)
{
  return net->mode == FX_RADIX ? s->weighed[at] : (int32_t)acc;
}

static void density_step(state *s, const fx_net *net, int t, fx_trace *trace)
{
  const fx_layer *d2 = &net->layer[FX_D2];
  keep_current(trace, FX_D1, t, s->d1_current, net->layer[FX_D1].n_out);
  fire(s, net, FX_D1, t, s->d1_current, trace);
  fx_current_spikes(s->current, d2->w, s->events.spikes[FX_D1][t], NULL, strips(d2->n_out));
  keep_current(trace, FX_D2, t, s->current, d2->n_out);
  const int32_t current = table_current(s, net, 0, s->current[0]);
  if (fx_net_reads_tables(net, t)) read_density(s, net, t, current);
  if (trace) trace->membrane[FX_D2][t][0] = integrated(s, net, 0, s->acc.sigma);
  for (int j = 0; j < fx_net_h(net); j++) s->h[j] = (int16_t)(s->current[1 + j] >> SF_H_SHIFT);
}

static const int8_t *bias_row(const fx_layer *layer)
{
  return layer->bias ? layer->w + (size_t)layer->n_in * SF_LANES : NULL;
}

static void hidden_step(state *s, const fx_net *net, int t, const int32_t *base, fx_trace *trace)
{
  const fx_layer *c1 = &net->layer[FX_C1], *c2 = &net->layer[FX_C2];
  const int8_t *w = c1->w + (size_t)fx_net_constants(net) * SF_LANES;
  memcpy(s->current, base, sizeof s->current);
  fx_current_mac(s->current, w, s->h, fx_net_h(net), strips(c1->n_out));
  const int saturated = saturate(s->current, strips(c1->n_out));
  if (t == 0) s->events.saturated[FX_C1] += (uint64_t)saturated; /* of a decoder, whose current does not change */
  keep_current(trace, FX_C1, t, s->current, c1->n_out);
  fire(s, net, FX_C1, t, s->current, trace);
  fx_current_spikes(s->current, c2->w, s->events.spikes[FX_C1][t], bias_row(c2), strips(c2->n_out));
  keep_current(trace, FX_C2, t, s->current, c2->n_out);
  for (int o = 0; o < strips(c2->n_out); o++) s->current[o] *= 1 << SF_AC_FRAC;
  fire(s, net, FX_C2, t, s->current, trace);
}

static void colour_step(state *s, const fx_net *net, int t, fx_trace *trace)
{
  const fx_layer *c3 = &net->layer[FX_C3];
  fx_current_spikes(s->current, c3->w, s->events.spikes[FX_C2][t], bias_row(c3), STRIP);
  keep_current(trace, FX_C3, t, s->current, c3->n_out);
  for (int o = 0; o < COLOURS; o++) {
    const int32_t current = table_current(s, net, 1 + o, s->current[o]);
    if (fx_net_reads_tables(net, t)) read_colour(s, net, t, o, current);
    if (trace) trace->membrane[FX_C3][t][o] = integrated(s, net, 1 + o, s->acc.colour[o]);
  }
}

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
  memset(s.weighed, 0, sizeof s.weighed);
  if (trace) memset(trace, 0, sizeof *trace);
  fx_current_mac(s.d1_current, d1->w, f, d1->n_in, strips(d1->n_out));
  for (int t = 0; t < net->steps; t++) {
    if (!fx_net_decodes(net)) density_step(&s, net, t, trace);
    hidden_step(&s, net, t, base, trace);
    colour_step(&s, net, t, trace);
  }
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
