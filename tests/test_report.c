/* The report of `make reproduce` from folders made by hand: averages, energies, the paper's order, what is missing. */
#include "report_fixture.h"
#include <math.h>

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
  write_text("s/no-budget/train.jsonl",
             "{\"iteration\":16,\"t_star\":7}\n{\"iteration\":32,\"t_star\":6}\n"
             "{\"iteration\":48,\"t_s{\"iteration\":32,\"t_star\":5}\n"
             "{\"iteration\":32,\"t_star\":5.5}\n{\"iteration\":48,\"t_star\":4,\"firing\":[0.25,0.5]}\n");
  load();
  const sf_run *run = &report.scene[0].run[SF_RUN_NO_BUDGET];
  const double at[] = {16, 32, 48}, t_star[] = {7, 5.5, 4};
  ck_assert_int_eq(run->points, 3);
  for (int i = 0; i < 3; i++) ck_assert(run->iteration[i] == at[i] && run->t_star_at[i] == t_star[i]);
  ck_assert(run->firing[2][0] == 0.25 && run->firing[2][1] == 0.5 && isnan(run->firing[2][2]));
  ck_assert(isnan(run->firing[1][0]));
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
  ck_assert_int_eq(count, 4);
  contains("plots/psnr-t_r.gp", "\n2 30 it_s\n", true);
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
