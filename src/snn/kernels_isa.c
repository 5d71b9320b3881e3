/* The kernels of kernels.h for one instruction set: the build defines SF_ISA. Oracle: net.c.
 * Backward follows SpikingJelly's sigmoid surrogate with the reset path differentiated. */
#include "snn/kernels.h"
#include "snn/gemm_isa.h"
#include "snn/plif.h"

#define SF_JOIN_(a, b) a##b
#define SF_JOIN(a, b) SF_JOIN_(a, b)
#define SF_TEXT_(a) #a
#define SF_TEXT(a) SF_TEXT_(a)

enum { B = SF_BLOCK, IN3 = SF_DIR_FEATURES + SF_GEO_FEATURES, GEO_PAD = 16 };

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

/* Charges n rows and writes membrane and activation (spike, or ReLU for the twin). prev: membrane before fire of the
 * step before, NULL at t = 0; h may equal prev. */
static void fire(const sf_net_view *net, int layer, float k, int t, int rows, const float *restrict current,
                 const float *prev, float *h, float *restrict s)
{
  const float theta = net->theta[layer];
  const int n = rows * B;
  if (net->relu) {
    for (int i = 0; i < n; i++) {
      h[i] = current[i];
      s[i] = current[i] > 0 ? current[i] : 0;
    }
  } else if (t == 0) {
    const float gain = net->mode == SF_DECAY ? k : 1.0f;
    for (int i = 0; i < n; i++) {
      float x = current[i] * gain;
      h[i] = x;
      s[i] = x >= theta ? 1.0f : 0.0f;
    }
  } else {
    const float keep = 1.0f - k, gain = net->mode == SF_NODECAY ? 1.0f : k;
    for (int i = 0; i < n; i++) {
      float v = prev[i] - (prev[i] >= theta ? theta : 0.0f);
      float x = keep * v + gain * current[i];
      h[i] = x;
      s[i] = x >= theta ? 1.0f : 0.0f;
    }
  }
}

