/* What PATA is held against, trained and counted by the same programs on the same scenes. */
#include "report/internal.h"
#include "base/json.h"
#include <math.h>
#include <string.h>

typedef enum { TWIN, LEARNED, CONVERTED, ALONG, FIXED } method;

/* One method's numbers; a row has their means over the seeds. BASE, OWN: energy of the ANN run, and of the twin on the
 * method's own samples. */
enum { STEPS, PSNR, ANN_PSNR, EXCESS, ENERGY, BASE, OWN, NUMBERS };
typedef struct point {
  double number[NUMBERS];
  int run; /* SF_RUNS: none */
} point;

typedef struct row {
  sf_mean number[NUMBERS], square; /* square: of PSNR */
  int run;
} row;

static const cJSON *converted_at(const sf_run *ann, int steps)
{
  const cJSON *item;
  cJSON_ArrayForEach(item, sf_json_get(ann->converted, "converted"))
  {
    if (sf_json_number(item, "steps") == steps) return item;
  }
  return NULL;
}

/* PSNR on rays, beside the twin's on the same; energy as a share of the twin's there. */
static point convert(const sf_run run[SF_RUNS], int steps)
{
  const sf_run *ann = &run[SF_RUN_ANN];
  const cJSON *at = converted_at(ann, steps), *twin = sf_json_get(ann->converted, "twin");
  const double psnr = sf_json_number(at, "psnr"), base = ann->value[SF_METRIC_ENERGY];
  const double samples = sf_json_number(at, "samples_per_ray") / sf_json_number(twin, "samples_per_ray");
  return (point){{[STEPS] = steps,
                  [PSNR] = psnr,
                  [ANN_PSNR] = sf_json_number(twin, "psnr"),
                  [EXCESS] = sf_squared_error(psnr) - sf_squared_error(sf_json_number(twin, "psnr")),
                  [ENERGY] = base * sf_json_number(at, "of_twin_percent") / 100,
                  [BASE] = base,
                  [OWN] = base * samples},
                 SF_RUN_ANN};
}

/* The run that trained so many steps alone: one of the sweep, or of the ablations. */
static int fixed_run(const sf_run run[SF_RUNS], int steps)
{
  const int id[] = {SF_RUN_SWEEP + steps - 1, SF_RUN_T, SF_RUN_T_MINUS_1, SF_RUN_T_PLUS_1, SF_RUN_HYBRID};
  for (size_t i = 0; i < sizeof id / sizeof *id; i++)
    if (run[id[i]].value[SF_METRIC_STEPS] == steps && !isnan(run[id[i]].value[SF_METRIC_PSNR])) return id[i];
  return SF_RUNS;
}

static point measure(const sf_run run[SF_RUNS], method m, int which)
{
  const double *ann = run[SF_RUN_ANN].value;
  if (m == CONVERTED) return convert(run, which);
  point p = {.run = m == TWIN ? SF_RUN_ANN : m == ALONG ? SF_RUN_ALONG : m == FIXED ? fixed_run(run, which) : which};
  for (int i = 0; i < NUMBERS; i++) p.number[i] = NAN;
  if (p.run == SF_RUNS) return p;
  const double *own = run[p.run].value;
  p.number[STEPS] = own[SF_METRIC_STEPS], p.number[PSNR] = own[SF_METRIC_PSNR];
  p.number[ENERGY] = own[SF_METRIC_ENERGY];
  if (m == TWIN) return p;
  p.number[ANN_PSNR] = ann[SF_METRIC_PSNR], p.number[EXCESS] = own[SF_METRIC_EXCESS];
  p.number[BASE] = ann[SF_METRIC_ENERGY], p.number[OWN] = own[SF_METRIC_TWIN];
  return p;
}

static row pool(const sf_report_scene *scene, method m, int which)
{
  row all = {.run = SF_RUNS};
  for (int k = 0; k < scene->seeds; k++) {
    const point p = measure(scene->of[k].run, m, which);
    if (isnan(p.number[PSNR])) continue;
    for (int i = 0; i < NUMBERS; i++) sf_mean_add(&all.number[i], p.number[i]);
    sf_mean_add(&all.square, p.number[PSNR] * p.number[PSNR]);
    if (all.run == SF_RUNS) all.run = p.run;
  }
  return all;
}

static double mean_of(const row *x, int number)
{
  return sf_mean_of(&x->number[number]);
}

/* In percent of another energy. */
static double saving(const row *x, int of)
{
  return 100 * (1 - mean_of(x, ENERGY) / mean_of(x, of));
}

/* Standard deviation over the seeds. */
static double psnr_spread(const row *x)
{
  const int n = x->square.count;
  const double mean = mean_of(x, PSNR);
  return n > 1 ? sqrt(fmax(0, (x->square.sum - n * mean * mean) / (n - 1))) : NAN;
}

/* ---- rows ---- */

static void origin_of(const sf_reproduction *r, int s, method m, const row *x, char text[SF_GRID_CELL])
{
  const sf_run *ann = &r->scene[s].run[SF_RUN_ANN];
  const double rays = sf_report_number(ann->converted, "rays");
  if (m != CONVERTED)
    sf_report_origin(r, s, x->run, text);
  else if (x->square.count > 1)
    snprintf(text, SF_GRID_CELL, "%d seeds; %.0f random rays of held-out views", x->square.count, rays);
  else
    snprintf(text, SF_GRID_CELL, "seed %.0f; %.0f random rays of held-out views",
             sf_report_number(ann->summary, "seed"), rays);
}

