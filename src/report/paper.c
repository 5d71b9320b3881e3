/* The runs and what the paper reports for them: "Adaptive Time-step Training for Enhancing Spike-Based Neural Radiance
 * Fields", averages over its sets of scenes. */
#include "report/report.h"
#include <math.h>

const sf_run_kind sf_run_kinds[SF_RUNS] = {
    [SF_RUN_ANN] = {"ann", "ANN (ReLU twin)"},
    [SF_RUN_BETA_5E9] = {"beta-5e-9", "beta = 5e-9"},
    [SF_RUN_BETA_5E8] = {"beta-5e-8", "beta = 5e-8"},
    [SF_RUN_BETA_1E7] = {"beta-1e-7", "beta = 1e-7"},
    [SF_RUN_BETA_5E7] = {"beta-5e-7", "beta = 5e-7 (full)"},
    [SF_RUN_BETA_1E6] = {"beta-1e-6", "beta = 1e-6"},
    [SF_RUN_HYBRID] = {"mode-hybrid", "input hybrid, T = 8"},
    [SF_RUN_NO_DECAY] = {"mode-no-decay", "input no-decay, T = 8"},
    [SF_RUN_DECAY] = {"mode-decay", "input decay, T = 8"},
    [SF_RUN_NO_STAGE1] = {"no-stage1", "without stage I"},
    [SF_RUN_NO_EXTRA] = {"no-extra", "without L_extra"},
    [SF_RUN_NO_PENALTY] = {"no-penalty", "without L_penalty"},
    [SF_RUN_NO_BUDGET] = {"no-budget", "without L_budg"},
    [SF_RUN_T_MINUS_1] = {"fixed-t-minus-1", "fixed t_r - 1"},
    [SF_RUN_T] = {"fixed-t", "fixed t_r"},
    [SF_RUN_T_PLUS_1] = {"fixed-t-plus-1", "fixed t_r + 1"},
    [SF_RUN_ALONG] = {"along-ray", "samples of a ray as steps"},
    [SF_RUN_SWEEP] = {"sweep-1", "fixed T = 1"},
    [SF_RUN_SWEEP + 1] = {"sweep-2", "fixed T = 2"},
    [SF_RUN_SWEEP + 2] = {"sweep-3", "fixed T = 3"},
    [SF_RUN_SWEEP + 3] = {"sweep-4", "fixed T = 4"},
    [SF_RUN_SWEEP + 4] = {"sweep-5", "fixed T = 5"},
    [SF_RUN_SWEEP + 5] = {"sweep-6", "fixed T = 6"},
    [SF_RUN_SWEEP + 6] = {"sweep-7", "fixed T = 7"},
    [SF_RUN_SWEEP + 7] = {"sweep-8", "fixed T = 8"},
};

#define SYNTHETIC "chair drums ficus hotdog lego materials mic ship"
#define GRID_BETAS                                                                                                     \
  {                                                                                                                    \
    SF_RUN_BETA_1E7, SF_RUN_BETA_5E7, SF_RUN_BETA_1E6                                                                  \
  }
#define PLANES_BETAS                                                                                                   \
  {                                                                                                                    \
    SF_RUN_BETA_5E9, SF_RUN_BETA_5E8, SF_RUN_BETA_5E7                                                                  \
  }

const sf_paper_group sf_paper_groups[SF_GROUPS] = {
    {"ingp",
     "blender",
     "Synthetic",
     SYNTHETIC,
     "800 x 800",
     GRID_BETAS,
     {[SF_RUN_ANN] = {32.14, 0.959, 0, 955.27},
      [SF_RUN_BETA_1E7] = {32.45, 0.959, 5.125, 643.39},
      [SF_RUN_BETA_5E7] = {32.21, 0.957, 3.625, 492.25},
      [SF_RUN_BETA_1E6] = {32.04, 0.956, 2.875, 405.33},
      [SF_RUN_HYBRID] = {32.12, 0, 8, 0},
      [SF_RUN_NO_DECAY] = {32.09, 0, 8, 0},
      [SF_RUN_DECAY] = {31.82, 0, 8, 0},
      [SF_RUN_NO_STAGE1] = {31.59, 0, 3.625, 0},
      [SF_RUN_NO_EXTRA] = {31.69, 0, 1.625, 0},
      [SF_RUN_NO_PENALTY] = {32.61, 0, 6.625, 0},
      [SF_RUN_NO_BUDGET] = {32.02, 0, 5.875, 0},
      [SF_RUN_T_MINUS_1] = {31.69, 0, 0, 398.37},
      [SF_RUN_T] = {32.11, 0, 0, 491.70},
      [SF_RUN_T_PLUS_1] = {32.29, 0, 0, 623.01}}},
    {"ingp",
     "colmap",
     "Mip-NeRF 360",
     "bicycle bonsai counter garden kitchen room stump",
     NULL,
     GRID_BETAS,
     {[SF_RUN_ANN] = {25.48, 0.668, 0, 18980},
      [SF_RUN_BETA_1E7] = {25.30, 0.667, 6, 15600},
      [SF_RUN_BETA_5E7] = {25.09, 0.646, 4.857, 13660},
      [SF_RUN_BETA_1E6] = {25.01, 0.641, 4, 11870}}},
    {"tensorf",
     "blender",
     "Synthetic",
     SYNTHETIC,
     "800 x 800",
     PLANES_BETAS,
     {[SF_RUN_ANN] = {33.14, 0.963, 0, 1261},
      [SF_RUN_BETA_5E9] = {33.10, 0.961, 5.625, 885.2},
      [SF_RUN_BETA_5E8] = {33.04, 0.960, 3.875, 815.2},
      [SF_RUN_BETA_5E7] = {32.91, 0.959, 2, 748.4}}},
    {"tensorf",
     "llff",
     "LLFF",
     "fern flower fortress horns leaves orchids room trex",
     "1008 x 756",
     PLANES_BETAS,
     {[SF_RUN_ANN] = {26.73, 0.839, 0, 11910},
      [SF_RUN_BETA_5E9] = {26.62, 0.832, 5.625, 6341},
      [SF_RUN_BETA_5E8] = {26.58, 0.831, 4.125, 5314},
      [SF_RUN_BETA_5E7] = {26.50, 0.828, 1.875, 3704}}},
    {"ingp", NULL, "scenes of none of the paper's sets", "", NULL, GRID_BETAS, {{0, 0, 0, 0}}},
    {"tensorf", NULL, "scenes of none of the paper's sets", "", NULL, PLANES_BETAS, {{0, 0, 0, 0}}},
};

static double published(double value)
{
  return value > 0 ? value : NAN;
}

double sf_paper_value(int group, int run, int metric)
{
  const sf_paper_row *row = &sf_paper_groups[group].row[run], *ann = &sf_paper_groups[group].row[SF_RUN_ANN];
  switch (metric) {
  case SF_METRIC_PSNR:
    return published(row->psnr);
  case SF_METRIC_SSIM:
    return published(row->ssim);
  case SF_METRIC_STEPS:
    return published(row->steps);
  case SF_METRIC_ENERGY:
    return published(row->energy);
  case SF_METRIC_SAVING:
    return run == SF_RUN_ANN ? NAN : 100 * (1 - published(row->energy) / published(ann->energy));
  case SF_METRIC_EXCESS:
    return run == SF_RUN_ANN ? NAN : pow(10, -published(row->psnr) / 10) - pow(10, -published(ann->psnr) / 10);
  default:
    return NAN;
  }
}
