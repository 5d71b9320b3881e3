/* sf_cycles: how long the accelerator takes for a frame, from the cycle model. */
#include "energy/energy.h"
#include "cli/cli.h"
#include "cycles/explore.h"
#include "cycles/frame.h"
#include "base/text.h"
#include "quant/quant.h"
#include "base/io.h"
#include "report/plot.h"
#include "scene/scene.h"
#include <inttypes.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BUILDS = 3, MEMORY_LATENCY = 16 };

/* Builds of the design space: a quarter, a half, all of the lanes at once. */
static const sf_engine builds[BUILDS] = {
    {SF_LANES / 4, SF_LANES / 32, 2}, {SF_LANES / 2, SF_LANES / 16, 2}, {SF_LANES, SF_LANES / 8, 2}};

typedef struct options {
  sf_engine engine;
  bool builds, explore;
  const char *scene, *data, *split, *plot, *tech;
  int view, downscale, threads, latency;
  double clock;
  bool json, quiet;
} options;

typedef struct job {
  options opt;
  fx_scene scene;
  sf_dataset data;
  sf_machine machine[1 + BUILDS]; /* the build that was asked for, and those of the design space */
  uint64_t rays, latency;         /* latency: of one sample in an empty engine, the first of the frame */
  sf_progress progress;
} job;

/* ---- the frame ---- */

static void frame_tick(void *user, int rows)
{
  job *j = user;
  if (sf_progress_due(&j->progress))
    sf_progress_show(&j->progress, "row %d of %d, %" PRIu64 " samples", rows, j->data.view[0].camera.height,
                     sf_machine_totals(&j->machine[0]).samples);
}

static sf_status run_frame(job *j)
{
  const sf_camera *camera = &j->data.view[0].camera;
  const sf_frame_job frame = {.scene = &j->scene,
                              .data = &j->data,
                              .view = &j->data.view[0],
                              .machine = j->machine,
                              .machines = 1 + (j->opt.builds ? BUILDS : 0),
                              .tick = frame_tick,
                              .user = j};
  j->rays = (uint64_t)camera->width * (uint64_t)camera->height;
  return sf_frame_run(&frame, &j->opt.engine, &j->latency);
}

/* ---- report ---- */

static double ratio(uint64_t a, uint64_t b)
{
  return b ? (double)a / (double)b : 0;
}

static int busiest(const sf_cycle_totals *t)
{
  int most = 0;
  for (int l = 1; l < SF_LAYERS; l++)
    if (t->busy[l] > t->busy[most]) most = l;
  return most;
}

static bool has_layer(const job *j, int layer)
{
  return j->scene.net.layer[layer].n_out > 0;
}

/* ---- design space ---- */

static const int cores[] = {1, 2, 4, 8}, clocks[] = {50, 100, 200, 400};
#define COUNT(array) (sizeof(array) / sizeof *(array))

static double frames_per_second(const sf_machine *machine, int count, double mhz)
{
  const uint64_t cycles = sf_machine_totals(machine).cycles;
  return cycles ? 1e6 * mhz * count / (double)cycles : 0;
}

static double cycles_per_sample(const sf_machine *machine)
{
  const sf_cycle_totals t = sf_machine_totals(machine);
  return ratio(t.cycles, t.samples);
}

static void print_space(const job *j)
{
  printf("\nframes/s      ");
  for (size_t c = 0; c < COUNT(cores); c++) printf("%6d core%s", cores[c], cores[c] > 1 ? "s" : " ");
  for (size_t m = 0; m < COUNT(clocks); m++) {
    printf("\n  %4d MHz    ", clocks[m]);
    for (size_t c = 0; c < COUNT(cores); c++) printf("%12.2f", frames_per_second(&j->machine[0], cores[c], clocks[m]));
  }
  putchar('\n');
  if (!j->opt.builds) return;
  printf("\nother builds            cycles per sample   frames/s at %.0f MHz\n", j->opt.clock);
  for (int b = 0; b < BUILDS; b++)
    printf("  %3d MACs, %2d neurons  %18.1f %20.2f\n", builds[b].macs, builds[b].neurons,
           cycles_per_sample(&j->machine[1 + b]), frames_per_second(&j->machine[1 + b], 1, j->opt.clock));
}

