/* Quantises a trained model to the scene file of the fixed-point core, the accelerator and the firmware. */
#include "spikefield/cli.h"
#include "spikefield/quant.h"
#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

typedef struct options {
  const char *output;
  int steps, background;
  uint64_t seed;
  sf_quant_widths widths;
  bool json;
} options;

static const char *const layer_name[SF_LAYERS] = {"D1", "D2", "C1", "C2", "C3"};

static sf_status file_size(const char *path, long long *size)
{
  struct stat info;
  if (stat(path, &info)) return sf_fail(SF_E_IO, "%s: cannot be read back", path);
  *size = (long long)info.st_size;
  return sf_ok();
}

static void print_text(const fx_scene *scene, const sf_quant_report *report, const char *path, long long bytes)
{
  printf("%s: %lld bytes, t_r = %d, %lld grid entries, %d x %d x %d occupancy cells\n", path, bytes, scene->net.steps,
         (long long)scene->grid.entries, scene->occ_res, scene->occ_res, scene->occ_res);
  printf("features of %d levels     error %6.3f %%  %lld grid entries clipped\n", scene->grid.levels,
         100 * report->feature_error, (long long)report->grid_clipped);
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &scene->net.layer[l];
    printf("%s %3d x %-3d LSB %-11.6g error %6.3f %%  %d weights clipped, k = %d/%d", layer_name[l], layer->n_in,
           layer->n_out, report->layer[l].unit, 100 * report->layer[l].error, report->layer[l].clipped, layer->k,
           1 << SF_LEAK_FRAC);
    if (layer->theta) printf(", theta = %d", layer->theta);
    putchar('\n');
  }
  printf("packed: %lld bytes at %d-bit weights, %d-bit features, %d-bit leaks, %d-bit grid entries\n",
         (long long)report->packed_bytes, report->widths.weight_bits, report->widths.feature_bits,
         report->widths.leak_bits, report->widths.grid_bits);
  printf("error: RMS of the layer's currents against float, %d calibration samples\n", report->samples);
}

static cJSON *layer_json(const fx_layer *layer, const sf_quant_layer *report, const char *name)
{
  cJSON *item = cJSON_CreateObject();
  cJSON_AddStringToObject(item, "layer", name);
  cJSON_AddNumberToObject(item, "n_in", layer->n_in);
  cJSON_AddNumberToObject(item, "n_out", layer->n_out);
  cJSON_AddNumberToObject(item, "k", layer->k);
  cJSON_AddNumberToObject(item, "theta", layer->theta);
  cJSON_AddNumberToObject(item, "current_lsb", report->unit);
  cJSON_AddNumberToObject(item, "current_error", report->error);
  cJSON_AddNumberToObject(item, "clipped_weights", report->clipped);
  return item;
}

static sf_status print_json(const fx_scene *scene, const sf_quant_report *report, const char *path, long long bytes)
{
  cJSON *json = cJSON_CreateObject(), *layers = cJSON_AddArrayToObject(json, "layers");
  cJSON_AddStringToObject(json, "scene", path);
  cJSON_AddNumberToObject(json, "bytes", (double)bytes);
  cJSON_AddNumberToObject(json, "t_r", scene->net.steps);
  cJSON_AddNumberToObject(json, "grid_entries", (double)scene->grid.entries);
  cJSON_AddNumberToObject(json, "grid_clipped", (double)report->grid_clipped);
  cJSON_AddItemToObject(json, "feature_lsb", cJSON_CreateDoubleArray(scene->feature_scale, scene->grid.levels));
  cJSON_AddNumberToObject(json, "feature_error", report->feature_error);
  cJSON_AddNumberToObject(json, "direction_lsb", scene->dir_scale);
  cJSON_AddNumberToObject(json, "calibration_samples", report->samples);
  cJSON_AddNumberToObject(json, "packed_bytes", (double)report->packed_bytes);
  cJSON_AddNumberToObject(json, "weight_bits", report->widths.weight_bits);
  cJSON_AddNumberToObject(json, "feature_bits", report->widths.feature_bits);
  cJSON_AddNumberToObject(json, "leak_bits", report->widths.leak_bits);
  cJSON_AddNumberToObject(json, "grid_bits", report->widths.grid_bits);
  for (int l = 0; l < SF_LAYERS; l++)
    cJSON_AddItemToArray(layers, layer_json(&scene->net.layer[l], &report->layer[l], layer_name[l]));
  char *text = cJSON_Print(json);
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "%s: no memory for the report", path);
  puts(text);
  free(text);
  return sf_ok();
}

