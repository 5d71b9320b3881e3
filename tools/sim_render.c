/* sim_render: one view of a scene through the float field, the fixed-point core or the accelerator. */
#include "sim/studio.h"
#include "spikefield/cli.h"
#include "spikefield/io.h"
#include <omp.h>
#include <stdlib.h>

enum { RTL_CROP = 16 };

typedef struct options {
  int view, backend, downscale, steps, threads;
  uint64_t seed;
  double scale;
  const char *scene, *data, *exr, *png, *model, *split, *crop;
  bool json, quiet;
} options;

typedef struct job {
  options opt;
  sf_studio studio;
  sf_shot shot;
  sf_render_report report;
  sf_progress progress;
  size_t done; /* pixels */
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
  const sf_camera *camera = &j->shot.view->camera;
  if (!j->opt.crop) {
    if (j->opt.backend != SF_BACKEND_RTL) return sf_ok();
    int w = camera->width < RTL_CROP ? camera->width : RTL_CROP,
        h = camera->height < RTL_CROP ? camera->height : RTL_CROP;
    j->shot.window = (sf_window){(camera->width - w) / 2, (camera->height - h) / 2, w, h};
    j->report.crop_chosen = true;
    return sf_ok();
  }
  const char *text = j->opt.crop;
  sf_window c;
  SF_TRY(read_number(&text, ',', &c.x));
  SF_TRY(read_number(&text, ',', &c.y));
  SF_TRY(read_number(&text, ',', &c.width));
  SF_TRY(read_number(&text, 0, &c.height));
  if (c.width < 1 || c.height < 1 || c.x + c.width > camera->width || c.y + c.height > camera->height)
    return sf_fail(SF_E_USAGE, "--crop %.60s is out of range: the view has %d x %d pixels", j->opt.crop, camera->width,
                   camera->height);
  j->shot.window = c;
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
  const options *o = &j->opt;
  SF_TRY(sf_studio_open(&j->studio, &(sf_studio_options){.backend = (sf_backend)o->backend,
                                                         .scene = o->scene,
                                                         .data = o->data,
                                                         .split = o->split,
                                                         .model = o->model,
                                                         .steps = o->steps,
                                                         .downscale = o->downscale,
                                                         .scale = (float)o->scale,
                                                         .seed = o->seed}));
  SF_TRY(sf_shot_load(&j->studio, o->view, &j->shot));
  if (!j->shot.view)
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s has %d %s views", o->view, o->data, j->shot.data.total,
                   o->split);
  SF_TRY(choose_crop(j));
  SF_TRY(check_writable(o->exr));
  return check_writable(o->png);
}

/* ---- progress ---- */

static bool tick(void *user, size_t pixels)
{
  job *j = user;
  j->done += pixels;
  if (sf_progress_due(&j->progress)) {
    double all = (double)j->shot.window.width * j->shot.window.height, done = (double)j->done;
    double elapsed = sf_seconds() - j->start;
    sf_progress_show(&j->progress, "%s: %.0f of %.0f pixels, %.0f pixels/s, ETA %.0f s",
                     sf_backend_names[j->opt.backend], done, all, done / elapsed, elapsed * (all - done) / done);
  }
  return !sf_cli_interrupted();
}

/* ---- results ---- */

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

static void fill_report(job *j, double seconds)
{
  j->report.scene = j->opt.scene, j->report.sha256 = j->studio.scene_sha256, j->report.view = j->shot.view->name;
  j->report.backend = sf_backend_names[j->opt.backend], j->report.exr = j->opt.exr, j->report.png = j->opt.png;
  j->report.net = &j->studio.scene.net, j->report.events = j->opt.backend != SF_BACKEND_FLOAT;
  j->report.crop = j->shot.window, j->report.psnr = j->shot.psnr, j->report.ssim = j->shot.ssim;
  j->report.golden = &j->shot.golden, j->report.seconds = seconds;
}

static sf_status work(job *j)
{
  SF_TRY(load(j));
  sf_progress_begin(&j->progress, j->opt.quiet);
  j->start = sf_seconds();
  j->studio.tick = tick, j->studio.user = j;
  sf_status status = sf_shot_render(&j->studio, &j->shot);
  sf_progress_end(&j->progress);
  if (status.code == SF_E_STOPPED) return sf_fail(status.code, "stopped; nothing was written");
  SF_TRY(status);
  fill_report(j, sf_seconds() - j->start);
  if (j->opt.png) SF_TRY(sf_golden_save_png(&j->shot.golden, j->opt.png));
  SF_TRY(sf_shot_save(&j->studio, &j->shot, j->opt.exr));
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
  j->opt = (options){.backend = SF_BACKEND_FIXED, .downscale = 1, .split = "test", .seed = 1};
  sf_status status = parse(argc, argv, &j->opt, &cli);
  if (status.code == SF_OK) {
    if (j->opt.threads) omp_set_num_threads(j->opt.threads);
    sf_cli_catch_signals();
    status = work(j);
  }
  sf_shot_free(&j->shot);
  sf_studio_close(&j->studio);
  free(j);
  return sf_cli_finish(&cli, status);
}
