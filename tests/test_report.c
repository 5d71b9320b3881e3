/* The report of `make reproduce` from folders made by hand: averages, energies, the paper's order, what is missing. */
#include "ck_run.h"
#include "folder_fixture.h"
#include "base/io.h"
#include "report/report.h"
#include <math.h>

static sf_reproduction report;

static void write_text(const char *path, const char *text)
{
  char full[600], dir[600];
  snprintf(full, sizeof full, "%s/%s", folder, path);
  snprintf(dir, sizeof dir, "%s", full);
  *strrchr(dir, '/') = 0;
  ck_ok(sf_make_dir(dir));
  ck_ok(sf_write_file(full, text, strlen(text)));
}

static void write_run(const char *scene, const char *run, double psnr, int t_r)
{
  char path[128], text[400];
  snprintf(path, sizeof path, "%s/%s/train.json", scene, run);
  snprintf(text, sizeof text,
           "{\"model\":\"/home/somebody/m\",\"psnr\":%.17g,\"ssim\":0.5,\"t_r\":%d,\"t_star\":%d.25,\"seconds\":3600,"
           "\"iterations\":90,\"seed\":7,\"views\":2}",
           psnr, t_r, t_r);
  write_text(path, text);
  snprintf(path, sizeof path, "%s/%s/status", scene, run);
  write_text(path, "done\n");
}

/* Energies in mJ. */
static void write_audit(const char *scene, const char *run, const char *file, double spiking, double twin, int samples)
{
  char path[128], text[300];
  snprintf(path, sizeof path, "%s/%s/%s", scene, run, file);
  snprintf(text, sizeof text, "{\"energy_spiking_fj\":%.0f,\"energy_ann_fj\":%.0f,\"samples\":%d}", spiking * 1e12,
           twin * 1e12, samples);
  write_text(path, text);
}

static void load_from(const char *path)
{
  sf_reproduction_free(&report);
  ck_ok(sf_reproduction_load(&report, path));
}

static void load(void)
{
  load_from(folder);
}

static void tear_down(void)
{
  sf_reproduction_free(&report);
  remove_folder();
}

static double mean(int scene, int run, int metric)
{
  return sf_reproduction_mean(&report, scene, run, metric, NULL);
}

static sf_order_verdict verdict(int a, int b, int metric)
{
  sf_order order[SF_ORDERS_MAX];
  const int n = sf_reproduction_order(&report, 0, order);
  for (int i = 0; i < n; i++)
    if (order[i].a == a && order[i].b == b && order[i].metric == metric) return order[i].verdict;
  ck_abort_msg("no such pair");
  return SF_ORDER_MISSING;
}

static void contains(const char *file, const char *text, bool wanted)
{
  char *data;
  size_t size;
  ck_ok(sf_read_file(in(file), 1 << 24, &data, &size));
  ck_assert_msg((strstr(data, text) != NULL) == wanted, "'%s' is %sin %s:\n%.3000s", text, wanted ? "not " : "", file,
                data);
  free(data);
}

static void print(void)
{
  FILE *out = fopen(in("table.md"), "w");
  ck_assert_ptr_nonnull(out);
  ck_ok(sf_reproduction_print(out, &report));
  ck_assert_int_eq(fclose(out), 0);
}

