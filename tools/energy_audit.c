/* energy_audit: every operation of a scene, counted three times, and its price. */
#include "spikefield/audit.h"
#include "spikefield/cli.h"
#include "spikefield/dut.h"
#include "spikefield/io.h"
#include "spikefield/rng.h"
#include <inttypes.h>
#include <omp.h>
#include <stdlib.h>

typedef struct options {
  int view, views, downscale, threads, rtl_rays, stall;
  uint64_t rays, seed;
  double scale;
  const char *split, *csv, *plusarg, *scene, *data;
  bool json, published, quiet;
} options;

enum { RTL_RAYS = 32 };
/* Streams of the random numbers of one seed. */
enum { STREAM_VIEW = 1, STREAM_X, STREAM_Y, STREAM_SUBSET };

typedef struct place {
  int view, x, y;
} place;

typedef struct audit {
  options opt;
  fx_scene scene;
  sf_dataset data;
  uint64_t pixels; /* of one view */
  char hash[65];
  uint64_t *subset; /* indices of the rays for the accelerator */
  sf_audit_report report;
  sf_progress progress;
  double start;
} audit;

/* ---- rays ---- */

static place ray_place(const audit *a, uint64_t index)
{
  const sf_camera *camera = &a->data.view[0].camera;
  if (a->opt.rays == 0) {
    uint64_t pixel = index % a->pixels;
    int first = a->opt.view >= 0 ? a->opt.view : 0;
    return (place){first + (int)(index / a->pixels), (int)(pixel % (uint64_t)camera->width),
                   (int)(pixel / (uint64_t)camera->width)};
  }
  uint64_t seed = a->opt.seed;
  int view = a->opt.view >= 0 ? a->opt.view : (int)sf_random_below(seed, STREAM_VIEW, index, (uint64_t)a->data.count);
  return (place){view, (int)sf_random_below(seed, STREAM_X, index, (uint64_t)camera->width),
                 (int)sf_random_below(seed, STREAM_Y, index, (uint64_t)camera->height)};
}

static sf_status make_ray(void *user, uint64_t index, fx_ray *ray)
{
  const audit *a = user;
  place p = ray_place(a, index);
  return sf_pixel_ray(&a->scene, &a->data, &a->data.view[p.view], p.x, p.y, ray);
}

static bool tick(void *user, uint64_t done)
{
  audit *a = user;
  double elapsed = sf_seconds() - a->start;
  if (sf_progress_due(&a->progress) && done > 0)
    sf_progress_show(&a->progress, "core: %" PRIu64 " of %" PRIu64 " rays, ETA %.0f s", done, a->report.rays,
                     elapsed * (double)(a->report.rays - done) / (double)done);
  return !sf_cli_interrupted();
}

static sf_status load(audit *a)
{
  options *o = &a->opt;
  SF_TRY(fx_scene_load(&a->scene, o->scene));
  SF_TRY(sf_sha256_file(o->scene, a->hash));
  /* Random rays come from every view unless one is named; whole views are many rays, so one is the default. */
  if (o->views == 0 && o->view < 0 && o->rays == 0) o->views = 1;
  sf_dataset_options how = {
      .downscale = o->downscale, .scale = (float)o->scale, .limit = o->view >= 0 ? o->view + 1 : o->views};
  SF_TRY(sf_dataset_load(&a->data, o->data, o->split, &how));
  if (o->view >= a->data.count || o->views > a->data.count)
    return sf_fail(SF_E_USAGE, "%s %d is out of range: %s has %d %s views", o->view >= 0 ? "--view" : "--views",
                   o->view >= 0 ? o->view : o->views, o->data, a->data.count, o->split);
  const sf_camera *first = &a->data.view[0].camera;
  for (int i = 1; i < a->data.count; i++)
    if (a->data.view[i].camera.width != first->width || a->data.view[i].camera.height != first->height)
      return sf_fail(SF_E_FORMAT, "%s: view %s differs in size from view %s", o->data, a->data.view[i].name,
                     a->data.view[0].name);
  a->pixels = (uint64_t)first->width * (uint64_t)first->height;
  a->report.rays = o->rays ? o->rays : a->pixels * (uint64_t)(o->view >= 0 ? 1 : a->data.count);
  sf_audit_report *r = &a->report;
  r->scene = o->scene, r->data = o->data, r->split = o->split, r->sha256 = a->hash, r->net = &a->scene.net;
  r->seed = o->seed, r->random_rays = o->rays > 0, r->three.wanted = o->rtl_rays;
  r->views = (double)r->rays / (double)a->pixels;
  return sf_ok();
}

