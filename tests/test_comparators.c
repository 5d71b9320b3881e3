/* The table of measured comparators, from numbers that a hand can check. */
#include "report_fixture.h"

/* Of a held-out view. */
static void write_counted(const char *run, double psnr, double mj, int samples)
{
  char path[200], text[300];
  snprintf(path, sizeof path, "%s/train.json", run);
  snprintf(text, sizeof text,
           "{\"psnr\":%.17g,\"ssim\":0.5,\"t_r\":1,\"t_star\":1,\"seconds\":1,\"iterations\":9,\"seed\":7,\"views\":2,"
           "\"frame\":{\"samples\":%d,\"macs\":1,\"sops\":1,\"energy_mj\":%g}}",
           psnr, samples, mj);
  write_text(path, text);
}

/* The twin's audited frame: samples of 0.04 mJ. */
static void write_seed(const char *dir, double more, int samples)
{
  char path[128], text[64];
  snprintf(path, sizeof path, "%s/ann", dir);
  write_counted(path, 30, 20, 500);
  snprintf(path, sizeof path, "%s/ann/float-0.json", dir);
  snprintf(text, sizeof text, "{\"psnr\":30,\"samples\":%d}", samples);
  write_text(path, text);
  snprintf(path, sizeof path, "%s/ann/convert.json", dir);
  write_text(path,
             "{\"rays\":100,\"twin\":{\"psnr\":20,\"samples_per_ray\":4},\"converted\":[{\"steps\":16,\"psnr\":10,"
             "\"samples_per_ray\":8,\"of_twin_percent\":150}]}");
  snprintf(path, sizeof path, "%s/along-ray", dir);
  write_counted(path, 20 + more, 5, 250);
  write_run(dir, "beta-5e-7", 29 + more, 4);
  write_audit(dir, "beta-5e-7", "audit-0.json", 20, 50, 1250);
  snprintf(path, sizeof path, "%s/beta-5e-7/scene.snn", dir);
  write_text(path, "");
  write_run(dir, "sweep-2", 28 + more, 2);
  write_audit(dir, "sweep-2", "audit-0.json", 10, 50, 1250);
  write_run(dir, "fixed-t-minus-1", 29.5 + more, 3);
  write_audit(dir, "fixed-t-minus-1", "audit-0.json", 16, 50, 1250);
  write_run(dir, "mode-hybrid", 31 + more, 8);
  write_audit(dir, "mode-hybrid", "audit-0.json", 60, 50, 1250);
}

static void has(const char *row)
{
  contains("tables/comparators.csv", row, true);
}

static void write_tables(void)
{
  int count;
  load();
  ck_ok(sf_reproduction_csv(&report, &count));
}

/* 10^-2.9 - 10^-3 = 25.89e-5; 10^-1 - 10^-2 = 9000e-5; the twin's 40 mJ times 1.5, and times 5 / 20. */
TEST(one_seed)
{
  write_seed("s", 0, 1000);
  write_tables();
  has("\ns,ANN (ReLU twin),-,30.00,-,-,40.000,-,-,");
  has("\ns,\"PATA, beta = 5e-7 (full)\",4,29.00,30.00,25.89,20.000,50.0,60.0,");
  has("\ns,\"twin converted, no training\",16,10.00,20.00,9000.00,60.000,-50.0,25.0,seed 7; 100 random rays");
  has("\ns,samples of a ray as steps,1 a sample,20.00,30.00,900.00,10.000,75.0,50.0,");
  has("\ns,\"fixed T, trained alone\",2,28.00,30.00,58.49,10.000,75.0,80.0,");
  has("\ns,\"fixed T, trained alone, cheapest as good as PATA\",3,29.50,30.00,12.20,16.000,60.0,68.0,");
  has("\ns,\"fixed T, trained alone, best PSNR\",8,31.00,30.00,-20.57,60.000,-50.0,-20.0,");
  contains("tables/comparators.csv", "alone,5", false);
  contains("tables/comparators.csv", "1e-7", false);
}

/* Means, and the standard deviation of 20 and 22; savings of mean energies, as everywhere: the twin's is 80 mJ. */
TEST(two_seeds)
{
  write_seed("s", 0, 1000);
  write_seed("s/seed-2", 2, 3000);
  write_tables();
  has("\ns,samples of a ray as steps,1 a sample,21.00 +- 1.41,30.00,715.48,20.000,75.0,50.0,");
  has("\ns,\"PATA, beta = 5e-7 (full)\",4,30.00 +- 1.41,30.00,2.66,20.000,75.0,60.0,");
  has("\ns,\"twin converted, no training\",16,10.00 +- 0.00,20.00,9000.00,120.00,-50.0,25.0,2 seeds; 100 random rays");
}

/* Runs of before have none. */
TEST(nothing_to_compare)
{
  write_run("s", "beta-5e-7", 29, 4);
  write_run("s", "fixed-t", 29, 4);
  write_tables();
  ck_assert_ptr_null(fopen(in("tables/comparators.csv"), "r"));
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
