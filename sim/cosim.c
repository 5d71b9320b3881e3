#include "sim/cosim.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CHUNK = SF_REPLAY_MAX };

typedef struct entry {
  fx_ray ray;
  uint64_t number, sample; /* ray, sample of the ray */
  bool first;
  int16_t f[SF_DIR_MAX]; /* [fx_net_inputs] */
  fx_out out;
  fx_trace trace;
} entry;

struct sf_cosim {
  const fx_scene *scene;
  sf_dut_options options;
  sf_dut *dut;
  int n;
  uint64_t number, sample; /* of the ray at work */
  int32_t base[SF_LANES];
  fx_counts expected; /* of the chunk */
  sf_cosim_totals sum;
  sf_cosim_place place;
  entry chunk[CHUNK];
  sf_dut_sample input[CHUNK];
  sf_dut_result result[CHUNK];
  sf_dut_trace trace[CHUNK];
};

sf_status sf_cosim_open(sf_cosim **cosim, const fx_scene *scene, const sf_dut_options *options)
{
  *cosim = NULL;
  sf_cosim *c = calloc(1, sizeof *c);
  if (!c) return sf_fail(SF_E_MEMORY, "co-simulation: out of memory");
  c->scene = scene;
  c->options = *options;
  const sf_status status = sf_dut_open(&c->dut, scene, options);
  if (status.code == SF_OK)
    *cosim = c;
  else
    sf_cosim_close(c);
  return status;
}

/* ---- where a counter departs ---- */

/* Runs the chunk again on a fresh accelerator, and reads the counters after every sample. */
static sf_status locate_count(const sf_cosim *c, sf_dut *dut, sf_cosim_place *place)
{
  fx_counts expected = {0};
  fx_trace trace;
  fx_out out;
  int32_t base[SF_LANES];
  for (int i = 0; i < c->n; i++) {
    const entry *e = &c->chunk[i];
    const sf_dut_sample sample = {.ray = &e->ray, .first = e->first || i == 0, .f = e->f};
    sf_dut_result result;
    fx_counts actual;
    fx_net_next(&c->scene->net, e->ray.dir, sample.first, e->f, base, &out, &trace, &expected);
    SF_TRY(sf_dut_run(dut, &sample, 1, &result));
    SF_TRY(sf_dut_counts(dut, &actual, NULL, NULL, NULL));
    if (sf_compare_counts(&expected, &actual, result.cycle, &place->what)) continue;
    place->ray = e->number;
    place->sample = e->sample;
    place->exact = true;
    return sf_ok();
  }
  return sf_ok();
}

static sf_status count_difference(sf_cosim *c, const sf_difference *difference)
{
  c->place = (sf_cosim_place){true, c->chunk[0].number, c->chunk[0].sample, false, *difference};
  sf_dut *dut;
  SF_TRY(sf_dut_open(&dut, c->scene, &c->options));
  const sf_status status = locate_count(c, dut, &c->place);
  sf_dut_close(dut);
  return status;
}

static sf_status differ(const sf_cosim *c)
{
  return sf_fail(SF_E_DIFFERENCE, "%s differs from the fixed-point core", c->place.what.wire);
}

/* ---- chunks ---- */

static void add_spikes(sf_cosim *c, const entry *e)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < SF_T_MAX; t++)
      for (int word = 0; word < SF_SPIKE_WORDS; word++)
        c->sum.spikes += (uint64_t)__builtin_popcountll(e->trace.spikes[l][t][word]);
}

static sf_status compare_samples(sf_cosim *c)
{
  for (int i = 0; i < c->n; i++) {
    const entry *e = &c->chunk[i];
    if (sf_compare_sample(&c->scene->net, &e->trace, &e->out, &c->result[i], &c->trace[i], &c->place.what)) continue;
    c->place.found = c->place.exact = true;
    c->place.ray = e->number;
    c->place.sample = e->sample;
    return differ(c);
  }
  return sf_ok();
}

/* Counts the whole chunk, even one with a difference, so that `samples` and the counts belong together. */
static sf_status add_chunk(sf_cosim *c, fx_counts *actual)
{
  uint64_t cycles, busy, stalls;
  SF_TRY(sf_dut_counts(c->dut, actual, &cycles, &busy, &stalls));
  c->sum.samples += (uint64_t)c->n;
  for (int i = 0; i < c->n; i++) add_spikes(c, &c->chunk[i]);
  fx_counts_add(&c->sum.core, &c->expected);
  fx_counts_add(&c->sum.rtl, actual);
  c->sum.cycles += cycles;
  c->sum.busy += busy;
  for (int l = 0; l < SF_LAYERS; l++) c->sum.layer_busy[l] += sf_dut_layer_busy(c->dut)[l];
  c->sum.stalls += stalls;
  return sf_ok();
}

