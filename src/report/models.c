/* What a step is worth beside what it costs; models that the paper sets its own beside. */
#include "report/internal.h"
#include "base/json.h"
#include <math.h>
#include <string.h>

/* ---- worth and price ---- */

static void balance_row(sf_grids *t, const sf_reproduction *r, int s, int run)
{
  const sf_run *one = &r->scene[s].run[run];
  const double worth = one->value[SF_METRIC_WORTH], price = one->value[SF_METRIC_PRICE];
  const char *state = sf_json_text(sf_json_get(one->summary, "search"), "state");
  char origin[SF_GRID_CELL];
  sf_grid_row(t);
  sf_grid_cell(t, "%s", r->scene[s].name), sf_grid_cell(t, "%s", sf_run_kinds[run].title);
  sf_grid_spread(t, 2, one->value[SF_METRIC_STEPS], sf_reproduction_spread(r, s, run, SF_METRIC_STEPS));
  sf_grid_number(t, 2, one->t_star);
  sf_grid_spread(t, 3, 1e5 * worth, 1e5 * sf_reproduction_spread(r, s, run, SF_METRIC_WORTH));
  sf_grid_number(t, 3, 1e5 * one->value[SF_METRIC_WORTH_ERROR]);
  sf_grid_spread(t, 3, 1e5 * price, 1e5 * sf_reproduction_spread(r, s, run, SF_METRIC_PRICE));
  sf_grid_number(t, 2, price > 0 ? worth / price : NAN);
  sf_grid_cell(t, "%s", state ? state : "-");
  sf_report_origin(r, s, run, origin);
  sf_grid_cell(t, "%s", origin);
}

void sf_report_add_balance(sf_grids *t, const sf_reproduction *r)
{
  static const char *const head[] = {"scene",      "method",     "t_r",           "t*",     "worth 1e-5",
                                     "error 1e-5", "price 1e-5", "worth / price", "search", "measured on"};
  bool any = false;
  for (int s = 0; s < r->count; s++)
    for (int i = SF_RUN_ANN + 1; i < SF_RUNS; i++) {
      if (isnan(r->scene[s].run[i].value[SF_METRIC_WORTH])) continue;
      if (!any) {
        sf_grid_begin(t, 2, "balance", "What one more step is worth, and what it costs");
        if (t->count) t->grid[t->count - 1].text_last = true;
        for (size_t c = 0; c < sizeof head / sizeof *head; c++) sf_grid_cell(t, "%s", head[c]);
      }
      any = true;
      balance_row(t, r, s, i);
    }
  if (any)
    sf_grid_note(t,
                 "worth: squared error that one more step at t* takes away, on the rays of the search; error: its "
                 "standard error; price: beta exp(t*) and the\nratio of the errors (docs/model.md). t* settles where "
                 "both are equal.");
}

/* ---- other models ---- */

typedef struct model {
  const char *data, *name; /* of sf_paper_groups */
  double psnr, steps;      /* 0: an ordinary model */
} model;

static const model models[] = {
    {"Synthetic", "Spiking-NeRF", 30.41, 256},
    {"Synthetic", "Mixed", 31.61, 4},
    {"Synthetic", "SpikingNeRF-D", 31.64, 4},
    {"Synthetic", "SpikingNeRF-T", 32.45, 1},
    {"Synthetic", "Spik-NeRF-Wan", 30.23, 2},
    {"Synthetic", "JaxNeRF", 31.65, 0},
    {"Synthetic", "MipNeRF", 33.09, 0},
    {"Synthetic", "TensoRF", 33.14, 0},
    {"Synthetic", "INGP", 32.14, 0},
    {"Synthetic", "SRes", 32.52, 0},
    {"Synthetic", "BiRF", 32.64, 0},
    {"Mip-NeRF 360", "NeRF", 23.85, 0},
    {"Mip-NeRF 360", "NeRF++", 25.11, 0},
    {"Mip-NeRF 360", "MipNeRF", 24.04, 0},
    {"Mip-NeRF 360", "INGP", 25.48, 0},
    {"Mip-NeRF 360", "Nerfacto", 26.39, 0},
    {"Mip-NeRF 360", "ZipNeRF", 28.54, 0},
    {"LLFF", "SRN", 22.84, 0},
    {"LLFF", "LLFF", 24.13, 0},
    {"LLFF", "NeRF", 26.50, 0},
    {"LLFF", "MipNeRF", 26.60, 0},
    {"LLFF", "Plenoxels", 26.29, 0},
    {"LLFF", "TensoRF", 26.73, 0},
};

