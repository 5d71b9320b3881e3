/* What is taken from COLMAP's tables and NumPy's arrays, and the words with which one is refused: kept as texts. */
#include "ck_run.h"
#include "src/scene/colmap.h"
#include "src/scene/npy.h"
#include "tests/reader_fixture.h"

/* ---- COLMAP ---- */

static void say_model(FILE *out, sf_colmap *m, sf_status status)
{
  say_status(out, status);
  for (int i = 0; i < m->cameras; i++)
    fprintf(out, "  camera %d\n", (int)m->camera[i].id), say_lens(out, &m->camera[i].lens);
  for (int i = 0; i < m->images; i++) {
    const sf_colmap_image *p = &m->image[i];
    fprintf(out, "  image %d of %d: '%s' %g %g %g %g at %g %g %g\n", (int)p->id, (int)p->camera, p->name, p->q[0],
            p->q[1], p->q[2], p->q[3], p->t[0], p->t[1], p->t[2]);
  }
  for (int i = 0; i < m->points; i++)
    fprintf(out, "  point %g %g %g\n", m->point[i][0], m->point[i][1], m->point[i][2]);
  sf_colmap_free(m);
}

static void say_tables(FILE *out, const char *cameras, const char *images, const char *points)
{
  sf_colmap m = {0};
  fprintf(out, "[%.100s][%.100s][%.100s]\n", cameras, images, points ? points : "none");
  put_file(in("c"), cameras, strlen(cameras)), put_file(in("i"), images, strlen(images));
  if (points) put_file(in("p"), points, strlen(points));
  say_model(out, &m, sf_colmap_read_text(&m, in("c"), in("i"), points ? in("p") : NULL));
}

static const char *const colmap_cameras[] = {"1 PINHOLE 40 30 50 51 20 15",
                                             "# no\n\n \t\r\n7 SIMPLE_PINHOLE 40 30 50 20 15\r\n",
                                             "1 SIMPLE_RADIAL 40 30 50 20 15 0.1\n2\tRADIAL 40 30 50 20 15 0.1 0.2",
                                             "1 OPENCV 40 30 50 51 20 15 .1 .2 .3 .4",
                                             "1 FOV 40 30 50 51 20 15 .1",
                                             "1 OPENCV_FISHEYE 40 30 50 51 20 15 .1 .2 .3 .4",
                                             "1 PIN 40 30 50 51 20 15",
                                             "1 PINHOLE 40 30 50 51 20",
                                             "1 PINHOLE 40 x",
                                             "x PINHOLE",
                                             "1",
                                             "1.5 PINHOLE 40 30 50 51 20 15",
                                             "2147483647 PINHOLE 1 1 1 1 1 1",
                                             "2147483648 PINHOLE 1 1 1 1 1 1",
                                             "-2147483648 PINHOLE 1 1 1 1 1 1",
                                             "1 PINHOLE 0.5 30 50 51 20 15",
                                             "1 PINHOLE 40 0.5 50 51 20 15",
                                             "1 PINHOLE 1e6 30 50 51 20 15",
                                             "1 PINHOLE 40 1e6 50 51 20 15",
                                             "1 PINHOLE 40 30 0 51 20 15",
                                             "1 PINHOLE 40 30 50 0 20 15",
                                             "1 PINHOLE 40 30 1e7 51 20 15",
                                             "1 PINHOLE 40 30 50 1e7 20 15",
                                             "1 PINHOLE 40 30 50 51 1e7 15",
                                             "1 PINHOLE 40 30 50 51 20 -1e7",
                                             "1 PINHOLE 40 30 50 51 20 nan",
                                             "1 PINHOLE 40 30 50 51 20 15 # more",
                                             "\xef\xbb\xbf"
                                             "1 PINHOLE 40 30 50 51 20 15",
                                             "\xef\xbb"
                                             "1 PINHOLE 40 30 50 51 20 15",
                                             "1 AVERYLONGNAMEOFACAMERAMODELTHATNOBODYWOULDEVERHAVETHOUGHTOFATALLX 1 1"};
