/* sim_render: one view of a scene through the float field, the fixed-point core or the accelerator. */
#include "spikefield/cli.h"
#include "spikefield/dut.h"
#include "spikefield/golden.h"
#include "spikefield/io.h"
#include "spikefield/model.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { BACKEND_FLOAT, BACKEND_FIXED, BACKEND_RTL };
static const char *const backend_name[] = {"float", "fixed", "rtl"};
enum { RTL_CROP = 16 };

typedef struct options {
  int view, backend, downscale, steps, threads;
  uint64_t seed;
  double scale;
  const char *scene, *data, *exr, *png, *model, *split, *crop;
  bool json, quiet;
} options;

typedef struct window {
  int x, y, width, height;
} window;

typedef struct job {
  options opt;
  fx_scene scene;
  sf_dataset data;
  const sf_view *view;
  window crop;
  char hash[65], beside[4096]; /* SHA-256 of the scene; the default model */
  double step_length;          /* between samples, world units */
  float background[3];
  sf_golden golden;
  sf_render_report report;
  sf_progress progress;
  double start;
} job;

/* ---- what to render ---- */

static sf_status read_number(const char **text, char stop, int *value)
{
  char *end;
  long n = strtol(*text, &end, 10);
  if (end == *text || **text < '0' || **text > '9' || *end != stop || n > 1 << 24)
    return sf_fail(SF_E_USAGE, "--crop expects X,Y,WIDTH,HEIGHT in whole pixels");
  *value = (int)n;
  *text = end + (stop != 0);
  return sf_ok();
}

static sf_status choose_crop(job *j)
{
  const sf_camera *camera = &j->view->camera;
  j->crop = (window){0, 0, camera->width, camera->height};
  if (!j->opt.crop) {
    if (j->opt.backend != BACKEND_RTL) return sf_ok();
    int w = camera->width < RTL_CROP ? camera->width : RTL_CROP,
        h = camera->height < RTL_CROP ? camera->height : RTL_CROP;
    j->crop = (window){(camera->width - w) / 2, (camera->height - h) / 2, w, h};
    j->report.crop_chosen = true;
    return sf_ok();
  }
  const char *text = j->opt.crop;
  window c;
  SF_TRY(read_number(&text, ',', &c.x));
  SF_TRY(read_number(&text, ',', &c.y));
  SF_TRY(read_number(&text, ',', &c.width));
  SF_TRY(read_number(&text, 0, &c.height));
  if (c.width < 1 || c.height < 1 || c.x + c.width > camera->width || c.y + c.height > camera->height)
    return sf_fail(SF_E_USAGE, "--crop %.60s is out of range: the view has %d x %d pixels", j->opt.crop, camera->width,
                   camera->height);
  j->crop = c;
  return sf_ok();
}

/* Fails before the work, not after it, when a result could not be written. */
static sf_status check_writable(const char *path)
{
  sf_writer writer;
  if (!path) return sf_ok();
  SF_TRY(sf_writer_open(&writer, path));
  sf_writer_abort(&writer);
  return sf_ok();
}

static sf_status load(job *j)
{
  SF_TRY(fx_scene_load(&j->scene, j->opt.scene));
  SF_TRY(sf_sha256_file(j->opt.scene, j->hash));
  if (j->opt.steps) j->scene.net.steps = j->opt.steps;
  sf_dataset_options how = {.downscale = j->opt.downscale, .scale = (float)j->opt.scale, .limit = j->opt.view + 1};
  SF_TRY(sf_dataset_load(&j->data, j->opt.data, j->opt.split, &how));
  if (j->opt.view >= j->data.count)
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s has %d %s views", j->opt.view, j->opt.data, j->data.count,
                   j->opt.split);
  j->view = &j->data.view[j->opt.view];
  j->step_length = j->scene.step_q24 / 16777216.0 / j->scene.to_box_scale / (double)j->data.scale;
  for (int c = 0; c < 3; c++) j->background[c] = (float)j->scene.background[c] / 65536;
  SF_TRY(choose_crop(j));
  SF_TRY(check_writable(j->opt.exr));
  SF_TRY(check_writable(j->opt.png));
  j->report.scene = j->opt.scene, j->report.sha256 = j->hash, j->report.view = j->view->name;
  j->report.backend = backend_name[j->opt.backend], j->report.exr = j->opt.exr, j->report.png = j->opt.png;
  j->report.net = &j->scene.net, j->report.events = j->opt.backend != BACKEND_FLOAT;
  memcpy(j->report.crop, (const int[4]){j->crop.x, j->crop.y, j->crop.width, j->crop.height}, sizeof j->report.crop);
  j->report.psnr = j->report.ssim = NAN;
  int planes = j->opt.backend == BACKEND_FLOAT ? SF_FLOAT_PLANES : SF_PLANES;
  return sf_golden_create(&j->golden, j->crop.width, j->crop.height, planes);
}

