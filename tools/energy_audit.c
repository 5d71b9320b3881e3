/* energy_audit: every operation of a scene, counted three times, and its price. */
#include "energy/energy.h"
#include "report/plot.h"
#include "cli/finish_ranks.h"
#include "base/clock.h"
#include "page/page.h"
#include "base/io.h"
#include "sim/plusarg.h"
#include "sim/studio/audit_run.h"
#include <inttypes.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct options {
  sf_audit_options audit;
  int threads, steps_b;
  const char *csv, *html, *model, *tech_b, *other, *plot;
  const char *command; /* of the page: the whole command line */
  bool json, published, quiet, compare;
} options;

enum { RTL_RAYS = 16, RECOUNT_RAYS = 1000 };
typedef struct page_audit {
  options opt;
  sf_audit audit;
  sf_page page; /* with --html */
  char model[4096];
  sf_progress progress;
  const char *what; /* is going on */
  double start;     /* when it began */
} page_audit;

/* ---- progress ---- */

static bool tick(void *user, const char *what, uint64_t done, uint64_t total)
{
  page_audit *a = user;
  if (a->what != what) a->what = what, a->start = sf_seconds();
  if (sf_progress_due(&a->progress) && done > 0)
    sf_progress_show(&a->progress, "%s: %" PRIu64 " of %" PRIu64 " rays, ETA %.0f s", what, done, total,
                     (sf_seconds() - a->start) * (double)(total - done) / (double)done);
  return !sf_cli_interrupted();
}

/* ---- reports ---- */

static sf_status write_csv(const page_audit *a)
{
  sf_writer writer;
  if (!a->opt.csv) return sf_ok();
  SF_TRY(sf_writer_open(&writer, a->opt.csv));
  sf_report_csv(writer.file, &a->audit.report);
  return sf_writer_commit(&writer);
}

/* ---- HTML ---- */

/* The command, quoted for a shell; NULL: no memory. */
static char *join_command(int argc, char **argv)
{
  static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789%+,-./:=@_";
  char *text = NULL;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  for (int i = 0; out && i < argc; i++) {
    const bool quoted = !argv[i][0] || argv[i][strspn(argv[i], plain)];
    fputs(quoted ? i ? " '" : "'" : i ? " " : "", out);
    for (const char *c = argv[i]; *c; c++) fputs(*c == '\'' ? "'\\''" : (char[]){*c, 0}, out);
    if (quoted) fputc('\'', out);
  }
  if (!out || fclose(out)) return NULL;
  return text;
}

static bool page_tick(void *user, int done, int total)
{
  page_audit *a = user;
  if (sf_progress_due(&a->progress)) sf_progress_show(&a->progress, "pictures of the report: %d of %d", done, total);
  return !sf_cli_interrupted();
}

/* The float model: the one named, or model.safetensors beside the scene where it is there. */
static const char *find_model(page_audit *a)
{
  const char *slash = strrchr(a->opt.audit.scene, '/');
  if (a->opt.model) return a->opt.model;
  snprintf(a->model, sizeof a->model, "%.*smodel.safetensors", slash ? (int)(slash - a->opt.audit.scene) + 1 : 0,
           a->opt.audit.scene);
  return access(a->model, R_OK) == 0 ? a->model : NULL;
}

static sf_status make_page(page_audit *a)
{
  const options *o = &a->opt;
  if (!o->html) return sf_ok();
  a->page.report = &a->audit.report, a->page.scene = &a->audit.scene,
  a->page.view = &a->audit.data.view[o->audit.view >= 0 ? o->audit.view : 0];
  a->page.data = &a->audit.data, a->page.model = find_model(a);
  a->page.model_optional = !o->model, a->page.command = o->command;
  a->page.whole = o->audit.rays == 0 && (o->audit.view >= 0 || a->audit.data.count == 1);
  a->page.tick = page_tick, a->page.user = a;
  sf_progress_begin(&a->progress, o->quiet);
  const sf_status status = sf_page_gather(&a->page);
  sf_progress_end(&a->progress);
  SF_TRY(status);
  return sf_page_save(&a->page, o->html);
}

