#include "sim/replay.h"
#include "sim/wave_file.h"
#include <stdlib.h>
#include <string.h>

typedef struct play {
  const sf_replay *replay;
  const fx_net *net;
  fx_ray ray[SF_REPLAY_MAX];
  sf_dut_sample input[SF_REPLAY_MAX];
  sf_dut_result result[SF_REPLAY_MAX];
  sf_dut_trace trace[SF_REPLAY_MAX];
} play;

static void prepare(play *p)
{
  for (int i = 0; i < p->replay->count; i++) {
    const sf_replay_sample *s = &p->replay->sample[i];
    memcpy(p->ray[i].dir, s->dir, sizeof s->dir);
    p->input[i] = (sf_dut_sample){.ray = &p->ray[i], .first = s->first || i == 0, .f = s->f};
  }
}

static bool compare_samples(const play *p, fx_counts *expected, sf_replayed *replayed)
{
  int32_t base[SF_LANES];
  fx_trace trace;
  fx_out out;
  for (int i = 0; i < p->replay->count; i++) {
    fx_net_next(p->net, p->ray[i].dir, p->input[i].first, p->input[i].f, base, &out, &trace, expected);
    replayed->at = i;
    if (!sf_compare_sample(p->net, &trace, &out, &p->result[i], &p->trace[i], &replayed->what)) return false;
  }
  return true;
}

static sf_status compare(play *p, sf_dut *dut, sf_replayed *replayed)
{
  fx_counts expected = {0}, actual;
  sf_status status = sf_dut_run_traced(dut, p->input, p->replay->count, p->result, p->trace);
  if (status.code == SF_OK) status = sf_dut_quiet(dut);
  if (status.code == SF_E_DIFFERENCE) {
    replayed->differs = true;
    replayed->at = sf_dut_received(dut) < p->replay->count ? sf_dut_received(dut) : p->replay->count - 1;
    memcpy(replayed->message, status.message, sizeof replayed->message);
    return sf_ok();
  }
  SF_TRY(status);
  replayed->differs = !compare_samples(p, &expected, replayed);
  if (replayed->differs) return sf_ok();
  SF_TRY(sf_dut_counts(dut, &actual, NULL, NULL, NULL));
  replayed->differs = !sf_compare_counts(&expected, &actual, sf_dut_cycle(dut), &replayed->what);
  return sf_ok();
}

sf_status sf_replay_run(const sf_replay *replay, const fx_net *net, const char *wave, sf_replayed *replayed)
{
  const fx_scene scene = {.net = *net};
  const sf_dut_options options = {.seed = replay->seed,
                                  .stall_percent = replay->stall_percent,
                                  .wave = wave,
                                  .wave_from = replay->count > 2 ? replay->count - 2 : 0,
                                  .plusarg = replay->plusarg[0] ? replay->plusarg : NULL};
  sf_dut *dut;
  memset(replayed, 0, sizeof *replayed);
  play *p = calloc(1, sizeof *p);
  if (!p) return sf_fail(SF_E_MEMORY, "replay: out of memory");
  p->replay = replay;
  p->net = net;
  prepare(p);
  if (wave) sf_wave_file_guard(wave, NULL);
  sf_status status = sf_dut_open(&dut, &scene, &options);
  if (status.code == SF_OK) {
    status = compare(p, dut, replayed);
    sf_dut_close(dut);
    if (wave && status.code == SF_OK) status = sf_wave_file_check(wave);
  }
  if (wave) sf_wave_file_guard(NULL, NULL);
  free(p);
  return status;
}

sf_status sf_replay_shrink(sf_replay *replay, const fx_net *net, bool *differs)
{
  sf_replayed replayed;
  for (int count = 2;; count *= 2) {
    sf_replay part = *replay;
    part.count = count < replay->count ? count : replay->count;
    memcpy(part.sample, replay->sample + replay->count - part.count, (size_t)part.count * sizeof *part.sample);
    part.sample[0].first = true;
    SF_TRY(sf_replay_run(&part, net, NULL, &replayed));
    *differs = replayed.differs;
    if (!replayed.differs && part.count < replay->count) continue;
    *replay = part;
    return sf_ok();
  }
}
