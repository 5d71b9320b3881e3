/* sim_render: views of a scene through the float field, the fixed-point core or the accelerator, simulated or on a
 * board. */
#include "sim/other_dut.h"
#include "sim/studio/view_set.h"
#include "tools/render/options.h"
#include "cli/finish_ranks.h"
#include "base/clock.h"
#include "base/io.h"
#include "base/sha256.h"
#include "base/text.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { RTL_CROP = 16 };

typedef struct job {
  render_options opt;
  sf_window crop; /* width 0: not given */
  sf_ranks *ranks;
  sf_studio studio;
  sf_progress progress;
  bool warned;
  size_t done, all; /* pixels of this run; all is an estimate while views are ahead */
  double start;
  /* one view */
  sf_shot shot;
  sf_render_report report;
  /* many views */
  sf_view_set set;
  cJSON *verdicts;
  char first[400]; /* difference */
} job;

/* ---- what to render ---- */

static sf_status choose_crop(job *j)
{
  const sf_camera *camera = &j->shot.view->camera;
  const sf_window *c = &j->crop;
  if (c->width == 0) {
    if (j->opt.backend != SF_BACKEND_RTL) return sf_ok();
    int w = camera->width < RTL_CROP ? camera->width : RTL_CROP,
        h = camera->height < RTL_CROP ? camera->height : RTL_CROP;
    j->shot.window = (sf_window){(camera->width - w) / 2, (camera->height - h) / 2, w, h};
    j->report.crop_chosen = true;
    return sf_ok();
  }
  if (c->x + c->width > camera->width || c->y + c->height > camera->height)
    return sf_fail(SF_E_USAGE, "--crop %.60s is out of range: the view has %d x %d pixels", j->opt.crop, camera->width,
                   camera->height);
  j->shot.window = *c;
  return sf_ok();
}

static sf_status open_studio(job *j)
{
  const render_options *o = &j->opt;
  const sf_studio_options how = {.backend = (sf_backend)o->backend,
                                 .kernels = o->kernels,
                                 .scene = o->scene,
                                 .data = o->data,
                                 .split = o->split,
                                 .model = o->model,
                                 .steps = o->steps,
                                 .downscale = o->downscale,
                                 .scale = (float)o->scale,
                                 .seed = o->seed,
                                 .port = o->port,
                                 .patience = o->patience};
  return sf_studio_open(&j->studio, &how);
}

static sf_status load_view(job *j)
{
  const render_options *o = &j->opt;
  SF_TRY(open_studio(j));
  if (o->camera) {
    sf_camera camera;
    SF_TRY(sf_camera_parse(o->camera, &camera));
    SF_TRY(sf_shot_from(&j->studio, &camera, &j->shot));
  } else
    SF_TRY(sf_shot_load(&j->studio, o->view, &j->shot));
  sf_dataset_warn(stderr, "sim_render", &j->shot.data, NULL);
  if (!j->shot.view)
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s has %d %s views", o->view, o->data, j->shot.data.total,
                   o->split);
  SF_TRY(choose_crop(j));
  return sf_writable(o->output);
}

/* ---- progress ---- */

/* Pixels of this process. Of several ranks, rank 0 counts views instead. */
static bool tick(void *user, size_t pixels)
{
  job *j = user;
  if (sf_ranks_size(j->ranks) > 1) return !sf_ranks_stop(j->ranks);
  j->done += pixels;
  if (sf_progress_due(&j->progress)) {
    double all = (double)j->all, done = (double)j->done, elapsed = sf_seconds() - j->start;
    char views[48] = "";
    if (j->set.todo > 0)
      snprintf(views, sizeof views, "%d of %d view%s, ", j->set.rendered, j->set.todo,
               sf_plural((uint64_t)j->set.todo));
    sf_progress_show(&j->progress, "%s: %s%.0f of %.0f pixels, %.0f pixels/s, ETA %.0f s",
                     sf_backend_names[j->opt.backend], views, done, all, done / elapsed, elapsed * (all - done) / done);
  }
  return !sf_cli_interrupted();
}

static void tick_views(void *user)
{
  job *j = user;
  const sf_view_set *set = &j->set;
  if (sf_progress_due(&j->progress))
    sf_progress_show(&j->progress, "%s: %d of %d views by %d ranks", sf_backend_names[j->opt.backend], set->rendered,
                     set->todo, sf_ranks_size(j->ranks));
}

/* Views ahead are taken to be of this view's size. */
static void begin_view(void *user, const sf_shot *shot)
{
  job *j = user;
  if (!j->warned && !sf_ranks_rank(j->ranks)) sf_dataset_warn(stderr, "sim_render", &shot->data, NULL);
  j->warned = true; /* the same for every view */
  if (sf_ranks_size(j->ranks) > 1) return;
  size_t pixels = (size_t)shot->window.width * (size_t)shot->window.height;
  j->all = j->done + pixels * (size_t)(j->set.todo - j->set.rendered);
}