/* ---- progress ---- */

static void show_progress(job *j, size_t done)
{
  size_t all = (size_t)j->crop.width * (size_t)j->crop.height;
  double elapsed = sf_seconds() - j->start;
  if (done == 0 || !sf_progress_due(&j->progress)) return;
  sf_progress_show(&j->progress, "%s: %zu of %zu pixels, %.0f pixels/s, ETA %.0f s", backend_name[j->opt.backend], done,
                   all, (double)done / elapsed, elapsed * (double)(all - done) / (double)done);
}

static sf_status stopped(void)
{
  return sf_fail(SF_E_STOPPED, "stopped; nothing was written");
}

/* ---- float ---- */

static sf_status float_rows(job *j, const sf_model *model, int y, int rows, float *space)
{
  size_t width = (size_t)j->crop.width, n = width * (size_t)rows, first = width * (size_t)y;
  float *origin = space, *direction = origin + 3 * n, *rgb = direction + 3 * n, *depth = rgb + 3 * n,
        *alpha = depth + n, *samples = alpha + n;
  for (size_t i = 0; i < n; i++) {
    float px = (float)(j->crop.x + (int)(i % width)) + 0.5f, py = (float)(j->crop.y + y + (int)(i / width)) + 0.5f;
    sf_camera_ray(&j->view->camera, px, py, origin + 3 * i, direction + 3 * i);
  }
  SF_TRY(sf_render_rays(model, origin, direction, n, j->scene.net.steps, j->background, rgb, depth, alpha, samples));
  for (size_t i = 0; i < n; i++) {
    for (int c = 0; c < 3; c++) sf_golden_real(&j->golden, SF_PLANE_R + c)[first + i] = rgb[3 * i + (size_t)c];
    sf_golden_real(&j->golden, SF_PLANE_A)[first + i] = alpha[i];
    sf_golden_real(&j->golden, SF_PLANE_Z)[first + i] = alpha[i] > 0 ? depth[i] / alpha[i] / j->data.scale : 0;
    sf_golden_int(&j->golden, SF_PLANE_SAMPLES)[first + i] = (uint32_t)samples[i];
    j->report.counts.samples += (uint64_t)samples[i];
    j->report.counts.rays += samples[i] > 0;
  }
  return sf_ok();
}

static sf_status float_batches(job *j, const sf_model *model)
{
  enum { BATCH = 4096, FLOATS_PER_RAY = 12 };
  if (model->config.scale != j->data.scale)
    return sf_fail(SF_E_RANGE, "%s: trained at scale %g, %s is read at %g; give --scale %.9g", j->opt.model,
                   (double)model->config.scale, j->opt.data, (double)j->data.scale, (double)model->config.scale);
  if (j->scene.net.steps > model->config.steps)
    return sf_fail(SF_E_RANGE, "%s: the model has %d time steps, %d are asked for", j->opt.model, model->config.steps,
                   j->scene.net.steps);
  int rows = j->crop.width >= BATCH ? 1 : BATCH / j->crop.width;
  if (rows > j->crop.height) rows = j->crop.height;
  float *space = malloc((size_t)rows * (size_t)j->crop.width * FLOATS_PER_RAY * sizeof *space);
  if (!space) return sf_fail(SF_E_MEMORY, "no memory for a batch of %d rows", rows);
  sf_status status = sf_ok();
  for (int y = 0; y < j->crop.height && status.code == SF_OK; y += rows) {
    int n = j->crop.height - y < rows ? j->crop.height - y : rows;
    status = sf_cli_interrupted() ? stopped() : float_rows(j, model, y, n, space);
    show_progress(j, (size_t)(y + n) * (size_t)j->crop.width);
  }
  free(space);
  return status;
}

