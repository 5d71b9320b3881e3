/* The decoder's three layers in the order of the data flow. The bias of a layer is the weight of one more input, which
 * is always active. */
#include "src/quant/tensorf.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MEMBRANE_LIMIT = (1 << (SF_MEMBRANE_BITS - 1)) - 1, INPUT_LIMIT = (1 << (SF_INPUT_BITS - 1)) - 1 };
enum { LAYERS = 3, FRAC_MAX = FX_DIR_FRAC_MAX - 1, FRAC_MIN = 5, PATIENCE = 2 };
enum { INPUTS_MAX = (SF_DIR_MAX > SF_LANES ? SF_DIR_MAX : SF_LANES) + 1 }; /* with the bias */

typedef struct context {
  fx_scene *scene;
  const sf_model *model;
  const char *name;
  const sf_vm_calibration *calibration;
  sf_quant_report *report;
} context;

static const int weight_id[LAYERS] = {SF_P_C1, SF_P_C2, SF_P_C3},
                 bias_id[LAYERS] = {SF_P_C1_BIAS, SF_P_C2_BIAS, SF_P_C3_BIAS};

static int rows_of(const sf_vm_calibration *c, int layer)
{
  return layer == 0 ? c->samples : c->samples * c->steps;
}

/* theta in membrane units is theta / unit * 2^frac; the spiking layers are 0 and 1. */
static double theta_of(const context *c, int layer)
{
  return layer < 2 ? ldexp(c->model->config.theta[1 + layer], layer == 1 ? SF_AC_FRAC : 0) : 0;
}

/* Weights and bias of the float layer side by side: [n_out][n_in + 1]. */
static float *join_weights(const context *c, int layer)
{
  const sf_param *p = &c->model->param[weight_id[layer]];
  const size_t n_in = (size_t)p->shape[1], n_out = (size_t)p->shape[0];
  const float *w = sf_model_param(c->model, weight_id[layer]), *bias = sf_model_param(c->model, bias_id[layer]);
  float *joined = malloc(n_out * (n_in + 1) * sizeof *joined);
  for (size_t o = 0; joined && o < n_out; o++) {
    memcpy(joined + o * (n_in + 1), w + o * n_in, n_in * sizeof *w);
    joined[o * (n_in + 1) + n_in] = bias[o];
  }
  return joined;
}

/* x[rows][n_in + 1], lsb[n_in + 1]. */
static sf_status fit(const context *c, int layer, const int16_t *x, const double *lsb, bool refine,
                     sf_quant_layer *result)
{
  const fx_layer *to = &c->scene->net.layer[FX_C1 + layer];
  const double theta = theta_of(c, layer);
  float *w = join_weights(c, layer);
  if (!w) return sf_fail(SF_E_MEMORY, "%s: no memory for the weights of a layer", c->name);
  const sf_fit_data data = {rows_of(c->calibration, layer), to->n_in + 1, to->n_out, x, c->calibration->current[layer]};
  const sf_fit_weights weights = {.w = w,
                                  .stride = to->n_in + 1,
                                  .lsb = lsb,
                                  .unit_min = theta > 0 ? theta / MEMBRANE_LIMIT : 1e-12,
                                  .weight_max = sf_symmetric_max(c->report->widths.weight_bits)};
  const sf_status status = sf_fit_layer(&data, &weights, refine, to->w, result);
  free(w);
  return status;
}

static sf_status finish_layer(const context *c, int layer, const int16_t *x, const double *lsb)
{
  fx_layer *to = &c->scene->net.layer[FX_C1 + layer];
  sf_quant_layer *result = &c->report->layer[FX_C1 + layer];
  SF_TRY(fit(c, layer, x, lsb, true, result));
  c->scene->units.current_scale[FX_C1 + layer] = result->unit;
  if (layer == 2) return sf_ok();
  const double exact = theta_of(c, layer) / result->unit, rounded = nearbyint(exact);
  if (!(rounded >= 1 && rounded <= MEMBRANE_LIMIT))
    return sf_fail(SF_E_UNSUPPORTED,
                   "%s: tensor '%s': its threshold is %g membrane units of this layer, expected 1..%d", c->name,
                   c->model->param[weight_id[layer]].name, exact, MEMBRANE_LIMIT);
  to->theta = (int32_t)rounded;
  return sf_ok();
}

/* ---- C1 ---- */

/* How the inputs are rounded: LSBs of the features and of all sines, cosines and directions. */
typedef struct input_format {
  double feature_lsb;
  int frac;
} input_format;

static double lsb_of(const context *c, const input_format *f, int input)
{
  return input < c->calibration->n_features ? f->feature_lsb : ldexp(1, -f->frac);
}

static int16_t to_input(double value)
{
  const double rounded = nearbyint(value);
  return (int16_t)(rounded > INPUT_LIMIT ? INPUT_LIMIT : rounded < -INPUT_LIMIT ? -INPUT_LIMIT : rounded);
}

