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
    const double share = l == FX_C2 && e->scene->net.mode == FX_RADIX ? 1 - ldexp(1, -e->scene->net.steps) : 1;
    e->theta[l] = real
                      ? share * ldexp(theta[l] / e->scene->units.current_scale[l], fx_layer_frac(l, e->scene->net.mode))
                      : (double)fx_net_theta(&e->scene->net, l);
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

/* fx_plif_step and fx_integrate_* of the modes that do not double: the same equation, rounded or not. */
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
  const bool exact = sf_exact_is(e, SF_EXACT_MEMBRANE), radix = e->scene->net.mode == FX_RADIX;
  for (int o = 0; o < e->scene->net.layer[l].n_out; o++) {
    const double in = ldexp(current[o], fx_layer_frac(l, e->scene->net.mode)), held = exact ? in : to_membrane(in);
    const double u = radix ? (t ? 2 * v[o] : held) : charge(e, v[o], held, e->k[l], t, exact);
    const double kept = exact ? u : to_membrane(u);
    const bool spike = kept >= e->theta[l];
    v[o] = kept - (spike ? e->theta[l] : 0);
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

/* What one LSB of a table's current is worth: radix asks for the sum of all digits, 2^T - 1 currents. */
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

/* The inputs h of C1, of D2's currents; an LSB of h is 2^shift of them. */
/* digits: of radix, whose mean is rounded to as many; else 0. */
static void add_h(const sf_exact *e, const double *d2, int digits, double *current)
{
  const fx_net *net = &e->scene->net;
  for (int j = 0; j < fx_net_h(net); j++) {
    const double mean = d2[1 + j] / (digits ? (1 << digits) - 1 : 1);
    const bool real = sf_exact_is(e, SF_EXACT_H) && !e->model->scales.weight_bits;
    const double kept =
        digits ? fx_weighed_h((int32_t)sf_exact_round(d2[1 + j]), digits) : floor(ldexp(mean, -SF_H_SHIFT));
    add_row(e, FX_C1, fx_net_constants(net) + j, real ? ldexp(mean, -SF_H_SHIFT) : kept, current);
  }
}

static void run_steps(const sf_exact *e, const double *d1, const double *base, sf_exact_out *out)
{
  const fx_net *net = &e->scene->net;
  double current[SF_LANES], d2[SF_LANES], v[3][SF_LANES] = {{0}};
  for (int t = 0; t < net->steps; t++) {
    memcpy(current, base, sizeof current);
    if (!fx_net_decodes(net)) {
      fire(e, FX_D1, t, v[0], d1, out);
      add_spikes(e, FX_D2, out->spikes[FX_D1][t], d2);
      out->sigma = integrate(e, out->sigma, density(e, d2[0]), FX_D2, t, SF_SIGMA_BITS);
      add_h(e, d2, 0, current);
    }
    fire(e, FX_C1, t, v[1], current, out);
    add_spikes(e, FX_C2, out->spikes[FX_C1][t], current);
    fire(e, FX_C2, t, v[2], current, out);
    add_spikes(e, FX_C3, out->spikes[FX_C2][t], current);
    for (int o = 0; o < 3; o++)
      out->colour[o] = integrate(e, out->colour[o], colour(e, current[o]), FX_C3, t, SF_COLOUR_BITS);
  }
}

/* ---- radix: a layer begins when all steps of the one before are there ---- */

/* The spikes that a layer's currents make, and what the next layer makes of them: sum[o], the weighed sum of all steps.
 */
static void run_layer(const sf_exact *e, int l, const double *current, double *sum, sf_exact_out *out)
{
  double step[SF_LANES], v[SF_LANES] = {0};
  memset(sum, 0, SF_LANES * sizeof *sum);
  for (int t = 0; t < e->scene->net.steps; t++) {
    fire(e, l, t, v, current, out);
    add_spikes(e, l + 1, out->spikes[l][t], step);
    for (int o = 0; o < e->scene->net.layer[l + 1].n_out; o++) sum[o] = 2 * sum[o] + step[o];
  }
}

static void run_layers(const sf_exact *e, const double *d1, const double *base, sf_exact_out *out)
{
  const fx_net *net = &e->scene->net;
  double current[SF_LANES], sum[SF_LANES];
  memcpy(current, base, sizeof current);
  if (!fx_net_decodes(net)) {
    run_layer(e, FX_D1, d1, sum, out);
    out->sigma = density(e, sum[0]);
    add_h(e, sum, net->steps, current);
  }
  run_layer(e, FX_C1, current, sum, out);
  for (int o = 0; o < SF_LANES; o++) current[o] = ldexp(sum[o], -net->steps);
  run_layer(e, FX_C2, current, sum, out);
  for (int o = 0; o < 3; o++) out->colour[o] = colour(e, sum[o]);
}

void sf_exact_sample(const sf_exact *e, const double *f, const double *base, sf_exact_out *out)
{
  double d1[SF_LANES] = {0};
  memset(out, 0, sizeof *out);
  for (int i = 0; i < e->scene->net.layer[FX_D1].n_in; i++) add_row(e, FX_D1, i, f[i], d1);
  (e->scene->net.mode == FX_RADIX ? run_layers : run_steps)(e, d1, base, out);
}

double sf_exact_behind(const sf_exact *e, int32_t n, double transmittance, double sigma)
{
  const double length = sf_exact_is(e, SF_EXACT_LATTICE) ? sf_exact_length(e, n) : fx_delta(e->scene, n);
  const double tau = ldexp(sigma * length, SF_TRANS_FRAC - SF_SIGMA_FRAC - SF_DELTA_FRAC); /* LSB of Q.20 */
  if (sf_exact_is(e, SF_EXACT_COMPOSITE)) return transmittance * exp(-ldexp(tau, -SF_TRANS_FRAC));
  return sf_exact_round(ldexp(transmittance * fx_exp_neg((uint64_t)sf_exact_round(tau)), -SF_TRANS_FRAC));
}
