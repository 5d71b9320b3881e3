/* Forward through the steps, a block of samples at a time. Oracle: net.c.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_FORWARD_ISA_H
#define SF_SNN_FORWARD_ISA_H
#include "snn/words_isa.h"
#include "snn/plif.h"

/* e^x within 2 ulp for x in [-87, 87], clamped outside; Cephes' polynomial, vectorises. */
static inline float fast_exp(float x)
{
  x = x < -87.0f ? -87.0f : x;
  x = x > 87.0f ? 87.0f : x;
  float shifted = x * 1.44269504f + 12582912.0f, n = shifted - 12582912.0f;
  float r = x - n * 0.693359375f + n * 2.12194440e-4f;
  float p = 1.9875691500e-4f;
  p = p * r + 1.3981999507e-3f;
  p = p * r + 8.3334519073e-3f;
  p = p * r + 4.1665795894e-2f;
  p = p * r + 1.6666665459e-1f;
  p = p * r + 5.0000001201e-1f;
  p = p * r * r + r + 1.0f;
  union {
    float f;
    uint32_t i;
  } bits = {.f = shifted}, scale;
  scale.i = (bits.i - 0x4B400000u + 127u) << 23;
  return p * scale.f;
}

/* Charges rows of neurons. prev: membrane before fire of the step before, NULL at t = 0; h may equal prev. */
static inline void charge(const sf_net_view *net, int layer, float k, int t, int rows, const float *restrict current,
                          const float *prev, float *h)
{
  const float theta = net->theta[layer];
  const int n = rows * B;
  if (net->relu || (t == 0 && net->mode != SF_DECAY))
    memcpy(h, current, (size_t)n * sizeof *h);
  else if (t == 0)
    for (int i = 0; i < n; i++) h[i] = current[i] * k;
  else {
    const float keep = 1.0f - k, gain = net->mode == SF_NODECAY ? 1.0f : k;
#pragma GCC ivdep /* h may be prev: element by element */
    for (int i = 0; i < n; i++) h[i] = keep * (prev[i] - (prev[i] >= theta ? theta : 0.0f)) + gain * current[i];
  }
}

/* A spiking layer at step t, a few rows at a time in the first-level cache: current = init + w in, charge, fire.
 * w NULL: the current is init. s: activations as words of rows; NULL: not wanted. */
static void layer(const sf_net_view *net, int index, float k, int t, const word *w, int pairs, const word *in,
                  const float *init, const float *prev, float *h, word *s)
{
  float tile[LAYER_ROWS * B];
  for (int m = 0, n; m < net->hidden; m += n) {
    n = layer_rows(net->hidden - m);
    const float *current = init ? init + m * B : NULL;
    if (w) {
      gemm(w + m * pairs, pairs, n, pairs, in, B, B, current, B, tile, B);
      current = tile;
    }
    charge(net, index, k, t, n, current, prev ? prev + m * B : NULL, h + m * B);
    if (s) activation_rows(net, index, n, h + m * B, s + m / PAIR * B);
  }
}

/* One step of an integrating output: o = charge(prev, e). */
static void integrate(const sf_net_view *net, float k, int t, int n, const float *restrict e, const float *prev,
                      float *restrict o)
{
  if (net->relu || (t == 0 && net->mode != SF_DECAY))
    for (int i = 0; i < n; i++) o[i] = e[i];
  else if (t == 0)
    for (int i = 0; i < n; i++) o[i] = k * e[i];
  else {
    const float gain = net->mode == SF_NODECAY ? 1.0f : k, keep = 1.0f - k;
    for (int i = 0; i < n; i++) o[i] = keep * prev[i] + gain * e[i];
  }
}

static void exponential(int n, const float *restrict x, float *restrict e)
{
  for (int i = 0; i < n; i++) e[i] = fast_exp(x[i]);
}

static void sigmoid(int n, const float *restrict x, float *restrict s)
{
  for (int i = 0; i < n; i++) s[i] = 1.0f / (1.0f + fast_exp(-x[i]));
}

/* Where the membranes of step t are kept: what backward does not ask for shares the last place. */
static inline int slot(int t, int keep)
{
  return t < keep ? t : SF_T_MAX - 1;
}

/* Outputs of step t, sigma or colour, from their currents and those of the step before. */
static void read_density(const sf_net_view *net, int t, const float *i, sf_block *x)
{
  float e[B];
  exponential(B, i, e);
  integrate(net, net->k[1], t, B, e, t ? x->sigma[t - 1] : NULL, x->sigma[t]);
}

static void read_colour(const sf_net_view *net, int t, sf_block *x)
{
  float c[3 * B];
  sigmoid(3 * B, x->j[t], c);
  integrate(net, net->k[4], t, 3 * B, c, t ? x->colour[t - 1] : NULL, x->colour[t]);
}

/* Spikes of a layer, from its membranes before fire: a bit per lane. */
static void layer_spikes(const sf_net_view *net, int index, const float *h, uint64_t *spikes)
{
  for (int r = 0; r < net->hidden; r++) spikes[r] = spike_bits(h + r * B, net->theta[index]);
}

