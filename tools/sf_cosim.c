/* Lockstep co-simulation: the Verilated accelerator, or one on a board, against the fixed-point core on rays of a data
 * set. */
#include "sim/activity/activity.h"
#include "sim/board/board.h"
#include "sim/board/lockstep.h"
#include "sim/lockstep.h"
#include "sim/other_dut.h"
#include "sim/plusarg.h"
#include "energy/energy.h"
#include "cli/finish_ranks.h"
#include "base/clock.h"
#include "base/io.h"
#include "base/text.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct options {
  sf_lockstep_options run;
  sf_ranks *ranks;
  int split, backend, top; /* backend: 0 rtl, 1 board; top: of sf_activity_block */
  double patience;
  bool json, quiet;
  const char *replay, *junit, *dut, *dut_top, *window;
  sf_activity_options activity;
  char evidence[4096]; /* where a difference's lies, "" where there is none */
  bool replays;        /* the replay shows it */
} options;
static const char *const split_name[] = {"test", "train"};

typedef struct display {
  sf_progress progress;
  double begun;
} display;

static void show(void *user, const sf_lockstep *l)
{
  display *d = user;
  const double seconds = sf_seconds() - d->begun;
  if (!sf_progress_due(&d->progress)) return;
  sf_progress_show(&d->progress, "ray %" PRIu64 "/%d  %" PRIu64 " samples equal  %.0f samples/s  %d process%s", l->rays,
                   l->options.rays, l->sum.samples, seconds > 0 ? (double)(l->sum.samples - l->resumed) / seconds : 0,
                   l->options.jobs, l->options.jobs == 1 ? "" : "es");
}

static sf_status print_text(const sf_lockstep *l, double seconds)
{
  sf_lockstep_print(stdout, l, seconds);
  return fflush(stdout) == 0 ? sf_ok() : sf_fail(SF_E_IO, "standard output: cannot write the report");
}

static sf_status report(const options *o, const sf_lockstep *l, const sf_status *status, double seconds)
{
  if (status->code != SF_OK && status->code != SF_E_DIFFERENCE && status->code != SF_E_STOPPED) return sf_ok();
  const sf_status saved = o->junit ? sf_lockstep_junit(l, status, seconds, o->junit) : sf_ok();
  if (o->json)
    SF_TRY(sf_json_print(sf_lockstep_json(l, status, seconds), true));
  else if (status->code != SF_E_DIFFERENCE)
    SF_TRY(print_text(l, seconds));
  return saved;
}

static sf_status load(const options *o, sf_lockstep *l)
{
  SF_TRY(sf_lockstep_load(l, &o->run));
  SF_TRY(sf_plusarg_check(o->run.plusarg));
  if (sf_ranks_rank(o->ranks) == 0) sf_dataset_warn(stderr, "sf_cosim", &l->data, NULL);
  return sf_ok();
}

static sf_status simulate(options *o, sf_lockstep *l)
{
  display d = {.begun = sf_seconds()};
  SF_TRY(sf_ranks_agree(o->ranks, load(o, l)));
  l->ranks = o->ranks;
  l->tick = show;
  l->user = &d;
  char faults[400] = "";
  sf_progress_begin(&d.progress, o->quiet);
  sf_status status = o->backend ? sf_board_lockstep_run(l, o->patience, faults) : sf_lockstep_run(l);
  sf_progress_end(&d.progress);
  l->user = NULL;
  if (sf_ranks_rank(o->ranks)) return status;
  if (faults[0]) fprintf(stderr, "sf_cosim: %s: sent again: %s\n", o->run.port, faults);
  snprintf(o->evidence, sizeof o->evidence, "%s", l->evidence);
  o->replays = l->replays;
  if (status.code == SF_OK && l->sum.samples == 0)
    status = sf_fail(SF_E_FORMAT, "%s: none of %d ray%s has a sample: nothing was compared", l->data.path, o->run.rays,
                     sf_plural((uint64_t)o->run.rays));
  const sf_status reported = report(o, l, &status, sf_seconds() - d.begun);
  if (status.code == SF_OK) return reported;
  return reported.code == SF_OK ? status : sf_fail(status.code, "%.199s; %.199s", status.message, reported.message);
}

