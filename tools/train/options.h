/* The command line of sf_train: its options, those of the run that it resumes, and what follows from both. */
#ifndef SF_TOOLS_TRAIN_OPTIONS_H
#define SF_TOOLS_TRAIN_OPTIONS_H
#include "cli/cli.h"
#include "train/train.h"

enum { TRAIN_OPTIONS_MAX = 80 };

typedef struct train_arguments {
  const char *output, *log, *summary, *fine_tune;
  sf_train_options train;
  double scale, theta, checkpoint_minutes, gamma;
  int bound, finest_res, lattice, occ_res, background, downscale, threads, eval_views, prefix_views, limit, weight_bits,
      leak_bits, grid_bits, view; /* port of the page, -1: none */
  int input_mode;                 /* 0: by the objective, else 1 + the sf_input_mode */
  bool resume, quiet, json, no_budget, along;
  int argc;
  char **argv;
  char *before[TRAIN_OPTIONS_MAX]; /* the program's name and what the run to resume was started with */
  int words;                       /* of it */
  cJSON *record;
  char log_path[4096]; /* where no --log is given */
} train_arguments;

/* The defaults of the options: with the hash grid, or with TensoRF's planes on data. */
void train_option_defaults(train_arguments *a, const sf_dataset *data);
void train_field_defaults(train_arguments *a, const sf_dataset *data); /* only those that depend on the field */
void train_defaults(train_arguments *a, int argc, char **argv);
void train_arguments_free(train_arguments *a);
/* options: TRAIN_OPTIONS_MAX, filled. */
sf_cli train_cli(train_arguments *a, sf_option *options);
/* path: of the data. With --resume the options of the run at --output come first. */
sf_status train_parse(train_arguments *a, const char **path);
/* What follows from the data: TensoRF's defaults, the box, the background; says so unless quiet. */
sf_status train_settle(train_arguments *a, const sf_dataset *data);
#endif
