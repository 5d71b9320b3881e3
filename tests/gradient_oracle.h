/* The trainer's loss, written once more from the equations of docs/model.md, in double precision, sample by sample.
 * Numbers are complex: the imaginary part carries the slope along one direction of the parameters, times TINY
 * (complex-step differentiation; Squire and Trapp 1998). So every derivative is exact to rounding, and a spike stays a
 * hard step whose slope is the surrogate's. */
#ifndef SF_TESTS_GRADIENT_ORACLE_H
#define SF_TESTS_GRADIENT_ORACLE_H
#include "field/field.h"
#include "snn/plif.h"
#include "train/vm.h"
#include <complex.h>
#include <math.h>
#include <stdlib.h>

typedef double complex dual;
static const double TINY = 1e-40;

enum { RAY_SAMPLES = 1024 };

typedef struct oracle {
  const sf_trainer *t;
  const sf_loss_plan *plan;
  dual *value;      /* [model.size] */
  double charge[3]; /* of a neuron of D1, C1, C2 that fires at any step of a sample */
  double *rounded;  /* the weights that the nets run with, [model.size]; NULL: those of `value` */
  int *slowed;      /* samples near a camera, which learn slower; NULL: not wanted */
  double *nearest;  /* least distance of a membrane from its threshold; NULL: not wanted */
  uint64_t *signs;  /* a leak's slope has a random sign wherever it is used, drawn from this state; NULL: its own */
} oracle;

typedef struct oracle_ray {
  int count;
  double delta[RAY_SAMPLES];
  double edge[RAY_SAMPLES][2]; /* where the interval starts and ends, in units of L_distortion */
  dual sigma[SF_T_MAX][RAY_SAMPLES], colour[SF_T_MAX][RAY_SAMPLES][3];
} oracle_ray;

static inline dual with_slope(double value, double slope, dual x)
{
  return value + I * (slope * cimag(x));
}

static inline dual positive(dual x)
{
  return creal(x) > 0 ? x : 0;
}

static inline dual logistic(dual x)
{
  return 1 / (1 + cexp(-x));
}

/* The step at 0, with the slope of sigmoid(alpha u). */
static inline dual spike(dual u)
{
  const double s = 1 / (1 + exp(-SF_SURROGATE_ALPHA * creal(u)));
  return with_slope(creal(u) >= 0, SF_SURROGATE_ALPHA * s * (1 - s), u);
}

/* One parameter: rounded weights pass the slope straight through. */
static inline dual parameter(const oracle *o, int id, size_t at)
{
  const size_t i = o->t->model.param[id].offset + at;
  return o->rounded ? o->rounded[i] + I * cimag(o->value[i]) : o->value[i];
}

static inline dual leak(const oracle *o, int layer)
{
  const dual x = o->value[o->t->model.param[SF_P_LEAK].offset + (size_t)layer];
  if (!o->signs) return logistic(x);
  *o->signs = *o->signs * 6364136223846793005u + 1442695040888963407u;
  return logistic(with_slope(creal(x), *o->signs >> 63 ? 1 : -1, x));
}

/* ---- the nets ---- */

/* Of a membrane, or an integrator. */
static inline dual charged_by(const oracle *o, int step, dual k, dual before, dual in)
{
  const sf_config *c = &o->t->model.config;
  if (c->net == SF_NET_ANN) return in;
  switch (c->mode) {
  case SF_NODECAY:
    return (1 - k) * before + in;
  case SF_HYBRID:
    return step == 0 ? in : (1 - k) * before + k * in;
  default:
    return (1 - k) * before + k * in;
  }
}

typedef struct oracle_layer {
  dual v[SF_LANES], silent[SF_LANES]; /* product over the steps of 1 - s: 1 where it never fired */
} oracle_layer;

static inline void oracle_fire(const oracle *o, int spiking, int step, dual k, const dual *current, oracle_layer *l,
                               dual *s)
{
  const sf_config *c = &o->t->model.config;
  for (int n = 0; n < c->hidden; n++) {
    const dual h = charged_by(o, step, k, step ? l->v[n] : 0, current[n]);
    s[n] = c->net == SF_NET_ANN ? positive(h) : spike(h - c->theta[spiking]);
    if (o->nearest) *o->nearest = fmin(*o->nearest, fabs(creal(h) - (double)c->theta[spiking]));
    l->v[n] = h - s[n] * c->theta[spiking];
    l->silent[n] = (step ? l->silent[n] : 1) * (1 - s[n]);
  }
}

/* out[rows] += matrix `id`, from input `first` on, times in[n]. */
static inline void oracle_multiply(const oracle *o, int id, int first, int n, const dual *in, dual *out)
{
  const int64_t rows = o->t->model.param[id].shape[0], columns = o->t->model.param[id].shape[1];
  for (int64_t r = 0; r < rows; r++)
    for (int i = 0; i < n; i++) out[r] += parameter(o, id, (size_t)(r * columns + first + i)) * in[i];
}

