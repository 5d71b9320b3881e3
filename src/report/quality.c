#include "report/quality.h"
#include "report/internal.h"
#include "base/json.h"
#include "snn/model.h"
#include <dirent.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { SEEDS_MAX = 64, SCENES_MAX = 256 };

static const struct {
  const char *key, *title, *format;
} columns[SF_QUALITIES] = {{"psnr", "spiking dB", "%.2f"},
                           {"twin_psnr", "twin dB", "%.2f"},
                           {"excess_mse", "excess error", "%.1e"},
                           {"t_star", "t*", "%.2f"},
                           {"t_r", "t_r", "%.1f"},
                           {"worth", "worth", "%.1e"},
                           {"price", "price", "%.1e"},
                           {"lost_cells", "cells lost", "%.3f"},
                           {"seconds", "seconds", "%.0f"}};

static int by_name(const void *a, const void *b)
{
  return strcmp(((const sf_quality_scene *)a)->name, ((const sf_quality_scene *)b)->name);
}

/* Occupied cells that the twins of all seeds have: what one of them has alone is its noise. */
typedef struct cells {
  uint8_t *bits; /* owned; NULL before the first twin */
  size_t bytes;
  bool comparable; /* hash grids of one size */
} cells;

static sf_status add_twin(cells *c, const char *path)
{
  sf_model m = {0};
  if (access(path, F_OK)) return sf_ok();
  sf_status status = sf_model_load(&m, path);
  const size_t bytes = status.code ? 0 : sf_config_cells(&m.config) / 8;
  if (!status.code && !c->bits) {
    *c = (cells){malloc(bytes), bytes, sf_model_has(&m, SF_P_GRID)};
    if (c->bits)
      memcpy(c->bits, m.occupancy, bytes);
    else
      status = sf_fail(SF_E_MEMORY, "%s: no memory for its cells", path);
  } else if (!status.code && (c->comparable = c->comparable && bytes == c->bytes))
    for (size_t i = 0; i < bytes; i++) c->bits[i] &= m.occupancy[i];
  sf_model_free(&m);
  return status;
}

/* Share of these cells that are empty in the model. */
static sf_status lost_cells(const cells *twin, const char *path, double *lost)
{
  sf_model m = {0};
  if (!twin->bits || !twin->comparable || access(path, F_OK)) return sf_ok();
  const sf_status status = sf_model_load(&m, path);
  size_t has = 0, gone = 0;
  if (!status.code && sf_config_cells(&m.config) / 8 == twin->bytes)
    for (size_t i = 0; i < twin->bytes; i++) {
      has += (size_t)__builtin_popcount(twin->bits[i]);
      gone += (size_t)__builtin_popcount(twin->bits[i] & ~(unsigned)m.occupancy[i]);
    }
  if (has) *lost = (double)gone / (double)has;
  sf_model_free(&m);
  return status;
}

static void add_state(sf_quality_scene *scene, const cJSON *search)
{
  const char *state = sf_json_text(search, "state");
  if (!state || strstr(scene->states, state)) return;
  const size_t used = strlen(scene->states);
  snprintf(scene->states + used, sizeof scene->states - used, "%s%s", used ? ", " : "", state);
}

/* One seed's numbers; NaN where a run is missing. */
static sf_status load_seed(const char *dir, const char *seed, const cells *twin, sf_quality_scene *scene,
                           double value[SF_QUALITIES])
{
  char path[4096 + 800];
  cJSON *run[2] = {NULL, NULL};
  sf_status status = sf_ok();
  for (int i = 0; i < 2 && !status.code; i++) {
    snprintf(path, sizeof path, "%s/%s/%s-%s/train.json", dir, scene->name, i ? "ann" : "snn", seed);
    if (!access(path, F_OK)) status = sf_json_load(path, &run[i]);
  }
  for (int i = 0; i < SF_QUALITIES; i++) value[i] = NAN;
  if (!status.code) {
    const cJSON *search = sf_json_get(run[0], "search");
    value[SF_QUALITY_PSNR] = sf_json_number(run[0], "psnr");
    value[SF_QUALITY_TWIN] = sf_json_number(run[1], "psnr");
    value[SF_QUALITY_EXCESS] = sf_squared_error(value[SF_QUALITY_PSNR]) - sf_squared_error(value[SF_QUALITY_TWIN]);
    value[SF_QUALITY_T_STAR] = sf_json_number(run[0], "t_star");
    value[SF_QUALITY_STEPS] = sf_json_number(run[0], "t_r");
    value[SF_QUALITY_WORTH] = sf_json_number(search, "worth");
    value[SF_QUALITY_PRICE] = sf_json_number(search, "price");
    value[SF_QUALITY_SECONDS] = sf_json_number(run[0], "seconds");
    add_state(scene, search);
    snprintf(path, sizeof path, "%s/%s/snn-%s/model.safetensors", dir, scene->name, seed);
    if (run[0]) status = lost_cells(twin, path, &value[SF_QUALITY_LOST]);
  }
  cJSON_Delete(run[0]);
  cJSON_Delete(run[1]);
  return status;
}

static void add_value(sf_spread *s, double value)
{
  if (isnan(value)) return;
  s->least = s->count ? fmin(s->least, value) : value;
  s->most = s->count ? fmax(s->most, value) : value;
  s->mean += (value - s->mean) / ++s->count;
}

