/* Quantises a trained model to the scene file of the fixed-point core, the accelerator and the firmware; writes vectors
 * of a scene for any simulator, its traces and graphs for other tools. */
#include "cli/cli.h"
#include "base/clock.h"
#include "fit/fit.h"
#include "quant/quant.h"
#include "tools/export/extras.h"
#include "tools/export/report.h"
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

typedef struct options {
  const char *output;
  export_options extra;
  int steps, background;
  uint64_t fit_rays, fit_bytes;
  const char *tech;
  double fit_loss;
  bool loss_given;
  sf_quant_widths widths;
  bool json, fit, quiet;
} options;

enum { FIT_RAYS = 262144, FIT_TILES = 24, KIT_SAMPLES = 48 };
static const double FIT_LOSS = 0.05;

static sf_status file_size(const char *path, long long *size)
{
  struct stat info;
  if (stat(path, &info)) return sf_fail(SF_E_IO, "%s: cannot be read back", path);
  *size = (long long)info.st_size;
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

/* What --fit tries after the default, each about a bit narrower than the one before. */
static const sf_quant_widths narrower[] = {{8, 11, 8, 7}, {8, 10, 7, 6}, {7, 10, 7, 6}, {6, 10, 7, 5}, {5, 9, 6, 5}};
enum { CANDIDATES = 1 + sizeof narrower / sizeof narrower[0] };

typedef struct candidates {
  fx_scene scene[CANDIDATES];
  sf_quant_report report[CANDIDATES];
  int count;
} candidates;

static sf_status quantise(const sf_model *model, const char *path, const options *o, const sf_quant_widths *widths,
                          candidates *c)
{
  const float grey = o->background == 0 ? 1 : 0;
  const sf_quant_options how = {
      .steps = o->steps, .background = {grey, grey, grey}, .seed = o->extra.seed, .widths = *widths};
  SF_TRY(sf_quantise_report(&c->scene[c->count], model, path, &how, &c->report[c->count]));
  c->count++;
  return sf_ok();
}

/* More candidates for the fit: narrower ones, where no widths were asked for or fine-tuned for. */
static sf_status quantise_narrower(const sf_model *model, const char *path, const options *o, candidates *c)
{
  const sf_quant_widths *w = &o->widths;
  const bool asked = w->weight_bits || w->feature_bits || w->leak_bits || w->grid_bits || model->scales.weight_bits;
  for (int i = 1; i < CANDIDATES && o->fit_loss > 0 && !asked && !o->fit_bytes; i++) {
    sf_quant_widths widths = narrower[i - 1];
    if (sf_model_decodes(model)) widths.feature_bits = SF_INPUT_BITS; /* a decoder's inputs have no other width */
    const sf_status status = quantise(model, path, o, &widths, c);
    if (status.code == SF_E_UNSUPPORTED) break; /* too narrow for this model */
    SF_TRY(status);
  }
  return sf_ok();
}

/* With --fit-bytes the field is made smaller first. --fit-loss, if it was given, is for both parts: the rest may lose
 * what the field left of it. */
static sf_status fit_both(candidates *c, const sf_fit_job *job, const options *o, fx_scene *fitted,
                          sf_fit_report *report)
{
  if (!o->fit_bytes) return sf_fit(fitted, job, report);
  sf_fit_job smaller = *job;
  fx_scene small;
  sf_fit_tables tables;
  smaller.loss_db = o->loss_given ? o->fit_loss : INFINITY;
  SF_TRY(sf_fit_to_bytes(&small, &smaller, o->fit_bytes, &tables));
  fx_scene_free(&c->scene[0]);
  c->scene[0] = small;
  smaller.loss_db = o->loss_given ? fmax(o->fit_loss - fmax(tables.loss_db, 0), 0) : o->fit_loss;
  SF_TRY(sf_fit(fitted, &smaller, report));
  report->tables = tables;
  return sf_ok();
}

/* The fitted scene and what its quantisation cost take the first place. */
static sf_status fit_to_rays(candidates *c, const sf_fit_rays *rays, const sf_fit_rays *tiles,
                             const sf_technology *technology, const options *o, sf_fit_report *report)
{
  fitting progress = {.begun = sf_seconds()};
  const fx_scene *candidate[CANDIDATES];
  sf_quant_widths widths[CANDIDATES];
  for (int i = 0; i < c->count; i++) candidate[i] = &c->scene[i], widths[i] = c->report[i].widths;
  const sf_fit_job job = {.candidate = candidate,
                          .widths = widths,
                          .candidates = c->count,
                          .rays = rays,
                          .tiles = tiles,
                          .technology = technology,
                          .loss_db = o->fit_loss,
                          .name = o->output,
                          .tick = fit_tick,
                          .user = &progress};
  fx_scene fitted;
  sf_progress_begin(&progress.progress, o->quiet);
  const sf_status status = fit_both(c, &job, o, &fitted, report);
  sf_progress_end(&progress.progress);
  if (status.code != SF_OK) return status;
  fx_scene_free(&c->scene[0]);
  c->scene[0] = fitted;
  c->report[0] = c->report[report->chosen];
  c->report[0].packed_bytes = (int64_t)report->after.bytes;
  return sf_ok();
}

/* The data first: what is wrong with it is said before the candidates' turn. */
static sf_status fit_scene(const sf_model *model, const char *path, candidates *c, const options *o,
                           sf_fit_report *report)
{
  sf_dataset data;
  sf_fit_rays rays, tiles = {0};
  sf_technology technology;
  SF_TRY(sf_technology_find(&technology, o->tech ? o->tech : "45nm"));
  SF_TRY(sf_fx_dataset_load(&data, &c->scene[0], path, o->extra.data, "train", &(sf_dataset_options){0}));
  sf_dataset_warn(stderr, "sf_export", &data, NULL);
  sf_status status = sf_fit_rays_draw(&rays, &data, c->scene[0].background, o->fit_rays, o->extra.seed);
  if (status.code == SF_OK) status = sf_fit_tiles_draw(&tiles, &data, FIT_TILES, o->extra.seed);
  sf_dataset_free(&data);
  if (status.code == SF_OK) status = quantise_narrower(model, path, o, c);
  if (status.code == SF_OK) status = fit_to_rays(c, &rays, &tiles, &technology, o, report);
  sf_fit_rays_free(&rays), sf_fit_rays_free(&tiles);
  return status;
}

/* ---- program ---- */

static sf_status flushed(void)
{
  return fflush(stdout) ? sf_fail(SF_E_IO, "standard output: the report was not written") : sf_ok();
}

static sf_status save_and_report(const fx_scene *scene, const options *o, const sf_quant_report *report,
                                 const sf_fit_report *fit, export_extras *more)
{
  long long bytes = 0;
  SF_TRY(fx_scene_save(scene, o->output));
  SF_TRY(file_size(o->output, &bytes));
  SF_TRY(export_extras_write(more, scene, o->output, &o->extra));
  if (o->json) {
    cJSON *json = export_report_json(scene, report, fit, o->output, bytes);
    export_extras_json(json, more, &o->extra);
    SF_TRY(sf_json_print(json, true));
  }
  if (!o->json) export_report_print(scene, report, fit, o->output, bytes);
  if (!o->json && fit) sf_fit_print(stdout, fit);
  if (!o->json) export_extras_print(more, &o->extra);
  return flushed();
}

/* A scene that is there: what is made of it alone. */
static sf_status export_beside(const char *path, const options *o)
{
  fx_scene scene;
  export_extras more;
  SF_TRY(fx_scene_load(&scene, path));
  sf_status status = export_extras_open(&more, &scene, path, &o->extra);
  if (status.code == SF_OK) status = export_extras_write(&more, &scene, path, &o->extra);
  export_extras_close(&more);
  fx_scene_free(&scene);
  SF_TRY(status);
  if (o->json) {
    cJSON *json = cJSON_CreateObject();
    export_extras_json(json, &more, &o->extra);
    SF_TRY(sf_json_print(json, true));
  } else
    export_extras_print(&more, &o->extra);
  return flushed();
}

static bool is_scene(const char *path)
{
  const size_t length = strlen(path);
  return length > 4 && !strcmp(path + length - 4, ".snn");
}

/* A float model as a graph of real numbers. */
static sf_status export_model_nir(const char *path, const options *o)
{
  sf_model model;
  SF_TRY(sf_model_load(&model, path));
  const sf_status status = sf_nir_write_model(o->extra.nir, &model);
  sf_model_free(&model);
  SF_TRY(status);
  const export_extras none = {0};
  if (o->json) {
    cJSON *json = cJSON_CreateObject();
    export_extras_json(json, &none, &o->extra);
    SF_TRY(sf_json_print(json, true));
  } else
    export_extras_print(&none, &o->extra);
  return flushed();
}

static sf_status export_from(const char *path, const options *o)
{
  const bool graph_alone = o->extra.nir && !o->extra.vectors && !o->extra.traces;
  return graph_alone && !is_scene(path) ? export_model_nir(path, o) : export_beside(path, o);
}

static sf_status fit_and_save(const sf_model *model, const char *path, candidates *c, const options *o,
                              export_extras *more)
{
  sf_fit_report fit;
  if (o->fit) SF_TRY(fit_scene(model, path, c, o, &fit));
  return save_and_report(&c->scene[0], o, &c->report[0], o->fit ? &fit : NULL, more);
}

static sf_status export_model(const sf_model *model, const char *path, const options *o, candidates *c)
{
  export_extras more;
  SF_TRY(quantise(model, path, o, &o->widths, c));
  sf_status status = export_extras_open(&more, &c->scene[0], path, &o->extra);
  if (status.code == SF_OK) status = fit_and_save(model, path, c, o, &more);
  export_extras_close(&more);
  return status;
}

static sf_status export_scene(const char *path, const options *o)
{
  sf_model model;
  if (o->fit) sf_cli_catch_signals();
  SF_TRY(sf_model_load(&model, path));
  candidates *c = calloc(1, sizeof *c);
  const sf_status status = c ? export_model(&model, path, o, c) : sf_fail(SF_E_MEMORY, "no memory");
  for (int i = 0; c && i < CANDIDATES; i++) fx_scene_free(&c->scene[i]);
  free(c);
  sf_model_free(&model);
  return status;
}

static sf_status only(bool given, const char *option, bool used, const char *by)
{
  return given && !used ? sf_fail(SF_E_USAGE, "%s needs %s", option, by) : sf_ok();
}

/* Options that nothing would read. */
static sf_status check_use(const options *o)
{
  const export_options *e = &o->extra;
  static const char *const output = "--output (-o) SCENE: nothing else is quantised";
  SF_TRY(only(o->steps, "--steps", o->output, output));
  SF_TRY(only(o->background >= 0, "--background", o->output, output));
  SF_TRY(only(o->widths.weight_bits, "--weight-bits", o->output, output));
  SF_TRY(only(o->widths.feature_bits, "--feature-bits", o->output, output));
  SF_TRY(only(o->widths.leak_bits, "--leak-bits", o->output, output));
  SF_TRY(only(o->widths.grid_bits, "--grid-bits", o->output, output));
  SF_TRY(only(o->fit_loss >= 0, "--fit-loss", o->fit, "--fit"));
  SF_TRY(only(o->fit_bytes, "--fit-bytes", o->fit, "--fit"));
  SF_TRY(only(o->fit_rays, "--fit-rays", o->fit, "--fit"));
  SF_TRY(only(o->tech, "--tech", o->fit, "--fit"));
  SF_TRY(only(e->data, "--data", o->fit || e->vectors || e->traces, "--fit, --vectors or --traces"));
  SF_TRY(only(e->seed, "--seed", o->output || e->vectors || e->traces, "--output (-o), --vectors or --traces"));
  SF_TRY(only(e->samples, "--samples", e->vectors, "--vectors"));
  SF_TRY(only(e->rays, "--rays", e->vectors || e->traces, "--vectors or --traces"));
  return only(e->view >= 0, "--view", e->traces, "--traces");
}

static sf_status check_options(const options *o)
{
  const bool extras = o->extra.vectors || o->extra.traces || o->extra.nir;
  if (o->extra.traces && !o->extra.data)
    return sf_fail(SF_E_USAGE, "--traces needs --data DATA: the views to draw rays from");
  if (o->extra.vectors && !o->extra.data)
    return sf_fail(SF_E_USAGE, "--vectors needs --data DATA: the views to draw rays from");
  if (o->extra.vectors) SF_TRY(sf_kit_check_folder(o->extra.vectors));
  if (!o->output && o->fit) return sf_fail(SF_E_USAGE, "--fit needs --output (-o) SCENE: nothing else is fitted");
  if (!o->output && !extras) return sf_fail(SF_E_USAGE, "--output (-o) SCENE is missing");
  if (o->fit && !o->extra.data) return sf_fail(SF_E_USAGE, "--fit needs --data DATA: the training views to fit to");
  return check_use(o);
}

static void set_defaults(options *o)
{
  if (o->background < 0) o->background = 0;
  o->loss_given = o->fit_loss >= 0;
  if (!o->loss_given) o->fit_loss = FIT_LOSS;
  if (!o->fit_rays) o->fit_rays = FIT_RAYS;
  if (!o->extra.samples) o->extra.samples = KIT_SAMPLES;
}

static int run(const sf_option *table, int argc, char **argv, options *o)
{
  const sf_cli cli = {.program = "sf_export",
                      .usage = "sf_export MODEL -o SCENE [--vectors DIR] [options]\n       sf_export SCENE --vectors "
                               "DIR --data DATA [options]\n       sf_export SCENE --traces DIR --data DATA [options]\n"
                               "       sf_export MODEL|SCENE --nir FILE",
                      .summary = "Quantises a trained model (model.safetensors) to integers for the fixed-point core,\n"
                                 "the accelerator and the firmware. Writes vectors, traces and graphs for other tools.",
                      .examples = "  sf_export model.safetensors -o scene.snn\n"
                                  "  sf_export model.safetensors -o short.snn --steps 2 --background black\n"
                                  "  sf_export model.safetensors -o small.snn --weight-bits 6 --grid-bits 6\n"
                                  "  sf_export model.safetensors -o small.snn --fit --data lego --fit-loss 0.05\n"
                                  "  sf_export model.safetensors -o board.snn --fit --data lego --fit-bytes 262144\n"
                                  "  sf_export scene.snn --vectors kit --data lego --samples 48 --seed 1\n"
                                  "  sf_export scene.snn --traces traces --data lego --view 0 --rays 20\n"
                                  "  sf_export scene.snn --nir scene.nir\n",
                      .options = table,
                      .min_positional = 1,
                      .max_positional = 1};
  const char *path = NULL;
  sf_status status = sf_cli_parse(&cli, argc, argv, &path);
  if (status.code == SF_OK) status = check_options(o);
  set_defaults(o);
  if (status.code == SF_OK) status = o->output ? export_scene(path, o) : export_from(path, o);
  return sf_cli_finish(&cli, status);
}

int main(int argc, char **argv)
{
  options o = {.background = -1, .fit_loss = -1, .extra = {.view = -1}}; /* and 0: not given */
  const sf_option table[] = {
      SF_GROUP("A scene"),
      {"--output", 'o', SF_ARG_OUTPUT, &o.output, 0, 0, NULL, "SCENE", "scene file to write (.snn)"},
      {"--steps", 0, SF_ARG_INT, &o.steps, 1, SF_T_MAX, NULL, "N",
       "unroll N time steps instead of the model's own t_r"},
      {"--background", 0, SF_ARG_CHOICE, &o.background, 0, 0, "white|black", "COLOUR",
       "colour behind the scene: white or black (default white)"},
      {"--seed", 0, SF_ARG_U64, &o.extra.seed, 0, 18446744073709551615.0, NULL, "S",
       "seed of the calibration samples, or of the rays and stalls of --vectors and --traces (default 0)"},
      SF_GROUP("Widths"),
      {"--weight-bits", 0, SF_ARG_INT, &o.widths.weight_bits, 2, SF_WEIGHT_BITS, NULL, "B", "bits of a weight"},
      {"--feature-bits", 0, SF_ARG_INT, &o.widths.feature_bits, 8, SF_INPUT_BITS, NULL, "B",
       "bits of the inputs of D1 and C1; hash grids alone"},
      {"--leak-bits", 0, SF_ARG_INT, &o.widths.leak_bits, 4, SF_LEAK_FRAC, NULL, "B", "fraction bits of a leak"},
      {"--grid-bits", 0, SF_ARG_INT, &o.widths.grid_bits, 2, SF_GRID_BITS, NULL, "B",
       "bits of an entry of the grid, or of planes and lines"},
      SF_GROUP("A smaller scene"),
      {"--fit", 0, SF_ARG_FLAG, &o.fit, 0, 0, NULL, NULL, "leave out what the training views of --data do not need"},
      {"--fit-loss", 0, SF_ARG_DOUBLE, &o.fit_loss, 0, 100, NULL, "DB",
       "PSNR that --fit may cost on rays of the training views; 0: only what changes no bit (default 0.05)"},
      {"--fit-bytes", 0, SF_ARG_U64, &o.fit_bytes, 1, 1e12, NULL, "N",
       "the field may take N bytes, as in a board's memory: halve tables and leave out levels, or components and "
       "points of planes, with the least loss, then fit the rest; --fit-loss is of both, or of the rest where it is "
       "not given"},
      {"--fit-rays", 0, SF_ARG_U64, &o.fit_rays, 256, 1e8, NULL, "N", "rays that --fit looks at (default 262144)"},
      {"--tech", 0, SF_ARG_INPUT, &o.tech, 0, 0, NULL, "FILE",
       "prices that say what --fit saves: a file or a name (default 45nm)"},
      SF_GROUP("For other tools"),
      {"--data", 0, SF_ARG_INPUT, &o.extra.data, 0, 0, NULL, "DATA", "data set for --fit, --vectors and --traces"},
      {"--vectors", 0, SF_ARG_PLACE, &o.extra.vectors, 0, 0, NULL, "DIR",
       "write programming, stimulus, everything expected, RTL and bench of the scene into DIR (docs/kit.md)"},
      {"--samples", 0, SF_ARG_INT, &o.extra.samples, 1, SF_KIT_SAMPLES_MAX, NULL, "N",
       "samples of --vectors (default 48)"},
      {"--rays", 0, SF_ARG_INT, &o.extra.rays, 1, 1e9, NULL, "N",
       "rays that --vectors draws from the test views at most (default 1000), and --traces (default 20)"},
      {"--traces", 0, SF_ARG_PLACE, &o.extra.traces, 0, 0, NULL, "DIR",
       "write spikes and membranes of random rays into DIR as SANA-FE does (docs/activity.md)"},
      {"--view", 0, SF_ARG_INT, &o.extra.view, 0, 1 << 20, NULL, "K",
       "test view of the rays of --traces (default: any)"},
      {"--nir", 0, SF_ARG_OUTPUT, &o.extra.nir, 0, 0, NULL, "FILE",
       "write the spiking nets as a NIR graph (HDF5); of a model real numbers, of a scene integers"},
      SF_GROUP("What is printed"),
      {"--quiet", 'q', SF_ARG_FLAG, &o.quiet, 0, 0, NULL, NULL, "no progress line"},
      {"--json", 0, SF_ARG_FLAG, &o.json, 0, 0, NULL, NULL, "print the report as JSON"},
      {0}};
  return run(table, argc, argv, &o);
}