static void print_files(const page_audit *a, bool csv, bool page)
{
  if (csv) printf("wrote %s\n", a->opt.csv);
  if (page) printf("wrote %s\n", a->opt.html);
}

static sf_status print_report(const page_audit *a, bool csv, bool page)
{
  if (a->opt.json) {
    cJSON *json = page ? sf_page_json(&a->page) : sf_report_json(&a->audit.report);
    if (a->opt.published) cJSON_AddItemToObject(json, "published", sf_published_json());
    return sf_json_print(json, true);
  }
  sf_report_print(stdout, &a->audit.report);
  if (a->opt.published) printf("\n"), sf_published_print(stdout);
  print_files(a, csv, page);
  return sf_ok();
}

/* ---- program ---- */

static sf_status run(page_audit *a)
{
  const double begin = sf_seconds();
  sf_audit_options how = a->opt.audit;
  how.tick = tick, how.user = a;
  SF_TRY(sf_ranks_agree(how.ranks, sf_audit_open(&a->audit, &how)));
  if (!sf_ranks_rank(how.ranks)) sf_dataset_warn(stderr, "energy_audit", &a->audit.data, NULL);
  sf_progress_begin(&a->progress, a->opt.quiet);
  const sf_status status = sf_audit_count(&a->audit);
  sf_progress_end(&a->progress);
  a->audit.report.seconds = sf_seconds() - begin;
  return status;
}

static void close_audit(page_audit *a)
{
  sf_page_free(&a->page);
  sf_audit_close(&a->audit);
  free(a);
}

static sf_status open_audit(page_audit **a, const options *opt)
{
  *a = calloc(1, sizeof **a);
  if (!*a) return sf_fail(SF_E_MEMORY, "no memory");
  (*a)->opt = *opt;
  return sf_ok();
}

/* The counts are printed even if a file cannot be written. A difference outweighs every other failure. */
static sf_status report(page_audit *a)
{
  const sf_status *agreement = &a->audit.report.three.agreement;
  const sf_status csv = write_csv(a), page = make_page(a);
  const sf_status printed = print_report(a, a->opt.csv && csv.code == SF_OK, a->opt.html && page.code == SF_OK);
  const sf_status *const failed = page.code == SF_E_DIFFERENCE || csv.code == SF_OK ? &page : &csv;
  if (agreement->code != SF_OK)
    return sf_fail(SF_E_DIFFERENCE, "%s: %.150s%s%.150s", a->opt.audit.scene, agreement->message,
                   failed->code == SF_OK ? "" : "; ", failed->message);
  return failed->code == SF_OK ? printed : *failed;
}

static sf_status audit_scene(const options *opt)
{
  page_audit *a;
  SF_TRY(open_audit(&a, opt));
  sf_status status = run(a);
  if (status.code == SF_OK && !sf_ranks_rank(opt->audit.ranks)) status = report(a);
  close_audit(a);
  return status;
}

/* ---- comparison ---- */

static bool is_report(const char *path)
{
  const size_t n = strlen(path);
  return n > 5 && !strcmp(path + n - 5, ".json");
}

/* Goes through text, as in a file, because the report's integers are raw digits in memory. */
static sf_status report_as_read(const page_audit *a, cJSON **json)
{
  cJSON *made = sf_report_json(&a->audit.report);
  char *text = made ? cJSON_PrintUnformatted(made) : NULL;
  *json = text ? cJSON_Parse(text) : NULL;
  cJSON_Delete(made);
  free(text);
  return *json ? sf_ok() : sf_fail(SF_E_MEMORY, "no memory for the report");
}

/* One side: a report, or a scene that is audited now. */
static sf_status side(const options *opt, cJSON **json)
{
  if (is_report(opt->audit.scene)) return sf_json_load(opt->audit.scene, json);
  page_audit *a;
  SF_TRY(open_audit(&a, opt));
  sf_status status = run(a);
  if (status.code == SF_OK) status = a->audit.report.three.agreement;
  if (status.code == SF_OK && !sf_ranks_rank(opt->audit.ranks)) status = report_as_read(a, json);
  close_audit(a);
  return sf_ranks_lost(opt->audit.ranks) ? status : sf_ranks_agree(opt->audit.ranks, status);
}