/* ---- evidence ---- */

/* For a shell. */
static void print_word(FILE *out, const char *word)
{
  if (word[strcspn(word, " \t\n'\"\\$`&|;<>()*?[#~!{")] == 0) {
    fputs(word, out);
    return;
  }
  putc('\'', out);
  for (; *word; word++) fputs(*word == '\'' ? "'\\''" : (char[]){*word, 0}, out);
  putc('\'', out);
}

/* After the difference itself. */
static void say_evidence(FILE *out, const options *o, const char *program)
{
  char path[4096 + 8];
  if (!o->evidence[0]) return;
  snprintf(path, sizeof path, "%s.json", o->evidence);
  fprintf(out, "evidence: %s, waveform %s.fst\n", path, o->evidence);
  if (!o->replays) {
    fprintf(out, "replay:   these samples alone do not show it; the same command again does\n");
    return;
  }
  fprintf(out, "replay:   ");
  print_word(out, program);
  fprintf(out, " --replay ");
  print_word(out, path);
  putc('\n', out);
}

/* ---- replay ---- */

static sf_status say_replayed(const char *path, const sf_replay *replay, const sf_replayed *replayed, const char *wave)
{
  char text[200], note[120] = "";
  const sf_replay_sample *s = &replay->sample[replayed->at];
  if (replay->other_block) snprintf(note, sizeof note, "; %s", replay->other_block);
  if (!replayed->differs) {
    if (!note[0] && replay->other_program) snprintf(note, sizeof note, "; the file was written by another program");
    printf("%s: %d sample%s, no difference%s\n", path, replay->count, sf_plural((uint64_t)replay->count), note);
    printf("waveform: %s\n", wave);
    return fflush(stdout) == 0 ? sf_ok() : sf_fail(SF_E_IO, "standard output: cannot write the report");
  }
  if (replayed->what.wire) sf_difference_text(&replayed->what, text);
  return sf_fail(SF_E_DIFFERENCE, "%s: ray %" PRIu64 " sample %" PRIu64 ": %s; waveform %s%s", path, s->ray, s->sample,
                 replayed->what.wire ? text : replayed->message, wave, note);
}

/* A replay's waveform may be written again and again, that of a difference not. */
static sf_status keep_evidence(const options *o)
{
  char path[4096];
  snprintf(path, sizeof path, "%s.json", o->run.evidence);
  if (access(path, F_OK)) return sf_ok();
  return sf_fail(SF_E_USAGE, "--evidence %s: %s is of a difference, whose waveform would be written over",
                 o->run.evidence, path);
}

static sf_status play(const options *o)
{
  sf_replay replay;
  sf_replayed replayed;
  fx_scene scene = {0};
  char *name, wave[4096];
  SF_TRY(keep_evidence(o));
  SF_TRY(sf_replay_load(&replay, &name, o->replay));
  snprintf(wave, sizeof wave, "%s.fst", o->run.evidence);
  sf_status status = fx_scene_load(&scene, name);
  if (status.code == SF_OK) status = sf_replay_run(&replay, &scene.net, wave, &replayed);
  if (status.code == SF_OK) status = say_replayed(o->replay, &replay, &replayed, wave);
  fx_scene_free(&scene);
  free(name);
  return status;
}

/* ---- activity for power tools ---- */

static sf_status record_activity(const options *o, sf_lockstep *l)
{
  display d = {.begun = sf_seconds()};
  sf_activity_report r;
  SF_TRY(load(o, l));
  l->tick = show;
  l->user = &d;
  sf_progress_begin(&d.progress, o->quiet);
  const sf_status status = sf_activity_run(l, &o->activity, &r);
  sf_progress_end(&d.progress);
  l->user = NULL;
  SF_TRY(status);
  if (o->json) return sf_json_print(sf_activity_json(&o->activity, &r), true);
  sf_activity_print(stdout, &o->activity, &r);
  return fflush(stdout) == 0 ? sf_ok() : sf_fail(SF_E_IO, "standard output: cannot write the report");
}

