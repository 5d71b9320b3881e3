/* Averages over scenes, and the paper's order. */
#include "report/report.h"
#include <math.h>

/* ---- means ---- */

typedef struct mean {
  double sum;
  int count;
} mean;

static void add(mean *m, double value)
{
  if (isnan(value)) return;
  m->sum += value;
  m->count++;
}

static double mean_of(const mean *m)
{
  return m->count ? m->sum / m->count : NAN;
}

static int first_scene(int scene)
{
  return scene < 0 ? 0 : scene;
}

static int last_scene(const sf_reproduction *r, int scene)
{
  return scene < 0 ? r->count : scene + 1;
}

double sf_reproduction_mean(const sf_reproduction *r, int scene, int run, int metric, int *count)
{
  mean m = {0};
  for (int s = first_scene(scene); s < last_scene(r, scene); s++) add(&m, r->scene[s].run[run].value[metric]);
  if (count) *count = m.count;
  return mean_of(&m);
}

double sf_reproduction_saving(const sf_reproduction *r, int scene, int run, int other)
{
  double spent = 0, base = 0;
  for (int s = first_scene(scene); s < last_scene(r, scene); s++) {
    const sf_run *runs = r->scene[s].run;
    const double a = runs[run].value[SF_METRIC_ENERGY],
                 b = other == SF_SAVING_TWIN ? runs[run].value[SF_METRIC_TWIN] : runs[other].value[SF_METRIC_ENERGY];
    if (isnan(a) || isnan(b)) continue;
    spent += a, base += b;
  }
  return base > 0 ? 100 * (1 - spent / base) : NAN;
}

double sf_reproduction_prefix(const sf_reproduction *r, int scene, int run, int step)
{
  mean m = {0};
  for (int s = first_scene(scene); s < last_scene(r, scene); s++) {
    const sf_run *one = &r->scene[s].run[run];
    if (step < one->prefixes) add(&m, one->prefix_psnr[step]);
  }
  return mean_of(&m);
}

double sf_reproduction_prefix_energy(const sf_reproduction *r, int scene, int run, int step)
{
  mean m = {0};
  for (int s = first_scene(scene); s < last_scene(r, scene); s++) add(&m, r->scene[s].run[run].prefix_energy[step]);
  return mean_of(&m);
}

/* ---- order ---- */

const char *const sf_order_names[] = {"-", "yes", "tie", "no"};
const double sf_order_tolerance[SF_METRICS] = {
    [SF_METRIC_PSNR] = 0.05, [SF_METRIC_SSIM] = 0.001, [SF_METRIC_STEPS] = 0.05, [SF_METRIC_ENERGY] = 0.01};

sf_order_verdict sf_order_judge(double paper, double ours, double paper_tolerance, double tolerance)
{
  if (isnan(paper) || isnan(ours)) return SF_ORDER_MISSING;
  const bool opposite = (ours > 0) != (paper > 0), tie = fabs(ours) <= tolerance;
  if (fabs(paper) <= paper_tolerance) return opposite && !tie ? SF_ORDER_NO : SF_ORDER_YES;
  return tie ? SF_ORDER_TIE : opposite ? SF_ORDER_NO : SF_ORDER_YES;
}

/* Over the scenes that have both; *tolerance of the difference. */
static double difference(const sf_reproduction *r, int a, int b, int metric, int *scenes, double *tolerance)
{
  mean x = {0}, y = {0};
  for (int s = 0; s < r->count; s++) {
    const double va = r->scene[s].run[a].value[metric], vb = r->scene[s].run[b].value[metric];
    if (isnan(va) || isnan(vb)) continue;
    add(&x, va), add(&y, vb);
  }
  *scenes = x.count;
  const double smaller = fmin(mean_of(&x), mean_of(&y));
  *tolerance = sf_order_tolerance[metric] * (metric == SF_METRIC_ENERGY ? smaller : 1);
  return mean_of(&x) - mean_of(&y);
}