static sf_status compare(const options *opt)
{
  cJSON *a = NULL, *b = NULL, *comparison = NULL;
  options other = *opt;
  other.audit.scene = opt->other;
  if (opt->tech_b) other.audit.tech = opt->tech_b;
  if (opt->steps_b) other.audit.steps = opt->steps_b;
  sf_status status = side(opt, &a);
  if (status.code == SF_OK) status = side(&other, &b);
  if (sf_ranks_rank(opt->audit.ranks)) return status;
  if (status.code == SF_OK) status = sf_audits_compare(a, opt->audit.scene, b, other.audit.scene, &comparison);
  cJSON_Delete(a), cJSON_Delete(b);
  if (status.code == SF_OK && opt->plot) status = sf_plot_comparison(opt->plot, comparison);
  SF_TRY(status);
  if (opt->json) return sf_json_print(comparison, true);
  sf_comparison_print(stdout, comparison);
  cJSON_Delete(comparison);
  return sf_ok();
}

static sf_status work(const options *opt)
{
  SF_TRY(sf_plusarg_check(opt->audit.plusarg));
  if (opt->compare) return compare(opt);
  if (opt->audit.scene) return audit_scene(opt);
  if (sf_ranks_rank(opt->audit.ranks)) return sf_ok();
  if (opt->json) return sf_json_print(sf_published_json(), true);
  sf_published_print(stdout);
  return sf_ok();
}

/* Refuses options without effect: there is no scene to count, or that side is a report. */
static sf_status check_effect(const options *o, const sf_cli *cli, int argc, char **argv)
{
  static const char *const b[] = {"--tech-b", "--steps-b", NULL}, *const tech[] = {"--tech", NULL},
                           *const steps[] = {"--steps", NULL}, *const rtl[] = {"--stall", "--plusarg", NULL};
  static const char *const counting[] = {"--views", "--view",      "--rays",        "--rtl-rays",   "--recount-rays",
                                         "--steps", "--tech",      "--twin",        "--seed",       "--stall",
                                         "--split", "--downscale", "--scale",       "--plusarg",    "--csv",
                                         "--html",  "--model",     "--cache-bytes", "--cache-ways", NULL};
  const bool a_counts = o->audit.scene && !(o->compare && is_report(o->audit.scene));
  const bool b_counts = o->compare && o->other && !is_report(o->other);
  if (o->compare && !b_counts) SF_TRY(sf_cli_refuse(cli, argc, argv, b, "has no effect: B is a report"));
  if (b_counts && !a_counts) {
    if (o->tech_b) SF_TRY(sf_cli_refuse(cli, argc, argv, tech, "has no effect: A is a report"));
    if (o->steps_b) SF_TRY(sf_cli_refuse(cli, argc, argv, steps, "has no effect: A is a report"));
  }
  if (!o->audit.rtl_rays) SF_TRY(sf_cli_refuse(cli, argc, argv, rtl, "has no effect beside --rtl-rays 0"));
  return a_counts || b_counts ? sf_ok()
                              : sf_cli_refuse(cli, argc, argv, counting, "has no effect: no scene is counted");
}

static sf_status parse_comparison(options *o, const char *const positional[3])
{
  static const char usage[] = "energy_audit --compare A B [DATA]";
  o->audit.data = positional[2];
  if (!o->audit.scene || !o->other) return sf_fail(SF_E_USAGE, "--compare needs two arguments; usage: %s", usage);
  const bool reports = is_report(o->audit.scene) && is_report(o->other);
  if (!o->audit.data && !reports) return sf_fail(SF_E_USAGE, "--compare of scenes needs DATA; usage: %s", usage);
  if (o->audit.data && reports)
    return sf_fail(SF_E_USAGE, "%s has no effect: reports are compared without data", o->audit.data);
  if (o->csv || o->html || o->published)
    return sf_fail(SF_E_USAGE, "--compare and %s exclude each other",
                   o->csv    ? "--csv"
                   : o->html ? "--html"
                             : "--published");
  return sf_ok();
}

