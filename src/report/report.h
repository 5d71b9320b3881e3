/* The tables, JSON and plots of `make reproduce`: what the runs of one profile left in their folders, beside the values
 * that the paper prints. */
#ifndef SF_REPORT_REPORT_H
#define SF_REPORT_REPORT_H
#include "base/arch.h"
#include "base/status.h"
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdio.h>

/* The runs of one scene. */
typedef enum {
  SF_RUN_ANN,
  SF_RUN_BETA_5E9, /* the first spiking one */
  SF_RUN_BETA_5E8,
  SF_RUN_BETA_1E7,
  SF_RUN_BETA_5E7, /* the reference: `full` of the ablations, t_r of the fixed runs */
  SF_RUN_BETA_1E6,
  SF_RUN_HYBRID,
  SF_RUN_NO_DECAY,
  SF_RUN_DECAY,
  SF_RUN_NO_STAGE1,
  SF_RUN_NO_EXTRA,
  SF_RUN_NO_PENALTY,
  SF_RUN_NO_BUDGET,
  SF_RUN_T_MINUS_1,
  SF_RUN_T,
  SF_RUN_T_PLUS_1, /* the last of the paper's */
  SF_RUN_ALONG,    /* membranes along the ray, a step a sample */
  SF_RUN_SWEEP,    /* one step, trained alone; then 2, 3, ... SF_T_MAX */
  SF_RUNS = SF_RUN_SWEEP + SF_T_MAX
} sf_run_id;

/* One number per run. Energies: paper ledger, mJ per frame, mean over the audited views. */
typedef enum {
  SF_METRIC_PSNR, /* float, held-out views, at t_r */
  SF_METRIC_SSIM,
  SF_METRIC_STEPS,   /* t_r; none for the ANN */
  SF_METRIC_ENERGY,  /* ANN: its synapses on the samples of its own rendering; along the ray: the ANN's, times what the
                        trainer counted on the held-out views beside the ANN's there */
  SF_METRIC_TWIN,    /* ReLU twin on the samples of the spiking frame */
  SF_METRIC_FIXED,   /* PSNR of the audited views, fixed point */
  SF_METRIC_FLOAT,   /* PSNR of the same views, float */
  SF_METRIC_LOSS,    /* FIXED - FLOAT */
  SF_METRIC_SECONDS, /* training */
  SF_METRIC_SAVING,  /* percent of the ANN's energy */
  SF_METRIC_EXCESS,  /* squared error, less the ANN's */
  SF_METRIC_WORTH,   /* of one more step at t*, and what it costs: squared error */
  SF_METRIC_WORTH_ERROR,
  SF_METRIC_PRICE,
  SF_METRICS
} sf_metric;

typedef struct sf_run_kind {
  const char *name, *title; /* folder; row of the tables */
} sf_run_kind;
extern const sf_run_kind sf_run_kinds[SF_RUNS];

/* One of the paper's sets of scenes with one backbone, and its averages; 0: not published. Energies: mJ per frame. */
enum { SF_BETAS = 3, SF_PAPER_GROUPS = 4, SF_GROUPS = SF_PAPER_GROUPS + 2 };
typedef struct sf_paper_row {
  double psnr, ssim, steps, energy;
} sf_paper_row;
typedef struct sf_paper_group {
  const char *backbone, *layout, *data; /* as in a trainer's summary; layout: of that set's folders; its name */
  const char *scenes, *pixels;          /* the set's scenes; what the paper renders */
  int beta[SF_BETAS];                   /* runs, the budgets rising */
  sf_paper_row row[SF_RUNS];
} sf_paper_group;
/* The last two are scenes of no set of the paper's, one group a backbone: without values. */
extern const sf_paper_group sf_paper_groups[SF_GROUPS];
double sf_paper_value(int group, int run, int metric); /* NaN: not published */

typedef struct sf_run {
  double value[SF_METRICS]; /* NaN: missing */
  double t_star;
  int prefixes;                                          /* T where every prefix was evaluated, else 0 */
  double prefix_psnr[SF_T_MAX];                          /* after 1..T steps */
  double prefix_energy[SF_T_MAX];                        /* mJ per frame; NaN: not audited */
  int audits, width, height;                             /* audited frames and their size in pixels */
  double cosim_samples, cosim_differences;               /* in lockstep with the RTL; NaN: not run */
  int points;                                            /* t* over iterations, rising */
  double *iteration, *t_star_at;                         /* owned */
  double (*firing)[3];                                   /* rates of the spiking layers there, NaN: none; owned */
  char *status, *train_command, *eval_command, *version; /* text of the run's files or NULL, owned */
  cJSON *summary;                                        /* of the trainer, or NULL, owned */
  cJSON *converted;                                      /* of sf_convert, of the ANN, or NULL, owned */
} sf_run;

