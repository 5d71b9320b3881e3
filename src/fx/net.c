/* One sample through the density and the colour net.
 * Mirror: rtl/sf_core.sv (the order of the layers; the arithmetic is in the units) */
#include "src/fx/net.h"
#include "src/fx/count.h"
#include "src/fx/current.h"
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

static void density_step(state *s, const fx_net *net, int t, fx_trace *trace)
{
  const fx_layer *d2 = &net->layer[FX_D2];
  keep_current(trace, FX_D1, t, s->d1_current, net->layer[FX_D1].n_out);
  fire(s, net, FX_D1, t, s->d1_current, trace);
  fx_current_spikes(s->current, d2->w, s->events.spikes[FX_D1][t], strips(d2->n_out));
  keep_current(trace, FX_D2, t, s->current, d2->n_out);
  const uint32_t e = fx_exp2(fx_exp2_argument(s->current[0], &net->exp_in));
  s->events.saturated[FX_D2] += e == (1u << SF_SIGMA_BITS) - 1;
  s->acc.sigma = fx_integrate_density(s->acc.sigma, e, d2->k, net->mode, t == 0, &s->events.saturated[FX_D2]);
  if (trace) trace->membrane[FX_D2][t][0] = (int32_t)s->acc.sigma;
  for (int j = 0; j < d2->n_out - 1; j++) s->h[j] = (int16_t)(s->current[1 + j] >> SF_H_SHIFT);
}

static void hidden_step(state *s, const fx_net *net, int t, const int32_t *base, fx_trace *trace)
{
  const fx_layer *c1 = &net->layer[FX_C1], *c2 = &net->layer[FX_C2];
  const int n_h = net->layer[FX_D2].n_out - 1, n_dir = c1->n_in - n_h;
  memcpy(s->current, base, sizeof s->current);
  fx_current_mac(s->current, c1->w + (size_t)n_dir * SF_LANES, s->h, n_h, strips(c1->n_out));
  keep_current(trace, FX_C1, t, s->current, c1->n_out);
  fire(s, net, FX_C1, t, s->current, trace);
  fx_current_spikes(s->current, c2->w, s->events.spikes[FX_C1][t], strips(c2->n_out));
  keep_current(trace, FX_C2, t, s->current, c2->n_out);
  for (int o = 0; o < strips(c2->n_out); o++) s->current[o] *= 1 << SF_AC_FRAC;
  fire(s, net, FX_C2, t, s->current, trace);
}

static void colour_step(state *s, const fx_net *net, int t, fx_trace *trace)
{
  const fx_layer *c3 = &net->layer[FX_C3];
  fx_current_spikes(s->current, c3->w, s->events.spikes[FX_C2][t], STRIP);
  keep_current(trace, FX_C3, t, s->current, c3->n_out);
  for (int o = 0; o < COLOURS; o++) {
    const uint32_t value = fx_sigmoid(fx_sigmoid_argument(s->current[o], &net->sigmoid_in));
    s->acc.colour[o] =
        fx_integrate_colour(s->acc.colour[o], value, c3->k, net->mode, t == 0, &s->events.saturated[FX_C3]);
    if (trace) trace->membrane[FX_C3][t][o] = (int32_t)s->acc.colour[o];
  }
}

void fx_net_direction(const fx_net *net, const int16_t *dir, int32_t *base, fx_counts *counts)
{
  const fx_layer *c1 = &net->layer[FX_C1];
  memset(base, 0, SF_LANES * sizeof *base);
  fx_current_mac(base, c1->w, dir, c1->n_in - (net->layer[FX_D2].n_out - 1), strips(c1->n_out));
  if (counts) fx_count_rays(counts, net, 1);
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
  for (int t = 0; t < net->steps; t++) {
    density_step(&s, net, t, trace);
    hidden_step(&s, net, t, base, trace);
    colour_step(&s, net, t, trace);
  }
  *out = s.acc;
  *events = s.events;
}

static void count_events(const fx_net *net, const fx_events *events, fx_counts *counts)
{
  static const int spiking[FX_SPIKING] = {FX_D1, FX_C1, FX_C2};
  fx_firing firing = {.samples = 1};
  for (int l = 0; l < FX_SPIKING; l++) {
    uint64_t seen[2] = {0};
    for (int t = 0; t < net->steps; t++) fx_firing_add(&firing, l, t, events->spikes[spiking[l]][t], seen);
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
