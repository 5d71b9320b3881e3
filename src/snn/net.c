/* The nets of one sample, step by step, as the equations read: the oracle of the kernels. */
#include "snn/plif.h"
#include <string.h>

typedef struct dense {
  const float *w; /* [n_out][stride] */
  int n_out, n_in, stride;
} dense;

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
    n->v[o] = h - spike * n->theta;
    if (!trace) continue;
    trace->current[layer][t][o] = current[o];
    trace->membrane[layer][t][o] = h;
    trace->spike[layer][t][o] = spike > 0 && !n->relu;
  }
}

void sf_net_sample(const sf_model *model, const float *f, const float *sh, int steps, float *sigma, float *colour,
                   sf_net_trace *trace)
{
  const sf_config *c = &model->config;
  const int hidden = c->hidden, in3 = SF_DIR_FEATURES + SF_GEO_FEATURES;
  const float *leak = sf_model_param(model, SF_P_LEAK);
  const dense w1 = {sf_model_param(model, SF_P_W1), hidden, 2 * c->levels, 2 * c->levels};
  const dense w2 = {sf_model_param(model, SF_P_W2), SF_DENSITY_OUT, hidden, hidden};
  const dense w3d = {sf_model_param(model, SF_P_W3), hidden, SF_DIR_FEATURES, in3};
  const dense w3h = {sf_model_param(model, SF_P_W3) + SF_DIR_FEATURES, hidden, SF_GEO_FEATURES, in3};
  const dense w4 = {sf_model_param(model, SF_P_W4), hidden, hidden, hidden};
  const dense w5 = {sf_model_param(model, SF_P_W5), 3, hidden, hidden};
  neurons n[3];
  static const int leak_of[3] = {0, 2, 3};
  for (int l = 0; l < 3; l++)
    n[l] = (neurons){c->mode, c->net == SF_NET_ANN, sf_sigmoid(leak[leak_of[l]]), c->theta[l], {0}};
  const float k_sigma = sf_sigmoid(leak[1]), k_colour = sf_sigmoid(leak[4]);
  const float h_step = sf_scales_h_step(&model->scales);

  float current1[SF_LANES] = {0}, base3[SF_LANES] = {0}, o_sigma = 0, o_colour[3] = {0};
  accumulate(&w1, f, current1);
  accumulate(&w3d, sh, base3);
  for (int t = 0; t < steps; t++) {
    float s[SF_LANES], i[SF_DENSITY_OUT] = {0}, h[SF_GEO_FEATURES], current[SF_LANES], j[3] = {0};
    fire(&n[0], hidden, t, current1, s, trace, 0);
    accumulate(&w2, s, i);
    memcpy(current, base3, sizeof current);
    for (int a = 0; a < SF_GEO_FEATURES; a++) h[a] = h_step > 0 ? sf_round_h(i[1 + a], h_step) : i[1 + a];
    accumulate(&w3h, h, current);
    fire(&n[1], hidden, t, current, s, trace, 2);
    memset(current, 0, sizeof current);
    accumulate(&w4, s, current);
    fire(&n[2], hidden, t, current, s, trace, 3);
    accumulate(&w5, s, j);
    sigma[t] = o_sigma = sf_plif_charge(c->mode, t, k_sigma, o_sigma, expf(i[0]));
    for (int a = 0; a < 3; a++)
      colour[3 * t + a] = o_colour[a] = sf_plif_charge(c->mode, t, k_colour, o_colour[a], sf_sigmoid(j[a]));
    if (!trace) continue;
    memcpy(trace->current[1][t], i, sizeof i);
    memcpy(trace->current[4][t], j, sizeof j);
    trace->membrane[1][t][0] = o_sigma;
    memcpy(trace->membrane[4][t], o_colour, sizeof o_colour);
  }
}

void sf_tensorf_decode(const sf_model *model, const float *in, int steps, float *colour, sf_net_trace *trace)
{
  const sf_config *c = &model->config;
  const int hidden = c->hidden, inputs = sf_tensorf_inputs(&c->tensorf);
  const float *leak = sf_model_leak(model), *b1 = sf_model_param(model, SF_V_B1), *b2 = sf_model_param(model, SF_V_B2),
              *b3 = sf_model_param(model, SF_V_B3);
  const dense w1 = {sf_model_param(model, SF_V_W1), hidden, inputs, inputs};
  const dense w2 = {sf_model_param(model, SF_V_W2), hidden, hidden, hidden};
  const dense w3 = {sf_model_param(model, SF_V_W3), 3, hidden, hidden};
  neurons n[2];
  for (int l = 0; l < 2; l++)
    n[l] = (neurons){c->mode, c->net == SF_NET_ANN, sf_sigmoid(leak[2 + l]), c->theta[1 + l], {0}};
  const float k_colour = sf_sigmoid(leak[4]);

  float base[SF_LANES] = {0}, o[3] = {0};
  memcpy(base, b1, (size_t)hidden * sizeof *b1);
  accumulate(&w1, in, base);
  for (int t = 0; t < steps; t++) {
    float s[SF_LANES], current[SF_LANES] = {0}, j[3] = {b3[0], b3[1], b3[2]};
    fire(&n[0], hidden, t, base, s, trace, 2);
    memcpy(current, b2, (size_t)hidden * sizeof *b2);
    accumulate(&w2, s, current);
    fire(&n[1], hidden, t, current, s, trace, 3);
    accumulate(&w3, s, j);
    for (int a = 0; a < 3; a++) colour[3 * t + a] = o[a] = sf_plif_charge(c->mode, t, k_colour, o[a], sf_sigmoid(j[a]));
    if (!trace) continue;
    memcpy(trace->current[4][t], j, sizeof j);
    memcpy(trace->membrane[4][t], o, sizeof o);
  }
}
