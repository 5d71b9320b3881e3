/* Everything of a reproduction for machines: no date or name of this machine, no path but what a failed run says. */
#include "report/internal.h"
#include "base/io.h"
#include <math.h>

#define PAPER "Adaptive Time-step Training for Enhancing Spike-Based Neural Radiance Fields"

static const char *const metric_key[SF_METRICS] = {"psnr",
                                                   "ssim",
                                                   "steps",
                                                   "energy_mj",
                                                   "twin_energy_mj",
                                                   "psnr_fixed",
                                                   "psnr_float",
                                                   "fixed_minus_float",
                                                   "seconds",
                                                   "saving_percent",
                                                   "excess_squared_error",
                                                   "worth",
                                                   "worth_error",
                                                   "price"};

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

static cJSON *paper_json(int group, int run)
{
  cJSON *json = cJSON_CreateObject();
  for (int m = 0; m < SF_METRICS; m++)
    if (m <= SF_METRIC_ENERGY || m == SF_METRIC_SAVING || m == SF_METRIC_EXCESS)
      sf_json_add_real(json, metric_key[m], sf_paper_value(group, run, m));
  return json;
}

/* Means and, where there are several seeds, spreads. */
static cJSON *numbers_json(const sf_reproduction *r, int scenes, int run)
{
  cJSON *json = cJSON_CreateObject(), *spread = NULL;
  for (int m = 0; m < SF_METRICS; m++)
    if (m != SF_METRIC_SAVING) sf_json_add_real(json, metric_key[m], sf_reproduction_mean(r, scenes, run, m, NULL));
  sf_json_add_real(json, "saving_percent",
                   run == SF_RUN_ANN ? NAN : sf_reproduction_saving(r, scenes, run, SF_RUN_ANN));
  sf_json_add_real(json, "saving_of_twin_percent", sf_reproduction_saving(r, scenes, run, SF_SAVING_TWIN));
  for (int m = 0; m < SF_METRICS; m++) {
    const double value = sf_reproduction_spread(r, scenes, run, m);
    if (isnan(value)) continue;
    if (!spread) spread = cJSON_AddObjectToObject(json, "spread");
    sf_json_add_real(spread, metric_key[m], value);
  }
  return json;
}

static cJSON *seeds_json(const sf_report_scene *scene, int id)
{
  cJSON *list = cJSON_CreateArray();
  for (int k = 0; k < scene->seeds; k++) {
    const sf_run *run = &scene->of[k].run[id];
    if (!run->summary) continue;
    cJSON *json = cJSON_CreateObject();
    sf_json_add_real(json, "seed", sf_json_number(run->summary, "seed"));
    for (int m = 0; m < SF_METRICS; m++) sf_json_add_real(json, metric_key[m], run->value[m]);
    sf_json_add_real(json, "t_star", run->t_star);
    cJSON_AddItemToArray(list, json);
  }
  return list;
}

static cJSON *run_json(const sf_reproduction *r, int scene, int id)
{
  const sf_run *run = &r->scene[scene].run[id];
  cJSON *json = numbers_json(r, scene, id);
  add_text(json, "status", run->status ? run->status : "not run");
  cJSON_AddItemToObject(json, "seeds", seeds_json(&r->scene[scene], id));
  sf_json_add_real(json, "t_star", run->t_star);
  sf_json_add_real(json, "cosim_samples", run->cosim_samples);
  sf_json_add_real(json, "cosim_differences", run->cosim_differences);
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

static cJSON *average_json(const sf_reproduction *r, int group, int run)
{
  int scenes;
  cJSON *json = numbers_json(r, sf_scenes_of(group), run);
  sf_reproduction_mean(r, sf_scenes_of(group), run, SF_METRIC_PSNR, &scenes);
  cJSON_AddNumberToObject(json, "scenes", scenes);
  cJSON_AddItemToObject(json, "paper", paper_json(group, run));
  return json;
}

/* What the paper prints for the scene's set, or null. */
static void add_group(cJSON *json, const sf_report_scene *scene)
{
  const sf_paper_group *g = &sf_paper_groups[scene->group];
  if (scene->group >= SF_PAPER_GROUPS || !sf_report_says_field(scene)) return;
  cJSON *paper = cJSON_AddObjectToObject(json, "paper");
  cJSON_AddStringToObject(paper, "data", g->data);
  cJSON_AddStringToObject(paper, "backbone", g->backbone);
  cJSON_AddItemToObject(paper, "ann", paper_json(scene->group, SF_RUN_ANN));
  for (int i = 0; i < SF_BETAS; i++)
    cJSON_AddItemToObject(paper, sf_run_kinds[g->beta[i]].name, paper_json(scene->group, g->beta[i]));
}

static cJSON *order_json(const sf_order *o)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "ablation", o->group);
  cJSON_AddStringToObject(json, "first", sf_run_kinds[o->a].name);
  cJSON_AddStringToObject(json, "second", sf_run_kinds[o->b].name);
  cJSON_AddStringToObject(json, "metric", metric_key[o->metric]);
  sf_json_add_real(json, "paper_difference", o->paper);
  sf_json_add_real(json, "difference", o->ours);
  sf_json_add_real(json, "standard_error", o->error);
  cJSON_AddNumberToObject(json, "scenes", o->scenes);
  cJSON_AddNumberToObject(json, "pairs", o->pairs);
  cJSON_AddStringToObject(json, "same_order", sf_order_names[o->verdict]);
  return json;
}

