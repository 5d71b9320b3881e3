/* The nets of src/fx once more, naively: dense sums in 64 bits, one neuron after the other, every event counted where
 * it happens. Shares only the tables, and the scales that a driver programs, with the core. */
#ifndef SF_TESTS_FX_NAIVE_H
#define SF_TESTS_FX_NAIVE_H
#include "ck_run.h"
#include "src/fx/unit.h"

/* ---- the naive nets ---- */

static inline int64_t naive_round(int64_t x, int n) /* floor(x / 2^n + 1/2) */
{
  if (n == 0) return x;
  const int64_t half = (int64_t)1 << (n - 1), whole = (int64_t)1 << n;
  const int64_t sum = x + half;
  return sum >= 0 ? sum / whole : -((-sum + whole - 1) / whole);
}

static inline int64_t naive_clamp(int64_t x, int64_t low, int64_t high)
{
  return x < low ? low : x > high ? high : x;
}

typedef struct naive_net {
  const fx_net *net;
  fx_counts *counts;
  fx_trace *trace;
  int64_t v[SF_LAYERS][SF_LANES];
  bool ever[SF_LAYERS][SF_LANES];
  int64_t sigma, colour[3];
} naive_net;

static inline int64_t naive_charge(const naive_net *n, int64_t v, int64_t current, int64_t k, int t)
{
  if (t == 0 && n->net->mode == FX_HYBRID) return current;
  const int64_t old = t == 0 ? 0 : v;
  if (n->net->mode == FX_RADIX) return 2 * old + current;
  if (n->net->mode == FX_NODECAY) return old - naive_round(old * k, 12) + current;
  return old + naive_round((current - old) * k, 12);
}

/* One update of some states of `bytes`; the first one of a sample reads nothing. */
static inline void naive_updates(naive_net *n, int l, int t, int states, int bytes, bool first)
{
  fx_layer_counts *c = &n->counts->layer[l];
  c->updates[t] += (uint64_t)states;
  c->state_w[t] += (uint64_t)(states * bytes);
  if (!first) c->state_r[t] += (uint64_t)(states * bytes);
}

/* gain: membrane LSB per LSB of the current */
static inline void naive_fire(naive_net *n, int l, int t, const int64_t *current, int64_t gain, bool *spike)
{
  const fx_layer *layer = &n->net->layer[l];
  const int64_t parts = ((int64_t)1 << n->net->steps) - 1; /* of 2^T: C2's current in radix mode */
  const int64_t theta =
      n->net->mode == FX_RADIX && l == FX_C2 ? naive_round(layer->theta * parts, n->net->steps) : layer->theta;
  for (int o = 0; o < layer->n_out; o++) {
    const int64_t in = n->net->mode == FX_RADIX && t > 0 ? 0 : current[o] * gain;
    const int64_t exact = naive_charge(n, n->v[l][o], in, layer->k, t), u = naive_clamp(exact, -8388608, 8388607);
    spike[o] = u >= theta;
    n->v[l][o] = spike[o] ? u - theta : u;
    n->counts->saturated[l] += u != exact;
    n->trace->current[l][t][o] = (int32_t)current[o];
    n->trace->membrane[l][t][o] = (int32_t)u;
    if (spike[o]) n->trace->spikes[l][t][o / 64] |= (uint64_t)1 << o % 64;
    n->counts->layer[l].spikes[t] += spike[o];
  }
}

static inline void naive_synapses(naive_net *n, int l, int t, const bool *spike, int64_t *current)
{
  const fx_layer *layer = &n->net->layer[l];
  for (int o = 0; o < layer->n_out; o++) current[o] = 0;
  for (int i = 0; i < layer->n_in; i++) {
    const bool read = spike[i] && !n->ever[l][i];
    for (int o = 0; o < layer->n_out; o++) {
      if (spike[i]) current[o] += layer->w[i * SF_LANES + o], n->counts->layer[l].sop[t]++;
      n->counts->layer[l].weight[t] += read;
    }
    n->ever[l][i] = n->ever[l][i] || spike[i];
  }
  for (int o = 0; layer->bias && o < layer->n_out; o++) {
    current[o] += layer->w[layer->n_in * SF_LANES + o];
    n->counts->layer[l].weight[t] += t == 0;
  }
}

