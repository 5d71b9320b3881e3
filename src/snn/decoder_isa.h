/* TensoRF's appearance features, their encoding and the spiking colour decoder: the colour half of the nets with up to
 * 160 inputs that are constant over the steps, and biases. A bias of C1 is the weight of an input that is always one.
 * Oracles: src/field/tensorf.c, src/snn/net.c.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_DECODER_ISA_H
#define SF_SNN_DECODER_ISA_H
#include "snn/radix_isa.h"

/* Rows of the decoder's inputs: the inputs, the one, zeros. */
static inline int decoder_rows(const sf_decoder_view *v)
{
  return (v->inputs + 1 + 15) / 16 * 16;
}

/* Rows of the appearance features as the products need them. */
#if defined(SF_AMX)
enum { FEATURE_ROWS = TILE_SIDE };
#else
enum { FEATURE_ROWS = 4 };
#endif
static inline int feature_rows(const sf_decoder_view *v)
{
  return (v->features + FEATURE_ROWS - 1) / FEATURE_ROWS * FEATURE_ROWS;
}

static void decoder_prepare(const sf_decoder_view *v, sf_decoder_words *n)
{
  const int hidden = v->net.hidden, rows = decoder_rows(v), features = feature_rows(v);
  float w1[SF_LANES * SF_DECODER_MAX] = {0}, basis[SF_APPEARANCE_MAX * SF_DECODER_MAX] = {0};
  for (int r = 0; r < hidden; r++) {
    memcpy(w1 + r * rows, v->w1 + r * v->inputs, (size_t)v->inputs * sizeof *w1);
    w1[r * rows + v->inputs] = v->b1[r];
  }
  for (int r = 0; r < v->features; r++)
    memcpy(basis + r * v->products, v->basis + r * v->columns, (size_t)v->columns * sizeof *basis);
  n->view = *v;
  sf_net_words *net = &n->net;
  net->view = v->net;
  pack_matrix(w1, rows, 1, hidden, rows, rows, n->w1);
  pack_matrix(w1, 1, rows, rows, hidden, hidden, n->w1t);
  pack_matrix(basis, v->products, 1, features, v->products, v->products, n->basis);
  pack_matrix(basis, 1, v->products, v->products, features, features, n->basist);
  prepare_hidden(&v->net, net);
  for (int l = 0; l < B; l++) {
    for (int r = 0; r < hidden; r++) n->b2[r * B + l] = v->b2[r];
    for (int c = 0; c < 4; c++) n->b3[c * B + l] = c < 3 ? v->b3[c] : 0;
  }
}

