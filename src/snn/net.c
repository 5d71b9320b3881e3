/* The nets of one sample, step by step, as the equations read: the oracle of the kernels. */
#include "snn/plif.h"
#include <string.h>

typedef struct dense {
  const float *w; /* [n_out][stride] */
  int n_out, n_in, stride;
} dense;

/* An output's next prefix: the sum of activations, or of weighted spikes the activation of the sum. sum: what is
 * integrated. */
static float read_out(sf_input_mode mode, int t, float k, float (*activation)(float), float *sum, float current)
{
  const bool outside = mode == SF_RADIX;
  *sum = sf_plif_integrate(mode, t, k, *sum, outside ? current : activation(current));
  return outside ? activation(*sum) : *sum;
}

static void accumulate(const dense *d, const float *in, float *out)
{
  for (int o = 0; o < d->n_out; o++)
    for (int i = 0; i < d->n_in; i++) out[o] += d->w[o * d->stride + i] * in[i];
}

typedef struct neurons {
  sf_input_mode mode;
  bool relu;
  float k, theta;
  float v[SF_LANES];
} neurons;

/* Fires one layer at step t: out = spikes, or the ReLU of the current for the twin. */
static void fire(neurons *n, int count, int t, const float *current, float *out, sf_net_trace *trace, int layer)
{
  for (int o = 0; o < count; o++) {
    float h = n->relu ? current[o] : sf_plif_charge(n->mode, t, n->k, n->v[o], current[o]);
    float spike = h >= n->theta ? 1.0f : 0.0f;
    out[o] = n->relu ? fmaxf(h, 0) : spike;
    n->v[o] = h - spike * sf_plif_reset(n->mode, n->theta);
    if (!trace) continue;
    trace->current[layer][t][o] = current[o];
    trace->membrane[layer][t][o] = h;
    trace->spike[layer][t][o] = spike > 0 && !n->relu;
  }
}

/* The matrix of a layer's parameter from input `first` on, n_in of them. */
static dense matrix(const sf_model *m, int id, int first, int n_in)
{
  const int stride = (int)m->param[id].shape[1];
  return (dense){sf_model_param(m, id) + first, (int)m->param[id].shape[0], n_in, stride};
}

/* out[count]: the layer's biases, or zeros. */
static void begin(const sf_model *m, int bias, int count, float *out)
{
  memset(out, 0, (size_t)count * sizeof *out);
  if (sf_model_has(m, bias)) memcpy(out, sf_model_param(m, bias), (size_t)count * sizeof *out);
}

void sf_net_sample(const sf_model *model, const float *in, const float *sh, int steps, float *sigma, float *colour,
                   sf_net_trace *trace)
{
  const sf_config *c = &model->config;
  const bool decodes = sf_model_decodes(model);
  const int hidden = c->hidden, n_h = decodes ? 0 : SF_GEO_FEATURES;
  const int n_in = (int)model->param[decodes ? SF_P_C1 : SF_P_D1].shape[1],
            constants = decodes ? n_in : SF_DIR_FEATURES;
  const float *leak = sf_model_param(model, SF_P_LEAK);
  const dense d1 = matrix(model, SF_P_D1, 0, n_in), d2 = matrix(model, SF_P_D2, 0, hidden);
  const dense c1 = matrix(model, SF_P_C1, 0, constants), c1_h = matrix(model, SF_P_C1, constants, n_h);
  const dense c2 = matrix(model, SF_P_C2, 0, hidden), c3 = matrix(model, SF_P_C3, 0, hidden);
  neurons n[3];
  static const int leak_of[3] = {0, 2, 3};
  for (int l = 0; l < 3; l++)
    n[l] = (neurons){c->mode, c->net == SF_NET_ANN, sf_sigmoid(leak[leak_of[l]]), c->theta[l], {0}};
  const float k_sigma = sf_sigmoid(leak[1]), k_colour = sf_sigmoid(leak[4]);
  const float h_step = sf_scales_h_step(&model->scales);

  float current1[SF_LANES] = {0}, base[SF_LANES], o_sigma = 0, o_colour[3] = {0};
  if (!decodes) accumulate(&d1, in, current1);
  begin(model, SF_P_C1_BIAS, hidden, base);
  accumulate(&c1, decodes ? in : sh, base);
  for (int t = 0; t < steps; t++) {
    float s[SF_LANES], i[SF_DENSITY_OUT] = {0}, h[SF_GEO_FEATURES], current[SF_LANES], j[3];
    if (!decodes) {
      fire(&n[0], hidden, t, current1, s, trace, 0);
      accumulate(&d2, s, i);
      sigma[t] = read_out(c->mode, t, k_sigma, expf, &o_sigma, i[0]);
    }
    memcpy(current, base, (size_t)hidden * sizeof *base);
    for (int a = 0; a < n_h; a++) h[a] = h_step > 0 ? sf_round_h(i[1 + a], h_step) : i[1 + a];
    accumulate(&c1_h, h, current);
    fire(&n[1], hidden, t, current, s, trace, 2);
    begin(model, SF_P_C2_BIAS, hidden, current);
    accumulate(&c2, s, current);
    fire(&n[2], hidden, t, current, s, trace, 3);
    begin(model, SF_P_C3_BIAS, 3, j);
    accumulate(&c3, s, j);
    for (int a = 0; a < 3; a++) colour[3 * t + a] = read_out(c->mode, t, k_colour, sf_sigmoid, &o_colour[a], j[a]);
    if (!trace) continue;
    if (!decodes) memcpy(trace->current[1][t], i, sizeof i), trace->membrane[1][t][0] = o_sigma;
    memcpy(trace->current[4][t], j, sizeof j);
    memcpy(trace->membrane[4][t], o_colour, sizeof o_colour);
  }
}
