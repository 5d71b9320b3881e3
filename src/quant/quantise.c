#include "src/quant/internal.h"
#include "fx/tensorf.h"
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

/* The first layer that there is has as many neurons as all. */
static sf_status check_sizes(const sf_model *model, const char *name)
{
  const sf_field_quantiser *field = sf_field_quantiser_of(model);
  const int hidden = model->config.hidden, first = sf_model_decodes(model) ? FX_C1 : FX_D1;
  if (hidden < 1 || hidden > SF_LANES)
    return sf_fail(SF_E_UNSUPPORTED, "%s: tensor '%s': %d neurons, the accelerator has %d", name,
                   model->param[sf_layer_weights[first]].name, hidden, SF_LANES);
  return field->check ? field->check(model, name) : sf_ok();
}

static sf_status check_model(const sf_model *model, const char *name, const sf_quant_options *options)
{
  const sf_config *config = &model->config;
  if (config->net != SF_NET_SNN)
    return sf_fail(SF_E_UNSUPPORTED, "%s: metadata 'net': an ANN has no spikes; the accelerator runs spiking nets only",
                   name);
  if (config->along)
    return sf_fail(SF_E_UNSUPPORTED,
                   "%s: metadata 'along_ray': its steps are the samples of a ray (--steps-along-ray); the accelerator "
                   "runs the steps of one sample",
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

static void take_tuned(sf_quant_widths *widths, const sf_scales *tuned)
{
  if (widths->weight_bits == 0) widths->weight_bits = tuned->weight_bits;
  if (widths->grid_bits == 0) widths->grid_bits = tuned->grid_bits;
  if (widths->leak_bits == 0) widths->leak_bits = tuned->leak_bits;
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
  const int64_t rows = fx_factors_components(&scene->tensorf.appearance);
  int64_t bits = (scene->log2_bound + 1) * res * res * res + scene->grid.entries * FX_GRID_FEATURES * widths->grid_bits;
  bits += (fx_tensorf_bytes(&scene->tensorf) - rows * FX_APPEARANCE_MAX) * widths->grid_bits;
  bits += rows * scene->tensorf.features * widths->weight_bits;
  for (int l = 0; l < SF_LAYERS; l++)
    bits += (int64_t)fx_layer_rows(&scene->net.layer[l]) * scene->net.layer[l].n_out * widths->weight_bits;
  return (bits + 7) / 8;
}

static void set_sizes(fx_scene *scene, const sf_model *model)
{
  scene->occ_res = model->config.occ_res;
  for (int l = 0; l < SF_LAYERS; l++) {
    if (!sf_model_has(model, sf_layer_weights[l])) continue;
    const sf_param *w = &model->param[sf_layer_weights[l]];
    fx_layer *layer = &scene->net.layer[l];
    layer->n_in = (int32_t)w->shape[1], layer->n_out = (int32_t)w->shape[0],
    layer->bias = sf_layer_bias[l] >= 0 && sf_model_has(model, sf_layer_bias[l]);
  }
}

/* k with `bits` fraction bits, as U1.LEAK_FRAC. */
static int32_t leak_value(float logit, int bits)
{
  return (int32_t)nearbyint(ldexp(1 / (1 + exp(-(double)logit)), bits)) << (SF_LEAK_FRAC - bits);
}

static void set_scalars(fx_scene *scene, const sf_model *model, const sf_quant_options *options, int leak_bits)
{
  const float *leak = sf_model_param(model, SF_P_LEAK); /* in the order of the layers */
  for (int l = 0; l < SF_LAYERS; l++)
    if (scene->net.layer[l].n_out > 0) scene->net.layer[l].k = leak_value(leak[l], leak_bits);
  scene->net.mode = model->config.mode; /* sf_input_mode is fx_input_mode */
  scene->net.steps = options->steps ? options->steps : model->t_r;
  scene->max_samples = MAX_SAMPLES;
  scene->trans_stop = (int32_t)floor(ldexp(model->config.stop, SF_TRANS_FRAC));
  for (int o = 0; o < 3; o++) scene->background[o] = (int32_t)nearbyint(ldexp(options->background[o], 16));
  scene->units.model_scale = (double)model->config.scale;
  scene->units.data_scale = (double)model->config.space.scale;
  scene->units.data_bound = model->config.space.bound, scene->units.data_ndc = model->config.space.ndc;
  scene->units.data_views = model->config.space.views, scene->units.data_poses = model->config.space.poses;
  scene->units.data_picture = model->config.space.picture;
}

/* What fine-tuning keeps to, beside what the field has said. */
static void describe(const fx_scene *scene, const sf_model *model, sf_quant_report *report)
{
  const sf_quant_widths *w = &report->widths;
  sf_scales *s = &report->scales;
  s->weight_bits = w->weight_bits, s->grid_bits = w->grid_bits, s->leak_bits = w->leak_bits;
  s->lsb.direction = (float)scene->units.dir_scale;
  for (int l = 0; l < (sf_model_decodes(model) ? 1 : scene->grid.levels); l++)
    s->lsb.feature[l] = (float)scene->units.feature_scale[l];
  for (int l = 0; l < SF_LAYERS; l++)
    if (scene->net.layer[l].n_out) s->lsb.current[l] = (float)scene->units.current_scale[l];
  if (scene->net.layer[FX_C1].bias) s->lsb.bias = 1 / (float)scene->net.layer[FX_C1].bias;
  if (!sf_settled_scales(model, w) && model->scales.weight_bits)
    report->unused =
        (sf_quant_widths){model->scales.weight_bits, SF_INPUT_BITS, model->scales.leak_bits, model->scales.grid_bits};
}

static sf_status quantise(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options,
                          sf_calibration *calibration, sf_quant_report *report)
{
  const sf_field_quantiser *field = sf_field_quantiser_of(model);
  set_sizes(scene, model);
  SF_TRY(field->set_sizes(scene, model, name, &report->widths));
  set_scalars(scene, model, options, report->widths.leak_bits);
  field->set_scalars(scene, model);
  SF_TRY(fx_scene_allocate(scene, name));
  memcpy(scene->occupancy, model->occupancy, sf_config_cells(&model->config) / 8);
  report->packed_bytes = sf_packed_bytes(scene, &report->widths);
  SF_TRY(sf_calibrate(calibration, model, scene->net.steps, options->seed));
  report->samples = calibration->samples;
  SF_TRY(field->quantise(scene, model, name, calibration, report));
  SF_TRY(sf_quantise_layers(scene, model, name, calibration, report));
  describe(scene, model, report);
  return fx_scene_check(scene, name);
}

sf_status sf_quantise_report(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_options *options,
                             sf_quant_report *report)
{
  sf_calibration calibration = {0};
  memset(scene, 0, sizeof *scene);
  memset(report, 0, sizeof *report);
  sf_scales_clear(&report->scales);
  report->widths = options->widths;
  if (model->scales.weight_bits) take_tuned(&report->widths, &model->scales);
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
