/* The report as Markdown that reads as plain text, too. */
#include "report/internal.h"
#include "base/json.h"
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* ---- a table with aligned columns ---- */

enum { COLUMNS = 16, CELL = 96 };

typedef struct table {
  char (*cell)[COLUMNS][CELL];       /* [room] */
  int room, rows, columns, at, left; /* left: columns of text, the first ones */
} table;

/* Room for the longest of a report's tables. */
static bool open_table(table *t, const sf_reproduction *r)
{
  const int runs = (r->count + 1) * SF_RUNS;
  t->room = 2 + SF_PAPER_GROUPS + (runs > SF_ORDERS_MAX ? runs : SF_ORDERS_MAX);
  t->cell = calloc((size_t)t->room, sizeof *t->cell);
  return t->cell;
}

static void begin(table *t)
{
  t->rows = t->columns = t->at = 0;
  t->left = 1;
}

static void row(table *t)
{
  t->rows++;
  t->at = 0;
}

static void cell(table *t, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void cell(table *t, const char *format, ...)
{
  if (t->at == COLUMNS) return;
  va_list args;
  va_start(args, format);
  vsnprintf(t->cell[t->rows - 1][t->at], CELL, format, args);
  va_end(args);
  for (char *c = t->cell[t->rows - 1][t->at]; *c; c++)
    if (*c == '|') *c = '/';
  if (++t->at > t->columns) t->columns = t->at;
}

static void number(table *t, int digits, double value)
{
  if (isnan(value))
    cell(t, "-");
  else
    cell(t, "%.*f", digits, fabs(value) < 0.5 * pow(10, -digits) ? 0 : value); /* no "-0.00" */
}

static void energy(table *t, double mj)
{
  if (isnan(mj))
    cell(t, "-");
  else
    cell(t, "%.*f", fabs(mj) >= 100 ? 2 : fabs(mj) >= 1 ? 3 : 5, mj);
}

static void end(FILE *out, const table *t)
{
  static const char dashes[CELL + 2] =
      "-------------------------------------------------------------------------------------------------";
  int width[COLUMNS] = {0};
  for (int r = 0; r < t->rows; r++)
    for (int c = 0; c < t->columns; c++) {
      const int n = (int)strlen(t->cell[r][c]);
      if (n > width[c]) width[c] = n;
    }
  for (int r = 0; r < t->rows; r++) {
    for (int c = 0; c < t->columns; c++) fprintf(out, c < t->left ? "| %-*s " : "| %*s ", width[c], t->cell[r][c]);
    fprintf(out, "|\n");
    for (int c = 0; r == 0 && c < t->columns; c++)
      fprintf(out, "|%.*s%s", width[c] + (c < t->left ? 2 : 1), dashes, c < t->left ? "" : ":");
    if (r == 0) fprintf(out, "|\n");
  }
  fprintf(out, "\n");
}

/* ---- the head ---- */

static const sf_run *first_done(const sf_reproduction *r)
{
  for (int s = 0; s < r->count; s++)
    for (int i = 0; i < SF_RUNS; i++)
      if (r->scene[s].run[i].summary) return &r->scene[s].run[i];
  return NULL;
}

static double training_hours(const sf_reproduction *r, int *runs)
{
  double sum = 0;
  *runs = 0;
  for (int s = 0; s < r->count; s++)
    for (int i = 0; i < SF_RUNS; i++) {
      const double seconds = r->scene[s].run[i].value[SF_METRIC_SECONDS];
      if (!isnan(seconds)) sum += seconds, ++*runs;
    }
  return sum / 3600;
}

static double number_of(const cJSON *json, const char *key)
{
  const double number = sf_json_number(json, key);
  return isnan(number) ? 0 : number;
}

static const sf_run *first_audited(const sf_reproduction *r)
{
  for (int s = 0; s < r->count; s++)
    if (r->scene[s].run[SF_RUN_BETA_5E7].audits) return &r->scene[s].run[SF_RUN_BETA_5E7];
  return NULL;
}

static void print_head(FILE *out, const sf_reproduction *r)
{
  int runs;
  const bool pairs = sf_report_is_pairs(r);
  const double hours = training_hours(r, &runs);
  fprintf(out, "# Reproduction of the paper, profile %s\n\n", r->profile);
  fprintf(out, "%d %s:", r->count, r->count == 1 ? "scene" : "scenes");
  for (int s = 0; s < r->count; s++) fprintf(out, " %s", r->scene[s].name);
  fprintf(out, ". %d", runs);
  if (!pairs) fprintf(out, " of %d", r->count * SF_RUNS);
  fprintf(out, " runs trained, %.2f h of training.\n", hours);
  const sf_run *run = first_done(r);
  if (run && pairs) fprintf(out, "Every run: seed %.0f.\n\n", number_of(run->summary, "seed"));
  if (pairs) return;
  if (run)
    fprintf(out, "Every run: %.0f iterations, seed %.0f; quality over %.0f held-out views.\n",
            number_of(run->summary, "iterations"), number_of(run->summary, "seed"), number_of(run->summary, "views"));
  run = first_audited(r);
  if (run)
    fprintf(out, "Energy: counts of `energy_audit`, paper ledger, mean of %d held-out %s of %d x %d pixels.\n",
            run->audits, run->audits == 1 ? "frame" : "frames", run->width, run->height);
  fprintf(out, "Paper: averages over eight scenes at 800 x 800 (energies: compare the savings, not the mJ).\n\n");
}

/* ---- tables of runs ---- */

static void method_head(table *t, bool paper)
{
  static const struct {
    const char *title;
    bool paper;
  } column[] = {{"PSNR dB", true},  {"SSIM", true},       {"steps", true},    {"mJ", true},
                {"saving %", true}, {"of twin %", false}, {"fixed dB", false}};
  begin(t), row(t);
  cell(t, "method");
  for (size_t i = 0; i < sizeof column / sizeof *column; i++) {
    cell(t, "%s", column[i].title);
    if (paper && column[i].paper) cell(t, "paper");
  }
  if (paper) cell(t, "scenes");
}

static void method_row(table *t, const sf_reproduction *r, int scene, int run)
{
  static const int metric[] = {SF_METRIC_PSNR, SF_METRIC_SSIM, SF_METRIC_STEPS}, digits[] = {2, 4, 3},
                   theirs[] = {2, 3, 3};
  const sf_run_kind *kind = &sf_run_kinds[run];
  const bool paper = scene < 0;
  int count;
  row(t);
  cell(t, "%s", kind->title);
  sf_reproduction_mean(r, scene, run, SF_METRIC_PSNR, &count);
  for (int i = 0; i < 3; i++) {
    number(t, paper || i != 2 ? digits[i] : 0, sf_reproduction_mean(r, scene, run, metric[i], NULL));
    if (paper) number(t, theirs[i], kind->paper[metric[i]]);
  }
  energy(t, sf_reproduction_mean(r, scene, run, SF_METRIC_ENERGY, NULL));
  if (paper) energy(t, kind->paper[SF_METRIC_ENERGY]);
  number(t, 2, run == SF_RUN_ANN ? NAN : sf_reproduction_saving(r, scene, run, SF_RUN_ANN));
  if (paper) number(t, 2, kind->paper_saving);
  number(t, 2, sf_reproduction_saving(r, scene, run, SF_SAVING_TWIN));
  number(t, 2, sf_reproduction_mean(r, scene, run, SF_METRIC_LOSS, NULL));
  if (paper) cell(t, "%d of %d", count, r->count);
}

static void print_methods(FILE *out, const sf_reproduction *r, table *t)
{
  fprintf(out, "## Averages over the scenes\n\n");
  method_head(t, true);
  for (int i = SF_RUN_ANN; i <= SF_RUN_BETA_1E6; i++) method_row(t, r, -1, i);
  end(out, t);
  fprintf(out,
          "saving: against the ANN run of the same scenes, as in the paper. of twin: against the ReLU twin on the\n"
          "samples of the spiking frame. fixed: PSNR of the fixed-point core minus float, audited frames.\n"
          "ANN energy: its synapses, each a MAC, on the samples of its own rendering.\n\n");
  fprintf(out, "## Ablations\n\n");
  method_head(t, true);
  for (int i = SF_RUN_HYBRID; i <= SF_RUN_NO_BUDGET; i++) method_row(t, r, -1, i);
  method_row(t, r, -1, SF_RUN_BETA_5E7);
  for (int i = SF_RUN_T_MINUS_1; i < SF_RUNS; i++) method_row(t, r, -1, i);
  end(out, t);
  fprintf(
      out,
      "Ablations at beta = 5e-7. fixed t_r: the steps that `full` learned for that scene, frozen; steps outside 1..T "
      "are skipped.\n\n");
}

static void print_scenes(FILE *out, const sf_reproduction *r, table *t)
{
  for (int s = 0; s < r->count; s++) {
    fprintf(out, "## Scene %s\n\n", r->scene[s].name);
    method_head(t, false);
    for (int i = 0; i < SF_RUNS; i++) method_row(t, r, s, i);
    end(out, t);
  }
}

/* ---- scenes with several backbones ---- */

static const char *text_of(const cJSON *json, const char *key)
{
  const char *text = sf_json_text(json, key);
  return text ? text : "-";
}

static void pair_row(table *t, const sf_reproduction *r, int scene, int id)
{
  const sf_report_scene *one = &r->scene[scene];
  const sf_run *run = &one->run[id];
  const double ann = one->run[SF_RUN_ANN].value[SF_METRIC_PSNR];
  row(t);
  cell(t, "%s", one->name), cell(t, "%s", text_of(run->summary, "backbone"));
  cell(t, "%g", number_of(run->summary, "beta")), number(t, 0, run->value[SF_METRIC_SECONDS] / 60);
  number(t, 2, ann), number(t, 2, run->value[SF_METRIC_PSNR]), number(t, 2, run->value[SF_METRIC_PSNR] - ann);
  number(t, 4, run->value[SF_METRIC_SSIM]), number(t, 0, run->value[SF_METRIC_STEPS]);
  number(t, 1, sf_reproduction_saving(r, scene, id, SF_SAVING_TWIN));
  number(t, 1, sf_reproduction_saving(r, scene, id, SF_RUN_ANN));
  number(t, 2, run->value[SF_METRIC_LOSS]);
  number(t, 0, run->cosim_samples), number(t, 0, run->cosim_differences);
}

static void paper_row(table *t, const sf_paper_group *g)
{
  row(t);
  cell(t, "paper: %s", g->data), cell(t, "%s", g->backbone), cell(t, "5e-07"), cell(t, "-");
  number(t, 2, g->ann_psnr), number(t, 2, g->psnr), number(t, 2, g->psnr - g->ann_psnr), number(t, 3, g->ssim);
  number(t, 3, g->steps), cell(t, "-"), number(t, 1, 100 * (1 - g->energy / g->ann_energy));
  for (int i = 0; i < 3; i++) cell(t, "-");
}

static void print_pairs(FILE *out, const sf_reproduction *r, table *t)
{
  static const char *const title[] = {"scene",      "backbone",   "beta",           "minutes",    "ANN dB",
                                      "spiking dB", "difference", "SSIM",           "t_r",        "of twin %",
                                      "saving %",   "fixed dB",   "samples in RTL", "differences"};
  begin(t), row(t);
  t->left = 2;
  for (size_t i = 0; i < sizeof title / sizeof *title; i++) cell(t, "%s", title[i]);
  for (int s = 0; s < r->count; s++)
    for (int i = SF_RUN_BETA_1E7; i < SF_RUNS; i++)
      if (r->scene[s].run[i].summary) pair_row(t, r, s, i);
  for (int g = 0; g < SF_PAPER_GROUPS; g++)
    for (int s = 0; s < r->count; s++)
      if (sf_reproduction_group(&r->scene[s]) == &sf_paper_groups[g]) {
        paper_row(t, &sf_paper_groups[g]);
        break;
      }
  end(out, t);
  fprintf(out,
          "minutes: of training, each run. PSNR and SSIM: float, all held-out views, spiking at its learned t_r. of "
          "twin: energy saved against the\n"
          "ReLU twin on the samples of the spiking frame; saving: against the ANN run on its own samples, as in the\n"
          "paper. fixed: PSNR of the fixed-point core minus float, audited frames. samples in RTL: co-simulated with\n"
          "the fixed-point core. Paper: averages over that set of scenes, beta = 5e-7, after its full training.\n\n");
}

/* ---- order and prefixes ---- */

static const char *const metric_title[SF_METRICS] = {[SF_METRIC_PSNR] = "PSNR dB",
                                                     [SF_METRIC_SSIM] = "SSIM",
                                                     [SF_METRIC_STEPS] = "steps",
                                                     [SF_METRIC_ENERGY] = "energy mJ"};

/* Ablations of which no pair is missing or reversed. */
static void print_kept(FILE *out, const sf_order *order, int n)
{
  fprintf(out, "No pair missing or reversed:");
  const char *separator = " ";
  for (int i = 0, next; i < n; i = next) {
    bool kept = true;
    for (next = i; next < n && strcmp(order[next].group, order[i].group) == 0; next++)
      if (order[next].verdict == SF_ORDER_NO || order[next].verdict == SF_ORDER_MISSING) kept = false;
    if (kept) fprintf(out, "%s%s", separator, order[i].group), separator = ", ";
  }
  fprintf(out, "%s.\n\n", *separator == ' ' ? " none" : "");
}

static void print_order(FILE *out, const sf_reproduction *r, table *t)
{
  sf_order order[SF_ORDERS_MAX];
  const int n = sf_reproduction_order(r, order);
  int verdicts[4] = {0};
  fprintf(out, "## Same order as the paper?\n\n");
  begin(t), row(t);
  t->left = 4;
  cell(t, "ablation"), cell(t, "first"), cell(t, "second"), cell(t, "what"), cell(t, "paper: first - second");
  cell(t, "here"), cell(t, "scenes"), cell(t, "same order");
  for (int i = 0; i < n; i++) {
    const sf_order *o = &order[i];
    row(t);
    cell(t, "%s", o->group), cell(t, "%s", sf_run_kinds[o->a].title), cell(t, "%s", sf_run_kinds[o->b].title);
    cell(t, "%s", metric_title[o->metric]);
    number(t, o->metric == SF_METRIC_STEPS ? 3 : 2, o->paper);
    if (o->metric == SF_METRIC_ENERGY)
      energy(t, o->ours);
    else
      number(t, o->metric == SF_METRIC_STEPS ? 3 : 2, o->ours);
    cell(t, "%d", o->scenes), cell(t, "%s", sf_order_names[o->verdict]);
    verdicts[o->verdict]++;
  }
  end(out, t);
  fprintf(out,
          "%d yes, %d tie, %d no, %d not run. A difference up to %g dB, %g steps or %g %% of the energy is a tie;\n"
          "where the paper's own difference is that small, only the opposite order beyond it counts as no.\n",
          verdicts[SF_ORDER_YES], verdicts[SF_ORDER_TIE], verdicts[SF_ORDER_NO], verdicts[SF_ORDER_MISSING],
          sf_order_tolerance[SF_METRIC_PSNR], sf_order_tolerance[SF_METRIC_STEPS],
          100 * sf_order_tolerance[SF_METRIC_ENERGY]);
  print_kept(out, order, n);
}

static int most_prefixes(const sf_reproduction *r)
{
  int most = 0;
  for (int s = 0; s < r->count; s++)
    for (int i = 0; i < SF_RUNS; i++)
      if (r->scene[s].run[i].prefixes > most) most = r->scene[s].run[i].prefixes;
  return most;
}

static void print_prefixes(FILE *out, const sf_reproduction *r, table *t)
{
  const int steps = most_prefixes(r);
  if (!steps) return;
  fprintf(out, "## PSNR after every number of steps (dB, average)\n\n");
  begin(t), row(t);
  cell(t, "method");
  for (int k = 0; k < steps; k++) cell(t, "%d", k + 1);
  for (int i = SF_RUN_BETA_1E7; i < SF_RUNS; i++) {
    if (isnan(sf_reproduction_prefix(r, -1, i, 0))) continue;
    row(t);
    cell(t, "%s", sf_run_kinds[i].title);
    for (int k = 0; k < steps; k++) number(t, 2, sf_reproduction_prefix(r, -1, i, k));
  }
  row(t);
  cell(t, "mJ per frame, beta = 5e-7");
  for (int k = 0; k < steps; k++) energy(t, sf_reproduction_prefix_energy(r, -1, SF_RUN_BETA_5E7, k));
  end(out, t);
}

/* ---- what is missing ---- */

static void print_unfinished(FILE *out, const sf_reproduction *r)
{
  bool any = false;
  const bool pairs = sf_report_is_pairs(r);
  for (int s = 0; s < r->count; s++)
    for (int i = 0; i < SF_RUNS; i++) {
      const char *status = r->scene[s].run[i].status;
      if (status && strcmp(status, "done") == 0) continue;
      if (pairs && !status) continue;
      if (!any) fprintf(out, "## Runs without a result\n\n");
      any = true;
      fprintf(out, "- %s, %s: %s\n", r->scene[s].name, sf_run_kinds[i].name, status ? status : "not run");
    }
  if (any) fprintf(out, "\n");
  if (r->problems) fprintf(out, "## Problems\n\n");
  for (int i = 0; i < r->problems; i++) fprintf(out, "- %s\n", r->problem[i]);
  if (r->problems) fprintf(out, "\n");
}

sf_status sf_reproduction_print(FILE *out, const sf_reproduction *r)
{
  table t = {.rows = 0};
  if (!open_table(&t, r)) return sf_fail(SF_E_MEMORY, "%s: no memory for the tables", r->dir);
  print_head(out, r);
  if (sf_report_is_pairs(r)) {
    print_pairs(out, r, &t);
  } else {
    print_methods(out, r, &t);
    print_order(out, r, &t);
    print_prefixes(out, r, &t);
    print_scenes(out, r, &t);
  }
  print_unfinished(out, r);
  free(t.cell);
  return sf_ok();
}
