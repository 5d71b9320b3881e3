/* PATA training of the float model (design equations: docs/model.md). */
#ifndef SF_TRAIN_TRAIN_H
#define SF_TRAIN_TRAIN_H
#include "snn/model.h"
#include "scene/scene.h"
#include "ranks/ranks.h"

/* What is trained while t* is searched. */
typedef enum {
  SF_OBJECTIVE_PREFIXES, /* the mean over all prefixes: what a step is worth does not depend on where t* stands */
  SF_OBJECTIVE_PAPER     /* M_smooth, as the paper has it, through all T steps in every iteration */
} sf_objective;

/* What one more step is charged with, times beta M_T / M_smooth. */
typedef enum {
  SF_PRICE_EXPONENTIAL, /* e^t, the paper's */
  SF_PRICE_ENERGY       /* what it costs on this scene: mJ per frame, 0.9 pJ per SOP, 4.6 pJ per MAC */
} sf_step_price;

typedef struct sf_train_options {
  sf_config config;
  double beta; /* weight of L_penalty: quality (small) against energy (large) */
  sf_objective objective;
  sf_step_price price;
  double target_loss;   /* dB: t* is the fewest steps that lose at most this; 0 = beta decides */
  double target_saving; /* percent of the ReLU twin's energy: t* is the most steps that save it; 0 = beta decides */
  double charge; /* once t* is found: by how many percent the error may grow for one percent fewer reads of weights */
  double search_rate; /* how fast the search's averages forget, 1 = default; the result should not hang on it */
  double alpha;       /* weight of L_extra */
  double opaque;      /* by how many percent the error may grow at the end for one percent fewer samples, in and behind
                       * surfaces; the paper's objective has none */
  double near_camera; /* samples nearer to a camera than this, times the cameras' mean distance from the centre, learn
                       * slower; not in NDC, nor with the paper's objective */
  double distortion;  /* weight of L_distortion, which draws the weights of a ray together; not with the paper's
                       * objective */
  int stage1, stage2; /* iterations; ignored when minutes > 0 */
  double minutes;     /* time budget of both stages, a quarter for stage I; 0 = iterations */
  uint64_t seed;
  int samples;            /* samples per iteration, about */
  double lr_grid, lr_net; /* Adam, decayed to three tenths over the run */
  bool no_stage1, no_extra, no_penalty, no_distill;
  bool no_scaling;  /* no max time-step scaling in the first epoch of each stage */
  int fixed_steps;  /* t* in stage II, frozen, without L_budg: 1..T; 0 = t* is learned */
  int background;   /* 0 random per ray, 1 white, 2 black */
  int rays;         /* TensoRF: of an iteration */
  int voxels;       /* TensoRF: the finest grid has voxels^3 in the shrunk box */
  double undecoded; /* TensoRF: share of the light that samples without a decoder may take; 0: weight_stop stays */
  /* Fine-tuning for few bits: starts from this model, whose scales are settled, at its t_r, without stage I and at a
   * tenth of the rates, with the weights rounded as the exporter will. Not owned; replaces config. NULL: from scratch.
   */
  const sf_model *start;
  sf_ranks *ranks;     /* that share the work of an iteration; not owned; NULL: alone */
  const cJSON *record; /* strings that a checkpoint keeps in its metadata, by key; not owned; NULL: none */
} sf_train_options;

sf_train_options sf_train_defaults(void);
/* TensoRF's, by the layout of the data: Blender, a forward-facing scene in NDC, or a scene in units of its own. */
sf_train_options sf_train_defaults_tensorf(const sf_dataset *data);

typedef enum {
  SF_SEARCH_NONE,        /* t* is not learned: stage I, fixed steps, one step, fine-tuning */
  SF_SEARCH_RUNNING,     /* t* moves */
  SF_SEARCH_BALANCED,    /* t* rested where worth and price are equal, or where the target is met */
  SF_SEARCH_AT_END,      /* at 1 or T steps worth and price are not equal yet */
  SF_SEARCH_MISSED,      /* no number of steps meets the target */
  SF_SEARCH_NOT_REACHED, /* t* still moved when the search ended */
  SF_SEARCH_TOO_SHORT    /* nothing was measured: t_r is where the search starts */
} sf_search_state;
extern const char *const sf_search_names[]; /* "none", "running", "balanced", ... */