static const char good[] = "1 PINHOLE 40 30 50 51 20 15\n", view[] = "3 1 0 0 0 4 5 6 1 a.png\n";
static const char *const colmap_images[] = {"3 1 0 0 0 4 5 6 1 a b.png\r\n\n4 0 1 0 0 7 8 9 2 \t c.png\n1 2 3 4 5 -1\n",
                                            "3 1 0 0 0 4 5 6 1 a\n1 2 3",
                                            "3 1 0 0 0 4 5 6 1 a\n1 2 3 4\n",
                                            "3 1 0 0 0 4 5 6 1 a\n1 2 3x\n",
                                            "3 1 0 0 0 4 5 6 1 a\n4 1 0 0 0 4 5 6 1 b\n",
                                            "3 1 0 0 0 4 5 6 1",
                                            "3 1 0 0 0 4 5 6 1 \t\n",
                                            "3 1 0 0 0 4 5 6",
                                            "3.5 1 0 0 0 4 5 6 1 a",
                                            "3 1 0 0 0 4 5 6 1.5 a",
                                            "3 1.006 0 0 0 4 5 6 1 a",
                                            "3 1.004 0 0 0 4 5 6 1 a",
                                            "3 0.5 0.5 0.5 0.5 1e12 5 6 1 a",
                                            "3 0.5 0.5 0.5 0.5 -9e11 5 6 1 a",
                                            "3 0.5 0.5 0.5 0 4 5 6 1 a",
                                            "3 1 0 0 0 4 5 nan 1 a",
                                            "# a\n  \n3 1 0 0 0 4 5 6 1 a\n# points\n  1 2 3\n",
                                            ""};
static const char *const colmap_points[] = {
    "1 2 3 4 0 0 0 0.5 1 2\n# x\n\n2 -5 6e1 7", "1 2 3", "1 2 1e12 4", "1 2 3 -9e11", "1 nan 3 4", ""};

static void colmap_texts(FILE *out)
{
  char text[700], name[400];
  for (int i = 0; i < COUNT(colmap_cameras); i++) say_tables(out, colmap_cameras[i], view, NULL);
  for (int i = 0; i < COUNT(colmap_images); i++) say_tables(out, good, colmap_images[i], NULL);
  for (int i = 0; i < COUNT(colmap_points); i++) say_tables(out, good, view, colmap_points[i]);
  for (int n = 254; n < 258; n++) {
    snprintf(name, sizeof name, "%0*d", n, 7);
    snprintf(text, sizeof text, "3 1 0 0 0 4 5 6 1 %s\n", name);
    say_tables(out, good, text, NULL);
  }
  put_file(in("c"), "1\0 2", 4);
  sf_colmap m = {0};
  say_model(out, &m, sf_colmap_read_text(&m, in("c"), in("i"), NULL));
  say_model(out, &m, sf_colmap_read_text(&m, in("none"), in("i"), NULL));
  for (int i = -1; i < 13; i++) {
    const char *known = "-";
    fprintf(out, "  model %d has %d", i, sf_colmap_model(i, NULL, &known));
    fprintf(out, ": %s\n", known);
  }
}

TEST(colmap_as_text)
{
  ck_expected_text("colmap-text.txt", out, colmap_texts(out));
}

/* Bytes of a table, least significant first. */
typedef struct table {
  char bytes[1000];
  size_t size;
} table;

static void whole(table *t, uint64_t value, int bytes)
{
  for (int i = 0; i < bytes; i++) t->bytes[t->size++] = (char)(value >> (8 * i));
}

static void real(table *t, double value)
{
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  whole(t, bits, 8);
}

static void make_tables(table t[3])
{
  memset(t, 0, 3 * sizeof *t);
  whole(&t[0], 2, 8);
  whole(&t[0], 7, 4), whole(&t[0], 1, 4), whole(&t[0], 40, 8), whole(&t[0], 30, 8); /* PINHOLE */
  for (int i = 0; i < 4; i++) real(&t[0], 20 + i);
  whole(&t[0], UINT32_MAX, 4), whole(&t[0], 3, 4), whole(&t[0], 300, 8), whole(&t[0], 70000, 8); /* RADIAL, of -1 */
  for (int i = 0; i < 5; i++) real(&t[0], 0.5 + i);
  whole(&t[1], 2, 8);
  for (int n = 0; n < 2; n++) {
    whole(&t[1], (uint64_t)(5 + n), 4);
    for (int i = 0; i < 4; i++) real(&t[1], i == n);
    for (int i = 0; i < 3; i++) real(&t[1], 3 * n + i);
    whole(&t[1], (uint64_t)(7 + n), 4);
    for (const char *c = n ? "b.png" : "a"; *c; c++) whole(&t[1], (uint64_t)*c, 1);
    whole(&t[1], 0, 1), whole(&t[1], (uint64_t)n, 8);
    for (int i = 0; i < 24 * n; i++) whole(&t[1], 9, 1);
  }
  whole(&t[2], 2, 8);
  for (int n = 0; n < 2; n++) {
    whole(&t[2], 77, 8);
    for (int i = 0; i < 3; i++) real(&t[2], 10 * n + i);
    whole(&t[2], 0, 3), real(&t[2], 0.5), whole(&t[2], (uint64_t)n, 8);
    for (int i = 0; i < 8 * n; i++) whole(&t[2], 9, 1);
  }
}

