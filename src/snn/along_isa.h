/* Nets whose steps are the samples of a ray (SpikingNeRF, Yao et al. 2023): one step per sample, and the membranes pass
 * from a sample to the next one of its ray. What a sample alone decides goes through the products of a block; what
 * hangs on the membranes goes sample by sample, a vector holding neighbouring neurons. Outputs are those of the step:
 * there is nothing to integrate. Oracle: tests/gradient_oracle.h. Included by kernels_isa.c only. */
#ifndef SF_SNN_ALONG_ISA_H
#define SF_SNN_ALONG_ISA_H
#include "snn/decoder_isa.h"

enum { ACROSS = 8 }; /* vectors of a row at a time */

/* out[V * VL] += sum of x[c] times row list[c] of w; list NULL: row c; x NULL: ones. */
static inline __attribute__((always_inline)) void sum_rows_tile(int V, const float *w, int ld, const uint16_t *list,
                                                                const float *x, int count, float *out)
{
  vf sum[ACROSS];
#pragma GCC unroll 8
  for (int v = 0; v < V; v++) sum[v] = load(out + v * VL);
  for (int c = 0; c < count; c++) {
    const float *row = w + (size_t)(list ? list[c] : c) * (size_t)ld;
#pragma GCC unroll 8
    for (int v = 0; v < V; v++) sum[v] += (x ? x[c] : 1.0f) * load(row + v * VL);
  }
#pragma GCC unroll 8
  for (int v = 0; v < V; v++) store(out + v * VL, sum[v]);
}

/* n: a multiple of 16. */
static inline __attribute__((always_inline)) void sum_rows(const float *w, int ld, const uint16_t *list, const float *x,
                                                           int count, float *out, int n)
{
  int j = 0;
  for (; j + ACROSS * VL <= n; j += ACROSS * VL) sum_rows_tile(ACROSS, w + j, ld, list, x, count, out + j);
  for (; j < n; j += VL) sum_rows_tile(1, w + j, ld, list, x, count, out + j);
}

/* The neurons that fire; how many. */
static inline int list_spikes(const float *h, int n, float theta, uint16_t *list)
{
  int count = 0;
  for (int i = 0; i < n; i++) {
    list[count] = (uint16_t)i;
    count += h[i] >= theta;
  }
  return count;
}

/* ---- forward ---- */

/* h: the current in, the membrane before fire out; v: after the reset of the sample before, and of this one. */
static void along_charge(const sf_net_view *net, int layer, float k, bool first, float *restrict h, float *restrict v)
{
  const float theta = net->theta[layer], keep = 1.0f - k, gain = net->mode == SF_NODECAY ? 1.0f : k;
  const int n = net->hidden;
  if (first && net->mode == SF_DECAY)
    for (int i = 0; i < n; i++) h[i] *= k;
  else if (!first)
    for (int i = 0; i < n; i++) h[i] = keep * v[i] + gain * h[i];
  for (int i = 0; i < n; i++) v[i] = h[i] - (h[i] >= theta ? theta : 0.0f);
}

static inline bool begins(const sf_block *x, int lane)
{
  return x->first >> lane & 1;
}

/* D1 and D2 of one lane: x->m1, x->i, x->sigma. */
static void along_density_lane(const sf_net_words *n, sf_block *x, int l)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  float *h = x->m1[0] + l * hidden, *i = x->i[0] + l * SF_DENSITY_OUT;
  uint16_t list[SF_LANES + 1];
  along_charge(net, 0, net->k[0], begins(x, l), h, x->state[l]->v[0]);
  memset(i, 0, SF_DENSITY_OUT * sizeof *i);
  sum_rows(n->w2_rows, SF_DENSITY_OUT, list, NULL, list_spikes(h, hidden, net->theta[0], list), i, SF_DENSITY_OUT);
  x->sigma[0][l] = fast_exp(i[0]);
}

/* C1 to C3 of one lane from C1's current in x->m3: x->m3, x->m4, x->colour. Biases: NULL or [hidden], [3]. */
static void along_colour_lane(const sf_net_words *n, sf_block *x, int l, const float *b2, const float *b3)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  float *h3 = x->m3[0] + l * hidden, *h4 = x->m4[0] + l * hidden, j[16] = {0};
  uint16_t list[SF_LANES + 1];
  along_charge(net, 1, net->k[2], begins(x, l), h3, x->state[l]->v[1]);
  if (b2)
    memcpy(h4, b2, (size_t)hidden * sizeof *h4);
  else
    memset(h4, 0, (size_t)hidden * sizeof *h4);
  sum_rows(n->w4_rows, hidden, list, NULL, list_spikes(h3, hidden, net->theta[1], list), h4, hidden);
  along_charge(net, 2, net->k[3], begins(x, l), h4, x->state[l]->v[2]);
  sum_rows(n->w5_rows, 16, list, NULL, list_spikes(h4, hidden, net->theta[2], list), j, 16);
  for (int c = 0; c < 3; c++) x->colour[0][c * B + l] = 1.0f / (1.0f + fast_exp(-(j[c] + (b3 ? b3[c] : 0))));
}

