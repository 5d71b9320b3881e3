/* energy_audit: every operation of a scene, counted three times, and its price. */
#include "spikefield/audit.h"
#include "spikefield/cli.h"
#include "spikefield/html.h"
#include "spikefield/io.h"
#include "spikefield/rng.h"
#include "sim/three_counts.h"
#include <inttypes.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct options {
  int view, views, downscale, threads, rtl_rays, stall, steps, steps_b;
  uint64_t rays, seed, recount_rays;
  double scale;
  const char *split, *csv, *html, *model, *plusarg, *scene, *data, *tech, *tech_b, *other;
  const char *command; /* of the page: the whole command line */
  bool json, published, quiet, compare;
} options;

enum { RTL_RAYS = 16, RECOUNT_RAYS = 1000 };
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
  sf_technology technology;
  sf_audit_report report;
  sf_page page; /* with --html */
  char model[4096];
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
  if (o->steps) a->scene.net.steps = o->steps;
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

/* ---- technology ---- */

/* A file, or the name of one of those that stand beside the program: ../share/spikefield/tech/NAME.tech. */
static sf_status load_technology(audit *a)
{
  char path[4096 + 64];
  const char *name = a->opt.tech;
  if (strchr(name, '/') || access(name, F_OK) == 0) return sf_technology_load(&a->technology, name);
  const ssize_t n = readlink("/proc/self/exe", path, 4096);
  if (n <= 0) return sf_fail(SF_E_IO, "--tech %s: /proc/self/exe: cannot find the program's folder", name);
  path[n] = 0;
  for (int up = 0; up < 2 && strrchr(path, '/'); up++) *strrchr(path, '/') = 0;
  const size_t folder = strlen(path);
  snprintf(path + folder, sizeof path - folder, "/share/spikefield/tech/%.60s.tech", name);
  return sf_technology_load(&a->technology, path);
}

/* ---- the rays for the accelerator ---- */

static void name_ray(void *user, uint64_t index, char *text, size_t size)
{
  const audit *a = user;
  const place p = ray_place(a, index);
  snprintf(text, size, "ray %" PRIu64 " (view %s, pixel %d,%d)", index, a->data.view[p.view].name, p.x, p.y);
}

static bool rtl_tick(void *user, int done)
{
  audit *a = user;
  const int rays = a->report.three.wanted;
  if (sf_progress_due(&a->progress))
    sf_progress_show(&a->progress, "accelerator: %d of %d rays, ETA %.0f s", done, rays,
                     (sf_seconds() - a->start) * (rays - done) / done);
  return !sf_cli_interrupted();
}

static sf_status run_rtl(audit *a)
{
  sf_three_counts *three = &a->report.three;
  uint64_t count = 0, *index = calloc((size_t)three->wanted + 1, sizeof *index);
  if (!index) return sf_fail(SF_E_MEMORY, "no memory for %d rays", three->wanted);
  sf_status status =
      sf_measure_choose(&a->report.measure, a->opt.seed, STREAM_SUBSET, (uint64_t)three->wanted, index, &count);
  const sf_three_job job = {.scene = &a->scene,
                            .index = index,
                            .rays = (int)count,
                            .ray = make_ray,
                            .name = name_ray,
                            .tick = rtl_tick,
                            .user = a,
                            .dut = {.seed = a->opt.seed, .stall_percent = a->opt.stall, .plusarg = a->opt.plusarg}};
  a->start = sf_seconds();
  if (status.code == SF_OK) status = sf_three_counts_run(&job, three);
  free(index);
  return status;
}

/* ---- reports ---- */

static sf_status write_csv(const audit *a)
{
  sf_writer writer;
  if (!a->opt.csv) return sf_ok();
  SF_TRY(sf_writer_open(&writer, a->opt.csv));
  sf_report_csv(writer.file, &a->report);
  return sf_writer_commit(&writer);
}

/* ---- HTML ---- */

