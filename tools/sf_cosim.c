/* Lockstep co-simulation: the Verilated accelerator against the fixed-point core on rays of a data set. */
#include "sim/cosim.h"
#include "sim/other_dut.h"
#include "spikefield/audit.h"
#include "spikefield/cli.h"
#include "spikefield/rng.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { STREAM_VIEW = 1, STREAM_X, STREAM_Y };

typedef struct options {
  int rays, stalls, split;
  uint64_t seed, limit;
  bool json, quiet;
  const char *wave, *plusarg, *dut, *dut_top;
} options;
static const char *const split_name[] = {"test", "train"};

typedef struct pixel_place {
  int view, x, y;
} pixel_place;

typedef struct session {
  options opt;
  fx_scene scene;
  sf_dataset data;
  sf_cosim *cosim;
  uint64_t rays; /* finished */
  double begun, seconds;
} session;

static pixel_place pick(const session *s, uint64_t ray)
{
  pixel_place p = {.view = (int)sf_random_below(s->opt.seed, STREAM_VIEW, ray, (uint64_t)s->data.count)};
  const sf_camera *camera = &s->data.view[p.view].camera;
  p.x = (int)sf_random_below(s->opt.seed, STREAM_X, ray, (uint64_t)camera->width);
  p.y = (int)sf_random_below(s->opt.seed, STREAM_Y, ray, (uint64_t)camera->height);
  return p;
}

static sf_status run_ray(session *s, uint64_t number)
{
  const pixel_place p = pick(s, number);
  fx_ray ray;
  SF_TRY(sf_pixel_ray(&s->scene, &s->data.view[p.view].camera, p.x, p.y, &ray));
  return sf_cosim_ray(s->cosim, number, &ray);
}

static void show(session *s, sf_progress *progress)
{
  const double seconds = sf_seconds() - s->begun;
  const uint64_t samples = sf_cosim_sum(s->cosim)->samples;
  sf_progress_show(progress, "ray %" PRIu64 "/%d  %" PRIu64 " samples equal  %.0f samples/s", s->rays, s->opt.rays,
                   samples, seconds > 0 ? (double)samples / seconds : 0);
}

static sf_status run_rays(session *s, sf_progress *progress)
{
  for (uint64_t i = 0; i < (uint64_t)s->opt.rays && !sf_cosim_limit_reached(s->cosim); i++) {
    if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "stopped after %" PRIu64 " rays", s->rays);
    SF_TRY(run_ray(s, i));
    s->rays++;
    if (sf_progress_due(progress)) show(s, progress);
  }
  return sf_cosim_finish(s->cosim);
}

/* ---- reports ---- */

static sf_status difference_status(const session *s, const sf_status *status)
{
  const sf_cosim_place *where = sf_cosim_where(s->cosim);
  const sf_difference *d = &where->what;
  char layer[48] = "", neuron[32] = "";
  if (!where->found) return *status;
  const pixel_place p = pick(s, where->ray);
  if (d->layer >= 0) snprintf(layer, sizeof layer, "layer %s step %d ", sf_layer_names[d->layer], d->step);
  if (d->neuron >= 0) snprintf(neuron, sizeof neuron, "neuron %d ", d->neuron);
  return sf_fail(SF_E_DIFFERENCE,
                 "ray %" PRIu64 " (view %s, pixel %d,%d) sample %s%" PRIu64 ": %s%s%s: expected %" PRId64
                 ", actual %" PRId64 ", cycle %" PRIu64,
                 where->ray, s->data.view[p.view].name, p.x, p.y, where->exact ? "" : ">= ", where->sample, layer,
                 neuron, d->wire, d->expected, d->actual, d->cycle);
}

static cJSON *difference_json(const session *s, const sf_status *status)
{
  const sf_cosim_place *where = sf_cosim_where(s->cosim);
  const sf_difference *d = &where->what;
  if (status->code == SF_OK) return cJSON_CreateNull();
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "message", status->message);
  if (!where->found) return json;
  const pixel_place p = pick(s, where->ray);
  sf_json_add_u64(json, "ray", where->ray);
  cJSON_AddStringToObject(json, "view", s->data.view[p.view].name);
  cJSON_AddNumberToObject(json, "x", p.x);
  cJSON_AddNumberToObject(json, "y", p.y);
  sf_json_add_u64(json, "sample", where->sample);
  cJSON_AddBoolToObject(json, "sample_exact", where->exact);
  if (d->layer >= 0) cJSON_AddStringToObject(json, "layer", sf_layer_names[d->layer]);
  if (d->layer >= 0) cJSON_AddNumberToObject(json, "step", d->step);
  if (d->neuron >= 0) cJSON_AddNumberToObject(json, "neuron", d->neuron);
  cJSON_AddStringToObject(json, "wire", d->wire);
  cJSON_AddNumberToObject(json, "expected", (double)d->expected);
  cJSON_AddNumberToObject(json, "actual", (double)d->actual);
  sf_json_add_u64(json, "cycle", d->cycle);
  return json;
}