/* The seeds that the folder holds for one kind of net, sorted: names of folders behind `prefix`. */
static int list_seeds(const char *path, const char *prefix, char seed[SEEDS_MAX][32])
{
  DIR *folder = opendir(path);
  int count = 0;
  for (const struct dirent *e; folder && count < SEEDS_MAX && (e = readdir(folder));)
    if (!strncmp(e->d_name, prefix, strlen(prefix)) && strlen(e->d_name) < 32)
      strcpy(seed[count++], e->d_name + strlen(prefix));
  if (folder) closedir(folder);
  qsort(seed, (size_t)count, sizeof *seed, (int (*)(const void *, const void *))strcmp);
  return count;
}

static sf_status load_scene(const char *dir, sf_quality_scene *scene)
{
  char path[4096 + 300], file[4096 + 600], seed[SEEDS_MAX][32];
  double value[SF_QUALITIES];
  cells twin = {0};
  sf_status status = sf_ok();
  snprintf(path, sizeof path, "%s/%s", dir, scene->name);
  int seeds = list_seeds(path, "ann-", seed);
  for (int i = 0; i < seeds && !status.code; i++) {
    snprintf(file, sizeof file, "%s/ann-%.31s/model.safetensors", path, seed[i]);
    status = add_twin(&twin, file);
  }
  seeds = list_seeds(path, "snn-", seed);
  for (int i = 0; i < seeds && !status.code; i++) {
    status = load_seed(dir, seed[i], &twin, scene, value);
    for (int v = 0; v < SF_QUALITIES && !status.code; v++) add_value(&scene->value[v], value[v]);
  }
  free(twin.bits);
  for (int v = 0; v < SF_QUALITIES; v++)
    if (!scene->value[v].count) scene->value[v].mean = scene->value[v].least = scene->value[v].most = NAN;
  return status;
}

sf_status sf_quality_load(sf_quality *q, const char *dir)
{
  *q = (sf_quality){.scene = calloc(SCENES_MAX, sizeof *q->scene)};
  if (!q->scene) return sf_fail(SF_E_MEMORY, "%s: no memory for the scenes", dir);
  DIR *folder = opendir(dir);
  if (!folder) return sf_fail(SF_E_IO, "%s: no such folder", dir);
  sf_status status = sf_ok();
  for (const struct dirent *e; !status.code && (e = readdir(folder));) {
    sf_quality_scene *scene = &q->scene[q->count];
    if (e->d_name[0] == '.' || strlen(e->d_name) >= sizeof scene->name || q->count == SCENES_MAX) continue;
    *scene = (sf_quality_scene){0};
    strcpy(scene->name, e->d_name);
    status = load_scene(dir, scene);
    if (scene->value[SF_QUALITY_PSNR].count || scene->value[SF_QUALITY_TWIN].count) q->count++;
  }
  closedir(folder);
  qsort(q->scene, (size_t)q->count, sizeof *q->scene, by_name);
  if (!status.code && !q->count)
    status = sf_fail(SF_E_FORMAT, "%s: no finished run SCENE/snn-SEED or SCENE/ann-SEED", dir);
  return status;
}

void sf_quality_free(sf_quality *q)
{
  free(q->scene);
  *q = (sf_quality){0};
}

cJSON *sf_quality_json(const sf_quality *q)
{
  cJSON *json = cJSON_CreateObject();
  for (int s = 0; s < q->count; s++) {
    cJSON *scene = cJSON_AddObjectToObject(json, q->scene[s].name);
    cJSON_AddStringToObject(scene, "search", q->scene[s].states);
    for (int i = 0; i < SF_QUALITIES; i++) {
      const sf_spread *v = &q->scene[s].value[i];
      if (!v->count) continue;
      cJSON *one = cJSON_AddObjectToObject(scene, columns[i].key);
      cJSON_AddNumberToObject(one, "mean", v->mean);
      cJSON_AddNumberToObject(one, "least", v->least);
      cJSON_AddNumberToObject(one, "most", v->most);
      cJSON_AddNumberToObject(one, "seeds", v->count);
    }
  }
  return json;
}

static void print_value(FILE *out, const char *format, double x)
{
  if (isnan(x))
    fprintf(out, "-");
  else
    fprintf(out, format, x);
}

/* mean +- half the range; the mean before in brackets. */
static void print_cell(FILE *out, int column, const sf_spread *v, const cJSON *before)
{
  fprintf(out, " ");
  print_value(out, columns[column].format, v->mean);
  if (v->count > 1) {
    fprintf(out, " +- ");
    print_value(out, columns[column].format, (v->most - v->least) / 2);
  }
  const double old = sf_json_number(sf_json_get(before, columns[column].key), "mean");
  if (!isnan(old)) {
    fprintf(out, " (");
    print_value(out, columns[column].format, old);
    fprintf(out, ")");
  }
  fprintf(out, " |");
}

void sf_quality_print(FILE *out, const sf_quality *q, const cJSON *before)
{
  fprintf(out, "| scene |");
  for (int i = 0; i < SF_QUALITIES; i++) fprintf(out, " %s |", columns[i].title);
  fprintf(out, " search |\n|---|");
  for (int i = 0; i < SF_QUALITIES; i++) fprintf(out, "---:|");
  fprintf(out, "---|\n");
  for (int s = 0; s < q->count; s++) {
    const sf_quality_scene *scene = &q->scene[s];
    fprintf(out, "| %s |", scene->name);
    for (int i = 0; i < SF_QUALITIES; i++) print_cell(out, i, &scene->value[i], sf_json_get(before, scene->name));
    fprintf(out, " %s |\n", scene->states);
  }
}
