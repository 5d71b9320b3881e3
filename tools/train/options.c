#include "tools/train/options.h"
#include "base/io.h"
#include "cli/record.h"
#include "field/field.h"
#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Options without influence on what is learned. A run may be resumed with other values of them. */
static const char *const apart[] = {"--output", "--threads", "--eval-views", "--psnr-prefixes", "--checkpoint-minutes",
                                    "--resume", "--log",     "--summary",    "--json",          "--quiet",
                                    "--view",   NULL};

/* The lattice whose equal steps are a pixel long, or a little shorter, as long as a ray has no more than it may have.
 * It is even, so that twice the step is one, too. pixels: along an edge of the box. */
static int lattice_of_pixels(int pixels, int bound)
{
  const int most = SF_STEPS_MAX / bound, lattice = 2 * (int)ceil(sqrt(3) / 2 * pixels / bound);
  return lattice < SF_LATTICE_MIN ? SF_LATTICE_MIN : lattice > most ? most : lattice;
}

/* Sets the box, its cells, the steps through it and the finest level, unless an option sets them. A level finer than
 * the pixels costs time and learns noise, and equal steps that are shorter than a pixel cost samples alone. Without
 * data, only the options count. */
static void set_box(train_arguments *a, const sf_dataset *data)
{
  sf_config *c = &a->train.config;
  sf_config_bound(c, a->bound ? a->bound : data ? data->bound : 1);
  c->occ_res = c->bound == 1 ? 256 : 128; /* of cascades, smaller cells would take too much memory */
  const int pixels = data ? sf_dataset_pixels(data, c->bound) : c->finest_res;
  if (pixels < c->finest_res) c->finest_res = pixels > c->base_res ? pixels : c->base_res;
  if (a->finest_res) c->finest_res = a->finest_res;
  if (a->gamma >= 0) c->dt_gamma = (float)a->gamma;
  c->lattice = c->dt_gamma > 0 ? sf_config_default().lattice : lattice_of_pixels(pixels, c->bound);
  if (a->lattice) c->lattice = a->lattice;
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
  if (a->occ_res) a->train.config.occ_res = a->occ_res;
  a->train.background = a->background ? a->background - 1 : vm && any_transparent(data) ? 1 : 0;
  if (a->quiet || a->json || vm || a->fine_tune) return;
  printf("box [-%d, %d]^3, %d occupancy grid%s, ", c->bound, c->bound, sf_config_cascades(c), c->bound > 1 ? "s" : "");
  if (c->dt_gamma > 0)
    printf("steps of distance / %g", 1 / (double)c->dt_gamma);
  else
    printf("steps of 2 sqrt(3) / %d", c->lattice);
  printf(", finest level %d, background %s\n", c->finest_res, name[a->train.background]);
  fflush(stdout);
}

/* What only the other backbone has, and what a model to fine-tune has settled. */
static sf_status check_effect(train_arguments *a)
{
  static const char *const grid[] = {"--levels",  "--log2-hash", "--base-res", "--finest-res",
                                     "--lattice", "--bound",     "--dt-gamma", NULL};
  static const char *const planes[] = {"--rays", "--voxels", "--undecoded", NULL};
  static const char *const settled[] = {"--backbone",      "--net",
                                        "--steps",         "--input-mode",
                                        "--hidden",        "--theta",
                                        "--occ-res",       "--voxels",
                                        "--stop",          "--fixed-steps",
                                        "--stage1",        "--no-stage1",
                                        "--no-extra",      "--no-penalty",
                                        "--no-budget",     "--no-distill",
                                        "--no-scaling",    "--beta",
                                        "--price",         "--target-loss",
                                        "--target-saving", "--objective",
                                        "--search-rate",   "--steps-along-ray",
                                        "--undecoded",     NULL};
  static const char *const minutes[] = {"--minutes", NULL}, *const iterations[] = {"--stage1", "--stage2", NULL},
                           *const budget[] = {"--beta", NULL}, *const search[] = {"--target-loss", "--target-saving",
                                                                                  "--price",       "--objective",
                                                                                  "--search-rate", NULL};
  static const char *const rays[] = {"--opaque", "--undecoded", "--near-camera", "--distortion", NULL};
  static const char *const spiking[] = {"--charge", "--steps-along-ray", NULL};
  static const char *const steps[] = {"--fixed-steps", "--charge", NULL}, *const mode[] = {"--input-mode", NULL};
  static const char fine_tune[] = "has no effect beside --fine-tune: the model has its own";
  sf_option options[TRAIN_OPTIONS_MAX];
  const sf_cli cli = train_cli(a, options);
  if (has_planes(a))
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, grid, "has no effect on --backbone tensorf"));
  else
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, planes, "has no effect on --backbone ingp"));
  if (a->train.minutes <= 0) SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, minutes, "0 leaves no time to learn"));
  if (a->train.minutes > 0) SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, iterations, "has no effect beside --minutes"));
  if (a->train.objective == SF_OBJECTIVE_PAPER)
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, rays, "has no effect beside --objective paper"));
  if (a->train.target_loss > 0 || a->train.target_saving > 0)
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, budget, "has no effect beside a target"));
  if (a->along) SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, steps, "has no effect beside --steps-along-ray"));
  if (a->along && a->input_mode == 1 + SF_RADIX)
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, mode,
                         "radix needs steps that weigh differently, and --steps-along-ray has one per sample"));
  if (a->train.fixed_steps > 0 || a->train.config.net == SF_NET_ANN || a->along)
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, search, "has no effect where the number of steps is fixed"));
  if (a->train.config.net == SF_NET_ANN)
    SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, spiking, "has no effect on --net ann"));
  if (!a->fine_tune) return sf_ok();
  SF_TRY(sf_cli_refuse(&cli, a->argc, a->argv, grid, fine_tune));
  return sf_cli_refuse(&cli, a->argc, a->argv, settled, fine_tune);
}