typedef struct sf_seed_runs {
  int seed; /* of the folder's name; 0: the scene's own folder */
  sf_run run[SF_RUNS];
} sf_seed_runs;

typedef struct sf_report_scene {
  char name[256];
  char *kind;          /* "LAYOUT BACKBONE", from the file `kind`; NULL: not there; owned */
  int group;           /* of sf_paper_groups */
  int seeds;           /* folders of seeds, the scene's own first */
  sf_seed_runs *of;    /* owned */
  sf_run run[SF_RUNS]; /* numbers: means over the seeds; the rest is that of the first seed with a result, not owned */
} sf_report_scene;

typedef struct sf_reproduction {
  char dir[4096], profile[256]; /* its last part */
  int count;
  sf_report_scene *scene; /* sorted by name, owned */
  char **problem;         /* what could not be read or does not agree, one line each, owned */
  int problems;
} sf_reproduction;

/* Reads DIR/SCENE/RUN/ and DIR/SCENE/seed-N/RUN/. What is missing stays missing; what is there and unreadable becomes a
 * problem. A folder without any of the runs is no scene. */
sf_status sf_reproduction_load(sf_reproduction *r, const char *dir);
void sf_reproduction_free(sf_reproduction *r);

/* Which scenes: one, by its place; all; those of a group. */
enum { SF_SCENES_ALL = -1, SF_SCENES_OF = -2 };
static inline int sf_scenes_of(int group)
{
  return SF_SCENES_OF - group;
}
bool sf_reproduction_chosen(const sf_reproduction *r, int s, int scenes);

/* Mean over the chosen scenes that have the number; NaN and *count = 0 where none has. count may be NULL. */
double sf_reproduction_mean(const sf_reproduction *r, int scenes, int run, int metric, int *count);
/* Standard deviation of that mean from one seed to another; NaN where no scene has two seeds. Scenes of one seed are
 * taken to spread like the others. */
double sf_reproduction_spread(const sf_reproduction *r, int scenes, int run, int metric);
/* 100 (1 - E_run / E_other) from energies summed over the scenes that have both. other: another run of the scene
 * (SF_RUN_ANN: the paper's saving), or SF_SAVING_TWIN for the ReLU twin on the same samples. */
enum { SF_SAVING_TWIN = -1 };
double sf_reproduction_saving(const sf_reproduction *r, int scenes, int run, int other);
/* Means over the scenes at step t (0-based) of every prefix. */
double sf_reproduction_prefix(const sf_reproduction *r, int scenes, int run, int step);
double sf_reproduction_prefix_energy(const sf_reproduction *r, int scenes, int run, int step);

/* Two runs that the paper orders: which is larger, there and here. */
typedef enum { SF_ORDER_MISSING, SF_ORDER_YES, SF_ORDER_TIE, SF_ORDER_NO } sf_order_verdict;
extern const char *const sf_order_names[]; /* "-", "yes", "tie", "no" */
typedef struct sf_order {
  const char *group;
  int a, b, metric;
  double paper, ours; /* a - b; ours: mean over the scenes that have both, paired by their seeds */
  double error;       /* standard error of ours; NaN: one seed */
  int scenes, pairs;
  sf_order_verdict verdict;
} sf_order;
enum { SF_ORDERS_MAX = 48 };
/* With one seed differences up to this are ties, with more those up to two standard errors: dB, SSIM, steps; energies:
 * this share of the smaller one. 0: not compared. */
extern const double sf_order_tolerance[SF_METRICS];
/* Verdict of a difference beside the paper's, the tie tolerance given. Where the paper itself ties, only the opposite
 * order beyond the tolerance contradicts it. */
sf_order_verdict sf_order_judge(double paper, double ours, double paper_tolerance, double tolerance);
/* Of the scenes of a group. */
int sf_reproduction_order(const sf_reproduction *r, int group, sf_order order[SF_ORDERS_MAX]);

/* Markdown for file and terminal. */
sf_status sf_reproduction_print(FILE *out, const sf_reproduction *r);
/* DIR/tables/NAME.csv, one per table. *count: how many. */
sf_status sf_reproduction_csv(const sf_reproduction *r, int *count);
cJSON *sf_reproduction_json(const sf_reproduction *r); /* NULL: no memory */
/* DIR/plots/NAME.gp: self-contained gnuplot scripts that write DIR/plots/NAME.svg. *count: how many. */
sf_status sf_reproduction_plots(const sf_reproduction *r, int *count);

/* DIR/report.html, one page that needs nothing beside it: tables; of every scene the truth, the twin and each budget
 * with a magnified part and a map of the errors; the pictures that gnuplot made of the plots. */
sf_status sf_reproduction_page(const sf_reproduction *r);
#endif
