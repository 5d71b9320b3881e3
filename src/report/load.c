/* Folders of runs to numbers. */
#include "report/internal.h"
#include "base/io.h"
#include <dirent.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TEXT_LIMIT = 1 << 20, SCENES_LIMIT = 4096, SEEDS_LIMIT = 1000 };

/* ---- one run ---- */

static void trim(char *text)
{
  size_t n = strlen(text);
  while (n && (text[n - 1] == '\n' || text[n - 1] == ' ')) text[--n] = 0;
}

/* NULL where the file is missing. */
static sf_status read_text(sf_reproduction *r, const char *dir, const char *name, char **text)
{
  char path[4096 + 512];
  size_t size;
  snprintf(path, sizeof path, "%s/%s", dir, name);
  *text = NULL;
  if (access(path, F_OK)) return sf_ok();
  sf_status status = sf_read_file(path, TEXT_LIMIT, text, &size);
  if (status.code == SF_E_MEMORY) return status;
  if (status.code) return sf_report_problem(r, "%s", status.message);
  trim(*text);
  return sf_ok();
}

static sf_status read_prefixes(sf_reproduction *r, const char *path, sf_run *run)
{
  const cJSON *list = sf_json_get(run->summary, "prefix_psnr");
  const int n = cJSON_GetArraySize(list);
  if (n > SF_T_MAX) return sf_report_problem(r, "%s: prefix_psnr has %d numbers, at most %d", path, n, SF_T_MAX);
  for (const cJSON *item = list ? list->child : NULL; item; item = item->next)
    run->prefix_psnr[run->prefixes++] = cJSON_IsNumber(item) ? item->valuedouble : NAN;
  return sf_ok();
}

static sf_status read_summary(sf_reproduction *r, const char *dir, bool ann, sf_run *run)
{
  char path[4096 + 512];
  snprintf(path, sizeof path, "%s/train.json", dir);
  SF_TRY(sf_report_read_json(r, path, &run->summary));
  if (!run->summary) return sf_ok();
  cJSON_DeleteItemFromObjectCaseSensitive(run->summary, "model"); /* a path of this machine */
  static const struct {
    const char *key;
    sf_metric metric;
  } field[] = {
      {"psnr", SF_METRIC_PSNR}, {"ssim", SF_METRIC_SSIM}, {"t_r", SF_METRIC_STEPS}, {"seconds", SF_METRIC_SECONDS}};
  for (size_t i = 0; i < sizeof field / sizeof *field; i++) {
    run->value[field[i].metric] = sf_json_number(run->summary, field[i].key);
    const bool none = cJSON_IsNull(sf_json_get(run->summary, field[i].key));
    if (isnan(run->value[field[i].metric]) && !(field[i].metric == SF_METRIC_SSIM && none)) /* tiny views have none */
      SF_TRY(sf_report_problem(r, "%s: no finite number '%s'", path, field[i].key));
  }
  const cJSON *search = sf_json_get(run->summary, "search");
  run->value[SF_METRIC_WORTH] = sf_json_number(search, "worth");
  run->value[SF_METRIC_WORTH_ERROR] = sf_json_number(search, "worth_error");
  run->value[SF_METRIC_PRICE] = sf_json_number(search, "price");
  run->t_star = sf_json_number(run->summary, "t_star");
  if (ann) run->value[SF_METRIC_STEPS] = run->t_star = NAN;
  return read_prefixes(r, path, run);
}

static sf_status read_cosim(sf_reproduction *r, const char *dir, sf_run *run)
{
  char path[4096 + 512];
  cJSON *json;
  snprintf(path, sizeof path, "%s/cosim.json", dir);
  SF_TRY(sf_report_read_json(r, path, &json));
  run->cosim_samples = sf_json_number(json, "samples");
  run->cosim_differences = sf_json_number(json, "differences");
  const bool broken = json && (isnan(run->cosim_samples) || isnan(run->cosim_differences));
  cJSON_Delete(json);
  if (broken) return sf_report_problem(r, "%s: no samples and differences", path);
  if (run->cosim_differences > 0)
    return sf_report_problem(r, "%s: RTL and fixed-point core differ: %.0f of %.0f samples", path,
                             run->cosim_differences, run->cosim_samples);
  return sf_ok();
}