/* A run in a folder that cannot be written may still find no difference, unless a place was asked for. */
static sf_status check_evidence(const char *prefix)
{
  char path[4096];
  if (!prefix) return sf_ok();
  snprintf(path, sizeof path, "%s.json", prefix);
  return sf_writable(path);
}

static sf_status check_board(const options *o)
{
  if (o->backend && !o->run.port) return sf_fail(SF_E_USAGE, "--backend board needs --port, such as /dev/ttyUSB0");
  if (!o->backend && (o->run.port || o->patience > 0))
    return sf_fail(SF_E_USAGE, "--port and --timeout belong to --backend board");
  return sf_ok();
}

/* Options that would have no effect are refused; those that were not given get their defaults. */
static sf_status settle(options *o)
{
  sf_lockstep_options *r = &o->run;
  SF_TRY(check_board(o));
  if (!(o->patience > 0)) o->patience = SF_BOARD_PATIENCE;
  const bool activity = o->activity.saif || o->activity.vcd;
  if (!activity && (o->window || o->activity.depth || o->activity.clock_mhz || o->top))
    return sf_fail(SF_E_USAGE, "--top, --window, --depth and --clock belong to --saif or --vcd");
  if (o->top && o->dut) return sf_fail(SF_E_USAGE, "--dut is a block in place of sf_top: it takes no --top sf_ray_top");
  if (activity && (o->junit || r->checkpoint || r->limit || r->jobs || r->block || r->evidence))
    return sf_fail(SF_E_USAGE, "--saif and --vcd take no --junit, --checkpoint, --limit-samples, --jobs, --block or "
                               "--evidence: their samples go through one accelerator");
  if (sf_ranks_launched() > 1 && (r->jobs || o->dut || o->replay || activity))
    return sf_fail(SF_E_USAGE, "--jobs, --dut, --replay, --saif and --vcd are for a program that no launcher started: "
                               "mpirun and srun say how many ranks there are");
  if (o->dut_top && !o->dut) return sf_fail(SF_E_USAGE, "--dut-top belongs to --dut");
  SF_TRY(check_evidence(r->evidence));
  if (!r->jobs) r->jobs = 1;
  if (!r->block) r->block = 256;
  if (!r->evidence) r->evidence = o->replay ? "sf_cosim-replay" : "sf_cosim-difference";
  o->activity.block = o->top ? SF_ACTIVITY_RAYS : SF_ACTIVITY_SAMPLES;
  if (!o->activity.clock_mhz) o->activity.clock_mhz = 200;
  if (!o->dut_top) o->dut_top = "sf_top";
  return sf_ok();
}

static sf_status run(options *o, const char *scene, const char *data)
{
  if (o->replay)
    return scene ? sf_fail(SF_E_USAGE, "--replay takes neither scene nor data: its file names them") : play(o);
  if (!data) return sf_fail(SF_E_USAGE, "%s is missing", scene ? "DATA" : "SCENE.snn");
  o->run.scene = scene;
  o->run.data = data;
  o->run.split = split_name[o->split];
  const bool activity = o->activity.saif || o->activity.vcd;
  if (o->window) SF_TRY(sf_activity_window(o->window, &o->activity));
  sf_lockstep *l = malloc(sizeof *l);
  if (!l) return sf_fail(SF_E_MEMORY, "out of memory");
  const sf_status status = activity ? record_activity(o, l) : simulate(o, l);
  sf_lockstep_free(l);
  free(l);
  return status;
}

enum { OPTIONS_MAX = 32 };