/* The paper gives the SSIM of the models that are its own networks' twins. */
static double ssim_of(const model *m)
{
  for (int g = 0; g < SF_PAPER_GROUPS; g++) {
    const sf_paper_group *group = &sf_paper_groups[g];
    const char *name = strcmp(group->backbone, "tensorf") == 0 ? "TensoRF" : "INGP";
    if (strcmp(m->data, group->data) == 0 && strcmp(m->name, name) == 0)
      return sf_paper_value(g, SF_RUN_ANN, SF_METRIC_SSIM);
  }
  return NAN;
}

static void model_row(sf_grids *t, const char *name, double psnr, double spread, double ssim, double steps,
                      const char *origin)
{
  sf_grid_row(t);
  sf_grid_cell(t, "%s", name), sf_grid_spread(t, 2, psnr, spread), sf_grid_number(t, 3, ssim);
  sf_grid_number(t, steps == floor(steps) ? 0 : 3, steps), sf_grid_cell(t, "%s", origin);
}

/* Rows of a group: the paper's own model and what was learned here. */
static void group_rows(sf_grids *t, const sf_reproduction *r, int g, bool spiking)
{
  const sf_paper_group *group = &sf_paper_groups[g];
  const int scenes = sf_scenes_of(g);
  char name[96], origin[SF_GRID_CELL];
  snprintf(name, sizeof name, "PATA %s, beta = 5e-7", sf_report_field(g));
  model_row(t, name, sf_paper_value(g, SF_RUN_BETA_5E7, SF_METRIC_PSNR), NAN,
            sf_paper_value(g, SF_RUN_BETA_5E7, SF_METRIC_SSIM), sf_paper_value(g, SF_RUN_BETA_5E7, SF_METRIC_STEPS),
            "as printed");
  for (int i = spiking ? 0 : -1; i < SF_BETAS; i++) {
    const int run = i < 0 ? SF_RUN_ANN : group->beta[i];
    const double psnr = sf_reproduction_mean(r, scenes, run, SF_METRIC_PSNR, NULL);
    if (isnan(psnr)) continue;
    snprintf(name, sizeof name, "here: %s, %s", sf_report_field(g), sf_run_kinds[run].title);
    sf_report_origin(r, scenes, run, origin);
    model_row(t, name, psnr, sf_reproduction_spread(r, scenes, run, SF_METRIC_PSNR),
              sf_reproduction_mean(r, scenes, run, SF_METRIC_SSIM, NULL),
              sf_reproduction_mean(r, scenes, run, SF_METRIC_STEPS, NULL), origin);
  }
}

/* ---- how they differ ---- */

static bool has_scene(const sf_reproduction *r, const char *data, const char *name, size_t length)
{
  char own[256];
  for (int s = 0; s < r->count; s++) {
    sf_report_scene_name(&r->scene[s], own);
    if (strcmp(sf_paper_groups[r->scene[s].group].data, data) == 0 && strlen(own) == length &&
        strncmp(own, name, length) == 0)
      return true;
  }
  return false;
}

