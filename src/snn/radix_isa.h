/* Radix mode: a layer waits for all digits of its inputs, so it needs one product, whatever the steps (docs/model.md).
 * Every prefix is a pass of its own. A block keeps the currents of D1 in m1[0], of C1 and C2 in m3 and m4 of the
 * prefix. Oracle: net.c. Included by kernels_isa.c only. */
#ifndef SF_SNN_RADIX_ISA_H
#define SF_SNN_RADIX_ISA_H
#include "snn/backward_isa.h"

static inline bool is_radix(const sf_net_view *net)
{
  return net->mode == SF_RADIX && !net->relu;
}

/* What one digit of the last step is worth: products with numbers are times this. */
static inline float last_digit(int steps)
{
  return sf_digit(steps - 1, steps);
}

/* The largest integer up to x, 0 <= x < 2^22. */
static inline vf floor_of(vf x)
{
#if defined(__AVX512F__)
  return (vf)_mm512_roundscale_ps((__m512)x, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
#elif defined(__AVX2__)
  return (vf)_mm256_floor_ps((__m256)x);
#else
  const vf one = (vf){0} + 1.0f, near = (x + 8388608.0f) - 8388608.0f;
  return near - (vf)((near > x) & (vi)one);
#endif
}

static inline vf least(vf a, vf b)
{
#if defined(__AVX512F__)
  return (vf)_mm512_min_ps((__m512)a, (__m512)b);
#elif defined(__AVX2__)
  return (vf)_mm256_min_ps((__m256)a, (__m256)b);
#else
  const vi s = a < b;
  return (vf)(((vi)a & s) | ((vi)b & ~s));
#endif
}

/* The spikes of `steps` steps as the number that they are the digits of, 0 .. 2^steps - 1: number[rows][B]. The digits
 * that a neuron finds one by one (sf_plif_charge) are the number cut; where theta is no power of two, rounding may
 * choose the next one at a multiple of the last digit. */
static inline void digits(float theta, int steps, int rows, const float *restrict current, float *restrict number)
{
  const float levels = (float)(1 << steps);
  const vf most = (vf){0} + (levels - 1), scale = (vf){0} + levels / (2 * theta);
  for (int i = 0; i < rows * B; i += VL) {
    const vf x = load(current + i) * scale;
    store(number + i, floor_of(least((vf)((vi)x & (x > 0)), most)));
  }
}

/* Backward of a layer's rows: g, gradient of what the spikes are worth in, of the current i out. The staircase of the
 * digits has the slope of a ramp from 0 to 2 theta whose ends are smoothed by a sigmoid s. With e = exp(alpha (i - 2
 * theta)) and q = exp(-2 alpha theta) that is
 *
 *   (s(alpha i) - s(alpha (i - 2 theta))) / 2 theta = (1 - q) / 2 theta * e / ((e + 1) (e + q))
 *
 * charge: NULL, or firing is charged: 1 where a sample is, else 0. A neuron that fires costs net->charge. The step from
 * no spike to one, at the last digit, has the surrogate's slope. */
static void digits_backward(const sf_net_view *net, int layer, int steps, int rows, const float *restrict current,
                            const float *charge, float *restrict g)
{
  float e[LAYER_ROWS * B];
  const float theta = net->theta[layer], alpha = sf_ramp_alpha(theta), q = fast_exp(-2 * alpha * theta);
  const float top = (1 - q) / (2 * theta), first = 2 * theta / (float)(1 << steps);
  for (int i = 0; i < rows * B; i++) {
    const float x = alpha * (current[i] - 2 * theta);
    e[i] = fast_exp(x < 40.0f ? x : 40.0f); /* its square is a number */
  }
  for (int i = 0; i < rows * B; i += VL) {
    const vf x = load(e + i);
    vf out = top * load(g + i) * (x * reciprocal((x + 1.0f) * (x + q)));
    if (charge) out += net->charge[layer] * load(charge + i % B) * surrogate(load(current + i) - first);
    store(g + i, out);
  }
}

/* out[rows][B] = init + last_digit times products with numbers, which stand in out. init NULL: 0. */
static void scale_products(int steps, int rows, const float *restrict init, float *restrict out)
{
  const float worth = last_digit(steps);
  for (int i = 0; i < rows * B; i++) out[i] = (init ? init[i] : 0.0f) + worth * out[i];
}

/* A layer's current, and its spikes' numbers as words of rows. w: the current is init + w in, of what `in` is in
 * numbers of `digits` digits, or, for 0, in values. NULL: it is there. */
static void waiting_layer(const sf_net_view *net, int index, int steps, const uint32_t *w, int pairs, const word *in,
                          int in_digits, const float *init, float *current, uint32_t *number)
{
  float own[LAYER_ROWS * B];
  for (int m = 0, n; m < net->hidden; m += n) {
    n = layer_rows(net->hidden - m);
    float *tile = own;
    const float *const from = init ? init + m * B : NULL;
    if (PAIR == 1) tile = floats(number + m * B);
    if (w) gemm(operands(w) + m * pairs, pairs, n, pairs, in, B, B, in_digits ? NULL : from, B, current + m * B, B);
    if (in_digits) scale_products(in_digits, n, from, current + m * B);
    digits(net->theta[index], steps, n, current + m * B, tile);
    row_words(tile, n, number + m / PAIR * B);
  }
}

/* D1's current to x->m1[0]. */
static void radix_density_current(const sf_net_words *n, sf_block *x, sf_net_scratch *w)
{
  constant_current(n, n->w1, n->view.features, x->f, w->rows, x->m1[0]);
}

/* D2's currents to x->i[p], and the density of prefix p + 1. */
static void radix_density_prefix(const sf_net_words *n, sf_block *x, int p, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int pairs = net->hidden / PAIR;
  waiting_layer(net, 0, p + 1, NULL, 0, NULL, 0, NULL, x->m1[0], w->spikes);
  gemm(operands(n->w2), pairs, SF_DENSITY_OUT, pairs, words(w->spikes), B, B, NULL, 0, x->i[p], B);
  scale_products(p + 1, SF_DENSITY_OUT, NULL, x->i[p]);
  exponential(B, x->i[p], x->sigma[p]);
}

/* From C1's current, or what it is made from (as waiting_layer), to the colour of prefix p + 1. */
static void radix_colour_prefix(const sf_net_words *n, sf_block *x, int p, int keep, const uint32_t *w3, int pairs3,
                                const word *in, const float *base, const float *bias2, const float *bias3,
                                sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden, pairs = hidden / PAIR, at = slot(p, keep);
  waiting_layer(net, 1, p + 1, w3, pairs3, in, 0, base, x->m3[at], w->spikes);
  waiting_layer(net, 2, p + 1, n->w4, pairs, words(w->spikes), p + 1, bias2, x->m4[at], w->rows);
  gemm(operands(n->w5), pairs, 4, pairs, words(w->rows), B, B, NULL, 0, x->j[p], B);
  scale_products(p + 1, 4, bias3, x->j[p]);
  sigmoid(3 * B, x->j[p], x->colour[p]);
}

static void radix_density(const sf_net_words *n, sf_block *x, int steps, sf_net_scratch *w)
{
  tiles_begin();
  radix_density_current(n, x, w);
  for (int p = x->from; p < steps; p++) radix_density_prefix(n, x, p, w);
  tiles_end();
}

static void radix_forward(const sf_net_words *n, sf_block *x, int steps, int keep, sf_net_scratch *w)
{
  const float step = n->view.h_step;
  tiles_begin();
  radix_density_current(n, x, w);
  constant_current(n, n->w3d, SF_DIR_FEATURES, x->sh, w->rows, w->sum3);
  for (int p = x->from; p < steps; p++) {
    radix_density_prefix(n, x, p, w);
    for (int a = B; a < SF_DENSITY_OUT * B && step > 0; a++) x->i[p][a] = sf_round_h(x->i[p][a], step, p + 1);
    radix_colour_prefix(n, x, p, keep, n->w3h, SF_DENSITY_OUT / PAIR, row_words(x->i[p], SF_DENSITY_OUT, w->rows),
                        w->sum3, NULL, NULL, w);
  }
  tiles_end();
}

/* Words of lanes of what a layer's spikes are worth, transposed for add_outer. bfloat16 rounds it, as gradients. */
static const word *worth_lanes(const sf_net_view *net, int layer, int steps, const float *current, sf_net_scratch *w)
{
  float own[LAYER_ROWS * B];
  for (int m = 0, n; m < net->hidden; m += n) {
    n = layer_rows(net->hidden - m);
    float *tile = own;
    if (PAIR == 1) tile = floats(w->spikes + m * B);
    digits(net->theta[layer], steps, n, current + m * B, tile);
    scale_products(steps, n, NULL, tile);
    lane_words(tile, n, w->spikes + m * BW);
  }
  transpose(operands(w->spikes), net->hidden, BW, words(w->t), net->hidden);
  return operands(w->t);
}

/* Backward of a layer from the gradient dy (words of rows) of the layer above through its transposed weights
 * wt[hidden][pairs]. Of `out`, sum, rows and lanes count. */
static void waiting_backward(const sf_net_view *net, int index, int steps, const uint32_t *wt, int pairs,
                             const word *dy, const float *current, const float *charge, backward_out out)
{
  float own[LAYER_ROWS * B];
  for (int m = 0, n; m < net->hidden; m += n) {
    n = layer_rows(net->hidden - m);
    float *tile = gradient_tile(out, m, own);
    gemm(operands(wt) + m * pairs, pairs, n, pairs, dy, B, B, NULL, 0, tile, B);
    digits_backward(net, index, steps, n, current + m * B, charge, tile);
    leave_gradient(out, m, n, tile);
  }
}

/* C3 and C2 of prefix p + 1. Leaves the gradient of C2's current as words of rows in w->rows; gj[4][B], the fourth row
 * zero. sum: that gradient is added here, or NULL. */
static void radix_output_backward(const sf_net_words *n, const sf_block *x, int p, const float *charge,
                                  const float *dcolour, float *gj, float *sum, sf_net_grad *grad, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  uint32_t small[4 * B], *lanes = lanes_beside(w->rows, w->lanes);
  memset(gj, 0, 4 * B * sizeof *gj);
  for (int l = 0; l < 3 * B; l++) {
    const float c = x->colour[p][l];
    gj[l] = dcolour[p * 3 * B + l] * c * (1.0f - c);
  }
  add_outer(grad->w5, hidden, lane_words(gj, 4, small), 4, worth_lanes(net, 2, p + 1, x->m4[p], w), hidden);
  waiting_backward(net, 2, p + 1, n->w5t, 4 / PAIR, row_words(gj, 4, small), x->m4[p], charge,
                   (backward_out){.sum = sum, .rows = w->rows, .lanes = lanes});
  add_outer(grad->w4, hidden, operands(lanes), hidden, worth_lanes(net, 1, p + 1, x->m3[p], w), hidden);
}

/* charge of digits_backward: the last prefix is charged. */
static const float *charged_lanes(const sf_net_view *net, const sf_block *x, bool last, float *room)
{
  for (int l = 0; l < B; l++) room[l] = l < x->lanes;
  return last && charged(net) ? room : NULL;
}

static void radix_backward(const sf_net_words *n, const sf_block *x, int steps, const float *dsigma,
                           const float *dcolour, float *df, sf_net_grad *grad, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  const size_t plane = (size_t)hidden * B * sizeof(float);
  tiles_begin();
  memset(w->sum1, 0, plane);
  memset(w->sum3, 0, plane);
  float gsum[SF_DENSITY_OUT * B] = {0}, room[B];
  uint32_t small[SF_DENSITY_OUT * B];
  for (int p = x->from; p < steps; p++) {
    float gj[4 * B], gi[SF_DENSITY_OUT * B];
    uint32_t *rows = w->spikes, *lanes = lanes_beside(rows, w->lanes);
    const float *charge = charged_lanes(net, x, p + 1 == steps, room);
    radix_output_backward(n, x, p, charge, dcolour, gj, NULL, grad, w);
    waiting_backward(net, 1, p + 1, n->w4t, hidden / PAIR, operands(w->rows), x->m3[p], charge,
                     (backward_out){.sum = w->sum3, .rows = rows, .lanes = lanes});
    gemm(operands(n->w3ht), hidden / PAIR, SF_DENSITY_OUT, hidden / PAIR, operands(rows), B, B, NULL, 0, gi, B);
    transpose(lane_words(x->i[p], SF_DENSITY_OUT, w->rows), SF_DENSITY_OUT, BW, words(w->t), SF_DENSITY_OUT);
    /* Column 16 of the padded gradient meets i[0], which is no input of C1: scratch. h starts at column 17. */
    add_outer(grad->w3 + SF_DIR_FEATURES, 32, operands(lanes), hidden, words(w->t), SF_DENSITY_OUT);
    for (int l = 0; l < B; l++) gi[l] = dsigma[p * B + l] * exp_slope(x->i[p][l]);
    add_outer(grad->w2, hidden, lane_words(gi, SF_DENSITY_OUT, small), SF_DENSITY_OUT,
              worth_lanes(net, 0, p + 1, x->m1[0], w), hidden);
    add_to(gsum, gi, SF_DENSITY_OUT * B);
  }
  /* All prefixes have the current of D1, and the ramp's slope does not hang on their steps. */
  waiting_backward(net, 0, steps, n->w2t, SF_DENSITY_OUT / PAIR, row_words(gsum, SF_DENSITY_OUT, small), x->m1[0],
                   charged_lanes(net, x, true, room), (backward_out){.sum = w->sum1, .rows = NULL, .lanes = NULL});
  constant_backward(n, x, df, grad, w);
  tiles_end();
}

/* The nets in any mode. */
static void nets_forward(const sf_net_words *n, sf_block *x, int steps, int keep, sf_net_scratch *w)
{
  (is_radix(&n->view) ? radix_forward : forward)(n, x, steps, keep, w);
}

static void nets_density(const sf_net_words *n, sf_block *x, int steps, sf_net_scratch *w)
{
  (is_radix(&n->view) ? radix_density : density)(n, x, steps, w);
}

static void nets_backward(const sf_net_words *n, const sf_block *x, int steps, const float *dsigma,
                          const float *dcolour, float *df, sf_net_grad *grad, sf_net_scratch *w)
{
  (is_radix(&n->view) ? radix_backward : backward)(n, x, steps, dsigma, dcolour, df, grad, w);
}
#endif
