/* The five layers in the order of the data flow: each unit follows from the one before. */
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MEMBRANE_LIMIT = (1 << (SF_MEMBRANE_BITS - 1)) - 1 };
enum { DIR_FRAC = 10, DIR_TRIALS = 7, DIR_PATIENCE = 2, C1_INPUTS = SF_DIR_FEATURES + SF_GEO_FEATURES };

typedef struct context {
  fx_scene *scene;
  const sf_model *model;
  const char *name;
  const sf_calibration *calibration;
  sf_quant_report *report;
} context;

static const sf_param_id param_of[SF_LAYERS] = {SF_P_D1, SF_P_D2, SF_P_C1, SF_P_C2, SF_P_C3};

static int frac_of(int layer)
{
  return layer == FX_C2 ? SF_AC_FRAC : 0;
}

static double theta_of(const sf_model *model, int layer)
{
  return layer == FX_D1   ? model->config.theta[0]
         : layer == FX_C1 ? model->config.theta[1]
         : layer == FX_C2 ? model->config.theta[2]
                          : 0;
}

/* With a smaller unit theta would not fit the membrane. Integrating layers have no threshold; their unit only has to
 * stay positive. */
static double smallest_unit(const sf_model *model, int layer)
{
  const double theta = theta_of(model, layer);
  return theta > 0 ? ldexp(theta, frac_of(layer)) / MEMBRANE_LIMIT : 1e-12;
}

static int rows_of(const sf_calibration *c)
{
  return c->samples * c->steps;
}

static sf_status fit(const context *c, int layer, const int16_t *x, const double *lsb, double unit_min, bool refine,
                     sf_quant_layer *result)
{
  const fx_layer *to = &c->scene->net.layer[layer];
  const sf_scales *settled = sf_settled_scales(c->model, &c->report->widths);
  const sf_fit_data data = {.rows = rows_of(c->calibration),
                            .n_in = to->n_in,
                            .n_out = to->n_out,
                            .x = x,
                            .target = c->calibration->target[layer]};
  const sf_fit_weights weights = {.w = sf_model_param(c->model, param_of[layer]),
                                  .stride = to->n_in,
                                  .lsb = lsb,
                                  .unit_min = unit_min,
                                  .unit = settled ? settled->lsb.current[layer] : 0,
                                  .weight_max = sf_symmetric_max(c->report->widths.weight_bits)};
  return sf_fit_layer(&data, &weights, refine, to->w, result);
}

static sf_status set_theta(const context *c, int layer, double unit)
{
  const double exact = ldexp(theta_of(c->model, layer) / unit, frac_of(layer)), rounded = nearbyint(exact);
  if (!(rounded >= 1 && rounded <= MEMBRANE_LIMIT))
    return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': theta %g is %g membrane units of this layer, expected 1..%d",
                   c->name, c->model->param[param_of[layer]].name, theta_of(c->model, layer), exact, MEMBRANE_LIMIT);
  c->scene->net.layer[layer].theta = (int32_t)rounded;
  return sf_ok();
}

/* A unit so coarse that h fits C1's inputs. At the widths of the core the first one is. */
static sf_status fit_h(const context *c, const int16_t *x, const double *lsb, sf_quant_layer *result)
{
  const int limit = sf_symmetric_max(c->report->widths.feature_bits);
  double unit_min = smallest_unit(c->model, FX_D2);
  for (;;) {
    SF_TRY(fit(c, FX_D2, x, lsb, unit_min, true, result));
    const int largest = fx_largest_h(&c->scene->net.layer[FX_D2]);
    if (largest <= limit || sf_settled_scales(c->model, &c->report->widths)) return sf_ok();
    unit_min = result->unit * fmax(1.01, (double)largest / limit);
  }
}

/* Everything of a layer once its inputs are known. */
static sf_status finish_layer(const context *c, int layer, const int16_t *x, const double *lsb)
{
  sf_quant_layer *result = &c->report->layer[layer];
  if (layer == FX_D2)
    SF_TRY(fit_h(c, x, lsb, result));
  else
    SF_TRY(fit(c, layer, x, lsb, smallest_unit(c->model, layer), true, result));
  c->scene->units.current_scale[layer] = result->unit;
  return layer == FX_D2 || layer == FX_C3 ? sf_ok() : set_theta(c, layer, result->unit);
}

/* The same features at every step: the fit counts each sample once per step, which changes nothing. */
static void density_inputs(const context *c, int16_t *x)
{
  const sf_calibration *cal = c->calibration;
  const size_t n = (size_t)cal->features;
  for (int sample = 0; sample < cal->samples; sample++) {
    int16_t f[FX_LEVELS_MAX * FX_GRID_FEATURES];
    fx_grid_features(&c->scene->grid, cal->pos + sample * 3, f, NULL);
    for (int t = 0; t < cal->steps; t++)
      memcpy(x + ((size_t)sample * (size_t)cal->steps + (size_t)t) * n, f, n * sizeof *x);
  }
}

static void spike_inputs(const sf_calibration *cal, int from, int16_t *x)
{
  const size_t n = (size_t)rows_of(cal) * (size_t)cal->hidden;
  for (size_t i = 0; i < n; i++) x[i] = cal->spikes[from][i];
}

static int16_t to_input(double value, int limit)
{
  return (int16_t)(value > limit ? limit : value < -limit ? -limit : value);
}