/* Where the search for t* stands. Squared errors are means over rays and colours, in [0,1]. */
typedef struct sf_search_report {
  sf_search_state state;
  int measured;                /* iterations that measured all prefixes */
  double worth, worth_error;   /* squared error that one more step saves at t*; its standard error, INFINITY where too
                                * few were measured to know it */
  double price, price_error;   /* beta (M_T / M_smooth) e^t, or what the step costs */
  double beta;                 /* the option, or what the target stands for */
  double prefix_mse[SF_T_MAX]; /* after 1..T steps */
  double saving;               /* share of the ReLU twin's energy at t_r, by the firing in training */
  double step_energy;          /* mJ per frame of one more step */
} sf_search_report;

/* Of the last iteration. */
typedef struct sf_train_stats {
  int stage; /* 1, 2; 3 = finished */
  int64_t iteration;
  double progress;  /* 0..1 of the whole run */
  double seconds;   /* training time, over resumes */
  double loss, mse; /* total loss; squared error of what is trained: M_{t_r}, in the search M_smooth or one prefix's */
  double t_star;
  int t_r;
  sf_search_report search;
  double tau[SF_LAYERS];
  double firing[3];  /* spikes per neuron and step of D1, C1, C2 */
  double row_reads;  /* 8 bytes of weights that the accelerator reads for a sample of the iteration */
  int rays, samples; /* of the iteration */
  int lattice;       /* its shortest step is 2 sqrt(3) / lattice model units; hash grids */
  double occupied;   /* share of occupied cells */
  int quiet[3];      /* neurons of D1, C1, C2 without a spike in 64 samples of the scene, counted every 64 iterations */
  int revived[3];    /* times that the layer was brought back to the threshold */
  int event[3];      /* in this iteration: revived because it was silent (-1) or saturated (1), or nothing (0) */
  double samples_per_second; /* through the nets, mean over the run and its resumes */
} sf_train_stats;

typedef struct sf_trainer sf_trainer;

/* Of ranks, every rank calls these functions in the same order, with the same options, data and checkpoint; all have
 * the same model afterwards, and the same failure where one of them fails. sf_trainer_save is for one of them alone.
 * The bits do not depend on how many there are.
 *
 * data must outlive the trainer. resume: a checkpoint to continue from, or NULL; its config replaces options->config.
 * It is refused where the data's scale, NDC or views, or the options' bound, are not those that it was made with. */
sf_status sf_trainer_create(sf_trainer **trainer, const sf_dataset *data, const sf_train_options *options,
                            const char *resume);
/* One iteration. NaN, Inf or divergence anywhere fails and names the tensor. The run is over then: the weights that
 * led there are not worth a checkpoint, the last one that was saved is. */
sf_status sf_trainer_step(sf_trainer *trainer, sf_train_stats *stats);
/* Atomic. with_optimiser: everything that --resume needs; without: the model alone. Refuses NaN, Inf and diverged
 * weights, naming the tensor, so that a run that went wrong cannot replace its last good checkpoint. */
sf_status sf_trainer_save(const sf_trainer *trainer, const char *path, bool with_optimiser);
/* As after the last iteration, without its losses (0); stage 3: nothing is left to train. */
sf_train_stats sf_trainer_stats(const sf_trainer *trainer);
const sf_model *sf_trainer_model(const sf_trainer *trainer);
void sf_trainer_free(sf_trainer *trainer);

/* Means of PSNR (a view's at most 99 dB) and SSIM (of the views of 11 x 11 pixels and more, else NaN) of the first
 * `views` views (0 = all) at `steps` steps (0 = t_r), composited on white. */
sf_status sf_evaluate(const sf_model *model, const sf_dataset *data, int views, int steps, double *psnr, double *ssim);
/* The same, which counts; see sf_render_counted. */
sf_status sf_evaluate_counted(const sf_model *model, const sf_dataset *data, int views, int steps, double *psnr,
                              double *ssim, sf_ray_events *events);
/* PSNR of the same at every prefix: psnr[0 .. T-1] for 1 .. T steps. */
sf_status sf_evaluate_prefixes(const sf_model *model, const sf_dataset *data, int views, double *psnr);
#endif
