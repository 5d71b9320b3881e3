/* Pairs of runs that the paper orders: which is larger, there and here. */
#include "report/report.h"
#include <math.h>

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

/* Two runs on the scenes that have both, paired by seeds. Every scene weighs the same. */
typedef struct comparison {
  double difference, error, smaller;
  int scenes, pairs;
} comparison;

/* Mean difference of a scene's pairs, and of its values the smaller mean; NaN: none. */
static double scene_difference(const sf_report_scene *scene, int a, int b, int metric, double *smaller, int *pairs)
{
  double x = 0, y = 0;
  *pairs = 0;
  for (int k = 0; k < scene->seeds; k++) {
    const double va = scene->of[k].run[a].value[metric], vb = scene->of[k].run[b].value[metric];
    if (!isnan(va - vb)) x += va, y += vb, ++*pairs;
  }
  *smaller = fmin(x, y) / *pairs;
  return (x - y) / *pairs;
}

/* Weighted squares of what the pairs of a scene are off the mean. */
static double squares(const sf_report_scene *scene, int a, int b, int metric, double mean, double weight)
{
  double sum = 0;
  for (int k = 0; k < scene->seeds; k++) {
    const double off = scene->of[k].run[a].value[metric] - scene->of[k].run[b].value[metric] - mean;
    if (!isnan(off)) sum += weight * weight * off * off;
  }
  return sum;
}

static comparison compare(const sf_reproduction *r, int group, int a, int b, int metric)
{
  comparison c = {.error = NAN};
  int pairs, most = 0;
  double smaller, sum = 0;
  for (int s = 0; s < r->count; s++) {
    const double d = r->scene[s].group == group ? scene_difference(&r->scene[s], a, b, metric, &smaller, &pairs) : NAN;
    if (isnan(d)) continue;
    c.difference += d, c.smaller += smaller, c.scenes++, c.pairs += pairs;
    if (pairs > most) most = pairs;
  }
  c.difference /= c.scenes, c.smaller /= c.scenes;
  if (most < 2) return c;
  for (int s = 0; s < r->count; s++) {
    if (r->scene[s].group != group) continue;
    scene_difference(&r->scene[s], a, b, metric, &smaller, &pairs);
    if (pairs) sum += squares(&r->scene[s], a, b, metric, c.difference, 1.0 / (c.scenes * pairs));
  }
  c.error = sqrt(sum * c.pairs / (c.pairs - 1));
  return c;
}

typedef struct pair {
  const char *group;
  int a, b, metric;
} pair;

/* Of every group: places among its budgets, or the twin. */
enum { LOW, MIDDLE, HIGH, TWIN };
static const pair budgets[] = {
    {"beta", LOW, MIDDLE, SF_METRIC_PSNR},   {"beta", MIDDLE, HIGH, SF_METRIC_PSNR},
    {"beta", LOW, MIDDLE, SF_METRIC_STEPS},  {"beta", MIDDLE, HIGH, SF_METRIC_STEPS},
    {"beta", LOW, MIDDLE, SF_METRIC_ENERGY}, {"beta", MIDDLE, HIGH, SF_METRIC_ENERGY},
    {"ANN", LOW, TWIN, SF_METRIC_PSNR},      {"ANN", MIDDLE, TWIN, SF_METRIC_PSNR},
    {"ANN", HIGH, TWIN, SF_METRIC_PSNR},     {"ANN", LOW, TWIN, SF_METRIC_ENERGY},
};
/* Of the first group alone. */
static const pair ablations[] = {
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
enum { BUDGETS = sizeof budgets / sizeof *budgets, ABLATIONS = sizeof ablations / sizeof *ablations };
_Static_assert(BUDGETS + ABLATIONS <= SF_ORDERS_MAX, "sf_order[] is too short");

static int run_of(int group, int place)
{
  return place == TWIN ? SF_RUN_ANN : sf_paper_groups[group].beta[place];
}

static void judge(const sf_reproduction *r, int group, sf_order *o)
{
  const double a = sf_paper_value(group, o->a, o->metric), b = sf_paper_value(group, o->b, o->metric);
  const comparison c = compare(r, group, o->a, o->b, o->metric);
  const bool share = o->metric == SF_METRIC_ENERGY;
  const double tie = sf_order_tolerance[o->metric];
  o->paper = a - b, o->ours = c.difference, o->error = c.error, o->scenes = c.scenes, o->pairs = c.pairs;
  o->verdict = sf_order_judge(o->paper, o->ours, share ? tie * fmin(a, b) : tie,
                              !isnan(c.error) ? 2 * c.error
                              : share         ? tie * c.smaller
                                              : tie);
}

int sf_reproduction_order(const sf_reproduction *r, int group, sf_order order[SF_ORDERS_MAX])
{
  const int n = group == 0 ? BUDGETS + ABLATIONS : group < SF_PAPER_GROUPS ? BUDGETS : 0;
  for (int i = 0; i < n; i++) {
    const pair *p = i < BUDGETS ? &budgets[i] : &ablations[i - BUDGETS];
    order[i] = (sf_order){.group = p->group,
                          .a = i < BUDGETS ? run_of(group, p->a) : p->a,
                          .b = i < BUDGETS ? run_of(group, p->b) : p->b,
                          .metric = p->metric};
    judge(r, group, &order[i]);
  }
  return n;
}