static sf_status render_float(job *j)
{
  if (!j->opt.model) {
    const char *slash = strrchr(j->opt.scene, '/');
    int folder = slash ? (int)(slash - j->opt.scene) + 1 : 0;
    snprintf(j->beside, sizeof j->beside, "%.*smodel.safetensors", folder, j->opt.scene);
    j->opt.model = j->beside;
  }
  sf_model model;
  SF_TRY(sf_model_load(&model, j->opt.model));
  sf_status status = float_batches(j, &model);
  sf_model_free(&model);
  return status;
}

/* ---- fixed ---- */

static sf_status fixed_pixel(job *j, sf_probe *probe, int x, int y)
{
  fx_ray ray;
  fx_pixel pixel;
  SF_TRY(sf_pixel_ray(&j->scene, &j->view->camera, j->crop.x + x, j->crop.y + y, &ray));
  sf_probe_begin(probe);
  SF_TRY(fx_render_ray(&j->scene, &ray, sf_probe_net, probe, &pixel, &probe->core));
  sf_golden_set(&j->golden, (size_t)y * (size_t)j->crop.width + (size_t)x, &pixel, &probe->core, j->step_length);
  return sf_ok();
}

/* Not thread-safe: callers hold the lock. */
static void add_counts(job *j, const fx_counts *counts, const uint64_t saturated_samples[SF_LAYERS])
{
  fx_counts_add(&j->report.counts, counts);
  for (int l = 0; l < SF_LAYERS; l++) j->report.saturated_samples[l] += saturated_samples[l];
}

static sf_status fixed_row(job *j, int y)
{
  sf_probe probe = {.net = &j->scene.net};
  fx_counts sum = {0};
  uint64_t saturated[SF_LAYERS] = {0};
  if (sf_cli_interrupted()) return stopped();
  for (int x = 0; x < j->crop.width; x++) {
    SF_TRY(fixed_pixel(j, &probe, x, y));
    fx_counts_add(&sum, &probe.core);
    for (int l = 0; l < SF_LAYERS; l++) saturated[l] += probe.saturated_samples[l];
  }
#pragma omp critical(sim_render)
  add_counts(j, &sum, saturated);
  return sf_ok();
}

static sf_status render_fixed(job *j)
{
  sf_status failed = sf_ok();
  int failed_row = j->crop.height;
  size_t done = 0;
#pragma omp parallel for schedule(dynamic)
  for (int y = 0; y < j->crop.height; y++) {
    sf_status status = fixed_row(j, y);
#pragma omp critical(sim_render)
    {
      if (status.code != SF_OK && y < failed_row) failed = status, failed_row = y;
      done += (size_t)j->crop.width;
      show_progress(j, done);
    }
  }
  return failed;
}

/* ---- rtl ---- */

/* The accelerator makes the picture; the core walks along so that a difference is reported at its first sample, and for
 * the saturation census, which the accelerator does not keep. */
typedef struct rtl_eval {
  sf_dut *dut;
  sf_probe core;
} rtl_eval;

static sf_status rtl_net(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  rtl_eval *e = user;
  fx_out core;
  unsigned long long sample = e->core.sample;
  SF_TRY(sf_probe_net(&e->core, ray, first, f, &core));
  SF_TRY(sf_dut_net(e->dut, ray, first, f, out));
  const uint32_t expected[4] = {core.sigma, core.colour[0], core.colour[1], core.colour[2]};
  const uint32_t actual[4] = {out->sigma, out->colour[0], out->colour[1], out->colour[2]};
  static const char *const name[4] = {"density", "red", "green", "blue"};
  for (int i = 0; i < 4; i++)
    if (expected[i] != actual[i])
      return sf_fail(SF_E_DIFFERENCE, "sample %llu: %s is %u in the core, %u in the accelerator, cycle %llu", sample,
                     name[i], expected[i], actual[i], (unsigned long long)sf_dut_cycle(e->dut));
  return sf_ok();
}