/* Sums of these numbers are exact in binary: equality, no bound. */
TEST(averages)
{
  int count;
  write_run("b", "beta-5e-7", 30.5, 4);
  write_run("a", "beta-5e-7", 28.25, 3);
  write_run("a", "beta-1e-7", 29, 5);
  load();
  ck_assert_int_eq(report.count, 2);
  ck_assert_str_eq(report.scene[0].name, "a");
  ck_assert(mean(-1, SF_RUN_BETA_5E7, SF_METRIC_PSNR) == 29.375);
  ck_assert(mean(-1, SF_RUN_BETA_5E7, SF_METRIC_STEPS) == 3.5);
  ck_assert(mean(1, SF_RUN_BETA_5E7, SF_METRIC_PSNR) == 30.5);
  ck_assert(sf_reproduction_mean(&report, -1, SF_RUN_BETA_1E7, SF_METRIC_PSNR, &count) == 29);
  ck_assert_int_eq(count, 1);
  ck_assert(isnan(sf_reproduction_mean(&report, -1, SF_RUN_ANN, SF_METRIC_PSNR, &count)));
  ck_assert_int_eq(count, 0);
  /* Only scene a has both: +0.75, although the averages differ by -0.375. */
  ck_assert_int_eq(verdict(SF_RUN_BETA_1E7, SF_RUN_BETA_5E7, SF_METRIC_PSNR), SF_ORDER_YES);
  ck_assert_int_eq(verdict(SF_RUN_BETA_5E7, SF_RUN_BETA_1E6, SF_METRIC_PSNR), SF_ORDER_MISSING);
  ck_assert_int_eq(report.problems, 0);
}

TEST(energies)
{
  write_run("a", "beta-5e-7", 30, 3);
  write_audit("a", "beta-5e-7", "audit-0.json", 10, 40, 1000); /* 0.04 mJ per sample */
  write_audit("a", "beta-5e-7", "audit-5.json", 20, 60, 1500);
  write_audit("a", "beta-5e-7", "prefix-2-0.json", 6, 40, 1000);
  write_audit("a", "beta-5e-7", "prefix-2-5.json", 8, 60, 1500);
  write_text("a/beta-5e-7/fixed-0.json", "{\"psnr\":29.5,\"energy_fj\":10000000000000,\"crop\":[0,0,64,48]}");
  write_text("a/beta-5e-7/fixed-5.json", "{\"psnr\":30.5,\"energy_fj\":20000000000000,\"crop\":[0,0,64,48]}");
  write_text("a/beta-5e-7/float-0.json", "{\"psnr\":29.75,\"samples\":1000}");
  write_text("a/beta-5e-7/float-5.json", "{\"psnr\":31,\"samples\":1500}");
  write_text("a/beta-5e-7/scene.snn", "");
  write_run("a", "ann", 31, 1);
  write_text("a/ann/float-0.json", "{\"psnr\":31,\"samples\":500}");
  write_text("a/ann/float-5.json", "{\"psnr\":32,\"samples\":2500}");
  load();
  ck_assert(mean(0, SF_RUN_BETA_5E7, SF_METRIC_ENERGY) == 15);
  ck_assert(mean(0, SF_RUN_BETA_5E7, SF_METRIC_TWIN) == 50);
  ck_assert(mean(0, SF_RUN_BETA_5E7, SF_METRIC_LOSS) == -0.375);
  ck_assert(isnan(mean(0, SF_RUN_ANN, SF_METRIC_STEPS)));
  /* 1e-9: products with 1e-12 round. */
  ck_assert_double_eq_tol(mean(0, SF_RUN_ANN, SF_METRIC_ENERGY), (500 + 2500) * 0.04 / 2, 1e-9);
  ck_assert_double_eq_tol(sf_reproduction_saving(&report, 0, SF_RUN_BETA_5E7, SF_SAVING_TWIN), 70, 1e-9);
  ck_assert_double_eq_tol(sf_reproduction_saving(&report, -1, SF_RUN_BETA_5E7, SF_RUN_ANN), 75, 1e-9);
  ck_assert_double_eq_tol(sf_reproduction_prefix_energy(&report, 0, SF_RUN_BETA_5E7, 1), 7, 1e-9);
  ck_assert(isnan(sf_reproduction_prefix_energy(&report, 0, SF_RUN_BETA_5E7, 0)));
  ck_assert_double_eq_tol(mean(0, SF_RUN_BETA_5E7, SF_METRIC_SAVING), 75, 1e-9);
  ck_assert_double_eq_tol(mean(0, SF_RUN_BETA_5E7, SF_METRIC_EXCESS), 1e-3 - pow(10, -3.1), 1e-15);
  ck_assert_int_eq(report.scene[0].run[SF_RUN_BETA_5E7].audits, 2);
  ck_assert_int_eq(report.scene[0].run[SF_RUN_BETA_5E7].width, 64);
  ck_assert_int_eq(report.problems, 0);
  print();
  contains("table.md", "2 audited frames of 64 x 48", true);
}