static sf_status export_scene(const char *model_path, const options *o)
{
  const float grey = o->background == 0 ? 1 : 0;
  const sf_quant_options how = {
      .steps = o->steps, .background = {grey, grey, grey}, .seed = o->seed, .widths = o->widths};
  sf_quant_report report;
  sf_model model;
  fx_scene scene;
  long long bytes = 0;
  SF_TRY(sf_model_load(&model, model_path));
  sf_status status = sf_quantise_report(&scene, &model, model_path, &how, &report);
  sf_model_free(&model);
  if (status.code != SF_OK) return status;
  status = fx_scene_save(&scene, o->output);
  if (status.code == SF_OK) status = file_size(o->output, &bytes);
  if (status.code == SF_OK && o->json) status = print_json(&scene, &report, o->output, bytes);
  if (status.code == SF_OK && !o->json) print_text(&scene, &report, o->output, bytes);
  fx_scene_free(&scene);
  if (status.code == SF_OK && fflush(stdout)) return sf_fail(SF_E_IO, "standard output: the report was not written");
  return status;
}

int main(int argc, char **argv)
{
  options o = {0};
  const sf_option table[] = {
      {.name = "--output",
       .letter = 'o',
       .type = SF_ARG_STRING,
       .value = &o.output,
       .argument = "SCENE",
       .help = "scene file to write (.snn), required"},
      {.name = "--steps",
       .type = SF_ARG_INT,
       .value = &o.steps,
       .min = 1,
       .max = SF_T_MAX,
       .argument = "N",
       .help = "unroll N time steps instead of the model's own t_r"},
      {.name = "--background",
       .type = SF_ARG_CHOICE,
       .value = &o.background,
       .choices = "white|black",
       .argument = "COLOUR",
       .help = "colour behind the scene: white or black (default white)"},
      {.name = "--seed",
       .type = SF_ARG_U64,
       .value = &o.seed,
       .min = 0,
       .max = 18446744073709551615.0,
       .argument = "S",
       .help = "seed of the calibration samples (default 0)"},
      {"--weight-bits", 0, SF_ARG_INT, &o.widths.weight_bits, 2, SF_WEIGHT_BITS, NULL, "B", "bits of a weight"},
      {"--feature-bits", 0, SF_ARG_INT, &o.widths.feature_bits, 8, SF_INPUT_BITS, NULL, "B",
       "bits of the inputs of D1 and C1"},
      {"--leak-bits", 0, SF_ARG_INT, &o.widths.leak_bits, 4, SF_LEAK_FRAC, NULL, "B", "fraction bits of a leak"},
      {"--grid-bits", 0, SF_ARG_INT, &o.widths.grid_bits, 2, SF_GRID_BITS, NULL, "B", "bits of a grid entry"},
      {.name = "--json", .type = SF_ARG_FLAG, .value = &o.json, .help = "print the report as JSON"},
      {0}};
  const sf_cli cli = {.program = "sf_export",
                      .usage = "sf_export MODEL -o SCENE [options]",
                      .summary = "Quantises a trained model (model.safetensors) to integers for the fixed-point core, "
                                 "the accelerator and the firmware.",
                      .examples = "  sf_export model.safetensors -o scene.snn\n"
                                  "  sf_export model.safetensors -o short.snn --steps 2 --background black\n"
                                  "  sf_export model.safetensors -o small.snn --weight-bits 6 --grid-bits 6\n",
                      .options = table,
                      .min_positional = 1,
                      .max_positional = 1};
  const char *model_path = NULL;
  sf_status status = sf_cli_parse(&cli, argc, argv, &model_path);
  if (status.code == SF_OK && !o.output) status = sf_fail(SF_E_USAGE, "--output (-o) SCENE is missing");
  if (status.code == SF_OK) status = export_scene(model_path, &o);
  return sf_cli_finish(&cli, status);
}