/* ---- the subset for the accelerator ---- */

/* The rays with samples whose random keys are smallest: seeded, without repetition, whatever the threads. */
static sf_status choose_subset(audit *a)
{
  int limit = a->report.three.wanted, n = 0;
  uint64_t *key = calloc((size_t)limit + 1, sizeof *key), *ray = calloc((size_t)limit + 1, sizeof *ray);
  a->subset = ray;
  if (!key || !ray) {
    free(key);
    return sf_fail(SF_E_MEMORY, "no memory for %d rays", limit);
  }
  for (uint64_t i = 0; i < a->report.rays && limit > 0; i++) {
    if (!(a->report.measure.hit[i / 8] >> i % 8 & 1)) continue;
    uint64_t k = sf_random_u64(a->opt.seed, STREAM_SUBSET, i);
    if (n == limit && k >= key[n - 1]) continue;
    int at = n < limit ? n++ : n - 1;
    for (; at > 0 && key[at - 1] > k; at--) key[at] = key[at - 1], ray[at] = ray[at - 1];
    key[at] = k, ray[at] = i;
  }
  free(key);
  a->report.three.rays = n;
  return sf_ok();
}

typedef struct rtl_eval {
  sf_dut *dut;
  sf_probe core;
  sf_dut_result result;
  bool check_counters; /* after every sample: only to find the sample of a difference, it is slow */
} rtl_eval;

static sf_status compare_outputs(const fx_out *core, const fx_out *rtl)
{
  static const char *const name[4] = {"density", "red", "green", "blue"};
  const uint32_t x[4] = {core->sigma, core->colour[0], core->colour[1], core->colour[2]};
  const uint32_t y[4] = {rtl->sigma, rtl->colour[0], rtl->colour[1], rtl->colour[2]};
  for (int i = 0; i < 4; i++)
    if (x[i] != y[i]) return sf_fail(SF_E_DIFFERENCE, "%s: core %u, accelerator %u", name[i], x[i], y[i]);
  return sf_ok();
}

static sf_status compare_bitmaps(const fx_net *net, const uint64_t core[SF_LAYERS][SF_T_MAX][2],
                                 const uint64_t rtl[SF_LAYERS][SF_T_MAX][2])
{
  for (int t = 0; t < net->steps; t++)
    for (int l = FX_D1; l <= FX_C2; l++)
      for (int w = 0; w < 2 && l != FX_D2; w++) {
        uint64_t difference = core[l][t][w] ^ rtl[l][t][w];
        if (!difference) continue;
        int bit = __builtin_ctzll(difference);
        return sf_fail(SF_E_DIFFERENCE, "spike of layer %s at step %d, neuron %d: core %d, accelerator %d",
                       sf_layer_names[l], t, 64 * w + bit, (int)(core[l][t][w] >> bit & 1),
                       (int)(rtl[l][t][w] >> bit & 1));
      }
  return sf_ok();
}

static sf_status compare_counters(rtl_eval *e)
{
  fx_counts rtl;
  uint64_t cycles, busy, stalls;
  SF_TRY(sf_dut_counts(e->dut, &rtl, &cycles, &busy, &stalls));
  return sf_counts_compare(&e->core.core, "core", &rtl, "accelerator");
}

static sf_status rtl_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  rtl_eval *e = user;
  sf_dut_sample sample = {.ray = ray, .first = first, .f = f};
  unsigned long long index = e->core.sample;
  fx_out core;
  SF_TRY(sf_probe_net(&e->core, ray, first, f, &core));
  SF_TRY(sf_dut_run(e->dut, &sample, 1, &e->result));
  sf_status status = compare_bitmaps(e->core.net, (const uint64_t(*)[SF_T_MAX][2])e->core.trace->spikes,
                                     (const uint64_t(*)[SF_T_MAX][2])e->result.spikes);
  if (status.code == SF_OK) status = compare_outputs(&core, &e->result.out);
  if (status.code == SF_OK && e->check_counters) status = compare_counters(e);
  *out = e->result.out;
  if (status.code != SF_E_DIFFERENCE) return status;
  return sf_fail(status.code, "sample %llu: %s", index, status.message);
}

static sf_status rtl_ray(audit *a, rtl_eval *e, uint64_t index)
{
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(make_ray(a, index, &ray));
  sf_probe_begin(&e->core);
  return fx_render_ray(&a->scene, &ray, rtl_net, e, &pixel, &e->core.core);
}

