/* Rays of the kit and what the fixed-point core makes of their samples. */
#include "sim/kit/kit.h"
#include "energy/energy.h"
#include "base/rng.h"
#include "base/text.h"
#include <stdlib.h>
#include <string.h>

/* As in sf_cosim: its ray N of the same seed is this ray N. */
enum { STREAM_VIEW = 1, STREAM_X, STREAM_Y };
/* Of a longer ray only the first ones, so that even a small kit has several directions. */
enum { SAMPLES_PER_RAY = 12 };

/* fx_net_fn */
static sf_status evaluate(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  sf_kit_draw *d = user;
  const fx_net *net = &d->scene->net;
  if (d->samples == d->limit || d->ray[d->rays].samples == SAMPLES_PER_RAY)
    return sf_fail(SF_E_STOPPED, "limit of samples reached");
  sf_kit_sample *s = &d->sample[d->samples++];
  s->ray = d->rays;
  s->first = first;
  memcpy(s->f, f, (size_t)fx_net_inputs(net) * sizeof *f);
  fx_net_next(net, ray->dir, first, s->f, d->base, &s->out, &s->trace, &d->counts);
  d->ray[d->rays].samples++;
  *out = s->out;
  return sf_ok();
}

static sf_status draw_ray(sf_kit_draw *d, const sf_dataset *data, uint64_t seed, uint64_t number)
{
  sf_kit_ray *r = &d->ray[d->rays];
  fx_pixel pixel;
  *r = (sf_kit_ray){.number = number, .view = (int)sf_random_below(seed, STREAM_VIEW, number, (uint64_t)data->count)};
  const sf_camera *camera = &data->view[r->view].camera;
  r->x = (int)sf_random_below(seed, STREAM_X, number, (uint64_t)camera->width);
  r->y = (int)sf_random_below(seed, STREAM_Y, number, (uint64_t)camera->height);
  SF_TRY(sf_pixel_ray(d->scene, data, &data->view[r->view], r->x, r->y, &r->ray));
  fx_counts march = {0}; /* the accelerator neither marches nor reads the grid */
  const sf_status status = fx_render_ray(d->scene, &r->ray, evaluate, d, &pixel, &march);
  d->rays += r->samples > 0;
  return status.code == SF_E_STOPPED ? sf_ok() : status;
}

sf_status sf_kit_draw_samples(sf_kit_draw *draw, const fx_scene *scene, const sf_dataset *data,
                              const sf_kit_options *options)
{
  *draw = (sf_kit_draw){.scene = scene, .limit = options->samples};
  draw->sample = calloc((size_t)options->samples, sizeof *draw->sample);
  draw->ray = calloc((size_t)options->samples + 1, sizeof *draw->ray); /* each has a sample, but for the one at work */
  if (!draw->sample || !draw->ray) return sf_fail(SF_E_MEMORY, "no memory for %d samples", options->samples);
  for (int i = 0; i < options->rays && draw->samples < draw->limit; i++)
    SF_TRY(draw_ray(draw, data, options->seed, (uint64_t)i));
  if (draw->samples) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: none of %d ray%s has a sample: no vectors", data->path, options->rays,
                 sf_plural((uint64_t)options->rays));
}

void sf_kit_draw_free(sf_kit_draw *draw)
{
  free(draw->sample);
  free(draw->ray);
  *draw = (sf_kit_draw){0};
}