static void add_engine(cJSON *json, const sf_engine *engine)
{
  cJSON_AddNumberToObject(json, "macs", engine->macs);
  cJSON_AddNumberToObject(json, "neurons", engine->neurons);
  cJSON_AddNumberToObject(json, "steps_at_once", engine->steps_at_once);
}

static void add_points(cJSON *space, const sf_engine *engine, const sf_machine *machine)
{
  for (size_t c = 0; c < COUNT(cores); c++)
    for (size_t m = 0; m < COUNT(clocks); m++) {
      cJSON *point = cJSON_CreateObject();
      add_engine(point, engine);
      cJSON_AddNumberToObject(point, "cycles_per_sample", cycles_per_sample(machine));
      cJSON_AddNumberToObject(point, "cores", cores[c]);
      cJSON_AddNumberToObject(point, "clock_mhz", clocks[m]);
      cJSON_AddNumberToObject(point, "frames_per_second", frames_per_second(machine, cores[c], clocks[m]));
      cJSON_AddItemToArray(space, point);
    }
}

/* ---- plot ---- */

static void put_plot(FILE *out, const job *j, const char *name)
{
  char text[400], title[400];
  const sf_cycle_totals total = sf_machine_totals(&j->machine[0]), *t = &total;
  snprintf(text, sizeof text, "Frames per second: %.200s, view %d, t_r = %d, %.1f cycles per sample", j->opt.data,
           j->opt.view, j->scene.net.steps, ratio(t->cycles, t->samples));
  sf_plot_quote(title, sizeof title, text);
  sf_plot_head(out, name, title, "clock, MHz", "frames per second (cycle model)", "outside right top");
  fprintf(out, "set logscale xy 2\nset xtics (");
  for (size_t m = 0; m < COUNT(clocks); m++) fprintf(out, "%s%d", m ? ", " : "", clocks[m]);
  fprintf(out, ")\n$frames << EOD\n");
  for (size_t m = 0; m < COUNT(clocks); m++) {
    fprintf(out, "%d", clocks[m]);
    for (size_t c = 0; c < COUNT(cores); c++)
      fprintf(out, " %.6g", frames_per_second(&j->machine[0], cores[c], clocks[m]));
    putc('\n', out);
  }
  fprintf(out, "EOD\nplot ");
  for (size_t c = 0; c < COUNT(cores); c++)
    fprintf(out, "%s$frames using 1:%zu with linespoints linecolor '%s' linewidth 2 pointtype 7 title '%d core%s'",
            c ? ", " : "", c + 2, sf_plot_colour[c], cores[c], cores[c] > 1 ? "s" : "");
  putc('\n', out);
}

static sf_status write_plot(const job *j)
{
  char name[256];
  sf_writer writer;
  SF_TRY(sf_plot_name(j->opt.plot, name));
  SF_TRY(sf_writer_open(&writer, j->opt.plot));
  put_plot(writer.file, j, name);
  SF_TRY(sf_writer_commit(&writer));
  fprintf(stderr, "wrote %s; gnuplot makes %s.svg of it\n", j->opt.plot, name);
  return sf_ok();
}

/* ---- output ---- */

static void print_planes(const job *j, const sf_planes_totals *p)
{
  printf("%" PRIu64
         " densities of the field, %.2f cycles each; %.2f look-ups and %.2f misses each, of a memory that answers "
         "after %d cycle%s\n",
         p->densities, ratio(p->cycles, p->densities), ratio(p->lookups, p->densities), ratio(p->misses, p->densities),
         j->opt.latency, sf_plural((uint64_t)j->opt.latency));
}

static void add_planes(cJSON *json, const job *j, const sf_planes_totals *p)
{
  sf_json_add_u64(json, "densities", p->densities);
  sf_json_add_u64(json, "lookups", p->lookups);
  sf_json_add_u64(json, "misses", p->misses);
  cJSON_AddNumberToObject(json, "memory_latency", j->opt.latency);
}