/* Density net: its currents to x->i. current: D1's. */
static void density_net(const sf_net_words *n, sf_block *x, int steps, int keep, const float *current,
                        sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  uint64_t fired[SF_T_MAX][SF_LANES];
  word *spikes = looked_up(net) ? NULL : words(w->spikes);
  for (int t = 0; t < steps; t++) {
    float *h = x->m1[slot(t, keep)];
    layer(net, 0, net->k[0], t, NULL, 0, NULL, current, t ? x->m1[slot(t - 1, keep)] : NULL, h, spikes);
    if (spikes)
      gemm(operands(n->w2), hidden / PAIR, SF_DENSITY_OUT, hidden / PAIR, spikes, B, B, NULL, 0, x->i[t], B);
    else
      layer_spikes(net, 0, h, fired[t]);
  }
  if (!spikes) spike_currents(n->w2_spikes, hidden, SF_DENSITY_OUT, steps, fired, x->i[0]);
  for (int t = 0; t < steps; t++) read_density(net, t, x->i[t], x);
}

/* in[inputs][B] times words of weights: what is constant over the steps. */
static void constant_current(const sf_net_words *n, const uint32_t *weights, int inputs, const float *in,
                             uint32_t *room, float *current)
{
  const int pairs = inputs / PAIR;
  gemm(operands(weights), pairs, n->view.hidden, pairs, row_words(in, inputs, room), B, B, NULL, 0, current, B);
}

static void density(const sf_net_words *n, sf_block *x, int steps, sf_net_scratch *w)
{
  tiles_begin();
  constant_current(n, n->w1, n->view.features, x->f, w->rows, w->sum1);
  density_net(n, x, steps, 0, w->sum1, w);
  tiles_end();
}

/* C2, C3 and the colour at step t. Of C1's spikes there are the bits, and either words in w->spikes, or all that they
 * add to C2's current in w->currents. bias2, bias3: [rows][B] or NULL. */
static void colour_step(const sf_net_words *n, sf_block *x, int t, int keep, const float *bias2, const float *bias3,
                        sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden, pairs = hidden / PAIR, at = slot(t, keep);
  const word *weights = operands(n->w4);
  const float *current = bias2;
  if (by_spikes(net, x->s3[at], FORWARD)) {
    float *const sum = w->currents + (LOOKUP ? t * hidden * B : 0);
    if (!LOOKUP) spike_currents(n->w4_spikes, hidden, hidden, 1, &x->s3[at], sum);
    for (int i = 0; bias2 && i < hidden * B; i++) sum[i] += bias2[i];
    weights = NULL, current = sum;
  }
  layer(net, 2, net->k[3], t, weights, pairs, words(w->spikes), current, t ? x->m4[slot(t - 1, keep)] : NULL, x->m4[at],
        words(w->rows));
  gemm(operands(n->w5), pairs, 4, pairs, words(w->rows), B, B, bias3, B, x->j[t], B);
  read_colour(net, t, x);
}

/* What follows C1, whose membranes are in x->m3. Where all spikes are looked up, after the last of `steps` steps. */
static void after_colour_1(const sf_net_words *n, sf_block *x, int t, int steps, int keep, const float *bias2,
                           const float *bias3, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int at = slot(t, keep);
  layer_spikes(net, 1, x->m3[at], x->s3[at]);
  if (!looked_up(net)) {
    colour_step(n, x, t, keep, bias2, bias3, w);
    return;
  }
  memcpy(w->fired3[t], x->s3[at], sizeof w->fired3[t]);
  if (t + 1 < steps) return;
  spike_currents(n->w4_spikes, net->hidden, net->hidden, steps, w->fired3, w->currents);
  for (int s = 0; s < steps; s++) colour_step(n, x, s, keep, bias2, bias3, w);
}

static void forward(const sf_net_words *n, sf_block *x, int steps, int keep, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  tiles_begin();
  constant_current(n, n->w1, net->features, x->f, w->rows, w->sum1);
  constant_current(n, n->w3d, SF_DIR_FEATURES, x->sh, w->rows, w->sum3);
  density_net(n, x, steps, keep, w->sum1, w);
  for (int t = 0; t < steps; t++) {
    if (net->h_step > 0)
      for (int a = B; a < SF_DENSITY_OUT * B; a++) x->i[t][a] = sf_round_h(x->i[t][a], net->h_step, 0);
    layer(net, 1, net->k[2], t, operands(n->w3h), SF_DENSITY_OUT / PAIR, row_words(x->i[t], SF_DENSITY_OUT, w->rows),
          w->sum3, t ? x->m3[slot(t - 1, keep)] : NULL, x->m3[slot(t, keep)], looked_up(net) ? NULL : words(w->spikes));
    after_colour_1(n, x, t, steps, keep, NULL, NULL, w);
  }
  tiles_end();
}
#endif