static sf_status name_ray(const audit *a, uint64_t index, sf_status status)
{
  place p = ray_place(a, index);
  return sf_fail(status.code, "ray %" PRIu64 " (view %s, pixel %d,%d): %s", index, a->data.view[p.view].name, p.x, p.y,
                 status.message);
}

/* The counters of a ray differ although outputs and spikes agree: again, with the counters read at every sample. */
static sf_status find_counter_sample(audit *a, rtl_eval *e, uint64_t index, sf_status difference)
{
  e->check_counters = true;
  SF_TRY(sf_dut_clear_counts(e->dut));
  sf_status status = rtl_ray(a, e, index);
  return name_ray(a, index, status.code == SF_E_DIFFERENCE ? status : difference);
}

static sf_status rtl_all(audit *a, rtl_eval *e)
{
  sf_three_counts *s = &a->report.three;
  SF_TRY(sf_dut_clear_counts(e->dut));
  a->start = sf_seconds();
  for (int i = 0; i < s->rays; i++) {
    if (sf_cli_interrupted())
      return sf_fail(SF_E_STOPPED, "stopped after %d of %d rays in the accelerator", i, s->rays);
    sf_status status = rtl_ray(a, e, a->subset[i]);
    if (status.code == SF_E_DIFFERENCE) return name_ray(a, a->subset[i], status);
    SF_TRY(status);
    fx_counts_add(&s->core, &e->core.core);
    fx_counts_add(&s->recount, &e->core.recount);
    SF_TRY(sf_dut_counts(e->dut, &s->rtl, &s->cycles, &s->busy, &s->stalls));
    status = sf_counts_compare(&s->core, "core", &s->rtl, "accelerator");
    if (status.code == SF_E_DIFFERENCE) return find_counter_sample(a, e, a->subset[i], status);
    if (sf_progress_due(&a->progress))
      sf_progress_show(&a->progress, "accelerator: %d of %d rays, ETA %.0f s", i + 1, s->rays,
                       (sf_seconds() - a->start) * (s->rays - i - 1) / (i + 1));
  }
  SF_TRY(sf_counts_compare(&s->core, "core", &s->recount, "recount"));
  return sf_counts_compare(&s->rtl, "accelerator", &s->recount, "recount");
}

static sf_status run_rtl(audit *a)
{
  a->report.three.agreement = sf_ok();
  SF_TRY(choose_subset(a));
  if (a->report.three.rays == 0) return sf_ok();
  rtl_eval *e = calloc(1, sizeof *e);
  fx_trace *trace = calloc(1, sizeof *trace);
  sf_dut_options how = {.seed = a->opt.seed, .stall_percent = a->opt.stall, .plusarg = a->opt.plusarg};
  sf_status status = e && trace ? sf_dut_open(&e->dut, &a->scene, &how) : sf_fail(SF_E_MEMORY, "no memory");
  if (status.code == SF_OK) {
    e->core.net = &a->scene.net, e->core.trace = trace;
    status = rtl_all(a, e);
    sf_dut_close(e->dut);
  }
  free(e), free(trace);
  if (status.code != SF_E_DIFFERENCE) return status;
  a->report.three.agreement = status; /* reported with the rest; the exit status tells */
  return sf_ok();
}

/* ---- reports ---- */

static sf_status write_csv(const audit *a)
{
  sf_writer writer;
  if (!a->opt.csv) return sf_ok();
  SF_TRY(sf_writer_open(&writer, a->opt.csv));
  sf_report_csv(writer.file, &a->scene.net, &a->report.measure.core);
  return sf_writer_commit(&writer);
}

static sf_status print_json(cJSON *json)
{
  char *text = json ? cJSON_Print(json) : NULL;
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for the report");
  puts(text);
  free(text);
  return sf_ok();
}

static sf_status print_report(const audit *a)
{
  if (a->opt.json) {
    cJSON *json = sf_report_json(&a->report);
    if (a->opt.published) cJSON_AddItemToObject(json, "published", sf_published_json());
    return print_json(json);
  }
  sf_report_print(stdout, &a->report);
  if (a->opt.published) printf("\n"), sf_published_print(stdout);
  return sf_ok();
}

/* ---- program ---- */

static sf_status count(audit *a)
{
  sf_measure_job job = {&a->scene, a->report.rays, make_ray, tick, a};
  sf_status status = sf_measure_rays(&job, &a->report.measure);
  if (status.code == SF_E_DIFFERENCE) return sf_fail(status.code, "%s: %s", a->opt.scene, status.message);
  SF_TRY(status);
  SF_TRY(sf_ledger_make(&a->scene.net, &a->report.measure.core, &a->report.ledger));
  return run_rtl(a);
}