/* The command in words that a shell reads back. */
static void join_command(char *text, size_t size, int argc, char **argv)
{
  size_t used = 0;
  for (int i = 0; i < argc && used < size; i++) {
    const bool plain = argv[i][0] && !argv[i][strcspn(argv[i], " \t\n'\"\\$`*?[]{}()<>|&;#~!")];
    const int n = snprintf(text + used, size - used, plain ? "%s%s" : "%s'%s'", i ? " " : "", argv[i]);
    used += n > 0 ? (size_t)n : 0;
  }
}

static bool page_tick(void *user, int done, int total)
{
  audit *a = user;
  if (sf_progress_due(&a->progress)) sf_progress_show(&a->progress, "pictures of the report: %d of %d", done, total);
  return !sf_cli_interrupted();
}

/* The float model: the one named, or model.safetensors beside the scene where it is there. */
static const char *find_model(audit *a)
{
  const char *slash = strrchr(a->opt.scene, '/');
  if (a->opt.model) return a->opt.model;
  snprintf(a->model, sizeof a->model, "%.*smodel.safetensors", slash ? (int)(slash - a->opt.scene) + 1 : 0,
           a->opt.scene);
  return access(a->model, R_OK) == 0 ? a->model : NULL;
}

static sf_status make_page(audit *a)
{
  const options *o = &a->opt;
  if (!o->html) return sf_ok();
  a->page.report = &a->report, a->page.scene = &a->scene, a->page.view = &a->data.view[o->view >= 0 ? o->view : 0];
  a->page.data = &a->data, a->page.model = find_model(a), a->page.command = o->command;
  a->page.whole = o->rays == 0 && (o->view >= 0 || a->data.count == 1);
  a->page.tick = page_tick, a->page.user = a;
  sf_progress_begin(&a->progress, o->quiet);
  const sf_status status = sf_page_gather(&a->page);
  sf_progress_end(&a->progress);
  SF_TRY(status);
  return sf_page_save(&a->page, o->html);
}

/* Fails before the work, not after it. */
static sf_status check_writable(const char *path)
{
  sf_writer writer;
  if (!path) return sf_ok();
  SF_TRY(sf_writer_open(&writer, path));
  sf_writer_abort(&writer);
  return sf_ok();
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
    cJSON *json = a->opt.html ? sf_page_json(&a->page) : sf_report_json(&a->report);
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
  sf_audit_report *r = &a->report;
  const sf_measure_job job = {&a->scene, r->rays, make_ray, tick, a, a->opt.seed, a->opt.recount_rays};
  const sf_status status = sf_measure_rays(&job, &r->measure);
  if (status.code == SF_E_DIFFERENCE) return sf_fail(status.code, "%s: %s", a->opt.scene, status.message);
  SF_TRY(status);
  const fx_counts *counts = &r->measure.core;
  SF_TRY(sf_ledger_make(&a->scene.net, counts, &r->ledger));
  r->traffic = sf_traffic_of(counts, r->rays);
  SF_TRY(sf_ledgers_make(&a->technology, &a->scene.net, counts, &r->traffic, sf_table_size(&a->scene), &r->ledgers));
  return run_rtl(a);
}

static sf_status run(audit *a)
{
  const double begin = sf_seconds();
  SF_TRY(load_technology(a));
  SF_TRY(load(a));
  SF_TRY(check_writable(a->opt.html));
  sf_progress_begin(&a->progress, a->opt.quiet);
  a->start = sf_seconds();
  const sf_status status = count(a);
  sf_progress_end(&a->progress);
  a->report.seconds = sf_seconds() - begin;
  return status;
}

static void close_audit(audit *a)
{
  sf_page_free(&a->page);
  sf_measure_free(&a->report.measure);
  sf_dataset_free(&a->data);
  fx_scene_free(&a->scene);
  free(a);
}

static sf_status open_audit(audit **a, const options *opt)
{
  *a = calloc(1, sizeof **a);
  if (!*a) return sf_fail(SF_E_MEMORY, "no memory");
  (*a)->opt = *opt;
  return sf_ok();
}

static sf_status audit_scene(const options *opt)
{
  audit *a;
  SF_TRY(open_audit(&a, opt));
  sf_status status = run(a);
  if (status.code == SF_OK) status = write_csv(a);
  if (status.code == SF_OK) status = make_page(a);
  if (status.code == SF_OK) status = print_report(a);
  if (status.code == SF_OK && a->report.three.agreement.code != SF_OK)
    status = sf_fail(SF_E_DIFFERENCE, "%s: %s", opt->scene, a->report.three.agreement.message);
  close_audit(a);
  return status;
}