static sf_option *runs(options *o, sf_option *list)
{
  sf_lockstep_options *r = &o->run;
  const sf_option table[] = {
      SF_GROUP("A first run"),
      {"--rays", 0, SF_ARG_INT, &r->rays, 1, 1e9, NULL, "N", "random rays over the views (default 200)"},
      {"--seed", 0, SF_ARG_U64, &r->seed, 0, 0x1p53, NULL, "S",
       "seed of rays, stalls and register contents at power-on (default 1)"},
      {"--split", 0, SF_ARG_CHOICE, &o->split, 0, 0, "test|train", NULL, "which views the rays are of (default test)"},
      {"--stalls", 0, SF_ARG_INT, &r->stall_percent, 0, 90, NULL, "P",
       "percent of cycles with a bubble or back-pressure (default 20)"},
      {"--limit-samples", 0, SF_ARG_U64, &r->limit, 0, 0x1p53, NULL, "N",
       "stop after N samples; the unit of work (--block) that has begun is finished"},
      {"--backend", 0, SF_ARG_CHOICE, &o->backend, 0, 0, "rtl|board", "B",
       "the Verilated accelerator (default), or one on a board: pixels and counters (docs/board.md)"},
      {"--port", 0, SF_ARG_STRING, &r->port, 0, 0, NULL, "DEVICE", "board: its serial port, such as /dev/ttyUSB0"},
      {"--timeout", 0, SF_ARG_DOUBLE, &o->patience, 0.01, 600, NULL, "S",
       "board: seconds without a byte until a command is sent again (default 1)"},
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "print one JSON object"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      SF_GROUP("Long runs"),
      {"--jobs", 0, SF_ARG_INT, &r->jobs, 1, SF_JOBS_MAX, NULL, "N",
       "processes; the result does not depend on it (default 1); mpirun and srun bring their own (docs/scale.md)"},
      {"--block", 0, SF_ARG_INT, &r->block, 1, 1e9, NULL, "N",
       "rays per unit of work, each on a freshly powered accelerator (default 256)"},
      {"--checkpoint", 0, SF_ARG_OUTPUT, &r->checkpoint, 0, 0, NULL, "FILE",
       "keep finished units of work in FILE; if it is there, go on from it; --rays may be larger than before"},
      SF_GROUP("A difference and its evidence"),
      {"--evidence", 0, SF_ARG_STRING, &r->evidence, 0, 0, NULL, "PREFIX",
       "write a difference to PREFIX.json and PREFIX.fst, the next one to PREFIX-2 (default sf_cosim-difference)"},
      {"--replay", 0, SF_ARG_INPUT, &o->replay, 0, 0, NULL, "FILE",
       "run the samples of a difference again, from its .json and on the block that differed; writes PREFIX.fst "
       "(default sf_cosim-replay)"},
      {"--junit", 0, SF_ARG_OUTPUT, &o->junit, 0, 0, NULL, "FILE", "the result as JUnit XML"}};
  return sf_cli_add(list, table, sizeof table / sizeof *table);
}

static sf_option *activity_and_blocks(options *o, sf_option *list)
{
  const sf_option table[] = {
      SF_GROUP("Switching activity"),
      {"--saif", 0, SF_ARG_OUTPUT, &o->activity.saif, 0, 0, NULL, "FILE",
       "stream all samples through one accelerator and write how often each net switched (docs/activity.md)"},
      {"--vcd", 0, SF_ARG_OUTPUT, &o->activity.vcd, 0, 0, NULL, "FILE",
       "stream them likewise and write every change of every net"},
      {"--top", 0, SF_ARG_CHOICE, &o->top, 0, 0, "sf_top|sf_ray_top", NULL,
       "the block of --saif and --vcd: samples through the nets (default), or rays to pixels, with field and "
       "compositor"},
      {"--window", 0, SF_ARG_STRING, &o->window, 0, 0, NULL, "FIRST,LAST",
       "cycles that --saif and --vcd cover (default all)"},
      {"--depth", 0, SF_ARG_INT, &o->activity.depth, 0, 64, NULL, "N",
       "levels of the hierarchy for --saif and --vcd, the top is 1 (default 0: all)"},
      {"--clock", 0, SF_ARG_DOUBLE, &o->activity.clock_mhz, 0.1, 1e5, NULL, "MHZ",
       "clock of their times (default 200)"},
      SF_GROUP("Planted faults, other blocks"),
      {"--plusarg", 0, SF_ARG_STRING, &o->run.plusarg, 0, 0, NULL, "ARG",
       "hand ARG to the simulation, such as +fault=1 in a build with planted faults; at most 63 characters"},
      {"--dut", 0, SF_ARG_STRING, &o->dut, 0, 0, NULL, "FILES",
       "another block with the ports of rtl/sf_top.sv: Verilog sources, options of Verilator, -F LIST (docs/kit.md)"},
      {"--dut-top", 0, SF_ARG_STRING, &o->dut_top, 0, 0, NULL, "NAME", "its module (default sf_top)"}};
  return sf_cli_add(list, table, sizeof table / sizeof *table);
}

