#include "src/quant/tensorf.h"
#include "render/composite.h"
#include <math.h>
#include <string.h>

enum { MAX_SAMPLES = 1024 };

double sf_fx_sigma_value(const fx_scene *scene, uint32_t sigma)
{
  return ldexp(sigma, -SF_SIGMA_FRAC) * scene->units.to_box_scale;
}

double sf_fx_colour_value(uint32_t colour)
{
  return ldexp(colour, -SF_COLOUR_FRAC);
}

static sf_status check_finite(const sf_model *model, const char *name)
{
  for (int id = 0; id < SF_P_COUNT; id++) {
    const float *value = sf_model_param(model, id);
    for (size_t i = 0; i < model->param[id].size; i++)
      if (!isfinite(value[i]))
        return sf_fail(SF_E_RANGE, "%s: tensor '%s': element %zu is %g, expected a finite number", name,
                       model->param[id].name, i, (double)value[i]);
  }
  return sf_ok();
}

static sf_status check_sizes(const sf_model *model, const char *name)
{
  const sf_config *config = &model->config;
  const bool vm = config->backbone == SF_TENSORF;
  if (config->hidden < 1 || config->hidden > SF_LANES)
    return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': %d neurons, the accelerator has %d", name,
                   model->param[vm ? SF_P_C1 : SF_P_D1].name, config->hidden, SF_LANES);
  if (vm && model->scales.weight_bits)
    return sf_fail(SF_E_UNSUPPORTED, "%s: metadata 'weight_bits': a TensoRF model cannot be fine-tuned", name);
  if (!vm && (config->levels < 1 || config->levels > FX_LEVELS_MAX))
    return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': %d levels, the accelerator has %d", name,
                   model->param[SF_P_GRID].name, config->levels, FX_LEVELS_MAX);
  return sf_ok();
}

static sf_status check_model(const sf_model *model, const char *name, const sf_quant_options *options)
{
  const sf_config *config = &model->config;
  if (config->net != SF_NET_SNN)
    return sf_fail(SF_E_UNSUPPORTED, "%s: metadata 'net': an ANN has no spikes; the accelerator runs spiking nets only",
                   name);
  SF_TRY(check_sizes(model, name));
  for (int i = 0; i < 3; i++)
    if (!isfinite(config->theta[i]) || config->theta[i] <= 0)
      return sf_fail(SF_E_RANGE, "%s: metadata 'theta' [%d] is %g, expected a positive number", name, i,
                     (double)config->theta[i]);
  if (options->steps < 0 || options->steps > config->steps)
    return sf_fail(SF_E_RANGE, "%s: %d steps asked for, the model was trained for T = %d", name, options->steps,
                   config->steps);
  if (options->steps == 0 && (model->t_r < 1 || model->t_r > config->steps))
    return sf_fail(SF_E_RANGE, "%s: metadata 't_r' is %d, expected 1..%d", name, model->t_r, config->steps);
  for (int o = 0; o < 3; o++)
    if (!(options->background[o] >= 0 && options->background[o] <= 1))
      return sf_fail(SF_E_RANGE, "%s: background[%d] is %g, expected 0..1", name, o, (double)options->background[o]);
  return check_finite(model, name);
}

/* *bits 0 becomes `high`. */
static sf_status resolve_width(int *bits, int low, int high, const char *what, const char *name)
{
  if (*bits == 0) *bits = high;
  if (*bits >= low && *bits <= high) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: %d bits asked for %s, expected %d..%d", name, *bits, what, low, high);
}

static sf_status resolve_widths(sf_quant_widths *widths, const char *name)
{
  SF_TRY(resolve_width(&widths->weight_bits, 2, SF_WEIGHT_BITS, "weights", name));
  SF_TRY(resolve_width(&widths->feature_bits, 8, SF_INPUT_BITS, "features", name));
  SF_TRY(resolve_width(&widths->leak_bits, 4, SF_LEAK_FRAC, "leaks", name));
  return resolve_width(&widths->grid_bits, 2, SF_GRID_BITS, "grid entries", name);
}

int64_t sf_packed_bytes(const fx_scene *scene, const sf_quant_widths *widths)
{
  const int64_t res = scene->occ_res;
  int64_t bits = (scene->log2_bound + 1) * res * res * res + scene->grid.entries * FX_GRID_FEATURES * widths->grid_bits;
  if (scene->backbone == FX_TENSORF) {
    const int64_t rows = scene->tensorf.appearance.components[0] + scene->tensorf.appearance.components[1] +
                         scene->tensorf.appearance.components[2];
    bits += (fx_tensorf_bytes(&scene->tensorf) - rows * FX_APPEARANCE_MAX) * widths->grid_bits;
    bits += rows * scene->tensorf.features * widths->weight_bits;
  }
  for (int l = 0; l < SF_LAYERS; l++)
    bits += (int64_t)fx_layer_rows(&scene->net.layer[l]) * scene->net.layer[l].n_out * widths->weight_bits;
  return (bits + 7) / 8;
}

