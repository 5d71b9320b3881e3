/* Backward through the steps. Follows SpikingJelly's sigmoid surrogate with the reset path differentiated.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_BACKWARD_ISA_H
#define SF_SNN_BACKWARD_ISA_H
#include "snn/forward_isa.h"

/* 1 / x for x > 0: the instruction's 2^-14 where there is one, else by subtracting the bits and two Newton steps
 * (8e-7). */
static inline vf reciprocal(vf x)
{
#if defined(__AVX512F__)
  return (vf)_mm512_rcp14_ps((__m512)x);
#else
  vf y = (vf)(0x7EF00000 - (vi)x);
  y *= 2.03212865f - 1.03116935f * (x * y);
  return y * (2.00000070f - x * y);
#endif
}

/* The surrogate's slope alpha s (1 - s), s = sigmoid(alpha x), which is alpha/4 / cosh^2(2 y), y = alpha/4 x: within
 * 7e-5 of its maximum for every x. cosh^2 as a polynomial in y^2, fitted so that its inverse has the least largest
 * error (6.2e-6). */
static inline vf surrogate(vf x)
{
  const vf far = (vf){0} + 64.0f;
  const float sharp = SF_SURROGATE_ALPHA / 4.0f;
  const vf y = sharp * x;
  vf w = y * y;
  const vi near = w < far;
  w = (vf)(((vi)w & near) | ((vi)far & ~near));
  vf p = w * 4.04860913e-2f + 6.45573130e-2f;
  p = p * w + 9.19493240e-1f;
  p = p * w + 2.78582631f;
  p = p * w + 5.34561520f;
  p = p * w + 3.99923221f;
  p = p * w + 1.00000616f;
  return sharp * reciprocal(p);
}

/* Backward of fire at step t. g: gradient of the activation in, of the current out; carry: gradient of the membrane
 * after reset, in and out; leak[B]: sum of g_h * dh/dw per lane. dh/dw = k(1-k)(x - v) = (1-k)(h - v) where the input
 * decays, -k(1-k) v where it does not; the part of v, which this step leaves to the next, is added here, where h is at
 * hand: carry = (1-k) g_h(t+1).
 * fired: see count_fired; NULL: firing is not charged. A neuron that fires at any of T steps, a = 1 - prod (1 - s(u)),
 * costs charge: da/ds(t) is 1 where it fires at no other step, else 0. */
static inline void fire_backward(const sf_net_view *net, int layer, float k, int t, int rows, const float *restrict h,
                                 const float *restrict fired, float *restrict g, float *restrict carry,
                                 float *restrict leak)
{
  if (net->relu) {
    for (int i = 0; i < rows * B; i++) g[i] = h[i] > 0 ? g[i] : 0;
    return;
  }
  const int hybrid_first = t == 0 && net->mode == SF_HYBRID;
  const int whole = net->mode == SF_NODECAY || hybrid_first;
  const float keep = 1.0f - k, gain = whole ? 1.0f : k, with_h = whole ? 0.0f : keep;
  const float with_v = net->mode == SF_NODECAY ? -k : -1.0f;
  const vf theta = (vf){0} + net->theta[layer], one = (vf){0} + 1.0f, charge = (vf){0} + net->charge[layer];
  for (int l = 0; l < B; l += VL) {
    vf sum_h = {0}, sum_v = {0};
    for (int r = 0; r < rows; r++) {
      const int i = r * B + l;
      const vf x = *(const vf *)(h + i), gv = *(const vf *)(carry + i);
      const vf v = x - (vf)((x >= theta) & (vi)theta);
      vf gs = *(const vf *)(g + i);
      if (fired) gs += (vf)((*(const vf *)(fired + i) == (vf)((x >= theta) & (vi)one)) & (vi)charge);
      const vf gh = (gs - theta * gv) * surrogate(x - theta) + gv;
      *(vf *)(carry + i) = keep * gh;
      *(vf *)(g + i) = gain * gh;
      sum_h += gh * x;
      sum_v += gv * v;
    }
    *(vf *)(leak + l) += with_h * sum_h + with_v * sum_v;
  }
}