static sf_status load_run(sf_reproduction *r, const char *scene_dir, int id, sf_run *run)
{
  static const int spiking[] = {SF_RUN_BETA_5E7, SF_RUN_BETA_1E7, SF_RUN_BETA_1E6, SF_RUN_BETA_5E8, SF_RUN_BETA_5E9};
  char dir[4096 + 320], reference[4096 + 320], log[4096 + 384], exported[4096 + 384], converted[4096 + 384];
  for (int m = 0; m < SF_METRICS; m++) run->value[m] = NAN;
  for (int t = 0; t < SF_T_MAX; t++) run->prefix_energy[t] = NAN;
  run->t_star = NAN;
  snprintf(dir, sizeof dir, "%s/%s", scene_dir, sf_run_kinds[id].name);
  for (int i = 0; i < (int)(sizeof spiking / sizeof *spiking); i++) { /* as reproduce.sh */
    snprintf(reference, sizeof reference, "%s/%s", scene_dir, sf_run_kinds[spiking[i]].name);
    snprintf(exported, sizeof exported, "%s/scene.snn", reference);
    if (access(exported, F_OK) == 0) break;
  }
  snprintf(log, sizeof log, "%s/train.jsonl", dir);
  snprintf(converted, sizeof converted, "%s/convert.json", dir);
  SF_TRY(read_text(r, dir, "status", &run->status));
  SF_TRY(read_text(r, dir, "train.cmd", &run->train_command));
  SF_TRY(read_text(r, dir, "eval.cmd", &run->eval_command));
  SF_TRY(read_text(r, dir, "version", &run->version));
  SF_TRY(read_summary(r, dir, id == SF_RUN_ANN, run));
  SF_TRY(read_cosim(r, dir, run));
  SF_TRY(sf_report_read_json(r, converted, &run->converted));
  SF_TRY(sf_report_load_log(log, run));
  return sf_report_load_frames(r, dir, reference, id == SF_RUN_ANN, run);
}

static void free_run(sf_run *run)
{
  free(run->iteration), free(run->t_star_at), free(run->firing);
  free(run->status), free(run->train_command), free(run->eval_command), free(run->version);
  cJSON_Delete(run->summary), cJSON_Delete(run->converted);
}

/* ---- scenes ---- */

static bool is_scene(const char *dir)
{
  char path[4096 + 384];
  for (int i = 0; i < SF_RUNS; i++) {
    snprintf(path, sizeof path, "%s/%s", dir, sf_run_kinds[i].name);
    if (access(path, F_OK) == 0) return true;
  }
  return false;
}

static sf_status load_seed(sf_reproduction *r, sf_report_scene *scene, const char *dir, int seed)
{
  sf_seed_runs *list = realloc(scene->of, (size_t)(scene->seeds + 1) * sizeof *list);
  if (!list) return sf_report_no_memory(r);
  scene->of = list;
  sf_seed_runs *runs = &list[scene->seeds++];
  memset(runs, 0, sizeof *runs);
  runs->seed = seed;
  for (int i = 0; i < SF_RUNS; i++) SF_TRY(load_run(r, dir, i, &runs->run[i]));
  return sf_ok();
}

/* The number in "seed-N"; 0: another name. */
static int seed_of(const char *name)
{
  char *end;
  if (strncmp(name, "seed-", 5) != 0 || name[5] < '0' || name[5] > '9') return 0;
  const long seed = strtol(name + 5, &end, 10);
  return *end || seed > 1 << 30 ? 0 : (int)seed;
}

static int is_seed(const struct dirent *entry)
{
  return seed_of(entry->d_name) > 0;
}

static int compare_seeds(const struct dirent **a, const struct dirent **b)
{
  return seed_of((*a)->d_name) - seed_of((*b)->d_name);
}

