#include "tools/train/options.h"
#include "base/io.h"
#include "cli/record.h"
#include "field/field.h"
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Options that decide nothing of what is learned: a run may be resumed with others. */
static const char *const apart[] = {"--output", "--threads", "--eval-views", "--psnr-prefixes", "--checkpoint-minutes",
                                    "--resume", "--log",     "--summary",    "--json",          "--quiet",
                                    NULL};

sf_cli train_cli(train_arguments *a, sf_option *o)
{
  sf_config *c = &a->train.config;
  sf_train_options *t = &a->train;
  const sf_option options[] = {
      {"--output", 'o', SF_ARG_OUTPUT, &a->output, 0, 0, NULL, "FILE", "model to write (default model.safetensors)"},
      {"--backbone", 0, SF_ARG_CHOICE, &c->backbone, 0, 0, "ingp|tensorf", "KIND",
       "hash grid, or TensoRF's planes and lines (default ingp)"},
      {"--minutes", 'm', SF_ARG_DOUBLE, &t->minutes, 0, 1e5, NULL, "M",
       "time to learn, a quarter of it for stage I (default: iterations); loading and evaluation are not counted"},
      {"--stage1", 0, SF_ARG_INT, &t->stage1, 0, 1e8, NULL, "N", "iterations of stage I (default 2500)"},
      {"--stage2", 0, SF_ARG_INT, &t->stage2, 0, 1e8, NULL, "N", "iterations of stage II (default 7500)"},
      {"--beta", 'b', SF_ARG_DOUBLE, &t->beta, 0, 1, NULL, "B",
       "quality (small) against energy (large) (default 5e-7)"},
      {"--price", 0, SF_ARG_CHOICE, &t->price, 0, 0, "exponential|energy", "KIND",
       "what beta weighs: e^t, as the paper, or what one more step costs here, mJ per frame (default exponential)"},
      {"--target-loss", 0, SF_ARG_DOUBLE, &t->target_loss, 0, 20, NULL, "DB",
       "in place of --beta: the fewest steps that are at most so far behind the best number of steps"},
      {"--target-saving", 0, SF_ARG_DOUBLE, &t->target_saving, 0, 100, NULL, "PERCENT",
       "in place of --beta: the most steps that save so much of the ReLU twin's energy"},
      {"--objective", 0, SF_ARG_CHOICE, &t->objective, 0, 0, "prefixes|paper", "KIND",
       "what is trained while t* is searched: the mean over all numbers of steps, or the paper's M_smooth through all "
       "T steps (default prefixes)"},
      {"--search-rate", 0, SF_ARG_DOUBLE, &t->search_rate, 0.01, 100, NULL, "R",
       "how fast the averages of the search forget; what it finds should not hang on it (default 1)"},
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
       "tensorf: the finest grid has N^3 voxels (default half the pictures' width, at most 300; NDC: 0.63 of it, "
       "at most 640)"},
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
      {"--downscale", 'd', SF_ARG_INT, &a->downscale, 0, 64, NULL, "F",
       "images of 1/F of the full size, 0 = by the layout (default 0)"},
      {"--limit", 0, SF_ARG_INT, &a->limit, 0, 1e6, NULL, "N", "use the first N training views, 0 = all (default 0)"},
      {"--background", 0, SF_ARG_CHOICE, &a->background, 0, 0, "auto|random|white|black", "KIND",
       "behind transparent pixels and rays that leave the box; auto: random, but white for tensorf on pictures with "
       "alpha (default auto)"},
      {"--no-stage1", 0, SF_ARG_FLAG, &t->no_stage1, 0, 0, NULL, NULL, "ablation: all iterations in stage II"},
      {"--no-extra", 0, SF_ARG_FLAG, &t->no_extra, 0, 0, NULL, NULL, "ablation: without L_extra"},
      {"--no-penalty", 0, SF_ARG_FLAG, &t->no_penalty, 0, 0, NULL, NULL, "ablation: without L_penalty"},
      {"--no-budget", 0, SF_ARG_FLAG, &a->no_budget, 0, 0, NULL, NULL, "ablation: without both (L_budg)"},
      {"--no-distill", 0, SF_ARG_FLAG, &t->no_distill, 0, 0, NULL, NULL, "ablation: without L_distill"},
      {"--no-scaling", 0, SF_ARG_FLAG, &t->no_scaling, 0, 0, NULL, NULL, "ablation: without max time-step scaling"},
      {"--fixed-steps", 0, SF_ARG_INT, &t->fixed_steps, 0, SF_T_MAX, NULL, "N",
       "stage II trains the prefix of N steps alone, t* = N, without L_budg; 0 = t* is learned (default 0)"},
      {"--fine-tune", 0, SF_ARG_INPUT, &a->fine_tune, 0, 0, NULL, "MODEL",
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
                              "  sf_train lego -o lego.safetensors --minutes 10 --target-loss 0.1\n"
                              "  sf_train lego -o lego.safetensors --minutes 10 --target-saving 50\n"
                              "  sf_train lego -o lego.safetensors --resume\n"
                              "  sf_train lego -o twin.safetensors --net ann --minutes 10\n"
                              "  sf_train lego -o vm.safetensors --backbone tensorf --minutes 30\n"
                              "  sf_train lego -o four.safetensors --fine-tune lego.safetensors --weight-bits 4\n",
                  .options = o,
                  .min_positional = 1,
                  .max_positional = 1};
}