static inline void oracle_bias(const oracle *o, int id, dual *out)
{
  for (size_t i = 0; i < o->t->model.param[id].size; i++) out[i] += parameter(o, id, i);
}

static inline dual oracle_charge(const oracle *o, const oracle_layer layer[3], int first)
{
  dual sum = 0;
  for (int l = first; l < 3; l++)
    for (int n = 0; n < o->t->model.config.hidden; n++) sum += o->charge[l] * (1 - layer[l].silent[n]);
  return sum;
}

/* C1 to the colour integrator at one step; current: of C1. Along a ray nothing is integrated. */
static inline void oracle_colour(const oracle *o, int step, const dual *current, oracle_layer layer[3],
                                 const dual before[3], dual colour[3])
{
  const bool along = o->t->model.config.along;
  dual s[SF_LANES], current2[SF_LANES] = {0}, j[3] = {0};
  oracle_fire(o, 1, step, leak(o, 2), current, &layer[1], s);
  oracle_multiply(o, SF_P_C2, 0, o->t->model.config.hidden, s, current2);
  oracle_bias(o, SF_P_C2_BIAS, current2);
  oracle_fire(o, 2, step, leak(o, 3), current2, &layer[2], s);
  oracle_multiply(o, SF_P_C3, 0, o->t->model.config.hidden, s, j);
  oracle_bias(o, SF_P_C3_BIAS, j);
  for (int a = 0; a < 3; a++)
    colour[a] = along ? logistic(j[a]) : charged_by(o, step, leak(o, 4), step ? before[a] : 0, logistic(j[a]));
}

static inline bool oracle_waits(const oracle *o)
{
  return o->t->model.config.mode == SF_RADIX && o->t->model.config.net == SF_NET_SNN;
}

static inline dual rounded_h(const oracle *o, int digits, dual h)
{
  const double step = sf_scales_h_step(&o->t->model.scales);
  if (!(step > 0)) return h;
  return with_slope(step * floor(creal(h) / step + 0.5 / (1 << (SF_H_SHIFT + digits))), 1, h);
}

/* Radix mode: what the digits of a current are worth, with the slope of the smoothed ramp. */
static inline dual worth_of(double theta, int steps, dual current)
{
  const double alpha = (double)sf_ramp_alpha((float)theta), levels = pow(2, steps), i = creal(current);
  const double number = fmin(fmax(floor(i * levels / (2 * theta)), 0), levels - 1);
  const double slope = (creal(logistic(alpha * i)) - creal(logistic(alpha * (i - 2 * theta)))) / (2 * theta);
  return with_slope(number / (levels - 1), slope, current);
}

/* Radix mode: out[rows] = what matrix `id` makes of all spikes of a layer, and of a bias, SF_P_COUNT for none. */
static inline void oracle_wait(const oracle *o, int spiking, int steps, const dual *current, oracle_layer *l, int id,
                               int bias, dual *out)
{
  const double theta = (double)o->t->model.config.theta[spiking];
  const int hidden = o->t->model.config.hidden;
  dual worth[SF_LANES];
  for (int n = 0; n < hidden; n++) {
    worth[n] = worth_of(theta, steps, current[n]);
    l->silent[n] = 1 - spike(current[n] - 2 * theta / pow(2, steps));
    const double unit = 2 * theta / pow(2, steps), at = creal(current[n]) / unit;
    const double next = fmin(fmax(round(at), 1), pow(2, steps) - 1); /* where another number begins */
    if (o->nearest) *o->nearest = fmin(*o->nearest, fabs(at - next) * unit);
  }
  if (bias < SF_P_COUNT) oracle_bias(o, bias, out);
  oracle_multiply(o, id, 0, hidden, worth, out);
}

/* Radix mode: C1 to the colour of a prefix. */
static inline void oracle_colour_prefix(const oracle *o, int steps, const dual *current, oracle_layer layer[3],
                                        dual colour[3])
{
  dual current2[SF_LANES] = {0}, j[3] = {0};
  oracle_wait(o, 1, steps, current, &layer[1], SF_P_C2, SF_P_C2_BIAS, current2);
  oracle_wait(o, 2, steps, current2, &layer[2], SF_P_C3, SF_P_C3_BIAS, j);
  for (int a = 0; a < 3; a++) colour[a] = logistic(j[a]);
}

