#include "sim/activity/activity.h"
#include "sim/activity/saif.h"
#include "sim/sim.h"
#include "sim/wave_file.h"
#include "energy/energy.h"
#include "cli/cli.h"
#include "base/io.h"
#include "base/text.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PIECE = 16384, TICK = 1024, PS_PER_US = 1000000 }; /* cycles of one waveform file; between two ticks */

typedef struct stream {
  sf_dut_sample *sample;
  int16_t (*f)[SF_DIR_MAX]; /* [fx_net_inputs] */
  fx_ray *ray;              /* per sample */
  int count, room;
} stream;

typedef struct activity {
  sf_lockstep *lockstep;
  const sf_activity_options *options;
  sf_activity_report *report;
  stream in;
  sf_dut *dut;
  sf_wave wave;
  sf_vcd vcd;
  sf_writer saif_file, vcd_file;
  char path[4096 + 16]; /* of the piece */
  uint64_t begun;       /* the stream's first cycle */
  uint64_t piece;       /* first cycle of the piece at work */
  bool dumping, opened, over;
  sf_status status; /* of the pieces read so far */
} activity;

/* ---- the samples of the rays ---- */

static bool make_room(stream *in)
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

typedef struct collector {
  stream *in;
  const fx_net *net;
  int32_t base[SF_LANES];
} collector;

/* fx_net_fn */
static sf_status collect(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  collector *c = user;
  stream *in = c->in;
  if (in->count == in->room && !make_room(in)) return sf_fail(SF_E_MEMORY, "activity: no memory for the samples");
  fx_net_next(c->net, ray->dir, first, f, c->base, out, NULL, NULL);
  memset(in->f[in->count], 0, sizeof in->f[0]);
  memcpy(in->f[in->count], f, (size_t)fx_net_inputs(c->net) * sizeof *f);
  in->ray[in->count] = *ray;
  in->sample[in->count++].first = first;
  return sf_ok();
}

static sf_status collect_rays(activity *a)
{
  const sf_lockstep *l = a->lockstep;
  collector c = {.in = &a->in, .net = &l->fx.net};
  for (int i = 0; i < l->options.rays; i++) {
    const sf_lockstep_pixel p = sf_lockstep_pick(l, (uint64_t)i);
    fx_ray ray;
    fx_pixel pixel;
    fx_counts march = {0};
    if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "stopped: no file is written");
    SF_TRY(sf_pixel_ray(&l->fx, &l->data, &l->data.view[p.view], p.x, p.y, &ray));
    SF_TRY(fx_render_ray(&l->fx, &ray, collect, &c, &pixel, &march));
  }
  for (int i = 0; i < a->in.count; i++) a->in.sample[i].ray = &a->in.ray[i], a->in.sample[i].f = a->in.f[i];
  a->report->rays = (uint64_t)l->options.rays;
  return a->in.count ? sf_ok()
                     : sf_fail(SF_E_FORMAT, "%s: none of %d ray%s has a sample: nothing to stream", l->data.path,
                               l->options.rays, sf_plural((uint64_t)l->options.rays));
}

/* ---- the waveform, a piece at a time ---- */

static uint64_t half_period(const activity *a)
{
  return (uint64_t)((double)PS_PER_US / (2 * a->options->clock_mhz) + 0.5);
}

static sf_status open_wave(activity *a)
{
  SF_TRY(sf_wave_open(&a->wave, a->path, 2 * a->piece));
  a->opened = true;
  if (!a->options->vcd) return sf_ok();
  return sf_vcd_open(&a->vcd, a->vcd_file.file, &a->wave, a->options->depth, half_period(a));
}

static void end_piece(activity *a, uint64_t cycle)
{
  sf_pins_dump_end(a->dut->pins);
  a->dumping = false;
  if (a->status.code == SF_OK) a->status = sf_wave_file_check(a->path);
  if (a->status.code == SF_OK && !a->opened) a->status = open_wave(a);
  if (a->status.code == SF_OK) a->status = sf_wave_add(&a->wave, a->path, 2 * cycle);
  if (a->status.code == SF_OK && a->options->vcd && ferror(a->vcd_file.file))
    a->status = sf_writer_commit(&a->vcd_file); /* says why */
}

static void begin_piece(activity *a, uint64_t cycle)
{
  a->piece = cycle;
  a->dumping = true;
  sf_pins_dump(a->dut->pins);
}

static void show(activity *a)
{
  sf_lockstep *l = a->lockstep;
  l->sum.samples = (uint64_t)a->dut->received;
  l->rays = l->sum.samples * (uint64_t)l->options.rays / (uint64_t)a->in.count;
  if (l->tick) l->tick(l->user, l);
}

/* Before clock cycle number `cycle` of the stream. */
static void before_cycle(activity *a, uint64_t cycle)
{
  const sf_activity_options *o = a->options;
  const uint64_t now = a->begun + cycle;
  if (a->over) return;
  a->over = a->status.code != SF_OK || sf_cli_interrupted() || (cycle > 0 && cycle - 1 == o->last);
  if (a->dumping && (a->over || now - a->piece == PIECE)) end_piece(a, now);
  if (!a->over && !a->dumping && cycle >= o->first) begin_piece(a, now);
  if (cycle % TICK == 0) show(a);
}

static void each_cycle(void *user)
{
  activity *a = user;
  before_cycle(a, a->dut->cycle - a->begun);
}

/* ---- the run ---- */

