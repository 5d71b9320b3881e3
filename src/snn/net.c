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

/* The nets of one sample, and what is constant over the steps. */
typedef struct nets {
  const sf_model *model;
  dense d2, c1_h, c2, c3;
  neurons n[3];
  int hidden, n_h;
  float k_sigma, k_colour, h_step;
  float current1[SF_LANES], base[SF_LANES]; /* of D1; of C1 without h */
} nets;

static void prepare(const sf_model *model, const float *in, const float *sh, nets *x)
{
  const sf_config *c = &model->config;
  const bool decodes = sf_model_decodes(model);
  const int hidden = c->hidden, n_h = decodes ? 0 : SF_GEO_FEATURES;
  const int n_in = (int)model->param[decodes ? SF_P_C1 : SF_P_D1].shape[1],
            constants = decodes ? n_in : SF_DIR_FEATURES;
  const float *leak = sf_model_param(model, SF_P_LEAK);
  const dense d1 = matrix(model, SF_P_D1, 0, n_in), c1 = matrix(model, SF_P_C1, 0, constants);
  static const int leak_of[3] = {0, 2, 3};
  *x = (nets){.model = model,
              .d2 = matrix(model, SF_P_D2, 0, hidden),
              .c1_h = matrix(model, SF_P_C1, constants, n_h),
              .c2 = matrix(model, SF_P_C2, 0, hidden),
              .c3 = matrix(model, SF_P_C3, 0, hidden),
              .hidden = hidden,
              .n_h = n_h,
              .k_sigma = sf_sigmoid(leak[1]),
              .k_colour = sf_sigmoid(leak[4]),
              .h_step = sf_scales_h_step(&model->scales)};
  for (int l = 0; l < 3; l++)
    x->n[l] = (neurons){c->mode, c->net == SF_NET_ANN, sf_sigmoid(leak[leak_of[l]]), c->theta[l], {0}};
  if (!decodes) accumulate(&d1, in, x->current1);
  begin(model, SF_P_C1_BIAS, hidden, x->base);
  accumulate(&c1, decodes ? in : sh, x->base);
}

static void add_h(const nets *x, const float *i, int digits, float *current)
{
  float h[SF_GEO_FEATURES];
  memcpy(current, x->base, (size_t)x->hidden * sizeof *current);
  for (int a = 0; a < x->n_h; a++) h[a] = x->h_step > 0 ? sf_round_h(i[1 + a], x->h_step, digits) : i[1 + a];
  accumulate(&x->c1_h, h, current);
}

/* Step by step through all layers. */
static void run_steps(nets *x, int steps, float *sigma, float *colour, sf_net_trace *trace)
{
  const sf_model *m = x->model;
  const sf_input_mode mode = m->config.mode;
  const bool decodes = sf_model_decodes(m);
  const int hidden = x->hidden;
  float o_sigma = 0, o_colour[3] = {0};
  for (int t = 0; t < steps; t++) {
    float s[SF_LANES], i[SF_DENSITY_OUT] = {0}, current[SF_LANES], j[3];
    if (!decodes) {
      fire(&x->n[0], hidden, t, x->current1, s, trace, 0);
      accumulate(&x->d2, s, i);
      sigma[t] = o_sigma = sf_plif_charge(mode, t, x->k_sigma, o_sigma, expf(i[0]));
    }
    add_h(x, i, 0, current);
    fire(&x->n[1], hidden, t, current, s, trace, 2);
    begin(m, SF_P_C2_BIAS, hidden, current);
    accumulate(&x->c2, s, current);
    fire(&x->n[2], hidden, t, current, s, trace, 3);
    begin(m, SF_P_C3_BIAS, 3, j);
    accumulate(&x->c3, s, j);
    for (int a = 0; a < 3; a++)
      colour[3 * t + a] = o_colour[a] = sf_plif_charge(mode, t, x->k_colour, o_colour[a], sf_sigmoid(j[a]));
    if (!trace) continue;
    if (!decodes) memcpy(trace->current[1][t], i, sizeof i), trace->membrane[1][t][0] = o_sigma;
    memcpy(trace->current[4][t], j, sizeof j);
    memcpy(trace->membrane[4][t], o_colour, sizeof o_colour);
  }
}

/* Radix mode: all steps of a layer before the next one. out[d->n_out]: what d makes of the spikes of `layer` and of a
 * bias, SF_P_COUNT for none, each step for its digit. `to`: the layer that gets it, of the trace. */
static void run_layer(nets *x, int layer, int steps, const float *current, const dense *d, int bias, float *out, int to,
                      sf_net_trace *trace)
{
  static const int traced[3] = {0, 2, 3};
  memset(out, 0, (size_t)d->n_out * sizeof *out);
  for (int t = 0; t < steps; t++) {
    float s[SF_LANES], i[SF_LANES] = {0};
    fire(&x->n[layer], x->hidden, t, current, s, trace, traced[layer]);
    if (bias < SF_P_COUNT) begin(x->model, bias, d->n_out, i);
    accumulate(d, s, i);
    for (int o = 0; o < d->n_out; o++) out[o] += sf_digit(t, steps) * i[o];
    if (!trace || to == 3) continue;
    memcpy(trace->current[to][t], i, (size_t)d->n_out * sizeof *i);
    memcpy(trace->membrane[to][t], out, (to == 1 ? 1 : (size_t)d->n_out) * sizeof *out);
  }
}

static void run_prefix(nets *x, int steps, float *sigma, float *colour, sf_net_trace *trace)
{
  float i[SF_DENSITY_OUT] = {0}, current[SF_LANES], current2[SF_LANES], j[3];
  if (!sf_model_decodes(x->model)) {
    run_layer(x, 0, steps, x->current1, &x->d2, SF_P_COUNT, i, 1, trace);
    *sigma = expf(i[0]);
  }
  add_h(x, i, steps, current);
  run_layer(x, 1, steps, current, &x->c2, SF_P_C2_BIAS, current2, 3, trace);
  run_layer(x, 2, steps, current2, &x->c3, SF_P_C3_BIAS, j, 4, trace);
  for (int a = 0; a < 3; a++) colour[a] = sf_sigmoid(j[a]);
}

void sf_net_sample(const sf_model *model, const float *in, const float *sh, int steps, float *sigma, float *colour,
                   sf_net_trace *trace)
{
  nets x;
  prepare(model, in, sh, &x);
  if (model->config.mode != SF_RADIX || model->config.net == SF_NET_ANN) {
    run_steps(&x, steps, sigma, colour, trace);
    return;
  }
  for (int t = 0; t < steps; t++) run_prefix(&x, t + 1, sigma + t, colour + 3 * t, t + 1 == steps ? trace : NULL);
}