static const struct {
  const char *group;
  int a, b, metric;
} pairs[] = {
    {"beta", SF_RUN_BETA_1E7, SF_RUN_BETA_5E7, SF_METRIC_PSNR},
    {"beta", SF_RUN_BETA_5E7, SF_RUN_BETA_1E6, SF_METRIC_PSNR},
    {"beta", SF_RUN_BETA_1E7, SF_RUN_BETA_5E7, SF_METRIC_STEPS},
    {"beta", SF_RUN_BETA_5E7, SF_RUN_BETA_1E6, SF_METRIC_STEPS},
    {"beta", SF_RUN_BETA_1E7, SF_RUN_BETA_5E7, SF_METRIC_ENERGY},
    {"beta", SF_RUN_BETA_5E7, SF_RUN_BETA_1E6, SF_METRIC_ENERGY},
    {"ANN", SF_RUN_BETA_1E7, SF_RUN_ANN, SF_METRIC_PSNR},
    {"ANN", SF_RUN_BETA_5E7, SF_RUN_ANN, SF_METRIC_PSNR},
    {"ANN", SF_RUN_BETA_1E6, SF_RUN_ANN, SF_METRIC_PSNR},
    {"ANN", SF_RUN_BETA_1E7, SF_RUN_ANN, SF_METRIC_ENERGY},
    {"input modes", SF_RUN_HYBRID, SF_RUN_NO_DECAY, SF_METRIC_PSNR},
    {"input modes", SF_RUN_NO_DECAY, SF_RUN_DECAY, SF_METRIC_PSNR},
    {"input modes", SF_RUN_HYBRID, SF_RUN_DECAY, SF_METRIC_PSNR},
    {"stage I", SF_RUN_BETA_5E7, SF_RUN_NO_STAGE1, SF_METRIC_PSNR},
    {"L_extra", SF_RUN_BETA_5E7, SF_RUN_NO_EXTRA, SF_METRIC_PSNR},
    {"L_extra", SF_RUN_BETA_5E7, SF_RUN_NO_EXTRA, SF_METRIC_STEPS},
    {"L_penalty", SF_RUN_NO_PENALTY, SF_RUN_BETA_5E7, SF_METRIC_PSNR},
    {"L_penalty", SF_RUN_NO_PENALTY, SF_RUN_BETA_5E7, SF_METRIC_STEPS},
    {"L_budg", SF_RUN_BETA_5E7, SF_RUN_NO_BUDGET, SF_METRIC_PSNR},
    {"L_budg", SF_RUN_NO_BUDGET, SF_RUN_BETA_5E7, SF_METRIC_STEPS},
    {"fixed steps", SF_RUN_T_PLUS_1, SF_RUN_T, SF_METRIC_PSNR},
    {"fixed steps", SF_RUN_T, SF_RUN_T_MINUS_1, SF_METRIC_PSNR},
    {"fixed steps", SF_RUN_T_PLUS_1, SF_RUN_T, SF_METRIC_ENERGY},
    {"fixed steps", SF_RUN_T, SF_RUN_T_MINUS_1, SF_METRIC_ENERGY},
    {"learned steps", SF_RUN_BETA_5E7, SF_RUN_T, SF_METRIC_PSNR},
};
_Static_assert(sizeof pairs / sizeof *pairs <= SF_ORDERS_MAX, "sf_order[] is too short");

int sf_reproduction_order(const sf_reproduction *r, sf_order order[SF_ORDERS_MAX])
{
  const int n = (int)(sizeof pairs / sizeof *pairs);
  for (int i = 0; i < n; i++) {
    sf_order *o = &order[i];
    *o = (sf_order){.group = pairs[i].group, .a = pairs[i].a, .b = pairs[i].b, .metric = pairs[i].metric};
    const double a = sf_run_kinds[o->a].paper[o->metric], b = sf_run_kinds[o->b].paper[o->metric];
    double tolerance;
    o->paper = a - b;
    o->ours = difference(r, o->a, o->b, o->metric, &o->scenes, &tolerance);
    const double share = o->metric == SF_METRIC_ENERGY ? fmin(a, b) : 1;
    o->verdict = sf_order_judge(o->paper, o->ours, sf_order_tolerance[o->metric] * share, tolerance);
  }
  return n;
}