/* Planted: the rendering's count is one fJ off, an audit that disagrees with itself, a file that is no JSON. */
TEST(faults)
{
  write_run("a", "beta-5e-7", 30, 3);
  write_audit("a", "beta-5e-7", "audit-0.json", 10, 40, 1000);
  write_text("a/beta-5e-7/fixed-0.json", "{\"psnr\":29.5,\"energy_fj\":10000000000001}");
  load();
  ck_assert_int_eq(report.problems, 1);
  ck_assert_ptr_nonnull(strstr(report.problem[0], "10000000000001 fJ in the rendering"));
  write_text("a/beta-5e-7/audit-1.json",
             "{\"energy_spiking_fj\":1,\"energy_ann_fj\":2,\"core_equals_recount\":false,\"samples\":1}");
  write_text("a/beta-5e-7/audit-2.json",
             "{\"energy_spiking_fj\":1,\"energy_ann_fj\":2,\"difference\":\"ray 0: it differs\",\"samples\":1}");
  write_text("a/no-extra/train.json", "{\"psnr\":");
  write_text("a/no-stage1/train.json", "{\"psnr\":null,\"ssim\":0.5,\"t_r\":3,\"seconds\":1}");
  write_text("a/no-budget/train.json", "{\"psnr\":20,\"ssim\":null,\"t_r\":3,\"seconds\":1}"); /* tiny views */
  load();
  ck_assert_int_eq(report.problems, 5);
  ck_assert_ptr_nonnull(strstr(report.problem[2], "the audit of view 2: ray 0: it differs"));
  ck_assert_ptr_nonnull(strstr(report.problem[3], "no-stage1/train.json: no finite number 'psnr'"));
  ck_assert_ptr_nonnull(strstr(report.problem[4], "no-extra/train.json"));
  ck_assert(isnan(mean(-1, SF_RUN_NO_EXTRA, SF_METRIC_PSNR)));
  ck_assert(mean(-1, SF_RUN_BETA_5E7, SF_METRIC_PSNR) == 30);
  print();
  contains("table.md", "## Problems", true);
}

TEST(judgement)
{
  static const struct {
    double paper, ours;
    sf_order_verdict verdict;
  } row[] = {{0.3, 0.2, SF_ORDER_YES},     {0.3, 0.05, SF_ORDER_TIE},  {0.3, -0.05, SF_ORDER_TIE},
             {0.3, -0.06, SF_ORDER_NO},    {0.3, 0.051, SF_ORDER_YES}, {-0.3, -1, SF_ORDER_YES},
             {-0.3, 0.1, SF_ORDER_NO},     {0.03, 0.01, SF_ORDER_YES}, {0.03, -0.04, SF_ORDER_YES},
             {0.03, -0.2, SF_ORDER_NO},    {0.03, 0.9, SF_ORDER_YES},  {NAN, 1, SF_ORDER_MISSING},
             {0.3, NAN, SF_ORDER_MISSING}, {0.3, 0, SF_ORDER_TIE}};
  for (size_t i = 0; i < sizeof row / sizeof *row; i++)
    ck_assert_msg(sf_order_judge(row[i].paper, row[i].ours, 0.05, 0.05) == row[i].verdict, "row %zu", i);
}

