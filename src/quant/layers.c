/* The layers of the net in the order of the data flow: each unit follows from the one before. A bias is the weight of
 * one more input, which is always active. */
#include "src/fx/unit.h"
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MEMBRANE_LIMIT = (1 << (SF_MEMBRANE_BITS - 1)) - 1, DIR_FRAC = 10, PATIENCE = 2 };
enum { INPUTS_MAX = (SF_DIR_MAX > SF_LANES ? SF_DIR_MAX : SF_LANES) + 1 }; /* with the bias */

typedef struct context {
  fx_scene *scene;
  const sf_model *model;
  const char *name;
  const sf_field_quantiser *field;
  const sf_calibration *calibration;
  sf_quant_report *report;
  const sf_scales *settled; /* NULL: to be found */
  int input_limit;          /* of features, harmonics and h */
} context;

/* The LSBs of C1's inputs: of the field's own features, of what else comes with the sample, and of h. */
typedef struct input_format {
  double feature, constant, h;
} input_format;

static double theta_of(const sf_model *model, int layer)
{
  for (int s = 0; s < FX_SPIKING; s++)
    if (fx_spiking_layers[s] == layer) return (double)model->config.theta[s];
  return 0;
}

/* Of theta, membrane LSB: fx/plif.c. */
static double largest_theta(const sf_model *model)
{
  return model->config.mode == SF_RADIX ? MEMBRANE_LIMIT / 2 : MEMBRANE_LIMIT;
}

/* With a smaller unit theta would not fit the membrane. Integrating layers have no threshold; their unit only has to
 * stay positive. */
static double smallest_unit(const sf_model *model, int layer)
{
  const double theta = theta_of(model, layer);
  return theta > 0 ? ldexp(theta, fx_layer_frac(layer, (int32_t)model->config.mode)) / largest_theta(model) : 1e-12;
}

static int rows_of(const sf_calibration *c, int layer)
{
  return c->samples * c->per_sample[layer];
}

static const char *tensor_of(const context *c, int layer)
{
  return c->model->param[sf_layer_weights[layer]].name;
}

/* Weights and bias of the float layer side by side: [n_out][fx_layer_rows]. */
static float *join_weights(const context *c, int layer)
{
  const fx_layer *to = &c->scene->net.layer[layer];
  const size_t n_in = (size_t)to->n_in, rows = (size_t)fx_layer_rows(to), n_out = (size_t)to->n_out;
  const float *w = sf_model_param(c->model, sf_layer_weights[layer]);
  float *joined = malloc(n_out * rows * sizeof *joined);
  for (size_t o = 0; joined && o < n_out; o++) {
    memcpy(joined + o * rows, w + o * n_in, n_in * sizeof *w);
    if (to->bias) joined[o * rows + n_in] = sf_model_param(c->model, sf_layer_bias[layer])[o];
  }
  return joined;
}

/* Weights beyond `limit` become the limit, and the currents of inputs with an LSB of 1 follow. Returns how many. */
static int limit_weights(const fx_layer *to, double limit, const int16_t *x, int rows, float *w, float *target)
{
  const int inputs = fx_layer_rows(to);
  int limited = 0;
  for (int o = 0; o < to->n_out; o++)
    for (int i = 0; i < inputs; i++) {
      float *weight = w + (size_t)o * (size_t)inputs + i;
      const float within = copysignf(fminf(fabsf(*weight), (float)limit), *weight), beyond = *weight - within;
      if (beyond == 0) continue;
      for (int row = 0; row < rows; row++)
        target[(size_t)row * (size_t)to->n_out + o] -= beyond * x[(size_t)row * (size_t)inputs + i];
      *weight = within;
      limited++;
    }
  return limited;
}