static void add_orders(cJSON *json, const sf_reproduction *r, int group)
{
  sf_order order[SF_ORDERS_MAX];
  cJSON *list = cJSON_AddArrayToObject(json, "order");
  const int n = sf_reproduction_order(r, group, order);
  for (int i = 0; i < n; i++) cJSON_AddItemToArray(list, order_json(&order[i]));
}

static void add_tolerance(cJSON *json)
{
  cJSON *tolerance = cJSON_AddObjectToObject(json, "tie_tolerance");
  cJSON_AddNumberToObject(tolerance, "psnr", sf_order_tolerance[SF_METRIC_PSNR]);
  cJSON_AddNumberToObject(tolerance, "steps", sf_order_tolerance[SF_METRIC_STEPS]);
  cJSON_AddNumberToObject(tolerance, "energy_share", sf_order_tolerance[SF_METRIC_ENERGY]);
  cJSON_AddNumberToObject(tolerance, "standard_errors_with_seeds", 2);
}

/* Averages and orders of the groups that are there. */
static void add_averages(cJSON *json, const sf_reproduction *r)
{
  cJSON *groups = cJSON_AddArrayToObject(json, "groups");
  for (int g = 0; g < SF_GROUPS; g++) {
    int scenes = 0;
    for (int s = 0; s < r->count; s++) scenes += r->scene[s].group == g;
    if (!scenes) continue;
    cJSON *group = cJSON_CreateObject();
    cJSON_AddItemToArray(groups, group);
    cJSON_AddStringToObject(group, "data", sf_paper_groups[g].data);
    cJSON_AddStringToObject(group, "backbone", sf_paper_groups[g].backbone);
    cJSON *average = cJSON_AddObjectToObject(group, "average");
    for (int i = 0; i < SF_RUNS; i++)
      if (g == 0 || i == SF_RUN_ANN || sf_paper_value(g, i, SF_METRIC_PSNR) > 0 ||
          !isnan(sf_reproduction_mean(r, sf_scenes_of(g), i, SF_METRIC_PSNR, NULL)))
        cJSON_AddItemToObject(average, sf_run_kinds[i].name, average_json(r, g, i));
    add_orders(group, r, g);
  }
}

static void add_scenes(cJSON *json, const sf_reproduction *r)
{
  cJSON *scenes = cJSON_AddObjectToObject(json, "scenes");
  for (int s = 0; s < r->count; s++) {
    cJSON *scene = cJSON_AddObjectToObject(scenes, r->scene[s].name);
    add_group(scene, &r->scene[s]);
    for (int i = 0; i < SF_RUNS; i++)
      if (sf_report_expected(r, s, i)) cJSON_AddItemToObject(scene, sf_run_kinds[i].name, run_json(r, s, i));
  }
}

static sf_status add_tables(cJSON *json, const sf_reproduction *r)
{
  sf_grids tables;
  const sf_status status = sf_report_tables(r, &tables);
  cJSON *list = cJSON_AddArrayToObject(json, "tables");
  for (int i = 0; i < tables.count && !status.code; i++) cJSON_AddItemToArray(list, sf_grid_json(&tables.grid[i]));
  sf_grids_free(&tables);
  return status;
}

cJSON *sf_reproduction_json(const sf_reproduction *r)
{
  cJSON *json = cJSON_CreateObject();
  if (!json) return NULL;
  sf_json_add_text(json, "profile", r->profile);
  cJSON_AddStringToObject(json, "paper", PAPER);
  if (!sf_report_is_pairs(r)) add_tolerance(json), add_averages(json, r);
  add_scenes(json, r);
  cJSON *problems = cJSON_AddArrayToObject(json, "problems");
  for (int i = 0; i < r->problems; i++) cJSON_AddItemToArray(problems, cJSON_CreateString(r->problem[i]));
  if (add_tables(json, r).code == SF_OK) return json;
  cJSON_Delete(json);
  return NULL;
}

static sf_status write_csv(const sf_reproduction *r, const sf_grid *grid)
{
  char path[4096 + 320];
  sf_writer writer;
  snprintf(path, sizeof path, "%s/tables/%s.csv", r->dir, grid->name);
  SF_TRY(sf_writer_open(&writer, path));
  sf_grid_csv(writer.file, grid);
  return sf_writer_commit(&writer);
}

sf_status sf_reproduction_csv(const sf_reproduction *r, int *count)
{
  char dir[4096 + 16];
  sf_grids tables;
  *count = 0;
  snprintf(dir, sizeof dir, "%s/tables", r->dir);
  SF_TRY(sf_make_dir(dir));
  sf_status status = sf_report_tables(r, &tables);
  for (int i = 0; i < tables.count && !status.code; i++) {
    status = write_csv(r, &tables.grid[i]);
    *count += !status.code;
  }
  sf_grids_free(&tables);
  return status;
}