/* Which of the set's scenes are not here. */
static void list_missing(const sf_reproduction *r, const sf_paper_group *g, char text[256])
{
  *text = 0;
  for (const char *name = g->scenes; *name;) {
    const size_t length = strcspn(name, " "), used = strlen(text);
    if (!has_scene(r, g->data, name, length)) snprintf(text + used, 256 - used, " %.*s", (int)length, name);
    name += length + (name[length] == ' ');
  }
  if (!*text) snprintf(text, 256, " none");
}

static void list_scenes(const sf_reproduction *r, const char *data, char text[512])
{
  char name[256];
  *text = 0;
  for (int s = 0; s < r->count; s++) {
    const cJSON *summary = r->scene[s].run[SF_RUN_ANN].summary;
    for (int i = SF_RUN_ANN + 1; i < SF_RUNS && !summary; i++) summary = r->scene[s].run[i].summary;
    const double width = sf_json_number(summary, "width"), height = sf_json_number(summary, "height");
    if (strcmp(sf_paper_groups[r->scene[s].group].data, data) != 0) continue;
    sf_report_scene_name(&r->scene[s], name);
    const size_t used = strlen(text);
    if (isnan(width))
      snprintf(text + used, 512 - used, "%s %.60s", used ? "," : "", name);
    else
      snprintf(text + used, 512 - used, "%s %.60s (%s, %.0f x %.0f)", used ? "," : "", name,
               sf_report_field(r->scene[s].group), width, height);
  }
}

static int count_words(const char *text)
{
  int count = *text != 0;
  for (; *text; text++) count += *text == ' ';
  return count;
}

static void note(sf_grids *t, const sf_reproduction *r, const sf_paper_group *g)
{
  char missing[256], here[512];
  list_missing(r, g, missing);
  list_scenes(r, g->data, here);
  sf_grid_note(t,
               "Not the same scenes and not the same pictures: rows as printed are averages over the %d scenes of "
               "%s%s%s.\nHere:%s. Not here:%s.",
               count_words(g->scenes), g->data, g->pixels ? " at " : "", g->pixels ? g->pixels : "", here, missing);
}

static void add_models(sf_grids *t, const sf_reproduction *r, const sf_paper_group *g, bool spiking)
{
  static const char *const head[] = {"model", "PSNR dB", "SSIM", "time steps", "measured on"};
  char title[128], name[64];
  snprintf(title, sizeof title, "%s models: %s", spiking ? "Spike-based" : "Ordinary", g->data);
  snprintf(name, sizeof name, "models-%s-%s", spiking ? "spiking" : "ordinary", g->layout);
  sf_grid_begin(t, 1, name, title);
  if (t->count) t->grid[t->count - 1].text_last = true;
  for (size_t i = 0; i < sizeof head / sizeof *head; i++) sf_grid_cell(t, "%s", head[i]);
  for (size_t i = 0; i < sizeof models / sizeof *models; i++) {
    const model *m = &models[i];
    if (strcmp(m->data, g->data) == 0 && (m->steps > 0) == spiking)
      model_row(t, m->name, m->psnr, NAN, ssim_of(m), m->steps > 0 ? m->steps : NAN, "as printed");
  }
  for (int i = 0; i < SF_PAPER_GROUPS; i++)
    if (strcmp(sf_paper_groups[i].data, g->data) == 0) group_rows(t, r, i, spiking);
  note(t, r, g);
}

static bool has_data(const sf_reproduction *r, const char *data)
{
  for (int s = 0; s < r->count; s++)
    if (strcmp(sf_paper_groups[r->scene[s].group].data, data) == 0) return true;
  return false;
}

void sf_report_add_models(sf_grids *t, const sf_reproduction *r)
{
  for (int g = 0; g < SF_PAPER_GROUPS; g++) {
    const sf_paper_group *group = &sf_paper_groups[g];
    bool before = !has_data(r, group->data);
    for (int i = 0; i < g; i++) before |= strcmp(sf_paper_groups[i].data, group->data) == 0;
    if (before) continue;
    if (g == 0) add_models(t, r, group, true);
    add_models(t, r, group, false);
  }
}
