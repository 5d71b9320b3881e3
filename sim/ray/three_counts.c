#include "sim/ray/three_counts.h"
#include "sim/compare.h"
#include "sim/ray/ray.h"
#include <stdlib.h>
#include <string.h>

typedef struct run {
  const sf_three_job *job;
  sf_three_counts *sum;
  sf_dut *dut;
  sf_ray_dut *rays; /* NULL: it has no encoder for the scene's field */
  sf_observer core;
  fx_memory memory;
  sf_memory_recount lines;
  sf_dut_result result;
  bool check_counters; /* after every sample: only to find the sample of a difference, it is slow */
  sf_ray_sample sample[SF_RAY_SAMPLES_MAX];
} run;

/* ---- one sample: outputs, spikes ---- */

/* A decoder puts out no density. */
static sf_status compare_outputs(const fx_net *net, const fx_out *core, const fx_out *rtl)
{
  static const char *const name[4] = {"density", "red", "green", "blue"};
  const uint32_t x[4] = {core->sigma, core->colour[0], core->colour[1], core->colour[2]};
  const uint32_t y[4] = {rtl->sigma, rtl->colour[0], rtl->colour[1], rtl->colour[2]};
  for (int i = fx_net_first_layer(net) != FX_D1; i < 4; i++)
    if (x[i] != y[i]) return sf_fail(SF_E_DIFFERENCE, "%s: core %u, accelerator %u", name[i], x[i], y[i]);
  return sf_ok();
}

static sf_status compare_bitmaps(const fx_net *net, const uint64_t core[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS],
                                 const uint64_t rtl[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS])
{
  for (int t = 0; t < net->steps; t++)
    for (int s = 0; s < FX_SPIKING; s++)
      for (int w = 0; w < SF_SPIKE_WORDS; w++) {
        const int l = fx_spiking_layers[s];
        const uint64_t difference = core[l][t][w] ^ rtl[l][t][w];
        if (!difference) continue;
        const int bit = __builtin_ctzll(difference);
        return sf_fail(SF_E_DIFFERENCE, "spike of layer %s at step %d, neuron %d: core %d, accelerator %d",
                       fx_layer_name(l), t, 64 * w + bit, (int)(core[l][t][w] >> bit & 1),
                       (int)(rtl[l][t][w] >> bit & 1));
      }
  return sf_ok();
}

static sf_status compare_counters(run *r)
{
  fx_counts rtl;
  uint64_t cycles, busy, stalls;
  SF_TRY(sf_dut_counts(r->dut, &rtl, &cycles, &busy, &stalls));
  return sf_compare_ray_counts(r->core.net, &r->core.core, &rtl);
}

static sf_status rtl_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  run *r = user;
  const sf_dut_sample sample = {.ray = ray, .first = first, .f = f};
  const unsigned long long index = r->core.sample;
  fx_out core;
  SF_TRY(sf_observer_net(&r->core, ray, first, f, &core));
  SF_TRY(sf_dut_run(r->dut, &sample, 1, &r->result));
  sf_status status = compare_bitmaps(r->core.net, (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])r->core.trace->spikes,
                                     (const uint64_t(*)[SF_T_MAX][SF_SPIKE_WORDS])r->result.spikes);
  if (status.code == SF_OK) status = compare_outputs(r->core.net, &core, &r->result.out);
  if (status.code == SF_OK && r->check_counters) status = compare_counters(r);
  *out = r->result.out;
  if (status.code != SF_E_DIFFERENCE) return status;
  return sf_fail(status.code, "sample %llu: %s", index, status.message);
}

/* ---- one ray: counters, traffic ---- */

static sf_status name_ray(const run *r, uint64_t index, sf_status status)
{
  char name[200];
  if (status.code != SF_E_DIFFERENCE) return status;
  r->job->name(r->job->user, index, name, sizeof name);
  return sf_fail(status.code, "%s: %s", name, status.message);
}

static uint64_t tile_of(const run *r, uint64_t index)
{
  return r->job->tile ? r->job->tile(r->job->user, index) : index;
}

static sf_status net_ray(run *r, uint64_t index, const fx_ray *ray, fx_pixel *pixel)
{
  return sf_observer_ray(&r->core, r->job->scene, ray, tile_of(r, index), rtl_net, r, pixel);
}

/* The counters differ although outputs and spikes agree: again, with the counters read at every sample. */
static sf_status find_counter_sample(run *r, uint64_t index, const fx_ray *ray, sf_status difference)
{
  fx_pixel pixel;
  r->check_counters = true;
  SF_TRY(sf_dut_clear_counts(r->dut));
  const sf_status status = net_ray(r, index, ray, &pixel);
  return status.code == SF_E_DIFFERENCE ? status : difference;
}

/* Sends the samples that the core took through the accelerator with encoder and compositor. Compares the pixel, and
 * counts what the accelerator reads and writes. */
