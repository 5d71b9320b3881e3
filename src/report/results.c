/* Everything of a reproduction for machines: no date or name of this machine, no path but what a failed run says. */
#include "report/internal.h"
#include "base/json.h"
#include <math.h>

#define PAPER "Adaptive Time-step Training for Enhancing Spike-Based Neural Radiance Fields"

static const char *const metric_key[SF_METRICS] = {
    "psnr", "ssim", "steps", "energy_mj", "twin_energy_mj", "psnr_fixed", "psnr_float", "fixed_minus_float", "seconds"};

static void add_number(cJSON *object, const char *key, double value)
{
  if (isfinite(value))
    cJSON_AddNumberToObject(object, key, value);
  else
    cJSON_AddNullToObject(object, key);
}

static void add_text(cJSON *object, const char *key, const char *text)
{
  if (text)
    sf_json_add_text(object, key, text);
  else
    cJSON_AddNullToObject(object, key);
}

static void add_list(cJSON *object, const char *key, const double *value, int count)
{
  cJSON *list = cJSON_AddArrayToObject(object, key);
  for (int i = 0; i < count; i++)
    cJSON_AddItemToArray(list, isfinite(value[i]) ? cJSON_CreateNumber(value[i]) : cJSON_CreateNull());
}

static cJSON *paper_json(int run)
{
  const sf_run_kind *kind = &sf_run_kinds[run];
  cJSON *json = cJSON_CreateObject();
  for (int m = 0; m <= SF_METRIC_ENERGY; m++) add_number(json, metric_key[m], kind->paper[m]);
  add_number(json, "saving_percent", kind->paper_saving);
  return json;
}

/* scene < 0: averages. */
static cJSON *numbers_json(const sf_reproduction *r, int scene, int run)
{
  cJSON *json = cJSON_CreateObject();
  for (int m = 0; m < SF_METRICS; m++) add_number(json, metric_key[m], sf_reproduction_mean(r, scene, run, m, NULL));
  add_number(json, "saving_percent", run == SF_RUN_ANN ? NAN : sf_reproduction_saving(r, scene, run, SF_RUN_ANN));
  add_number(json, "saving_of_twin_percent", sf_reproduction_saving(r, scene, run, SF_SAVING_TWIN));
  return json;
}

static cJSON *run_json(const sf_reproduction *r, int scene, int id)
{
  const sf_run *run = &r->scene[scene].run[id];
  cJSON *json = numbers_json(r, scene, id);
  add_text(json, "status", run->status ? run->status : "not run");
  add_number(json, "t_star", run->t_star);
  add_number(json, "cosim_samples", run->cosim_samples);
  add_number(json, "cosim_differences", run->cosim_differences);
  cJSON_AddNumberToObject(json, "audited_frames", run->audits);
  cJSON_AddNumberToObject(json, "frame_width", run->width);
  cJSON_AddNumberToObject(json, "frame_height", run->height);
  add_list(json, "prefix_psnr", run->prefix_psnr, run->prefixes);
  add_list(json, "prefix_energy_mj", run->prefix_energy, isnan(run->prefix_energy[0]) ? 0 : SF_T_MAX);
  add_text(json, "train", run->train_command);
  add_text(json, "evaluate", run->eval_command);
  add_text(json, "version", run->version);
  cJSON_AddItemToObject(json, "summary", run->summary ? cJSON_Duplicate(run->summary, 1) : cJSON_CreateNull());
  cJSON *log = cJSON_AddObjectToObject(json, "t_star_over_iterations");
  add_list(log, "iteration", run->iteration, run->points);
  add_list(log, "t_star", run->t_star_at, run->points);
  return json;
}

static cJSON *average_json(const sf_reproduction *r, int run)
{
  int scenes;
  cJSON *json = numbers_json(r, -1, run);
  sf_reproduction_mean(r, -1, run, SF_METRIC_PSNR, &scenes);
  cJSON_AddNumberToObject(json, "scenes", scenes);
  cJSON_AddItemToObject(json, "paper", paper_json(run));
  return json;
}

static cJSON *group_json(const sf_paper_group *g)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "data", g->data);
  add_number(json, "ann_psnr", g->ann_psnr), add_number(json, "ann_energy_mj", g->ann_energy);
  add_number(json, "psnr", g->psnr), add_number(json, "ssim", g->ssim), add_number(json, "steps", g->steps);
  add_number(json, "energy_mj", g->energy);
  return json;
}

static cJSON *order_json(const sf_order *o)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "ablation", o->group);
  cJSON_AddStringToObject(json, "first", sf_run_kinds[o->a].name);
  cJSON_AddStringToObject(json, "second", sf_run_kinds[o->b].name);
  cJSON_AddStringToObject(json, "metric", metric_key[o->metric]);
  add_number(json, "paper_difference", o->paper);
  add_number(json, "difference", o->ours);
  cJSON_AddNumberToObject(json, "scenes", o->scenes);
  cJSON_AddStringToObject(json, "same_order", sf_order_names[o->verdict]);
  return json;
}

static void add_orders(cJSON *json, const sf_reproduction *r)
{
  sf_order order[SF_ORDERS_MAX];
  cJSON *tolerance = cJSON_AddObjectToObject(json, "tie_tolerance");
  cJSON_AddNumberToObject(tolerance, "psnr", sf_order_tolerance[SF_METRIC_PSNR]);
  cJSON_AddNumberToObject(tolerance, "steps", sf_order_tolerance[SF_METRIC_STEPS]);
  cJSON_AddNumberToObject(tolerance, "energy_share", sf_order_tolerance[SF_METRIC_ENERGY]);
  cJSON *list = cJSON_AddArrayToObject(json, "order");
  const int n = sf_reproduction_order(r, order);
  for (int i = 0; i < n; i++) cJSON_AddItemToArray(list, order_json(&order[i]));
}

cJSON *sf_reproduction_json(const sf_reproduction *r)
{
  cJSON *json = cJSON_CreateObject();
  if (!json) return NULL;
  sf_json_add_text(json, "profile", r->profile);
  if (sf_report_is_pairs(r)) {
    cJSON_AddStringToObject(json, "paper", PAPER);
  } else {
    cJSON_AddStringToObject(json, "paper",
                            PAPER ": INGP backbone, averages over the eight Synthetic scenes, 800 x 800");
    cJSON *average = cJSON_AddObjectToObject(json, "average");
    for (int i = 0; i < SF_RUNS; i++) cJSON_AddItemToObject(average, sf_run_kinds[i].name, average_json(r, i));
    add_orders(json, r);
  }
  cJSON *scenes = cJSON_AddObjectToObject(json, "scenes");
  for (int s = 0; s < r->count; s++) {
    cJSON *scene = cJSON_AddObjectToObject(scenes, r->scene[s].name);
    const sf_paper_group *group = sf_reproduction_group(&r->scene[s]);
    if (group) cJSON_AddItemToObject(scene, "paper", group_json(group));
    for (int i = 0; i < SF_RUNS; i++) cJSON_AddItemToObject(scene, sf_run_kinds[i].name, run_json(r, s, i));
  }
  cJSON *problems = cJSON_AddArrayToObject(json, "problems");
  for (int i = 0; i < r->problems; i++) cJSON_AddItemToArray(problems, cJSON_CreateString(r->problem[i]));
  return json;
}
