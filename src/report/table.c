/* The report as Markdown that reads as plain text, too. */
#include "report/internal.h"
#include "base/json.h"
#include <math.h>
#include <string.h>

/* ---- the head ---- */

static const sf_run *first_done(const sf_reproduction *r)
{
  for (int s = 0; s < r->count; s++)
    for (int i = 0; i < SF_RUNS; i++)
      if (r->scene[s].run[i].summary) return &r->scene[s].run[i];
  return NULL;
}

/* Training of all seeds; *runs with a result, *expected: what the profile makes. */
static double training_hours(const sf_reproduction *r, int *runs, int *expected)
{
  double sum = 0;
  *runs = *expected = 0;
  for (int s = 0; s < r->count; s++)
    for (int k = 0; k < r->scene[s].seeds; k++)
      for (int i = 0; i < SF_RUNS; i++) {
        const sf_run *run = &r->scene[s].of[k].run[i];
        const double seconds = run->value[SF_METRIC_SECONDS];
        if (!isnan(seconds)) sum += seconds, ++*runs;
        *expected += k ? run->status != NULL : sf_report_expected(r, s, i);
      }
  return sum / 3600;
}

static void print_head(FILE *out, const sf_reproduction *r)
{
  int runs, expected;
  const bool pairs = sf_report_is_pairs(r);
  const double hours = training_hours(r, &runs, &expected);
  fprintf(out, "# Reproduction of the paper, profile %s\n\n", r->profile);
  fprintf(out, "%d %s:", r->count, r->count == 1 ? "scene" : "scenes");
  for (int s = 0; s < r->count; s++) fprintf(out, " %s", r->scene[s].name);
  fprintf(out, ". %d", runs);
  if (!pairs) fprintf(out, " of %d", expected);
  fprintf(out, " runs trained, %.2f h of training.\n", hours);
  const sf_run *run = first_done(r);
  if (run && pairs) fprintf(out, "Every run: seed %.0f.\n\n", sf_report_number(run->summary, "seed"));
  if (pairs) return;
  if (run) fprintf(out, "Every run: %.0f iterations.\n", sf_report_number(run->summary, "iterations"));
  fprintf(out,
          "PSNR and SSIM: float, held-out views. Energy: counts of `energy_audit`, paper ledger, mean of the audited\n"
          "frames. Energies grow with the pixels of a frame: compare the savings with the paper's, not the mJ.\n\n");
}

/* ---- tables of runs ---- */

static void method_head(sf_grids *t, bool paper)
{
  static const struct {
    const char *title;
    bool paper;
  } column[] = {{"PSNR dB", true},  {"SSIM", true},       {"steps", true},       {"mJ", true},
                {"saving %", true}, {"of twin %", false}, {"excess 1e-5", true}, {"fixed dB", false}};
  sf_grid_cell(t, "method");
  for (size_t i = 0; i < sizeof column / sizeof *column; i++) {
    sf_grid_cell(t, "%s", column[i].title);
    if (paper && column[i].paper) sf_grid_cell(t, "paper");
  }
  sf_grid_cell(t, "measured on");
  if (t->count) t->grid[t->count - 1].text_last = true;
}

/* One number of a run, its spread over the seeds, and the paper's where group is not negative. */
static void method_cell(sf_grids *t, const sf_reproduction *r, int scenes, int run, int metric, int group)
{
  static const int digits[SF_METRICS] = {[SF_METRIC_PSNR] = 2,
                                         [SF_METRIC_SSIM] = 4,
                                         [SF_METRIC_STEPS] = 3,
                                         [SF_METRIC_SAVING] = 2,
                                         [SF_METRIC_EXCESS] = 2},
                   theirs[SF_METRICS] = {[SF_METRIC_PSNR] = 2,
                                         [SF_METRIC_SSIM] = 3,
                                         [SF_METRIC_STEPS] = 3,
                                         [SF_METRIC_SAVING] = 2,
                                         [SF_METRIC_EXCESS] = 2};
  const double unit = metric == SF_METRIC_EXCESS ? 1e5 : 1, spread = sf_reproduction_spread(r, scenes, run, metric),
               paper = group < 0 ? NAN : sf_paper_value(group, run, metric);
  const double value = metric != SF_METRIC_SAVING ? sf_reproduction_mean(r, scenes, run, metric, NULL)
                       : run == SF_RUN_ANN        ? NAN
                                                  : sf_reproduction_saving(r, scenes, run, SF_RUN_ANN);
  const bool whole = metric == SF_METRIC_STEPS && group < 0 && isnan(spread); /* t_r of one run */
  if (metric == SF_METRIC_ENERGY)
    sf_grid_energy(t, value, spread);
  else
    sf_grid_spread(t, whole ? 0 : digits[metric], unit * value, unit * spread);
  if (group < 0) return;
  if (metric == SF_METRIC_ENERGY)
    sf_grid_energy(t, paper, NAN);
  else
    sf_grid_number(t, theirs[metric], unit * paper);
}