/* x[rows][fx_layer_rows], lsb[fx_layer_rows]. limit: of weights, where all LSBs are 1; else infinite. */
static sf_status fit_within(const context *c, int layer, double limit, const int16_t *x, const double *lsb,
                            double unit_min, bool refine, sf_quant_layer *result)
{
  const fx_layer *to = &c->scene->net.layer[layer];
  const int inputs = fx_layer_rows(to), rows = rows_of(c->calibration, layer);
  const bool limits = !isinf(limit);
  const size_t currents = (size_t)rows * (size_t)to->n_out;
  float *w = join_weights(c, layer), *target = limits ? malloc(currents * sizeof *target) : NULL;
  if (!w || (limits && !target)) {
    free(w), free(target);
    return sf_fail(SF_E_MEMORY, "%s: no memory for the weights of a layer", c->name);
  }
  if (limits) memcpy(target, c->calibration->target[layer], currents * sizeof *target);
  const int limited = limits ? limit_weights(to, limit, x, rows, w, target) : 0;
  const sf_fit_data data = {rows, inputs, to->n_out, x, limits ? target : c->calibration->target[layer]};
  const sf_fit_weights weights = {.w = w,
                                  .stride = inputs,
                                  .lsb = lsb,
                                  .unit_min = unit_min,
                                  .unit = c->settled ? c->settled->lsb.current[layer] : 0,
                                  .weight_max = sf_symmetric_max(c->report->widths.weight_bits)};
  const sf_status status = sf_fit_layer(&data, &weights, refine, to->w, result);
  result->clipped += limited;
  free(w);
  free(target);
  return status;
}

static sf_status fit(const context *c, int layer, const int16_t *x, const double *lsb, double unit_min, bool refine,
                     sf_quant_layer *result)
{
  return fit_within(c, layer, INFINITY, x, lsb, unit_min, refine, result);
}

static sf_status set_theta(const context *c, int layer, double unit)
{
  const double exact = ldexp(theta_of(c->model, layer) / unit, fx_layer_frac(layer, (int32_t)c->model->config.mode)),
               rounded = nearbyint(exact);
  if (!(rounded >= 1 && rounded <= largest_theta(c->model)))
    return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': theta %g is %g membrane units of this layer, expected 1..%.0f",
                   c->name, tensor_of(c, layer), theta_of(c->model, layer), exact, largest_theta(c->model));
  c->scene->net.layer[layer].theta = (int32_t)rounded;
  return sf_ok();
}

/* A unit so coarse that h fits C1's inputs. At the widths of the core the first one is. */
static sf_status fit_h(const context *c, const int16_t *x, const double *lsb, sf_quant_layer *result)
{
  double unit_min = smallest_unit(c->model, FX_D2);
  for (;;) {
    SF_TRY(fit(c, FX_D2, x, lsb, unit_min, true, result));
    const int largest = fx_largest_h(&c->scene->net.layer[FX_D2]);
    if (largest <= c->input_limit || c->settled) return sf_ok();
    unit_min = result->unit * fmax(1.01, (double)largest / c->input_limit);
  }
}

/* Sum of the squared errors of the colours with the integer weights of C3. */
static double colour_error(const context *c, const int16_t *x, double unit)
{
  const fx_layer *to = &c->scene->net.layer[FX_C3];
  const sf_calibration *cal = c->calibration;
  const size_t inputs = (size_t)fx_layer_rows(to), n_out = (size_t)to->n_out;
  const double whole = 1.0 / (cal->digits ? (1 << cal->digits) - 1 : 1);
  double error = 0;
  for (size_t row = 0; row < (size_t)rows_of(cal, FX_C3); row++)
    for (size_t o = 0; o < n_out; o++) {
      int32_t sum = 0;
      for (size_t i = 0; i < inputs; i++) sum += x[row * inputs + i] * to->w[i * SF_LANES + o];
      const double exact = whole * (double)cal->target[FX_C3][row * n_out + o];
      const double d = 1 / (1 + exp(-exact)) - 1 / (1 + exp(-whole * unit * sum));
      error += d * d;
    }
  return error;
}

/* One weight of C3 that is far larger than the others makes the unit of all of them coarse, though the colour is black
 * or full long before. So smaller limits of the weights are tried, and the colours decide. Below LEAST a spike alone
 * does not saturate a colour. */
