#include "sim/activity/activity.h"
#include "sim/activity/flow.h"
#include "sim/activity/saif.h"
#include "sim/wave_file.h"
#include "cli/cli.h"
#include "base/io.h"
#include "base/text.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PIECE = 16384, TICK = 1024, PS_PER_US = 1000000 }; /* cycles of one waveform file; between two ticks */

typedef struct activity {
  sf_lockstep *lockstep;
  const sf_activity_options *options;
  sf_activity_report *report;
  sf_flow *flow;
  sf_wave wave;
  sf_vcd vcd;
  sf_writer saif_file, vcd_file;
  char path[4096 + 16]; /* of the piece */
  uint64_t begun;       /* the stream's first cycle */
  uint64_t piece;       /* first cycle of the piece at work */
  bool dumping, opened, over;
  sf_status status;              /* of the pieces read so far */
  void (*around)(void *context); /* what the flow does in each cycle, such as its memory; or NULL */
  void *around_context;
} activity;

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
  sf_pins_dump_end(a->flow->dut->pins);
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
  sf_pins_dump(a->flow->dut->pins);
}

static void show(activity *a)
{
  sf_lockstep *l = a->lockstep;
  const sf_flow *f = a->flow;
  const uint64_t received = (uint64_t)f->dut->received;
  l->rays = received * f->rays / f->items;
  l->sum.samples = received * f->samples / f->items;
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
  if (a->around) a->around(a->around_context);
  before_cycle(a, a->flow->dut->cycle - a->begun);
}

/* ---- the run ---- */

static sf_status run_flow(activity *a)
{
  sf_flow *f = a->flow;
  sf_dut *dut = f->dut;
  a->begun = sf_dut_cycle(dut);
  a->around = dut->each_cycle, a->around_context = dut->each_cycle_context;
  dut->each_cycle = each_cycle, dut->each_cycle_context = a;
  dut->received = 0;
  before_cycle(a, 0);
  const sf_status ran = f->run(f);
  dut->each_cycle = a->around, dut->each_cycle_context = a->around_context;
  if (a->dumping) end_piece(a, sf_dut_cycle(dut));
  SF_TRY(ran);
  SF_TRY(a->status);
  if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "stopped: no file is written");
  if (!a->opened)
    return sf_fail(SF_E_USAGE, "--window begins at cycle %" PRIu64 ", but the stream has %" PRIu64, a->options->first,
                   sf_dut_cycle(dut) - a->begun);
  a->report->rays = f->rays, a->report->samples = f->samples;
  SF_TRY(f->compare(f));
  a->report->lookups = f->lookups, a->report->misses = f->misses;
  return sf_ok();
}

static sf_status simulate(activity *a)
{
  const sf_lockstep_options *o = &a->lockstep->options;
  const sf_dut_options how = {.seed = o->seed,
                              .stall_percent = o->stall_percent,
                              .wave = a->path,
                              .wave_from = -1, /* the pieces begin it */
                              .plusarg = o->plusarg};
  SF_TRY((a->options->block == SF_ACTIVITY_RAYS ? sf_flow_rays : sf_flow_samples)(&a->flow, a->lockstep, &how));
  return run_flow(a);
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
  if (a.flow) a.flow->close(a.flow);
  sf_wave_file_guard(NULL, NULL);
  unlink(a.path);
  sf_wave_free(&a.wave);
  free(a.vcd.shown);
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

/* ---- report ---- */

cJSON *sf_activity_json(const sf_activity_options *o, const sf_activity_report *r)
{
  cJSON *json = cJSON_CreateObject();
  if (o->saif) sf_json_add_text(json, "saif", o->saif);
  if (o->vcd) sf_json_add_text(json, "vcd", o->vcd);
  cJSON_AddStringToObject(json, "block", o->block == SF_ACTIVITY_RAYS ? "sf_ray_top" : "sf_top");
  sf_json_add_u64(json, "rays", r->rays);
  sf_json_add_u64(json, "samples", r->samples);
  sf_json_add_u64(json, "differences", 0);
  if (o->block == SF_ACTIVITY_RAYS) {
    sf_json_add_u64(json, "lookups", r->lookups);
    sf_json_add_u64(json, "misses", r->misses);
  }
  sf_json_add_u64(json, "cycles", r->cycles);
  sf_json_add_u64(json, "bits", r->bits);
  sf_json_add_u64(json, "quiet_bits", r->quiet);
  sf_json_add_u64(json, "toggles", r->toggles);
  sf_json_add_u64(json, "clock_toggles", r->clock_toggles);
  cJSON_AddNumberToObject(json, "clock_mhz", o->clock_mhz);
  return json;
}

void sf_activity_print(FILE *out, const sf_activity_options *o, const sf_activity_report *r)
{
  fprintf(out, "%" PRIu64 " ray%s, %" PRIu64 " sample%s: 0 differences\n", r->rays, sf_plural(r->rays), r->samples,
          sf_plural(r->samples));
  if (o->block == SF_ACTIVITY_RAYS)
    fprintf(out, "%" PRIu64 " look-ups of the field, %" PRIu64 " lines from memory\n", r->lookups, r->misses);
  fprintf(out,
          "%" PRIu64 " cycles, %" PRIu64 " bits of nets, %" PRIu64 " of them never toggle; %.1f toggles per cycle\n",
          r->cycles, r->bits, r->quiet, r->cycles ? (double)r->toggles / (double)r->cycles : 0);
  for (int i = 0; i < 2; i++) {
    const char *path = i ? o->vcd : o->saif;
    if (path) fprintf(out, "%s: at %g MHz\n", path, o->clock_mhz);
  }
}
