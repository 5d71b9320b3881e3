/* The nets, compositing, and one choice of blocks. */
#include "bounds/exact.h"
#include "src/fx/unit.h"
#include <stdlib.h>
#include <string.h>

enum { INPUTS_MAX = SF_DIR_MAX > SF_LANES ? SF_DIR_MAX : SF_LANES, ROWS_MAX = INPUTS_MAX + 1 /* the bias */ };

/* Value of one LSB of input i of a layer; the one behind all others is the bias'. */
static double input_lsb(const fx_scene *scene, int layer, int i)
{
  if (i == scene->net.layer[layer].n_in) return 1.0 / scene->net.layer[layer].bias;
  if (layer == FX_D1) return scene->units.feature_scale[i / FX_GRID_FEATURES];
  if (layer != FX_C1) return 1;
  if (scene->backbone == FX_TENSORF)
    return i < scene->tensorf.features ? scene->units.feature_scale[0] : scene->units.dir_scale;
  return i < SF_DIR_FEATURES ? scene->units.dir_scale : ldexp(scene->units.current_scale[FX_D2], SF_H_SHIFT);
}

/* A weight of the model in the units of the scene's. */
static double real_weight(const fx_scene *scene, const sf_model *model, int l, int o, int i)
{
  const int n_in = scene->net.layer[l].n_in;
  const double w =
      i == n_in ? sf_model_param(model, sf_layer_bias[l])[o] : sf_model_param(model, sf_layer_weights[l])[o * n_in + i];
  return w * input_lsb(scene, l, i) / scene->units.current_scale[l];
}

static void set_weights(sf_exact *e, int l)
{
  const fx_layer *layer = &e->scene->net.layer[l];
  const bool real = sf_exact_is(e, (sf_exact_id)(SF_EXACT_D1 + l));
  for (int i = 0; i < fx_layer_rows(layer); i++)
    for (int o = 0; o < layer->n_out; o++)
      e->w[l][i * SF_LANES + o] = real ? real_weight(e->scene, e->model, l, o, i) : layer->w[i * SF_LANES + o];
}

bool sf_exact_resembles(const fx_scene *scene, const sf_model *model, int l)
{
  const fx_layer *layer = &scene->net.layer[l];
  double all = 0, apart = 0, limit = 0;
  for (int i = 0; i < fx_layer_rows(layer); i++)
    for (int o = 0; o < layer->n_out; o++) limit = fmax(limit, abs(layer->w[i * SF_LANES + o]));
  for (int i = 0; i < fx_layer_rows(layer); i++)
    for (int o = 0; o < layer->n_out; o++) {
      const double w = sf_exact_clamp(real_weight(scene, model, l, o, i), -limit, limit);
      all += w * w, apart += pow(w - layer->w[i * SF_LANES + o], 2);
    }
  return apart <= all / 4;
}

static void set_scalars(sf_exact *e)
{
  const sf_config *config = &e->model->config;
  const float *leak = sf_model_param(e->model, SF_P_LEAK);
  const double theta[SF_LAYERS] = {config->theta[0], 0, config->theta[1], config->theta[2], 0};
  for (int l = 0; l < SF_LAYERS; l++) {
    const bool real = sf_exact_is(e, SF_EXACT_LEAK);
    if (e->scene->net.layer[l].n_out == 0) continue;
    e->k[l] = real ? ldexp(1 / (1 + exp(-(double)leak[l])), SF_LEAK_FRAC) : e->scene->net.layer[l].k;
    e->theta[l] = real ? ldexp(theta[l] / e->scene->units.current_scale[l], fx_layer_frac(l, e->scene->net.mode))
                       : (double)e->scene->net.layer[l].theta;
  }
}

/* Model units to Q0.24 of the box. */
static double of_box(const sf_exact *e, double length)
{
  return ldexp(length / (2 * e->model->config.bound), SF_DELTA_FRAC);
}

double sf_exact_length(const sf_exact *e, int32_t n)
{
  if (e->planes)
    return ldexp((double)sf_tensorf_step(&e->model->config.tensorf) * e->scene->units.to_box_scale, SF_DELTA_FRAC);
  if (!e->steps.growing) return ldexp(sqrt(3.0) / (e->model->config.lattice * e->model->config.bound), SF_DELTA_FRAC);
  return of_box(e, e->steps.length[n]);
}

double sf_exact_distance(const sf_exact *e, int32_t n)
{
  if (!e->steps.growing) return n * sf_exact_length(e, n);
  return of_box(e, e->steps.start[n] + 0.5 * (e->steps.length[n] - e->steps.length[0]));
}