/* sum[hidden][B] to m[B][hidden]. */
static void by_lane(const float *sum, int hidden, float *m)
{
  transpose(operands(sum), hidden, B, words(m), hidden);
}

static void along_density(const sf_net_words *n, sf_block *x, sf_net_scratch *w)
{
  tiles_begin();
  constant_current(n, n->w1, n->view.features, x->f, w->rows, w->sum1);
  tiles_end();
  by_lane(w->sum1, n->view.hidden, x->m1[0]);
  for (int l = 0; l < x->lanes; l++) along_density_lane(n, x, l);
}

static void along_forward(const sf_net_words *n, sf_block *x, sf_net_scratch *w)
{
  const int hidden = n->view.hidden;
  tiles_begin();
  constant_current(n, n->w1, n->view.features, x->f, w->rows, w->sum1);
  constant_current(n, n->w3d, SF_DIR_FEATURES, x->sh, w->rows, w->sum3);
  tiles_end();
  by_lane(w->sum1, hidden, x->m1[0]);
  by_lane(w->sum3, hidden, x->m3[0]);
  for (int l = 0; l < x->lanes; l++) {
    along_density_lane(n, x, l);
    sum_rows(n->w3h_rows, hidden, NULL, x->i[0] + l * SF_DENSITY_OUT, SF_DENSITY_OUT, x->m3[0] + l * hidden, hidden);
    along_colour_lane(n, x, l, NULL, NULL);
  }
}

static void decoder_along_forward(const sf_decoder_words *n, sf_decoder_block *d, sf_net_scratch *w)
{
  tiles_begin();
  decoder_inputs(n, d, w);
  tiles_end();
  by_lane(w->sum3, n->net.view.hidden, d->net.m3[0]);
  for (int l = 0; l < d->net.lanes; l++) along_colour_lane(&n->net, &d->net, l, n->view.b2, n->view.b3);
}

/* ---- backward ---- */

/* g: gradient of the spikes in, of the current out; carry: of the membrane after the reset, of this sample in, of the
 * one before out. Returns the slope of the leak's logit, as fire_backward. */
static float along_fire_backward(const sf_net_view *net, int layer, float k, bool first, const float *restrict h,
                                 float *restrict g, float *restrict carry)
{
  const bool as_it_is = first && net->mode == SF_HYBRID;
  const float keep = 1.0f - k, gain = net->mode == SF_NODECAY || as_it_is ? 1.0f : k;
  const float with_h = net->mode == SF_NODECAY || as_it_is ? 0.0f : keep;
  const float with_v = net->mode == SF_NODECAY ? -k : -1.0f;
  const vf theta = (vf){0} + net->theta[layer];
  vf sum_h = {0}, sum_v = {0};
  for (int i = 0; i < net->hidden; i += VL) {
    const vf x = load(h + i), gv = load(carry + i);
    const vf v = x - (vf)((x >= theta) & (vi)theta);
    const vf gh = (load(g + i) - theta * gv) * surrogate(x - theta) + gv;
    store(carry + i, (first ? 0.0f : keep) * gh);
    store(g + i, gain * gh);
    sum_h += gh * x;
    sum_v += gv * v;
  }
  float slope = 0;
  for (int i = 0; i < VL; i++) slope += with_h * sum_h[i] + with_v * sum_v[i];
  return slope;
}

/* to[n] += a * (h >= theta). */
static inline void add_spikes(float *restrict to, const float *restrict h, float theta, float a, int n)
{
  for (int i = 0; i < n; i++) to[i] += h[i] >= theta ? a : 0.0f;
}

/* C3 to C1 of one lane; dj: gradient of C3's current. Leaves those of C1's and C2's currents in w->g3 and w->g4. */
static void along_colour_backward(const sf_net_words *n, const sf_block *x, int l, const float dj[3], sf_net_grad *grad,
                                  sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  const float *h3 = x->m3[0] + l * hidden, *h4 = x->m4[0] + l * hidden;
  float *g3 = w->g3 + l * hidden, *g4 = w->g4 + l * hidden;
  uint16_t list[SF_LANES + 1];
  memset(g3, 0, (size_t)hidden * sizeof *g3);
  memset(g4, 0, (size_t)hidden * sizeof *g4);
  for (int c = 0; c < 3; c++) add_spikes(grad->w5 + c * hidden, h4, net->theta[2], dj[c], hidden);
  sum_rows(net->w5, hidden, NULL, dj, 3, g4, hidden);
  w->leak[3][l] += along_fire_backward(net, 2, net->k[3], begins(x, l), h4, g4, w->carry.v[2]);
  const int spikes = list_spikes(h3, hidden, net->theta[1], list);
  for (int s = 0; s < spikes; s++) add_to(grad->w4t + list[s] * hidden, g4, hidden);
  sum_rows(net->w4, hidden, NULL, g4, hidden, g3, hidden);
  w->leak[2][l] += along_fire_backward(net, 1, net->k[2], begins(x, l), h3, g3, w->carry.v[1]);
}