/* What follows from the options, once they are parsed. */
static sf_status finish_options(train_arguments *a)
{
  sf_config *c = &a->train.config;
  c->along = a->along;
  const bool papers = a->along || a->train.objective == SF_OBJECTIVE_PAPER || c->net == SF_NET_ANN;
  if (a->input_mode)
    c->mode = a->input_mode - 1;
  else if (papers)
    c->mode = SF_HYBRID;
  if (c->net == SF_NET_ANN || c->along) c->steps = 1;
  for (int i = 0; i < 3; i++) c->theta[i] = (float)a->theta;
  if (a->no_budget) a->train.no_extra = a->train.no_penalty = true;
  if (a->train.no_stage1) a->train.stage2 += a->train.stage1, a->train.stage1 = 0;
  if (a->train.fixed_steps > c->steps)
    return sf_fail(SF_E_USAGE, "--fixed-steps %d is more than T = %d", a->train.fixed_steps, c->steps);
  if (a->train.target_loss > 0 && a->train.target_saving > 0)
    return sf_fail(SF_E_USAGE, "--target-loss and --target-saving exclude each other");
  const char *width = a->weight_bits ? "weight" : a->leak_bits ? "leak" : a->grid_bits ? "grid" : NULL;
  if (width && !a->fine_tune) return sf_fail(SF_E_USAGE, "--%s-bits needs --fine-tune MODEL", width);
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

/* A model to fine-tune has its field: it decides which options and defaults there are. */
static sf_status take_backbone(train_arguments *a)
{
  sf_tensors set;
  SF_TRY(sf_tensors_load(&set, a->fine_tune));
  const char *text = sf_tensors_meta(&set, "backbone");
  const long backbone = text ? strtol(text, NULL, 10) : SF_INGP;
  if (backbone >= 0 && backbone < SF_FIELDS) a->train.config.backbone = (int32_t)backbone; /* else loading says it */
  sf_tensors_free(&set);
  return sf_ok();
}

/* TensoRF's defaults depend on the data: the options once more, on top of them. */
static sf_status take_tensorf_defaults(train_arguments *a, const sf_dataset *data)
{
  train_field_defaults(a, data);
  const char *path[1];
  SF_TRY(parse(a, path));
  SF_TRY(finish_options(a));
  return sf_config_check(&a->train.config);
}

sf_status train_parse(train_arguments *a, const char **path)
{
  sf_cli_catch_signals();
  SF_TRY(parse(a, path));
  if (a->fine_tune && !a->resume) {
    SF_TRY(take_backbone(a));
    SF_TRY(parse(a, path));
  }
  if (!a->log) {
    snprintf(a->log_path, sizeof a->log_path, "%s.jsonl", a->output), a->log = a->log_path;
    SF_TRY(parse(a, path)); /* it is an output, too */
  }
  if (a->resume) SF_TRY(restore(a, path));
  SF_TRY(check_effect(a));
  if (a->threads) omp_set_num_threads(a->threads);
  SF_TRY(finish_options(a));
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
  train_option_defaults(a, NULL);
  a->argc = argc, a->argv = argv;
  a->before[0] = argv[0], a->words = 1;
}

void train_arguments_free(train_arguments *a)
{
  for (int i = 1; i < a->words; i++) free(a->before[i]);
  cJSON_Delete(a->record);
}
