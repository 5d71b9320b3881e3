/* The report of profile paper from folders made by hand: seeds, the paper's sets of scenes, the page. */
#include "report_fixture.h"
#include "image/image.h"
#include "page/internal.h"
#include <math.h>
#include <sys/stat.h>

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
  write_text(
      "paper/fox-ingp/ann/convert.json",
      "{\"rays\":500,\"twin\":{\"psnr\":25.5},\"converted\":[{\"steps\":4,\"psnr\":20,\"of_twin_percent\":30.25},"
      "{\"steps\":256,\"psnr\":25.25,\"of_twin_percent\":812}]}");
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
  ck_assert_int_eq(count, 9);
  contains("paper/tables/comparators.csv",
           "\nfox-ingp,\"twin converted, no training\",256,25.25,25.50,16.70,-,-,-,seed 1; 500 random rays of "
           "held-out views\n",
           true);
  contains("paper/tables/order-tensorf-blender.csv", "\nbeta,beta = 5e-9,beta = 5e-8,PSNR dB,0.06,0.25,-,1,1,yes\n",
           true);
  contains("paper/tables/quality-tensorf-blender.csv", "\nbeta = 5e-8,32.50,33.04,0.5000,0.960,3.000,3.875,-,815.20,",
           true);
  ck_ok(sf_reproduction_plots(&report, &count)); /* no average over two fields */
  ck_assert_int_eq(count, 3);
  contains("paper/plots/psnr-t_r.gp", "\n3 32.75 lego-tensorf\n", true);
  ck_assert(access(in("paper/plots/balance-fox-ingp.gp"), F_OK) == 0);
  cJSON *json = sf_reproduction_json(&report);
  ck_assert_ptr_nonnull(json);
  const cJSON *groups = sf_json_get(json, "groups");
  ck_assert_int_eq(cJSON_GetArraySize(groups), 2);
  ck_assert(sf_json_real(sf_json_at(json, "groups[0].average.beta-5e-9.paper.psnr")) == 33.10);
  ck_assert_int_eq(cJSON_GetArraySize(sf_json_get(json, "tables")), 9);
  cJSON_Delete(json);
}

/* A grey picture with a square of 8 x 8 pixels of another colour. */
static void write_picture(const char *path, int side, int x0, int y0, const uint8_t colour[3])
{
  static uint16_t rgba[40 * 40 * 4];
  const sf_image image = {side, side, rgba};
  for (int y = 0; y < side; y++)
    for (int x = 0; x < side; x++)
      for (int c = 0; c < 4; c++) {
        const bool inside = x >= x0 && x < x0 + 8 && y >= y0 && y < y0 + 8;
        rgba[4 * (y * side + x) + c] = c == 3 ? 65535 : (uint16_t)(257 * (inside ? colour[c] : 128));
      }
  ck_ok(sf_image_save_png(&image, in(path)));
}

/* The <img> of 8 x 8 pixels of one colour, as the page has it. */
static char *square_of(const uint8_t colour[3], const char *alt)
{
  uint8_t rgb[8 * 8 * 3];
  char *text;
  size_t size;
  FILE *out = open_memstream(&text, &size);
  for (int i = 0; i < 8 * 8 * 3; i++) rgb[i] = colour[i % 3];
  ck_ok(html_put_png(out, rgb, 8, 8, NULL, 0, alt));
  ck_assert_int_eq(fclose(out), 0);
  return text;
}

/* The part is where the errors are; each picture has its PSNR; what is no picture, or of another size, is left out. */
TEST(page)
{
  static const uint8_t grey[3] = {128, 128, 128}, red[3] = {200, 10, 10}, black[3] = {0, 0, 0};
  write_run("it's <s>", "ann", 30, 1);
  write_run("it's <s>", "beta-5e-7", 30, 3);
  write_run("it's <s>", "beta-1e-7", 30, 3);
  write_run("it's <s>", "beta-1e-6", 30, 3);
  write_picture("it's <s>/ann/truth-3.png", 40, 0, 0, grey);
  write_picture("it's <s>/ann/frame-3.png", 40, 12, 20, black);
  write_picture("it's <s>/beta-5e-7/frame-3.png", 40, 24, 8, (const uint8_t[3]){255, 255, 255});
  write_picture("it's <s>/beta-1e-7/frame-3.png", 40, 24, 8, red);
  write_text("it's <s>/beta-1e-6/frame-3.png", "no picture");
  write_text("plots/psnr-t_r.svg", "<svg/>");
  load();
  ck_ok(sf_reproduction_page(&report));
  contains("report.html", "it's &lt;s&gt;, view 3", true);
  contains("report.html", "<s>,", false);
  char *part = square_of(red, "A part, magnified");
  contains("report.html", part, true);
  free(part);
  /* 64 of 1600 pixels: white is 127 / 255 off in each colour; in red 72, 118 and 118 are. */
  contains("report.html", "<b>beta = 5e-7 (full)</b> 20.03 dB", true);
  contains("report.html", "<b>beta = 1e-7</b> 21.69 dB", true);
  contains("report.html", "<b>truth</b></fig", true);
  contains("report.html", "<b>beta = 1e-6</b>", false);
  contains("report.html", "data:image/svg+xml;base64,PHN2Zy8+", true);
  contains("report.html", "<td>input hybrid, T = 8</td>", true);
  write_picture("it's <s>/beta-1e-6/frame-3.png", 20, 0, 0, red);
  ck_ok(sf_reproduction_page(&report));
  contains("report.html", "<b>beta = 1e-6</b>", false);
  remove_folder();
  ck_assert_int_eq(mkdir(folder, 0700), 0);
  load();
  ck_ok(sf_reproduction_page(&report));
  contains("report.html", "No scene has a rendered view yet.", true);
  contains("report.html", "None is drawn", true);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