/* Sine and cosine within 1e-7 + 1e-7 |x|; Cody and Waite's reduction, Cephes' polynomials. */
static inline void fast_sincos(float x, float *s, float *c)
{
  union {
    float f;
    uint32_t i;
  } shifted = {.f = x * 0.636619772f + 12582912.0f};
  const float n = shifted.f - 12582912.0f;
  const float r = ((x - n * 1.5703125f) - n * 4.837512969970703125e-4f) - n * 7.54978995489188216e-8f, z = r * r;
  const float sine = ((-1.9515295891e-4f * z + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * r + r;
  const float cosine =
      ((2.443315711809948e-5f * z - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) * z * z - 0.5f * z + 1;
  const uint32_t q = shifted.i;
  const float a = q & 1 ? cosine : sine, b = q & 1 ? sine : cosine;
  *s = q & 2 ? -a : a;
  *c = (q + 1) & 2 ? -b : b;
}

/* Rows of the encodings of feature i at frequency f. */
static inline float *sine_row(const sf_decoder_view *v, float *in, int i, int f)
{
  return in + (v->features + 3 + i * v->feature_freqs + f) * B;
}

static inline float *cosine_row(const sf_decoder_view *v, float *in, int i, int f)
{
  return sine_row(v, in, i, f) + v->features * v->feature_freqs * B;
}

/* A frequency from the one below: sin 2a = 2 sin a cos a, cos 2a = 1 - 2 sin^2 a. */
static void encode_features(const sf_decoder_view *v, float *in)
{
  for (int i = 0; i < v->features && v->feature_freqs; i++) {
    float *s = sine_row(v, in, i, 0), *c = cosine_row(v, in, i, 0);
    const float *x = in + i * B;
    for (int l = 0; l < B; l++) fast_sincos(x[l], &s[l], &c[l]);
    for (int f = 1; f < v->feature_freqs; f++)
      for (int l = f * B; l < (f + 1) * B; l++) {
        s[l] = 2 * s[l - B] * c[l - B];
        c[l] = 1 - 2 * s[l - B] * s[l - B];
      }
  }
}

/* Adds to din[features][B] what comes through the encodings. */
static void encode_backward(const sf_decoder_view *v, float *in, float *din)
{
  for (int i = 0; i < v->features; i++)
    for (int f = 0; f < v->feature_freqs; f++) {
      const float *s = sine_row(v, in, i, f), *c = cosine_row(v, in, i, f);
      const float *ds = sine_row(v, din, i, f), *dc = cosine_row(v, din, i, f), scale = (float)(1 << f);
      for (int l = 0; l < B; l++) din[i * B + l] += scale * (c[l] * ds[l] - s[l] * dc[l]);
    }
}

/* Features, and their encodings: those of the direction come rounded. The backward pass takes them for exact. */
static void round_inputs(const sf_decoder_view *v, float *in)
{
  float *encoding = sine_row(v, in, 0, 0);
  if (!(v->feature_step > 0)) return;
  for (int i = 0; i < v->features * B; i++) in[i] = sf_round_input(in[i], v->feature_step);
  for (int i = 0; i < 2 * v->features * v->feature_freqs * B; i++)
    encoding[i] = sf_round_input(encoding[i], v->encoding_step);
}

/* Products to features, encodings and the current that is constant over the steps. */
static void decoder_inputs(const sf_decoder_words *n, sf_decoder_block *x, sf_net_scratch *w)
{
  const sf_decoder_view *v = &n->view;
  const int rows = decoder_rows(v), features = feature_rows(v);
  float out[SF_APPEARANCE_MAX * B];
  transpose(operands(x->product), B, v->products, words(x->product_rows), B);
  gemm(operands(n->basis), v->products / PAIR, features, v->products / PAIR,
       row_words(x->product_rows, v->products, w->rows), B, B, NULL, 0, out, B);
  memcpy(x->in, out, (size_t)v->features * B * sizeof *out);
  encode_features(v, x->in);
  round_inputs(v, x->in);
  for (int l = 0; l < B; l++) x->in[v->inputs * B + l] = 1;
  memset(x->in + (v->inputs + 1) * B, 0, (size_t)(rows - v->inputs - 1) * B * sizeof *x->in);
  constant_current(&n->net, n->w1, rows, x->in, w->rows, w->sum3);
}

static void decoder_forward(const sf_decoder_words *n, sf_decoder_block *d, int steps, int keep, sf_net_scratch *w)
{
  const sf_net_words *net = &n->net;
  const sf_net_view *v = &net->view;
  sf_block *x = &d->net;
  tiles_begin();
  decoder_inputs(n, d, w);
  for (int p = x->from; p < steps && is_radix(v); p++) {
    float *current = x->m3[slot(p, keep)];
    memcpy(current, w->sum3, (size_t)v->hidden * B * sizeof *current);
    radix_colour_prefix(net, x, p, keep, NULL, 0, NULL, NULL, n->b2, n->b3, w);
  }
  for (int t = 0; t < steps && !is_radix(v); t++) {
    layer(v, 1, v->k[2], t, NULL, 0, NULL, w->sum3, t ? x->m3[slot(t - 1, keep)] : NULL, x->m3[slot(t, keep)],
          looked_up(v) ? NULL : words(w->spikes));
    after_colour_1(net, x, t, steps, keep, n->b2, n->b3, w);
  }
  tiles_end();
}

/* grad[rows] += x[rows][B] summed over the lanes. */
static void add_lane_sums(float *grad, const float *x, int rows)
{
  for (int r = 0; r < rows; r++, x += B) {
    vf sum = {0};
    float total = 0;
    for (int l = 0; l < B; l += VL) sum += *(const vf *)(x + l);
    for (int l = 0; l < VL; l++) total += sum[l];
    grad[r] += total;
  }
}

/* Gradients of C1's weights and of everything before: w->sum3 holds the gradient of the constant current. */
static void decoder_inputs_backward(const sf_decoder_words *n, sf_decoder_block *d, float *dproduct,
                                    sf_decoder_grad *grad, sf_net_scratch *w)
{
  const sf_decoder_view *v = &n->view;
  const int hidden = v->net.hidden, rows = decoder_rows(v), features = feature_rows(v);
  word *t = words(w->t);
  float din[SF_DECODER_MAX * B], dout[SF_DECODER_MAX * B];
  transpose(lane_words(d->in, rows, w->spikes), rows, BW, t, rows);
  add_outer(grad->w1, rows, lane_words(w->sum3, hidden, w->lanes), hidden, t, rows);
  gemm(operands(n->w1t), hidden / PAIR, rows, hidden / PAIR, row_words(w->sum3, hidden, w->rows), B, B, NULL, 0, din,
       B);
  encode_backward(v, d->in, din);
  memset(din + v->features * B, 0, (size_t)(features - v->features) * B * sizeof *din);
  transpose(lane_words(d->product_rows, v->products, w->spikes), v->products, BW, t, v->products);
  add_outer(grad->basis, v->products, lane_words(din, features, w->lanes), features, t, v->products);
  gemm(operands(n->basist), features / PAIR, v->products, features / PAIR, row_words(din, features, w->rows), B, B,
       NULL, 0, dout, B);
  transpose(operands(dout), v->products, B, words(dproduct), v->products);
}

static void decoder_backward(const sf_decoder_words *n, sf_decoder_block *d, int steps, const float *dcolour,
                             float *dproduct, sf_decoder_grad *grad, sf_net_scratch *w)
{
  const sf_net_words *net = &n->net;
  const sf_net_view *v = &net->view;
  const int hidden = v->hidden;
  const size_t plane = (size_t)hidden * B * sizeof(float);
  float gcolour[3 * B] = {0}, gsum[4 * B] = {0};
  tiles_begin();
  memset(w->g3, 0, plane);
  memset(w->g4, 0, plane);
  memset(w->sum1, 0, plane);
  memset(w->sum3, 0, plane);
  memset(w->leak, 0, sizeof w->leak);
  if (charged(v) && !is_radix(v)) count_fired(v, &d->net, 1, steps, w);
  for (int p = d->net.from; p < steps && is_radix(v); p++) {
    float gj[4 * B], room[B];
    const float *charge = charged_lanes(v, &d->net, p + 1 == steps, room);
    radix_output_backward(net, &d->net, p, charge, dcolour, gj, w->sum1, &grad->net, w);
    add_to(gsum, gj, 4 * B);
    waiting_backward(v, 1, p + 1, net->w4t, hidden / PAIR, words(w->rows), d->net.m3[p], charge,
                     (backward_out){.sum = w->sum3, .rows = NULL, .lanes = NULL});
  }
  for (int t = steps - 1; t >= 0 && !is_radix(v); t--) {
    float gj[4 * B];
    add_to(gcolour, dcolour + t * 3 * B, 3 * B);
    colour_output_backward(net, &d->net, t, gcolour, gj, w->sum1, &grad->net, w);
    add_to(gsum, gj, 4 * B);
    layer_backward(v, 1, v->k[2], t, net->w4t, hidden / PAIR, words(w->rows), d->net.m3[t],
                   (backward_out){fired(v, 1, w), w->g3, w->leak[2], w->sum3, NULL, NULL, NULL});
  }
  decoder_inputs_backward(n, d, dproduct, grad, w);
  tiles_end();
  add_lane_sums(grad->b2, w->sum1, hidden);
  add_lane_sums(grad->b3, gsum, 3);
  for (int i = 0; i < SF_LAYERS; i++)
    for (int l = 0; l < B; l++) grad->net.leak[i] += w->leak[i][l];
}
#endif
