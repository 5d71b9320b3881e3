/* Profile scenes: scenes of any kind, each with its fields, in one table. */
#include "report/internal.h"
#include "base/json.h"

static const char *text_of(const cJSON *json, const char *key)
{
  const char *text = sf_json_text(json, key);
  return text ? text : "-";
}

static void pair_row(sf_grids *t, const sf_reproduction *r, int scene, int id)
{
  const sf_report_scene *one = &r->scene[scene];
  const sf_run *run = &one->run[id];
  const double ann = one->run[SF_RUN_ANN].value[SF_METRIC_PSNR];
  sf_grid_row(t);
  sf_grid_cell(t, "%s", one->name), sf_grid_cell(t, "%s", text_of(run->summary, "backbone"));
  sf_grid_cell(t, "%g", sf_report_number(run->summary, "beta")),
      sf_grid_number(t, 0, run->value[SF_METRIC_SECONDS] / 60);
  sf_grid_number(t, 2, ann), sf_grid_number(t, 2, run->value[SF_METRIC_PSNR]),
      sf_grid_number(t, 2, run->value[SF_METRIC_PSNR] - ann);
  sf_grid_number(t, 4, run->value[SF_METRIC_SSIM]), sf_grid_number(t, 0, run->value[SF_METRIC_STEPS]);
  sf_grid_number(t, 1, sf_reproduction_saving(r, scene, id, SF_SAVING_TWIN));
  sf_grid_number(t, 1, sf_reproduction_saving(r, scene, id, SF_RUN_ANN));
  sf_grid_number(t, 2, run->value[SF_METRIC_LOSS]);
  sf_grid_number(t, 0, run->cosim_samples), sf_grid_number(t, 0, run->cosim_differences);
}

static void paper_row(sf_grids *t, int group)
{
  const sf_paper_group *g = &sf_paper_groups[group];
  const int run = SF_RUN_BETA_5E7;
  const double ann = sf_paper_value(group, SF_RUN_ANN, SF_METRIC_PSNR),
               psnr = sf_paper_value(group, run, SF_METRIC_PSNR);
  sf_grid_row(t);
  sf_grid_cell(t, "paper: %s", g->data), sf_grid_cell(t, "%s", g->backbone), sf_grid_cell(t, "5e-07");
  sf_grid_cell(t, "-"), sf_grid_number(t, 2, ann), sf_grid_number(t, 2, psnr), sf_grid_number(t, 2, psnr - ann);
  sf_grid_number(t, 3, sf_paper_value(group, run, SF_METRIC_SSIM));
  sf_grid_number(t, 3, sf_paper_value(group, run, SF_METRIC_STEPS)), sf_grid_cell(t, "-");
  sf_grid_number(t, 1, sf_paper_value(group, run, SF_METRIC_SAVING));
  for (int i = 0; i < 3; i++) sf_grid_cell(t, "-");
}

/* A scene and a field a row; below them the paper's for their kinds, each once. */
void sf_report_add_pairs(sf_grids *t, const sf_reproduction *r)
{
  static const char *const title[] = {"scene",      "backbone",   "beta",           "minutes",    "ANN dB",
                                      "spiking dB", "difference", "SSIM",           "t_r",        "of twin %",
                                      "saving %",   "fixed dB",   "samples in RTL", "differences"};
  sf_grid_begin(t, 2, "scenes", "");
  for (size_t i = 0; i < sizeof title / sizeof *title; i++) sf_grid_cell(t, "%s", title[i]);
  for (int s = 0; s < r->count; s++)
    for (int i = SF_RUN_ANN + 1; i < SF_RUNS; i++)
      if (r->scene[s].run[i].summary) pair_row(t, r, s, i);
  for (int g = 0; g < SF_PAPER_GROUPS; g++)
    for (int s = 0; s < r->count; s++)
      if (r->scene[s].group == g && sf_report_says_field(&r->scene[s])) {
        paper_row(t, g);
        break;
      }
  sf_grid_note(
      t, "minutes: of training, each run. PSNR and SSIM: float, all held-out views, spiking at its learned t_r. of "
         "twin: energy saved against the\n"
         "ReLU twin on the samples of the spiking frame; saving: against the ANN run on its own samples, as in the\n"
         "paper. fixed: PSNR of the fixed-point core minus float, audited frames. samples in RTL: co-simulated with\n"
         "the fixed-point core. Paper: averages over that set of scenes, beta = 5e-7, after its full training.");
}
