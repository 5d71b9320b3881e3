/* Sweeps: loading, the front against its definition, names, tables; measured points against their parts. */
#include "ck_run.h"
#include "base/io.h"
#include "sweep/sweep.h"
#include "base/rng.h"
#include "tests/folder_fixture.h"
#include <math.h>

static const sf_point centre = {.name = "w8",
                                .model = "m",
                                .axis = {8, 12, 8, 12, 8, 3, 20, 19, 2},
                                .figure = {30, 40, 0.1, 2.3e-5, 3, 70, 60, 50, 200, 1e6, 9}};

static void save(const char *name, const sf_point *point)
{
  char file[64];
  snprintf(file, sizeof file, "points/%s.json", name);
  ck_ok(sf_make_dir(in("points")));
  cJSON *json = sf_point_json(point);
  ck_ok(sf_json_save(json, in(file)));
  cJSON_Delete(json);
  ck_ok(sf_write_file(in("centre"), "c\n", 2));
}

TEST(points_come_back)
{
  sf_point other = centre;
  OWNED(sf_sweep) sweep;
  char name[64];
  other.axis[SF_AXIS_WEIGHT] = 5, other.axis[SF_AXIS_STEPS] = 1;
  other.figure[SF_POINT_PSNR_FLOAT] = INFINITY; /* equal images */
  save("c", &centre), save("a", &other);
  ck_ok(sf_sweep_load(&sweep, folder));
  ck_assert_int_eq(sweep.count, 2);
  ck_assert_ptr_eq(sweep.centre, &sweep.point[1]);
  ck_assert_mem_eq(sweep.centre->axis, centre.axis, sizeof centre.axis);
  ck_assert_mem_eq(sweep.centre->figure, centre.figure, sizeof centre.figure);
  ck_assert(isnan(sweep.point[0].figure[SF_POINT_PSNR_FLOAT]));
  sf_point_short_name(&sweep, &sweep.point[0], name, sizeof name);
  ck_assert_str_eq(name, "w5 t1");
  sf_point_short_name(&sweep, sweep.centre, name, sizeof name);
  ck_assert_str_eq(name, "centre");
  ck_assert(!sf_point_on_axis(&sweep, &sweep.point[0], SF_AXIS_WEIGHT));
  sweep.point[0].axis[SF_AXIS_STEPS] = 2;
  ck_assert(sf_point_on_axis(&sweep, &sweep.point[0], SF_AXIS_WEIGHT));
  ck_assert(!sf_point_on_axis(&sweep, &sweep.point[0], SF_AXIS_GRID));
}

TEST(broken_folders_are_named)
{
  static const char *const broken[] = {"{}", "[1]", "{\"name\": 3}",
                                       "{\"name\": \"x\", \"model\": \"m\", \"weight_bits\": 1e9}", "{"};
  sf_sweep sweep;
  ck_bad(sf_sweep_load(&sweep, folder), SF_E_IO, "centre", folder);
  save("c", &centre);
  for (int i = 0; i < 5; i++) {
    ck_ok(sf_write_file(in("points/b.json"), broken[i], strlen(broken[i])));
    ck_bad(sf_sweep_load(&sweep, folder), SF_E_FORMAT, "b.json", folder);
  }
  ck_assert_int_eq(unlink(in("points/b.json")), 0);
  ck_assert_int_eq(unlink(in("points/c.json")), 0);
  ck_bad(sf_sweep_load(&sweep, folder), SF_E_FORMAT, "'c'", "missing");
}

