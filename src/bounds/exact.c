#include "bounds/exact.h"
#include "src/fx/unit.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static double round_half_up(double x)
{
  return floor(x + 0.5);
}

static double clamp(double x, double low, double high)
{
  return fmin(fmax(x, low), high);
}

static int frac_of(int layer)
{
  return layer == FX_C2 ? SF_AC_FRAC : 0;
}

/* Value of one LSB of input i of a layer. */
static double input_lsb(const fx_scene *scene, int layer, int i)
{
  if (layer == FX_D1) return scene->units.feature_scale[i / FX_GRID_FEATURES];
  if (layer != FX_C1) return 1;
  return i < SF_DIR_FEATURES ? scene->units.dir_scale : ldexp(scene->units.current_scale[FX_D2], SF_H_SHIFT);
}

/* A weight of the model in the units of the scene's. */
static double real_weight(const fx_scene *scene, const sf_model *model, int l, int o, int i)
{
  static const sf_param_id id[SF_LAYERS] = {SF_P_D1, SF_P_D2, SF_P_C1, SF_P_C2, SF_P_C3};
  const double w = sf_model_param(model, id[l])[o * scene->net.layer[l].n_in + i];
  return w * input_lsb(scene, l, i) / scene->units.current_scale[l];
}

static void set_weights(sf_exact *e, int l)
{
  const fx_layer *layer = &e->scene->net.layer[l];
  const bool real = sf_exact_is(e, (sf_exact_id)(SF_EXACT_D1 + l));
  for (int i = 0; i < layer->n_in; i++)
    for (int o = 0; o < layer->n_out; o++)
      e->w[l][i * SF_LANES + o] = real ? real_weight(e->scene, e->model, l, o, i) : layer->w[i * SF_LANES + o];
}

bool sf_exact_resembles(const fx_scene *scene, const sf_model *model, int l)
{
  const fx_layer *layer = &scene->net.layer[l];
  double all = 0, apart = 0, limit = 0;
  for (int i = 0; i < layer->n_in; i++)
    for (int o = 0; o < layer->n_out; o++) limit = fmax(limit, abs(layer->w[i * SF_LANES + o]));
  for (int i = 0; i < layer->n_in; i++)
    for (int o = 0; o < layer->n_out; o++) {
      const double w = clamp(real_weight(scene, model, l, o, i), -limit, limit);
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
    e->k[l] = real ? ldexp(1 / (1 + exp(-(double)leak[l])), SF_LEAK_FRAC) : e->scene->net.layer[l].k;
    e->theta[l] =
        real ? ldexp(theta[l] / e->scene->units.current_scale[l], frac_of(l)) : (double)e->scene->net.layer[l].theta;
  }
}

/* Model units to Q0.24 of the box. */
static double of_box(const sf_exact *e, double length)
{
  return ldexp(length / (2 * e->model->config.bound), SF_DELTA_FRAC);
}

double sf_exact_length(const sf_exact *e, int32_t n)
{
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
  double *block = calloc((size_t)SF_LAYERS * SF_LANES * SF_LANES, sizeof *block);
  if (!block) return sf_fail(SF_E_MEMORY, "no memory for the weights in double precision");
  for (int l = 0; l < SF_LAYERS; l++) {
    e->w[l] = block + (size_t)l * SF_LANES * SF_LANES;
    set_weights(e, l);
  }
  set_scalars(e);
  return sf_ok();
}

void sf_exact_close(sf_exact *e)
{
  free(e->w[0]);
}

/* ---- grid ---- */

static void corner_weights(bool exact, const double g[3], double weight[8])
{
  for (uint32_t xy = 0; xy < 4; xy++) {
    const double w = (xy & 1 ? g[0] : 256 - g[0]) * (xy & 2 ? g[1] : 256 - g[1]), upper = w * g[2] / 256;
    weight[xy + 4] = exact ? upper : round_half_up(upper);
    weight[xy] = w - weight[xy + 4];
  }
}