/* Radix mode: every prefix is a pass of its own, and the last one is charged. */
static inline void oracle_prefixes(const oracle *o, const dual *current, const dual *constant, oracle_layer layer[3],
                                   oracle_ray *ray, int at)
{
  for (int p = 0; p < o->plan->steps; p++) {
    dual i[SF_DENSITY_OUT] = {0}, current1[SF_LANES];
    if (p < sf_loss_from(o->plan)) continue;
    oracle_wait(o, 0, p + 1, current, &layer[0], SF_P_D2, SF_P_COUNT, i);
    ray->sigma[p][at] = cexp(i[0]);
    memcpy(current1, constant, sizeof current1);
    for (int a = 1; a < SF_DENSITY_OUT; a++) i[a] = rounded_h(o, p + 1, i[a]);
    oracle_multiply(o, SF_P_C1, SF_DIR_FEATURES, SF_GEO_FEATURES, i + 1, current1);
    oracle_colour_prefix(o, p + 1, current1, layer, ray->colour[p][at]);
  }
}

/* Density and colour nets of one sample, all steps; what its firing is charged with. */
static inline dual oracle_nets(const oracle *o, const dual *feature, const float *sh, oracle_ray *ray, int at)
{
  const sf_model *m = &o->t->model;
  oracle_layer layer[3];
  dual current[SF_LANES] = {0}, constant[SF_LANES] = {0}, direction[SF_DIR_FEATURES], s[SF_LANES];
  for (int i = 0; i < SF_DIR_FEATURES; i++) direction[i] = sh[i];
  oracle_multiply(o, SF_P_D1, 0, 2 * m->config.levels, feature, current);
  oracle_multiply(o, SF_P_C1, 0, SF_DIR_FEATURES, direction, constant);
  if (oracle_waits(o)) oracle_prefixes(o, current, constant, layer, ray, at);
  for (int t = 0; t < o->plan->steps && !oracle_waits(o); t++) {
    dual i[SF_DENSITY_OUT] = {0}, current1[SF_LANES];
    oracle_fire(o, 0, t, leak(o, 0), current, &layer[0], s);
    oracle_multiply(o, SF_P_D2, 0, m->config.hidden, s, i);
    ray->sigma[t][at] = charged_by(o, t, leak(o, 1), t ? ray->sigma[t - 1][at] : 0, cexp(i[0]));
    memcpy(current1, constant, sizeof current1);
    for (int a = 1; a < SF_DENSITY_OUT; a++) i[a] = rounded_h(o, 0, i[a]);
    oracle_multiply(o, SF_P_C1, SF_DIR_FEATURES, SF_GEO_FEATURES, i + 1, current1);
    oracle_colour(o, t, current1, layer, t ? ray->colour[t - 1][at] : NULL, ray->colour[t][at]);
  }
  return oracle_charge(o, layer, 0);
}

/* Of one sample of a net along rays, the one after `before` others of its ray; layer: as they left it. */
static inline void oracle_nets_along(const oracle *o, const dual *feature, const float *sh, int before,
                                     oracle_layer layer[3], oracle_ray *ray, int at)
{
  const sf_model *m = &o->t->model;
  dual current[SF_LANES] = {0}, direction[SF_DIR_FEATURES], s[SF_LANES], i[SF_DENSITY_OUT] = {0};
  for (int a = 0; a < SF_DIR_FEATURES; a++) direction[a] = sh[a];
  oracle_multiply(o, SF_P_D1, 0, 2 * m->config.levels, feature, current);
  oracle_fire(o, 0, before, leak(o, 0), current, &layer[0], s);
  oracle_multiply(o, SF_P_D2, 0, m->config.hidden, s, i);
  ray->sigma[0][at] = cexp(i[0]);
  memset(current, 0, sizeof current);
  oracle_multiply(o, SF_P_C1, 0, SF_DIR_FEATURES, direction, current);
  oracle_multiply(o, SF_P_C1, SF_DIR_FEATURES, SF_GEO_FEATURES, i + 1, current);
  oracle_colour(o, before, current, layer, NULL, ray->colour[0][at]);
}

static inline void oracle_decoder_along(const oracle *o, const dual *in, int before, oracle_layer layer[3],
                                        oracle_ray *ray, int at)
{
  dual current[SF_LANES] = {0};
  oracle_multiply(o, SF_P_C1, 0, sf_tensorf_inputs(&o->t->model.config.tensorf), in, current);
  oracle_bias(o, SF_P_C1_BIAS, current);
  oracle_colour(o, before, current, layer, NULL, ray->colour[0][at]);
}

/* The decoder of one sample. */
static inline dual oracle_decoder(const oracle *o, const dual *in, oracle_ray *ray, int at)
{
  oracle_layer layer[3];
  dual current[SF_LANES] = {0};
  oracle_multiply(o, SF_P_C1, 0, sf_tensorf_inputs(&o->t->model.config.tensorf), in, current);
  oracle_bias(o, SF_P_C1_BIAS, current);
  for (int p = 0; p < o->plan->steps && oracle_waits(o); p++)
    if (p >= sf_loss_from(o->plan)) oracle_colour_prefix(o, p + 1, current, layer, ray->colour[p][at]);
  for (int t = 0; t < o->plan->steps && !oracle_waits(o); t++)
    oracle_colour(o, t, current, layer, t ? ray->colour[t - 1][at] : NULL, ray->colour[t][at]);
  return oracle_charge(o, layer, 1);
}