static void set_sizes(fx_scene *scene, const sf_model *model)
{
  if (model->config.backbone == SF_TENSORF) {
    sf_tensorf_set_sizes(scene, model);
    return;
  }
  const int32_t hidden = model->config.hidden;
  const int32_t n_in[SF_LAYERS] = {2 * model->config.levels, hidden, SF_DIR_FEATURES + SF_GEO_FEATURES, hidden, hidden};
  const int32_t n_out[SF_LAYERS] = {hidden, SF_DENSITY_OUT, hidden, hidden, 3};
  for (int l = 0; l < SF_LAYERS; l++) scene->net.layer[l].n_in = n_in[l], scene->net.layer[l].n_out = n_out[l];
  sf_quantise_levels(&scene->grid, model);
  scene->occ_res = model->config.occ_res;
  scene->log2_bound = sf_config_cascades(&model->config) - 1;
}

/* k with `bits` fraction bits, as U1.LEAK_FRAC. */
static int32_t leak_value(float logit, int bits)
{
  return (int32_t)nearbyint(ldexp(1 / (1 + exp(-(double)logit)), bits)) << (SF_LEAK_FRAC - bits);
}

static void set_steps(fx_scene *scene, const sf_config *config)
{
  const double step = 2 * sqrt(3.0) / config->lattice; /* model units */
  scene->step_q24 = (int32_t)nearbyint(ldexp(step / (2 * config->bound), SF_DELTA_FRAC));
  if (!(config->dt_gamma > 0)) return;
  scene->gamma_q24 = (int32_t)nearbyint(ldexp((double)config->dt_gamma, 24));
  scene->near_q16 = (int32_t)nearbyint(ldexp(SF_NEAR / step, 16));
  scene->longest_q16 =
      (int32_t)nearbyint(fmax(1, (double)config->lattice * config->bound / config->occ_res) * (1 << 16));
}

static void set_scalars(fx_scene *scene, const sf_model *model, const sf_quant_options *options, int leak_bits)
{
  const float *leak = sf_model_param(model, SF_P_LEAK); /* in the order of the layers */
  for (int l = 0; l < SF_LAYERS; l++)
    if (scene->net.layer[l].n_out > 0) scene->net.layer[l].k = leak_value(leak[l], leak_bits);
  scene->net.mode = model->config.mode;
  scene->net.steps = options->steps ? options->steps : model->t_r;
  set_steps(scene, &model->config);
  scene->max_samples = MAX_SAMPLES;
  scene->trans_stop = (int32_t)floor(ldexp((double)sf_opaque, SF_TRANS_FRAC));
  for (int o = 0; o < 3; o++) {
    scene->background[o] = (int32_t)nearbyint(ldexp(options->background[o], 16));
    scene->units.to_box_offset[o] = 0.5;
  }
  scene->units.to_box_scale = 0.5 / model->config.bound;
  scene->units.model_scale = (double)model->config.scale;
  if (scene->backbone == FX_TENSORF) sf_tensorf_set_scalars(scene, model);
}

static sf_scales scales_of(const fx_scene *scene, int weight_bits)
{
  sf_scales s = {.weight_bits = weight_bits, .lsb.direction = (float)scene->units.dir_scale};
  for (int l = 0; l < FX_LEVELS_MAX; l++) s.lsb.entry[l] = s.lsb.feature[l] = 1;
  for (int l = 0; l < scene->grid.levels; l++) {
    s.lsb.feature[l] = (float)scene->units.feature_scale[l];
    s.lsb.entry[l] = ldexpf(s.lsb.feature[l], 16 - scene->grid.shift[l]);
  }
  for (int l = 0; l < SF_LAYERS; l++) s.lsb.current[l] = (float)scene->units.current_scale[l];
  return s;
}

static sf_status quantise(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options,
                          sf_calibration *calibration, sf_quant_report *report)
{
  set_sizes(scene, model);
  set_scalars(scene, model, options, report->widths.leak_bits);
  SF_TRY(fx_scene_allocate(scene, name));
  memcpy(scene->occupancy, model->occupancy, sf_config_cells(&model->config) / 8);
  report->packed_bytes = sf_packed_bytes(scene, &report->widths);
  if (scene->backbone == FX_TENSORF) return sf_quantise_tensorf(scene, model, name, options, report);
  SF_TRY(sf_calibrate(calibration, model, scene->net.steps, options->seed));
  report->samples = calibration->samples;
  sf_quantise_grid(scene, model, calibration, report);
  SF_TRY(sf_quantise_layers(scene, model, name, calibration, report));
  report->unused_tuning = sf_settled_scales(model, &report->widths) ? 0 : model->scales.weight_bits;
  report->scales = scales_of(scene, report->widths.weight_bits);
  return fx_scene_check(scene, name);
}

sf_status sf_quantise_report(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options,
                             sf_quant_report *report)
{
  sf_calibration calibration = {0};
  memset(scene, 0, sizeof *scene);
  memset(report, 0, sizeof *report);
  report->widths = options->widths;
  if (report->widths.weight_bits == 0) report->widths.weight_bits = model->scales.weight_bits;
  SF_TRY(check_model(model, name, options));
  SF_TRY(resolve_widths(&report->widths, name));
  const sf_status status = quantise(scene, model, name, options, &calibration, report);
  sf_calibration_free(&calibration);
  if (status.code != SF_OK) fx_scene_free(scene);
  return status;
}

sf_status sf_quantise(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options)
{
  sf_quant_report report;
  return sf_quantise_report(scene, model, name, options, &report);
}