static void say_bytes(FILE *out, const char *title, const table t[3], bool points)
{
  sf_colmap m = {0};
  static const char *const name[] = {"c", "i", "p"};
  fprintf(out, "%s\n", title);
  for (int i = 0; i < 3; i++) put_file(in(name[i]), t[i].bytes, t[i].size);
  say_model(out, &m, sf_colmap_read_binary(&m, in("c"), in("i"), points ? in("p") : NULL));
}

static void colmap_bytes(FILE *out)
{
  /* A byte of a table, and what it becomes. */
  static const struct {
    const char *title;
    int table, at, value;
  } rows[] = {{"a camera more", 0, 0, 3},        {"a camera less", 0, 0, 1},
              {"many cameras", 0, 6, 1},         {"model 12", 0, 12, 12},
              {"model -1", 0, 15, 255},          {"model 1001", 0, 13, 4},
              {"model FOV", 0, 12, 7},           {"an image more", 1, 0, 3},
              {"an image less", 1, 0, 1},        {"many images", 1, 5, 1},
              {"two points more", 1, 74, 2},     {"many points", 1, 81, 1},
              {"a name without end", 1, 73, 65}, {"a point more", 2, 0, 3},
              {"a point less", 2, 0, 1},         {"a track", 2, 51, 8},
              {"a long track", 2, 55, 1},        {"a camera's number", 0, 10, 1},
              {"a point's number", 2, 9, 5},     {"a quaternion", 1, 18, 0},
              {"far away", 2, 39, 0x7f}};
  table t[3], all[3];
  make_tables(all);
  say_bytes(out, "whole", all, true), say_bytes(out, "without points", all, false);
  for (int i = 0; i < COUNT(rows); i++) {
    memcpy(t, all, sizeof t);
    t[rows[i].table].bytes[rows[i].at] = (char)rows[i].value;
    say_bytes(out, rows[i].title, t, true);
  }
  for (int k = 0; k < 3; k++) { /* cut, and too long */
    for (size_t cut = 1; cut < all[k].size; cut += 5) {
      memcpy(t, all, sizeof t);
      t[k].size -= cut;
      say_bytes(out, "cut", t, true);
    }
    memcpy(t, all, sizeof t);
    whole(&t[k], 0, 1), say_bytes(out, "a byte too many", t, true);
  }
  for (int n = 254; n < 258; n++) {
    memcpy(t, all, sizeof t);
    t[1].size = 72;
    t[1].bytes[0] = 1;
    for (int i = 0; i < n; i++) whole(&t[1], 'a', 1);
    whole(&t[1], 0, 1), whole(&t[1], 0, 8);
    say_bytes(out, "a long name", t, true);
  }
}

TEST(colmap_as_bytes)
{
  ck_expected_text("colmap-bytes.txt", out, colmap_bytes(out));
}

/* More entries than there is room for at first. */
TEST(colmap_grows)
{
  sf_colmap m = {0};
  for (int i = 0; i < 200; i++) {
    const double params[4] = {50, 50, i, 0}, at[3] = {i, 0, 0};
    sf_colmap_image image = {.id = i, .q = {1}, .name = "a"};
    ck_ok(sf_colmap_add_camera(&m, "w", i, "PINHOLE", 40, 30, params));
    ck_ok(sf_colmap_add_image(&m, "w", &image));
    ck_ok(sf_colmap_add_point(&m, "w", at));
  }
  ck_assert(m.cameras == 200 && m.images == 200 && m.points == 200);
  for (int i = 0; i < 200; i++) {
    ck_assert_double_eq(m.camera[i].lens.cx, i);
    ck_assert(m.camera[i].id == i && m.image[i].id == i);
    ck_assert_double_eq(m.point[i][0], i);
  }
  sf_colmap_free(&m);
}