/* Activations of stored membranes. */
static void activation(const sf_net_view *net, int layer, int rows, const float *restrict h, float *restrict s)
{
  const float theta = net->theta[layer];
  if (net->relu)
    for (int i = 0; i < rows * B; i++) s[i] = h[i] > 0 ? h[i] : 0;
  else
    for (int i = 0; i < rows * B; i++) s[i] = h[i] >= theta ? 1.0f : 0.0f;
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

static void density_step(const sf_net_view *net, sf_block *x, int t, int slot, const float *current, sf_net_scratch *w,
                         float *i, float *sigma, const float *sigma_before)
{
  float e[B];
  fire(net, 0, net->k[0], t, net->hidden, current, t ? x->m1[slot ? t - 1 : 0] : NULL, x->m1[slot ? t : 0], w->b);
  gemm((gemm_a){net->w2, net->hidden, 1}, SF_DENSITY_OUT, net->hidden, w->b, B, B, NULL, 0, i, B);
  exponential(B, i, e);
  integrate(net, net->k[1], t, B, e, sigma_before, sigma);
}

static void constant_current(const sf_net_view *net, const sf_block *x, float *current)
{
  gemm((gemm_a){net->w1, net->features, 1}, net->hidden, net->features, x->f, B, B, NULL, 0, current, B);
}

static void density(const sf_net_view *net, sf_block *x, int steps, sf_net_scratch *w)
{
  constant_current(net, x, w->a);
  for (int t = 0; t < steps; t++) density_step(net, x, t, 0, w->a, w, x->i[0], x->sigma[t], t ? x->sigma[t - 1] : NULL);
}

static void forward(const sf_net_view *net, sf_block *x, int steps, int keep, sf_net_scratch *w)
{
  const int hidden = net->hidden;
  constant_current(net, x, w->a);
  gemm((gemm_a){net->w3, IN3, 1}, hidden, SF_DIR_FEATURES, x->sh, B, B, NULL, 0, w->d, B);
  for (int t = 0; t < steps; t++) {
    const int at = keep ? t : 0, before = keep ? t - 1 : 0;
    float c[3 * B];
    density_step(net, x, t, keep, w->a, w, x->i[t], x->sigma[t], t ? x->sigma[t - 1] : NULL);
    gemm((gemm_a){net->w3 + SF_DIR_FEATURES, IN3, 1}, hidden, SF_GEO_FEATURES, x->i[t] + B, B, B, w->d, B, w->c, B);
    fire(net, 1, net->k[2], t, hidden, w->c, t ? x->m3[before] : NULL, x->m3[at], w->b);
    gemm((gemm_a){net->w4, hidden, 1}, hidden, hidden, w->b, B, B, NULL, 0, w->c, B);
    fire(net, 2, net->k[3], t, hidden, w->c, t ? x->m4[before] : NULL, x->m4[at], w->b);
    gemm((gemm_a){net->w5, hidden, 1}, 3, hidden, w->b, B, B, NULL, 0, x->j[t], B);
    sigmoid(3 * B, x->j[t], c);
    integrate(net, net->k[4], t, 3 * B, c, t ? x->colour[t - 1] : NULL, x->colour[t]);
  }
}

/* Backward of fire at step t. ds: gradient of the activation; carry: gradient of the membrane after reset, in and out;
 * g: gradient of the current (may be ds); leak[B]: sum of g_h * dh/dw per lane. */
static void fire_backward(const sf_net_view *net, int layer, float k, int t, int rows, const float *h,
                          const float *prev, const float *ds, float *restrict carry, float *g, float *restrict leak)
{
  const float theta = net->theta[layer], keep = 1.0f - k;
  if (net->relu) {
    for (int i = 0; i < rows * B; i++) g[i] = h[i] > 0 ? ds[i] : 0;
    return;
  }
  const int fresh = t == 0, hybrid_first = fresh && net->mode == SF_HYBRID;
  const float gain = net->mode == SF_NODECAY || hybrid_first ? 1.0f : k;
  /* dh/dw = k(1-k)(x - v) = (1-k)(h - v) where the input decays, -k(1-k) v where it does not. */
  const float with_h = net->mode == SF_NODECAY || hybrid_first ? 0.0f : keep;
  const float with_v = fresh ? 0.0f : net->mode == SF_NODECAY ? -k * keep : -keep;
  if (fresh) prev = h; /* any readable row: with_v is 0 */
  for (int r = 0; r < rows; r++)
#pragma GCC ivdep /* g may be ds: element by element */
    for (int l = 0; l < B; l++) {
      const int i = r * B + l;
      float v = prev[i] - (prev[i] >= theta ? theta : 0.0f);
      float e = fast_exp(-fabsf(SF_SURROGATE_ALPHA * (h[i] - theta)));
      float surrogate = SF_SURROGATE_ALPHA * e / ((1.0f + e) * (1.0f + e));
      float gh = (ds[i] - theta * carry[i]) * surrogate + carry[i];
      carry[i] = keep * gh;
      leak[l] += gh * (with_h * h[i] + with_v * v);
      g[i] = gain * gh;
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

static void add_outer(float *grad, int ld, const float *dy, int rows, const float *xt, int ldx, int columns)
{
  gemm((gemm_a){dy, B, 1}, rows, B, xt, ldx, columns, grad, ld, grad, ld);
}

static void add_to(float *restrict sum, const float *restrict x, int n)
{
  for (int i = 0; i < n; i++) sum[i] += x[i];
}

/* Colour integrator and layers C3, C2, C1 at step t; leaves the gradient of h in gh[SF_GEO_FEATURES][B]. */
static void colour_backward(const sf_net_view *net, const sf_block *x, int t, float *gcolour, float *gh,
                            sf_net_grad *grad, sf_net_scratch *w)
{
  const int hidden = net->hidden;
  float c[3 * B], gj[3 * B];
  sigmoid(3 * B, x->j[t], c);
  for (int a = 0; a < 3; a++)
    integrate_backward(net, net->k[4], t, c + a * B, t ? x->colour[t - 1] + a * B : NULL, gcolour + a * B, gj + a * B,
                       w->leak[4]);
  for (int i = 0; i < 3 * B; i++) gj[i] *= c[i] * (1.0f - c[i]);
  activation(net, 2, hidden, x->m4[t], w->a);
  transpose(w->a, hidden, w->t, hidden);
  add_outer(grad->w5, hidden, gj, 3, w->t, hidden, hidden);
  gemm((gemm_a){net->w5, 1, hidden}, hidden, 3, gj, B, B, NULL, 0, w->a, B);
  fire_backward(net, 2, net->k[3], t, hidden, x->m4[t], t ? x->m4[t - 1] : NULL, w->a, w->g4, w->a, w->leak[3]);

  activation(net, 1, hidden, x->m3[t], w->b);
  transpose(w->b, hidden, w->t, hidden);
  add_outer(grad->w4, hidden, w->a, hidden, w->t, hidden, hidden);
  gemm((gemm_a){net->w4, 1, hidden}, hidden, hidden, w->a, B, B, NULL, 0, w->b, B);
  fire_backward(net, 1, net->k[2], t, hidden, x->m3[t], t ? x->m3[t - 1] : NULL, w->b, w->g3, w->b, w->leak[2]);

  add_to(w->sum3, w->b, hidden * B);
  transpose(x->i[t], SF_DENSITY_OUT, w->t, GEO_PAD);
  /* Column 16 of the padded gradient meets i[0], which is no input of C1: scratch. h starts at column 17. */
  add_outer(grad->w3 + SF_DIR_FEATURES, 32, w->b, hidden, w->t, GEO_PAD, GEO_PAD);
  gemm((gemm_a){net->w3 + SF_DIR_FEATURES, 1, IN3}, SF_GEO_FEATURES, hidden, w->b, B, B, NULL, 0, gh, B);
}

static void backward(const sf_net_view *net, const sf_block *x, int steps, const float *dsigma, const float *dcolour,
                     float *df, sf_net_grad *grad, sf_net_scratch *w)
{
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
    float gi[SF_DENSITY_OUT * B], e[B];
    add_to(gsigma, dsigma + t * B, B);
    add_to(gcolour, dcolour + t * 3 * B, 3 * B);
    exponential(B, x->i[t], e);
    integrate_backward(net, net->k[1], t, e, t ? x->sigma[t - 1] : NULL, gsigma, gi, w->leak[1]);
    for (int l = 0; l < B; l++) {
      float clamped = x->i[t][l] > 15.0f ? 15.0f : x->i[t][l] < -15.0f ? -15.0f : x->i[t][l];
      gi[l] *= fast_exp(clamped); /* torch-ngp's trunc_exp */
    }
    colour_backward(net, x, t, gcolour, gi + B, grad, w);
    activation(net, 0, hidden, x->m1[t], w->a);
    transpose(w->a, hidden, w->t, hidden);
    add_outer(grad->w2, hidden, gi, SF_DENSITY_OUT, w->t, hidden, hidden);
    gemm((gemm_a){net->w2, 1, hidden}, hidden, SF_DENSITY_OUT, gi, B, B, NULL, 0, w->a, B);
    fire_backward(net, 0, net->k[0], t, hidden, x->m1[t], t ? x->m1[t - 1] : NULL, w->a, w->g1, w->a, w->leak[0]);
    add_to(w->sum1, w->a, hidden * B);
  }
  transpose(x->sh, SF_DIR_FEATURES, w->t, SF_DIR_FEATURES);
  add_outer(grad->w3, 32, w->sum3, hidden, w->t, SF_DIR_FEATURES, SF_DIR_FEATURES);
  const int padded = (net->features + 15) / 16 * 16;
  memcpy(w->a, x->f, (size_t)net->features * B * sizeof(float));
  memset(w->a + net->features * B, 0, (size_t)(padded - net->features) * B * sizeof(float));
  transpose(w->a, padded, w->t, padded);
  add_outer(grad->w1, padded, w->sum1, hidden, w->t, padded, padded);
  gemm((gemm_a){net->w1, 1, net->features}, net->features, hidden, w->sum1, B, B, NULL, 0, df, B);
  for (int n = 0; n < SF_LAYERS; n++)
    for (int l = 0; l < B; l++) grad->leak[n] += w->leak[n][l];
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

static void grid_forward(const sf_grid_level *level, const float *table, const float *x, float *restrict out)
{
  int32_t index[8][B];
  float weight[8][B];
  grid_corners(level, x, index, weight);
  const float *entries = table + 2 * level->offset;
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

const sf_kernels SF_JOIN(sf_kernels_, SF_ISA) = {SF_TEXT(SF_ISA), forward,      density,
                                                 backward,        grid_forward, grid_backward};