int main(int argc, char **argv)
{
  options o = {.run = {.rays = 200, .seed = 1, .stall_percent = 20}, .activity = {.last = UINT64_MAX}};
  const char *positional[2];
  sf_option table[OPTIONS_MAX];
  *activity_and_blocks(&o, runs(&o, table)) = (sf_option){0};
  const sf_cli cli = {.program = "sf_cosim",
                      .usage = "sf_cosim SCENE.snn DATA [options]\n       sf_cosim --replay FILE",
                      .summary = "Run the Verilog accelerator and the fixed-point core on the same samples and compare "
                                 "everything for equality.\nExit status 1 at the first difference.",
                      .examples =
                          "  sf_cosim scene.snn data --rays 200 --seed 1\n"
                          "  sf_cosim scene.snn data --rays 100000 --jobs 8 --checkpoint run.part --json\n"
                          "  mpirun -n 8 sf_cosim scene.snn data --rays 1000000 --checkpoint run.part\n"
                          "  sf_cosim --replay sf_cosim-difference.json\n"
                          "  sf_cosim scene.snn data --backend board --port /dev/ttyUSB0\n"
                          "  sf_cosim scene.snn data --rays 200 --stalls 0 --saif run.saif --depth 3\n"
                          "  sf_cosim scene.snn data --rays 50 --stalls 0 --saif rays.saif --top sf_ray_top\n"
                          "  sf_cosim scene.snn data --dut \"my_pkg.sv my_core.sv my_top.sv\" --dut-top my_top\n"
                          "  sf_cosim scene.snn data --dut \"-F kit/rtl.f\"\n",
                      .options = table,
                      .min_positional = 0,
                      .max_positional = 2};
  static const char *const named_by_replay[] = {
      "--rays",  "--seed",       "--split",   "--stalls", "--limit-samples", "--json",   "--jobs",
      "--block", "--checkpoint", "--junit",   "--saif",   "--vcd",           "--window", "--depth",
      "--clock", "--plusarg",    "--backend", "--port",   "--timeout",       "--top",    NULL};
  static const char *const of_simulation[] = {"--stalls",  "--jobs", "--block", "--checkpoint", "--evidence",
                                              "--plusarg", "--dut",  "--saif",  "--vcd",        NULL};
  sf_status status = sf_cli_parse(&cli, argc, argv, positional);
  if (status.code == SF_OK && o.backend)
    status = sf_cli_refuse(&cli, argc, argv, of_simulation, "has no effect beside --backend board");
  if (status.code == SF_OK && o.replay)
    status = sf_cli_refuse(&cli, argc, argv, named_by_replay, "has no effect beside --replay: its file is the run");
  if (status.code == SF_OK) status = settle(&o);
  if (status.code == SF_OK && o.dut) status = sf_other_dut_run("sf_cosim", o.dut, o.dut_top, argv);
  if (status.code == SF_OK && o.replay) status = sf_other_dut_replay(o.replay, argv);
  sf_cli_catch_signals();
  if (status.code == SF_OK) {
    const sf_ranks_options how = {
        .interrupted = sf_cli_interrupted, .processes = o.run.jobs, .argc = argc, .argv = argv};
    status = sf_ranks_open(&o.ranks, &how);
    if (sf_ranks_size(o.ranks) > 1) o.run.jobs = sf_ranks_size(o.ranks);
  }
  if (status.code == SF_OK) status = run(&o, positional[0], positional[1]);
  const int code = sf_cli_finish_ranks(&cli, o.ranks, status);
  if (code == 1 && status.code == SF_E_DIFFERENCE) say_evidence(stderr, &o, argv[0]);
  return code;
}