static sf_status load_seeds(sf_reproduction *r, sf_report_scene *scene, const char *dir)
{
  char path[4096 + 320];
  struct dirent **entry;
  SF_TRY(load_seed(r, scene, dir, 0));
  const int n = scandir(dir, &entry, is_seed, compare_seeds);
  sf_status status = n > SEEDS_LIMIT ? sf_fail(SF_E_RANGE, "%s: more than %d seeds", dir, SEEDS_LIMIT) : sf_ok();
  for (int i = 0; i < n; i++) {
    snprintf(path, sizeof path, "%s/seed-%d", dir, seed_of(entry[i]->d_name));
    if (!status.code && is_scene(path)) status = load_seed(r, scene, path, seed_of(entry[i]->d_name));
    free(entry[i]);
  }
  if (n >= 0) free(entry);
  return status;
}

static bool has_seeds(const char *dir)
{
  struct dirent **entry;
  const int n = scandir(dir, &entry, is_seed, NULL);
  for (int i = 0; i < n; i++) free(entry[i]);
  if (n >= 0) free(entry);
  return n > 0;
}

static sf_status load_scene(sf_reproduction *r, const char *name)
{
  char dir[4096 + 260];
  snprintf(dir, sizeof dir, "%s/%s", r->dir, name);
  if (name[0] == '.' || !(is_scene(dir) || has_seeds(dir))) return sf_ok();
  sf_report_scene *list = realloc(r->scene, (size_t)(r->count + 1) * sizeof *list);
  if (!list) return sf_report_no_memory(r);
  r->scene = list;
  sf_report_scene *scene = &list[r->count++];
  memset(scene, 0, sizeof *scene);
  snprintf(scene->name, sizeof scene->name, "%s", name);
  SF_TRY(read_text(r, dir, "kind", &scene->kind));
  return load_seeds(r, scene, dir);
}

/* ---- all of them ---- */

static const char *last_part(const char *path)
{
  const char *slash = strrchr(path, '/');
  return slash && slash[1] ? slash + 1 : path;
}

sf_status sf_reproduction_load(sf_reproduction *r, const char *dir)
{
  *r = (sf_reproduction){0};
  snprintf(r->dir, sizeof r->dir, "%s", dir);
  for (size_t n = strlen(r->dir); n > 1 && r->dir[n - 1] == '/'; n--) r->dir[n - 1] = 0;
  snprintf(r->profile, sizeof r->profile, "%s", last_part(r->dir));
  if (!strcmp(r->profile, ".") || !strcmp(r->profile, "..")) {
    char *whole = realpath(r->dir, NULL);
    if (whole) snprintf(r->profile, sizeof r->profile, "%s", last_part(whole));
    free(whole);
  }
  struct dirent **entry;
  const int n = scandir(r->dir, &entry, NULL, alphasort);
  if (n < 0) return sf_fail(SF_E_IO, "%s: cannot list the folder", r->dir);
  sf_status status = n > SCENES_LIMIT ? sf_fail(SF_E_RANGE, "%s: more than %d entries", r->dir, SCENES_LIMIT) : sf_ok();
  for (int i = 0; i < n; i++) {
    if (!status.code) status = load_scene(r, entry[i]->d_name);
    free(entry[i]);
  }
  free(entry);
  if (!status.code) status = sf_report_compare_parameters(r);
  if (!status.code) sf_report_pool(r);
  if (status.code) sf_reproduction_free(r);
  return status;
}

void sf_reproduction_free(sf_reproduction *r)
{
  for (int s = 0; s < r->count; s++) {
    for (int k = 0; k < r->scene[s].seeds; k++)
      for (int i = 0; i < SF_RUNS; i++) free_run(&r->scene[s].of[k].run[i]);
    free(r->scene[s].of), free(r->scene[s].kind);
  }
  for (int i = 0; i < r->problems; i++) free(r->problem[i]);
  free(r->scene), free(r->problem);
  *r = (sf_reproduction){0};
}