sf_status sf_exact_open(sf_exact *e, const fx_scene *scene, const sf_model *model, uint32_t mask)
{
  *e = (sf_exact){.scene = scene, .model = model, .mask = mask};
  SF_TRY(sf_steps_make(&e->steps, &model->config, 1));
  double *block = calloc((size_t)SF_LAYERS * ROWS_MAX * SF_LANES, sizeof *block);
  if (!block) return sf_fail(SF_E_MEMORY, "no memory for the weights in double precision");
  for (int l = 0; l < SF_LAYERS; l++) {
    e->w[l] = block + (size_t)l * ROWS_MAX * SF_LANES;
    set_weights(e, l);
  }
  set_scalars(e);
  e->weight_stop = sf_exact_is(e, SF_EXACT_DECODE)      ? 0
                   : sf_exact_is(e, SF_EXACT_COMPOSITE) ? ldexp(model->config.tensorf.weight_stop, SF_TRANS_FRAC)
                                                        : scene->tensorf.weight_stop;
  const sf_status status = scene->backbone == FX_TENSORF ? sf_exact_planes_open(e) : sf_ok();
  if (status.code != SF_OK) sf_exact_close(e);
  return status;
}

void sf_exact_close(sf_exact *e)
{
  free(e->w[0]);
  sf_exact_planes_close(e);
}

/* ---- nets ---- */

/* fx_plif_step and fx_integrate_* of spikes that weigh the same: the same equation, rounded or not. */
static double charge(const sf_exact *e, double v, double in, double k, int t, bool exact)
{
  if (t == 0 && e->scene->net.mode == FX_HYBRID) return in;
  const double old = t == 0 ? 0 : v, d = e->scene->net.mode == FX_NODECAY ? -old : in - old;
  const double product = ldexp(d * k, -SF_LEAK_FRAC);
  /* no-decay subtracts the rounded product of v, which is not the rounded product of -v */
  const double leak = exact                              ? product
                      : e->scene->net.mode == FX_NODECAY ? -sf_exact_round(-product)
                                                         : sf_exact_round(product);
  return old + leak + (e->scene->net.mode == FX_NODECAY ? in : 0);
}

static double to_membrane(double x)
{
  return sf_exact_clamp(x, -FX_MEMBRANE_MAX - 1, FX_MEMBRANE_MAX);
}

static void fire(const sf_exact *e, int l, int t, double *v, const double *current, sf_exact_out *out)
{
  const bool exact = sf_exact_is(e, SF_EXACT_MEMBRANE), weighted = e->scene->net.mode == FX_RADIX;
  const double theta = e->theta[l], quantum = weighted ? 2 * theta : theta;
  for (int o = 0; o < e->scene->net.layer[l].n_out; o++) {
    const double in = ldexp(current[o], fx_layer_frac(l, e->scene->net.mode)), held = exact ? in : to_membrane(in);
    const double u = weighted ? 2 * (t ? v[o] : theta) + held - theta : charge(e, v[o], held, e->k[l], t, exact);
    const double kept = exact ? u : to_membrane(u);
    const bool spike = kept >= quantum;
    v[o] = kept - (spike ? quantum : 0);
    out->spikes[l][t][o / 64] |= (uint64_t)spike << o % 64;
  }
}

static void add_row(const sf_exact *e, int l, int i, double x, double *current)
{
  const double *w = e->w[l] + i * SF_LANES;
  for (int o = 0; o < e->scene->net.layer[l].n_out; o++) current[o] += x * w[o];
}

static void add_bias(const sf_exact *e, int l, double *current)
{
  const fx_layer *layer = &e->scene->net.layer[l];
  if (layer->bias) add_row(e, l, layer->n_in, layer->bias, current);
}

static void add_spikes(const sf_exact *e, int l, const uint64_t spikes[SF_SPIKE_WORDS], double *current)
{
  memset(current, 0, SF_LANES * sizeof *current);
  add_bias(e, l, current);
  for (int i = 0; i < e->scene->net.layer[l].n_in; i++)
    if (spikes[i / 64] >> i % 64 & 1) add_row(e, l, i, 1, current);
}

static double table_argument(double current, const fx_scale *scale, int bits)
{
  const double high = ldexp(1, bits - 1);
  return sf_exact_clamp(sf_exact_round(ldexp(current * scale->mul, -scale->shift)) + scale->bias, -high, high - 1);
}

/* What one LSB of a table's current is worth: weighted steps sum to 2^T - 1 of them. */
static double current_lsb(const sf_exact *e, int layer)
{
  const fx_net *net = &e->scene->net;
  return e->scene->units.current_scale[layer] / (net->mode == FX_RADIX ? (1 << net->steps) - 1 : 1);
}

static double density(const sf_exact *e, double current)
{
  const fx_net *net = &e->scene->net;
  const fx_scale scale = fx_net_scale(net, &net->exp_in);
  if (!sf_exact_is(e, SF_EXACT_EXP2)) return fx_exp2((int32_t)table_argument(current, &scale, FX_EXP2_BITS));
  const double y = current * current_lsb(e, FX_D2) / log(2) + ldexp(net->exp_in.bias, -SF_LOG_FRAC);
  return exp2(fmin(y, 64) + SF_SIGMA_FRAC);
}

