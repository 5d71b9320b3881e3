/* What is computed from several runs: numbers over the seeds of a run, savings and errors beside the twin, groups. */
#include "report/internal.h"
#include "base/json.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- beside the twin ---- */

/* Of a held-out view, as the trainer counted it; NaN: it did not. */
static double counted(const sf_run *run, const char *key)
{
  return sf_json_number(sf_json_get(run->summary, "frame"), key);
}

/* No audit counts it: what it costs beside the twin on the held-out views. */
static void price_along(const sf_run *twin, sf_run *along)
{
  const double mj = twin->value[SF_METRIC_ENERGY];
  along->value[SF_METRIC_ENERGY] = mj * counted(along, "energy_mj") / counted(twin, "energy_mj");
  along->value[SF_METRIC_TWIN] = mj * counted(along, "samples") / counted(twin, "samples");
}

static void beside_twin(sf_run run[SF_RUNS])
{
  const double *twin = run[SF_RUN_ANN].value;
  price_along(&run[SF_RUN_ANN], &run[SF_RUN_ALONG]);
  for (int i = SF_RUN_ANN + 1; i < SF_RUNS; i++) {
    double *v = run[i].value;
    v[SF_METRIC_SAVING] = 100 * (1 - v[SF_METRIC_ENERGY] / twin[SF_METRIC_ENERGY]);
    v[SF_METRIC_EXCESS] = sf_squared_error(v[SF_METRIC_PSNR]) - sf_squared_error(twin[SF_METRIC_PSNR]);
  }
}

/* ---- means over the seeds ---- */

static void pool_prefixes(const sf_report_scene *scene, int id, sf_run *run)
{
  for (int t = 0; t < SF_T_MAX; t++) {
    sf_mean psnr = {0}, energy = {0};
    for (int k = 0; k < scene->seeds; k++) {
      const sf_run *one = &scene->of[k].run[id];
      if (t < one->prefixes) sf_mean_add(&psnr, one->prefix_psnr[t]);
      sf_mean_add(&energy, one->prefix_energy[t]);
    }
    if (psnr.count) run->prefix_psnr[t] = sf_mean_of(&psnr), run->prefixes = t + 1;
    run->prefix_energy[t] = sf_mean_of(&energy);
  }
}

static void pool_run(sf_report_scene *scene, int id)
{
  int first = 0;
  while (first < scene->seeds - 1 && !scene->of[first].run[id].summary) first++;
  if (!scene->of[first].run[id].summary) first = 0;
  sf_run *run = &scene->run[id];
  *run = scene->of[first].run[id];
  if (scene->seeds == 1) return;
  sf_mean t_star = {0};
  for (int m = 0; m < SF_METRICS; m++) {
    sf_mean value = {0};
    for (int k = 0; k < scene->seeds; k++) sf_mean_add(&value, scene->of[k].run[id].value[m]);
    run->value[m] = sf_mean_of(&value);
  }
  for (int k = 0; k < scene->seeds; k++) sf_mean_add(&t_star, scene->of[k].run[id].t_star);
  run->t_star = sf_mean_of(&t_star);
  pool_prefixes(scene, id, run);
}

/* ---- groups ---- */

/* By data and field, as a summary says or, while no run has one, the scene's folder; where nothing does, the first
 * group, as all of profile quick are. */
static int group_of(const sf_report_scene *scene)
{
  char kind[2][32] = {"", ""};
  const char *layout = kind[0], *backbone = NULL;
  for (int run = SF_RUN_ANN; run < SF_RUNS && !backbone; run++) {
    backbone = sf_json_text(scene->run[run].summary, "backbone");
    if (backbone) layout = sf_json_text(scene->run[run].summary, "layout");
  }
  if (!backbone && scene->kind && sscanf(scene->kind, "%31s %31s", kind[0], kind[1]) == 2) backbone = kind[1];
  if (!backbone) return 0;
  for (int i = 0; i < SF_GROUPS; i++) {
    const sf_paper_group *g = &sf_paper_groups[i];
    if (!strcmp(backbone, g->backbone) && (!g->layout || (layout && !strcmp(layout, g->layout)))) return i;
  }
  return SF_PAPER_GROUPS;
}

void sf_report_pool(sf_reproduction *r)
{
  for (int s = 0; s < r->count; s++) {
    sf_report_scene *scene = &r->scene[s];
    for (int k = 0; k < scene->seeds; k++) beside_twin(scene->of[k].run);
    for (int i = 0; i < SF_RUNS; i++) pool_run(scene, i);
    scene->group = group_of(scene);
  }
}