/* Every run in the paper's own numbers: every pair must agree; then one number is moved, and just its pairs turn. */
TEST(order)
{
  sf_order order[SF_ORDERS_MAX];
  for (int i = 0; i < SF_RUNS; i++) {
    const sf_run_kind *k = &sf_run_kinds[i];
    const double mj = sf_paper_value(0, i, SF_METRIC_ENERGY), psnr = sf_paper_value(0, i, SF_METRIC_PSNR);
    if (isnan(psnr)) continue; /* of the other field */
    write_run("s", k->name, psnr, 1);
    if (!isnan(mj) && i != SF_RUN_ANN) write_audit("s", k->name, "audit-0.json", mj, 955.27, 1000);
  }
  write_text("s/beta-5e-7/scene.snn", "");
  write_text("s/ann/float-0.json", "{\"psnr\":31,\"samples\":1000}");
  load();
  for (int i = 0; i < SF_RUNS; i++)
    report.scene[0].of[0].run[i].value[SF_METRIC_STEPS] = sf_paper_value(0, i, SF_METRIC_STEPS);
  const int n = sf_reproduction_order(&report, 0, order);
  for (int i = 0; i < n; i++) {
    ck_assert_msg(order[i].verdict == SF_ORDER_YES, "%s: pair %d is '%s'", order[i].group, i,
                  sf_order_names[order[i].verdict]);
    ck_assert_double_eq_tol(order[i].ours, order[i].paper, 1e-9);
  }
  ck_assert_double_eq_tol(sf_reproduction_saving(&report, -1, SF_RUN_BETA_1E7, SF_RUN_ANN), 32.65, 0.005); /* printed */
  ck_assert_double_eq_tol(sf_reproduction_saving(&report, -1, SF_RUN_BETA_1E6, SF_RUN_ANN), 57.57, 0.005);
  report.scene[0].of[0].run[SF_RUN_DECAY].value[SF_METRIC_PSNR] = 32.5;
  sf_reproduction_order(&report, 0, order);
  int turned = 0;
  for (int i = 0; i < n; i++)
    if (order[i].verdict == SF_ORDER_NO) {
      ck_assert_str_eq(order[i].group, "input modes");
      turned++;
    }
  ck_assert_int_eq(turned, 2);
  report.scene[0].of[0].run[SF_RUN_NO_EXTRA].value[SF_METRIC_STEPS] = 3.625;
  ck_assert_int_eq(verdict(SF_RUN_BETA_5E7, SF_RUN_NO_EXTRA, SF_METRIC_STEPS), SF_ORDER_TIE);
  print();
  contains("table.md", "22 yes, 1 tie, 2 no, 0 not run.", true);
  contains("table.md",
           "No pair missing or reversed: beta, ANN, stage I, L_extra, L_penalty, L_budg, fixed steps, learned", true);
}

/* A killed training: a line is cut, and after the resume iterations are there again. */
TEST(log_of_a_resumed_run)
{
  write_run("s", "no-budget", 30, 3);
  write_text("s/no-budget/train.jsonl", "{\"iteration\":16,\"t_star\":7}\n{\"iteration\":32,\"t_star\":6}\n"
                                        "{\"iteration\":48,\"t_s{\"iteration\":32,\"t_star\":5}\n"
                                        "{\"iteration\":32,\"t_star\":5.5}\n{\"iteration\":48,\"t_star\":4}\n");
  load();
  const sf_run *run = &report.scene[0].run[SF_RUN_NO_BUDGET];
  const double at[] = {16, 32, 48}, t_star[] = {7, 5.5, 4};
  ck_assert_int_eq(run->points, 3);
  for (int i = 0; i < 3; i++) ck_assert(run->iteration[i] == at[i] && run->t_star_at[i] == t_star[i]);
}

