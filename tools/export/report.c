#include "tools/export/report.h"
#include <stdio.h>

void export_report_print(const fx_scene *scene, const sf_quant_report *report, bool fit, const char *path,
                         long long bytes)
{
  const bool vm = scene->backbone == FX_TENSORF;
  const int32_t *res = scene->tensorf.res;
  printf("%s: %lld bytes, t_r = %d, %lld %s entries, %d x %d x %d occupancy cells\n", path, bytes, scene->net.steps,
         (long long)(vm ? fx_tensorf_bytes(&scene->tensorf) : scene->grid.entries), vm ? "TensoRF" : "grid",
         scene->occ_res, scene->occ_res, scene->occ_res);
  if (vm)
    printf("%d features of %d x %d x %d points", scene->tensorf.features, res[0], res[1], res[2]);
  else
    printf("features of %d levels", scene->grid.levels);
  if (!fit)
    printf(", error %.3f %%, %lld grid entries clipped", 100 * report->feature_error, (long long)report->grid_clipped);
  putchar('\n');
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &scene->net.layer[l];
    if (!layer->n_out) continue; /* a decoder has no density net */
    printf("%s %3d x %-3d LSB %-11.6g", fx_layer_name(l), layer->n_in, layer->n_out, report->layer[l].unit);
    if (!fit) printf(" error %6.3f %%  %d weights clipped,", 100 * report->layer[l].error, report->layer[l].clipped);
    printf(" k = %d/%d", layer->k, 1 << SF_LEAK_FRAC);
    if (layer->theta) printf(", theta = %d", layer->theta);
    putchar('\n');
  }
  printf("packed: %lld bytes at %d-bit weights, %d-bit features, %d-bit leaks, %d-bit grid entries\n",
         (long long)report->packed_bytes, report->widths.weight_bits, report->widths.feature_bits,
         report->widths.leak_bits, report->widths.grid_bits);
  const sf_quant_widths *unused = &report->unused;
  if (unused->weight_bits)
    printf("note: fine-tuned for %d-bit weights, %d-bit features and %d-bit grid entries; those scales are not used "
           "here\n",
           unused->weight_bits, unused->feature_bits, unused->grid_bits);
  if (!fit) printf("error: RMS of the layer's currents against float, %d calibration samples\n", report->samples);
}

static cJSON *layer_json(const fx_layer *layer, const sf_quant_layer *report, bool fit, const char *name)
{
  cJSON *item = cJSON_CreateObject();
  cJSON_AddStringToObject(item, "layer", name);
  cJSON_AddNumberToObject(item, "n_in", layer->n_in);
  cJSON_AddNumberToObject(item, "n_out", layer->n_out);
  cJSON_AddNumberToObject(item, "k", layer->k);
  cJSON_AddNumberToObject(item, "theta", layer->theta);
  cJSON_AddNumberToObject(item, "current_lsb", report->unit);
  if (fit) return item;
  cJSON_AddNumberToObject(item, "current_error", report->error);
  cJSON_AddNumberToObject(item, "clipped_weights", report->clipped);
  return item;
}

cJSON *export_report_json(const fx_scene *scene, const sf_quant_report *report, const sf_fit_report *fit,
                          const char *path, long long bytes)
{
  cJSON *json = cJSON_CreateObject(), *layers = cJSON_AddArrayToObject(json, "layers");
  cJSON_AddStringToObject(json, "scene", path);
  cJSON_AddNumberToObject(json, "bytes", (double)bytes);
  cJSON_AddNumberToObject(json, "t_r", scene->net.steps);
  cJSON_AddNumberToObject(json, "grid_entries", (double)scene->grid.entries);
  if (!fit) cJSON_AddNumberToObject(json, "grid_clipped", (double)report->grid_clipped);
  const bool vm = scene->backbone == FX_TENSORF;
  cJSON_AddStringToObject(json, "backbone", vm ? "tensorf" : "ingp");
  if (vm) cJSON_AddNumberToObject(json, "field_bytes", (double)fx_tensorf_bytes(&scene->tensorf));
  cJSON_AddItemToObject(json, "feature_lsb",
                        cJSON_CreateDoubleArray(scene->units.feature_scale, vm ? 1 : scene->grid.levels));
  if (!fit) cJSON_AddNumberToObject(json, "feature_error", report->feature_error);
  cJSON_AddNumberToObject(json, "direction_lsb", scene->units.dir_scale);
  cJSON_AddNumberToObject(json, "calibration_samples", report->samples);
  cJSON_AddNumberToObject(json, "packed_bytes", (double)report->packed_bytes);
  cJSON_AddNumberToObject(json, "weight_bits", report->widths.weight_bits);
  cJSON_AddNumberToObject(json, "feature_bits", report->widths.feature_bits);
  cJSON_AddNumberToObject(json, "leak_bits", report->widths.leak_bits);
  cJSON_AddNumberToObject(json, "grid_bits", report->widths.grid_bits);
  for (int l = 0; l < SF_LAYERS; l++)
    cJSON_AddItemToArray(layers, layer_json(&scene->net.layer[l], &report->layer[l], fit, fx_layer_name(l)));
  if (fit) cJSON_AddItemToObject(json, "fit", sf_fit_json(fit));
  return json;
}