/* The box, the steps through it and the finest level, but for what was asked for. A level finer than the pixels costs
 * time and learns noise. Without data: what the options alone say. */
static void set_box(train_arguments *a, const sf_dataset *data)
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

/* Whether the field is of planes and lines, whose defaults follow from the data; else it is a hash grid. */
static bool has_planes(const train_arguments *a)
{
  return !sf_field_of(&a->train.config)->lattice;
}

static void settle_space(train_arguments *a, const sf_dataset *data)
{
  static const char *const name[] = {"random", "white", "black"};
  const sf_config *c = &a->train.config;
  const bool vm = has_planes(a);
  a->train.config.scale = data->scale;
  if (!vm) set_box(a, data);
  a->train.background = a->background ? a->background - 1 : vm && any_transparent(data) ? 1 : 0;
  if (a->quiet || a->json || vm || a->fine_tune) return;
  printf("box [-%d, %d]^3, %d occupancy grid%s, ", c->bound, c->bound, sf_config_cascades(c), c->bound > 1 ? "s" : "");
  if (c->dt_gamma > 0)
    printf("steps of distance / %g", 1 / (double)c->dt_gamma);
  else
    printf("equal steps");
  printf(", finest level %d, background %s\n", c->finest_res, name[a->train.background]);
  fflush(stdout);
}

/* What only the other backbone has, and what a model to fine-tune has settled. */
static sf_status check_effect(train_arguments *a)
{
  static const char *const grid[] = {"--levels",  "--log2-hash", "--base-res", "--finest-res",
                                     "--lattice", "--bound",     "--dt-gamma", NULL};
  static const char *const planes[] = {"--rays", "--voxels", NULL};
  static const char *const settled[] = {"--net",         "--steps",       "--input-mode",
                                        "--hidden",      "--theta",       "--occ-res",
                                        "--fixed-steps", "--stage1",      "--no-stage1",
                                        "--no-extra",    "--no-penalty",  "--no-budget",
                                        "--no-distill",  "--no-scaling",  "--beta",
                                        "--price",       "--target-loss", "--target-saving",
                                        "--objective",   "--search-rate", NULL},
                           *const minutes[] = {"--minutes", NULL}, *const iterations[] = {"--stage1", "--stage2", NULL},
                           *const budget[] = {"--beta", NULL}, *const search[] = {"--target-loss", "--target-saving",
                                                                                  "--price",       "--objective",
                                                                                  "--search-rate", NULL};
  static const char fine_tune[] = "has no effect beside --fine-tune: the model has its own";
  sf_option options[TRAIN_OPTIONS_MAX];
  const sf_cli cli = train_cli(a, options);
  if (has_planes(a))
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, grid, "has no effect on --backbone tensorf"));
  else
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, planes, "has no effect on --backbone ingp"));
  if (a->train.minutes <= 0) SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, minutes, "0 leaves no time to learn"));
  if (a->train.minutes > 0) SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, iterations, "has no effect beside --minutes"));
  if (a->train.target_loss > 0 || a->train.target_saving > 0)
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, budget, "has no effect beside a target"));
  if (a->train.fixed_steps > 0 || a->train.config.net == SF_NET_ANN)
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, search, "has no effect where the number of steps is fixed"));
  if (!a->fine_tune) return sf_ok();
  SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, grid, fine_tune));
  return sf_cli_refuse(&cli, a->argc, a->argv, settled, fine_tune);
}