static double entry_value(const sf_exact *e, int level, int64_t entry, int which)
{
  const fx_scene *s = e->scene;
  const size_t i = (size_t)entry * FX_GRID_FEATURES + (size_t)which;
  if (!sf_exact_is(e, SF_EXACT_ENTRIES)) return s->grid.table[i];
  return (double)sf_model_param(e->model, SF_P_GRID)[i] /
         ldexp(s->units.feature_scale[level], 16 - s->grid.shift[level]);
}

void sf_exact_features(const sf_exact *e, const double pos[3], double *f)
{
  const fx_grid *grid = &e->scene->grid;
  const bool exact = sf_exact_is(e, SF_EXACT_POSITION);
  for (int level = 0; level < grid->levels; level++) {
    uint32_t base[3];
    double g[3], weight[8], sum[FX_GRID_FEATURES] = {0};
    for (int a = 0; a < 3; a++) {
      const double product = ldexp(pos[a] * grid->scale_q16[level], -32); /* 1/256 of a cell */
      const double p = (exact ? product : round_half_up(product)) + 128;
      base[a] = (uint32_t)floor(p / 256), g[a] = p - 256.0 * base[a];
    }
    corner_weights(exact, g, weight);
    for (uint32_t corner = 0; corner < 8; corner++) {
      const int64_t entry = sf_exact_entry(grid, level, base, corner);
      for (int i = 0; i < FX_GRID_FEATURES; i++) sum[i] += weight[corner] * entry_value(e, level, entry, i);
    }
    for (int i = 0; i < FX_GRID_FEATURES; i++) {
      const double value = ldexp(sum[i], -grid->shift[level]);
      f[level * FX_GRID_FEATURES + i] = exact ? value : clamp(round_half_up(value), -FX_INPUT_MAX, FX_INPUT_MAX);
    }
  }
}

/* ---- nets ---- */

/* fx_plif_step and fx_integrate_*: the same equation, rounded or not. */
static double charge(const sf_exact *e, double v, double in, double k, int t, bool exact)
{
  if (t == 0 && e->scene->net.mode == FX_HYBRID) return in;
  const double old = t == 0 ? 0 : v, d = e->scene->net.mode == FX_NODECAY ? -old : in - old;
  const double product = ldexp(d * k, -SF_LEAK_FRAC);
  /* no-decay subtracts the rounded product of v, which is not the rounded product of -v */
  const double leak = exact                              ? product
                      : e->scene->net.mode == FX_NODECAY ? -round_half_up(-product)
                                                         : round_half_up(product);
  return old + leak + (e->scene->net.mode == FX_NODECAY ? in : 0);
}