static void print_text(const job *j)
{
  const sf_cycle_totals total = sf_machine_totals(&j->machine[0]), *t = &total;
  const int most = busiest(t);
  printf("%s, view %d: %" PRIu64 " rays, %" PRIu64 " samples, t_r = %d\n", j->opt.data, j->opt.view, j->rays,
         t->samples, j->scene.net.steps);
  printf("%" PRIu64 " cycles, %.1f per sample (a dense ReLU net of the same sizes on these lanes: %" PRIu64 ")\n",
         t->cycles, ratio(t->cycles, t->samples), sf_cycles_dense(&j->scene.net));
  if (j->machine[0].planes) print_planes(j, sf_planes_model_totals(j->machine[0].planes));
  printf("a build of %d MACs, %d neuron units, %d step%s of C2 at once\n", j->opt.engine.macs, j->opt.engine.neurons,
         j->opt.engine.steps_at_once, sf_plural((uint64_t)j->opt.engine.steps_at_once));
  printf("latency of a sample alone: %" PRIu64 " cycles\nutilisation:", j->latency);
  for (int l = 0; l < SF_LAYERS; l++)
    if (has_layer(j, l)) printf(" %s %.1f %%", fx_layer_name(l), 100 * ratio(t->busy[l], t->cycles));
  printf("; the busiest is %s\n", fx_layer_name(most));
  printf("%" PRIu64 " cycles without a sample for %s, %" PRIu64 " in which sums of %s waited for the readout\n",
         t->waits, fx_layer_name(has_layer(j, FX_D1) ? FX_D1 : FX_C1), t->stalls,
         has_layer(j, FX_D2) ? "D2 or C3" : "C3");
  print_space(j);
  printf("\n%.2f ms per frame at %.0f MHz in one core\n", ratio(t->cycles, 1) / j->opt.clock / 1e3, j->opt.clock);
}

static sf_status print_json(const job *j)
{
  const sf_cycle_totals total = sf_machine_totals(&j->machine[0]), *t = &total;
  cJSON *json = cJSON_CreateObject();
  add_engine(json, &j->opt.engine);
  sf_json_add_u64(json, "rays", j->rays);
  sf_json_add_u64(json, "samples", t->samples);
  sf_json_add_u64(json, "cycles", t->cycles);
  cJSON_AddNumberToObject(json, "cycles_per_sample", ratio(t->cycles, t->samples));
  sf_json_add_u64(json, "latency", j->latency);
  if (j->machine[0].planes) add_planes(json, j, sf_planes_model_totals(j->machine[0].planes));
  sf_json_add_u64(json, "waits", t->waits);
  sf_json_add_u64(json, "stalls", t->stalls);
  cJSON *busy = cJSON_AddObjectToObject(json, "utilisation");
  for (int l = 0; l < SF_LAYERS; l++)
    if (has_layer(j, l)) cJSON_AddNumberToObject(busy, fx_layer_name(l), ratio(t->busy[l], t->cycles));
  cJSON_AddNumberToObject(json, "clock_mhz", j->opt.clock);
  cJSON_AddNumberToObject(json, "frames_per_second", frames_per_second(&j->machine[0], 1, j->opt.clock));
  cJSON *space = cJSON_AddArrayToObject(json, "design_space");
  add_points(space, &j->opt.engine, &j->machine[0]);
  for (int b = 0; b < BUILDS && j->opt.builds; b++) add_points(space, &builds[b], &j->machine[1 + b]);
  return sf_json_print(json, true);
}