static sf_status rtl_pixel(job *j, rtl_eval *e, int x, int y)
{
  fx_ray ray;
  fx_pixel pixel;
  fx_counts rtl = {0};
  uint64_t cycles, busy, stalls;
  SF_TRY(sf_pixel_ray(&j->scene, &j->view->camera, j->crop.x + x, j->crop.y + y, &ray));
  sf_probe_begin(&e->core);
  SF_TRY(sf_dut_clear_counts(e->dut));
  SF_TRY(fx_render_ray(&j->scene, &ray, rtl_net, e, &pixel, &e->core.core));
  if (pixel.samples > 0) SF_TRY(sf_dut_counts(e->dut, &rtl, &cycles, &busy, &stalls));
  SF_TRY(sf_counts_compare(&e->core.core, "core", &rtl, "accelerator"));
  sf_golden_set(&j->golden, (size_t)y * (size_t)j->crop.width + (size_t)x, &pixel, &rtl, j->step_length);
  for (int l = 0; l < SF_LAYERS; l++) rtl.saturated[l] = e->core.core.saturated[l];
  rtl.samples = pixel.samples, rtl.rays = pixel.samples > 0;
  rtl.saturated_features = e->core.core.saturated_features;
  add_counts(j, &rtl, e->core.saturated_samples);
  return sf_ok();
}

static sf_status rtl_pixels(job *j, rtl_eval *e)
{
  size_t done = 0;
  for (int y = 0; y < j->crop.height; y++)
    for (int x = 0; x < j->crop.width; x++) {
      if (sf_cli_interrupted()) return stopped();
      sf_status status = rtl_pixel(j, e, x, y);
      if (status.code == SF_E_DIFFERENCE)
        return sf_fail(status.code, "%s: pixel (%d, %d) of view %s, %s", j->opt.scene, j->crop.x + x, j->crop.y + y,
                       j->view->name, status.message);
      if (status.code != SF_OK) return status;
      show_progress(j, ++done);
    }
  return sf_ok();
}

static sf_status render_rtl(job *j)
{
  rtl_eval e = {.core = {.net = &j->scene.net}};
  sf_dut_options how = {.seed = j->opt.seed};
  SF_TRY(sf_dut_open(&e.dut, &j->scene, &how));
  sf_status status = rtl_pixels(j, &e);
  sf_dut_close(e.dut);
  return status;
}

/* ---- results ---- */

/* Nothing here tells `fixed` from `rtl`, nor when or where it ran: equal pictures are equal files. */
static sf_status save(const job *j)
{
  char steps[16], crop[64], downscale[16], saturation[256], unexpected[64];
  snprintf(steps, sizeof steps, "%d", j->scene.net.steps);
  snprintf(crop, sizeof crop, "%d,%d,%d,%d", j->crop.x, j->crop.y, j->crop.width, j->crop.height);
  snprintf(downscale, sizeof downscale, "%d", j->opt.downscale);
  sf_saturation_census(j->report.saturated_samples, j->report.counts.saturated_features, saturation, sizeof saturation);
  sf_saturation_unexpected(&j->scene.net, j->report.saturated_samples, unexpected, sizeof unexpected);
  bool is_float = j->opt.backend == BACKEND_FLOAT;
  const char *const attributes[] = {"t_r",
                                    steps,
                                    "scene_sha256",
                                    j->hash,
                                    "view",
                                    j->view->name,
                                    "split",
                                    j->opt.split,
                                    "crop",
                                    crop,
                                    "downscale",
                                    downscale,
                                    "arithmetic",
                                    is_float ? "float" : "fixed",
                                    "Z_units",
                                    "world units of the data set, 0 = nothing hit",
                                    is_float ? NULL : "saturation",
                                    saturation,
                                    "unexpected_saturation",
                                    unexpected,
                                    NULL};
  if (j->opt.png) SF_TRY(sf_golden_save_png(&j->golden, j->opt.png));
  return sf_golden_save(&j->golden, j->opt.exr, attributes);
}

static sf_status print_report(const job *j)
{
  if (!j->opt.json) {
    sf_render_report_print(stdout, &j->report);
    return sf_ok();
  }
  cJSON *json = sf_render_report_json(&j->report);
  char *text = json ? cJSON_Print(json) : NULL;
  cJSON_Delete(json);
  if (!text) return sf_fail(SF_E_MEMORY, "no memory for the report");
  puts(text);
  free(text);
  return sf_ok();
}