static inline void naive_products(naive_net *n, int l, int t, int row, const int64_t *x, int count, int64_t *current)
{
  const fx_layer *layer = &n->net->layer[l];
  for (int i = 0; i < count; i++)
    for (int o = 0; o < layer->n_out; o++) {
      current[o] += x[i] * layer->w[(row + i) * SF_LANES + o];
      n->counts->layer[l].mac[t]++;
      n->counts->layer[l].weight[t] += t == 0; /* the row is held for the later steps */
    }
}

static inline int64_t naive_scale(int64_t current, const fx_scale *s, int64_t limit)
{
  return naive_clamp(naive_round(current * s->mul, s->shift) + s->bias, -limit, limit - 1);
}

static inline int64_t naive_integrate(naive_net *n, int l, int t, int64_t acc, int64_t in, int64_t high)
{
  const int64_t exact = naive_charge(n, acc, in, n->net->layer[l].k, t), kept = naive_clamp(exact, 0, high);
  n->counts->saturated[l] += kept != exact;
  naive_updates(n, l, t, 1, 4, t == 0);
  return kept;
}

/* What a table gives for a current of 2^-digits LSB. */
static inline int64_t naive_exp(naive_net *n, int64_t current)
{
  const fx_scale scale = fx_net_scale(n->net, &n->net->exp_in);
  const int64_t y = naive_scale(current, &scale, 131072);
  n->counts->saturated[FX_D2] += y >= 65536;
  return fx_exp2((int32_t)y);
}

static inline int64_t naive_sigmoid(const naive_net *n, int64_t current)
{
  const fx_scale scale = fx_net_scale(n->net, &n->net->sigmoid_in);
  return fx_sigmoid((int32_t)naive_scale(current, &scale, 32768));
}

static inline void naive_density(naive_net *n, int t, const int64_t *d1, int64_t *h)
{
  const fx_layer *d2 = &n->net->layer[FX_D2];
  bool spike[SF_LANES];
  int64_t current[SF_LANES];
  naive_fire(n, FX_D1, t, d1, 1, spike);
  naive_updates(n, FX_D1, t, n->net->layer[FX_D1].n_out, 3, t == 0);
  naive_synapses(n, FX_D2, t, spike, current);
  for (int o = 0; o < d2->n_out; o++) n->trace->current[FX_D2][t][o] = (int32_t)current[o];
  n->counts->layer[FX_D2].special[t]++;
  n->sigma = naive_integrate(n, FX_D2, t, n->sigma, naive_exp(n, current[0]), ((int64_t)1 << 28) - 1);
  n->trace->membrane[FX_D2][t][0] = (int32_t)n->sigma;
  for (int j = 0; j + 1 < d2->n_out; j++)
    h[j] = naive_round(current[1 + j] * 2 - ((1 << SF_H_SHIFT) - 1), SF_H_SHIFT + 1); /* floor */
}

/* C1's currents of h, within the membrane's range. */
static inline void naive_hidden(naive_net *n, int t, const int64_t *base, const int64_t *h, int64_t *current)
{
  const fx_layer *l = n->net->layer;
  const int n_h = l[FX_D1].n_out ? l[FX_D2].n_out - 1 : 0;
  memcpy(current, base, SF_LANES * sizeof *current);
  naive_products(n, FX_C1, t, l[FX_C1].n_in - n_h, h, n_h, current);
  for (int o = 0; o < l[FX_C1].n_out; o++) {
    const int64_t kept = naive_clamp(current[o], -8388608, 8388607);
    n->counts->saturated[FX_C1] += kept != current[o] && t == 0;
    current[o] = kept;
  }
}