/* Refuses what is missing or does not fit together. */
static sf_status check_arguments(options *o, const sf_cli *cli, const char *const positional[3])
{
  if (o->audit.view >= 0 && o->audit.views > 0) return sf_fail(SF_E_USAGE, "--view and --views exclude each other");
  if (o->model && !o->html) return sf_fail(SF_E_USAGE, "--model goes with --html");
  if (o->compare) return parse_comparison(o, positional);
  if (positional[2]) return sf_fail(SF_E_USAGE, "unexpected argument %s; usage: %s", positional[2], cli->usage);
  if (o->tech_b || o->steps_b || o->plot)
    return sf_fail(SF_E_USAGE, "%s goes with --compare", o->tech_b ? "--tech-b" : o->steps_b ? "--steps-b" : "--plot");
  if (o->audit.scene && !o->audit.data) return sf_fail(SF_E_USAGE, "missing argument DATA; usage: %s", cli->usage);
  if (!o->audit.scene && !o->published) return sf_fail(SF_E_USAGE, "missing argument; usage: %s", cli->usage);
  return sf_ok();
}

/* Inputs that are read after the counting. */
static sf_status check_inputs(const options *o)
{
  sf_technology technology;
  if (o->model) SF_TRY(sf_readable(o->model));
  if (o->audit.twin) SF_TRY(sf_readable(o->audit.twin));
  return o->tech_b ? sf_technology_find(&technology, o->tech_b) : sf_ok();
}

static sf_status parse(int argc, char **argv, options *o, sf_cli *cli)
{
  const sf_option table[] = {
      SF_GROUP("What is counted"),
      {"--views", 0, SF_ARG_INT, &o->audit.views, 1, 1 << 20, NULL, "N", "all pixels of the first N views (default 1)"},
      {"--view", 0, SF_ARG_INT, &o->audit.view, 0, 1 << 20, NULL, "K", "all pixels of view K alone"},
      {"--rays", 0, SF_ARG_U64, &o->audit.rays, 1, 1e9, NULL, "N", "N random rays instead of all pixels"},
      {"--split", 0, SF_ARG_STRING, &o->audit.split, 0, 0, NULL, "NAME", "train or test (default test)"},
      {"--steps", 0, SF_ARG_INT, &o->audit.steps, 1, SF_T_MAX, NULL, "N", "time steps in place of the scene's t_r"},
      {"--threads", 0, SF_ARG_INT, &o->threads, 1, 1024, NULL, "N", "threads (default: all processors)"},
      SF_GROUP("Reports"),
      {"--html", 0, SF_ARG_OUTPUT, &o->html, 0, 0, NULL, "FILE", "write the report as one self-contained page"},
      {"--csv", 0, SF_ARG_OUTPUT, &o->csv, 0, 0, NULL, "FILE", "write the counts per layer and step"},
      {"--model", 0, SF_ARG_INPUT, &o->model, 0, 0, NULL, "FILE",
       "float model, for its PSNR in the page (default: model.safetensors beside the scene, if there)"},
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      SF_GROUP("Prices and comparisons"),
      {"--tech", 0, SF_ARG_INPUT, &o->audit.tech, 0, 0, NULL, "FILE", "prices: a file or a name (default 45nm)"},
      {"--twin", 0, SF_ARG_INPUT, &o->audit.twin, 0, 0, NULL, "FILE",
       "compare with this float model of a ReLU twin that was trained by itself, on its own samples"},
      {"--compare", 0, SF_ARG_FLAG, &o->compare, 0, 0, NULL, NULL,
       "say what changed between two reports (.json) or scenes: --compare A B [DATA]"},
      {"--tech-b", 0, SF_ARG_INPUT, &o->tech_b, 0, 0, NULL, "FILE", "prices of B (default: those of A)"},
      {"--steps-b", 0, SF_ARG_INT, &o->steps_b, 1, SF_T_MAX, NULL, "N", "time steps of B (default: as A)"},
      {"--plot", 0, SF_ARG_OUTPUT, &o->plot, 0, 0, NULL, "NAME.gp",
       "of a comparison: gnuplot script of energies by kind; gnuplot writes NAME.svg"},
      {"--published", 0, SF_ARG_FLAG, &o->published, 0, 0, NULL, NULL, "recompute the paper's energy tables"},
      {"--cache-bytes", 0, SF_ARG_INT, &o->audit.cache.bytes, FX_CACHE_BYTES_MIN, FX_CACHE_BYTES_MAX, NULL, "N",
       "of the field's cache, a power of two (default as built)"},
      {"--cache-ways", 0, SF_ARG_INT, &o->audit.cache.ways, 1, FX_WAYS_MAX, NULL, "N",
       "of the field's cache: 1, 2, 4 or 8 (default as built)"},
      SF_GROUP("Checks and tuning"),
      {"--rtl-rays", 0, SF_ARG_INT, &o->audit.rtl_rays, 0, 1 << 20, NULL, "N",
       "rays that the accelerator renders, too (default 16)"},
      {"--recount-rays", 0, SF_ARG_U64, &o->audit.recount_rays, 0, 1e9, NULL, "N",
       "rays recounted from their spike bitmaps (default 1000)"},
      {"--seed", 0, SF_ARG_U64, &o->audit.seed, 0, 0, NULL, "S", "seed of the random choices (default 1)"},
      {"--stall", 0, SF_ARG_INT, &o->audit.stall, 0, 90, NULL, "PERCENT",
       "percent of cycles with a bubble or back-pressure (default 0)"},
      {"--downscale", 0, SF_ARG_INT, &o->audit.downscale, 0, 64, NULL, "N",
       "views of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->audit.scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the scene's (default 0)"},
      {"--plusarg", 0, SF_ARG_STRING, &o->audit.plusarg, 0, 0, NULL, "TEXT", "hand TEXT to the simulation"},
      {0}};
  const char *positional[3];
  cli->options = table;
  sf_status status = sf_cli_parse(cli, argc, argv, positional);
  o->audit.scene = positional[0], o->audit.data = positional[1], o->other = o->compare ? positional[1] : NULL;
  if (status.code == SF_OK) status = check_arguments(o, cli, positional);
  if (status.code == SF_OK) status = check_effect(o, cli, argc, argv);
  if (status.code == SF_OK) status = check_inputs(o);
  cli->options = NULL;
  return status;
}

