/* sf_train: learns a spiking radiance field and its time budget from posed images. */
#include "spikefield/cli.h"
#include "spikefield/io.h"
#include "spikefield/quant.h"
#include "spikefield/record.h"
#include "spikefield/train.h"
#include <errno.h>
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { OPTIONS_MAX = 64 };

typedef struct arguments {
  const char *output, *log, *summary, *fine_tune;
  sf_train_options train;
  double scale, theta, checkpoint_minutes, gamma;
  int bound, finest_res, background, downscale, threads, eval_views, prefix_views, limit, weight_bits;
  bool resume, quiet, json, no_hybrid, no_stage1, no_budget;
  int argc;
  char **argv;
  char *before[OPTIONS_MAX]; /* the program's name and what the run to resume was started with */
  int words;                 /* of it */
  cJSON *record;
} arguments;

/* Options that decide nothing of what is learned: a run may be resumed with others. */
static const char *const apart[] = {"--output", "--threads", "--eval-views", "--psnr-prefixes", "--checkpoint-minutes",
                                    "--resume", "--log",     "--summary",    "--json",          "--quiet",
                                    NULL};

static sf_cli make_cli(arguments *a, sf_option *o)
{
  sf_config *c = &a->train.config;
  sf_train_options *t = &a->train;
  const sf_option options[] = {
      {"--output", 'o', SF_ARG_OUTPUT, &a->output, 0, 0, NULL, "FILE", "model to write (default model.safetensors)"},
      {"--backbone", 0, SF_ARG_CHOICE, &c->backbone, 0, 0, "ingp|tensorf", "KIND",
       "hash grid, or TensoRF's planes and lines (default ingp)"},
      {"--minutes", 'm', SF_ARG_DOUBLE, &t->minutes, 0, 1e5, NULL, "M",
       "time budget, a quarter for stage I (default: iterations)"},
      {"--stage1", 0, SF_ARG_INT, &t->stage1, 0, 1e8, NULL, "N", "iterations of stage I (default 2500)"},
      {"--stage2", 0, SF_ARG_INT, &t->stage2, 0, 1e8, NULL, "N", "iterations of stage II (default 7500)"},
      {"--beta", 'b', SF_ARG_DOUBLE, &t->beta, 0, 1, NULL, "B",
       "quality (small) against energy (large) (default 5e-7, tensorf but for NDC 2e-6)"},
      {"--steps", 'T', SF_ARG_INT, &c->steps, 1, SF_T_MAX, NULL, "T", "time steps unrolled in training (default 8)"},
      {"--net", 0, SF_ARG_CHOICE, &c->net, 0, 0, "snn|ann", "KIND", "spiking nets or their ReLU twin (default snn)"},
      {"--input-mode", 0, SF_ARG_CHOICE, &c->mode, 0, 0, "hybrid|decay|no-decay", "MODE",
       "charging of the neurons (default hybrid)"},
      {"--seed", 's', SF_ARG_U64, &t->seed, 0, 9e15, NULL, "S", "same seed, same bits, any thread count (default 1)"},
      {"--threads", 'j', SF_ARG_INT, &a->threads, 0, 1024, NULL, "N", "threads, 0 = all (default 0)"},
      {"--samples", 0, SF_ARG_INT, &t->samples, 256, 1 << 22, NULL, "N",
       "samples per iteration, about (default 16384, tensorf 32768)"},
      {"--rays", 0, SF_ARG_INT, &t->rays, 64, 1 << 15, NULL, "N", "tensorf: rays per iteration at most (default 4096)"},
      {"--voxels", 0, SF_ARG_INT, &t->voxels, 16, 1024, NULL, "N",
       "tensorf: the finest grid has N^3 voxels (default half the pictures' width, at most 300; NDC: 0.63 of it, at "
       "most "
       "640)"},
      {"--lr-grid", 0, SF_ARG_DOUBLE, &t->lr_grid, 1e-8, 10, NULL, "R",
       "Adam's rate for the field (default 1e-2, tensorf 2e-2)"},
      {"--lr-net", 0, SF_ARG_DOUBLE, &t->lr_net, 1e-8, 10, NULL, "R",
       "Adam's rate for nets and leaks (default 5e-3, tensorf 1e-3)"},
      {"--levels", 0, SF_ARG_INT, &c->levels, 1, 16, NULL, "L", "levels of the hash grid (default 16)"},
      {"--log2-hash", 0, SF_ARG_INT, &c->log2_hash, 4, 24, NULL, "N", "log2 of a level's entries (default 19)"},
      {"--base-res", 0, SF_ARG_INT, &c->base_res, 2, 4096, NULL, "N", "resolution of the coarsest level (default 16)"},
      {"--finest-res", 0, SF_ARG_INT, &a->finest_res, 2, 32768, NULL, "N",
       "resolution of the finest level (default a pixel of the pictures, at most 2048 x bound and 32768)"},
      {"--hidden", 0, SF_ARG_INT, &c->hidden, 16, SF_LANES, NULL, "N",
       "neurons of a spiking layer, multiple of 16 (default 128)"},
      {"--theta", 0, SF_ARG_DOUBLE, &a->theta, 1e-3, 1e3, NULL, "V", "firing threshold (default 0.25, tensorf 0.5)"},
      {"--lattice", 0, SF_ARG_INT, &c->lattice, 16, 1024, NULL, "N",
       "the shortest step is the diagonal of a box of bound 1 divided by this, at the finest (default 1024)"},
      {"--bound", 0, SF_ARG_INT, &a->bound, 0, 64, NULL, "B",
       "the box is [-B, B]^3 model units, B = 1, 2, 4, ... 64; 0 = the data's (default 0)"},
      {"--dt-gamma", 0, SF_ARG_DOUBLE, &a->gamma, -1, 0.125, NULL, "G",
       "steps grow to distance * G, 0 = not at all; -1: 1/128 where the bound is above 1, else 0 (default -1)"},
      {"--occ-res", 0, SF_ARG_INT, &c->occ_res, 8, 256, NULL, "N",
       "occupancy cells per axis, power of two (default 128)"},
      {"--scale", 0, SF_ARG_DOUBLE, &a->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the layout's (default 0)"},
      {"--downscale", 'd', SF_ARG_INT, &a->downscale, 1, 64, NULL, "F", "box-filter the images by F (default 1)"},
      {"--limit", 0, SF_ARG_INT, &a->limit, 0, 1e6, NULL, "N", "use the first N training views, 0 = all (default 0)"},
      {"--background", 0, SF_ARG_CHOICE, &a->background, 0, 0, "auto|random|white|black", "KIND",
       "behind transparent pixels and rays that leave the box; auto: random, but white for tensorf on pictures with "
       "alpha (default auto)"},
      {"--no-stage1", 0, SF_ARG_FLAG, &a->no_stage1, 0, 0, NULL, NULL, "ablation: all iterations in stage II"},
      {"--no-extra", 0, SF_ARG_FLAG, &t->no_extra, 0, 0, NULL, NULL, "ablation: without L_extra"},
      {"--no-penalty", 0, SF_ARG_FLAG, &t->no_penalty, 0, 0, NULL, NULL, "ablation: without L_penalty"},
      {"--no-budget", 0, SF_ARG_FLAG, &a->no_budget, 0, 0, NULL, NULL, "ablation: without both (L_budg)"},
      {"--no-distill", 0, SF_ARG_FLAG, &t->no_distill, 0, 0, NULL, NULL, "ablation: without L_distill"},
      {"--no-scaling", 0, SF_ARG_FLAG, &t->no_scaling, 0, 0, NULL, NULL, "ablation: without max time-step scaling"},
      {"--fixed-steps", 0, SF_ARG_INT, &t->fixed_steps, 0, SF_T_MAX, NULL, "N",
       "stage II trains the prefix of N steps alone, t* = N, without L_budg; 0 = t* is learned (default 0)"},
      {"--fine-tune", 0, SF_ARG_STRING, &a->fine_tune, 0, 0, NULL, "MODEL",
       "start from this trained model, at its t_r, with weights rounded as sf_export does; stage II alone"},
      {"--weight-bits", 0, SF_ARG_INT, &a->weight_bits, 2, SF_WEIGHT_BITS, NULL, "B",
       "of --fine-tune: bits of a weight (default 8)"},
      {"--eval-views", 0, SF_ARG_INT, &a->eval_views, 0, 1e6, NULL, "N",
       "test views rendered at the end, 0 = all (default 0)"},
      {"--psnr-prefixes", 0, SF_ARG_INT, &a->prefix_views, 0, 1e6, NULL, "N",
       "PSNR at every prefix 1..T over N test views, 0 = off (default 0)"},
      {"--checkpoint-minutes", 0, SF_ARG_DOUBLE, &a->checkpoint_minutes, 0, 1e5, NULL, "M",
       "time between checkpoints (default 2)"},
      {"--resume", 'r', SF_ARG_FLAG, &a->resume, 0, 0, NULL, NULL,
       "continue from the checkpoint at --output, with the options of its run"},
      {"--log", 0, SF_ARG_PLACE, &a->log, 0, 0, NULL, "FILE",
       "JSON lines, one per 16 iterations (default OUTPUT.jsonl)"},
      {"--summary", 0, SF_ARG_OUTPUT, &a->summary, 0, 0, NULL, "FILE", "write the closing summary there as JSON, too"},
      {"--json", 0, SF_ARG_FLAG, &a->json, 0, 0, NULL, NULL, "print the closing summary as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &a->quiet, 0, 0, NULL, NULL, "no progress line"},
      {0}};
  memcpy(o, options, sizeof options);
  return (sf_cli){.program = "sf_train",
                  .usage = "sf_train DATA [-o model.safetensors] [options]",
                  .summary =
                      "Learns a spiking radiance field and, with it, how many time steps the scene needs (PATA).\n"
                      "DATA is a folder of posed pictures in the Blender, LLFF, COLMAP or instant-ngp layout; sf_data "
                      "says what is\n"
                      "understood of it.",
                  .examples = "  sf_train scene -o model.safetensors --minutes 2\n"
                              "  sf_train lego -o lego.safetensors --minutes 10 --beta 1e-6\n"
                              "  sf_train lego -o lego.safetensors --resume\n"
                              "  sf_train lego -o twin.safetensors --net ann --minutes 10\n"
                              "  sf_train lego -o vm.safetensors --backbone tensorf --minutes 30\n"
                              "  sf_train lego -o four.safetensors --fine-tune lego.safetensors --weight-bits 4\n",
                  .options = o,
                  .min_positional = 1,
                  .max_positional = 1};
}

static double psnr_of(double mse)
{
  return mse > 0 ? -10 * log10(mse) : 99;
}

static void log_line(FILE *log, const sf_train_stats *s)
{
  fprintf(log,
          "{\"iteration\":%lld,\"stage\":%d,\"seconds\":%.3f,\"loss\":%.9g,\"mse\":%.9g,\"mse_full\":%.9g,"
          "\"mse_floor\":%.9g,\"mse_ceil\":%.9g,\"psnr\":%.4f,\"t_star\":%.6f,\"t_r\":%d,\"rays\":%d,\"samples\":%d,"
          "\"lattice\":%d,"
          "\"occupied\":%.6f,\"tau\":[%.5f,%.5f,%.5f,%.5f,%.5f],\"firing\":[%.5f,%.5f,%.5f],\"quiet\":[%d,%d,%d],"
          "\"revived\":[%d,%d,%d]}\n",
          (long long)s->iteration, s->stage, s->seconds, s->loss, s->mse, s->mse_full, s->mse_floor, s->mse_ceil,
          psnr_of(s->mse), s->t_star, s->t_r, s->rays, s->samples, s->lattice, s->occupied, s->tau[0], s->tau[1],
          s->tau[2], s->tau[3], s->tau[4], s->firing[0], s->firing[1], s->firing[2], s->quiet[0], s->quiet[1],
          s->quiet[2], s->revived[0], s->revived[1], s->revived[2]);
}

/* Averages for the eye; the log has the raw values. */
typedef struct recent {
  double mse, loss, rate;
} recent;

static void smooth(recent *r, const sf_train_stats *s, double step)
{
  const double keep = r->mse > 0 ? 0.95 : 0;
  r->mse = keep * r->mse + (1 - keep) * s->mse;
  r->loss = keep * r->loss + (1 - keep) * s->loss;
  r->rate = keep * r->rate + (1 - keep) * s->samples / fmax(step, 1e-9);
}

static void show(sf_progress *p, const sf_train_stats *s, const recent *r)
{
  const double left = s->progress > 1e-6 ? s->seconds * (1 - s->progress) / s->progress : 0;
  sf_progress_show(p,
                   "stage %s %5.1f%%  iteration %lld  %.0fk samples/s  loss %.5f  PSNR %.2f dB  t* %.2f  firing %.2f "
                   "%.2f %.2f  ETA %d:%02d",
                   s->stage == 1 ? "I " : "II", 100 * s->progress, (long long)s->iteration, r->rate / 1e3, r->loss,
                   psnr_of(r->mse), s->t_star, s->firing[0], s->firing[1], s->firing[2], (int)left / 60,
                   (int)left % 60);
}

static void warn(sf_progress *progress, const sf_train_stats *s)
{
  static const char *const layer[] = {"D1", "C1", "C2"};
  for (int l = 0; l < 3; l++)
    if (s->event[l]) {
      sf_progress_end(progress);
      fprintf(stderr, "sf_train: warning: iteration %lld: the neurons of %s %s: brought back to the threshold\n",
              (long long)s->iteration, layer[l], s->event[l] < 0 ? "were silent" : "fired all the time");
    }
}

/* A disk that is full now may not be later: only what must be saved now has to be. good: one was saved. */
static sf_status checkpoint(const sf_trainer *trainer, const arguments *a, bool now, sf_progress *progress, bool *good)
{
  const sf_status status = sf_trainer_save(trainer, a->output, true);
  if (!status.code) *good = true;
  if (now || status.code != SF_E_IO) return status;
  sf_progress_end(progress);
  fprintf(stderr, "sf_train: warning: %s: no checkpoint, the run goes on\n", status.message);
  return sf_ok();
}

static sf_status loop(sf_trainer *trainer, const arguments *a, FILE *log, sf_train_stats *s)
{
  sf_progress progress;
  recent r = {0};
  double tried = sf_seconds();
  bool good = a->resume;
  sf_progress_begin(&progress, a->quiet);
  do {
    const double before = s->seconds;
    sf_status status = sf_trainer_step(trainer, s);
    if (status.code) {
      sf_progress_end(&progress);
      return good ? sf_fail(status.code, "%s (last good checkpoint: %s)", status.message, a->output) : status;
    }
    smooth(&r, s, s->seconds - before);
    warn(&progress, s);
    if (s->iteration % 16 == 0 || s->stage == 3) log_line(log, s);
    if (sf_progress_due(&progress)) show(&progress, s, &r);
    const bool stop = sf_cli_interrupted() && s->stage != 3;
    if (s->stage != 3 && (stop || sf_seconds() - tried > 60 * a->checkpoint_minutes)) {
      SF_TRY(checkpoint(trainer, a, stop, &progress, &good));
      tried = sf_seconds();
    }
    if (stop) {
      sf_progress_end(&progress);
      return sf_fail(SF_E_STOPPED, "interrupted at iteration %lld; continue with --resume (checkpoint: %s)",
                     (long long)s->iteration, a->output);
    }
  } while (s->stage != 3);
  show(&progress, s, &r);
  sf_progress_end(&progress);
  return ferror(log) ? sf_fail(SF_E_IO, "%s: cannot write the log", a->log) : sf_ok();
}

/* Held-out quality at the end. */
typedef struct quality {
  double psnr, ssim, prefix[SF_T_MAX];
  int views, prefixes;
  const char *layout; /* of the data */
} quality;

static cJSON *make_summary(const arguments *a, const sf_config *c, const sf_train_stats *s, const quality *q)
{
  static const char *const net[] = {"snn", "ann"}, *const mode[] = {"hybrid", "decay", "no-decay"};
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "model", a->output);
  cJSON_AddStringToObject(json, "backbone", c->backbone == SF_TENSORF ? "tensorf" : "ingp");
  cJSON_AddStringToObject(json, "layout", q->layout);
  cJSON_AddStringToObject(json, "net", net[c->net]);
  cJSON_AddStringToObject(json, "mode", mode[c->mode]);
  cJSON_AddNumberToObject(json, "beta", a->train.beta);
  cJSON_AddNumberToObject(json, "seed", (double)a->train.seed);
  cJSON_AddNumberToObject(json, "iterations", (double)s->iteration);
  cJSON_AddNumberToObject(json, "seconds", s->seconds);
  cJSON_AddNumberToObject(json, "samples_per_second", s->samples_per_second);
  cJSON_AddNumberToObject(json, "T", c->steps);
  cJSON_AddNumberToObject(json, "t_r", s->t_r);
  cJSON_AddNumberToObject(json, "t_star", s->t_star);
  if (c->backbone == SF_INGP) cJSON_AddNumberToObject(json, "lattice", c->lattice);
  cJSON_AddItemToObject(json, "tau", cJSON_CreateDoubleArray(s->tau, SF_LAYERS));
  cJSON_AddItemToObject(json, "firing", cJSON_CreateDoubleArray(s->firing, 3));
  cJSON_AddItemToObject(json, "quiet", cJSON_CreateIntArray(s->quiet, 3));
  cJSON_AddItemToObject(json, "revived", cJSON_CreateIntArray(s->revived, 3));
  cJSON_AddNumberToObject(json, "psnr", q->psnr);
  cJSON_AddNumberToObject(json, "ssim", q->ssim);
  cJSON_AddNumberToObject(json, "views", q->views);
  if (q->prefixes) cJSON_AddItemToObject(json, "prefix_psnr", cJSON_CreateDoubleArray(q->prefix, q->prefixes));
  return json;
}

static sf_status print_json(const cJSON *json, const char *model)
{
  char *text = cJSON_PrintUnformatted(json);
  if (!text) return sf_fail(SF_E_MEMORY, "%s: no memory for the summary", model);
  puts(text);
  free(text);
  return sf_ok();
}

static void print_text(const arguments *a, const sf_config *c, const sf_train_stats *s, const quality *q)
{
  printf(
      "%s: %lld iterations in %.0f s; t_r = %d of T = %d (t* = %.2f); held-out PSNR %.2f dB, SSIM %.4f over %d views\n",
      a->output, (long long)s->iteration, s->seconds, s->t_r, c->steps, s->t_star, q->psnr, q->ssim, q->views);
  if (c->backbone == SF_INGP)
    printf("%s: samples lie 2 sqrt(3) / %d apart%s\n", a->output, c->lattice,
           c->dt_gamma > 0 ? " near the camera" : "");
  if (!q->prefixes) return;
  printf("%s: PSNR at 1..%d steps:", a->output, q->prefixes);
  for (int i = 0; i < q->prefixes; i++) printf(" %.2f", q->prefix[i]);
  printf(" dB\n");
}

/* View by view, so that it shows where it is and stops when asked to. */
static sf_status evaluate_views(const sf_model *model, const sf_dataset *test, const arguments *a, quality *q)
{
  sf_progress progress;
  sf_status status = sf_ok();
  sf_progress_begin(&progress, a->quiet);
  for (int v = 0, used = 0, prefixed = 0; v < test->count && !status.code; v++) {
    const bool whole = !a->eval_views || used < a->eval_views, prefixes = prefixed < a->prefix_views;
    if (!test->view[v].image.rgba || (!whole && !prefixes)) continue;
    if (sf_cli_interrupted()) {
      status =
          sf_fail(SF_E_STOPPED, "interrupted in the evaluation; continue with --resume (checkpoint: %s)", a->output);
      break;
    }
    if (sf_progress_due(&progress)) sf_progress_show(&progress, "evaluation: view %d of %d", v + 1, test->count);
    sf_dataset one = *test;
    one.view = &test->view[v];
    one.count = 1;
    double psnr = 0, ssim = 0, prefix[SF_T_MAX];
    if (whole) {
      status = sf_evaluate(model, &one, 1, 0, &psnr, &ssim);
      used = ++q->views;
      q->psnr += (psnr - q->psnr) / used;
      q->ssim += (ssim - q->ssim) / used;
    }
    if (prefixes && !status.code) {
      q->prefixes = model->config.steps;
      status = sf_evaluate_prefixes(model, &one, 1, prefix);
      prefixed++;
      for (int i = 0; i < q->prefixes && !status.code; i++) q->prefix[i] += (prefix[i] - q->prefix[i]) / prefixed;
    }
  }
  sf_progress_end(&progress);
  if (!status.code && !q->views) status = sf_fail(SF_E_FORMAT, "%s: no view with a picture to evaluate on", test->path);
  return status;
}

static sf_status load_test(sf_dataset *test, const char *data_path, const sf_dataset_options *how, const arguments *a,
                           bool cameras_only)
{
  sf_dataset_options options = *how;
  options.limit = !a->eval_views || a->eval_views > a->prefix_views ? a->eval_views : a->prefix_views;
  options.cameras_only = cameras_only;
  return sf_dataset_load(test, data_path, "test", &options);
}

/* The faults of what is evaluated on, before anything is learned. */
static sf_status check_test(const sf_dataset *data, const char *data_path, const sf_dataset_options *how,
                            const arguments *a)
{
  sf_dataset test;
  SF_TRY(load_test(&test, data_path, how, a, true));
  sf_dataset_warn(stderr, "sf_train", &test);
  const sf_status status = sf_dataset_agree(data, &test);
  sf_dataset_free(&test);
  return status;
}

static sf_status evaluate(const sf_model *model, const char *data_path, const sf_dataset_options *how,
                          const arguments *a, quality *q)
{
  sf_dataset test;
  SF_TRY(load_test(&test, data_path, how, a, false));
  q->layout = sf_layout_names[test.layout];
  sf_status status = evaluate_views(model, &test, a, q);
  sf_dataset_free(&test);
  return status;
}

static sf_status finish(const sf_trainer *trainer, const char *data_path, const sf_dataset_options *how,
                        const arguments *a, const sf_train_stats *s)
{
  const sf_model *model = sf_trainer_model(trainer);
  quality q = {0};
  SF_TRY(evaluate(model, data_path, how, a, &q));
  cJSON *json = make_summary(a, &model->config, s, &q);
  sf_status status = a->summary ? sf_json_save(json, a->summary) : sf_ok();
  if (!status.code && a->json)
    status = print_json(json, a->output);
  else if (!status.code)
    print_text(a, &model->config, s, &q);
  cJSON_Delete(json);
  return status;
}

static sf_status train_and_report(const char *path, const sf_dataset *data, const sf_dataset_options *how,
                                  const arguments *a, FILE *log)
{
  sf_trainer *trainer;
  SF_TRY(sf_trainer_create(&trainer, data, &a->train, a->resume ? a->output : NULL));
  sf_train_stats stats = sf_trainer_stats(trainer);
  sf_status status = sf_ok();
  if (stats.stage != 3) {
    status = loop(trainer, a, log, &stats);
    if (!status.code) status = sf_trainer_save(trainer, a->output, true); /* the evaluation can be interrupted, too */
  }
  if (!status.code) status = finish(trainer, path, how, a, &stats);
  if (!status.code) status = sf_trainer_save(trainer, a->output, false);
  sf_trainer_free(trainer);
  return status;
}

/* The model to fine-tune, with the scales that sf_export would choose for it. */
static sf_status load_start(const arguments *a, float scale, sf_model *model)
{
  const sf_quant_options how = {.widths.weight_bits = a->weight_bits ? a->weight_bits : SF_WEIGHT_BITS};
  sf_quant_report report;
  fx_scene scene;
  SF_TRY(sf_model_load(model, a->fine_tune));
  if (model->config.backbone == SF_TENSORF) {
    sf_model_free(model);
    return sf_fail(SF_E_UNSUPPORTED, "%s: --fine-tune knows the hash grid's nets only, the model is of tensorf",
                   a->fine_tune);
  }
  sf_status status = sf_quantise_report(&scene, model, a->fine_tune, &how, &report);
  if (!status.code) {
    fx_scene_free(&scene);
    model->scales = report.scales;
    if (fabsf(model->config.scale - scale) > 1e-6f * scale)
      status = sf_fail(SF_E_RANGE, "%s: metadata 'scale' is %g, the data has %g (see --scale)", a->fine_tune,
                       (double)model->config.scale, (double)scale);
  }
  if (status.code) sf_model_free(model);
  return status;
}

/* The box, the steps through it and the finest level, but for what was asked for. A level finer than the pixels costs
 * time and learns noise. Without data: what the options alone say. */
static void set_box(arguments *a, const sf_dataset *data)
{
  sf_config *c = &a->train.config;
  sf_config_bound(c, a->bound ? a->bound : data ? data->bound : 1);
  const int pixels = data ? sf_dataset_pixels(data, c->bound) : c->finest_res;
  if (pixels < c->finest_res) c->finest_res = pixels > c->base_res ? pixels : c->base_res;
  if (a->finest_res) c->finest_res = a->finest_res;
  if (a->gamma >= 0) c->dt_gamma = (float)a->gamma;
}

static bool any_transparent(const sf_dataset *data)
{
  for (int v = 0; v < data->count; v++) {
    const sf_image *image = &data->view[v].image;
    const size_t n = image->rgba ? (size_t)image->width * (size_t)image->height : 0;
    for (size_t i = 0; i < n; i++)
      if (image->rgba[4 * i + 3] < 65535) return true;
  }
  return false;
}

/* What follows from the data. */
static void settle(arguments *a, const sf_dataset *data)
{
  static const char *const name[] = {"random", "white", "black"};
  const sf_config *c = &a->train.config;
  const bool vm = c->backbone == SF_TENSORF;
  a->train.config.scale = data->scale;
  if (!vm) set_box(a, data);
  a->train.background = a->background ? a->background - 1 : vm && any_transparent(data) ? 1 : 0;
  if (a->quiet || a->json || vm) return;
  printf("box [-%d, %d]^3, %d occupancy grid%s, ", c->bound, c->bound, sf_config_cascades(c), c->bound > 1 ? "s" : "");
  if (c->dt_gamma > 0)
    printf("steps of distance / %g", 1 / (double)c->dt_gamma);
  else
    printf("equal steps");
  printf(", finest level %d, background %s\n", c->finest_res, name[a->train.background]);
  fflush(stdout);
}

static bool named(const char *const *list, const char *name)
{
  while (*list && strcmp(*list, name) != 0) list++;
  return *list;
}

/* Is the option among the command line's words? */
static bool given(const arguments *a, const sf_option *o)
{
  const size_t length = strlen(o->name);
  for (int i = 1; i < a->argc && strcmp(a->argv[i], "--") != 0; i++) {
    const char *word = a->argv[i];
    if (!strncmp(word, o->name, length) && (!word[length] || word[length] == '=')) return true;
    if (o->letter && word[0] == '-' && word[1] == o->letter) return true;
  }
  return false;
}

/* What only the other backbone has, and what a model to fine-tune has settled. */
static sf_status check_effect(arguments *a)
{
  static const char *const grid[] = {"--levels",  "--log2-hash", "--base-res", "--finest-res",
                                     "--lattice", "--bound",     "--dt-gamma", NULL};
  static const char *const planes[] = {"--rays", "--voxels", NULL};
  static const char *const settled[] = {"--net",     "--steps",       "--input-mode", "--hidden", "--theta",
                                        "--occ-res", "--fixed-steps", "--stage1",     NULL};
  const bool tensorf = a->train.config.backbone == SF_TENSORF;
  sf_option options[OPTIONS_MAX];
  make_cli(a, options);
  for (const sf_option *o = options; o->name; o++) {
    if (!given(a, o)) continue;
    if (named(tensorf ? grid : planes, o->name))
      return sf_fail(SF_E_USAGE, "%s has no effect on --backbone %s", o->name, tensorf ? "tensorf" : "ingp");
    if (a->fine_tune && (named(grid, o->name) || named(settled, o->name)))
      return sf_fail(SF_E_USAGE, "%s has no effect beside --fine-tune: the model has its own", o->name);
  }
  return sf_ok();
}

/* What follows from the options, once they are parsed. */
static sf_status finish_options(arguments *a)
{
  sf_config *c = &a->train.config;
  if (c->net == SF_NET_ANN) c->steps = 1;
  for (int i = 0; i < 3; i++) c->theta[i] = (float)a->theta;
  if (a->no_budget) a->train.no_extra = a->train.no_penalty = true;
  if (a->no_stage1) a->train.stage2 += a->train.stage1, a->train.stage1 = 0;
  if (a->train.fixed_steps > c->steps)
    return sf_fail(SF_E_USAGE, "--fixed-steps %d is more than T = %d", a->train.fixed_steps, c->steps);
  if (a->weight_bits && !a->fine_tune) return sf_fail(SF_E_USAGE, "--weight-bits needs --fine-tune MODEL");
  if (a->fine_tune && c->backbone == SF_TENSORF)
    return sf_fail(SF_E_USAGE, "--fine-tune knows the hash grid's nets only");
  return sf_ok();
}

/* The command line on top of what the run was started with, if that is known. */
static sf_status parse(arguments *a, const char **path)
{
  sf_option options[OPTIONS_MAX];
  sf_cli cli = make_cli(a, options);
  cli.min_positional = 0;
  SF_TRY(sf_cli_parse(&cli, a->words, a->before, path));
  cli.min_positional = 1;
  SF_TRY(sf_cli_parse(&cli, a->argc, a->argv, path));
  cJSON_Delete(a->record);
  a->train.record = a->record = sf_record_make(options, apart);
  return a->record ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for the options");
}

/* The options of the run at --output; other ones on the command line would make another run of it. */
static sf_status restore(arguments *a, const char **path)
{
  sf_tensors set;
  sf_option options[OPTIONS_MAX];
  make_cli(a, options);
  SF_TRY(sf_tensors_load(&set, a->output));
  sf_status status = sf_record_words(&set, options, apart, a->before, &a->words, OPTIONS_MAX);
  if (!status.code) status = parse(a, path);
  if (status.code == SF_E_USAGE) status = sf_fail(SF_E_FORMAT, "%s: cannot resume: %s", a->output, status.message);
  if (!status.code) status = sf_record_compare(&set, a->record);
  sf_tensors_free(&set);
  return status;
}

/* TensoRF's defaults depend on the data: the options once more, on top of them. */
static sf_status take_tensorf_defaults(arguments *a, const sf_dataset *data)
{
  a->train = sf_train_defaults_tensorf(data);
  a->theta = (double)a->train.config.theta[0];
  const char *path[1];
  SF_TRY(parse(a, path));
  SF_TRY(finish_options(a));
  return sf_config_check(&a->train.config);
}

static sf_status run(arguments *a, const char *path)
{
  char log_path[4096];
  if (!a->log) snprintf(log_path, sizeof log_path, "%s.jsonl", a->output), a->log = log_path;
  sf_dataset data;
  const sf_dataset_options how = {.downscale = a->downscale, .scale = (float)a->scale, .limit = a->limit};
  SF_TRY(sf_dataset_load(&data, path, "train", &how));
  sf_dataset_warn(stderr, "sf_train", &data);
  sf_model start = {0};
  sf_status status = check_test(&data, path, &how, a);
  if (!status.code && a->train.config.backbone == SF_TENSORF) status = take_tensorf_defaults(a, &data);
  if (!status.code) settle(a, &data);
  if (!status.code && a->fine_tune && !a->resume) {
    status = load_start(a, data.scale, &start);
    a->train.start = &start;
  }
  FILE *log = status.code ? NULL : fopen(a->log, a->resume ? "a" : "w");
  if (!status.code)
    status = log ? sf_ok() : sf_fail(SF_E_IO, "%s: cannot open the log for writing: %s", a->log, strerror(errno));
  if (log) setvbuf(log, NULL, _IOLBF, 0);
  if (!status.code) status = train_and_report(path, &data, &how, a, log);
  if (log && fclose(log) && !status.code) status = sf_fail(SF_E_IO, "%s: cannot write the log", a->log);
  sf_model_free(&start);
  sf_dataset_free(&data);
  return status;
}

static sf_status start(arguments *a, const char **path)
{
  SF_TRY(parse(a, path));
  if (a->resume) SF_TRY(restore(a, path));
  SF_TRY(check_effect(a));
  if (a->threads) omp_set_num_threads(a->threads);
  SF_TRY(finish_options(a));
  sf_cli_catch_signals();
  set_box(a, NULL);
  if (a->train.config.backbone == SF_TENSORF) return sf_ok();
  sf_status status = sf_config_check(&a->train.config);
  if (status.code == SF_E_RANGE) status.code = SF_E_USAGE;
  return status;
}

int main(int argc, char **argv)
{
  arguments a = {.output = "model.safetensors",
                 .train = sf_train_defaults(),
                 .downscale = 1,
                 .checkpoint_minutes = 2,
                 .gamma = -1,
                 .argc = argc,
                 .argv = argv,
                 .before = {argv[0]},
                 .words = 1};
  a.theta = (double)a.train.config.theta[0];
  sf_option options[OPTIONS_MAX];
  const sf_cli cli = make_cli(&a, options);
  const char *path[1] = {NULL};
  sf_status status = start(&a, path);
  if (!status.code) status = run(&a, path[0]);
  for (int i = 1; i < a.words; i++) free(a.before[i]);
  cJSON_Delete(a.record);
  return sf_cli_finish(&cli, status);
}