/* ---- comparison ---- */

static bool is_report(const char *path)
{
  const size_t n = strlen(path);
  return n > 5 && !strcmp(path + n - 5, ".json");
}

/* Through text, as a file would hold it: the report's integers are raw digits in memory. */
static sf_status report_as_read(const audit *a, cJSON **json)
{
  cJSON *made = sf_report_json(&a->report);
  char *text = made ? cJSON_PrintUnformatted(made) : NULL;
  *json = text ? cJSON_Parse(text) : NULL;
  cJSON_Delete(made);
  free(text);
  return *json ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for the report");
}

/* One side: a report, or a scene that is audited now. */
static sf_status side(const options *opt, cJSON **json)
{
  if (is_report(opt->scene)) return sf_json_load(opt->scene, json);
  audit *a;
  SF_TRY(open_audit(&a, opt));
  sf_status status = run(a);
  if (status.code == SF_OK) status = a->report.three.agreement;
  if (status.code == SF_OK) status = report_as_read(a, json);
  close_audit(a);
  return status;
}

static sf_status compare(const options *opt)
{
  cJSON *a = NULL, *b = NULL, *comparison = NULL;
  options other = *opt;
  other.scene = opt->other;
  if (opt->tech_b) other.tech = opt->tech_b;
  if (opt->steps_b) other.steps = opt->steps_b;
  sf_status status = side(opt, &a);
  if (status.code == SF_OK) status = side(&other, &b);
  if (status.code == SF_OK) status = sf_audits_compare(a, opt->scene, b, other.scene, &comparison);
  cJSON_Delete(a), cJSON_Delete(b);
  SF_TRY(status);
  if (opt->json) return print_json(comparison);
  sf_comparison_print(stdout, comparison);
  cJSON_Delete(comparison);
  return sf_ok();
}

static sf_status work(const options *opt)
{
  if (opt->compare) return compare(opt);
  if (opt->scene) return audit_scene(opt);
  if (opt->json) return print_json(sf_published_json());
  sf_published_print(stdout);
  return sf_ok();
}

static sf_status parse_comparison(options *o, const char *const positional[3])
{
  static const char usage[] = "energy_audit --compare A B [DATA]";
  o->other = positional[1], o->data = positional[2];
  if (!o->scene || !o->other) return sf_fail(SF_E_USAGE, "--compare needs two arguments; usage: %s", usage);
  if (!o->data && !(is_report(o->scene) && is_report(o->other)))
    return sf_fail(SF_E_USAGE, "--compare of scenes needs DATA; usage: %s", usage);
  if (o->csv || o->html || o->published)
    return sf_fail(SF_E_USAGE, "--compare and %s exclude each other",
                   o->csv    ? "--csv"
                   : o->html ? "--html"
                             : "--published");
  return sf_ok();
}