int main(int argc, char **argv)
{
  sf_cli cli = {
      .program = "energy_audit",
      .usage = "energy_audit scene.snn DATA [options]",
      .summary =
          "Counts every operation of a scene in the fixed-point core, in the accelerator and again from the\n"
          "spike bitmaps; prices the counts and those of the scene's ReLU twin. Exit status 1 if any\ncount differs.",
      .examples = "  energy_audit scene.snn data --views 2 --json\n"
                  "  energy_audit scene.snn data --view 0 --html report.html\n"
                  "  mpirun -n 8 energy_audit scene.snn data --views 200 --json\n"
                  "  energy_audit scene.snn data --tech my.tech --csv counts.csv\n"
                  "  energy_audit --compare a.json b.json --plot change.gp && gnuplot change.gp\n"
                  "  energy_audit --compare scene.snn scene.snn data --steps 2 --steps-b 1\n"
                  "  energy_audit --published\n",
      .min_positional = 0,
      .max_positional = 3};
  options opt = {
      .audit = {
          .view = -1, .rtl_rays = RTL_RAYS, .recount_rays = RECOUNT_RAYS, .tech = "45nm", .split = "test", .seed = 1}};
  sf_status status = parse(argc, argv, &opt, &cli);
  if (status.code == SF_OK) {
    char *command = join_command(argc, argv);
    opt.command = command ? command : cli.program;
    if (opt.threads) omp_set_num_threads(opt.threads);
    sf_cli_catch_signals();
    const sf_ranks_options how = {.interrupted = sf_cli_interrupted, .argc = argc, .argv = argv};
    status = sf_ranks_open(&opt.audit.ranks, &how);
    opt.quiet |= sf_ranks_rank(opt.audit.ranks) > 0;
    if (status.code == SF_OK) status = work(&opt);
    free(command);
  }
  return sf_cli_finish_ranks(&cli, opt.audit.ranks, status);
}