static void fire(const sf_exact *e, int l, int t, double *v, const double *current, sf_exact_out *out)
{
  const bool exact = sf_exact_is(e, SF_EXACT_MEMBRANE);
  for (int o = 0; o < e->scene->net.layer[l].n_out; o++) {
    const double u = charge(e, v[o], ldexp(current[o], frac_of(l)), e->k[l], t, exact);
    const double kept = exact ? u : clamp(u, -FX_MEMBRANE_MAX - 1, FX_MEMBRANE_MAX);
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

static void add_spikes(const sf_exact *e, int l, const uint64_t spikes[SF_SPIKE_WORDS], double *current)
{
  memset(current, 0, SF_LANES * sizeof *current);
  for (int i = 0; i < e->scene->net.layer[l].n_in; i++)
    if (spikes[i / 64] >> i % 64 & 1) add_row(e, l, i, 1, current);
}

static double table_argument(double current, const fx_scale *scale, int bits)
{
  const double high = ldexp(1, bits - 1);
  return clamp(round_half_up(ldexp(current * scale->mul, -scale->shift)) + scale->bias, -high, high - 1);
}

static double density(const sf_exact *e, double current)
{
  const fx_net *net = &e->scene->net;
  if (!sf_exact_is(e, SF_EXACT_EXP2)) return fx_exp2((int32_t)table_argument(current, &net->exp_in, FX_EXP2_BITS));
  const double y = current * e->scene->units.current_scale[FX_D2] / log(2) + ldexp(net->exp_in.bias, -SF_LOG_FRAC);
  return exp2(fmin(y, 64) + SF_SIGMA_FRAC);
}

static double colour(const sf_exact *e, double current)
{
  const fx_net *net = &e->scene->net;
  if (sf_exact_is(e, SF_EXACT_SIGMOID)) return 65536 / (1 + exp(-current * e->scene->units.current_scale[FX_C3]));
  return fx_sigmoid((int32_t)table_argument(current, &net->sigmoid_in, FX_SIGMOID_BITS));
}

static double integrate(const sf_exact *e, double acc, double in, int l, int t, int bits)
{
  const bool exact = sf_exact_is(e, SF_EXACT_INTEGRATOR);
  const double next = charge(e, acc, in, e->k[l], t, exact);
  return exact ? next : clamp(next, 0, ldexp(1, bits) - 1);
}

void sf_exact_direction(const sf_exact *e, const double *dir, double *base)
{
  const int n_dir = fx_net_constants(&e->scene->net);
  memset(base, 0, SF_LANES * sizeof *base);
  for (int i = 0; i < n_dir; i++) add_row(e, FX_C1, i, dir[i], base);
}

void sf_exact_sample(const sf_exact *e, const double *f, const double *base, sf_exact_out *out)
{
  const fx_net *net = &e->scene->net;
  const int n_h = fx_net_h(net), n_dir = fx_net_constants(net);
  double d1[SF_LANES] = {0}, current[SF_LANES], v[3][SF_LANES] = {{0}};
  memset(out, 0, sizeof *out);
  for (int i = 0; i < net->layer[FX_D1].n_in; i++) add_row(e, FX_D1, i, f[i], d1);
  for (int t = 0; t < net->steps; t++) {
    double d2[SF_LANES];
    fire(e, FX_D1, t, v[0], d1, out);
    add_spikes(e, FX_D2, out->spikes[FX_D1][t], d2);
    out->sigma = integrate(e, out->sigma, density(e, d2[0]), FX_D2, t, SF_SIGMA_BITS);
    memcpy(current, base, sizeof current);
    for (int j = 0; j < n_h; j++) {
      const double h = ldexp(d2[1 + j], -SF_H_SHIFT);
      add_row(e, FX_C1, n_dir + j, sf_exact_is(e, SF_EXACT_H) && !e->model->scales.weight_bits ? h : floor(h), current);
    }
    fire(e, FX_C1, t, v[1], current, out);
    add_spikes(e, FX_C2, out->spikes[FX_C1][t], current);
    fire(e, FX_C2, t, v[2], current, out);
    add_spikes(e, FX_C3, out->spikes[FX_C2][t], current);
    for (int o = 0; o < 3; o++)
      out->colour[o] = integrate(e, out->colour[o], colour(e, current[o]), FX_C3, t, SF_COLOUR_BITS);
  }
}

double sf_exact_behind(const sf_exact *e, int32_t n, double transmittance, double sigma)
{
  const double length = sf_exact_is(e, SF_EXACT_LATTICE) ? sf_exact_length(e, n) : fx_delta(e->scene, n);
  const double tau = ldexp(sigma * length, SF_TRANS_FRAC - SF_SIGMA_FRAC - SF_DELTA_FRAC); /* LSB of Q.20 */
  if (sf_exact_is(e, SF_EXACT_COMPOSITE)) return transmittance * exp(-ldexp(tau, -SF_TRANS_FRAC));
  return round_half_up(ldexp(transmittance * fx_exp_neg((uint64_t)round_half_up(tau)), -SF_TRANS_FRAC));
}