TEST(plots_and_json)
{
  int count;
  load(); /* nothing at all */
  ck_assert_int_eq(report.count, 0);
  print();
  ck_ok(sf_reproduction_plots(&report, &count));
  ck_assert_int_eq(count, 0);
  write_run("it's", "beta-5e-7", 30, 2);
  write_text("it's/beta-5e-7/train.json",
             "{\"model\":\"/home/somebody/m\",\"psnr\":30,\"ssim\":0.5,\"t_r\":2,\"t_star\":2,\"seconds\":1,"
             "\"search\":{\"worth\":2e-5,\"worth_error\":1e-6,\"price\":3e-5},\"prefix_psnr\":[25,30,30.5]}");
  write_text("it's/fixed-t-minus-1/status", "skipped: 0 steps are outside 1..8\n");
  write_text("notes/readme", "no scene\n");
  load();
  ck_assert_int_eq(report.count, 1);
  ck_assert(sf_reproduction_prefix(&report, 0, SF_RUN_BETA_5E7, 1) == 30);
  ck_assert(isnan(sf_reproduction_prefix(&report, 0, SF_RUN_BETA_5E7, 3)));
  ck_ok(sf_reproduction_plots(&report, &count));
  ck_assert_int_eq(count, 3);
  contains("plots/balance-it's.gp", "\n2.00000 2e-05 1e-06\n", true);
  contains("plots/balance-it's.gp", "plot 3e-05 * exp(x - 2.00000) with lines", true);
  contains("plots/psnr-steps.gp", "\n2 30\n", true);
  contains("plots/psnr-steps-it's.gp", "set title 'PSNR after every time step: it_s", true);
  print();
  contains("table.md", "- it's, fixed-t-minus-1: skipped: 0 steps", true);
  contains("table.md", "- it's, ann: not run", true);
  cJSON *json = sf_reproduction_json(&report);
  ck_assert_ptr_nonnull(json);
  ck_ok(sf_json_save(json, in("results.json")));
  cJSON_Delete(json);
  contains("results.json", "somebody", false);
  contains("results.json", "\"prefix_psnr\":\t[25, 30, 30.5]", true);
}

/* Profile scenes: a row for every scene and backbone, below them the paper's for their kinds, each once. */
TEST(pairs)
{
  static const struct {
    const char *ann, *spiking, *summary, *kind;
  } scene[] = {
      {"a/ann", "a/beta-5e-7", "scenes/a/beta-5e-7/train.json", "\"tensorf\",\"layout\":\"llff\""},
      {"b/ann", "b/beta-1e-7", "scenes/b/beta-1e-7/train.json", "\"tensorf\",\"layout\":\"llff\""},
      {"c/ann", "c/beta-5e-7", "scenes/c/beta-5e-7/train.json", "\"ingp\",\"layout\":\"ingp\""},
  };
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    char text[300];
    write_run("scenes", scene[i].ann, 25, 1);
    snprintf(text, sizeof text,
             "{\"psnr\":24.875,\"ssim\":0.5,\"t_r\":3,\"t_star\":2.5,\"seconds\":1,\"beta\":5e-7,\"backbone\":%s}",
             scene[i].kind);
    write_text(scene[i].summary, text);
    write_audit("scenes", scene[i].spiking, "audit-0.json", 10, 40, 1000);
  }
  write_text("scenes/a/beta-5e-7/cosim.json", "{\"samples\":1234,\"differences\":0}");
  write_text(
      "scenes/a/beta-1e-6/train.json",
      "{\"psnr\":24.5,\"ssim\":0.5,\"t_r\":2,\"t_star\":2,\"seconds\":1,\"beta\":1e-6,\"backbone\":\"tensorf\"}");
  write_text("scenes/b/beta-1e-7/status", "failed: no memory\n");
  load_from(in("scenes"));
  ck_assert_int_eq(report.count, 3);
  ck_assert_int_eq(report.scene[1].group, 3);
  ck_assert_int_eq(report.scene[2].group, SF_PAPER_GROUPS);
  print();
  contains(
      "table.md",
      "| a           | tensorf  | 5e-07 |       0 |  25.00 |      24.88 |      -0.12 | 0.5000 |     3 |      75.0 |",
      true);
  contains("table.md", "| paper: LLFF | tensorf  | 5e-07 |       - |  26.73 |      26.50 |      -0.23 |  0.828 | 1.875",
           true);
  contains("table.md", "|           1234 |           0 |", true);
  contains("table.md", "Synthetic", false);
  contains("table.md", "1e-06 |       0 |  25.00 |      24.50 |      -0.50 | 0.5000 |     2 |", true);
  contains("table.md", "- b, beta-1e-7: failed: no memory", true);
  contains("table.md", "without stage I", false);
  write_text("scenes/b/beta-1e-7/cosim.json", "{\"samples\":100,\"differences\":1}");
  write_text("scenes/c/beta-5e-7/cosim.json", "{\"samples\":100}");
  load_from(in("scenes"));
  ck_assert_int_eq(report.problems, 2);
  ck_assert_ptr_nonnull(strstr(report.problem[0], "b/beta-1e-7/cosim.json: RTL and fixed-point core differ: 1 of 100"));
  ck_assert_ptr_null(strstr(report.problem[0], folder)); /* no path of this machine */
  cJSON *json = sf_reproduction_json(&report);
  ck_assert(!cJSON_HasObjectItem(json, "groups") && !cJSON_HasObjectItem(json, "tie_tolerance"));
  cJSON_Delete(json);
  load_from(in("scenes/."));
  ck_assert_str_eq(report.profile, "scenes");
}