/* group: with the paper's values; -1: without. */
static void method_row(sf_grids *t, const sf_reproduction *r, int scenes, int run, int group)
{
  static const int metric[] = {SF_METRIC_PSNR, SF_METRIC_SSIM, SF_METRIC_STEPS, SF_METRIC_ENERGY, SF_METRIC_SAVING};
  char origin[SF_GRID_CELL];
  sf_grid_row(t);
  sf_grid_cell(t, "%s", sf_run_kinds[run].title);
  for (int i = 0; i < 5; i++) method_cell(t, r, scenes, run, metric[i], group);
  sf_grid_number(t, 2, sf_reproduction_saving(r, scenes, run, SF_SAVING_TWIN));
  method_cell(t, r, scenes, run, SF_METRIC_EXCESS, group);
  sf_grid_number(t, 2, sf_reproduction_mean(r, scenes, run, SF_METRIC_LOSS, NULL));
  sf_report_origin(r, scenes, run, origin);
  sf_grid_cell(t, "%s", origin);
}

static void begin_methods(sf_grids *t, const char *name, const char *what, int group)
{
  const sf_paper_group *g = &sf_paper_groups[group];
  char file[64], title[128];
  snprintf(file, sizeof file, "%s-%s-%s", name, g->backbone, g->layout ? g->layout : "other");
  snprintf(title, sizeof title, "%s: %s, %s", what, sf_report_field(group), g->data);
  sf_grid_begin(t, 1, file, title);
  method_head(t, group < SF_PAPER_GROUPS);
}

static void add_methods(sf_grids *t, const sf_reproduction *r, int group)
{
  const sf_paper_group *g = &sf_paper_groups[group];
  const int scenes = sf_scenes_of(group), paper = group < SF_PAPER_GROUPS ? group : -1;
  begin_methods(t, "quality", "Averages over the scenes", group);
  method_row(t, r, scenes, SF_RUN_ANN, paper);
  for (int i = 0; i < SF_BETAS; i++) method_row(t, r, scenes, g->beta[i], paper);
  sf_grid_note(
      t,
      "saving: against the ANN run of the same scenes, as in the paper. of twin: against the ReLU twin on the\n"
      "samples of the spiking frame. excess: mean over the scenes of 10^(-PSNR/10), less the twin's; the paper's is\n"
      "from its average PSNR. fixed: PSNR of the fixed-point core minus float, audited frames. ANN energy: its\n"
      "synapses, each a MAC, on the samples of its own rendering. +-: standard deviation over the seeds.%s%s%s%s",
      *g->scenes ? "\nPaper: averages over " : "", g->scenes, g->pixels ? ", " : "", g->pixels ? g->pixels : "");
}

static void add_ablations(sf_grids *t, const sf_reproduction *r)
{
  const int scenes = sf_scenes_of(0);
  begin_methods(t, "ablations", "Ablations", 0);
  for (int i = SF_RUN_HYBRID; i <= SF_RUN_NO_BUDGET; i++) method_row(t, r, scenes, i, 0);
  method_row(t, r, scenes, SF_RUN_BETA_5E7, 0);
  for (int i = SF_RUN_T_MINUS_1; i <= SF_RUN_T_PLUS_1; i++) method_row(t, r, scenes, i, 0);
  sf_grid_note(t, "Ablations at beta = 5e-7. fixed t_r: the steps that `full` learned for that scene, frozen; steps "
                  "outside 1..T are skipped.");
}

