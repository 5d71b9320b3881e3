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
  SF_RUN_T_PLUS_1,
  SF_RUNS
} sf_run_id;

/* One number per run. Energies: paper ledger, mJ per frame, mean over the audited views. */
typedef enum {
  SF_METRIC_PSNR, /* float, held-out views, at t_r */
  SF_METRIC_SSIM,
  SF_METRIC_STEPS,   /* t_r; none for the ANN */
  SF_METRIC_ENERGY,  /* ANN: its synapses on the samples of its own rendering */
  SF_METRIC_TWIN,    /* ReLU twin on the samples of the spiking frame */
  SF_METRIC_FIXED,   /* PSNR of the audited views, fixed point */
  SF_METRIC_FLOAT,   /* PSNR of the same views, float */
  SF_METRIC_LOSS,    /* FIXED - FLOAT */
  SF_METRIC_SECONDS, /* training */
  SF_METRICS
} sf_metric;

/* A run and the paper's row for it (averages over the eight Synthetic scenes, INGP backbone); NaN: not published. */
typedef struct sf_run_kind {
  const char *name, *title; /* folder; row of the tables */
  double paper[SF_METRICS], paper_saving;
} sf_run_kind;
extern const sf_run_kind sf_run_kinds[SF_RUNS];

/* The paper's averages over one set of scenes with one backbone: its twin, and beta = 5e-7. Energies: mJ per frame. */
typedef struct sf_paper_group {
  const char *backbone, *layout, *data; /* as in a trainer's summary; layout: of that set's folders; its name */
  double ann_psnr, ann_energy, psnr, ssim, steps, energy;
} sf_paper_group;
enum { SF_PAPER_GROUPS = 4 };
extern const sf_paper_group sf_paper_groups[SF_PAPER_GROUPS];

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
  char *status, *train_command, *eval_command, *version; /* text of the run's files or NULL, owned */
  cJSON *summary;                                        /* of the trainer, or NULL, owned */
} sf_run;

typedef struct sf_report_scene {
  char name[256];
  sf_run run[SF_RUNS];
} sf_report_scene;

typedef struct sf_reproduction {
  char dir[4096], profile[256]; /* its last part */
  int count;
  sf_report_scene *scene; /* sorted by name, owned */
  char **problem;         /* what could not be read or does not agree, one line each, owned */
  int problems;
} sf_reproduction;

/* Reads DIR/SCENE/RUN/. What is missing stays missing; what is there and unreadable becomes a problem. A folder without
 * any of the runs is no scene. */
sf_status sf_reproduction_load(sf_reproduction *r, const char *dir);
void sf_reproduction_free(sf_reproduction *r);

/* Mean over the scenes that have the number; NaN and *count = 0 where none has. scene < 0: all. count may be NULL. */
double sf_reproduction_mean(const sf_reproduction *r, int scene, int run, int metric, int *count);
/* 100 (1 - E_run / E_other) from energies summed over the scenes that have both. other: another run of the scene
 * (SF_RUN_ANN: the paper's saving), or SF_SAVING_TWIN for the ReLU twin on the same samples. */
enum { SF_SAVING_TWIN = -1 };
double sf_reproduction_saving(const sf_reproduction *r, int scene, int run, int other);
/* Means over the scenes at step t (0-based) of every prefix. */
double sf_reproduction_prefix(const sf_reproduction *r, int scene, int run, int step);
double sf_reproduction_prefix_energy(const sf_reproduction *r, int scene, int run, int step);

/* Two runs that the paper orders: which is larger, there and here. */
typedef enum { SF_ORDER_MISSING, SF_ORDER_YES, SF_ORDER_TIE, SF_ORDER_NO } sf_order_verdict;
extern const char *const sf_order_names[]; /* "-", "yes", "tie", "no" */
typedef struct sf_order {
  const char *group;
  int a, b, metric;
  double paper, ours; /* a - b; ours: mean over the scenes that have both */
  int scenes;
  sf_order_verdict verdict;
} sf_order;
enum { SF_ORDERS_MAX = 48 };
/* Differences up to this are ties: dB, SSIM, steps; energies: this share of the smaller one. 0: not compared. */
extern const double sf_order_tolerance[SF_METRICS];
/* Verdict of a difference beside the paper's, the tie tolerance given. Where the paper itself ties, only the opposite
 * order beyond the tolerance contradicts it. */
sf_order_verdict sf_order_judge(double paper, double ours, double paper_tolerance, double tolerance);
int sf_reproduction_order(const sf_reproduction *r, sf_order order[SF_ORDERS_MAX]);

/* The paper's averages for the kind of scene that this is, NULL: none, or not known. */
const sf_paper_group *sf_reproduction_group(const sf_report_scene *scene);

/* Markdown for file and terminal. */
sf_status sf_reproduction_print(FILE *out, const sf_reproduction *r);
cJSON *sf_reproduction_json(const sf_reproduction *r); /* NULL: no memory */
/* DIR/plots/NAME.gp: self-contained gnuplot scripts that write DIR/plots/NAME.svg. *count: how many. */
sf_status sf_reproduction_plots(const sf_reproduction *r, int *count);
#endif