/* D2 and D1 of one lane from C1's in w->g3. Leaves the gradient of D1's current in w->g1. */
static void along_density_backward(const sf_net_words *n, const sf_block *x, int l, float dsigma, sf_net_grad *grad,
                                   sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  const float *h = x->m1[0] + l * hidden, *i = x->i[0] + l * SF_DENSITY_OUT, *g3 = w->g3 + l * hidden;
  float *g1 = w->g1 + l * hidden, gi[SF_DENSITY_OUT] = {0};
  sum_rows(n->h_rows, 16, NULL, g3, hidden, gi, SF_DENSITY_OUT);
  for (int r = 0; r < hidden; r++) /* column 16 is scratch, as in colour_backward */
    for (int a = 0; a < SF_DENSITY_OUT; a++) grad->w3[32 * r + SF_DIR_FEATURES + a] += g3[r] * i[a];
  gi[0] = dsigma * fast_exp(i[0] > 15.0f ? 15.0f : i[0] < -15.0f ? -15.0f : i[0]);
  for (int a = 0; a < SF_DENSITY_OUT; a++) add_spikes(grad->w2 + a * hidden, h, net->theta[0], gi[a], hidden);
  memset(g1, 0, (size_t)hidden * sizeof *g1);
  sum_rows(net->w2, hidden, NULL, gi, SF_DENSITY_OUT, g1, hidden);
  w->leak[0][l] += along_fire_backward(net, 0, net->k[0], begins(x, l), h, g1, w->carry.v[0]);
}

static void colour_slope(const sf_block *x, int l, const float *dcolour, float dj[3])
{
  for (int c = 0; c < 3; c++) {
    const float y = x->colour[0][c * B + l];
    dj[c] = dcolour[c * B + l] * y * (1.0f - y);
  }
}

/* g[B][hidden] of the lanes with samples to sum[hidden][B], zeros in the others. */
static void by_row(float *g, int hidden, int lanes, float *sum)
{
  memset(g + lanes * hidden, 0, (size_t)((B - lanes) * hidden) * sizeof *g);
  transpose(operands(g), B, hidden, words(sum), B);
}

static void add_leaks(const sf_net_scratch *w, sf_net_grad *grad)
{
  for (int i = 0; i < SF_LAYERS; i++)
    for (int l = 0; l < B; l++) grad->leak[i] += w->leak[i][l];
}

static void along_backward(const sf_net_words *n, const sf_block *x, const float *dsigma, const float *dcolour,
                           float *df, sf_net_grad *grad, sf_net_scratch *w)
{
  const int hidden = n->view.hidden;
  memset(w->leak, 0, sizeof w->leak);
  for (int l = x->lanes - 1; l >= 0; l--) {
    float dj[3];
    colour_slope(x, l, dcolour, dj);
    along_colour_backward(n, x, l, dj, grad, w);
    along_density_backward(n, x, l, dsigma[l], grad, w);
  }
  by_row(w->g1, hidden, x->lanes, w->sum1);
  by_row(w->g3, hidden, x->lanes, w->sum3);
  tiles_begin();
  constant_backward(n, x, df, grad, w);
  tiles_end();
  add_leaks(w, grad);
}

static void decoder_along_backward(const sf_decoder_words *n, sf_decoder_block *d, const float *dcolour,
                                   float *dproduct, sf_decoder_grad *grad, sf_net_scratch *w)
{
  const sf_block *x = &d->net;
  const int hidden = n->net.view.hidden;
  memset(w->leak, 0, sizeof w->leak);
  for (int l = x->lanes - 1; l >= 0; l--) {
    float dj[3];
    colour_slope(x, l, dcolour, dj);
    along_colour_backward(&n->net, x, l, dj, &grad->net, w);
    add_to(grad->b2, w->g4 + l * hidden, hidden);
    for (int c = 0; c < 3; c++) grad->b3[c] += dj[c];
  }
  by_row(w->g3, hidden, x->lanes, w->sum3);
  tiles_begin();
  decoder_inputs_backward(n, d, dproduct, grad, w);
  tiles_end();
  add_leaks(w, &grad->net);
}
#endif
