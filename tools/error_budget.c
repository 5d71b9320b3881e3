/* error_budget: what is lost where, from doubles to the integers of the core. */
#include "bounds/bounds.h"
#include "cli/cli.h"
#include "quant/quant.h"
#include <omp.h>
#include <stdlib.h>

typedef struct options {
  const char *model, *scene, *data, *split;
  uint64_t rays, samples, seed;
  int view, downscale, threads;
  double scale;
  bool json, quiet;
} options;

typedef struct budget {
  options opt;
  sf_model model;
  fx_scene scene;
  sf_dataset data;
  sf_budget_row row[SF_BUDGET_BLOCKS]; /* those that the scene's field has, or all without a scene */
  int rows;
  sf_picture_job job;
  sf_picture_budget picture;
  sf_progress progress;
} budget;

static sf_status measure_blocks(budget *b)
{
  for (int i = 0; i < SF_BUDGET_BLOCKS; i++) {
    if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "stopped after %d of %d blocks", i, SF_BUDGET_BLOCKS);
    if (b->opt.model && !sf_budget_has(b->scene.backbone, (sf_budget_id)i)) continue;
    const sf_budget_row row = b->row[b->rows++] = sf_budget_measure((sf_budget_id)i, b->opt.samples);
    sf_progress_show(&b->progress, "block %d of %d: %s", i + 1, SF_BUDGET_BLOCKS, row.block);
    if (row.ratio > 1)
      return sf_fail(SF_E_DIFFERENCE, "%s: error %g %s is %.3f times its bound", row.block, row.measured, row.unit,
                     row.ratio);
  }
  return sf_ok();
}

static bool tick(void *user, int done, int rows)
{
  budget *b = user;
  sf_progress_show(&b->progress, "picture %d of %d", done + 1, rows);
  return !sf_cli_interrupted();
}

/* Errors of the three files are found before the blocks are measured. */
static sf_status load_picture(budget *b)
{
  const options *o = &b->opt;
  const sf_dataset_options how = {.downscale = o->downscale, .scale = (float)o->scale, .limit = o->view + 1};
  SF_TRY(sf_model_load(&b->model, o->model));
  SF_TRY(fx_scene_load(&b->scene, o->scene));
  SF_TRY(sf_fx_dataset_load(&b->data, &b->scene, o->scene, o->data, o->split, &how));
  sf_dataset_warn(stderr, "error_budget", &b->data, NULL);
  if (o->view >= b->data.count)
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s has %d %s views", o->view, o->data, b->data.count,
                   o->split);
  b->job = (sf_picture_job){.model = &b->model,
                            .scene = &b->scene,
                            .data = &b->data,
                            .view = &b->data.view[o->view],
                            .name = o->scene,
                            .rays = o->rays,
                            .seed = o->seed,
                            .tick = tick,
                            .user = b};
  return sf_picture_budget_check(&b->job);
}

static sf_status print_json(const budget *b)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddItemToObject(json, "units", sf_budget_json(b->row, b->rows));
  if (b->opt.model) cJSON_AddItemToObject(json, "picture", sf_picture_budget_json(&b->picture));
  return sf_json_print(json, true);
}

static sf_status work(budget *b)
{
  if (b->opt.model) SF_TRY(load_picture(b));
  sf_progress_begin(&b->progress, b->opt.quiet);
  sf_status status = measure_blocks(b);
  if (status.code == SF_OK && b->opt.model) status = sf_picture_budget_make(&b->job, &b->picture);
  sf_progress_end(&b->progress);
  SF_TRY(status);
  if (b->opt.json) return print_json(b);
  sf_budget_print(stdout, b->row, b->rows);
  if (!b->opt.model) return sf_ok();
  printf("\n%s, view %s: %llu random rays, %llu samples\n\n", b->opt.scene, b->data.view[b->opt.view].name,
         (unsigned long long)b->picture.rays, (unsigned long long)b->picture.samples);
  sf_picture_budget_print(stdout, &b->picture);
  return sf_ok();
}

static sf_status parse(int argc, char **argv, options *o, sf_cli *cli)
{
  const sf_option table[] = {
      SF_GROUP("What is measured"),
      {"--samples", 0, SF_ARG_U64, &o->samples, 1, 1e10, NULL, "N",
       "inputs to try of a block that has too many to try all (default 1e6)"},
      {"--rays", 0, SF_ARG_U64, &o->rays, 1, 1e6, NULL, "N", "random rays of the view (default 1000)"},
      {"--view", 0, SF_ARG_INT, &o->view, 0, 1 << 20, NULL, "K", "which view of the split, from 0 (default 0)"},
      {"--split", 0, SF_ARG_STRING, &o->split, 0, 0, NULL, "NAME", "train or test (default test)"},
      SF_GROUP("What is printed"),
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      SF_GROUP("Tuning"),
      {"--downscale", 0, SF_ARG_INT, &o->downscale, 0, 64, NULL, "N",
       "views of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the scene's (default 0)"},
      {"--seed", 0, SF_ARG_U64, &o->seed, 0, 0, NULL, "S", "seed of the random rays (default 1)"},
      {"--threads", 0, SF_ARG_INT, &o->threads, 1, 1024, NULL, "N", "threads (default: all processors)"},
      {0}};
  const char *positional[3];
  cli->options = table;
  const sf_status status = sf_cli_parse(cli, argc, argv, positional);
  cli->options = NULL;
  SF_TRY(status);
  o->model = positional[0], o->scene = positional[1], o->data = positional[2];
  if (o->model && !o->data) return sf_fail(SF_E_USAGE, "missing argument; usage: %s", cli->usage);
  return sf_ok();
}

int main(int argc, char **argv)
{
  sf_cli cli = {
      .program = "error_budget",
      .usage = "error_budget [model.safetensors scene.snn DATA] [options]",
      .summary = "Error of each block of the fixed-point core against its derived bound (docs/fixed-point.md).\n"
                 "With a model (hash grid or TensoRF), its export and its pictures: the blocks of its field, and what\n"
                 "each costs, by computing one at a time in double precision.\n"
                 "Exit status 1 if an error is over its bound.",
      .examples = "  error_budget\n"
                  "  error_budget model.safetensors scene.snn data --view 3 --rays 4000 --json\n",
      .min_positional = 0,
      .max_positional = 3};
  budget *b = calloc(1, sizeof *b);
  if (!b) return sf_cli_finish(&cli, sf_fail(SF_E_MEMORY, "no memory"));
  b->opt = (options){.split = "test", .rays = 1000, .samples = 1000000, .seed = 1};
  sf_status status = parse(argc, argv, &b->opt, &cli);
  if (status.code == SF_OK) {
    if (b->opt.threads) omp_set_num_threads(b->opt.threads);
    sf_cli_catch_signals();
    status = work(b);
  }
  sf_dataset_free(&b->data);
  fx_scene_free(&b->scene);
  sf_model_free(&b->model);
  free(b);
  return sf_cli_finish(&cli, status);
}
