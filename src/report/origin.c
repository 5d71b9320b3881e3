/* What a number was measured on. */
#include "report/internal.h"
#include "base/json.h"
#include <math.h>
#include <stdarg.h>
#include <string.h>

enum { NAMED = 4, SEEDS_NAMED = 8 };

bool sf_report_is_pairs(const sf_reproduction *r)
{
  return strcmp(r->profile, "scenes") == 0;
}

double sf_report_number(const cJSON *json, const char *key)
{
  const double number = sf_json_number(json, key);
  return isnan(number) ? 0 : number;
}

const char *sf_report_field(int group)
{
  return strcmp(sf_paper_groups[group].backbone, "tensorf") == 0 ? "TensoRF" : "hash grid";
}

bool sf_report_says_field(const sf_report_scene *scene)
{
  for (int i = 0; i < SF_RUNS; i++)
    if (sf_json_text(scene->run[i].summary, "backbone")) return true;
  return false;
}

bool sf_report_expected(const sf_reproduction *r, int s, int run)
{
  const sf_report_scene *scene = &r->scene[s];
  const sf_paper_group *g = &sf_paper_groups[scene->group];
  bool ours = run == SF_RUN_ANN;
  if (scene->run[run].status || scene->run[run].summary) return true;
  if (sf_report_is_pairs(r)) return false;
  for (int i = 0; i < SF_BETAS; i++) ours |= g->beta[i] == run;
  return ours || (scene->group == 0 && run >= SF_RUN_HYBRID && run <= SF_RUN_T_PLUS_1);
}

void sf_report_scene_name(const sf_report_scene *scene, char name[256])
{
  const char *suffix[] = {"-ingp", "-tensorf"};
  snprintf(name, 256, "%s", scene->name);
  for (int i = 0; i < 2; i++) {
    const size_t n = strlen(name), m = strlen(suffix[i]);
    if (n > m && strcmp(name + n - m, suffix[i]) == 0) name[n - m] = 0;
  }
}

static void add(char text[SF_GRID_CELL], const char *format, ...) __attribute__((format(printf, 2, 3)));
static void add(char text[SF_GRID_CELL], const char *format, ...)
{
  const size_t used = strlen(text);
  va_list args;
  va_start(args, format);
  vsnprintf(text + used, SF_GRID_CELL - used, format, args);
  va_end(args);
}

/* From the smaller to the larger one. */
typedef struct range {
  double low, high;
} range;

static void widen(range *x, double value)
{
  if (isnan(value)) return;
  if (!(x->low <= value)) x->low = value;
  if (!(x->high >= value)) x->high = value;
}

static void add_range(char text[SF_GRID_CELL], range x, const char *what)
{
  if (isnan(x.low)) return;
  if (x.low == x.high)
    add(text, "; %.0f %s%s", x.low, what, x.low == 1 ? "" : "s");
  else
    add(text, "; %.0f to %.0f %ss", x.low, x.high, what);
}

/* Scenes with a result of the run. */
static void add_scenes(const sf_reproduction *r, int scenes, int run, char text[SF_GRID_CELL])
{
  char name[256];
  int count = 0;
  for (int s = 0; s < r->count; s++)
    count += sf_reproduction_chosen(r, s, scenes) && !isnan(r->scene[s].run[run].value[SF_METRIC_PSNR]);
  if (count > NAMED) add(text, "%d scenes", count);
  for (int s = 0, named = 0; s < r->count && count <= NAMED; s++) {
    if (!sf_reproduction_chosen(r, s, scenes) || isnan(r->scene[s].run[run].value[SF_METRIC_PSNR])) continue;
    sf_report_scene_name(&r->scene[s], name);
    add(text, "%s%.60s", named++ ? " " : "", name);
  }
}

/* Adds it to the list, once. */
static void add_seed(double seed[SEEDS_NAMED], int *count, double one)
{
  for (int i = 0; i < *count; i++)
    if (seed[i] == one) return;
  if (!isnan(one) && *count < SEEDS_NAMED) seed[(*count)++] = one;
}

static void add_seeds(const sf_reproduction *r, int scenes, int run, char text[SF_GRID_CELL])
{
  double seed[SEEDS_NAMED];
  int count = 0;
  for (int s = 0; s < r->count; s++)
    for (int k = 0; k < r->scene[s].seeds && sf_reproduction_chosen(r, s, scenes); k++)
      add_seed(seed, &count, sf_json_number(r->scene[s].of[k].run[run].summary, "seed"));
  if (count) add(text, "; seed%s", count > 1 ? "s" : "");
  for (int i = 0; i < count; i++) add(text, " %.0f", seed[i]);
}

/* Pixels of pictures. */
typedef struct sizes {
  range width, height;
} sizes;

static void add_sizes(char text[SF_GRID_CELL], const sizes *x)
{
  if (!(x->width.low > 0)) return;
  add(text, " of %.0f x %.0f", x->width.low, x->height.low);
  if (x->width.high > x->width.low) add(text, " to %.0f x %.0f", x->width.high, x->height.high);
}

void sf_report_origin(const sf_reproduction *r, int scenes, int run, char text[SF_GRID_CELL])
{
  const range none = {NAN, NAN};
  range views = none, frames = none;
  sizes viewed = {none, none}, audited = {none, none};
  *text = 0;
  add_scenes(r, scenes, run, text);
  if (!*text) add(text, "-");
  add_seeds(r, scenes, run, text);
  for (int s = 0; s < r->count; s++) {
    const sf_run *one = &r->scene[s].run[run];
    if (!sf_reproduction_chosen(r, s, scenes)) continue;
    widen(&views, sf_json_number(one->summary, "views"));
    widen(&viewed.width, sf_json_number(one->summary, "width"));
    widen(&viewed.height, sf_json_number(one->summary, "height"));
    if (one->audits) widen(&frames, one->audits);
    if (one->width) widen(&audited.width, one->width), widen(&audited.height, one->height);
  }
  add_range(text, views, "view"), add_sizes(text, &viewed);
  add_range(text, frames, "audited frame"), add_sizes(text, &audited);
}