static void add_scene(sf_grids *t, const sf_reproduction *r, int s)
{
  char name[300], title[300];
  snprintf(name, sizeof name, "scene-%s", r->scene[s].name);
  snprintf(title, sizeof title, "Scene %s", r->scene[s].name);
  sf_grid_begin(t, 1, name, title);
  method_head(t, false);
  for (int i = 0; i < SF_RUNS; i++)
    if (sf_report_expected(r, s, i)) method_row(t, r, s, i, -1);
}

/* ---- order and prefixes ---- */

static const char *const metric_title[SF_METRICS] = {[SF_METRIC_PSNR] = "PSNR dB",
                                                     [SF_METRIC_SSIM] = "SSIM",
                                                     [SF_METRIC_STEPS] = "steps",
                                                     [SF_METRIC_ENERGY] = "energy mJ"};

/* Ablations of which no pair is missing or reversed. */
static void write_kept(char *text, size_t size, const sf_order *order, int n)
{
  const char *separator = " ";
  size_t used = (size_t)snprintf(text, size, "No pair missing or reversed:");
  for (int i = 0, next; i < n; i = next) {
    bool kept = true;
    for (next = i; next < n && strcmp(order[next].group, order[i].group) == 0; next++)
      if (order[next].verdict == SF_ORDER_NO || order[next].verdict == SF_ORDER_MISSING) kept = false;
    if (kept && used < size) used += (size_t)snprintf(text + used, size - used, "%s%s", separator, order[i].group);
    if (kept) separator = ", ";
  }
  if (used < size) snprintf(text + used, size - used, "%s.", *separator == ' ' ? " none" : "");
}

static void order_row(sf_grids *t, const sf_order *o)
{
  const int digits = o->metric == SF_METRIC_STEPS ? 3 : 2;
  sf_grid_row(t);
  sf_grid_cell(t, "%s", o->group), sf_grid_cell(t, "%s", sf_run_kinds[o->a].title);
  sf_grid_cell(t, "%s", sf_run_kinds[o->b].title), sf_grid_cell(t, "%s", metric_title[o->metric]);
  sf_grid_number(t, digits, o->paper);
  if (o->metric == SF_METRIC_ENERGY)
    sf_grid_energy(t, o->ours, NAN), sf_grid_energy(t, 2 * o->error, NAN);
  else
    sf_grid_number(t, digits, o->ours), sf_grid_number(t, digits, 2 * o->error);
  sf_grid_cell(t, "%d", o->scenes), sf_grid_cell(t, "%d", o->pairs), sf_grid_cell(t, "%s", sf_order_names[o->verdict]);
}

static void add_order(sf_grids *t, const sf_reproduction *r, int group)
{
  static const char *const head[] = {"ablation", "first",  "second", "what",  "paper: first - second",
                                     "here",     "2 s.e.", "scenes", "pairs", "same order"};
  sf_order order[SF_ORDERS_MAX];
  const int n = sf_reproduction_order(r, group, order);
  int verdicts[4] = {0};
  char name[64], title[128], kept[256];
  if (!n) return;
  snprintf(name, sizeof name, "order-%s-%s", sf_paper_groups[group].backbone, sf_paper_groups[group].layout);
  snprintf(title, sizeof title, "Same order as the paper? %s, %s", sf_report_field(group), sf_paper_groups[group].data);
  sf_grid_begin(t, 4, name, title);
  for (size_t i = 0; i < sizeof head / sizeof *head; i++) sf_grid_cell(t, "%s", head[i]);
  for (int i = 0; i < n; i++) order_row(t, &order[i]), verdicts[order[i].verdict]++;
  write_kept(kept, sizeof kept, order, n);
  sf_grid_note(t,
               "%d yes, %d tie, %d no, %d not run. With several seeds a difference up to two standard errors (2 s.e.,\n"
               "paired over scenes and seeds) is a tie; with one, up to %g dB, %g steps or %g %% of the energy. Where\n"
               "the paper's own difference is that small, only the opposite order beyond it counts as no.\n%s",
               verdicts[SF_ORDER_YES], verdicts[SF_ORDER_TIE], verdicts[SF_ORDER_NO], verdicts[SF_ORDER_MISSING],
               sf_order_tolerance[SF_METRIC_PSNR], sf_order_tolerance[SF_METRIC_STEPS],
               100 * sf_order_tolerance[SF_METRIC_ENERGY], kept);
}