/* d rounded to its LSB, h rounded down to its own as the accelerator does. */
static void colour_inputs(const context *c, double d_lsb, double h_lsb, int16_t *x)
{
  const sf_calibration *cal = c->calibration;
  const int limit = sf_symmetric_max(c->report->widths.feature_bits), one = 1 << SF_H_SHIFT;
  for (int row = 0; row < rows_of(cal); row++) {
    const float *d = cal->direction + (size_t)(row / cal->steps) * SF_DIR_FEATURES;
    const float *current = cal->target[FX_D2] + (size_t)row * SF_DENSITY_OUT;
    int16_t *to = x + (size_t)row * C1_INPUTS;
    for (int i = 0; i < SF_DIR_FEATURES; i++) to[i] = to_input(nearbyint(d[i] / d_lsb), limit);
    for (int j = 0; j < SF_GEO_FEATURES; j++)
      to[SF_DIR_FEATURES + j] = to_input(floor(nearbyint(one * current[1 + j] / h_lsb) / one), limit);
  }
}

static void colour_lsb(double *lsb, double d_lsb, double h_lsb)
{
  for (int i = 0; i < C1_INPUTS; i++) lsb[i] = i < SF_DIR_FEATURES ? d_lsb : h_lsb;
}

/* C1 has one unit for rows of d and of h, whose LSBs differ: a coarser d makes its weights finer. Harmonics are below
 * 3/4 and fill `feature_bits` at 2^-(feature_bits-1). Ends DIR_PATIENCE trials after the best one. */
static sf_status colour_layer(const context *c, int16_t *x)
{
  const double h_lsb = ldexp(c->scene->units.current_scale[FX_D2], SF_H_SHIFT);
  const int bits = c->report->widths.feature_bits - 1, finest = bits < DIR_FRAC ? bits : DIR_FRAC;
  const sf_scales *settled = sf_settled_scales(c->model, &c->report->widths);
  double lsb[C1_INPUTS], best = settled ? settled->lsb.direction : ldexp(1, -finest), best_error = INFINITY;
  for (int frac = settled ? 0 : finest, last = DIR_FRAC - DIR_TRIALS + 1; frac >= last && frac > 0; frac--) {
    const double d_lsb = ldexp(1, -frac);
    sf_quant_layer result;
    colour_lsb(lsb, d_lsb, h_lsb);
    colour_inputs(c, d_lsb, h_lsb, x);
    SF_TRY(fit(c, FX_C1, x, lsb, smallest_unit(c->model, FX_C1), false, &result));
    if (result.error >= best_error) continue;
    best = d_lsb, best_error = result.error;
    if (last > frac - DIR_PATIENCE) last = frac - DIR_PATIENCE;
  }
  c->scene->units.dir_scale = best;
  colour_lsb(lsb, best, h_lsb);
  colour_inputs(c, best, h_lsb, x);
  return finish_layer(c, FX_C1, x, lsb);
}

bool sf_quant_scale(double factor, int shift_max, int bias, fx_scale *scale)
{
  int exponent;
  frexp(factor, &exponent);
  int shift = 16 - exponent;
  if (shift > shift_max) shift = shift_max;
  double mul = nearbyint(ldexp(factor, shift));
  if (mul > 65535) mul = nearbyint(ldexp(factor, --shift));
  if (shift < 0) return false;
  *scale = (fx_scale){.mul = (int32_t)mul, .shift = shift, .bias = bias};
  return true;
}

static sf_status set_scale(const context *c, int layer, double factor, int bias, fx_scale *scale)
{
  if (sf_quant_scale(factor, 31, bias, scale)) return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': weights of up to %g are too large for the output function",
                 c->name, c->model->param[param_of[layer]].name,
                 c->scene->units.current_scale[layer] * sf_symmetric_max(c->report->widths.weight_bits));
}

static sf_status all_layers(const context *c, int16_t *x)
{
  const double log2e = 1.4426950408889634, one = 1 << SF_LOG_FRAC;
  double features[SF_FEATURE_MAX], spikes[SF_LANES];
  for (int i = 0; i < SF_FEATURE_MAX; i++) features[i] = c->scene->units.feature_scale[i / FX_GRID_FEATURES];
  for (int i = 0; i < SF_LANES; i++) spikes[i] = 1;
  density_inputs(c, x);
  SF_TRY(finish_layer(c, FX_D1, x, features));
  spike_inputs(c->calibration, FX_D1, x);
  SF_TRY(finish_layer(c, FX_D2, x, spikes));
  SF_TRY(colour_layer(c, x));
  spike_inputs(c->calibration, FX_C1, x);
  SF_TRY(finish_layer(c, FX_C2, x, spikes));
  spike_inputs(c->calibration, FX_C2, x);
  SF_TRY(finish_layer(c, FX_C3, x, spikes));
  /* Density per box edge = 2 bound * density per model unit (the box is 2 bound model units wide): + log2(2 bound). */
  const int32_t bias = (1 + c->scene->log2_bound) << SF_LOG_FRAC;
  SF_TRY(set_scale(c, FX_D2, c->scene->units.current_scale[FX_D2] * log2e * one, bias, &c->scene->net.exp_in));
  return set_scale(c, FX_C3, c->scene->units.current_scale[FX_C3] * one, 0, &c->scene->net.sigmoid_in);
}

sf_status sf_quantise_layers(fx_scene *scene, const sf_model *model, const char *name,
                             const sf_calibration *calibration, sf_quant_report *report)
{
  const context c = {scene, model, name, calibration, report};
  int16_t *x = malloc((size_t)rows_of(calibration) * SF_LANES * sizeof *x);
  if (!x) return sf_fail(SF_E_MEMORY, "%s: no memory for %d calibration rows", name, rows_of(calibration));
  const sf_status status = all_layers(&c, x);
  free(x);
  return status;
}