/* beta-5e-7 failed before its export: the ANN was rendered with the next. */
TEST(reference_of_the_ann)
{
  write_text("a/beta-5e-7/status", "failed: no memory\n");
  write_run("a", "beta-1e-7", 30, 3);
  write_text("a/beta-1e-7/scene.snn", "");
  write_audit("a", "beta-1e-7", "audit-0.json", 10, 40, 1000);
  write_run("a", "ann", 31, 1);
  write_text("a/ann/float-0.json", "{\"psnr\":31,\"samples\":500}");
  load();
  ck_assert_double_eq_tol(mean(0, SF_RUN_ANN, SF_METRIC_ENERGY), 20, 1e-9);
}

TEST(parameters)
{
  write_text("a/ann/train.cmd", "sf_train DATA --stage1 4 --seed 1 --net ann --psnr-prefixes 1\n");
  write_text("a/beta-5e-7/train.cmd", "sf_train DATA --stage1 4 --seed 1 --beta 5e-7\n");
  write_text("b/ann/train.cmd", "sf_train DATA --stage1 4 --seed 1 --net ann\n");
  write_text("a/ann/eval.cmd", "sim_render, energy_audit: views 0, --downscale 2 --seed 1\n");
  write_text("a/beta-5e-7/eval.cmd", "sim_render, energy_audit: views 0, --downscale 2 --seed 1\n");
  write_text("b/ann/eval.cmd", "sim_render, energy_audit: views 0 9, --downscale 2 --seed 1\n");
  load();
  ck_assert_int_eq(report.problems, 0);
  write_text("b/ann/eval.cmd", "sim_render, energy_audit: views 0, --downscale 1 --seed 1\n");
  load();
  ck_assert_int_eq(report.problems, 1);
  ck_assert_ptr_nonnull(strstr(report.problem[0], "runs of different parameters: a, ann: 'sim_render"));
  ck_assert_ptr_nonnull(strstr(report.problem[0], "; b, ann: 'sim_render"));
  write_text("a/beta-5e-7/train.cmd", "sf_train DATA --stage1 5 --seed 1 --beta 5e-7\n");
  load();
  ck_assert_int_eq(report.problems, 1);
  ck_assert_ptr_nonnull(strstr(report.problem[0], "; a, beta-5e-7: 'sf_train DATA --stage1 5"));
}

TEST(too_many_prefixes)
{
  write_text("s/ann/train.json",
             "{\"psnr\":30,\"ssim\":0.5,\"t_r\":2,\"seconds\":1,\"prefix_psnr\":[1,2,3,4,5,6,7,8,9]}");
  load();
  ck_assert_int_eq(report.problems, 1);
  sf_reproduction other;
  ck_bad(sf_reproduction_load(&other, in("nowhere")), SF_E_IO, "nowhere", "folder");
}

