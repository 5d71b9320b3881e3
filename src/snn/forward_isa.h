/* Forward through the steps, a block of samples at a time. Oracle: net.c.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_FORWARD_ISA_H
#define SF_SNN_FORWARD_ISA_H
#include "snn/event_isa.h"
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
  const float theta = net->theta[layer], lost = sf_plif_reset((sf_input_mode)net->mode, theta);
  const int n = rows * B;
  if (net->relu || (t == 0 && net->mode != SF_DECAY))
    memcpy(h, current, (size_t)n * sizeof *h);
  else if (t == 0)
    for (int i = 0; i < n; i++) h[i] = current[i] * k;
  else {
    const float keep = net->mode == SF_WEIGHTED ? 2.0f : 1.0f - k, gain = net->mode >= SF_NODECAY ? 1.0f : k;
#pragma GCC ivdep /* h may be prev: element by element */
    for (int i = 0; i < n; i++) h[i] = keep * (prev[i] - (prev[i] >= theta ? lost : 0.0f)) + gain * current[i];
  }
}

/* A spiking layer at step t, a few rows at a time in the first-level cache: current = init + w in, charge, fire.
 * w NULL: the current is init. s: activations as words of rows. */
static void layer(const sf_net_view *net, int index, float k, int t, const word *w, int pairs, const word *in,
                  const float *init, const float *prev, float *h, word *s)
{
  float tile[LAYER_ROWS * B];
  for (int m = 0, n; m < net->hidden; m += n, s += n / PAIR * B) {
    n = layer_rows(net->hidden - m);
    const float *current = init ? init + m * B : NULL;
    if (w) {
      gemm(w + m * pairs, pairs, n, pairs, in, B, B, current, B, tile, B);
      current = tile;
    }
    charge(net, index, k, t, n, current, prev ? prev + m * B : NULL, h + m * B);
    activation_rows(net, index, n, h + m * B, s);
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
    const float share = net->mode == SF_WEIGHTED ? sf_step_share(t) : k;
    const float gain = net->mode == SF_NODECAY ? 1.0f : share, keep = 1.0f - share;
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

/* Outputs of step t from their currents: sigma or colour, and what they have integrated, of the step before, too. */
static void read_density(const sf_net_view *net, int t, const float *i, sf_block *x)
{
  float e[B];
  if (net->mode == SF_WEIGHTED) {
    integrate(net, net->k[1], t, B, i, t ? x->i_sum[t - 1] : NULL, x->i_sum[t]);
    exponential(B, x->i_sum[t], x->sigma[t]);
  } else {
    exponential(B, i, e);
    integrate(net, net->k[1], t, B, e, t ? x->sigma[t - 1] : NULL, x->sigma[t]);
  }
}

static void read_colour(const sf_net_view *net, int t, sf_block *x)
{
  float c[3 * B];
  if (net->mode == SF_WEIGHTED) {
    integrate(net, net->k[4], t, 3 * B, x->j[t], t ? x->j_sum[t - 1] : NULL, x->j_sum[t]);
    sigmoid(3 * B, x->j_sum[t], x->colour[t]);
  } else {
    sigmoid(3 * B, x->j[t], c);
    integrate(net, net->k[4], t, 3 * B, c, t ? x->colour[t - 1] : NULL, x->colour[t]);
  }
}

/* Density net at step t. */
static void density_step(const sf_net_words *n, sf_block *x, int t, int keep, const float *current, sf_net_scratch *w,
                         float *i)
{
  const sf_net_view *net = &n->view;
  word *spikes = words(w->spikes);
  layer(net, 0, net->k[0], t, NULL, 0, NULL, current, t ? x->m1[slot(t - 1, keep)] : NULL, x->m1[slot(t, keep)],
        spikes);
  gemm(operands(n->w2), net->hidden / PAIR, SF_DENSITY_OUT, net->hidden / PAIR, spikes, B, B, NULL, 0, i, B);
  read_density(net, t, i, x);
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
  for (int t = 0; t < steps; t++) density_step(n, x, t, 0, w->sum1, w, x->i[0]);
  tiles_end();
}

/* C2 at step t from the spikes of C1 in w->spikes; activations to w->rows. bias: [hidden][B] or NULL. */
static void colour_layer_2(const sf_net_words *n, sf_block *x, int t, int at, int before, const float *bias,
                           sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  const word *weights = operands(n->w4);
  const float *current = bias;
  for (int r = 0; r < hidden; r++) x->s3[at][r] = spike_bits(x->m3[at] + r * B, net->theta[1]);
  if (!net->relu && few_spikes(x->s3[at], hidden, dense_forward)) {
    weights = NULL;
    float *const sum = floats(w->lanes);
    event_current(n->w4_slice, hidden, x->s3[at], floats(w->t));
    transpose(words(w->t), B, hidden, words(w->lanes), B);
    for (int i = 0; bias && i < hidden * B; i++) sum[i] += bias[i];
    current = sum;
  }
  layer(net, 2, net->k[3], t, weights, hidden / PAIR, words(w->spikes), current, t ? x->m4[before] : NULL, x->m4[at],
        words(w->rows));
}

static void forward(const sf_net_words *n, sf_block *x, int steps, int keep, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int pairs = net->hidden / PAIR;
  word *spikes = words(w->spikes), *rows = words(w->rows);
  tiles_begin();
  constant_current(n, n->w1, net->features, x->f, w->rows, w->sum1);
  constant_current(n, n->w3d, SF_DIR_FEATURES, x->sh, w->rows, w->sum3);
  for (int t = 0; t < steps; t++) {
    const int at = slot(t, keep), before = slot(t - 1, keep);
    density_step(n, x, t, keep, w->sum1, w, x->i[t]);
    if (net->h_step > 0)
      for (int a = B; a < SF_DENSITY_OUT * B; a++) x->i[t][a] = sf_round_h(x->i[t][a], net->h_step);
    layer(net, 1, net->k[2], t, operands(n->w3h), SF_DENSITY_OUT / PAIR, row_words(x->i[t], SF_DENSITY_OUT, w->rows),
          w->sum3, t ? x->m3[before] : NULL, x->m3[at], spikes);
    colour_layer_2(n, x, t, at, before, NULL, w);
    gemm(operands(n->w5), pairs, 4, pairs, rows, B, B, NULL, 0, x->j[t], B);
    read_colour(net, t, x);
  }
  tiles_end();
}
#endif
