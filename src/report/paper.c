/* The runs and what the paper reports for them: "Adaptive Time-step Training for Enhancing Spike-Based Neural Radiance
 * Fields", INGP backbone, averages over the eight Synthetic scenes at 800 x 800. */
#include "report/report.h"
#include "base/json.h"
#include <math.h>
#include <string.h>

#define ROW(psnr, ssim, steps, energy, saving) {psnr, ssim, steps, energy, NAN, NAN, NAN, NAN, NAN}, saving

const sf_run_kind sf_run_kinds[SF_RUNS] = {
    [SF_RUN_ANN] = {"ann", "ANN (ReLU twin)", ROW(32.14, 0.959, NAN, 955.27, NAN)},
    [SF_RUN_BETA_1E7] = {"beta-1e-7", "beta = 1e-7", ROW(32.45, 0.959, 5.125, 643.39, 32.65)},
    [SF_RUN_BETA_5E7] = {"beta-5e-7", "beta = 5e-7 (full)", ROW(32.21, 0.957, 3.625, 492.25, 48.47)},
    [SF_RUN_BETA_1E6] = {"beta-1e-6", "beta = 1e-6", ROW(32.04, 0.956, 2.875, 405.33, 57.57)},
    [SF_RUN_HYBRID] = {"mode-hybrid", "input hybrid, T = 8", ROW(32.12, NAN, 8, NAN, NAN)},
    [SF_RUN_NO_DECAY] = {"mode-no-decay", "input no-decay, T = 8", ROW(32.09, NAN, 8, NAN, NAN)},
    [SF_RUN_DECAY] = {"mode-decay", "input decay, T = 8", ROW(31.82, NAN, 8, NAN, NAN)},
    [SF_RUN_NO_STAGE1] = {"no-stage1", "without stage I", ROW(31.59, NAN, 3.625, NAN, NAN)},
    [SF_RUN_NO_EXTRA] = {"no-extra", "without L_extra", ROW(31.69, NAN, 1.625, NAN, NAN)},
    [SF_RUN_NO_PENALTY] = {"no-penalty", "without L_penalty", ROW(32.61, NAN, 6.625, NAN, NAN)},
    [SF_RUN_NO_BUDGET] = {"no-budget", "without L_budg", ROW(32.02, NAN, 5.875, NAN, NAN)},
    [SF_RUN_T_MINUS_1] = {"fixed-t-minus-1", "fixed t_r - 1", ROW(31.69, NAN, NAN, 398.37, NAN)},
    [SF_RUN_T] = {"fixed-t", "fixed t_r", ROW(32.11, NAN, NAN, 491.70, NAN)},
    [SF_RUN_T_PLUS_1] = {"fixed-t-plus-1", "fixed t_r + 1", ROW(32.29, NAN, NAN, 623.01, NAN)},
};

const sf_paper_group sf_paper_groups[SF_PAPER_GROUPS] = {
    {"ingp", "blender", "Synthetic", 32.14, 955.27, 32.21, 0.957, 3.625, 492.25},
    {"ingp", "colmap", "Mip-NeRF 360", 25.48, 18980, 25.09, 0.646, 4.857, 13660},
    {"tensorf", "blender", "Synthetic", 33.14, 1261, 32.91, 0.959, 2, 748.4},
    {"tensorf", "llff", "LLFF", 26.73, 11910, 26.50, 0.828, 1.875, 3704},
};

const sf_paper_group *sf_reproduction_group(const sf_report_scene *scene)
{
  const cJSON *summary = NULL;
  for (int run = SF_RUN_BETA_1E7; run < SF_RUNS && !summary; run++) summary = scene->run[run].summary;
  for (int i = 0; summary && i < SF_PAPER_GROUPS; i++)
    if (sf_json_says(summary, "backbone", sf_paper_groups[i].backbone) &&
        sf_json_says(summary, "layout", sf_paper_groups[i].layout))
      return &sf_paper_groups[i];
  return NULL;
}