/* ---- the fields ---- */

static inline void oracle_grid(const oracle *o, const double x[3], dual *feature)
{
  const sf_model *m = &o->t->model;
  for (int l = 0; l < m->config.levels; l++) {
    const sf_grid_level *level = &m->level[l];
    feature[2 * l] = feature[2 * l + 1] = 0;
    for (int corner = 0; corner < 8; corner++) {
      uint32_t p[3];
      double weight = 1;
      for (int a = 0; a < 3; a++) {
        const double pos = x[a] * (double)level->scale + 0.5, cell = floor(pos);
        const int high = corner >> a & 1;
        p[a] = (uint32_t)cell + (uint32_t)high;
        weight *= high ? pos - cell : 1 - (pos - cell);
      }
      const uint32_t entry = level->stride ? p[0] + level->stride * (p[1] + level->stride * p[2])
                                           : (p[0] ^ p[1] * 2654435761u ^ p[2] * 805459861u) & (level->entries - 1);
      for (int i = 0; i < 2; i++)
        feature[2 * l + i] += weight * o->value[m->param[SF_P_GRID].offset + 2 * (level->offset + entry) + (size_t)i];
    }
  }
}

/* Plane times line, component c of mode m. first: SF_P_DENSITY_PLANE or SF_P_APP_PLANE. */
static inline dual oracle_product(const oracle *o, int first, int m, int c, const double x[3])
{
  const sf_tensorf *f = &o->t->model.config.tensorf;
  const int n = first == SF_P_APP_PLANE ? f->appearance[m] : f->density[m];
  int low[3];
  double part[3];
  for (int i = 0; i < 3; i++) {
    const int resolution = f->resolution[sf_tensorf_axis[m][i]];
    const double at = x[sf_tensorf_axis[m][i]] * (resolution - 1);
    low[i] = (int)fmin(floor(at), resolution - 2);
    part[i] = at - low[i];
  }
  dual plane = 0, line = 0;
  for (int corner = 0; corner < 4; corner++) {
    const int u = corner & 1, v = corner >> 1;
    const size_t at = (size_t)((low[1] + v) * f->resolution[sf_tensorf_axis[m][0]] + low[0] + u);
    plane +=
        (u ? part[0] : 1 - part[0]) * (v ? part[1] : 1 - part[1]) * parameter(o, first + m, at * (size_t)n + (size_t)c);
  }
  for (int w = 0; w < 2; w++)
    line += (w ? part[2] : 1 - part[2]) * parameter(o, first + 3 + m, (size_t)((low[2] + w) * n + c));
  return plane * line;
}

static inline dual oracle_density(const oracle *o, const double x[3])
{
  const sf_tensorf *f = &o->t->model.config.tensorf;
  dual sum = f->shift;
  for (int m = 0; m < 3; m++)
    for (int c = 0; c < f->density[m]; c++) sum += oracle_product(o, SF_P_DENSITY_PLANE, m, c, x);
  return (double)f->distance_scale * (f->activation == SF_RELU ? positive(sum) : clog(1 + cexp(sum)));
}

/* Sines, then cosines, of x[n] 2^0 .. 2^(freqs-1). */
static inline dual *oracle_sines(const dual *x, int n, int freqs, dual *out)
{
  for (int i = 0; i < n * freqs; i++) {
    const dual angle = x[i / freqs] * ldexp(1, i % freqs);
    out[i] = csin(angle);
    out[n * freqs + i] = ccos(angle);
  }
  return out + 2 * n * freqs;
}

static inline void oracle_inputs(const oracle *o, const double x[3], const float *direction, dual *in)
{
  const sf_tensorf *f = &o->t->model.config.tensorf;
  const dual d[3] = {direction[0], direction[1], direction[2]};
  for (int i = 0; i < f->features; i++) in[i] = 0;
  for (int m = 0, column = 0; m < 3; column += f->appearance[m++])
    for (int c = 0; c < f->appearance[m]; c++) {
      const dual product = oracle_product(o, SF_P_APP_PLANE, m, c, x);
      for (int i = 0; i < f->features; i++)
        in[i] += parameter(o, SF_P_BASIS, (size_t)(i * sf_tensorf_products(f) + column + c)) * product;
    }
  memcpy(in + f->features, d, sizeof d);
  oracle_sines(d, 3, f->view_freqs, oracle_sines(in, f->features, f->feature_freqs, in + f->features + 3));
}
#endif
