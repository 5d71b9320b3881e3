#include "sim/lockstep.h"
#include "base/sha256.h"
#include "energy/energy.h"
#include "cli/cli.h"
#include "base/clock.h"
#include "base/io.h"
#include "quant/quant.h"
#include "base/rng.h"
#include "base/text.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { STREAM_BLOCK = SF_LOCKSTEP_STREAM, SAVE_SECONDS = 1 };

typedef struct block {
  uint64_t rays; /* finished */
  sf_cosim_totals sum;
  sf_status status;
  sf_cosim_place place;
  char wire[sizeof((sf_lockstep *)0)->wire]; /* of place, which points to it where it is read */
  sf_replay replay;
} block;

typedef struct checkpoint {
  char identity[65];
  int of;                       /* rays of the run that wrote it */
  sf_lockstep_state now, whole; /* now: for a run of as many rays */
  char seal[65];                /* hash of what stands before it */
} checkpoint;

/* ---- one block, wherever it is dealt to ---- */

static sf_status run_ray(const sf_lockstep *l, sf_cosim *cosim, uint64_t number)
{
  const sf_lockstep_pixel p = sf_lockstep_pick(l, number);
  fx_ray ray;
  SF_TRY(sf_pixel_ray(&l->fx, &l->data, &l->data.view[p.view], p.x, p.y, &ray));
  return sf_cosim_ray(cosim, number, &ray);
}

static sf_status run_rays(const sf_lockstep *l, sf_cosim *cosim, uint64_t unit, block *b)
{
  const uint64_t from = unit * (uint64_t)l->options.block, all = (uint64_t)l->options.rays;
  const uint64_t end = from + (uint64_t)l->options.block < all ? from + (uint64_t)l->options.block : all;
  bool stopped = false;
  for (uint64_t ray = from; ray < end && !stopped; ray++) {
    SF_TRY(run_ray(l, cosim, ray));
    b->rays++;
    stopped = sf_ranks_stop(l->ranks);
  }
  SF_TRY(sf_cosim_finish(cosim));
  return stopped ? sf_fail(SF_E_STOPPED, "stopped") : sf_ok();
}

static void run_block(void *user, uint64_t unit, void *result)
{
  const sf_lockstep *l = user;
  block *b = result;
  const sf_dut_options options = {.seed = sf_random_u64(l->options.seed, STREAM_BLOCK, unit),
                                  .stall_percent = l->options.stall_percent,
                                  .plusarg = l->options.plusarg};
  sf_cosim *cosim;
  b->status = sf_ranks_named(l->ranks, sf_cosim_open(&cosim, &l->fx, &options));
  if (b->status.code != SF_OK) return;
  b->status = run_rays(l, cosim, unit, b);
  b->sum = *sf_cosim_sum(cosim);
  b->place = *sf_cosim_where(cosim);
  if (b->place.found) sf_cosim_replay(cosim, &b->replay);
  if (b->place.what.wire) snprintf(b->wire, sizeof b->wire, "%s", b->place.what.wire);
  b->place.what.wire = NULL;
  sf_cosim_close(cosim);
}

/* ---- checkpoints ---- */

/* A checkpoint is what this very program holds in memory, so the program is part of the identity. */
static sf_status identify(sf_lockstep *l)
{
  const sf_lockstep_options *o = &l->options;
  char text[2048], program[65], scene[65];
  SF_TRY(sf_sha256_file("/proc/self/exe", program));
  SF_TRY(sf_sha256_file(o->scene, scene));
  int n = snprintf(text, sizeof text, "%s %s %s %" PRIu64 " %d %d %s", program, scene, o->split, o->seed, o->block,
                   o->stall_percent, o->plusarg ? o->plusarg : "");
  char cameras[65];
  sf_camera *camera = calloc((size_t)l->data.count, sizeof *camera);
  if (!camera) return sf_fail(SF_E_MEMORY, "%s: out of memory", o->data);
  for (int i = 0; i < l->data.count; i++) camera[i] = l->data.view[i].camera;
  sf_sha256(camera, (size_t)l->data.count * sizeof *camera, cameras);
  free(camera);
  n += snprintf(text + n, sizeof text - (size_t)n, " %s", cameras);
  sf_sha256(text, (size_t)n, l->identity);
  return sf_ok();
}