static sf_status parse(int argc, char **argv, options *o, sf_cli *cli)
{
  const sf_option table[] = {
      {"--views", 0, SF_ARG_INT, &o->views, 1, 1 << 20, NULL, "N", "all pixels of the first N views (default 1)"},
      {"--view", 0, SF_ARG_INT, &o->view, 0, 1 << 20, NULL, "K", "all pixels of view K alone"},
      {"--rays", 0, SF_ARG_U64, &o->rays, 1, 1e9, NULL, "N", "N random rays instead of all pixels"},
      {"--rtl-rays", 0, SF_ARG_INT, &o->rtl_rays, 0, 1 << 20, NULL, "N", "rays for the accelerator too (default 16)"},
      {"--recount-rays", 0, SF_ARG_U64, &o->recount_rays, 0, 1e9, NULL, "N",
       "rays recounted from their spike bitmaps (default 1000)"},
      {"--steps", 0, SF_ARG_INT, &o->steps, 1, SF_T_MAX, NULL, "N", "time steps in place of the scene's t_r"},
      {"--tech", 0, SF_ARG_STRING, &o->tech, 0, 0, NULL, "FILE", "prices: a file or a name (default 45nm)"},
      {"--seed", 0, SF_ARG_U64, &o->seed, 0, 0, NULL, "S", "of the random choices (default 1)"},
      {"--stall", 0, SF_ARG_INT, &o->stall, 0, 90, NULL, "PERCENT", "bubbles and back-pressure (default 0)"},
      {"--split", 0, SF_ARG_STRING, &o->split, 0, 0, NULL, "NAME", "train or test (default test)"},
      {"--downscale", 0, SF_ARG_INT, &o->downscale, 1, 64, NULL, "N", "shrink the views by N (default 1)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the layout's (default 0)"},
      {"--csv", 0, SF_ARG_STRING, &o->csv, 0, 0, NULL, "FILE", "write the counts per layer and step"},
      {"--html", 0, SF_ARG_STRING, &o->html, 0, 0, NULL, "FILE", "write the report as one self-contained page"},
      {"--model", 0, SF_ARG_STRING, &o->model, 0, 0, NULL, "FILE",
       "float model, for its PSNR in the page (default: model.safetensors beside the scene, if there)"},
      {"--compare", 0, SF_ARG_FLAG, &o->compare, 0, 0, NULL, NULL,
       "A B [DATA]: two reports (.json) or scenes, what changed"},
      {"--tech-b", 0, SF_ARG_STRING, &o->tech_b, 0, 0, NULL, "FILE", "prices of B (default: those of A)"},
      {"--steps-b", 0, SF_ARG_INT, &o->steps_b, 1, SF_T_MAX, NULL, "N", "time steps of B (default: as A)"},
      {"--published", 0, SF_ARG_FLAG, &o->published, 0, 0, NULL, NULL, "recompute the paper's energy tables"},
      {"--plusarg", 0, SF_ARG_STRING, &o->plusarg, 0, 0, NULL, "TEXT", "passed to the simulation"},
      {"--threads", 0, SF_ARG_INT, &o->threads, 1, 1024, NULL, "N", "default: all processors"},
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      {0}};
  const char *positional[3];
  cli->options = table;
  sf_status status = sf_cli_parse(cli, argc, argv, positional);
  cli->options = NULL;
  SF_TRY(status);
  o->scene = positional[0], o->data = positional[1];
  if (o->view >= 0 && o->views > 0) return sf_fail(SF_E_USAGE, "--view and --views exclude each other");
  if (o->compare) return parse_comparison(o, positional);
  if (positional[2]) return sf_fail(SF_E_USAGE, "unexpected argument %s; usage: %s", positional[2], cli->usage);
  if (o->tech_b || o->steps_b)
    return sf_fail(SF_E_USAGE, "%s goes with --compare", o->tech_b ? "--tech-b" : "--steps-b");
  if (o->scene && !o->data) return sf_fail(SF_E_USAGE, "missing argument DATA; usage: %s", cli->usage);
  if (!o->scene && !o->published) return sf_fail(SF_E_USAGE, "missing argument; usage: %s", cli->usage);
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
                            "  energy_audit scene.snn data --view 0 --html report.html\n"
                            "  energy_audit scene.snn data --tech my.tech --csv counts.csv\n"
                            "  energy_audit --compare a.json b.json\n"
                            "  energy_audit --compare scene.snn scene.snn data --steps 2 --steps-b 1\n"
                            "  energy_audit --published\n",
                .min_positional = 0,
                .max_positional = 3};
  options opt = {.view = -1,
                 .downscale = 1,
                 .rtl_rays = RTL_RAYS,
                 .recount_rays = RECOUNT_RAYS,
                 .tech = "45nm",
                 .split = "test",
                 .seed = 1};
  sf_status status = parse(argc, argv, &opt, &cli);
  if (status.code == SF_OK) {
    char command[4096];
    join_command(command, sizeof command, argc, argv);
    opt.command = command;
    if (opt.threads) omp_set_num_threads(opt.threads);
    sf_cli_catch_signals();
    status = work(&opt);
  }
  return sf_cli_finish(&cli, status);
}