/* The largest value of the bias' input with which no weight of a bias decides the layer's unit. */
static int bias_input(const context *c, const input_format *f)
{
  const sf_param *p = &c->model->param[SF_P_C1];
  const float *w = sf_model_param(c->model, SF_P_C1), *bias = sf_model_param(c->model, SF_P_C1_BIAS);
  double largest = 0, bias_max = 0;
  for (int64_t o = 0; o < p->shape[0]; o++) {
    for (int64_t i = 0; i < p->shape[1]; i++)
      largest = fmax(largest, fabs(w[o * p->shape[1] + i]) * lsb_of(c, f, (int)i));
    bias_max = fmax(bias_max, fabs((double)bias[o]));
  }
  const double value = largest > 0 ? ceil(bias_max / largest) : 1;
  return value < 1 ? 1 : value > INPUT_LIMIT ? INPUT_LIMIT : (int)value;
}

static int c1_inputs(const context *c, const input_format *f, int16_t *x, double *lsb)
{
  const sf_vm_calibration *cal = c->calibration;
  const int n = cal->n_inputs, bias = bias_input(c, f);
  for (int i = 0; i < n; i++) lsb[i] = lsb_of(c, f, i);
  lsb[n] = 1.0 / bias;
  for (int sample = 0; sample < cal->samples; sample++) {
    int16_t *to = x + (size_t)sample * (size_t)(n + 1);
    const float *in = cal->inputs + (size_t)sample * (size_t)n;
    for (int i = 0; i < n; i++) to[i] = to_input(in[i] / lsb[i]);
    to[n] = (int16_t)bias;
  }
  return bias;
}

static sf_status try_format(const context *c, const input_format *f, int16_t *x, double *error)
{
  double lsb[INPUTS_MAX];
  sf_quant_layer result;
  c1_inputs(c, f, x, lsb);
  SF_TRY(fit(c, 0, x, lsb, false, &result));
  *error = result.error;
  return sf_ok();
}

/* C1 has one unit for all inputs: a coarser LSB of some makes their weights finer. First that of sines and cosines,
 * then that of the features, each from its finest on as long as it helps. */
static sf_status choose_format(const context *c, int16_t *x, input_format *best)
{
  double error, best_error;
  input_format f = {c->scene->units.feature_scale[0], FRAC_MAX};
  *best = f;
  SF_TRY(try_format(c, &f, x, &best_error));
  for (int tries = 0; f.frac > FRAC_MIN && tries < PATIENCE; tries++) {
    f.frac--;
    SF_TRY(try_format(c, &f, x, &error));
    if (error < best_error) *best = f, best_error = error, tries = -1;
  }
  f = *best;
  for (int tries = 0; tries < PATIENCE; tries++) {
    f.feature_lsb *= 2;
    SF_TRY(try_format(c, &f, x, &error));
    if (error < best_error) *best = f, best_error = error, tries = -1;
  }
  return sf_ok();
}

static sf_status first_layer(const context *c, int16_t *x)
{
  fx_scene *scene = c->scene;
  double lsb[INPUTS_MAX];
  input_format format;
  SF_TRY(choose_format(c, x, &format));
  const double coarser = format.feature_lsb / scene->units.feature_scale[0]; /* a power of two */
  scene->tensorf.feature_in.shift += ilogb(coarser);
  scene->units.feature_scale[0] = format.feature_lsb;
  scene->tensorf.encoding_frac = format.frac;
  scene->units.dir_scale = ldexp(1, -format.frac);
  scene->net.layer[FX_C1].bias = c1_inputs(c, &format, x, lsb);
  return finish_layer(c, 0, x, lsb);
}

/* ---- C2, C3 ---- */

static sf_status spike_layer(const context *c, int layer, int16_t *x)
{
  const sf_vm_calibration *cal = c->calibration;
  const size_t hidden = (size_t)cal->hidden, rows = (size_t)rows_of(cal, layer);
  double lsb[SF_LANES + 1];
  for (size_t i = 0; i <= hidden; i++) lsb[i] = 1;
  for (size_t row = 0; row < rows; row++) {
    int16_t *to = x + row * (hidden + 1);
    for (size_t i = 0; i < hidden; i++) to[i] = cal->spikes[layer - 1][row * hidden + i];
    to[hidden] = 1;
  }
  return finish_layer(c, layer, x, lsb);
}

static sf_status all_layers(const context *c, int16_t *x)
{
  SF_TRY(first_layer(c, x));
  SF_TRY(spike_layer(c, 1, x));
  SF_TRY(spike_layer(c, 2, x));
  if (sf_quant_scale(c->scene->units.current_scale[FX_C3] * (1 << SF_LOG_FRAC), 31, 0, &c->scene->net.sigmoid_in))
    return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': weights are too large for the output function", c->name,
                 c->model->param[SF_P_C3].name);
}

sf_status sf_quantise_decoder(fx_scene *scene, const sf_model *model, const char *name,
                              const sf_vm_calibration *calibration, sf_quant_report *report)
{
  const context c = {scene, model, name, calibration, report};
  const size_t rows = (size_t)calibration->samples * (size_t)calibration->steps;
  int16_t *x = malloc(rows * INPUTS_MAX * sizeof *x);
  if (!x) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu calibration rows", name, rows);
  const sf_status status = all_layers(&c, x);
  free(x);
  return status;
}