static sf_status make_models(job *j)
{
  const sf_engine *e = &j->opt.engine;
  const int parts = SF_LANES / e->macs, s = e->steps_at_once;
  if (e->macs * parts != SF_LANES || (parts != 1 && parts != 2 && parts != 4))
    return sf_fail(SF_E_USAGE, "--macs %d: expected %d, %d or %d", e->macs, SF_LANES, SF_LANES / 2, SF_LANES / 4);
  if (e->neurons > e->macs || (e->neurons & (e->neurons - 1)))
    return sf_fail(SF_E_USAGE, "--neurons %d: expected a power of two, at most --macs", e->neurons);
  if (s & (s - 1)) return sf_fail(SF_E_USAGE, "--steps-at-once %d: expected 1, 2, 4 or 8", s);
  SF_TRY(sf_machine_open(&j->machine[0], &j->scene, e, j->opt.latency));
  for (int b = 0; b < BUILDS && j->opt.builds; b++)
    SF_TRY(sf_machine_open(&j->machine[1 + b], &j->scene, &builds[b], j->opt.latency));
  return sf_ok();
}

/* ---- other builds, in time and energy ---- */

static bool explore_tick(void *user, const char *what, int done, int total)
{
  job *j = user;
  if (sf_progress_due(&j->progress)) sf_progress_show(&j->progress, "%s: %d of %d", what, done, total);
  return !sf_cli_interrupted();
}

static sf_status show_explored(const job *j, const sf_explore *e)
{
  if (j->opt.plot) SF_TRY(sf_plot_explored(j->opt.plot, e, j->opt.clock));
  if (j->opt.json) return sf_json_print(sf_explore_json(e, j->opt.clock), true);
  printf("%s, view %d, t_r = %d: ", j->opt.data, j->opt.view, j->scene.net.steps);
  sf_explore_print(stdout, e, j->opt.clock);
  return sf_ok();
}

static sf_status explore(job *j)
{
  sf_technology technology;
  sf_explore *e;
  SF_TRY(sf_technology_find(&technology, j->opt.tech ? j->opt.tech : "45nm"));
  const sf_explore_job how = {.scene = &j->scene,
                              .data = &j->data,
                              .view = &j->data.view[0],
                              .technology = &technology,
                              .tick = explore_tick,
                              .user = j};
  sf_progress_begin(&j->progress, j->opt.quiet);
  sf_status status = sf_explore_run(&how, &e);
  sf_progress_end(&j->progress);
  if (status.code == SF_OK) status = show_explored(j, e);
  free(e);
  return status;
}

static sf_status run(job *j)
{
  char name[256];
  if (j->opt.plot) SF_TRY(sf_plot_name(j->opt.plot, name));
  SF_TRY(fx_scene_load(&j->scene, j->opt.scene));
  if (j->opt.latency && j->scene.backbone == FX_INGP)
    return sf_fail(SF_E_USAGE, "--latency has no effect: %.200s has a hash grid, whose field is not modelled",
                   j->opt.scene);
  if (!j->opt.latency) j->opt.latency = MEMORY_LATENCY;
  const sf_dataset_options how = {.downscale = j->opt.downscale, .first = j->opt.view, .limit = 1};
  SF_TRY(sf_fx_dataset_load(&j->data, &j->scene, j->opt.scene, j->opt.data, j->opt.split, &how));
  sf_dataset_warn(stderr, "sf_cycles", &j->data, NULL);
  if (j->data.count == 0)
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s has fewer %s views", j->opt.view, j->opt.data,
                   j->opt.split);
  if (j->opt.explore) return explore(j);
  SF_TRY(make_models(j));
  sf_progress_begin(&j->progress, j->opt.quiet);
  const sf_status status = run_frame(j);
  sf_progress_end(&j->progress);
  SF_TRY(status);
  if (j->opt.plot) SF_TRY(write_plot(j));
  if (j->opt.json) return print_json(j);
  print_text(j);
  return sf_ok();
}

/* Options that nothing would read. */
static sf_status check_effect(const options *o, const sf_cli *cli, int argc, char **argv)
{
  static const char *const one[] = {"--macs", "--neurons", "--steps-at-once", "--builds", "--latency", NULL},
                           *const tech[] = {"--tech", NULL};
  if (!o->explore) return sf_cli_refuse(cli, argc, argv, tech, "has no effect: it goes with --explore");
  return sf_cli_refuse(cli, argc, argv, one, "has no effect beside --explore, which takes all");
}