/* Three seeds of one scene, with these differences between two runs; a second scene has one seed. */
static sf_order_verdict with_seeds(double first, double second, double third)
{
  static const char *const place[] = {"s", "s/seed-2", "s/seed-3"};
  const double psnr[] = {30, 30.5, 31}, difference[] = {first, second, third};
  for (int i = 0; i < 3; i++) {
    write_run(place[i], "beta-5e-7", psnr[i], 3);
    write_run(place[i], "beta-1e-7", psnr[i] + difference[i], 4);
  }
  load();
  return verdict(SF_RUN_BETA_1E7, SF_RUN_BETA_5E7, SF_METRIC_PSNR);
}

TEST(seeds)
{
  sf_order order[SF_ORDERS_MAX];
  ck_assert_int_eq(with_seeds(0.25, 0.125, 0.25), SF_ORDER_YES);
  ck_assert_int_eq(report.count, 1);
  ck_assert_int_eq(report.scene[0].seeds, 3);
  ck_assert(mean(0, SF_RUN_BETA_5E7, SF_METRIC_PSNR) == 30.5);
  ck_assert(sf_reproduction_spread(&report, 0, SF_RUN_BETA_5E7, SF_METRIC_PSNR) == 0.5);
  ck_assert(sf_reproduction_spread(&report, -1, SF_RUN_BETA_5E7, SF_METRIC_STEPS) == 0);
  sf_reproduction_order(&report, 0, order);
  ck_assert_int_eq(order[0].pairs, 3);
  /* 0.25, 0.125, 0.25 are off their mean by 1/24, 1/12, 1/24: variance 1/192. */
  ck_assert_double_eq_tol(order[0].error, sqrt(1.0 / 192 / 3), 1e-12);
  ck_assert_int_eq(order[2].verdict, SF_ORDER_YES); /* steps: one more with every seed */
  print();
  contains("table.md", "| 30.50 +- 0.50 | 32.21 |", true);
  contains("table.md", "s; seed 7; 2 views", true);
  ck_assert_int_eq(with_seeds(0.5, -0.25, 0.25), SF_ORDER_TIE); /* mean 0.17, two standard errors 0.44 */
  ck_assert_int_eq(with_seeds(0.03125, 0.03125, 0.03125), SF_ORDER_YES);
  ck_assert_int_eq(with_seeds(-0.25, -0.125, -0.25), SF_ORDER_NO);
  /* Scenes weigh the same, whatever their seeds. */
  write_run("t", "beta-5e-7", 28, 2);
  load();
  ck_assert(mean(-1, SF_RUN_BETA_5E7, SF_METRIC_PSNR) == 29.25);
  ck_assert_double_eq_tol(sf_reproduction_spread(&report, -1, SF_RUN_BETA_5E7, SF_METRIC_PSNR), sqrt(0.125), 1e-12);
  write_run("s/seed-4", "beta-1e-6", 20, 2);
  write_text("s/seed-4/beta-1e-7/status", "failed: no memory\n");
  write_run("alone/seed-2", "beta-5e-7", 20, 2);
  write_text("s/seed-x/status", "done\n");
  load();
  ck_assert_int_eq(report.count, 3);
  ck_assert(mean(1, SF_RUN_BETA_1E6, SF_METRIC_PSNR) == 20);
  ck_assert(mean(0, SF_RUN_BETA_5E7, SF_METRIC_PSNR) == 20);
  print();
  contains("table.md", "- s, seed 4, beta-1e-7: failed: no memory", true);
}

/* A run of a scene with its field, its data and its search. */
static void write_kind(const char *scene, const char *run, double psnr, const char *kind)
{
  char path[128], text[400];
  write_run(scene, run, psnr, 3);
  snprintf(path, sizeof path, "%s/%s/train.json", scene, run);
  snprintf(text, sizeof text,
           "{\"psnr\":%.17g,\"ssim\":0.5,\"t_r\":3,\"t_star\":2.5,\"seconds\":1,\"seed\":1,\"views\":25,\"width\":400,"
           "\"height\":300,\"search\":{\"state\":\"balanced\",\"worth\":2e-5,\"worth_error\":1e-6,\"price\":1e-5},%s}",
           psnr, kind);
  write_text(path, text);
}