static double ratio(uint64_t part, uint64_t whole)
{
  return whole ? (double)part / (double)whole : 0;
}

static sf_status print_json(const session *s, const sf_status *status)
{
  const sf_cosim_totals *sum = sf_cosim_sum(s->cosim);
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "seed", s->opt.seed);
  cJSON_AddNumberToObject(json, "stall_percent", s->opt.stalls);
  sf_json_add_u64(json, "rays", s->rays);
  sf_json_add_u64(json, "rays_with_samples", sum->core.rays);
  sf_json_add_u64(json, "samples", sum->samples);
  sf_json_add_u64(json, "spikes", sum->spikes);
  cJSON_AddNumberToObject(json, "differences", status->code == SF_E_DIFFERENCE);
  cJSON_AddItemToObject(json, "first_difference", difference_json(s, status));
  sf_json_add_u64(json, "cycles", sum->cycles);
  sf_json_add_u64(json, "stall_cycles", sum->stalls);
  cJSON_AddNumberToObject(json, "cycles_per_sample", ratio(sum->cycles, sum->samples));
  cJSON_AddNumberToObject(json, "utilisation", ratio(sum->busy, sum->cycles));
  cJSON_AddItemToObject(json, "counts", sf_counts_json(&s->scene.net, &sum->rtl));
  sf_json_add_u64(json, "energy_fj", sum->energy_rtl_fj);
  sf_json_add_u64(json, "energy_core_fj", sum->energy_core_fj);
  cJSON_AddNumberToObject(json, "seconds", s->seconds);
  char *text = cJSON_Print(json);
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for the report");
  const bool written = puts(text) >= 0 && fflush(stdout) == 0;
  free(text);
  return written ? sf_ok() : sf_fail(SF_E_IO, "standard output: cannot write the report");
}

static sf_status print_text(const session *s)
{
  const sf_cosim_totals *sum = sf_cosim_sum(s->cosim);
  printf("%" PRIu64 " rays (%" PRIu64 " with samples), %" PRIu64 " samples, %" PRIu64 " spikes: 0 differences\n",
         s->rays, sum->core.rays, sum->samples, sum->spikes);
  printf("compared: outputs, spikes, membranes and rows per layer and step, every counter, energy\n");
  printf("%" PRIu64 " cycles, %.1f per sample, utilisation %.1f %%, stalled %.1f %%\n", sum->cycles,
         ratio(sum->cycles, sum->samples), 100 * ratio(sum->busy, sum->cycles), 100 * ratio(sum->stalls, sum->cycles));
  printf("energy %" PRIu64 " fJ by the core, %" PRIu64 " fJ by the accelerator\n", sum->energy_core_fj,
         sum->energy_rtl_fj);
  printf("%.1f s, seed %" PRIu64 ", stalls %d %%\n", s->seconds, s->opt.seed, s->opt.stalls);
  return fflush(stdout) == 0 ? sf_ok() : sf_fail(SF_E_IO, "standard output: cannot write the report");
}

static sf_status simulate(session *s)
{
  const sf_cosim_options how = {
      .dut = {.seed = s->opt.seed, .stall_percent = s->opt.stalls, .wave = s->opt.wave, .plusarg = s->opt.plusarg},
      .limit = s->opt.limit};
  sf_progress progress;
  SF_TRY(sf_cosim_open(&s->cosim, &s->scene, &how));
  s->begun = sf_seconds();
  sf_progress_begin(&progress, s->opt.quiet);
  sf_status status = run_rays(s, &progress);
  show(s, &progress);
  sf_progress_end(&progress);
  s->seconds = sf_seconds() - s->begun;
  if (status.code == SF_E_DIFFERENCE) status = difference_status(s, &status);
  if (status.code == SF_OK && sf_cosim_sum(s->cosim)->samples == 0)
    status = sf_fail(SF_E_FORMAT, "%s: none of %d rays has a sample: nothing was compared", s->data.path, s->opt.rays);
  if (status.code != SF_OK && status.code != SF_E_DIFFERENCE) return status;
  const sf_status printed = s->opt.json ? print_json(s, &status) : status.code == SF_OK ? print_text(s) : sf_ok();
  return status.code == SF_OK ? printed : status;
}

