/* What a converted net shows and costs, on random rays. */
#include "convert/internal.h"
#include "energy/energy.h"
#include "render/march.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>

enum { PLACES = 1 + SF_CONVERT_POINTS }; /* the twin first */

/* A ray on its way, once per number of steps: each ends where its own light does. */
typedef struct way {
  float transmittance[PLACES], rgb[PLACES][3];
  uint64_t samples[PLACES], sops[PLACES];
} way;

/* colour: NULL of a sample that the net does not see. */
static void add(way *w, float stop, int place, float sigma, const float *colour, float length, uint64_t sops)
{
  if (w->transmittance[place] < stop) return;
  const float behind = w->transmittance[place] * expf(-sigma * length);
  if (!colour) {
    w->transmittance[place] = behind;
    return;
  }
  for (int c = 0; c < 3; c++) w->rgb[place][c] += (w->transmittance[place] - behind) * colour[c];
  w->transmittance[place] = behind;
  w->samples[place]++, w->sops[place] += sops;
}

static bool alive(const way *w, float stop, int places)
{
  for (int i = 0; i < places; i++)
    if (w->transmittance[i] >= stop) return true;
  return false;
}

static void walk(const sf_converted *net, const sf_steps *intervals, const convert_ray *ray, int points,
                 const int *steps, way *w)
{
  const sf_march march = sf_march_begin(net->model, intervals, ray->origin, ray->direction, 0.5f);
  sf_converted_output output[SF_CONVERT_POINTS];
  convert_point p;
  float x[3], colour[3];
  for (int i = 0; i <= points; i++) w->transmittance[i] = 1;
  for (int n = sf_march_next(&march, 0, x); n >= 0 && alive(w, march.stop, points + 1);
       n = sf_march_next(&march, n + 1, x)) {
    const float length = intervals->length[n];
    const bool seen = convert_read(net->model, ray, x, w->transmittance[0], length, &p);
    if (seen) {
      sf_net_sample(net->model, p.in, ray->sh, 1, &p.sigma, colour, NULL);
      sf_converted_sample(net, p.in, ray->sh, points, steps, output);
    }
    add(w, march.stop, 0, p.sigma, seen ? colour : NULL, length, 0);
    for (int i = 0; i < points; i++)
      add(w, march.stop, 1 + i, net->first ? p.sigma : output[i].sigma, seen ? output[i].colour : NULL, length,
          output[i].sops);
  }
  for (int i = 0; i <= points; i++)
    for (int c = 0; c < 3; c++) w->rgb[i][c] += w->transmittance[i]; /* white behind */
}

/* Sums in the order of the rays: the same for any number of threads. */
static void sum_up(const sf_converted *net, const convert_ray *ray, const way *w, int rays, int place,
                   sf_conversion *to)
{
  double error = 0;
  for (int i = 0; i < rays; i++) {
    for (int c = 0; c < 3; c++) {
      const double d = fmin(fmax(w[i].rgb[place][c], 0), 1) - ray[i].truth[c];
      error += d * d;
    }
    to->samples += w[i].samples[place], to->sops += w[i].sops[place];
  }
  to->psnr = -10 * log10(error / (3.0 * rays));
  to->macs = to->samples * sf_converted_macs(net->model, to->steps);
  to->fj = to->macs * SF_MAC_FJ + to->sops * SF_SOP_FJ;
}

sf_status sf_convert_measure(const sf_converted *net, const sf_dataset *views, const sf_conversion_rays *rays,
                             int points, const int *steps, sf_conversion *twin, sf_conversion *result)
{
  sf_steps intervals;
  const int n = rays->count;
  int done = 0;
  SF_TRY(sf_march_steps(&intervals, net->model, 1));
  convert_ray *ray = calloc((size_t)n, sizeof *ray);
  way *w = calloc((size_t)n, sizeof *w);
  sf_status status = ray && w ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for %d rays", n);
  for (int i = 0; i < n && !status.code; i++) status = convert_pick(views, rays->seed, (uint64_t)i, &ray[i]);
  if (!status.code) {
#pragma omp parallel for schedule(dynamic, 4)
    for (int i = 0; i < n; i++) {
      int now;
      walk(net, &intervals, &ray[i], points, steps, &w[i]);
#pragma omp atomic capture
      now = ++done;
      if (rays->tick && omp_get_thread_num() == 0) rays->tick(rays->user, now);
    }
    *twin = (sf_conversion){0};
    sum_up(net, ray, w, n, 0, twin);
    for (int p = 0; p < points; p++) {
      result[p] = (sf_conversion){.steps = steps[p]};
      sum_up(net, ray, w, n, 1 + p, &result[p]);
    }
  }
  free(ray), free(w);
  return status;
}