/* Counts the steps at which each neuron of spiking layers `first`..2 fires; where no sample is, one that no membrane
 * reaches. */
static void count_fired(const sf_net_view *net, const sf_block *x, int first, int steps, sf_net_scratch *w)
{
  for (int layer = first; layer < 3; layer++)
    for (int r = 0; r < net->hidden; r++) {
      float *to = w->fired[layer] + r * B;
      for (int l = 0; l < B; l++) to[l] = l < x->lanes ? 0.0f : 2.0f;
      for (int t = 0; t < steps; t++) {
        const float *h = (layer == 0 ? x->m1[t] : layer == 1 ? x->m3[t] : x->m4[t]) + r * B;
        for (int l = 0; l < B; l++) to[l] += h[l] >= net->theta[layer] ? 1.0f : 0.0f;
      }
    }
}

static bool charged(const sf_net_view *net)
{
  return !net->relu && (net->charge[0] > 0 || net->charge[1] > 0 || net->charge[2] > 0);
}

/* For backward_out. */
static const float *fired(const sf_net_view *net, int layer, const sf_net_scratch *w)
{
  return charged(net) ? w->fired[layer] : NULL;
}

/* Backward of integrate at step t: g is the gradient of o(t) (its carry included), returns the gradient of e in de and
 * of o(t-1) in g. */
static void integrate_backward(const sf_net_view *net, float k, int t, const float *e, const float *prev,
                               float *restrict g, float *restrict de, float *restrict leak)
{
  if (net->relu || (t == 0 && net->mode == SF_HYBRID)) {
    for (int i = 0; i < B; i++) de[i] = g[i];
    return;
  }
  const float keep = 1.0f - k, slope = k * keep, gain = net->mode == SF_NODECAY ? 1.0f : k;
  const float with_e = net->mode == SF_NODECAY ? 0.0f : 1.0f;
  for (int i = 0; i < B; i++) {
    float before = t ? prev[i] : 0.0f;
    leak[i] += g[i] * slope * (with_e * e[i] - before);
    de[i] = gain * g[i];
    g[i] *= keep;
  }
}

static void add_to(float *restrict sum, const float *restrict x, int n)
{
  for (int i = 0; i < n; i++) sum[i] += x[i];
}

/* The slope of exp as torch-ngp's trunc_exp has it. */
static inline float exp_slope(float x)
{
  return fast_exp(x > 15.0f ? 15.0f : x < -15.0f ? -15.0f : x);
}

/* What layer_backward leaves behind; NULL = not wanted. fired: what it reads, as fire_backward. */
typedef struct backward_out {
  const float *fired;
  float *carry, *leak, *sum; /* sum: currents' gradient added up over the steps */
  float *all;                /* currents' gradient [hidden][B] */
  uint32_t *rows, *lanes;    /* rooms for the currents' gradient as operands */
} backward_out;

/* Where a word holds one number, what layer_backward leaves in `rows` is all three. */
static inline uint32_t *lanes_beside(uint32_t *rows, uint32_t *lanes)
{
  return PAIR == 1 ? rows : lanes;
}

/* Where the gradient of rows from m on is worked out; own: room for it. */
static inline float *gradient_tile(backward_out out, int m, float *own)
{
  return PAIR == 1 && out.rows ? floats(out.rows + m * B) : own;
}

/* The gradient of the currents of n rows from m on, to where it is wanted. */
static inline void leave_gradient(backward_out out, int m, int n, const float *tile)
{
  if (out.sum) add_to(out.sum + m * B, tile, n * B);
  if (PAIR == 1) return;
  if (out.all) memcpy(out.all + m * B, tile, (size_t)n * B * sizeof *tile);
  if (out.rows) row_words(tile, n, out.rows + m / PAIR * B);
  if (out.lanes) lane_words(tile, n, out.lanes + m * BW);
}

/* Backward of a spiking layer at step t from the gradient dy (words of rows) of the layer above, through its transposed
 * weights wt[hidden][pairs]; a few rows at a time. */