static sf_status ray_traffic(run *r, uint64_t index, const fx_ray *ray, const fx_pixel *core)
{
  sf_ray_request request = sf_ray_request_as(r->job->scene, ray, core, r->sample);
  sf_field_counters field;
  fx_pixel pixel;
  request.new_tile = sf_ray_dut_new_tile(r->rays, tile_of(r, index));
  SF_TRY(sf_ray_dut_run(r->rays, &request, 1, &pixel));
  SF_TRY(sf_compare_pixel(core, &pixel, sf_dut_cycle(r->rays->dut)));
  SF_TRY(sf_ray_dut_field(r->rays, &field));
  const fx_counts taken = {.samples = pixel.samples};
  const sf_traffic seen = sf_traffic_recount(r->job->scene, &taken, &(fx_memory_counts){0}, (uint64_t)request.n, 1);
  r->sum->rtl_traffic.lookups = field.lookups, r->sum->rtl_traffic.misses = field.misses;
  r->sum->rtl_traffic.table_bytes += seen.table_bytes;
  r->sum->rtl_traffic.exp_neg += seen.exp_neg;
  r->sum->rtl_traffic.frame_bytes += sizeof pixel;
  return sf_ok();
}

static sf_status compare_all(const sf_three_counts *s)
{
  SF_TRY(sf_counts_compare(&s->core, "core", &s->recount, "recount"));
  SF_TRY(sf_traffic_compare(&s->core_traffic, "core", &s->recount_traffic, "recount", SF_TRAFFIC_EVENTS));
  SF_TRY(sf_memory_compare(&s->core_memory, "core", &s->recount_memory, "recount"));
  return sf_traffic_compare(&s->core_traffic, "core", &s->rtl_traffic, "accelerator", s->rtl_events);
}

static sf_status one_ray(run *r, uint64_t index)
{
  sf_three_counts *s = r->sum;
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(r->job->ray(r->job->user, index, &ray));
  s->rays++;
  const sf_status ran = net_ray(r, index, &ray, &pixel); /* broken off by a difference: what was counted until then */
  if (ran.code != SF_OK && ran.code != SF_E_DIFFERENCE) return ran;
  fx_counts_add(&s->core, &r->core.core);
  fx_counts_add(&s->recount, &r->core.recount);
  s->core_memory = r->memory.counts, s->recount_memory = r->lines.counts;
  s->core_traffic = sf_traffic_of(r->job->scene, &s->core, &s->core_memory, (uint64_t)s->rays);
  s->recount_traffic =
      sf_traffic_recount(r->job->scene, &s->recount, &s->recount_memory, s->core.field_samples, (uint64_t)s->rays);
  const sf_status read = sf_dut_counts(r->dut, &s->rtl, &s->cycles, &s->busy, &s->stalls);
  if (ran.code != SF_OK) return name_ray(r, index, ran);
  SF_TRY(read);
  SF_TRY(name_ray(r, index, ray_traffic(r, index, &ray, &pixel)));
  const sf_status status = sf_compare_ray_counts(r->core.net, &s->core, &s->rtl);
  if (status.code == SF_E_DIFFERENCE) return name_ray(r, index, find_counter_sample(r, index, &ray, status));
  return name_ray(r, index, compare_all(s));
}

static sf_status all_rays(run *r)
{
  SF_TRY(sf_dut_clear_counts(r->dut));
  for (int i = 0; i < r->job->rays; i++) {
    SF_TRY(one_ray(r, r->job->index[i]));
    if (r->job->tick && !r->job->tick(r->job->user, i + 1))
      return sf_fail(SF_E_STOPPED, "stopped after %d of %d rays in the accelerator", i + 1, r->job->rays);
  }
  return sf_ok();
}

static sf_status open_and_run(run *r)
{
  const fx_scene *scene = r->job->scene;
  const fx_cache_shape *cache = r->job->cache.bytes ? &r->job->cache : &sf_cache_built;
  const bool built = cache->bytes == sf_cache_built.bytes && cache->ways == sf_cache_built.ways;
  r->sum->rtl_events = built ? SF_TRAFFIC_AT_PORTS : SF_TRAFFIC_LOOKUP; /* another cache is the core's alone */
  SF_TRY(fx_memory_open(&r->memory, scene, cache));
  SF_TRY(sf_memory_recount_open(&r->lines, scene, cache));
  SF_TRY(sf_dut_open(&r->dut, scene, &r->job->dut));
  SF_TRY(sf_ray_dut_open(&r->rays, scene, &r->job->dut));
  return all_rays(r);
}

sf_status sf_three_counts_run(const sf_three_job *job, sf_three_counts *counts)
{
  *counts = (sf_three_counts){.wanted = counts->wanted, .rtl_events = SF_TRAFFIC_AT_PORTS, .agreement = sf_ok()};
  if (job->rays == 0) return sf_ok();
  run *r = calloc(1, sizeof *r);
  fx_trace *trace = calloc(1, sizeof *trace);
  sf_status status = sf_fail(SF_E_MEMORY, "no memory for the three counts");
  if (r && trace) {
    r->job = job, r->sum = counts, r->core.net = &job->scene->net, r->core.trace = trace;
    r->core.memory = &r->memory, r->core.lines = &r->lines;
    status = open_and_run(r);
    fx_memory_close(&r->memory), sf_memory_recount_close(&r->lines);
    sf_ray_dut_close(r->rays);
    if (r->dut) sf_dut_close(r->dut);
  }
  free(r), free(trace);
  if (status.code != SF_E_DIFFERENCE) return status;
  counts->agreement = status;
  return sf_ok();
}