static sf_status fit_colours(const context *c, const int16_t *x, const double *lsb, sf_quant_layer *result)
{
  enum { TRIES = 16 }; /* down to 1/256 of the largest */
  static const double LEAST = 4;
  fx_layer *to = &c->scene->net.layer[FX_C3];
  const double unit_min = smallest_unit(c->model, FX_C3);
  const size_t inputs = (size_t)fx_layer_rows(to);
  float *w = join_weights(c, FX_C3), largest = 0;
  if (!w) return sf_fail(SF_E_MEMORY, "%s: no memory for the weights of a layer", c->name);
  for (size_t i = 0; i < inputs * (size_t)to->n_out; i++) largest = fmaxf(largest, fabsf(w[i]));
  free(w);
  SF_TRY(fit(c, FX_C3, x, lsb, unit_min, true, result));
  if (c->settled) return sf_ok();
  double best = largest > LEAST ? colour_error(c, x, result->unit) : 0, chosen = INFINITY;
  double limit = largest * M_SQRT1_2;
  for (int n = 0; n < TRIES && limit >= LEAST; n++, limit *= M_SQRT1_2) {
    sf_quant_layer tried;
    SF_TRY(fit_within(c, FX_C3, limit, x, lsb, unit_min, true, &tried));
    const double error = colour_error(c, x, tried.unit);
    if (error < best) best = error, chosen = limit;
  }
  return largest > LEAST ? fit_within(c, FX_C3, chosen, x, lsb, unit_min, true, result) : sf_ok();
}

/* Everything of a layer once its inputs are known. */
static sf_status finish_layer(const context *c, int layer, const int16_t *x, const double *lsb)
{
  sf_quant_layer *result = &c->report->layer[layer];
  if (layer == FX_D2)
    SF_TRY(fit_h(c, x, lsb, result));
  else if (layer == FX_C3)
    SF_TRY(fit_colours(c, x, lsb, result));
  else
    SF_TRY(fit(c, layer, x, lsb, smallest_unit(c->model, layer), true, result));
  c->scene->units.current_scale[layer] = result->unit;
  return theta_of(c->model, layer) > 0 ? set_theta(c, layer, result->unit) : sf_ok();
}

/* ---- D1 ---- */

/* The same features at every step: the fit counts each sample once per step, which changes nothing. */
static sf_status density_layer(const context *c, int16_t *x)
{
  const sf_calibration *cal = c->calibration;
  const size_t n = (size_t)cal->features, steps = (size_t)cal->per_sample[FX_D1];
  double lsb[SF_FEATURE_MAX];
  for (int i = 0; i < SF_FEATURE_MAX; i++) lsb[i] = c->scene->units.feature_scale[i / FX_GRID_FEATURES];
  for (int sample = 0; sample < cal->samples; sample++) {
    int16_t f[FX_LEVELS_MAX * FX_GRID_FEATURES];
    fx_grid_features(&c->scene->grid, cal->pos + sample * 3, f, NULL);
    for (size_t t = 0; t < steps; t++) memcpy(x + ((size_t)sample * steps + t) * n, f, n * sizeof *x);
  }
  return finish_layer(c, FX_D1, x, lsb);
}

/* ---- C1 ---- */

static double lsb_of(const context *c, const input_format *f, int input)
{
  const int own = c->field->set_inputs ? c->calibration->features : 0; /* of the field, among C1's */
  return input < own ? f->feature : input < c->calibration->constants ? f->constant : f->h;
}

static int16_t to_input(double value, int limit)
{
  return (int16_t)(value > limit ? limit : value < -limit ? -limit : value);
}