static void layer_backward(const sf_net_view *net, int index, float k, int t, const uint32_t *wt, int pairs,
                           const word *dy, const float *h, backward_out out)
{
  float own[LAYER_ROWS * B];
  for (int m = 0, n; m < net->hidden; m += n) {
    n = layer_rows(net->hidden - m);
    float *tile = gradient_tile(out, m, own);
    gemm(operands(wt) + m * pairs, pairs, n, pairs, dy, B, B, NULL, 0, tile, B);
    fire_backward(net, index, k, t, n, h + m * B, out.fired ? out.fired + m * B : NULL, tile, out.carry + m * B,
                  out.leak);
    leave_gradient(out, m, n, tile);
  }
}

/* grad[rows][ld] += sum over lanes of dy (words of lanes) and x (words of lanes, transposed: [BW][columns]). */
static void add_outer(float *grad, int ld, const word *dy, int rows, const word *xt, int columns)
{
  gemm(dy, BW, rows, BW, xt, columns, columns, grad, ld, grad, ld);
}

/* The activations of a spiking layer at one step, transposed for add_outer. */
static const word *activations(const sf_net_view *net, int layer, const float *h, sf_net_scratch *w)
{
  activation_lanes(net, layer, net->hidden, h, words(w->spikes));
  transpose(words(w->spikes), net->hidden, BW, words(w->t), net->hidden);
  return operands(w->t);
}

/* Colour integrator and layers C3, C2 at step t; leaves the gradient of j in gj[4][B], the fourth row zero, and that of
 * C2's current as words of rows in w->rows. sum: that gradient added up over the steps, or NULL. */
static void colour_output_backward(const sf_net_words *n, const sf_block *x, int t, float *gcolour, float *gj,
                                   float *sum, sf_net_grad *grad, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  float c[3 * B];
  uint32_t small[4 * B], *lanes = lanes_beside(w->rows, w->lanes);
  sigmoid(3 * B, x->j[t], c);
  memset(gj + 3 * B, 0, B * sizeof *gj);
  for (int a = 0; a < 3; a++)
    integrate_backward(net, net->k[4], t, c + a * B, t ? x->colour[t - 1] + a * B : NULL, gcolour + a * B, gj + a * B,
                       w->leak[4]);
  for (int i = 0; i < 3 * B; i++) gj[i] *= c[i] * (1.0f - c[i]);
  add_outer(grad->w5, hidden, lane_words(gj, 4, small), 4, activations(net, 2, x->m4[t], w), hidden);
  const bool events = by_spikes(net, x->s3[t], BACKWARD);
  layer_backward(net, 2, net->k[3], t, n->w5t, 4 / PAIR, row_words(gj, 4, small), x->m4[t],
                 (backward_out){fired(net, 2, w), w->g4, w->leak[3], sum, events ? floats(lanes) : NULL, w->rows,
                                events ? NULL : lanes});
  if (events) {
    transpose(operands(lanes), hidden, B, words(w->t), hidden);
    spike_outer(grad->w4t, hidden, hidden, x->s3[t], floats(w->t));
  } else
    add_outer(grad->w4, hidden, operands(lanes), hidden, activations(net, 1, x->m3[t], w), hidden);
}

/* Colour integrator and layers C3, C2, C1 at step t; leaves the gradient of i in gi[16][B], row 0 zero. */
static void colour_backward(const sf_net_words *n, const sf_block *x, int t, float *gcolour, float *gi,
                            sf_net_grad *grad, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  float gj[4 * B];
  uint32_t *rows = w->spikes, *lanes = lanes_beside(rows, w->lanes);
  colour_output_backward(n, x, t, gcolour, gj, NULL, grad, w);
  layer_backward(net, 1, net->k[2], t, n->w4t, hidden / PAIR, operands(w->rows), x->m3[t],
                 (backward_out){fired(net, 1, w), w->g3, w->leak[2], w->sum3, NULL, rows, lanes});
  gemm(operands(n->w3ht), hidden / PAIR, 16, hidden / PAIR, operands(rows), B, B, NULL, 0, gi, B);
  transpose(lane_words(x->i[t], SF_DENSITY_OUT, w->rows), SF_DENSITY_OUT, BW, words(w->t), SF_DENSITY_OUT);
  /* Column 16 of the padded gradient meets i[0], which is no input of C1: scratch. h starts at column 17. */
  add_outer(grad->w3 + SF_DIR_FEATURES, 32, operands(lanes), hidden, words(w->t), SF_DENSITY_OUT);
}