static inline void naive_colour(naive_net *n, int t, const int64_t *base, const int64_t *h)
{
  const fx_layer *l = n->net->layer;
  bool spike[SF_LANES], spike2[SF_LANES];
  int64_t current[SF_LANES];
  naive_hidden(n, t, base, h, current);
  naive_fire(n, FX_C1, t, current, 1, spike);
  naive_updates(n, FX_C1, t, l[FX_C1].n_out, 3, t == 0);
  naive_synapses(n, FX_C2, t, spike, current);
  naive_fire(n, FX_C2, t, current, 1 << SF_AC_FRAC, spike2);
  naive_updates(n, FX_C2, t, l[FX_C2].n_out, 3, t == 0);
  naive_synapses(n, FX_C3, t, spike2, current);
  for (int o = 0; o < 3; o++) {
    const int64_t s = naive_sigmoid(n, current[o]);
    n->counts->layer[FX_C3].special[t]++;
    n->colour[o] = naive_integrate(n, FX_C3, t, n->colour[o], s, ((int64_t)1 << 20) - 1);
    n->trace->current[FX_C3][t][o] = (int32_t)current[o];
    n->trace->membrane[FX_C3][t][o] = (int32_t)n->colour[o];
  }
}

/* ---- the naive nets of radix: numbers of T binary digits between layers ---- */

/* A layer's spike trains as numbers below 2^T. */
static inline void naive_numbers(naive_net *n, int l, const int64_t *current, int64_t gain, int64_t *number)
{
  const int steps = n->net->steps;
  for (int t = 0; t < steps; t++) {
    bool spike[SF_LANES];
    naive_fire(n, l, t, current, gain, spike);
    for (int o = 0; o < n->net->layer[l].n_out; o++) number[o] = (t ? number[o] : 0) + (spike[o] << (steps - 1 - t));
  }
}

/* sum = their products with the weights; a bias has all digits. What is counted and traced is that of every step. */
static inline void naive_digits(naive_net *n, int l, const int64_t *number, int64_t *sum)
{
  const fx_layer *layer = &n->net->layer[l];
  const int steps = n->net->steps;
  for (int t = 0; t < steps; t++) {
    bool spike[SF_LANES];
    int64_t current[SF_LANES];
    for (int i = 0; i < layer->n_in; i++) spike[i] = number[i] >> (steps - 1 - t) & 1;
    naive_synapses(n, l, t, spike, current);
    if (!fx_layer_fires(l))
      for (int o = 0; o < layer->n_out; o++) n->trace->current[l][t][o] = (int32_t)current[o];
  }
  for (int o = 0; o < layer->n_out; o++) {
    sum[o] = 0;
    for (int i = 0; i < layer->n_in; i++) sum[o] += number[i] * layer->w[i * SF_LANES + o];
    if (layer->bias) sum[o] += ((1 << steps) - 1) * layer->w[layer->n_in * SF_LANES + o];
  }
}

/* An output's sum of the currents so far: that of its inputs' leading digits. */
static inline void naive_prefixes(naive_net *n, int l, int output)
{
  for (int t = 0; t < n->net->steps; t++) {
    int64_t sum = 0;
    for (int s = 0; s <= t; s++) sum += (int64_t)n->trace->current[l][s][output] * (1 << (t - s));
    n->trace->membrane[l][t][output] = (int32_t)sum;
  }
}

static inline int64_t naive_floor(int64_t x, int64_t by)
{
  return x >= 0 ? x / by : -((-x + by - 1) / by);
}

static inline void naive_radix_density(naive_net *n, const int64_t *d1, int64_t *h)
{
  const fx_layer *l = n->net->layer;
  const int steps = n->net->steps;
  const int64_t parts = ((int64_t)1 << steps) - 1, half = (int64_t)1 << 14, whole = (int64_t)1 << (SF_H_SHIFT + steps);
  int64_t number[SF_LANES], sum[SF_LANES];
  naive_numbers(n, FX_D1, d1, 1, number);
  naive_digits(n, FX_D2, number, sum);
  naive_prefixes(n, FX_D2, 0);
  for (int t = 0; t < steps; t++) {
    naive_updates(n, FX_D1, t, l[FX_D1].n_out, 3, t == 0);
    naive_updates(n, FX_D2, t, l[FX_D2].n_out, 4, t == 0);
  }
  n->counts->layer[FX_D2].special[steps - 1]++;
  n->sigma = naive_exp(n, sum[0]);
  for (int j = 0; j + 1 < l[FX_D2].n_out; j++) { /* the mean in 2^-steps: a product with 2^(15 + T) / (2^T - 1) */
    const int64_t factor = (2 * ((int64_t)32768 << steps) + parts) / (2 * parts);
    const int64_t mean = naive_floor(sum[1 + j] * factor + half, 2 * half);
    h[j] = naive_floor(mean, whole);
  }
}