static sf_status compare_counts(sf_cosim *c, const fx_counts *actual)
{
  sf_difference difference;
  if (!sf_compare_counts(&c->expected, actual, sf_dut_cycle(c->dut), &difference)) {
    SF_TRY(count_difference(c, &difference));
    return differ(c);
  }
  return sf_dut_clear_counts(c->dut);
}

/* Compares what came before the sample without a result first, because the difference may be there. */
static sf_status stuck(sf_cosim *c, const sf_status *ran)
{
  const int received = sf_dut_received(c->dut), n = c->n;
  c->n = received < n ? received : n;
  const sf_status earlier = compare_samples(c);
  c->n = n;
  SF_TRY(earlier);
  const entry *e = &c->chunk[received < n ? received : n - 1];
  c->place = (sf_cosim_place){true, e->number, e->sample, received < n, {-1, -1, -1, NULL, 0, 0, sf_dut_cycle(c->dut)}};
  return *ran;
}

static sf_status flush(sf_cosim *c)
{
  for (int i = 0; i < c->n; i++)
    c->input[i] = (sf_dut_sample){.ray = &c->chunk[i].ray, .first = c->chunk[i].first, .f = c->chunk[i].f};
  if (c->n == 0) return sf_ok();
  sf_status ran = sf_dut_run_traced(c->dut, c->input, c->n, c->result, c->trace);
  if (ran.code == SF_OK) ran = sf_dut_quiet(c->dut);
  if (ran.code != SF_OK) return stuck(c, &ran);
  fx_counts actual;
  const sf_status equal = compare_samples(c), counted = add_chunk(c, &actual);
  SF_TRY(equal);
  SF_TRY(counted);
  SF_TRY(compare_counts(c, &actual));
  memset(&c->expected, 0, sizeof c->expected);
  c->n = 0;
  return sf_ok();
}

/* fx_net_fn: gives the core's answer at once. The accelerator's comes with the rest of the chunk. */
static sf_status evaluate(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  sf_cosim *c = user;
  entry *e = &c->chunk[c->n++];
  e->ray = *ray;
  e->number = c->number;
  e->sample = c->sample++;
  e->first = first;
  memset(e->f, 0, sizeof e->f);
  memcpy(e->f, f, (size_t)fx_net_inputs(&c->scene->net) * sizeof *f);
  fx_net_next(&c->scene->net, ray->dir, first, e->f, c->base, &e->out, &e->trace, &c->expected);
  *out = e->out;
  return c->n == CHUNK ? flush(c) : sf_ok();
}

sf_status sf_cosim_ray(sf_cosim *c, uint64_t number, const fx_ray *ray)
{
  fx_pixel pixel;
  fx_counts march = {0}; /* the accelerator neither marches nor reads the grid */
  c->number = number;
  c->sample = 0;
  SF_TRY(fx_render_ray(c->scene, ray, evaluate, c, &pixel, &march));
  c->sum.core.rays += march.rays; /* of a decoder; else the nets count them */
  return sf_ok();
}

sf_status sf_cosim_finish(sf_cosim *c)
{
  return flush(c);
}

const sf_cosim_totals *sf_cosim_sum(const sf_cosim *c)
{
  return &c->sum;
}
const sf_cosim_place *sf_cosim_where(const sf_cosim *c)
{
  return &c->place;
}

void sf_cosim_totals_add(sf_cosim_totals *sum, const sf_cosim_totals *more)
{
  fx_counts_add(&sum->core, &more->core);
  fx_counts_add(&sum->rtl, &more->rtl);
  sum->samples += more->samples;
  sum->spikes += more->spikes;
  sum->cycles += more->cycles;
  sum->busy += more->busy;
  for (int l = 0; l < SF_LAYERS; l++) sum->layer_busy[l] += more->layer_busy[l];
  sum->stalls += more->stalls;
}

void sf_cosim_replay(const sf_cosim *c, sf_replay *replay)
{
  *replay = (sf_replay){.seed = c->options.seed, .stall_percent = c->options.stall_percent};
  snprintf(replay->plusarg, sizeof replay->plusarg, "%s", c->options.plusarg ? c->options.plusarg : "");
  for (int i = 0; i < c->n; i++) {
    const entry *e = &c->chunk[i];
    sf_replay_sample *s = &replay->sample[replay->count++];
    *s = (sf_replay_sample){.ray = e->number, .sample = e->sample, .first = e->first};
    memcpy(s->dir, e->ray.dir, sizeof s->dir);
    memcpy(s->f, e->f, sizeof s->f);
    if (c->place.exact && e->number == c->place.ray && e->sample == c->place.sample) return;
  }
}

void sf_cosim_close(sf_cosim *c)
{
  if (!c) return;
  sf_dut_close(c->dut);
  free(c);
}
