#include "sim/activity/flow.h"
#include "sim/compare.h"
#include "energy/energy.h"
#include "cli/cli.h"
#include "base/text.h"
#include <stdlib.h>
#include <string.h>

typedef struct samples {
  sf_flow flow; /* the first: a flow is one of these */
  const sf_lockstep *lockstep;
  sf_dut_sample *sample;
  int16_t (*f)[SF_DIR_MAX]; /* [fx_net_inputs] */
  fx_ray *ray;              /* per sample */
  sf_dut_result *result;
  int count, room;
  int32_t base[SF_LANES]; /* of the ray at work */
} samples;

/* ---- the rays of either flow ---- */

sf_status sf_flow_ray(const sf_lockstep *l, int ray, fx_ray *out)
{
  const sf_lockstep_pixel p = sf_lockstep_pick(l, (uint64_t)ray);
  if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "stopped: no file is written");
  return sf_pixel_ray(&l->fx, &l->data, &l->data.view[p.view], p.x, p.y, out);
}

sf_status sf_flow_empty(const sf_lockstep *l)
{
  return sf_fail(SF_E_FORMAT, "%s: none of %d ray%s has a sample: nothing to stream", l->data.path, l->options.rays,
                 sf_plural((uint64_t)l->options.rays));
}

/* ---- samples ---- */

static bool make_room(samples *in)
{
  const int room = in->room ? 2 * in->room : 1024;
  void *sample = realloc(in->sample, (size_t)room * sizeof *in->sample);
  if (sample) in->sample = sample;
  void *f = realloc(in->f, (size_t)room * sizeof *in->f);
  if (f) in->f = f;
  void *ray = realloc(in->ray, (size_t)room * sizeof *in->ray);
  if (ray) in->ray = ray;
  if (!sample || !f || !ray) return false;
  in->room = room;
  return true;
}

/* fx_net_fn */
static sf_status collect(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  samples *in = user;
  const fx_net *net = &in->lockstep->fx.net;
  if (in->count == in->room && !make_room(in)) return sf_fail(SF_E_MEMORY, "activity: no memory for the samples");
  fx_net_next(net, ray->dir, first, f, in->base, out, NULL, NULL);
  memset(in->f[in->count], 0, sizeof in->f[0]);
  memcpy(in->f[in->count], f, (size_t)fx_net_inputs(net) * sizeof *f);
  in->ray[in->count] = *ray;
  in->sample[in->count++].first = first;
  return sf_ok();
}

static sf_status collect_rays(samples *in)
{
  const sf_lockstep *l = in->lockstep;
  for (int i = 0; i < l->options.rays; i++) {
    fx_ray ray;
    fx_pixel pixel;
    fx_counts march = {0};
    SF_TRY(sf_flow_ray(l, i, &ray));
    SF_TRY(fx_render_ray(&l->fx, &ray, collect, in, &pixel, &march));
  }
  if (!in->count) return sf_flow_empty(l);
  for (int i = 0; i < in->count; i++) in->sample[i].ray = &in->ray[i], in->sample[i].f = in->f[i];
  in->flow.rays = (uint64_t)l->options.rays;
  in->flow.items = in->flow.samples = (uint64_t)in->count;
  in->result = malloc((size_t)in->count * sizeof *in->result);
  return in->result ? sf_ok() : sf_fail(SF_E_MEMORY, "activity: no memory for %d results", in->count);
}

static sf_status run(sf_flow *flow)
{
  samples *in = (samples *)flow;
  return sf_dut_run(flow->dut, in->sample, in->count, in->result);
}

static sf_status compare(sf_flow *flow)
{
  const samples *in = (const samples *)flow;
  const fx_net *net = &in->lockstep->fx.net;
  fx_counts expected = {0}, actual;
  int32_t base[SF_LANES];
  char text[200];
  sf_difference d;
  for (int i = 0; i < in->count; i++) {
    fx_trace trace;
    fx_out out;
    fx_net_next(net, in->ray[i].dir, in->sample[i].first, in->f[i], base, &out, &trace, &expected);
    if (sf_compare_sample(net, &trace, &out, &in->result[i], NULL, &d)) continue;
    sf_difference_text(&d, text);
    return sf_fail(SF_E_DIFFERENCE, "sample %d of the stream: %s", i, text);
  }
  SF_TRY(sf_dut_counts(flow->dut, &actual, NULL, NULL, NULL));
  if (sf_compare_counts(&expected, &actual, sf_dut_cycle(flow->dut), &d)) return sf_ok();
  sf_difference_text(&d, text);
  return sf_fail(SF_E_DIFFERENCE, "stream of %d sample%s: %s", in->count, sf_plural((uint64_t)in->count), text);
}

static void close_samples(sf_flow *flow)
{
  samples *in = (samples *)flow;
  sf_dut_close(flow->dut);
  free(in->sample), free(in->f), free(in->ray), free(in->result);
  free(in);
}

sf_status sf_flow_samples(sf_flow **flow, const sf_lockstep *l, const sf_dut_options *options)
{
  samples *in = calloc(1, sizeof *in);
  *flow = NULL;
  if (!in) return sf_fail(SF_E_MEMORY, "activity: out of memory");
  *in = (samples){.flow = {.run = run, .compare = compare, .close = close_samples}, .lockstep = l};
  sf_status status = collect_rays(in);
  if (status.code == SF_OK) status = sf_dut_open(&in->flow.dut, &l->fx, options);
  if (status.code == SF_OK)
    *flow = &in->flow;
  else
    close_samples(&in->flow);
  return status;
}