static sf_status compare(const activity *a, const sf_dut_result *result)
{
  const fx_net *net = &a->lockstep->fx.net;
  fx_counts expected = {0}, actual;
  int32_t base[SF_LANES];
  char text[200];
  sf_difference d;
  for (int i = 0; i < a->in.count; i++) {
    fx_trace trace;
    fx_out out;
    fx_net_next(net, a->in.ray[i].dir, a->in.sample[i].first, a->in.f[i], base, &out, &trace, &expected);
    if (sf_compare_sample(net, &trace, &out, &result[i], NULL, &d)) continue;
    sf_difference_text(&d, text);
    return sf_fail(SF_E_DIFFERENCE, "sample %d of the stream: %s", i, text);
  }
  SF_TRY(sf_dut_counts(a->dut, &actual, NULL, NULL, NULL));
  if (sf_compare_counts(&expected, &actual, sf_dut_cycle(a->dut), &d)) return sf_ok();
  sf_difference_text(&d, text);
  return sf_fail(SF_E_DIFFERENCE, "stream of %d sample%s: %s", a->in.count, sf_plural((uint64_t)a->in.count), text);
}

static sf_status stream_samples(activity *a, sf_dut_result *result)
{
  a->begun = sf_dut_cycle(a->dut);
  a->dut->each_cycle = each_cycle;
  a->dut->each_cycle_context = a;
  before_cycle(a, 0);
  const sf_status ran = sf_dut_run(a->dut, a->in.sample, a->in.count, result);
  a->dut->each_cycle = NULL;
  if (a->dumping) end_piece(a, sf_dut_cycle(a->dut));
  SF_TRY(ran);
  SF_TRY(a->status);
  if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "stopped: no file is written");
  if (!a->opened)
    return sf_fail(SF_E_USAGE, "--window begins at cycle %" PRIu64 ", but the stream has %" PRIu64, a->options->first,
                   sf_dut_cycle(a->dut) - a->begun);
  a->report->samples = (uint64_t)a->in.count;
  return compare(a, result);
}

static sf_status simulate(activity *a)
{
  const sf_lockstep_options *o = &a->lockstep->options;
  const sf_dut_options how = {.seed = o->seed,
                              .stall_percent = o->stall_percent,
                              .wave = a->path,
                              .wave_from = -1, /* the pieces begin it */
                              .plusarg = o->plusarg};
  sf_dut_result *result = malloc((size_t)a->in.count * sizeof *result);
  if (!result) return sf_fail(SF_E_MEMORY, "activity: no memory for %d results", a->in.count);
  sf_status status = sf_dut_open(&a->dut, &a->lockstep->fx, &how);
  if (status.code == SF_OK) status = stream_samples(a, result);
  free(result);
  return status;
}

/* ---- files ---- */

static void sum_up(const activity *a)
{
  const sf_wave *w = &a->wave;
  sf_activity_report *r = a->report;
  r->cycles = (w->end - w->begin) / 2;
  r->bits = w->bits;
  for (size_t i = 0; i < w->bits; i++) r->toggles += w->bit[i].toggles, r->quiet += w->bit[i].toggles == 0;
  for (int n = 0; n < w->nets; n++)
    if (w->instance[w->net[n].instance].level == 1 && !strcmp(w->net[n].name, "clk_i"))
      r->clock_toggles = sf_wave_net_bit(w, &w->net[n], 0)->toggles;
}

static sf_status write_files(activity *a)
{
  const sf_activity_options *o = a->options;
  SF_TRY(collect_rays(a));
  SF_TRY(simulate(a));
  sum_up(a);
  if (o->vcd) {
    sf_vcd_close(&a->vcd);
    SF_TRY(sf_writer_commit(&a->vcd_file));
  }
  if (!o->saif) return sf_ok();
  sf_saif_write(a->saif_file.file, &a->wave, o->depth, half_period(a));
  return sf_writer_commit(&a->saif_file);
}

static sf_status open_files(activity *a)
{
  if (a->options->saif) SF_TRY(sf_writer_open(&a->saif_file, a->options->saif));
  if (a->options->vcd) SF_TRY(sf_writer_open(&a->vcd_file, a->options->vcd));
  return sf_ok();
}

sf_status sf_activity_run(sf_lockstep *lockstep, const sf_activity_options *options, sf_activity_report *report)
{
  activity a = {.lockstep = lockstep, .options = options, .report = report, .status = sf_ok()};
  memset(report, 0, sizeof *report);
  snprintf(a.path, sizeof a.path, "%s.piece.fst", options->saif ? options->saif : options->vcd);
  sf_status status = open_files(&a);
  sf_wave_file_guard(a.path, (const char *[]){a.saif_file.aside, a.vcd_file.aside});
  if (status.code == SF_OK) status = write_files(&a);
  if (options->saif) sf_writer_abort(&a.saif_file);
  if (options->vcd) sf_writer_abort(&a.vcd_file);
  sf_dut_close(a.dut);
  sf_wave_file_guard(NULL, NULL);
  unlink(a.path);
  sf_wave_free(&a.wave);
  free(a.vcd.shown);
  free(a.in.sample), free(a.in.f), free(a.in.ray);
  return status;
}

sf_status sf_activity_window(const char *text, sf_activity_options *o)
{
  char rest;
  if (text[0] != '-' && sscanf(text, "%" SCNu64 ",%" SCNu64 "%c", &o->first, &o->last, &rest) == 2 &&
      o->first <= o->last)
    return sf_ok();
  return sf_fail(SF_E_USAGE, "--window %s: expected FIRST,LAST: two cycles of the stream, the first not after the last",
                 text);
}