/* Every field and set of scenes has tables of its own beside the paper's values for it; scenes of no set have none. */
TEST(groups)
{
  static const char planes[] = "\"backbone\":\"tensorf\",\"layout\":\"blender\"",
                    grid[] = "\"backbone\":\"ingp\",\"layout\":\"ingp\"";
  int count;
  write_kind("paper/lego-tensorf", "ann", 33, planes);
  write_kind("paper/lego-tensorf", "beta-5e-9", 32.75, planes);
  write_kind("paper/lego-tensorf", "beta-5e-8", 32.5, planes);
  write_kind("paper/lego-tensorf", "beta-5e-7", 32, planes);
  write_kind("paper/fox-ingp", "ann", 25, grid);
  write_kind("paper/fox-ingp", "beta-1e-7", 24, grid);
  load_from(in("paper"));
  ck_assert_int_eq(report.problems, 0);
  ck_assert_int_eq(report.scene[1].group, 2);
  ck_ok(sf_reproduction_csv(&report, &count));
  print();
  contains("table.md", "## Averages over the scenes: TensoRF, Synthetic", true);
  contains("table.md", "| beta = 5e-8        |   32.50 | 33.04 |", true);
  contains("table.md", "hash grid, Synthetic\n", false); /* no such scene */
  contains("table.md", "without stage I", false);
  contains("table.md", "scenes of none of the paper's sets", true);
  contains("table.md", "lego; seed 1; 25 views of 400 x 300", true);
  contains("paper/tables/models-spiking-blender.csv", "\nSpiking-NeRF,30.41,-,256,as printed\n", true);
  contains("paper/tables/models-spiking-blender.csv", "\n\"here: TensoRF, beta = 5e-9\",32.75,0.500,3,lego;", true);
  contains("paper/tables/models-ordinary-blender.csv", "\nBiRF,32.64,-,-,as printed\n", true);
  contains("table.md", "Here: lego (TensoRF, 400 x 300). Not here: chair drums ficus hotdog materials mic ship.", true);
  contains("table.md", "Plenoxels", false);
  contains("table.md", "|      2.000 |      0.100 |      1.000 |          2.00 | balanced |", true);
  ck_assert_int_eq(count, 8);
  contains("paper/tables/order-tensorf-blender.csv", "\nbeta,beta = 5e-9,beta = 5e-8,PSNR dB,0.06,0.25,-,1,1,yes\n",
           true);
  contains("paper/tables/quality-tensorf-blender.csv", "\nbeta = 5e-8,32.50,33.04,0.5000,0.960,3.000,3.875,-,815.20,",
           true);
  cJSON *json = sf_reproduction_json(&report);
  ck_assert_ptr_nonnull(json);
  const cJSON *groups = sf_json_get(json, "groups");
  ck_assert_int_eq(cJSON_GetArraySize(groups), 2);
  ck_assert(sf_json_real(sf_json_at(json, "groups[0].average.beta-5e-9.paper.psnr")) == 33.10);
  ck_assert_int_eq(cJSON_GetArraySize(sf_json_get(json, "tables")), 8);
  cJSON_Delete(json);
}

/* Scenes of any kind are as many as there are: each has its rows. */
TEST(many_scenes)
{
  char name[32], row[48];
  for (int i = 0; i < 60; i++) {
    snprintf(name, sizeof name, "scenes/s%02d", i);
    write_run(name, "beta-5e-7", 20 + i, 2);
  }
  load_from(in("scenes"));
  print();
  for (int i = 0; i < 60; i++) {
    snprintf(row, sizeof row, "\n| s%02d ", i);
    contains("table.md", row, true);
  }
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