static inline void naive_radix_colour(naive_net *n, const int64_t *base, const int64_t *h)
{
  const fx_layer *l = n->net->layer;
  const int steps = n->net->steps;
  int64_t current[SF_LANES], number[SF_LANES], sum[SF_LANES];
  naive_hidden(n, 0, base, h, current);
  naive_numbers(n, FX_C1, current, 1, number);
  naive_digits(n, FX_C2, number, sum);
  naive_numbers(n, FX_C2, sum, (int64_t)256 >> steps, number);
  naive_digits(n, FX_C3, number, sum);
  for (int t = 0; t < steps; t++) {
    naive_updates(n, FX_C1, t, l[FX_C1].n_out, 3, t == 0);
    naive_updates(n, FX_C2, t, l[FX_C2].n_out, 3, t == 0);               /* adds up */
    if (t > 0) naive_updates(n, FX_C2, t - 1, l[FX_C2].n_out, 3, false); /* fires, without the first time */
    naive_updates(n, FX_C3, t, 3, 4, t == 0);
  }
  for (int o = 0; o < 3; o++) {
    naive_prefixes(n, FX_C3, o);
    n->counts->layer[FX_C3].special[steps - 1]++;
    n->colour[o] = naive_sigmoid(n, sum[o]);
  }
}

static inline void naive_sample(const fx_net *net, const int16_t *f, const int16_t *dir, bool first, fx_out *out,
                                fx_trace *trace, fx_counts *counts)
{
  const bool decodes = net->layer[FX_D1].n_out == 0;
  const fx_layer *c1 = &net->layer[FX_C1];
  const int n_h = decodes ? 0 : net->layer[FX_D2].n_out - 1, n_dir = c1->n_in - n_h;
  naive_net n = {.net = net, .counts = counts, .trace = trace};
  fx_counts ignored = {0};
  int64_t x[SF_LANES], d[SF_DIR_MAX], d1[SF_LANES] = {0}, base[SF_LANES] = {0}, h[SF_OUT_MAX] = {0};
  for (int i = 0; i < net->layer[FX_D1].n_in; i++) x[i] = f[i];
  for (int i = 0; i < n_dir; i++) d[i] = dir[i];
  uint64_t before[SF_LAYERS];
  memcpy(before, counts->saturated, sizeof before);
  memset(trace, 0, sizeof *trace);
  counts->samples++;
  counts->rays += first && !decodes;
  naive_products(&n, FX_D1, 0, 0, x, net->layer[FX_D1].n_in, d1);
  n.counts = first ? counts : &ignored;
  naive_products(&n, FX_C1, 0, 0, d, n_dir, base);
  for (int o = 0; c1->bias && o < c1->n_out; o++) {
    base[o] += (int64_t)c1->bias * c1->w[c1->n_in * SF_LANES + o];
    n.counts->layer[FX_C1].weight[0]++;
  }
  n.counts = counts;
  if (net->mode == FX_RADIX) {
    if (!decodes) naive_radix_density(&n, d1, h);
    naive_radix_colour(&n, base, h);
  }
  for (int t = 0; t < net->steps && net->mode != FX_RADIX; t++) {
    if (!decodes) naive_density(&n, t, d1, h);
    naive_colour(&n, t, base, h);
  }
  for (int l = 0; l < SF_LAYERS; l++) counts->saturated_samples[l] += counts->saturated[l] != before[l];
  *out = (fx_out){(uint32_t)n.sigma, {(uint32_t)n.colour[0], (uint32_t)n.colour[1], (uint32_t)n.colour[2]}};
}
#endif