static sf_status save(sf_lockstep *l)
{
  if (!l->options.checkpoint) return sf_ok();
  checkpoint c;
  memset(&c, 0, sizeof c);
  memcpy(c.identity, l->identity, sizeof c.identity);
  c.of = l->options.rays;
  c.now = (sf_lockstep_state){l->blocks, l->rays, l->sum};
  c.whole = l->whole;
  sf_sha256(&c, offsetof(checkpoint, seal), c.seal);
  l->saved = sf_seconds();
  SF_TRY(sf_write_file(l->options.checkpoint, &c, sizeof c));
  l->kept = c.now.rays;
  return sf_ok();
}

static sf_status resume(sf_lockstep *l)
{
  const char *path = l->options.checkpoint;
  checkpoint c;
  char *data;
  size_t size;
  if (!path || access(path, F_OK)) return sf_ok();
  SF_TRY(sf_read_file(path, sizeof c, &data, &size));
  const bool ours = size == sizeof c && !memcmp(data, l->identity, sizeof l->identity);
  if (ours) memcpy(&c, data, sizeof c);
  free(data);
  if (!ours)
    return sf_fail(SF_E_FORMAT, "%s: this checkpoint is of another program, scene or data set, or of other options",
                   path);
  char seal[65];
  sf_sha256(&c, offsetof(checkpoint, seal), seal);
  if (memcmp(seal, c.seal, sizeof seal)) return sf_fail(SF_E_FORMAT, "%s: this checkpoint is damaged", path);
  const sf_lockstep_state *from = c.of == l->options.rays ? &c.now : &c.whole;
  if (from->rays > (uint64_t)l->options.rays)
    return sf_fail(SF_E_USAGE, "%s: %" PRIu64 " rays are finished, more than --rays %d; give as many or more", path,
                   from->rays, l->options.rays);
  l->whole = c.whole;
  l->blocks = from->blocks, l->rays = from->rays, l->sum = from->sum;
  l->resumed = from->sum.samples, l->kept = from->rays;
  return sf_ok();
}

/* ---- all blocks ---- */

static bool enough(const sf_lockstep *l)
{
  return l->options.limit && l->sum.samples >= l->options.limit;
}

static bool take_block(void *user, uint64_t unit, const void *result)
{
  sf_lockstep *l = user;
  const block *b = result;
  (void)unit;
  if (b->status.code == SF_E_STOPPED && !l->partial) {
    l->trouble = save(l);
    l->partial = true;
  }
  l->rays += b->rays;
  sf_cosim_totals_add(&l->sum, &b->sum);
  if (b->status.code == SF_E_STOPPED) return sf_ranks_stop(l->ranks); /* else this process alone was stopped */
  if (b->status.code != SF_OK) l->trouble = b->status;
  l->place = b->place;
  memcpy(l->wire, b->wire, sizeof l->wire);
  if (l->wire[0]) l->place.what.wire = l->wire;
  l->replay = b->replay;
  if (b->status.code != SF_OK) return false;
  l->blocks++;
  if (!l->partial && l->rays % (uint64_t)l->options.block == 0)
    l->whole = (sf_lockstep_state){l->blocks, l->rays, l->sum};
  if (sf_seconds() - l->saved > SAVE_SECONDS && !l->partial && l->trouble.code == SF_OK) l->trouble = save(l);
  return l->trouble.code == SF_OK && !enough(l);
}

/* A launcher may not leave time to wait for the blocks at work, so what is finished is kept at once. */
static void tick(void *user)
{
  sf_lockstep *l = user;
  if (!l->stopping && !l->partial && l->trouble.code == SF_OK && sf_ranks_stop(l->ranks)) {
    l->stopping = true;
    l->trouble = save(l);
  }
  if (l->tick) l->tick(l->user, l);
}