static void add_row(sf_grids *t, const sf_reproduction *r, int s, method m, int which, const char *name)
{
  const row x = pool(&r->scene[s], m, which);
  const double steps = mean_of(&x, STEPS);
  char origin[SF_GRID_CELL];
  if (isnan(mean_of(&x, PSNR))) return;
  sf_grid_row(t);
  sf_grid_cell(t, "%s", r->scene[s].name), sf_grid_cell(t, "%s", name);
  if (m == ALONG)
    sf_grid_cell(t, "1 a sample");
  else
    sf_grid_number(t, steps == floor(steps) ? 0 : 2, steps);
  sf_grid_spread(t, 2, mean_of(&x, PSNR), psnr_spread(&x));
  sf_grid_number(t, 2, mean_of(&x, ANN_PSNR));
  sf_grid_number(t, 2, 1e5 * mean_of(&x, EXCESS));
  sf_grid_energy(t, mean_of(&x, ENERGY), NAN);
  sf_grid_number(t, 1, saving(&x, BASE)), sf_grid_number(t, 1, saving(&x, OWN));
  origin_of(r, s, m, &x, origin);
  sf_grid_cell(t, "%s", origin);
}

/* Of the numbers of steps that were trained alone: the one of the highest PSNR, and the cheapest whose error is at most
 * that of beta = 5e-7; 0: none. */
static void choose(const sf_report_scene *scene, int *highest, int *cheapest)
{
  const row learned = pool(scene, LEARNED, SF_RUN_BETA_5E7);
  double most = -INFINITY, least = INFINITY;
  *highest = *cheapest = 0;
  for (int steps = 1; steps <= SF_T_MAX; steps++) {
    const row x = pool(scene, FIXED, steps);
    if (mean_of(&x, PSNR) > most) most = mean_of(&x, PSNR), *highest = steps;
    if (mean_of(&x, EXCESS) <= mean_of(&learned, EXCESS) && mean_of(&x, ENERGY) < least)
      least = mean_of(&x, ENERGY), *cheapest = steps;
  }
}

static void fixed_rows(sf_grids *t, const sf_reproduction *r, int s)
{
  int highest, cheapest;
  char name[96];
  choose(&r->scene[s], &highest, &cheapest);
  for (int steps = 1; steps <= SF_T_MAX; steps++) {
    snprintf(name, sizeof name, "fixed T, trained alone%s%s", steps == highest ? ", best PSNR" : "",
             steps == cheapest ? ", cheapest as good as PATA" : "");
    add_row(t, r, s, FIXED, steps, name);
  }
}

static void scene_rows(sf_grids *t, const sf_reproduction *r, int s)
{
  const sf_report_scene *scene = &r->scene[s];
  const cJSON *item;
  char name[96];
  add_row(t, r, s, TWIN, 0, sf_run_kinds[SF_RUN_ANN].title);
  for (int i = 0; i < SF_BETAS; i++) {
    const int run = sf_paper_groups[scene->group].beta[i];
    snprintf(name, sizeof name, "PATA, %s", sf_run_kinds[run].title);
    add_row(t, r, s, LEARNED, run, name);
  }
  cJSON_ArrayForEach(item, sf_json_get(scene->run[SF_RUN_ANN].converted, "converted"))
  {
    add_row(t, r, s, CONVERTED, (int)sf_report_number(item, "steps"), "twin converted, no training");
  }
  add_row(t, r, s, ALONG, 0, sf_run_kinds[SF_RUN_ALONG].title);
  fixed_rows(t, r, s);
}

static bool is_compared(const sf_report_scene *scene)
{
  bool any = scene->run[SF_RUN_ANN].converted != NULL;
  for (int i = SF_RUN_ALONG; i < SF_RUNS; i++) any |= scene->run[i].summary != NULL;
  return any;
}

void sf_report_add_comparators(sf_grids *t, const sf_reproduction *r)
{
  static const char *const head[] = {"scene",       "method", "steps",    "PSNR dB",   "twin dB",
                                     "excess 1e-5", "mJ",     "saving %", "of twin %", "measured on"};
  bool any = false;
  for (int s = 0; s < r->count; s++) any |= is_compared(&r->scene[s]);
  if (!any) return;
  sf_grid_begin(t, 2, "comparators", "Measured comparators");
  if (t->count) t->grid[t->count - 1].text_last = true;
  for (size_t i = 0; i < sizeof head / sizeof *head; i++) sf_grid_cell(t, "%s", head[i]);
  for (int s = 0; s < r->count; s++)
    if (is_compared(&r->scene[s])) scene_rows(t, r, s);
  sf_grid_note(
      t,
      "excess: squared error less the twin's on the same rays. mJ: paper ledger, of the audited frames. saving: "
      "against\n"
      "the ANN run; of twin: against the twin on the method's own samples. The converted twin has thresholds balanced "
      "on\n"
      "the training views, as in Spiking-NeRF; its mJ is the twin's, times its share on random rays. Samples of a ray "
      "as\n"
      "steps: membranes pass along the ray, as in SpikingNeRF, trained; its mJ is the twin's, times its share on the\n"
      "held-out views. fixed T: each trained alone, without a search.");
}