static sf_status work(job *j)
{
  SF_TRY(load(j));
  sf_progress_begin(&j->progress, j->opt.quiet);
  j->start = sf_seconds();
  sf_status status = j->opt.backend == BACKEND_FLOAT   ? render_float(j)
                     : j->opt.backend == BACKEND_FIXED ? render_fixed(j)
                                                       : render_rtl(j);
  sf_progress_end(&j->progress);
  j->report.seconds = sf_seconds() - j->start;
  SF_TRY(status);
  if (j->view->image.rgba)
    SF_TRY(sf_golden_quality(&j->golden, &j->view->image, j->crop.x, j->crop.y, j->background, &j->report.psnr,
                             &j->report.ssim));
  SF_TRY(save(j));
  return print_report(j);
}

static sf_status parse(int argc, char **argv, options *o, sf_cli *cli)
{
  const sf_option table[] = {
      {"--view", 0, SF_ARG_INT, &o->view, 0, 1 << 20, NULL, "K", "which view of the split, from 0 (default 0)"},
      {"--backend", 0, SF_ARG_CHOICE, &o->backend, 0, 0, "float|fixed|rtl", "B", "arithmetic (default fixed):"},
      {"--output", 'o', SF_ARG_STRING, &o->exr, 0, 0, NULL, "FILE", "EXR to write"},
      {"--png", 0, SF_ARG_STRING, &o->png, 0, 0, NULL, "FILE", "also a PNG preview"},
      {"--crop", 0, SF_ARG_STRING, &o->crop, 0, 0, NULL, "X,Y,W,H",
       "only this window (rtl default: 16x16 in the centre)"},
      {"--steps", 0, SF_ARG_INT, &o->steps, 1, SF_T_MAX, NULL, "N", "time steps (default: the scene's t_r)"},
      {"--model", 0, SF_ARG_STRING, &o->model, 0, 0, NULL, "FILE",
       "for float (default model.safetensors beside the scene)"},
      {"--split", 0, SF_ARG_STRING, &o->split, 0, 0, NULL, "NAME", "train or test (default test)"},
      {"--downscale", 0, SF_ARG_INT, &o->downscale, 1, 64, NULL, "N", "shrink the views by N (default 1)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the layout's (default 0)"},
      {"--seed", 0, SF_ARG_U64, &o->seed, 0, 0, NULL, "S", "rtl: random reset values (default 1)"},
      {"--threads", 0, SF_ARG_INT, &o->threads, 1, 1024, NULL, "N", "default: all processors"},
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      {0}};
  const char *positional[2];
  cli->options = table;
  sf_status status = sf_cli_parse(cli, argc, argv, positional);
  cli->options = NULL;
  SF_TRY(status);
  if (!o->exr) return sf_fail(SF_E_USAGE, "-o FILE is missing");
  o->scene = positional[0], o->data = positional[1];
  return sf_ok();
}

int main(int argc, char **argv)
{
  sf_cli cli = {.program = "sim_render",
                .usage = "sim_render scene.snn DATA --view K -o golden.exr [options]",
                .summary =
                    "Renders one view through the float field, the fixed-point core or the Verilog accelerator.\n"
                    "EXR channels: R G B A, Z (mean distance, world units), samples; fixed and rtl also spikes,\n"
                    "sops, macs, energy_fJ and the raw integers fx.R fx.G fx.B fx.A fx.T.",
                .examples = "  sim_render scene.snn data --view 3 -o golden.exr --png preview.png\n"
                            "  sim_render scene.snn data --backend rtl --crop 40,40,16,16 -o rtl.exr\n",
                .min_positional = 2,
                .max_positional = 2};
  job *j = calloc(1, sizeof *j);
  if (!j) return sf_cli_finish(&cli, sf_fail(SF_E_MEMORY, "no memory"));
  j->opt = (options){.backend = BACKEND_FIXED, .downscale = 1, .split = "test", .seed = 1};
  sf_status status = parse(argc, argv, &j->opt, &cli);
  if (status.code == SF_OK) {
    if (j->opt.threads) omp_set_num_threads(j->opt.threads);
    sf_cli_catch_signals();
    status = work(j);
  }
  sf_golden_free(&j->golden);
  sf_dataset_free(&j->data);
  fx_scene_free(&j->scene);
  free(j);
  return sf_cli_finish(&cli, status);
}