/* ---- NumPy ---- */

static void say_npy(FILE *out, int version, const char *header, int numbers, int width)
{
  table t = {.size = 0};
  double *value = NULL;
  int rows = 0;
  const size_t n = strlen(header);
  for (const char *c = "\x93NUMPY"; *c; c++) whole(&t, (uint64_t)*c, 1);
  whole(&t, (uint64_t)version, 1), whole(&t, 0, 1), whole(&t, n, version == 1 ? 2 : 4);
  memcpy(t.bytes + t.size, header, n), t.size += n;
  for (int i = 0; i < numbers; i++) {
    const float narrow = i == 9 ? NAN : 0.25f + (float)i;
    uint32_t bits;
    memcpy(&bits, &narrow, sizeof bits);
    if (width == 4)
      whole(&t, bits, 4);
    else
      real(&t, i == 9 ? INFINITY : 0.25 + i);
  }
  put_file(in("n"), t.bytes, t.size);
  fprintf(out, "%d %s with %d of %d\n", version, header, numbers, width);
  say_status(out, sf_npy_load(in("n"), 3, &value, &rows));
  for (int i = 0; value && i < 3 * rows; i++) fprintf(out, "  %g", value[i]);
  fprintf(out, "%s", value ? "\n" : "");
  free(value);
}

static void npys(FILE *out)
{
  static const char good[] = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
  static const char *const wrong[] = {"{'descr': '>f8', 'fortran_order': False, 'shape': (2, 3), }",
                                      "{'descr': '<i8', 'fortran_order': False, 'shape': (2, 3), }",
                                      "{'descr': '<f88', 'fortran_order': False, 'shape': (2, 3), }",
                                      "{'descr': '<f8', 'fortran_order': True, 'shape': (2, 3), }",
                                      "{'descr': '<f8', 'shape': (2, 3), }",
                                      "{'fortran_order': False, 'shape': (2, 3), }",
                                      "{'descr': '<f8', 'fortran_order': False}",
                                      "{'descr': '<f8', 'fortran_order': False, 'shape': 2, 3}",
                                      "{'descr': '<f8', 'fortran_order': False, 'shape': (2), }",
                                      "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 4), }",
                                      "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3, 1), }",
                                      "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 3), }",
                                      "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 3), }",
                                      "{'descr': '<f8', 'fortran_order': False, 'shape': (1000001, 3), }",
                                      "{\"descr\":\"<f8\",\"fortran_order\":False,\"shape\":(2,3,)}"};
  for (int version = 0; version < 5; version++) say_npy(out, version, good, 6, 8);
  say_npy(out, 1, "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 3), }", 9, 4);
  say_npy(out, 1, "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 3), }", 12, 4);
  say_npy(out, 1, "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 3), }", 12, 8);
  say_npy(out, 1, good, 5, 8), say_npy(out, 1, good, 7, 8), say_npy(out, 1, good, 6, 4);
  for (int i = 0; i < COUNT(wrong); i++) say_npy(out, 1, wrong[i], 6, 8);
  static const char *const starts[] = {"\x93NUMPY\1\0\0",     "\x93NUMPX\1\0\0\0\0\0\0\0", "\x93NUMPY\1\0\7\0ab",
                                       "\x93NUMPY\1\0\2\0ab", "\x93NUMPY\2\0\0\4\0\0",     "\x93NUMPY\2\0\0\0\1\0"};
  static const size_t bytes[] = {9, 14, 12, 12, 12, 12};
  for (int i = 0; i < COUNT(starts); i++) {
    double *value;
    int rows;
    put_file(in("n"), starts[i], bytes[i]);
    say_status(out, sf_npy_load(in("n"), 3, &value, &rows));
    ck_assert_ptr_null(value);
  }
}

TEST(arrays_of_numpy)
{
  ck_expected_text("npy.txt", out, npys(out));
}

/* ---- LLFF ---- */

