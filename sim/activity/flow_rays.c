#include "sim/activity/flow.h"
#include "sim/compare.h"
#include "sim/ray/ray.h"
#include <stdlib.h>
#include <string.h>

typedef struct rays {
  sf_flow flow; /* the first: a flow is one of these */
  const sf_lockstep *lockstep;
  sf_ray_dut *dut;
  fx_ray *ray;
  sf_ray_request *request;
  sf_ray_sample **sample; /* per ray */
  fx_pixel *core, *actual;
  fx_counts counts; /* the core's */
  fx_memory memory;
  sf_ray_sample scratch[SF_RAY_SAMPLES_MAX]; /* of one ray */
} rays;

static void core_reads(void *user, fx_read what, const uint32_t pos[3])
{
  fx_memory_read(user, what, pos);
}

/* The samples that the block needs, kept in as much memory as they take. */
static sf_status keep_request(rays *in, int i)
{
  sf_ray_request *r = &in->request[i];
  *r = sf_ray_request_as(&in->lockstep->fx, &in->ray[i], &in->core[i], in->scratch);
  in->sample[i] = malloc(((size_t)r->n + 1) * sizeof *in->scratch);
  if (!in->sample[i]) return sf_fail(SF_E_MEMORY, "activity: no memory for the samples");
  memcpy(in->sample[i], in->scratch, (size_t)r->n * sizeof *in->scratch);
  r->sample = in->sample[i];
  r->new_tile = sf_ray_dut_new_tile(in->dut, (uint64_t)i);
  return sf_ok();
}

static sf_status collect_rays(rays *in)
{
  const sf_lockstep *l = in->lockstep;
  const fx_watch watch = {core_reads, &in->memory};
  const fx_cache_shape cache = sf_ray_dut_cache(in->dut);
  SF_TRY(fx_memory_open(&in->memory, &l->fx, &cache));
  for (int i = 0; i < l->options.rays; i++) {
    SF_TRY(sf_flow_ray(l, i, &in->ray[i]));
    fx_memory_ray(&in->memory, (uint64_t)i);
    SF_TRY(fx_render_watched(&l->fx, &in->ray[i], NULL, NULL, &watch, &in->core[i], &in->counts));
    SF_TRY(keep_request(in, i));
  }
  in->flow.rays = in->flow.items = (uint64_t)l->options.rays;
  in->flow.samples = in->counts.samples;
  return in->counts.samples ? sf_ok() : sf_flow_empty(l);
}

static sf_status run(sf_flow *flow)
{
  rays *in = (rays *)flow;
  return sf_ray_dut_stream(in->dut, in->request, (int)flow->items, in->actual);
}

static sf_status compare(sf_flow *flow)
{
  const rays *in = (const rays *)flow;
  sf_field_counters field;
  fx_counts counts;
  for (int i = 0; i < (int)flow->items; i++) {
    const sf_status same = sf_compare_pixel(&in->core[i], &in->actual[i], sf_dut_cycle(flow->dut));
    if (same.code != SF_OK) return sf_fail(same.code, "ray %d of the stream: %s", i, same.message);
  }
  SF_TRY(sf_dut_counts(flow->dut, &counts, NULL, NULL, NULL));
  SF_TRY(sf_compare_ray_counts(&in->lockstep->fx.net, &in->counts, &counts));
  SF_TRY(sf_ray_dut_field(in->dut, &field));
  SF_TRY(sf_compare_field(&in->memory.counts, &field));
  flow->lookups = field.lookups, flow->misses = field.misses;
  return sf_ok();
}

static void close_rays(sf_flow *flow)
{
  rays *in = (rays *)flow;
  sf_ray_dut_close(in->dut);
  fx_memory_close(&in->memory);
  for (int i = 0; in->sample && i < in->lockstep->options.rays; i++) free(in->sample[i]);
  free(in->ray), free(in->request), free(in->sample), free(in->core), free(in->actual);
  free(in);
}

static sf_status open_rays(rays *in, const sf_dut_options *options)
{
  const size_t n = (size_t)in->lockstep->options.rays;
  in->ray = calloc(n, sizeof *in->ray), in->request = calloc(n, sizeof *in->request);
  in->sample = calloc(n, sizeof *in->sample);
  in->core = calloc(n, sizeof *in->core), in->actual = calloc(n, sizeof *in->actual);
  if (!in->ray || !in->request || !in->sample || !in->core || !in->actual)
    return sf_fail(SF_E_MEMORY, "activity: no memory for %zu rays", n);
  SF_TRY(sf_ray_dut_open(&in->dut, &in->lockstep->fx, options));
  in->flow.dut = in->dut->dut;
  return collect_rays(in);
}

sf_status sf_flow_rays(sf_flow **flow, const sf_lockstep *l, const sf_dut_options *options)
{
  rays *in = calloc(1, sizeof *in);
  *flow = NULL;
  if (!in) return sf_fail(SF_E_MEMORY, "activity: out of memory");
  *in = (rays){.flow = {.run = run, .compare = compare, .close = close_rays}, .lockstep = l};
  const sf_status status = open_rays(in, options);
  if (status.code == SF_OK)
    *flow = &in->flow;
  else
    close_rays(&in->flow);
  return status;
}