static sf_status work(audit *a)
{
  if (!a->opt.scene) {
    if (a->opt.json) return print_json(sf_published_json());
    sf_published_print(stdout);
    return sf_ok();
  }
  double begin = sf_seconds();
  SF_TRY(load(a));
  sf_progress_begin(&a->progress, a->opt.quiet);
  a->start = sf_seconds();
  sf_status status = count(a);
  sf_progress_end(&a->progress);
  SF_TRY(status);
  a->report.seconds = sf_seconds() - begin;
  SF_TRY(write_csv(a));
  SF_TRY(print_report(a));
  if (a->report.three.agreement.code == SF_OK) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "%s: %s", a->opt.scene, a->report.three.agreement.message);
}

static sf_status parse(int argc, char **argv, options *o, sf_cli *cli)
{
  const sf_option table[] = {
      {"--views", 0, SF_ARG_INT, &o->views, 1, 1 << 20, NULL, "N", "all pixels of the first N views (default 1)"},
      {"--view", 0, SF_ARG_INT, &o->view, 0, 1 << 20, NULL, "K", "all pixels of view K alone"},
      {"--rays", 0, SF_ARG_U64, &o->rays, 1, 1e9, NULL, "N", "N random rays instead of all pixels"},
      {"--rtl-rays", 0, SF_ARG_INT, &o->rtl_rays, 0, 1 << 20, NULL, "N", "rays for the accelerator too (default 32)"},
      {"--seed", 0, SF_ARG_U64, &o->seed, 0, 0, NULL, "S", "of the random choices (default 1)"},
      {"--stall", 0, SF_ARG_INT, &o->stall, 0, 90, NULL, "PERCENT", "bubbles and back-pressure (default 0)"},
      {"--split", 0, SF_ARG_STRING, &o->split, 0, 0, NULL, "NAME", "train or test (default test)"},
      {"--downscale", 0, SF_ARG_INT, &o->downscale, 1, 64, NULL, "N", "shrink the views by N (default 1)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the layout's (default 0)"},
      {"--csv", 0, SF_ARG_STRING, &o->csv, 0, 0, NULL, "FILE", "write the counts per layer and step"},
      {"--published", 0, SF_ARG_FLAG, &o->published, 0, 0, NULL, NULL, "recompute the paper's energy tables"},
      {"--plusarg", 0, SF_ARG_STRING, &o->plusarg, 0, 0, NULL, "TEXT", "passed to the simulation"},
      {"--threads", 0, SF_ARG_INT, &o->threads, 1, 1024, NULL, "N", "default: all processors"},
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      {0}};
  const char *positional[2];
  cli->options = table;
  sf_status status = sf_cli_parse(cli, argc, argv, positional);
  cli->options = NULL;
  SF_TRY(status);
  o->scene = positional[0], o->data = positional[1];
  if (o->scene && !o->data) return sf_fail(SF_E_USAGE, "missing argument DATA; usage: %s", cli->usage);
  if (!o->scene && !o->published) return sf_fail(SF_E_USAGE, "missing argument; usage: %s", cli->usage);
  if (o->view >= 0 && o->views > 0) return sf_fail(SF_E_USAGE, "--view and --views exclude each other");
  return sf_ok();
}

int main(int argc, char **argv)
{
  sf_cli cli = {.program = "energy_audit",
                .usage = "energy_audit scene.snn DATA [options]",
                .summary =
                    "Counts every operation of a scene in the fixed-point core, in the accelerator and again from the\n"
                    "spike bitmaps; prices the counts and the scene's ANN twin. Exit status 1 if any count differs.",
                .examples = "  energy_audit scene.snn data --views 2 --json\n"
                            "  energy_audit --published\n",
                .min_positional = 0,
                .max_positional = 2};
  audit *a = calloc(1, sizeof *a);
  if (!a) return sf_cli_finish(&cli, sf_fail(SF_E_MEMORY, "no memory"));
  a->opt = (options){.view = -1, .downscale = 1, .rtl_rays = RTL_RAYS, .split = "test", .seed = 1};
  sf_status status = parse(argc, argv, &a->opt, &cli);
  if (status.code == SF_OK) {
    if (a->opt.threads) omp_set_num_threads(a->opt.threads);
    sf_cli_catch_signals();
    status = work(a);
  }
  sf_measure_free(&a->report.measure);
  free(a->subset);
  sf_dataset_free(&a->data);
  fx_scene_free(&a->scene);
  free(a);
  return sf_cli_finish(&cli, status);
}