/* What follows from the options, once they are parsed. */
static sf_status finish_options(train_arguments *a)
{
  sf_config *c = &a->train.config;
  if (c->net == SF_NET_ANN) c->steps = 1;
  for (int i = 0; i < 3; i++) c->theta[i] = (float)a->theta;
  if (a->no_budget) a->train.no_extra = a->train.no_penalty = true;
  if (a->train.no_stage1) a->train.stage2 += a->train.stage1, a->train.stage1 = 0;
  if (a->train.fixed_steps > c->steps)
    return sf_fail(SF_E_USAGE, "--fixed-steps %d is more than T = %d", a->train.fixed_steps, c->steps);
  if (a->train.target_loss > 0 && a->train.target_saving > 0)
    return sf_fail(SF_E_USAGE, "--target-loss and --target-saving exclude each other");
  if (a->weight_bits && !a->fine_tune) return sf_fail(SF_E_USAGE, "--weight-bits needs --fine-tune MODEL");
  if (a->fine_tune && has_planes(a)) return sf_fail(SF_E_USAGE, "--fine-tune knows the hash grid's nets only");
  return sf_ok();
}

/* The command line on top of what the run was started with, if that is known. */
static sf_status parse(train_arguments *a, const char **path)
{
  sf_option options[TRAIN_OPTIONS_MAX];
  sf_cli cli = train_cli(a, options);
  cli.min_positional = 0;
  if (a->words > 1) SF_TRY(sf_cli_parse(&cli, a->words, a->before, path));
  cli.min_positional = 1;
  SF_TRY(sf_cli_parse(&cli, a->argc, a->argv, path));
  cJSON_Delete(a->record);
  a->train.record = a->record = sf_record_make(options, apart);
  return a->record ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for the options");
}

/* The options of the run at --output; other ones on the command line would make another run of it. */
static sf_status restore(train_arguments *a, const char **path)
{
  sf_tensors set;
  sf_option options[TRAIN_OPTIONS_MAX];
  train_cli(a, options);
  SF_TRY(sf_tensors_load(&set, a->output));
  sf_status status =
      sf_tensors_meta(&set, "train.iteration")
          ? sf_ok()
          : sf_fail(SF_E_FORMAT, "%s: cannot resume: this is no checkpoint but a finished model", a->output);
  if (!status.code) status = sf_record_words(&set, options, apart, a->before, &a->words, TRAIN_OPTIONS_MAX);
  if (!status.code) status = parse(a, path);
  if (status.code == SF_E_USAGE) status = sf_fail(SF_E_FORMAT, "%s: cannot resume: %s", a->output, status.message);
  if (!status.code) status = sf_record_compare(&set, a->record);
  sf_tensors_free(&set);
  return status;
}

/* TensoRF's defaults depend on the data: the options once more, on top of them. */
static sf_status take_tensorf_defaults(train_arguments *a, const sf_dataset *data)
{
  a->train = sf_train_defaults_tensorf(data);
  a->theta = (double)a->train.config.theta[0];
  const char *path[1];
  SF_TRY(parse(a, path));
  SF_TRY(finish_options(a));
  return sf_config_check(&a->train.config);
}

sf_status train_parse(train_arguments *a, const char **path)
{
  SF_TRY(parse(a, path));
  if (!a->log) {
    snprintf(a->log_path, sizeof a->log_path, "%s.jsonl", a->output), a->log = a->log_path;
    SF_TRY(parse(a, path)); /* it is an output, too */
  }
  if (a->resume) SF_TRY(restore(a, path));
  SF_TRY(check_effect(a));
  if (a->threads) omp_set_num_threads(a->threads);
  SF_TRY(finish_options(a));
  sf_cli_catch_signals();
  set_box(a, NULL);
  if (has_planes(a)) return sf_ok();
  sf_status status = sf_config_check(&a->train.config);
  if (status.code == SF_E_RANGE) status.code = SF_E_USAGE;
  return status;
}

sf_status train_settle(train_arguments *a, const sf_dataset *data)
{
  if (has_planes(a)) SF_TRY(take_tensorf_defaults(a, data));
  settle_space(a, data);
  return sf_ok();
}

void train_defaults(train_arguments *a, int argc, char **argv)
{
  *a = (train_arguments){.output = "model.safetensors",
                         .train = sf_train_defaults(),
                         .checkpoint_minutes = 2,
                         .gamma = -1,
                         .argc = argc,
                         .argv = argv,
                         .before = {argv[0]},
                         .words = 1};
  a->theta = (double)a->train.config.theta[0];
}

void train_arguments_free(train_arguments *a)
{
  for (int i = 1; i < a->words; i++) free(a->before[i]);
  cJSON_Delete(a->record);
}