static void begin_run(job *j)
{
  sf_progress_begin(&j->progress, j->opt.quiet);
  j->start = sf_seconds();
  j->studio.tick = tick, j->studio.user = j;
}

/* ---- one view ---- */

static void fill_report(job *j, double seconds)
{
  j->report.scene = j->opt.scene, j->report.sha256 = j->studio.scene_sha256, j->report.view = j->shot.view->name;
  j->report.backend = sf_backend_names[j->opt.backend], j->report.exr = j->opt.output, j->report.png = j->opt.png;
  j->report.net = &j->studio.scene.net, j->report.events = j->opt.backend != SF_BACKEND_FLOAT;
  j->report.crop = j->shot.window, j->report.psnr = j->shot.psnr, j->report.ssim = j->shot.ssim;
  j->report.golden = &j->shot.golden, j->report.seconds = seconds;
}

static sf_status render_one(job *j)
{
  SF_TRY(load_view(j));
  begin_run(j);
  j->all = (size_t)j->shot.window.width * (size_t)j->shot.window.height;
  sf_status status = sf_shot_render(&j->studio, &j->shot);
  sf_progress_end(&j->progress);
  if (status.code == SF_E_STOPPED) return sf_fail(status.code, "stopped; nothing was written");
  SF_TRY(status);
  fill_report(j, sf_seconds() - j->start);
  SF_TRY(sf_shot_save(&j->studio, &j->shot, j->opt.output));
  if (j->opt.png) SF_TRY(sf_golden_save_png(&j->shot.golden, j->opt.png));
  if (j->opt.truth) SF_TRY(sf_shot_save_truth(&j->studio, &j->shot, j->opt.truth));
  if (j->opt.json) return sf_json_print(sf_render_report_json(&j->report), true);
  sf_render_report_print(stdout, &j->report);
  return sf_ok();
}

/* ---- all views ---- */

static void begin_set(job *j)
{
  j->set.studio = &j->studio, j->set.ranks = j->ranks;
  j->set.begin = begin_view, j->set.tick = tick_views, j->set.user = j;
  begin_run(j);
}

/* SHA-256 of a file of the set, "" where there is none. */
static void hash_file(const job *j, const char *name, char hex[65])
{
  char path[4096 + 16];
  snprintf(path, sizeof path, "%s/%s", j->set.folder, name);
  if (sf_sha256_file(path, hex).code != SF_OK) hex[0] = 0;
}

/* A file that has the bytes that it had before was kept. */
static void print_files(const job *j, const char *contact, char before[2][65])
{
  char now[2][65];
  hash_file(j, SF_MANIFEST_NAME, now[0]), hash_file(j, SF_CONTACT_NAME, now[1]);
  const bool manifest = !strcmp(now[0], before[0]), picture = !strcmp(now[1], before[1]);
  printf("%s %s and ", manifest ? "kept" : "wrote", j->set.manifest_path);
  if (picture != manifest) printf("%s ", picture ? "kept" : "wrote");
  printf("%s\n", contact);
}

static sf_status render_all(job *j)
{
  SF_TRY(sf_ranks_agree(j->ranks, open_studio(j)));
  snprintf(j->set.folder, sizeof j->set.folder, "%s", j->opt.output);
  begin_set(j);
  char contact[4096 + 16], before[2][65];
  hash_file(j, SF_MANIFEST_NAME, before[0]), hash_file(j, SF_CONTACT_NAME, before[1]);
  sf_status status = sf_view_set_render(&j->set, &j->crop);
  const double seconds = sf_seconds() - j->start;
  if (sf_ranks_rank(j->ranks)) return status;
  if (status.code == SF_OK) status = sf_view_set_contact(&j->set, contact);
  sf_progress_end(&j->progress);
  SF_TRY(status);
  if (j->opt.json) {
    cJSON *json = sf_manifest_report_json(&j->set.manifest);
    sf_view_set_add_run(&j->set, seconds, json);
    return sf_json_print(json, true);
  }
  sf_manifest_report_print(stdout, &j->set.manifest);
  sf_view_set_print_run(stdout, &j->set, seconds);
  print_files(j, contact, before);
  return sf_ok();
}

/* ---- verification ---- */

static void report_verdict(void *user, const sf_verdict *v)
{
  job *j = user;
  const sf_status *bad = v->picture.code != SF_OK ? &v->picture : v->file.code != SF_OK ? &v->file : NULL;
  if (bad && !j->first[0]) snprintf(j->first, sizeof j->first, "view %.60s: %.320s", v->view->name, bad->message);
  if (j->opt.json)
    cJSON_AddItemToArray(j->verdicts, sf_verdict_json(v));
  else
    sf_verdict_print(stdout, v);
}