/* The largest value of the bias' input with which no weight of a bias decides the layer's unit. */
static int bias_input(const context *c, const double *lsb)
{
  const sf_param *p = &c->model->param[SF_P_C1];
  const float *w = sf_model_param(c->model, SF_P_C1), *bias = sf_model_param(c->model, SF_P_C1_BIAS);
  double largest = 0, bias_max = 0;
  for (int64_t o = 0; o < p->shape[0]; o++) {
    for (int64_t i = 0; i < p->shape[1]; i++) largest = fmax(largest, fabs(w[o * p->shape[1] + i]) * lsb[i]);
    bias_max = fmax(bias_max, fabs((double)bias[o]));
  }
  const double value = largest > 0 ? ceil(bias_max / largest) : 1;
  return value < 1 ? 1 : value > c->input_limit ? c->input_limit : (int)value;
}

/* Constant inputs rounded to their LSB, h rounded down to its own as the accelerator does: currents are whole numbers
 * of LSBs of D2, which take H_SHIFT bits of h, and of radix are the sum of all digits. Sets the bias' input. */
static void colour_inputs(const context *c, const input_format *f, int16_t *x, double *lsb)
{
  const sf_calibration *cal = c->calibration;
  fx_layer *to = &c->scene->net.layer[FX_C1];
  const int n = cal->constants, h = to->n_in - n, one = 1 << SF_H_SHIFT, per_sample = cal->per_sample[FX_C1];
  for (int i = 0; i < to->n_in; i++) lsb[i] = lsb_of(c, f, i);
  if (to->bias) {
    to->bias = c->settled ? (int32_t)lround(1 / (double)c->settled->lsb.bias) : bias_input(c, lsb);
    lsb[to->n_in] = 1.0 / to->bias;
  }
  for (int row = 0; row < rows_of(cal, FX_C1); row++) {
    const float *constant = cal->constant + (size_t)(row / per_sample) * (size_t)n;
    const float *current = h ? cal->target[FX_D2] + (size_t)row * (size_t)(h + 1) : NULL;
    int16_t *in = x + (size_t)row * (size_t)fx_layer_rows(to);
    for (int i = 0; i < n; i++) in[i] = to_input(nearbyint(constant[i] / lsb[i]), c->input_limit);
    for (int j = 0; j < h; j++) {
      const double exact = nearbyint(one * current[1 + j] / f->h); /* of a model beyond all reason it fits no integer */
      const int32_t lsbs = (int32_t)fmax(-FX_MEMBRANE_MAX, fmin(FX_MEMBRANE_MAX, exact));
      in[n + j] = to_input(cal->digits ? fx_weighed_h(lsbs, cal->digits) : lsbs >> SF_H_SHIFT, c->input_limit);
    }
    if (to->bias) in[to->n_in] = (int16_t)to->bias;
  }
}

static sf_status try_format(const context *c, const input_format *f, int16_t *x, double *error)
{
  double lsb[INPUTS_MAX];
  sf_quant_layer result;
  colour_inputs(c, f, x, lsb);
  SF_TRY(fit(c, FX_C1, x, lsb, smallest_unit(c->model, FX_C1), false, &result));
  *error = result.error;
  return sf_ok();
}

/* C1 has one unit for inputs whose LSBs differ: a coarser LSB of some makes their weights finer. First that of
 * harmonics or encodings (below 1: they fill `bits` at 2^-bits), then that of the field's own features, each from its
 * finest on. Either search ends PATIENCE trials after its best one. */
static sf_status choose_format(const context *c, int16_t *x, input_format *best)
{
  const int bits = c->report->widths.feature_bits - 1, finest = -(bits < DIR_FRAC ? bits : DIR_FRAC);
  double error, best_error = INFINITY;
  input_format f = *best;
  for (int n = finest, last = c->field->tried; n <= last && n <= c->field->coarsest; n++) {
    f.constant = ldexp(1, n);
    SF_TRY(try_format(c, &f, x, &error));
    if (error >= best_error) continue;
    *best = f, best_error = error;
    if (last < n + PATIENCE) last = n + PATIENCE;
  }
  f = *best;
  for (int tries = 0; c->field->set_inputs && tries < PATIENCE; tries++) {
    f.feature *= 2;
    SF_TRY(try_format(c, &f, x, &error));
    if (error < best_error) *best = f, best_error = error, tries = -1;
  }
  return sf_ok();
}

