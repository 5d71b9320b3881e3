/* The kernels of kernels.h for one instruction set: the build defines SF_ISA. Oracle: net.c.
 * Backward follows SpikingJelly's sigmoid surrogate with the reset path differentiated. */
#include "snn/kernels.h"
#include "snn/gemm_isa.h"
#include "snn/plif.h"

#define SF_JOIN_(a, b) a##b
#define SF_JOIN(a, b) SF_JOIN_(a, b)
#define SF_TEXT_(a) #a
#define SF_TEXT(a) SF_TEXT_(a)

enum { B = SF_BLOCK, IN3 = SF_DIR_FEATURES + SF_GEO_FEATURES, BW = B / PAIR, TILE = 6 };

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

/* Weights [rows][columns] (row stride ld) as words [rows][padded / PAIR], zero beyond `columns`. */
static void pack_matrix(const float *w, int row, int column, int rows, int columns, int padded, uint32_t *out)
{
  word *to = (word *)out;
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < padded; c += PAIR) {
      const int d = c + PAIR - 1;
      *to++ = pair(c < columns ? w[r * row + c * column] : 0, d < columns ? w[r * row + d * column] : 0);
    }
}

static void prepare(const sf_net_view *v, sf_net_words *n)
{
  const int hidden = v->hidden, features = v->features;
  float h[SF_LANES * 16] = {0};
  for (int r = 0; r < hidden; r++)
    memcpy(h + 16 * r + 1, v->w3 + IN3 * r + SF_DIR_FEATURES, SF_GEO_FEATURES * sizeof *h);
  memset(n, 0, sizeof *n);
  n->view = *v;
  pack_matrix(v->w1, features, 1, hidden, features, features, n->w1);
  pack_matrix(v->w2, hidden, 1, SF_DENSITY_OUT, hidden, hidden, n->w2);
  pack_matrix(v->w3, IN3, 1, hidden, SF_DIR_FEATURES, SF_DIR_FEATURES, n->w3d);
  pack_matrix(h, 16, 1, hidden, 16, 16, n->w3h);
  pack_matrix(v->w4, hidden, 1, hidden, hidden, hidden, n->w4);
  pack_matrix(v->w5, hidden, 1, 3, hidden, hidden, n->w5); /* the fourth row stays zero */
  pack_matrix(v->w1, 1, features, features, hidden, hidden, n->w1t);
  pack_matrix(v->w2, 1, hidden, hidden, SF_DENSITY_OUT, SF_DENSITY_OUT, n->w2t);
  pack_matrix(h, 1, 16, 16, hidden, hidden, n->w3ht);
  pack_matrix(v->w4, 1, hidden, hidden, hidden, hidden, n->w4t);
  pack_matrix(v->w5, 1, hidden, hidden, 3, 4, n->w5t);
  for (int r = 0; r < hidden; r++)
    for (int c = 0; c < hidden; c++) n->w4_slice[c / 64][r * 64 + c % 64] = operand(v->w4[c * hidden + r]);
}

/* Words of neighbouring rows: x[rows][B] -> out[rows / PAIR][B]. */
static inline void pack_rows(const float *restrict x, int rows, word *restrict out)
{
  for (int r = 0; r < rows; r += PAIR, out += B)
    for (int l = 0; l < B; l++) out[l] = pair(x[r * B + l], x[(r + PAIR - 1) * B + l]);
}

/* Words of lanes l and l + B/2: x[rows][B] -> out[rows][BW]. */
static inline void pack_lanes(const float *restrict x, int rows, word *restrict out)
{
  for (int r = 0; r < rows; r++, x += B, out += BW)
    for (int l = 0; l < BW; l++) out[l] = pair(x[l], x[l + B - BW]);
}