/* A row of poses_bounds.npy with one of its numbers changed; one of three. */
static void say_llff(FILE *out, int at, double value, int pictures, int downscale)
{
  double row[17] = {0, 1, 0, 5, 30, -1, 0, 0, 6, 40, 0, 0, 1, 7, 50, 2, 9};
  char header[] = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 17), }";
  table t = {.size = 0};
  sf_capture c = {0};
  remove_folder(), make_folder();
  fprintf(out, "number %d is %g, %d pictures, 1/%d\n", at, value, pictures, downscale);
  for (const char *b = "\x93NUMPY\1"; *b; b++) whole(&t, (uint64_t)*b, 1);
  whole(&t, 0, 1), whole(&t, sizeof header - 1, 2);
  memcpy(t.bytes + t.size, header, sizeof header - 1), t.size += sizeof header - 1;
  for (int n = 0; n < 3; n++)
    for (int i = 0; i < 17; i++) real(&t, n == 1 && i == at ? value : row[i] + (n == 2 && i == 15 ? -0.5 : 0));
  put_file(in("poses_bounds.npy"), t.bytes, t.size);
  ck_ok(sf_make_dir(in("images_2")));
  if (downscale != 2) ck_ok(sf_make_dir(in("images")));
  for (int n = 0; n < pictures; n++) {
    char name[40];
    snprintf(name, sizeof name, "%s/%c.%s", downscale == 2 ? "images_2" : "images", "cab"[n % 3] + n / 3,
             n % 2 ? "JPG" : "png");
    put_file(in(name), name, strlen(name));
  }
  put_file(in("images_2/other.txt"), "x", 1);
  fprintf(out, "  there %d\n", sf_llff_there(folder));
  const sf_status status = sf_llff_read(&c, folder, &(sf_dataset_options){.downscale = downscale});
  say_status(out, status);
  if (!status.code) {
    fprintf(out, "  near %g shrink %d picture %d\n", c.near, c.shrink, c.picture);
    for (int f = 0; f < c.count; f++) say_frame(out, &c.frame[f]);
  }
  free(c.frame);
}

static void llffs(FILE *out)
{
  static const struct {
    int at;
    double value;
  } rows[] = {{0, 0.05},   {0, 0.11},  {1, 1.004}, {1, 1.006},  {5, -0.996},  {5, -0.994},  {12, 1.004}, {12, 1.006},
              {12, 0.994}, {6, 0.009}, {6, 0.011}, {10, 0.011}, {11, -0.011}, {2, 0.011},   {4, 0.9},    {4, 1},
              {4, 999999}, {4, 1e6},   {9, 0.9},   {9, 1e6},    {14, 1e-3},   {14, 0.0011}, {14, 1e7},   {3, 9e11},
              {8, -1e12},  {13, 1e12}, {15, 0},    {15, -1},    {15, 9},      {15, 8.9},    {16, 1.9}};
  say_llff(out, -1, 0, 3, 1), say_llff(out, -1, 0, 2, 1), say_llff(out, -1, 0, 4, 1), say_llff(out, -1, 0, 3, 2);
  say_llff(out, -1, 0, 3, 0), say_llff(out, -1, 0, 3, 4), say_llff(out, -1, 0, 3, 3);
  for (int i = 0; i < COUNT(rows); i++) say_llff(out, rows[i].at, rows[i].value, 3, 1);
}

TEST(rows_of_llff)
{
  ck_expected_text("llff.txt", out, llffs(out));
}

/* Which folder, and what is left to shrink. */
static void folders(FILE *out)
{
  static const int there[] = {1, 2, 4, 8, 64, 65};
  for (int set = 0; set < 64; set += set < 8 ? 1 : 7) {
    remove_folder(), make_folder();
    fprintf(out, "folders");
    for (int i = 0; i < 6; i++)
      if (set >> i & 1) {
        char name[40];
        snprintf(name, sizeof name, there[i] == 1 ? "images" : "images_%d", there[i]);
        ck_ok(sf_make_dir(in(name)));
        fprintf(out, " %s", name);
      }
    fprintf(out, "\n");
    for (int downscale = 0; downscale < 9; downscale++) {
      char folder_name[64] = "";
      int shrink = -1;
      const double side = downscale % 2 ? 1600 : 3201;
      const sf_status status =
          sf_pictures_choose(folder, downscale, side, side / (downscale % 3 ? 2 : 0.5), folder_name, &shrink);
      say_status(out, status);
      if (!status.code) fprintf(out, "  1/%d of %g: %s by %d\n", downscale, side, folder_name, shrink);
    }
  }
}

TEST(folders_of_pictures)
{
  ck_expected_text("folders.txt", out, folders(out));
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
