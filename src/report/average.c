/* Averages over scenes, and their spread over seeds. */
#include "report/internal.h"
#include <math.h>

bool sf_reproduction_chosen(const sf_reproduction *r, int s, int scenes)
{
  return scenes == SF_SCENES_ALL || s == scenes || r->scene[s].group == SF_SCENES_OF - scenes;
}

double sf_reproduction_mean(const sf_reproduction *r, int scenes, int run, int metric, int *count)
{
  sf_mean m = {0};
  for (int s = 0; s < r->count; s++)
    if (sf_reproduction_chosen(r, s, scenes)) sf_mean_add(&m, r->scene[s].run[run].value[metric]);
  if (count) *count = m.count;
  return sf_mean_of(&m);
}

/* Of one scene's seeds; NaN: fewer than two. */
static double variance(const sf_report_scene *scene, int run, int metric)
{
  sf_mean m = {0}, squares = {0};
  for (int k = 0; k < scene->seeds; k++) sf_mean_add(&m, scene->of[k].run[run].value[metric]);
  for (int k = 0; k < scene->seeds; k++) {
    const double off = scene->of[k].run[run].value[metric] - sf_mean_of(&m);
    sf_mean_add(&squares, off * off);
  }
  return squares.count > 1 ? squares.sum / (squares.count - 1) : NAN;
}

double sf_reproduction_spread(const sf_reproduction *r, int scenes, int run, int metric)
{
  sf_mean m = {0};
  int count;
  for (int s = 0; s < r->count; s++)
    if (sf_reproduction_chosen(r, s, scenes)) sf_mean_add(&m, variance(&r->scene[s], run, metric));
  sf_reproduction_mean(r, scenes, run, metric, &count);
  return sqrt(sf_mean_of(&m) / count);
}

double sf_reproduction_saving(const sf_reproduction *r, int scenes, int run, int other)
{
  double spent = 0, base = 0;
  for (int s = 0; s < r->count; s++) {
    if (!sf_reproduction_chosen(r, s, scenes)) continue;
    const sf_run *runs = r->scene[s].run;
    const double a = runs[run].value[SF_METRIC_ENERGY],
                 b = other == SF_SAVING_TWIN ? runs[run].value[SF_METRIC_TWIN] : runs[other].value[SF_METRIC_ENERGY];
    if (isnan(a) || isnan(b)) continue;
    spent += a, base += b;
  }
  return base > 0 ? 100 * (1 - spent / base) : NAN;
}

double sf_reproduction_prefix(const sf_reproduction *r, int scenes, int run, int step)
{
  sf_mean m = {0};
  for (int s = 0; s < r->count; s++) {
    const sf_run *one = &r->scene[s].run[run];
    if (sf_reproduction_chosen(r, s, scenes) && step < one->prefixes) sf_mean_add(&m, one->prefix_psnr[step]);
  }
  return sf_mean_of(&m);
}

double sf_reproduction_prefix_energy(const sf_reproduction *r, int scenes, int run, int step)
{
  sf_mean m = {0};
  for (int s = 0; s < r->count; s++)
    if (sf_reproduction_chosen(r, s, scenes)) sf_mean_add(&m, r->scene[s].run[run].prefix_energy[step]);
  return sf_mean_of(&m);
}