/* Everything that decides a picture comes from the manifest. */
static sf_status load_manifest(job *j)
{
  render_options *o = &j->opt;
  const sf_manifest_origin *origin = &j->set.manifest.origin;
  const char *slash = strrchr(o->verify, '/');
  SF_TRY(sf_manifest_load(&j->set.manifest, o->verify));
  if (origin->model_sha256[0])
    return sf_fail(SF_E_UNSUPPORTED, "%s: float pictures may differ between machines, only fixed ones can be verified",
                   o->verify);
  if (o->view >= 0 && !sf_manifest_find(&j->set.manifest, o->view))
    return sf_fail(SF_E_USAGE, "--view %d is out of range: %s lists %d of %d views", o->view, o->verify,
                   j->set.manifest.count, j->set.manifest.total);
  if (j->set.manifest.count == 0) return sf_fail(SF_E_RANGE, "%s: lists no view", o->verify);
  o->split = origin->split, o->steps = origin->steps, o->downscale = origin->downscale, o->scale = origin->scale;
  snprintf(j->set.manifest_path, sizeof j->set.manifest_path, "%s", o->verify);
  int length = slash ? (int)(slash - o->verify) : 1;
  snprintf(j->set.folder, sizeof j->set.folder, "%.*s", length, slash ? o->verify : ".");
  return sf_ok();
}

static sf_status verify(job *j)
{
  int differences = 0;
  const sf_status loaded = load_manifest(j);
  SF_TRY(sf_ranks_agree(j->ranks, loaded.code == SF_OK ? open_studio(j) : loaded));
  j->verdicts = cJSON_CreateArray();
  begin_set(j);
  sf_status status = sf_view_set_verify(&j->set, j->opt.view, report_verdict, &differences);
  sf_progress_end(&j->progress);
  SF_TRY(status);
  if (sf_ranks_rank(j->ranks)) return status;
  if (j->opt.json) {
    cJSON *json = cJSON_CreateObject();
    cJSON_AddBoolToObject(json, "ok", differences == 0);
    cJSON_AddNumberToObject(json, "differences", differences);
    cJSON_AddItemToObject(json, "view", j->verdicts);
    j->verdicts = NULL;
    sf_view_set_add_run(&j->set, sf_seconds() - j->start, json);
    SF_TRY(sf_json_print(json, true));
  } else {
    sf_view_set_print_run(stdout, &j->set, sf_seconds() - j->start);
  }
  if (differences > 0) /* each was told above, but in JSON */
    return sf_fail(SF_E_DIFFERENCE, "%s: %d of %d views differ%s%s", j->opt.verify, differences, j->set.todo,
                   j->opt.json ? "; " : "", j->opt.json ? j->first : "");
  if (!j->opt.json)
    printf("OK: %d of %d view%s as %s says\n", j->set.todo, j->set.manifest.total,
           j->set.manifest.total == 1 ? " is" : "s are", j->opt.verify);
  return sf_ok();
}

/* ---- program ---- */

static sf_status work(job *j)
{
  char faults[400] = "";
  const sf_status status = j->opt.verify ? verify(j) : j->opt.all ? render_all(j) : render_one(j);
  if (j->studio.board) sf_link_faults_text(&j->studio.board->link, faults);
  if (faults[0]) fprintf(stderr, "sim_render: %s: sent again: %s\n", j->opt.port, faults);
  return status;
}

/* 0: as many threads as processors. More are not started: they would have nothing to do, and a thread that the system
 * refuses would end the program. */
static void set_threads(int threads)
{
  const int most = omp_get_num_procs();
  if (threads) omp_set_num_threads(threads < most ? threads : most);
}

int main(int argc, char **argv)
{
  sf_cli cli = render_cli();
  job *j = calloc(1, sizeof *j);
  if (!j) return sf_cli_finish(&cli, sf_fail(SF_E_MEMORY, "no memory"));
  sf_status status = render_parse(argc, argv, &j->opt, &cli);
  if (status.code == SF_OK && j->opt.crop) status = sf_window_parse(j->opt.crop, &j->crop);
  if (status.code == SF_OK && j->opt.dut) status = sf_other_dut_run("sim_render", j->opt.dut, j->opt.dut_top, argv);
  if (status.code == SF_OK) {
    set_threads(j->opt.threads);
    sf_cli_catch_signals();
    const sf_ranks_options how = {.interrupted = sf_cli_interrupted, .argc = argc, .argv = argv};
    status = sf_ranks_open(&j->ranks, &how);
    j->opt.quiet |= sf_ranks_rank(j->ranks) > 0;
  }
  if (status.code == SF_OK) status = work(j);
  cJSON_Delete(j->verdicts);
  sf_view_set_free(&j->set);
  sf_shot_free(&j->shot);
  sf_studio_close(&j->studio);
  sf_ranks *ranks = j->ranks;
  free(j);
  return sf_cli_finish_ranks(&cli, ranks, status);
}
