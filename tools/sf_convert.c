/* sf_convert: a trained ReLU twin as integrate-and-fire neurons, its quality and energy over the number of steps. */
#include "convert/convert.h"
#include "cli/cli.h"
#include "base/json.h"
#include "energy/energy.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { POINTS = 7, CALIBRATION = 256 };
static const int steps[POINTS] = {4, 8, 16, 32, 64, 128, 256};

typedef struct options {
  int rays, downscale;
  uint64_t seed;
  double percentile;
  bool json, quiet;
} options;

typedef struct measured {
  sf_converted net;
  sf_conversion twin, at[POINTS];
} measured;

/* Mean squared error above the twin's on the same rays; decibels of a good and of a poor picture are unlike errors. */
static double excess(const sf_conversion *c, const sf_conversion *twin)
{
  return pow(10, -c->psnr / 10) - pow(10, -twin->psnr / 10);
}

static cJSON *row_json(const sf_conversion *c, const sf_conversion *twin, int rays)
{
  cJSON *json = cJSON_CreateObject();
  if (c->steps) cJSON_AddNumberToObject(json, "steps", c->steps);
  cJSON_AddNumberToObject(json, "psnr", c->psnr);
  if (c->steps) cJSON_AddNumberToObject(json, "excess_squared_error", excess(c, twin));
  cJSON_AddNumberToObject(json, "samples_per_ray", (double)c->samples / rays);
  sf_json_add_u64(json, "macs", c->macs), sf_json_add_u64(json, "sops", c->sops);
  sf_json_add_u64(json, "energy_fj", c->fj);
  if (c->steps) cJSON_AddNumberToObject(json, "of_twin_percent", 100.0 * (double)c->fj / (double)twin->fj);
  return json;
}

static sf_status print_json(const measured *m, const options *o)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddNumberToObject(json, "rays", o->rays);
  cJSON_AddNumberToObject(json, "seed", (double)o->seed);
  cJSON_AddNumberToObject(json, "percentile", o->percentile);
  cJSON *list = cJSON_AddArrayToObject(json, "thresholds");
  for (int l = m->net.first; l < SF_CONVERTED_LAYERS; l++)
    cJSON_AddItemToArray(list, cJSON_CreateNumber((double)m->net.threshold[l]));
  cJSON_AddItemToObject(json, "twin", row_json(&m->twin, &m->twin, o->rays));
  cJSON *rows = cJSON_AddArrayToObject(json, "converted");
  for (int p = 0; p < POINTS; p++) cJSON_AddItemToArray(rows, row_json(&m->at[p], &m->twin, o->rays));
  return sf_json_print(json, true);
}

static sf_status print_text(const measured *m, const options *o)
{
  printf("%d random rays of held-out views; thresholds", o->rays);
  for (int l = m->net.first; l < SF_CONVERTED_LAYERS; l++) printf(" %.3g", (double)m->net.threshold[l]);
  printf(" (percentile %g)\n", o->percentile);
  printf("%-10s %8s %12s %12s %12s\n", "steps", "PSNR dB", "excess 1e-5", "nJ per ray", "of twin %");
  printf("%-10s %8.2f %12s %12.2f %12s\n", "ReLU twin", m->twin.psnr, "-", (double)m->twin.fj * 1e-6 / o->rays,
         "100.0");
  for (int p = 0; p < POINTS; p++)
    printf("%-10d %8.2f %12.2f %12.2f %12.1f\n", m->at[p].steps, m->at[p].psnr, 1e5 * excess(&m->at[p], &m->twin),
           (double)m->at[p].fj * 1e-6 / o->rays, 100.0 * (double)m->at[p].fj / (double)m->twin.fj);
  return sf_ok();
}

/* One split, at the scale of the model. */
static sf_status load(sf_dataset *data, const sf_model *model, const char *path, const char *dir, const char *split,
                      const options *o)
{
  const sf_dataset_options how = {.downscale = o->downscale, .scale = model->config.scale};
  SF_TRY(sf_dataset_load(data, dir, split, &how));
  const sf_status status = sf_space_check(&model->config.space, path, data);
  if (!strcmp(split, "train")) sf_dataset_warn(stderr, "sf_convert", data, NULL);
  if (status.code) sf_dataset_free(data);
  return status;
}

typedef struct teller {
  sf_progress progress;
  int rays;
} teller;

static void show(void *user, int done)
{
  teller *t = user;
  if (sf_progress_due(&t->progress))
    sf_progress_show(&t->progress, "%d of %d rays at every number of steps", done, t->rays);
}

static sf_status measure(measured *m, const sf_model *model, const char *path, const char *dir, const options *o)
{
  sf_dataset views;
  SF_TRY(load(&views, model, path, dir, "train", o));
  sf_status status = sf_convert(&m->net, model, &views, CALIBRATION, o->percentile, o->seed);
  sf_dataset_free(&views);
  if (status.code) return sf_fail(status.code, "%.200s: %s", path, status.message);
  SF_TRY(load(&views, model, path, dir, "test", o));
  teller tell = {.rays = o->rays};
  sf_progress_begin(&tell.progress, o->quiet);
  const sf_conversion_rays rays = {.count = o->rays, .seed = o->seed, .tick = show, .user = &tell};
  status = sf_convert_measure(&m->net, &views, &rays, POINTS, steps, &m->twin, m->at);
  sf_progress_end(&tell.progress);
  sf_dataset_free(&views);
  return status;
}

static sf_status convert(const char *path, const char *dir, const options *o)
{
  sf_model model;
  measured m = {.net = {0}};
  SF_TRY(sf_model_load(&model, path));
  sf_status status = measure(&m, &model, path, dir, o);
  if (!status.code) status = o->json ? print_json(&m, o) : print_text(&m, o);
  sf_converted_free(&m.net);
  sf_model_free(&model);
  return status;
}

int main(int argc, char **argv)
{
  options o = {.rays = 1000, .seed = 1, .percentile = 99.9};
  const sf_option table[] = {
      {"--rays", 0, SF_ARG_INT, &o.rays, 1, 1 << 20, NULL, "N", "random rays of held-out views (default 1000)"},
      {"--percentile", 0, SF_ARG_DOUBLE, &o.percentile, 1, 100, NULL, "P",
       "of a layer's activations: its threshold (default 99.9)"},
      {"--seed", 0, SF_ARG_U64, &o.seed, 0, 9e15, NULL, "S", "of the rays (default 1)"},
      {"--downscale", 0, SF_ARG_INT, &o.downscale, 0, 64, NULL, "N",
       "views of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--json", 0, SF_ARG_FLAG, &o.json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o.quiet, 0, 0, NULL, NULL, "no progress line"},
      {0}};
  const sf_cli cli = {
      .program = "sf_convert",
      .usage = "sf_convert TWIN.safetensors DATA [options]",
      .summary =
          "Makes a spiking net of a trained ReLU twin (sf_train --net ann) without training:\n"
          "integrate-and-fire neurons with balanced thresholds, 4 to 256 time steps. Prints PSNR, squared error\n"
          "above the twin's, and energy (paper ledger, float) beside the twin's, on random rays. Of a TensoRF\n"
          "model it converts the decoder.",
      .examples = "  sf_convert ann/model.safetensors data/lego\n"
                  "  sf_convert ann/model.safetensors data/lego --rays 5000 --json\n",
      .options = table,
      .min_positional = 2,
      .max_positional = 2};
  const char *positional[2];
  sf_status status = sf_cli_parse(&cli, argc, argv, positional);
  if (!status.code) status = convert(positional[0], positional[1], &o);
  return sf_cli_finish(&cli, status);
}