static sf_status run_blocks(sf_lockstep *l)
{
  const uint64_t per = (uint64_t)l->options.block, begun = l->blocks;
  const sf_deal deal = {.first = begun,
                        .end = enough(l) ? begun : ((uint64_t)l->options.rays + per - 1) / per,
                        .result_size = sizeof(block),
                        .work = run_block,
                        .take = take_block,
                        .tick = tick,
                        .user = l};
  l->saved = sf_seconds();
  const sf_status status = sf_ranks_deal(l->ranks, &deal);
  if (sf_ranks_rank(l->ranks) || begun >= deal.end) return status;
  SF_TRY(l->trouble);
  if (!l->partial) SF_TRY(save(l));
  return l->partial && status.code == SF_OK ? sf_fail(SF_E_STOPPED, "stopped") : status;
}

sf_status sf_lockstep_energy(sf_lockstep *l)
{
  l->energy_core_fj = sf_energy_fj(&l->sum.core);
  l->energy_rtl_fj = sf_energy_fj(&l->sum.rtl);
  if (l->energy_core_fj == l->energy_rtl_fj) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "energy of equal counts: expected %" PRIu64 " fJ, actual %" PRIu64 " fJ",
                 l->energy_core_fj, l->energy_rtl_fj);
}

/* ---- evidence ---- */

/* An earlier difference keeps its files: PREFIX, PREFIX-2, PREFIX-3... The file that reserves the name becomes the
 * replay file. */
static sf_status reserve(sf_lockstep *l, char path[4096])
{
  for (int n = 1; n < 10000; n++) {
    char number[16] = "";
    if (n > 1) snprintf(number, sizeof number, "-%d", n);
    if (snprintf(l->evidence, sizeof l->evidence, "%s%s", l->options.evidence, number) >= (int)sizeof l->evidence)
      break;
    snprintf(path, 4096, "%s.fst", l->evidence);
    if (!access(path, F_OK)) continue;
    snprintf(path, 4096, "%s.json", l->evidence);
    const int file = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file >= 0) return close(file), sf_ok();
    if (errno != EEXIST) return sf_fail(SF_E_IO, "cannot write %s: %s", path, strerror(errno));
  }
  return sf_fail(SF_E_IO, "%.100s: every name for the evidence is taken; remove old files or give another --evidence",
                 l->options.evidence);
}

/* The place of the difference, and what differs in the replay, as JSON. */
static void add_place(const sf_lockstep *l, const sf_replayed *replayed, cJSON *json)
{
  const sf_lockstep_pixel p = sf_lockstep_pick(l, l->place.ray);
  const sf_difference *d = &replayed->what;
  char *data = realpath(l->data.path, NULL);
  sf_json_add_text(json, "data", data ? data : l->data.path);
  free(data);
  sf_json_add_text(json, "split", l->options.split);
  cJSON_AddNumberToObject(json, "view", p.view);
  cJSON_AddNumberToObject(json, "x", p.x), cJSON_AddNumberToObject(json, "y", p.y);
  if (!replayed->differs || !d->wire) return;
  cJSON_AddNumberToObject(json, "at", replayed->at);
  cJSON_AddNumberToObject(json, "layer", d->layer), cJSON_AddNumberToObject(json, "step", d->step);
  cJSON_AddNumberToObject(json, "neuron", d->neuron);
  cJSON_AddStringToObject(json, "wire", d->wire);
  cJSON_AddNumberToObject(json, "expected", (double)d->expected);
  cJSON_AddNumberToObject(json, "actual", (double)d->actual);
  sf_json_add_u64(json, "cycle", d->cycle);
}