static int most_prefixes(const sf_reproduction *r, int scenes)
{
  int most = 0;
  for (int s = 0; s < r->count; s++)
    for (int i = 0; i < SF_RUNS && sf_reproduction_chosen(r, s, scenes); i++)
      if (r->scene[s].run[i].prefixes > most) most = r->scene[s].run[i].prefixes;
  return most;
}

static void add_prefixes(sf_grids *t, const sf_reproduction *r, int group)
{
  const sf_paper_group *g = &sf_paper_groups[group];
  const int scenes = sf_scenes_of(group), steps = most_prefixes(r, scenes);
  char name[64], title[160];
  if (!steps) return;
  snprintf(name, sizeof name, "prefixes-%s-%s", g->backbone, g->layout ? g->layout : "other");
  snprintf(title, sizeof title, "PSNR after every number of steps (dB, average): %s, %s", sf_report_field(group),
           g->data);
  sf_grid_begin(t, 1, name, title);
  sf_grid_cell(t, "method");
  for (int k = 0; k < steps; k++) sf_grid_cell(t, "%d", k + 1);
  for (int i = SF_RUN_ANN + 1; i < SF_RUNS; i++) {
    if (isnan(sf_reproduction_prefix(r, scenes, i, 0))) continue;
    sf_grid_row(t);
    sf_grid_cell(t, "%s", sf_run_kinds[i].title);
    for (int k = 0; k < steps; k++) sf_grid_number(t, 2, sf_reproduction_prefix(r, scenes, i, k));
  }
  sf_grid_row(t);
  sf_grid_cell(t, "mJ per frame, beta = 5e-7");
  for (int k = 0; k < steps; k++) sf_grid_energy(t, sf_reproduction_prefix_energy(r, scenes, SF_RUN_BETA_5E7, k), NAN);
}

/* ---- what is missing ---- */

static void print_missing(FILE *out, const sf_reproduction *r, int s, int k, int i, bool *any)
{
  const sf_report_scene *scene = &r->scene[s];
  const char *status = scene->of[k].run[i].status;
  char seed[32] = "";
  if (status ? strcmp(status, "done") == 0 : k > 0 || !sf_report_expected(r, s, i)) return;
  if (!*any) fprintf(out, "## Runs without a result\n\n");
  *any = true;
  if (k) snprintf(seed, sizeof seed, ", seed %d", scene->of[k].seed);
  fprintf(out, "- %s%s, %s: %s\n", scene->name, seed, sf_run_kinds[i].name, status ? status : "not run");
}

static void print_unfinished(FILE *out, const sf_reproduction *r)
{
  bool any = false;
  for (int s = 0; s < r->count; s++)
    for (int k = 0; k < r->scene[s].seeds; k++)
      for (int i = 0; i < SF_RUNS; i++) print_missing(out, r, s, k, i, &any);
  if (any) fprintf(out, "\n");
  if (r->problems) fprintf(out, "## Problems\n\n");
  for (int i = 0; i < r->problems; i++) fprintf(out, "- %s\n", r->problem[i]);
  if (r->problems) fprintf(out, "\n");
}

/* ---- all ---- */

static bool has_scenes(const sf_reproduction *r, int group)
{
  for (int s = 0; s < r->count; s++)
    if (r->scene[s].group == group) return true;
  return false;
}

sf_status sf_report_tables(const sf_reproduction *r, sf_grids *t)
{
  *t = (sf_grids){.status = sf_ok()};
  if (sf_report_is_pairs(r)) {
    sf_report_add_pairs(t, r);
    return t->status;
  }
  for (int g = 0; g < SF_GROUPS; g++) {
    if (!has_scenes(r, g) && (r->count || g)) continue;
    add_methods(t, r, g);
    if (g == 0) add_ablations(t, r);
    add_order(t, r, g);
    add_prefixes(t, r, g);
  }
  sf_report_add_balance(t, r);
  sf_report_add_models(t, r);
  sf_report_add_comparators(t, r);
  for (int s = 0; s < r->count; s++) add_scene(t, r, s);
  return t->status;
}

sf_status sf_reproduction_print(FILE *out, const sf_reproduction *r)
{
  sf_grids tables;
  const sf_status status = sf_report_tables(r, &tables);
  if (!status.code) print_head(out, r);
  for (int i = 0; i < tables.count && !status.code; i++) sf_grid_markdown(out, &tables.grid[i]);
  if (!status.code) print_unfinished(out, r);
  sf_grids_free(&tables);
  return status;
}