/* Gradients of what was constant over the steps: w1, the directions' part of w3, and the features. */
static void constant_backward(const sf_net_words *n, const sf_block *x, float *df, sf_net_grad *grad, sf_net_scratch *w)
{
  const int hidden = n->view.hidden, features = n->view.features, padded = (features + 15) / 16 * 16;
  word *t = words(w->t);
  float inputs[2 * 16 * B] = {0};
  transpose(lane_words(x->sh, SF_DIR_FEATURES, w->spikes), SF_DIR_FEATURES, BW, t, SF_DIR_FEATURES);
  add_outer(grad->w3, 32, lane_words(w->sum3, hidden, w->lanes), hidden, t, SF_DIR_FEATURES);
  memcpy(inputs, x->f, (size_t)features * B * sizeof *inputs);
  transpose(lane_words(inputs, padded, w->spikes), padded, BW, t, padded);
  add_outer(grad->w1, padded, lane_words(w->sum1, hidden, w->lanes), hidden, t, padded);
  gemm(operands(n->w1t), hidden / PAIR, features, hidden / PAIR, row_words(w->sum1, hidden, w->rows), B, B, NULL, 0, df,
       B);
}

static void backward(const sf_net_words *n, const sf_block *x, int steps, const float *dsigma, const float *dcolour,
                     float *df, sf_net_grad *grad, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  const size_t plane = (size_t)hidden * B * sizeof(float);
  float gsigma[B] = {0}, gcolour[3 * B] = {0};
  tiles_begin();
  memset(w->g1, 0, plane);
  memset(w->g3, 0, plane);
  memset(w->g4, 0, plane);
  memset(w->sum1, 0, plane);
  memset(w->sum3, 0, plane);
  memset(w->leak, 0, sizeof w->leak);
  if (charged(net)) count_fired(net, x, 0, steps, w);
  for (int t = steps - 1; t >= 0; t--) {
    float gi[SF_DENSITY_OUT * B], ge[B], e[B];
    uint32_t small[SF_DENSITY_OUT * B];
    add_to(gsigma, dsigma + t * B, B);
    add_to(gcolour, dcolour + t * 3 * B, 3 * B);
    exponential(B, x->i[t], e);
    integrate_backward(net, net->k[1], t, e, t ? x->sigma[t - 1] : NULL, gsigma, ge, w->leak[1]);
    colour_backward(n, x, t, gcolour, gi, grad, w);
    for (int l = 0; l < B; l++) gi[l] = ge[l] * exp_slope(x->i[t][l]);
    if (looked_up(net)) {
      uint64_t fired[SF_LANES];
      layer_spikes(net, 0, x->m1[t], fired);
      transpose(operands(gi), SF_DENSITY_OUT, B, words(w->t), SF_DENSITY_OUT);
      spike_outer(grad->w2t, hidden, SF_DENSITY_OUT, fired, floats(w->t));
    } else
      add_outer(grad->w2, hidden, lane_words(gi, SF_DENSITY_OUT, small), SF_DENSITY_OUT,
                activations(net, 0, x->m1[t], w), hidden);
    layer_backward(net, 0, net->k[0], t, n->w2t, SF_DENSITY_OUT / PAIR, row_words(gi, SF_DENSITY_OUT, small), x->m1[t],
                   (backward_out){fired(net, 0, w), w->g1, w->leak[0], w->sum1, NULL, NULL, NULL});
  }
  constant_backward(n, x, df, grad, w);
  tiles_end();
  for (int i = 0; i < SF_LAYERS; i++)
    for (int l = 0; l < B; l++) grad->leak[i] += w->leak[i][l];
}
#endif
