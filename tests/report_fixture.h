/* Folders of runs made by hand, and the report of them. */
#ifndef SF_TESTS_REPORT_FIXTURE_H
#define SF_TESTS_REPORT_FIXTURE_H
#include "ck_run.h"
#include "folder_fixture.h"
#include "base/io.h"
#include "report/report.h"

static sf_reproduction report;

static inline void write_text(const char *path, const char *text)
{
  char full[600], dir[600];
  snprintf(full, sizeof full, "%s/%s", folder, path);
  snprintf(dir, sizeof dir, "%s", full);
  *strrchr(dir, '/') = 0;
  ck_ok(sf_make_dir(dir));
  ck_ok(sf_write_file(full, text, strlen(text)));
}

static inline void write_run(const char *scene, const char *run, double psnr, int t_r)
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
static inline void write_audit(const char *scene, const char *run, const char *file, double spiking, double twin,
                               int samples)
{
  char path[128], text[300];
  snprintf(path, sizeof path, "%s/%s/%s", scene, run, file);
  snprintf(text, sizeof text, "{\"energy_spiking_fj\":%.0f,\"energy_ann_fj\":%.0f,\"samples\":%d}", spiking * 1e12,
           twin * 1e12, samples);
  write_text(path, text);
}

static inline void load_from(const char *path)
{
  sf_reproduction_free(&report);
  ck_ok(sf_reproduction_load(&report, path));
}

static inline void load(void)
{
  load_from(folder);
}

static inline void tear_down(void)
{
  sf_reproduction_free(&report);
  remove_folder();
}

static inline double mean(int scene, int run, int metric)
{
  return sf_reproduction_mean(&report, scene, run, metric, NULL);
}

static inline sf_order_verdict verdict(int a, int b, int metric)
{
  sf_order order[SF_ORDERS_MAX];
  const int n = sf_reproduction_order(&report, 0, order);
  for (int i = 0; i < n; i++)
    if (order[i].a == a && order[i].b == b && order[i].metric == metric) return order[i].verdict;
  ck_abort_msg("no such pair");
  return SF_ORDER_MISSING;
}

static inline void contains(const char *file, const char *text, bool wanted)
{
  char *data;
  size_t size;
  ck_ok(sf_read_file(in(file), 1 << 24, &data, &size));
  ck_assert_msg((strstr(data, text) != NULL) == wanted, "'%s' is %sin %s:\n%.3000s", text, wanted ? "not " : "", file,
                data);
  free(data);
}

static inline void print(void)
{
  FILE *out = fopen(in("table.md"), "w");
  ck_assert_ptr_nonnull(out);
  ck_ok(sf_reproduction_print(out, &report));
  ck_assert_int_eq(fclose(out), 0);
}
#endif