static double colour(const sf_exact *e, double current)
{
  const fx_net *net = &e->scene->net;
  if (sf_exact_is(e, SF_EXACT_SIGMOID)) return 65536 / (1 + exp(-current * current_lsb(e, FX_C3)));
  const fx_scale scale = fx_net_scale(net, &net->sigmoid_in);
  return fx_sigmoid((int32_t)table_argument(current, &scale, FX_SIGMOID_BITS));
}

static double integrate(const sf_exact *e, double acc, double in, int l, int t, int bits)
{
  const bool exact = sf_exact_is(e, SF_EXACT_INTEGRATOR);
  const double next = charge(e, acc, in, e->k[l], t, exact);
  return exact ? next : sf_exact_clamp(next, 0, ldexp(1, bits) - 1);
}

void sf_exact_direction(const sf_exact *e, const double *x, double *base)
{
  const int n = fx_net_constants(&e->scene->net);
  memset(base, 0, SF_LANES * sizeof *base);
  add_bias(e, FX_C1, base);
  for (int i = 0; i < n; i++) add_row(e, FX_C1, i, x[i], base);
}

/* The output so far: activations are integrated; of weighted spikes currents, and the activation comes behind. */
static void read_density(const sf_exact *e, int t, double current, sf_exact_out *out)
{
  const bool weighted = e->scene->net.mode == FX_RADIX;
  out->weighed[0] = 2 * out->weighed[0] + current;
  if (!fx_net_reads_tables(&e->scene->net, t)) return;
  const double value = density(e, weighted ? out->weighed[0] : current);
  out->sigma = weighted ? value : integrate(e, out->sigma, value, FX_D2, t, SF_SIGMA_BITS);
}

static void read_colour(const sf_exact *e, int t, int o, double current, sf_exact_out *out)
{
  const bool weighted = e->scene->net.mode == FX_RADIX;
  out->weighed[1 + o] = 2 * out->weighed[1 + o] + current;
  if (!fx_net_reads_tables(&e->scene->net, t)) return;
  const double value = colour(e, weighted ? out->weighed[1 + o] : current);
  out->colour[o] = weighted ? value : integrate(e, out->colour[o], value, FX_C3, t, SF_COLOUR_BITS);
}

/* D1 and D2 at step t; the inputs h of C1 are added to `current`. */
static void density_step(const sf_exact *e, int t, double *v, const double *d1, double *current, sf_exact_out *out)
{
  const fx_net *net = &e->scene->net;
  double d2[SF_LANES];
  fire(e, FX_D1, t, v, d1, out);
  add_spikes(e, FX_D2, out->spikes[FX_D1][t], d2);
  read_density(e, t, d2[0], out);
  for (int j = 0; j < fx_net_h(net); j++) {
    const double h = ldexp(d2[1 + j], -SF_H_SHIFT);
    const bool real = sf_exact_is(e, SF_EXACT_H) && !e->model->scales.weight_bits;
    add_row(e, FX_C1, fx_net_constants(net) + j, real ? h : floor(h), current);
  }
}

void sf_exact_sample(const sf_exact *e, const double *f, const double *base, sf_exact_out *out)
{
  const fx_net *net = &e->scene->net;
  double d1[SF_LANES] = {0}, current[SF_LANES], v[3][SF_LANES] = {{0}};
  memset(out, 0, sizeof *out);
  for (int i = 0; i < net->layer[FX_D1].n_in; i++) add_row(e, FX_D1, i, f[i], d1);
  for (int t = 0; t < net->steps; t++) {
    memcpy(current, base, sizeof current);
    if (!fx_net_decodes(net)) density_step(e, t, v[0], d1, current, out);
    fire(e, FX_C1, t, v[1], current, out);
    add_spikes(e, FX_C2, out->spikes[FX_C1][t], current);
    fire(e, FX_C2, t, v[2], current, out);
    add_spikes(e, FX_C3, out->spikes[FX_C2][t], current);
    for (int o = 0; o < 3; o++) read_colour(e, t, o, current[o], out);
  }
}

double sf_exact_behind(const sf_exact *e, int32_t n, double transmittance, double sigma)
{
  const double length = sf_exact_is(e, SF_EXACT_LATTICE) ? sf_exact_length(e, n) : fx_delta(e->scene, n);
  const double tau = ldexp(sigma * length, SF_TRANS_FRAC - SF_SIGMA_FRAC - SF_DELTA_FRAC); /* LSB of Q.20 */
  if (sf_exact_is(e, SF_EXACT_COMPOSITE)) return transmittance * exp(-ldexp(tau, -SF_TRANS_FRAC));
  return sf_exact_round(ldexp(transmittance * fx_exp_neg((uint64_t)sf_exact_round(tau)), -SF_TRANS_FRAC));
}