int main(int argc, char **argv)
{
  job j = {.opt = {.split = "test", .clock = 200, .engine = sf_engine_default}};
  options *o = &j.opt;
  const sf_option table[] = {
      {"--view", 0, SF_ARG_INT, &o->view, 0, 1 << 20, NULL, "K", "which view of the split, from 0 (default 0)"},
      {"--split", 0, SF_ARG_STRING, &o->split, 0, 0, NULL, "NAME", "train or test (default test)"},
      {"--downscale", 0, SF_ARG_INT, &o->downscale, 0, 64, NULL, "N",
       "a view of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--plot", 0, SF_ARG_OUTPUT, &o->plot, 0, 0, NULL, "NAME.gp",
       "gnuplot script of frames per second, or of what was explored; gnuplot writes NAME.svg"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      SF_GROUP("Another accelerator"),
      {"--clock", 0, SF_ARG_DOUBLE, &o->clock, 1, 1e5, NULL, "MHZ", "for the last line and --json (default 200)"},
      {"--macs", 0, SF_ARG_INT, &o->engine.macs, 1, SF_LANES, NULL, "N",
       "multipliers of D1 and C1 (default: of this build's RTL)"},
      {"--neurons", 0, SF_ARG_INT, &o->engine.neurons, 4, 64, NULL, "N", "neuron units (likewise)"},
      {"--steps-at-once", 0, SF_ARG_INT, &o->engine.steps_at_once, 1, 8, NULL, "N",
       "steps that C2 sums up side by side (likewise)"},
      {"--latency", 0, SF_ARG_INT, &o->latency, 1, 10000, NULL, "CYCLES",
       "of TensoRF's memory, from a request to its first beat (default 16)"},
      SF_GROUP("Many builds"),
      {"--builds", 0, SF_ARG_FLAG, &o->builds, 0, 0, NULL, NULL,
       "also builds for 1/4, 1/2 or all of the lanes at once"},
      {"--explore", 0, SF_ARG_FLAG, &o->explore, 0, 0, NULL, NULL,
       "time against energy over MACs, neuron units, steps at once and caches: the Pareto front"},
      {"--tech", 0, SF_ARG_INPUT, &o->tech, 0, 0, NULL, "FILE",
       "of --explore: prices, a file or a name (default 45nm)"},
      SF_GROUP("Tuning"),
      {"--threads", 0, SF_ARG_INT, &o->threads, 1, 1024, NULL, "N", "threads (default: all processors)"},
      {0}};
  const sf_cli cli = {
      .program = "sf_cycles",
      .usage = "sf_cycles SCENE.snn DATA [options]",
      .summary =
          "Cycles, latency, utilisation and frames per second of the accelerator for a view, by the cycle model:\n"
          "control with spike counts in place of bitmaps, exact while the streams never make it wait. Of a hash\n"
          "grid it begins with the features; of TensoRF it has all from positions to pixels, with cache and memory.",
      .examples = "  sf_cycles scene.snn data --view 3\n"
                  "  sf_cycles scene.snn data --downscale 4 --clock 100 --json\n"
                  "  sf_cycles scene.snn data --builds\n"
                  "  sf_cycles tensorf.snn data --latency 64\n"
                  "  sf_cycles scene.snn data --plot frames.gp && gnuplot frames.gp\n"
                  "  sf_cycles scene.snn data --explore --plot builds.gp\n",
      .options = table,
      .min_positional = 2,
      .max_positional = 2};
  const char *positional[2] = {NULL, NULL};
  sf_status status = sf_cli_parse(&cli, argc, argv, positional);
  o->scene = positional[0], o->data = positional[1];
  if (status.code == SF_OK) status = check_effect(o, &cli, argc, argv);
  if (status.code == SF_OK && o->threads) omp_set_num_threads(o->threads);
  if (status.code == SF_OK) status = run(&j);
  for (int b = 0; b < 1 + BUILDS; b++) sf_machine_close(&j.machine[b]);
  sf_dataset_free(&j.data);
  fx_scene_free(&j.scene);
  if (status.code == SF_OK && fflush(stdout)) status = sf_fail(SF_E_IO, "standard output: the report was not written");
  return sf_cli_finish(&cli, status);
}