static sf_status write_replay(sf_lockstep *l, const sf_status *status)
{
  char path[4096];
  sf_replayed replayed;
  SF_TRY(sf_replay_shrink(&l->replay, &l->fx.net, &l->replays));
  snprintf(path, sizeof path, "%s.fst", l->evidence);
  SF_TRY(sf_replay_run(&l->replay, &l->fx.net, path, &replayed));
  cJSON *json = cJSON_CreateObject();
  char text[200] = "";
  if (replayed.what.wire) sf_difference_text(&replayed.what, text);
  sf_json_add_text(json, "in_the_run", status->message);
  sf_json_add_text(json, "in_the_replay", !replayed.differs ? "none" : text[0] ? text : replayed.message);
  sf_json_add_text(json, "wave", path);
  add_place(l, &replayed, json);
  snprintf(path, sizeof path, "%s.json", l->evidence);
  return sf_replay_save(&l->replay, l->options.scene, json, path);
}

static sf_status write_evidence(sf_lockstep *l, const sf_status *difference)
{
  char reserved[4096];
  sf_status status = reserve(l, reserved);
  if (status.code == SF_OK) {
    status = write_replay(l, difference);
    if (status.code != SF_OK) {
      unlink(reserved);
      snprintf(reserved, sizeof reserved, "%s.fst", l->evidence);
      unlink(reserved);
    }
  }
  if (status.code != SF_OK) l->evidence[0] = 0;
  return status;
}

/* `by` begins with "stopped", too, and may name a rank that is lost. */
static sf_status stopped(const sf_lockstep *l, const sf_status *by)
{
  char kept[4200] = "";
  if (l->options.checkpoint)
    snprintf(kept, sizeof kept, "; %s holds %" PRIu64 " ray%s, the same command goes on from there",
             l->options.checkpoint, l->kept, sf_plural(l->kept));
  return sf_fail(SF_E_STOPPED, "stopped after %" PRIu64 " of %d ray%s, %" PRIu64 " sample%s equal%s%s", l->rays,
                 l->options.rays, sf_plural((uint64_t)l->options.rays), l->sum.samples, sf_plural(l->sum.samples),
                 by->message + strlen("stopped"), kept);
}

/* A difference is reported even if its evidence cannot be written. */
static sf_status difference(sf_lockstep *l, const sf_status *found)
{
  const sf_status status = sf_lockstep_difference(l, found);
  l->unwritten = write_evidence(l, &status);
  if (l->unwritten.code == SF_OK) return status;
  return sf_fail(status.code, "%.*s; no evidence: %s", (int)sizeof status.message / 2, status.message,
                 l->unwritten.message);
}

sf_status sf_lockstep_run(sf_lockstep *l)
{
  const bool first = sf_ranks_rank(l->ranks) == 0;
  SF_TRY(sf_ranks_same(l->ranks, "scene or data set", l->identity));
  SF_TRY(sf_ranks_agree(l->ranks, first ? resume(l) : sf_ok()));
  const sf_status status = run_blocks(l);
  if (!first) return status;
  l->complete = status.code == SF_OK;
  const sf_status energy = sf_lockstep_energy(l);
  if (status.code == SF_E_STOPPED) return stopped(l, &status);
  if (status.code == SF_OK) return energy;
  return l->place.found ? difference(l, &status) : status;
}

sf_status sf_lockstep_load(sf_lockstep *l, const sf_lockstep_options *options)
{
  memset(l, 0, sizeof *l);
  l->options = *options;
  if (options->plusarg && strlen(options->plusarg) > SF_PLUSARG_MAX)
    return sf_fail(SF_E_USAGE, "--plusarg takes at most %d characters", SF_PLUSARG_MAX);
  SF_TRY(fx_scene_load(&l->fx, options->scene));
  SF_TRY(sf_fx_dataset_load(&l->data, &l->fx, options->scene, options->data, options->split, &(sf_dataset_options){0}));
  if (l->data.count < 1) return sf_fail(SF_E_FORMAT, "%s: no views", options->data);
  return identify(l);
}

void sf_lockstep_free(sf_lockstep *l)
{
  sf_dataset_free(&l->data);
  fx_scene_free(&l->fx);
}