static sf_status colour_layer(const context *c, int16_t *x)
{
  double lsb[INPUTS_MAX];
  input_format best = {.feature = c->scene->units.feature_scale[0],
                       .constant = c->settled ? c->settled->lsb.direction : 0,
                       .h = ldexp(c->scene->units.current_scale[FX_D2], SF_H_SHIFT)};
  if (!c->settled) SF_TRY(choose_format(c, x, &best));
  if (c->field->set_inputs) c->field->set_inputs(c->scene, best.feature, best.constant);
  c->scene->units.dir_scale = best.constant;
  colour_inputs(c, &best, x, lsb);
  return finish_layer(c, FX_C1, x, lsb);
}

/* ---- D2, C2, C3 ---- */

static sf_status spike_layer(const context *c, int layer, int from, int16_t *x)
{
  const fx_layer *to = &c->scene->net.layer[layer];
  const size_t n_in = (size_t)to->n_in, inputs = (size_t)fx_layer_rows(to);
  const int16_t always = c->calibration->digits ? (int16_t)((1 << c->calibration->digits) - 1) : 1;
  double lsb[SF_LANES + 1];
  for (size_t i = 0; i < inputs; i++) lsb[i] = 1;
  for (size_t row = 0; row < (size_t)rows_of(c->calibration, layer); row++) {
    for (size_t i = 0; i < n_in; i++) x[row * inputs + i] = c->calibration->spikes[from][row * n_in + i];
    if (to->bias) x[row * inputs + n_in] = always;
  }
  return finish_layer(c, layer, x, lsb);
}

static sf_status set_scale(const context *c, int layer, double factor, int bias, fx_scale *scale)
{
  if (sf_quant_scale(factor, 31, bias, scale)) return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': weights of up to %g are too large for the output function",
                 c->name, tensor_of(c, layer),
                 c->scene->units.current_scale[layer] * sf_symmetric_max(c->report->widths.weight_bits));
}

static sf_status density_net(const context *c, int16_t *x)
{
  const double log2e = 1.4426950408889634, one = 1 << SF_LOG_FRAC;
  SF_TRY(density_layer(c, x));
  SF_TRY(spike_layer(c, FX_D2, FX_D1, x));
  /* Density per box edge = 2 bound * density per model unit (the box is 2 bound model units wide): + log2(2 bound). */
  const int32_t bias = (1 + c->scene->log2_bound) << SF_LOG_FRAC;
  return set_scale(c, FX_D2, c->scene->units.current_scale[FX_D2] * log2e * one, bias, &c->scene->net.exp_in);
}

static sf_status all_layers(const context *c, int16_t *x)
{
  if (!sf_model_decodes(c->model)) SF_TRY(density_net(c, x));
  SF_TRY(colour_layer(c, x));
  SF_TRY(spike_layer(c, FX_C2, FX_C1, x));
  SF_TRY(spike_layer(c, FX_C3, FX_C2, x));
  return set_scale(c, FX_C3, c->scene->units.current_scale[FX_C3] * (1 << SF_LOG_FRAC), 0, &c->scene->net.sigmoid_in);
}

sf_status sf_quantise_layers(fx_scene *scene, const sf_model *model, const char *name,
                             const sf_calibration *calibration, sf_quant_report *report)
{
  const context c = {.scene = scene,
                     .model = model,
                     .name = name,
                     .field = sf_field_quantiser_of(model),
                     .calibration = calibration,
                     .report = report,
                     .settled = sf_settled_scales(model, &report->widths),
                     .input_limit = sf_symmetric_max(report->widths.feature_bits)};
  const size_t rows = (size_t)calibration->samples * (size_t)calibration->steps;
  int16_t *x = malloc(rows * INPUTS_MAX * sizeof *x);
  if (!x) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu calibration rows", name, rows);
  const sf_status status = all_layers(&c, x);
  free(x);
  return status;
}