/* Activations (spikes, or ReLU for the twin) of membranes before fire, as words of rows. */
static inline void activation_rows(const sf_net_view *net, int layer, int rows, const float *restrict h,
                                   word *restrict out)
{
  const float theta = net->theta[layer];
  for (int r = 0; r < rows; r += PAIR, out += B) {
    const float *x = h + r * B, *y = h + (r + PAIR - 1) * B;
    if (net->relu)
      for (int l = 0; l < B; l++) out[l] = pair(x[l] > 0 ? x[l] : 0, y[l] > 0 ? y[l] : 0);
    else
      for (int l = 0; l < B; l++) out[l] = spike_pair(x[l], y[l], theta);
  }
}

/* The same as words of lanes. */
static inline void activation_lanes(const sf_net_view *net, int layer, int rows, const float *restrict h,
                                    word *restrict out)
{
  const float theta = net->theta[layer];
  for (int r = 0; r < rows; r++, h += B, out += BW) {
    const float *y = h + B - BW;
    if (net->relu)
      for (int l = 0; l < BW; l++) out[l] = pair(h[l] > 0 ? h[l] : 0, y[l] > 0 ? y[l] : 0);
    else
      for (int l = 0; l < BW; l++) out[l] = spike_pair(h[l], y[l], theta);
  }
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
 * w NULL: the current is init. s: activations as words of rows. */
static void layer(const sf_net_view *net, int index, float k, int t, const word *w, int pairs, const word *in,
                  const float *init, const float *prev, float *h, word *s)
{
  float tile[TILE * B];
  for (int m = 0, n; m < net->hidden; m += n, s += n / PAIR * B) {
    n = tile_rows(net->hidden - m);
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

/* Above these shares of neurons firing in a block, the dense products are faster (measured: make bench). */
static const float dense_forward = 0.25f, dense_backward = 0.45f;

static bool few_spikes(const uint64_t *spikes, int rows, float share)
{
  int count = 0;
  for (int r = 0; r < rows; r++) count += __builtin_popcountll(spikes[r]);
  return (float)count < share * (float)(rows * B);
}

/* out[V*VL] = sum of the listed rows; pairs of rows, the list ends with a row of zeros where needed. */
static inline __attribute__((always_inline)) void add_rows(int V, const float *rows, int ld, const uint8_t *list, int n,
                                                           float *out)
{
  vf a[4], b[4];
#pragma GCC unroll 4
  for (int v = 0; v < V; v++) a[v] = b[v] = (vf){0};
  for (int i = 0; i < n; i += 2) {
    const float *x = rows + list[i] * ld, *y = rows + list[i + 1] * ld;
#pragma GCC unroll 4
    for (int v = 0; v < V; v++) {
      a[v] += *(const vf *)(x + v * VL);
      b[v] += *(const vf *)(y + v * VL);
    }
  }
#pragma GCC unroll 4
  for (int v = 0; v < V; v++) *(vf *)(out + v * VL) = a[v] + b[v];
}

/* Event-driven product: per lane, the rows of the neurons that fire are added. slice[..][hidden + 1][64], the last row
 * zero; spikes[hidden]; out[B][hidden]. A slice fits the first-level cache and leaves room there. */
static void event_current(const float slice[][(SF_LANES + 1) * 64], int hidden, const uint64_t *spikes, float *out)
{
  uint8_t list[B][SF_LANES + 64];
  int count[B] = {0};
  for (int first = 0; first < hidden; first += 64) {
    uint64_t bits[64] = {0};
    memcpy(bits, spikes + first, (size_t)(hidden - first < 64 ? hidden - first : 64) * sizeof *bits);
    transpose_bits(bits);
    for (int l = 0; l < B; l++) count[l] += list_bits(bits[l], (uint8_t)first, list[l] + count[l]);
  }
  for (int l = 0; l < B; l++) list[l][count[l]] = (uint8_t)hidden;
  int c = 0;
  for (; c + 4 * VL <= hidden; c += 4 * VL)
    for (int l = 0; l < B; l++) add_rows(4, slice[c / 64] + c % 64, 64, list[l], count[l], out + l * hidden + c);
  for (; c < hidden; c += VL)
    for (int l = 0; l < B; l++) add_rows(1, slice[c / 64] + c % 64, 64, list[l], count[l], out + l * hidden + c);
}

/* grad[m][V*VL] += the rows of the lanes in which neuron m fires. */
static inline __attribute__((always_inline)) void add_lanes(int V, float *grad, uint64_t lanes, const float *rows,
                                                            int ld)
{
  vf a[8];
#pragma GCC unroll 8
  for (int v = 0; v < V; v++) a[v] = *(const vf *)(grad + v * VL);
  for (; lanes; lanes &= lanes - 1) {
    const float *x = rows + __builtin_ctzll(lanes) * ld;
#pragma GCC unroll 8
    for (int v = 0; v < V; v++) a[v] += *(const vf *)(x + v * VL);
  }
#pragma GCC unroll 8
  for (int v = 0; v < V; v++) *(vf *)(grad + v * VL) = a[v];
}

/* Event-driven weights' gradient: grad[hidden][hidden] (in, out) += spikes[hidden] x dy[B][hidden]. */
static void event_outer(float *grad, int hidden, const uint64_t *spikes, const float *dy)
{
  int c = 0;
  for (; c + 8 * VL <= hidden; c += 8 * VL)
    for (int m = 0; m < hidden; m++) add_lanes(8, grad + m * hidden + c, spikes[m], dy + c, hidden);
  for (; c < hidden; c += VL)
    for (int m = 0; m < hidden; m++) add_lanes(1, grad + m * hidden + c, spikes[m], dy + c, hidden);
}

/* Where the membranes of step t are kept: what backward does not ask for shares the last place. */
static inline int slot(int t, int keep)
{
  return t < keep ? t : SF_T_MAX - 1;
}

/* Density net at step t. */
static void density_step(const sf_net_words *n, sf_block *x, int t, int keep, const float *current, sf_net_scratch *w,
                         float *i, float *sigma, const float *sigma_before)
{
  const sf_net_view *net = &n->view;
  word *spikes = (word *)w->spikes;
  float e[B];
  layer(net, 0, net->k[0], t, NULL, 0, NULL, current, t ? x->m1[slot(t - 1, keep)] : NULL, x->m1[slot(t, keep)],
        spikes);
  gemm((const word *)n->w2, net->hidden / PAIR, SF_DENSITY_OUT, net->hidden / PAIR, spikes, B, B, NULL, 0, i, B);
  exponential(B, i, e);
  integrate(net, net->k[1], t, B, e, sigma_before, sigma);
}

/* in[inputs][B] times words of weights: what is constant over the steps. */
static void constant_current(const sf_net_words *n, const uint32_t *weights, int inputs, const float *in, word *words,
                             float *current)
{
  const int pairs = inputs / PAIR;
  pack_rows(in, inputs, words);
  gemm((const word *)weights, pairs, n->view.hidden, pairs, words, B, B, NULL, 0, current, B);
}

static void density(const sf_net_words *n, sf_block *x, int steps, sf_net_scratch *w)
{
  constant_current(n, n->w1, n->view.features, x->f, (word *)w->rows, w->sum1);
  for (int t = 0; t < steps; t++)
    density_step(n, x, t, 0, w->sum1, w, x->i[0], x->sigma[t], t ? x->sigma[t - 1] : NULL);
}

/* C2 at step t from the spikes of C1 in w->spikes; activations to w->rows. */
static void colour_layer_2(const sf_net_words *n, sf_block *x, int t, int at, int before, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  const word *weights = (const word *)n->w4;
  float *current = NULL;
  for (int r = 0; r < hidden; r++) x->s3[at][r] = spike_bits(x->m3[at] + r * B, net->theta[1]);
  if (!net->relu && few_spikes(x->s3[at], hidden, dense_forward)) {
    weights = NULL;
    current = (float *)w->lanes;
    event_current(n->w4_slice, hidden, x->s3[at], (float *)w->t);
    transpose((word *)w->t, B, hidden, (word *)w->lanes, B);
  }
  layer(net, 2, net->k[3], t, weights, hidden / PAIR, (word *)w->spikes, current, t ? x->m4[before] : NULL, x->m4[at],
        (word *)w->rows);
}

static void forward(const sf_net_words *n, sf_block *x, int steps, int keep, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int pairs = net->hidden / PAIR;
  word *spikes = (word *)w->spikes, *rows = (word *)w->rows;
  constant_current(n, n->w1, net->features, x->f, rows, w->sum1);
  constant_current(n, n->w3d, SF_DIR_FEATURES, x->sh, rows, w->sum3);
  for (int t = 0; t < steps; t++) {
    const int at = slot(t, keep), before = slot(t - 1, keep);
    float c[3 * B];
    density_step(n, x, t, keep, w->sum1, w, x->i[t], x->sigma[t], t ? x->sigma[t - 1] : NULL);
    pack_rows(x->i[t], SF_DENSITY_OUT, rows);
    layer(net, 1, net->k[2], t, (const word *)n->w3h, SF_DENSITY_OUT / PAIR, rows, w->sum3, t ? x->m3[before] : NULL,
          x->m3[at], spikes);
    colour_layer_2(n, x, t, at, before, w);
    gemm((const word *)n->w5, pairs, 4, pairs, rows, B, B, NULL, 0, x->j[t], B);
    sigmoid(3 * B, x->j[t], c);
    integrate(net, net->k[4], t, 3 * B, c, t ? x->colour[t - 1] : NULL, x->colour[t]);
  }
}

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

/* The surrogate's slope alpha s (1 - s), s = sigmoid(alpha x), alpha = 4, which is 1 / cosh^2(2 x), its maximum 1:
 * within 7e-5 of it for every x. cosh^2 as a polynomial in x^2, fitted so that its inverse has the least largest error
 * (6.2e-6). */
static inline vf surrogate(vf x)
{
  const vf far = (vf){0} + 64.0f;
  vf w = x * x;
  const vi near = w < far;
  w = (vf)(((vi)w & near) | ((vi)far & ~near));
  vf p = w * 4.04860913e-2f + 6.45573130e-2f;
  p = p * w + 9.19493240e-1f;
  p = p * w + 2.78582631f;
  p = p * w + 5.34561520f;
  p = p * w + 3.99923221f;
  p = p * w + 1.00000616f;
  return reciprocal(p);
}
_Static_assert(SF_SURROGATE_ALPHA == 4, "surrogate() is a fit for alpha = 4");

/* Backward of fire at step t. g: gradient of the activation in, of the current out; carry: gradient of the membrane
 * after reset, in and out; leak[B]: sum of g_h * dh/dw per lane. dh/dw = k(1-k)(x - v) = (1-k)(h - v) where the input
 * decays, -k(1-k) v where it does not; the part of v, which this step leaves to the next, is added here, where h is at
 * hand: carry = (1-k) g_h(t+1). */
static inline void fire_backward(const sf_net_view *net, int layer, float k, int t, int rows, const float *restrict h,
                                 float *restrict g, float *restrict carry, float *restrict leak)
{
  if (net->relu) {
    for (int i = 0; i < rows * B; i++) g[i] = h[i] > 0 ? g[i] : 0;
    return;
  }
  const int hybrid_first = t == 0 && net->mode == SF_HYBRID;
  const float keep = 1.0f - k, gain = net->mode == SF_NODECAY || hybrid_first ? 1.0f : k;
  const float with_h = net->mode == SF_NODECAY || hybrid_first ? 0.0f : keep;
  const float with_v = net->mode == SF_NODECAY ? -k : -1.0f;
  const vf theta = (vf){0} + net->theta[layer];
  for (int l = 0; l < B; l += VL) {
    vf sum_h = {0}, sum_v = {0};
    for (int r = 0; r < rows; r++) {
      const int i = r * B + l;
      const vf x = *(const vf *)(h + i), gv = *(const vf *)(carry + i);
      const vf v = x - (vf)((x >= theta) & (vi)theta);
      const vf gh = (*(const vf *)(g + i) - theta * gv) * surrogate(x - theta) + gv;
      *(vf *)(carry + i) = keep * gh;
      *(vf *)(g + i) = gain * gh;
      sum_h += gh * x;
      sum_v += gv * v;
    }
    *(vf *)(leak + l) += with_h * sum_h + with_v * sum_v;
  }
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

/* What layer_backward leaves behind; NULL = not wanted. */
typedef struct backward_out {
  float *carry, *leak, *sum; /* sum: currents' gradient added up over the steps */
  float *all;                /* currents' gradient [hidden][B] */
  word *rows, *lanes;        /* currents' gradient as operands */
} backward_out;

/* Backward of a spiking layer at step t from the gradient dy (words of rows) of the layer above, through its transposed
 * weights wt[hidden][pairs]; a few rows at a time. */
static void layer_backward(const sf_net_view *net, int index, float k, int t, const uint32_t *wt, int pairs,
                           const word *dy, const float *h, backward_out out)
{
  float tile[TILE * B];
  for (int m = 0, n; m < net->hidden; m += n) {
    n = tile_rows(net->hidden - m);
    gemm((const word *)wt + m * pairs, pairs, n, pairs, dy, B, B, NULL, 0, tile, B);
    fire_backward(net, index, k, t, n, h + m * B, tile, out.carry + m * B, out.leak);
    if (out.sum) add_to(out.sum + m * B, tile, n * B);
    if (out.all) memcpy(out.all + m * B, tile, (size_t)n * B * sizeof *tile);
    if (out.rows) pack_rows(tile, n, out.rows + m / PAIR * B);
    if (out.lanes) pack_lanes(tile, n, out.lanes + m * BW);
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
  activation_lanes(net, layer, net->hidden, h, (word *)w->spikes);
  transpose((word *)w->spikes, net->hidden, BW, (word *)w->t, net->hidden);
  return (const word *)w->t;
}

/* Colour integrator and layers C3, C2, C1 at step t; leaves the gradient of i in gi[16][B], row 0 zero. */
static void colour_backward(const sf_net_words *n, const sf_block *x, int t, float *gcolour, float *gi,
                            sf_net_grad *grad, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  float c[3 * B], gj[4 * B] = {0};
  word *rows = (word *)w->rows, *lanes = (word *)w->lanes, small[4 * B];
  sigmoid(3 * B, x->j[t], c);
  for (int a = 0; a < 3; a++)
    integrate_backward(net, net->k[4], t, c + a * B, t ? x->colour[t - 1] + a * B : NULL, gcolour + a * B, gj + a * B,
                       w->leak[4]);
  for (int i = 0; i < 3 * B; i++) gj[i] *= c[i] * (1.0f - c[i]);
  pack_lanes(gj, 4, small);
  add_outer(grad->w5, hidden, small, 4, activations(net, 2, x->m4[t], w), hidden);
  pack_rows(gj, 4, small);
  const bool events = !net->relu && few_spikes(x->s3[t], hidden, dense_backward);
  layer_backward(
      net, 2, net->k[3], t, n->w5t, 4 / PAIR, small, x->m4[t],
      (backward_out){w->g4, w->leak[3], NULL, events ? (float *)w->lanes : NULL, rows, events ? NULL : lanes});
  if (events) {
    transpose(lanes, hidden, B, (word *)w->t, hidden);
    event_outer(grad->w4t, hidden, x->s3[t], (float *)w->t);
  } else
    add_outer(grad->w4, hidden, lanes, hidden, activations(net, 1, x->m3[t], w), hidden);
  word *rows3 = (word *)w->spikes;
  layer_backward(net, 1, net->k[2], t, n->w4t, hidden / PAIR, rows, x->m3[t],
                 (backward_out){w->g3, w->leak[2], w->sum3, NULL, rows3, lanes});
  gemm((const word *)n->w3ht, hidden / PAIR, 16, hidden / PAIR, rows3, B, B, NULL, 0, gi, B);
  pack_lanes(x->i[t], SF_DENSITY_OUT, rows);
  transpose(rows, SF_DENSITY_OUT, BW, (word *)w->t, SF_DENSITY_OUT);
  /* Column 16 of the padded gradient meets i[0], which is no input of C1: scratch. h starts at column 17. */
  add_outer(grad->w3 + SF_DIR_FEATURES, 32, lanes, hidden, (word *)w->t, SF_DENSITY_OUT);
}

/* Gradients of what was constant over the steps: w1, the directions' part of w3, and the features. */
static void constant_backward(const sf_net_words *n, const sf_block *x, float *df, sf_net_grad *grad, sf_net_scratch *w)
{
  const int hidden = n->view.hidden, features = n->view.features, padded = (features + 15) / 16 * 16;
  word *rows = (word *)w->rows, *lanes = (word *)w->lanes, *spikes = (word *)w->spikes, *t = (word *)w->t;
  pack_lanes(x->sh, SF_DIR_FEATURES, spikes);
  transpose(spikes, SF_DIR_FEATURES, BW, t, SF_DIR_FEATURES);
  pack_lanes(w->sum3, hidden, lanes);
  add_outer(grad->w3, 32, lanes, hidden, t, SF_DIR_FEATURES);
  memset(spikes, 0, (size_t)padded * BW * sizeof *spikes);
  pack_lanes(x->f, features, spikes);
  transpose(spikes, padded, BW, t, padded);
  pack_lanes(w->sum1, hidden, lanes);
  add_outer(grad->w1, padded, lanes, hidden, t, padded);
  pack_rows(w->sum1, hidden, rows);
  gemm((const word *)n->w1t, hidden / PAIR, features, hidden / PAIR, rows, B, B, NULL, 0, df, B);
}

static void backward(const sf_net_words *n, const sf_block *x, int steps, const float *dsigma, const float *dcolour,
                     float *df, sf_net_grad *grad, sf_net_scratch *w)
{
  const sf_net_view *net = &n->view;
  const int hidden = net->hidden;
  const size_t plane = (size_t)hidden * B * sizeof(float);
  float gsigma[B] = {0}, gcolour[3 * B] = {0};
  memset(w->g1, 0, plane);
  memset(w->g3, 0, plane);
  memset(w->g4, 0, plane);
  memset(w->sum1, 0, plane);
  memset(w->sum3, 0, plane);
  memset(w->leak, 0, sizeof w->leak);
  for (int t = steps - 1; t >= 0; t--) {
    float gi[SF_DENSITY_OUT * B], ge[B], e[B];
    word small[SF_DENSITY_OUT * B];
    add_to(gsigma, dsigma + t * B, B);
    add_to(gcolour, dcolour + t * 3 * B, 3 * B);
    exponential(B, x->i[t], e);
    integrate_backward(net, net->k[1], t, e, t ? x->sigma[t - 1] : NULL, gsigma, ge, w->leak[1]);
    colour_backward(n, x, t, gcolour, gi, grad, w);
    for (int l = 0; l < B; l++) {
      float clamped = x->i[t][l] > 15.0f ? 15.0f : x->i[t][l] < -15.0f ? -15.0f : x->i[t][l];
      gi[l] = ge[l] * fast_exp(clamped); /* torch-ngp's trunc_exp */
    }
    pack_lanes(gi, SF_DENSITY_OUT, small);
    add_outer(grad->w2, hidden, small, SF_DENSITY_OUT, activations(net, 0, x->m1[t], w), hidden);
    pack_rows(gi, SF_DENSITY_OUT, small);
    layer_backward(net, 0, net->k[0], t, n->w2t, SF_DENSITY_OUT / PAIR, small, x->m1[t],
                   (backward_out){w->g1, w->leak[0], w->sum1, NULL, NULL, NULL});
  }
  constant_backward(n, x, df, grad, w);
  for (int i = 0; i < SF_LAYERS; i++)
    for (int l = 0; l < B; l++) grad->leak[i] += w->leak[i][l];
}

/* Table index and trilinear weight of the 8 corners of every sample of a block. */
static void grid_corners(const sf_grid_level *level, const float *restrict x, int32_t index[8][B], float weight[8][B])
{
  const float scale = level->scale;
  const uint32_t stride = level->stride, mask = level->entries - 1;
  for (int l = 0; l < B; l++) {
    float px = x[l] * scale + 0.5f, py = x[B + l] * scale + 0.5f, pz = x[2 * B + l] * scale + 0.5f;
    int32_t cx = (int32_t)px, cy = (int32_t)py, cz = (int32_t)pz;
    float fx = px - (float)cx, fy = py - (float)cy, fz = pz - (float)cz;
#pragma GCC unroll 8
    for (int c = 0; c < 8; c++) {
      uint32_t ix = (uint32_t)cx + (c & 1), iy = (uint32_t)cy + (c >> 1 & 1), iz = (uint32_t)cz + (c >> 2);
      uint32_t dense = ix + stride * (iy + stride * iz);
      uint32_t hashed = (ix ^ iy * 2654435761u ^ iz * 805459861u) & mask;
      index[c][l] = (int32_t)(stride ? dense : hashed);
      weight[c][l] = (c & 1 ? fx : 1 - fx) * (c & 2 ? fy : 1 - fy) * (c & 4 ? fz : 1 - fz);
    }
  }
}

/* Asks for a block's entries before the first is used: tables do not fit the caches, and the sums would wait for one
 * sample's lines after another's (2.4 times as fast on a table in memory). */
static void prefetch_corners(const float *entries, int32_t index[8][B])
{
  for (int l = 0; l < B; l++)
#pragma GCC unroll 8
    for (int c = 0; c < 8; c++) __builtin_prefetch(entries + 2 * (size_t)index[c][l]);
}

static void grid_forward(const sf_grid_level *level, const float *table, const float *x, float *restrict out)
{
  int32_t index[8][B];
  float weight[8][B];
  grid_corners(level, x, index, weight);
  const float *entries = table + 2 * level->offset;
  prefetch_corners(entries, index);
  for (int l = 0; l < B; l++) {
    float a = 0, b = 0;
#pragma GCC unroll 8
    for (int c = 0; c < 8; c++) {
      const float *e = entries + 2 * (size_t)index[c][l];
      a += weight[c][l] * e[0];
      b += weight[c][l] * e[1];
    }
    out[l] = a;
    out[B + l] = b;
  }
}

static void grid_backward(const sf_grid_level *level, const float *x, const float *dout, float *dtable)
{
  int32_t index[8][B];
  float weight[8][B];
  grid_corners(level, x, index, weight);
  float *entries = dtable + 2 * level->offset;
  prefetch_corners(entries, index);
  for (int l = 0; l < B; l++) {
    const float a = dout[l], b = dout[B + l];
    if (a == 0 && b == 0) continue;
#pragma GCC unroll 8
    for (int c = 0; c < 8; c++) {
      float *e = entries + 2 * (size_t)index[c][l];
      e[0] += weight[c][l] * a;
      e[1] += weight[c][l] * b;
    }
  }
}

const sf_kernels SF_JOIN(sf_kernels_, SF_ISA) = {SF_TEXT(SF_ISA), prepare,      forward,      density,
                                                 backward,        grid_forward, grid_backward};
