/* PATA training of the float model (design equations: docs/model.md). */
#ifndef SPIKEFIELD_TRAIN_H
#define SPIKEFIELD_TRAIN_H
#include "spikefield/model.h"
#include "spikefield/scene.h"

typedef struct sf_train_options {
  sf_config config;
  double beta;        /* weight of L_penalty: quality (small) against energy (large) */
  double alpha;       /* weight of L_extra */
  int stage1, stage2; /* iterations; ignored when minutes > 0 */
  double minutes;     /* time budget of both stages, a quarter for stage I; 0 = iterations */
  uint64_t seed;
  int samples;            /* samples per iteration, about */
  double lr_grid, lr_net; /* Adam, decayed to three tenths over the run */
  bool no_stage1, no_extra, no_penalty, no_distill;
  bool no_scaling; /* no max time-step scaling in the first epoch of each stage */
  int fixed_steps; /* t* in stage II, frozen, without L_budg: 1..T; 0 = t* is learned */
  int background;  /* 0 random per ray, 1 white, 2 black */
  int rays;        /* TensoRF: of an iteration */
  int voxels;      /* TensoRF: the finest grid has voxels^3 in the shrunk box */
  /* Fine-tuning for few bits: starts from this model, whose scales are settled, at its t_r, without stage I and at a
   * tenth of the rates, with the weights rounded as the exporter will. Not owned; replaces config. NULL: from scratch.
   */
  const sf_model *start;
  const cJSON *record; /* strings that a checkpoint keeps in its metadata, by key; not owned; NULL: none */
} sf_train_options;

sf_train_options sf_train_defaults(void);
/* TensoRF's, by the layout of the data: Blender, a forward-facing scene in NDC, or a scene in units of its own. */
sf_train_options sf_train_defaults_tensorf(const sf_dataset *data);

/* Of the last iteration. */
typedef struct sf_train_stats {
  int stage; /* 1, 2; 3 = finished */
  int64_t iteration;
  double progress;                      /* 0..1 of the whole run */
  double seconds;                       /* training time, over resumes */
  double loss, mse;                     /* total loss; M_T in stage I, M_smooth in stage II */
  double mse_full, mse_floor, mse_ceil; /* M_T, M_{t_f}, M_{t_c} */
  double t_star;
  int t_r;
  double tau[SF_LAYERS];
  double firing[3];  /* spikes per neuron and step of D1, C1, C2 */
  int rays, samples; /* of the iteration */
  int lattice;       /* its shortest step is 2 sqrt(3) / lattice model units; hash grids */
  double occupied;   /* share of occupied cells */
  int quiet[3];      /* neurons of D1, C1, C2 without a spike in 64 samples of the scene, counted every 64 iterations */
  int revived[3];    /* times that the layer was brought back to the threshold */
  int event[3];      /* in this iteration: revived because it was silent (-1) or saturated (1), or nothing (0) */
  double samples_per_second; /* through the nets, mean over the run and its resumes */
} sf_train_stats;

typedef struct sf_trainer sf_trainer;

/* data must outlive the trainer. resume: a checkpoint to continue from, or NULL; its config replaces options->config.
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
/* PSNR of the same at every prefix: psnr[0 .. T-1] for 1 .. T steps. */
sf_status sf_evaluate_prefixes(const sf_model *model, const sf_dataset *data, int views, double *psnr);
#endif