/* The front by its definition, on random points with many ties. */
TEST(front)
{
  enum { POINTS = 120 };
  static const int costs[] = {SF_POINT_ENERGY, SF_POINT_BYTES, SF_POINT_TRAFFIC};
  sf_point point[POINTS];
  sf_sweep sweep = {.point = point, .count = POINTS, .centre = point};
  for (uint64_t i = 0; i < POINTS; i++) {
    point[i] = centre;
    point[i].figure[SF_POINT_PSNR_TRUTH] = 25 + (double)sf_random_below(1, 1, i, 8);
    for (int c = 0; c < 3; c++) point[i].figure[costs[c]] = 10 + (double)sf_random_below(1, 2 + (uint64_t)c, i, 6);
  }
  sf_sweep_mark(&sweep);
  int marked = 0;
  for (int i = 0; i < sweep.count; i++) {
    bool beaten = false;
    for (int j = 0; j < sweep.count && !beaten; j++) {
      const double *a = sweep.point[j].figure, *b = sweep.point[i].figure;
      bool as_good = a[SF_POINT_PSNR_TRUTH] >= b[SF_POINT_PSNR_TRUTH],
           better = a[SF_POINT_PSNR_TRUTH] > b[SF_POINT_PSNR_TRUTH];
      for (int c = 0; c < 3; c++) as_good &= a[costs[c]] <= b[costs[c]], better |= a[costs[c]] < b[costs[c]];
      beaten = as_good && better;
    }
    ck_assert_int_eq(sweep.point[i].front, !beaten);
    marked += !beaten;
  }
  ck_assert_int_gt(marked, 3);
  ck_assert_int_lt(marked, POINTS / 2);
}

/* 70.02 mJ and 70.04 mJ are printed alike: neither beats the other by them. */
TEST(what_prints_alike_is_alike)
{
  static const int energy = SF_POINT_ENERGY;
  sf_point a = centre, b = centre;
  a.figure[SF_POINT_ENERGY] = 70.02, b.figure[SF_POINT_ENERGY] = 70.04;
  ck_assert(!sf_point_beats(&a, &b, &energy, 1) && !sf_point_beats(&b, &a, &energy, 1));
  b.figure[SF_POINT_ENERGY] = 71;
  ck_assert(sf_point_beats(&a, &b, &energy, 1) && !sf_point_beats(&b, &a, &energy, 1));
  b.figure[SF_POINT_PSNR_TRUTH] += 0.1;
  ck_assert(!sf_point_beats(&a, &b, &energy, 1) && !sf_point_beats(&b, &a, &energy, 1));
  b.figure[SF_POINT_PSNR_TRUTH] = NAN; /* equal to the picture: nothing is better */
  ck_assert(sf_point_beats(&b, &centre, &(int){SF_POINT_BYTES}, 1));
}

TEST(files)
{
  sf_point other = centre;
  sf_sweep sweep;
  char text[8192] = {0};
  int plots;
  other.axis[SF_AXIS_GRID] = 5, other.figure[SF_POINT_BYTES] = 5e5, other.figure[SF_POINT_PSNR_TRUTH] = 29;
  save("c", &centre), save("g5", &other);
  ck_ok(sf_sweep_load(&sweep, folder));
  sf_sweep_mark(&sweep);
  FILE *out = fmemopen(text, sizeof text - 1, "w");
  sf_sweep_print(out, &sweep);
  fclose(out);
  ck_assert_ptr_nonnull(strstr(text, "## grid entries, bits"));
  ck_assert_ptr_null(strstr(text, "## weights, bits")); /* one value only */
  ck_assert_ptr_nonnull(strstr(text, "| centre | 30.00 | 40.00 | 0.10 | 3.0 |"));
  ck_assert_ptr_nonnull(strstr(text, "| g5 | 29.00 |"));
  out = fmemopen(text, sizeof text - 1, "w");
  sf_sweep_csv(out, &sweep);
  fclose(out);
  ck_assert_ptr_nonnull(strstr(text, "\nw8,m,1,8,12,5,12,8,3,20,19,2,29,"));
  ck_ok(sf_sweep_plots(&sweep, &plots));
  ck_assert_int_eq(plots, 4);
  ck_assert_int_eq(access(in("plots/front-bytes.gp"), R_OK), 0);
  sf_sweep_free(&sweep);
  other = centre, other.figure[SF_POINT_PSNR_FLOAT] = INFINITY; /* equal to float */
  save("c", &other);
  ck_ok(sf_sweep_load(&sweep, folder));
  out = fmemopen(text, sizeof text - 1, "w");
  sf_sweep_print(out, &sweep);
  fclose(out);
  ck_assert_ptr_nonnull(strstr(text, "| centre | 30.00 | equal |"));
  ck_ok(sf_sweep_plots(&sweep, &plots));
  size_t size;
  char *script = read_whole(in("plots/widths.gp"), &size);
  ck_assert_ptr_null(strstr(script, "nan with lines"));
  free(script);
  sf_sweep_free(&sweep);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