static sf_status run(session *s, const char *scene, const char *data)
{
  SF_TRY(fx_scene_load(&s->scene, scene));
  SF_TRY(sf_dataset_load(&s->data, data, split_name[s->opt.split], &(sf_dataset_options){.downscale = 1}));
  if (s->data.count < 1) return sf_fail(SF_E_FORMAT, "%s: no views", data);
  return simulate(s);
}

int main(int argc, char **argv)
{
  session s = {.opt = {.rays = 200, .seed = 1, .stalls = 20, .dut_top = "sf_top"}};
  options *o = &s.opt;
  const char *positional[2];
  const sf_option table[] = {
      {.name = "--rays",
       .type = SF_ARG_INT,
       .value = &o->rays,
       .min = 1,
       .max = 1e9,
       .argument = "N",
       .help = "random rays over the views (default 200)"},
      {.name = "--seed",
       .type = SF_ARG_U64,
       .value = &o->seed,
       .min = 0,
       .max = 0x1p53,
       .argument = "S",
       .help = "of rays, stalls and register contents at power-on (default 1)"},
      {.name = "--split",
       .type = SF_ARG_CHOICE,
       .value = &o->split,
       .choices = "test|train",
       .help = "views to take (default test)"},
      {.name = "--stalls",
       .type = SF_ARG_INT,
       .value = &o->stalls,
       .min = 0,
       .max = 90,
       .argument = "P",
       .help = "percent of cycles with a bubble or back-pressure (default 20)"},
      {.name = "--limit-samples",
       .type = SF_ARG_U64,
       .value = &o->limit,
       .min = 0,
       .max = 0x1p53,
       .argument = "N",
       .help = "stop after N samples"},
      {.name = "--json", .type = SF_ARG_FLAG, .value = &o->json, .help = "print one JSON object"},
      {.name = "--quiet", .type = SF_ARG_FLAG, .value = &o->quiet, .help = "no progress line"},
      {.name = "--wave",
       .type = SF_ARG_STRING,
       .value = &o->wave,
       .argument = "FILE",
       .help = "FST waveform of the first difference, where there is one"},
      {.name = "--plusarg",
       .type = SF_ARG_STRING,
       .value = &o->plusarg,
       .argument = "ARG",
       .help = "passed to the simulation, for a fault build: +fault=1"},
      {.name = "--dut",
       .type = SF_ARG_STRING,
       .value = &o->dut,
       .argument = "FILES",
       .help =
           "Verilog sources of another block with the ports of rtl/sf_top.sv, and options of Verilator (docs/kit.md)"},
      {.name = "--dut-top",
       .type = SF_ARG_STRING,
       .value = &o->dut_top,
       .argument = "NAME",
       .help = "its module (default sf_top)"},
      {0}};
  const sf_cli cli = {.program = "sf_cosim",
                      .usage = "sf_cosim SCENE.snn DATA [options]",
                      .summary = "Run the Verilog accelerator and the fixed-point core on the same samples and compare "
                                 "everything for equality.\nExit status 1 at the first difference.",
                      .examples =
                          "  sf_cosim scene.snn data --rays 200 --seed 1\n"
                          "  sf_cosim scene.snn data --dut \"my_pkg.sv my_core.sv my_top.sv\" --dut-top my_top\n",
                      .options = table,
                      .min_positional = 2,
                      .max_positional = 2};
  sf_status status = sf_cli_parse(&cli, argc, argv, positional);
  if (status.code == SF_OK && o->dut) status = sf_other_dut_run(o->dut, o->dut_top, argv);
  sf_cli_catch_signals();
  if (status.code == SF_OK) status = run(&s, positional[0], positional[1]);
  sf_cosim_close(s.cosim);
  sf_dataset_free(&s.data);
  fx_scene_free(&s.scene);
  return sf_cli_finish(&cli, status);
}
