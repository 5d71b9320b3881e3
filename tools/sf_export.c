/* Quantises a trained model to the scene file of the fixed-point core, the accelerator and the firmware. */
#include "spikefield/cli.h"
#include "spikefield/fit.h"
#include "spikefield/quant.h"
#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

typedef struct options {
  const char *output, *data;
  int steps, background;
  uint64_t seed, fit_rays;
  double fit_loss;
  bool json, fit, quiet;
} options;

enum { FIT_RAYS = 262144 };
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
    printf("%s %3d x %-3d LSB %-11.6g error %6.3f %%  %d weights clipped, k = %d/4096", layer_name[l], layer->n_in,
           layer->n_out, report->layer[l].unit, 100 * report->layer[l].error, report->layer[l].clipped, layer->k);
    if (layer->theta) printf(", theta = %d", layer->theta);
    putchar('\n');
  }
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

static sf_status print_json(const fx_scene *scene, const sf_quant_report *report, const sf_fit_report *fit,
                            const char *path, long long bytes)
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
  for (int l = 0; l < SF_LAYERS; l++)
    cJSON_AddItemToArray(layers, layer_json(&scene->net.layer[l], &report->layer[l], layer_name[l]));
  if (fit) cJSON_AddItemToObject(json, "fit", sf_fit_json(fit));
  char *text = cJSON_Print(json);
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "%s: no memory for the report", path);
  puts(text);
  free(text);
  return sf_ok();
}

/* ---- --fit ---- */

typedef struct fitting {
  sf_progress progress;
  double begun;
} fitting;

static bool fit_tick(void *user, const char *what, int done, int total)
{
  fitting *f = user;
  if (what && sf_progress_due(&f->progress))
    sf_progress_show(&f->progress, "fit: %s, %d of %d, %.0f s", what, done, total, sf_seconds() - f->begun);
  return !sf_cli_interrupted();
}

/* Replaces the scene by the fitted one. */
static sf_status fit_to_rays(fx_scene *scene, const sf_fit_rays *rays, const options *o, sf_fit_report *report)
{
  fitting progress = {.begun = sf_seconds()};
  const fx_scene *const candidate[] = {scene};
  const sf_fit_job job = {.candidate = candidate,
                          .candidates = 1,
                          .rays = rays,
                          .loss_db = o->fit_loss,
                          .name = o->output,
                          .tick = fit_tick,
                          .user = &progress};
  fx_scene fitted;
  sf_progress_begin(&progress.progress, o->quiet);
  const sf_status status = sf_fit(&fitted, &job, report);
  sf_progress_end(&progress.progress);
  if (status.code != SF_OK) return status;
  fx_scene_free(scene);
  *scene = fitted;
  return sf_ok();
}

/* scale: the model's, which the poses must be in. */
static sf_status fit_scene(fx_scene *scene, float scale, const options *o, sf_fit_report *report)
{
  const sf_dataset_options how = {.downscale = 1, .scale = scale};
  sf_dataset data;
  sf_fit_rays rays;
  SF_TRY(sf_dataset_load(&data, o->data, "train", &how));
  sf_status status = sf_fit_rays_draw(&rays, &data, scene->background, o->fit_rays, o->seed);
  sf_dataset_free(&data);
  if (status.code != SF_OK) return status;
  status = fit_to_rays(scene, &rays, o, report);
  sf_fit_rays_free(&rays);
  return status;
}

/* ---- program ---- */

static sf_status quantise(const char *model_path, const options *o, fx_scene *scene, float *scale,
                          sf_quant_report *report)
{
  const float grey = o->background == 0 ? 1 : 0;
  const sf_quant_options how = {.steps = o->steps, .background = {grey, grey, grey}, .seed = o->seed};
  sf_model model;
  SF_TRY(sf_model_load(&model, model_path));
  const sf_status status = sf_quantise_report(scene, &model, model_path, &how, report);
  *scale = model.config.scale;
  sf_model_free(&model);
  return status;
}

static sf_status save_and_report(const fx_scene *scene, const options *o, const sf_quant_report *report,
                                 const sf_fit_report *fit)
{
  long long bytes = 0;
  SF_TRY(fx_scene_save(scene, o->output));
  SF_TRY(file_size(o->output, &bytes));
  if (o->json) SF_TRY(print_json(scene, report, fit, o->output, bytes));
  if (!o->json) print_text(scene, report, o->output, bytes);
  if (!o->json && fit) sf_fit_print(stdout, fit);
  return fflush(stdout) ? sf_fail(SF_E_IO, "standard output: the report was not written") : sf_ok();
}

static sf_status export_scene(const char *model_path, const options *o)
{
  sf_quant_report report;
  sf_fit_report fit;
  fx_scene scene;
  float scale;
  if (o->fit) sf_cli_catch_signals();
  SF_TRY(quantise(model_path, o, &scene, &scale, &report));
  sf_status status = o->fit ? fit_scene(&scene, scale, o, &fit) : sf_ok();
  if (status.code == SF_OK) status = save_and_report(&scene, o, &report, o->fit ? &fit : NULL);
  fx_scene_free(&scene);
  return status;
}

static sf_status check_options(const options *o)
{
  if (!o->output) return sf_fail(SF_E_USAGE, "--output (-o) SCENE is missing");
  if (o->fit && !o->data) return sf_fail(SF_E_USAGE, "--fit needs --data DATA: the training views to fit to");
  return sf_ok();
}

int main(int argc, char **argv)
{
  options o = {.fit_rays = FIT_RAYS, .fit_loss = 0.05};
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
      {.name = "--fit",
       .type = SF_ARG_FLAG,
       .value = &o.fit,
       .help = "leave out what the training views of --data do not need"},
      {.name = "--fit-loss",
       .type = SF_ARG_DOUBLE,
       .value = &o.fit_loss,
       .min = 0,
       .max = 100,
       .argument = "DB",
       .help = "PSNR that --fit may cost on rays of the training views; 0: only what changes no bit (default 0.05)"},
      {.name = "--fit-rays",
       .type = SF_ARG_U64,
       .value = &o.fit_rays,
       .min = 256,
       .max = 1e8,
       .argument = "N",
       .help = "rays that --fit looks at (default 262144)"},
      {.name = "--data", .type = SF_ARG_STRING, .value = &o.data, .argument = "DATA", .help = "data set for --fit"},
      {.name = "--quiet", .letter = 'q', .type = SF_ARG_FLAG, .value = &o.quiet, .help = "no progress line"},
      {.name = "--json", .type = SF_ARG_FLAG, .value = &o.json, .help = "print the report as JSON"},
      {0}};
  const sf_cli cli = {.program = "sf_export",
                      .usage = "sf_export MODEL -o SCENE [options]",
                      .summary = "Quantises a trained model (model.safetensors) to integers for the fixed-point core, "
                                 "the accelerator and the firmware.",
                      .examples = "  sf_export model.safetensors -o scene.snn\n"
                                  "  sf_export model.safetensors -o short.snn --steps 2 --background black\n"
                                  "  sf_export model.safetensors -o small.snn --fit --data lego --fit-loss 0.05\n",
                      .options = table,
                      .min_positional = 1,
                      .max_positional = 1};
  const char *model_path = NULL;
  sf_status status = sf_cli_parse(&cli, argc, argv, &model_path);
  if (status.code == SF_OK) status = check_options(&o);
  if (status.code == SF_OK) status = export_scene(model_path, &o);
  return sf_cli_finish(&cli, status);
}
