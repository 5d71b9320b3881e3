/* Pictures of a data set in any layout: names, sizes, cameras of their own; which layout is taken where there are two.
 */
#include "ck_run.h"
#include "layout_folder.h"
#include "src/scene/capture.h"
#include <sys/stat.h>
#include <unistd.h>

/* Whatever its length, and none is cut: "dir/./././p00" with another ending, and too long a name. */
TEST(a_picture_is_found_by_a_long_name)
{
  char name[5000] = "", path[4096];
  const layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  strcpy(name, "images/");
  for (int i = 0; i < 300; i++) strcat(name, "./");
  strcat(name, "p00.jpg");
  ck_ok(sf_picture_find(path, folder, name));
  ck_assert_str_eq(strrchr(path, '/'), "/p00.png");
  ck_assert(sf_is_file(path));
  name[strlen(name) - 4] = 0;
  ck_ok(sf_picture_find(path, folder, name));
  ck_assert_str_eq(strrchr(path, '/'), "/p00.png");
  ck_assert(sf_is_file(path));
  for (size_t n = strlen(name); n < 4200; n += 2) strcat(name, "./");
  ck_bad(sf_picture_find(path, folder, name), SF_E_IO, folder, "too long");
}

/* Nobody writes into the pipe: opening it would wait for ever. */
TEST(a_picture_is_no_pipe)
{
  const layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 0);
  put_json("transforms.json", &rig, "", "images", 0, 1);
  const char *first = in("images/p00.png");
  ck_assert(!unlink(first) && !mkfifo(first, 0600));
  ck_bad(reload_as("test", NULL), SF_E_IO, "p00.png", "not a regular file (frame 0 of");
}

/* Both files there: forward-facing poses are read for their depths, others for their lenses; transforms.json always. */
TEST(one_layout_wins_and_says_so)
{
  layout_rig rig = row();
  put_llff(&rig, 0, 4, 40), put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, 4 * WIDTH, 4 * HEIGHT, 255);
  reload("train");
  ck_assert(d.layout == SF_LAYOUT_LLFF && d.warnings == 1 && strstr(d.warning[0], "poses_bounds.npy is used"));
  put_llff(&rig, 0, 0.001, 40); /* nothing is behind so near a plane */
  reload("train");
  ck_assert(d.layout == SF_LAYOUT_COLMAP && d.warnings == 1 && strstr(d.warning[0], "COLMAP model is used"));
  put_picture("images/zz.png", 4 * WIDTH, 4 * HEIGHT, 9, 255); /* that COLMAP did not register */
  reload("train");
  ck_assert(d.layout == SF_LAYOUT_COLMAP && d.warnings == 1);
  rig.lens[0].param[1] = rig.lens[0].param[0];
  put_json("transforms.json", &rig, "", "images", 0, 1);
  reload("train");
  ck_assert(d.layout == SF_LAYOUT_INGP && d.warnings == 1 && strstr(d.warning[0], "transforms.json is used"));
}

TEST(pictures_of_the_size_asked_for)
{
  layout_rig rig = orbit();
  static const struct {
    int downscale, width;
  } asked[] = {{1, 32}, {2, 16}, {4, 8}, {8, 4}};
  rig.lens[0].width = 32, rig.lens[0].height = 24;
  rig.lens[0].param[2] = 16, rig.lens[0].param[3] = 12;
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, 32, 24, 255), put_pictures("images_2", &rig, 16, 12, 255);
  put_pictures("images_4", &rig, 8, 6, 255);
  for (int i = 0; i < 4; i++) {
    ck_ok(reload_as("test", &(sf_dataset_options){.downscale = asked[i].downscale}));
    ck_assert_int_eq(d.view[0].camera.width, asked[i].width);
    ck_assert_int_eq(strncmp(d.view[0].name,
                             i == 0   ? "images/"
                             : i == 1 ? "images_2/"
                                      : "images_4/",
                             7 + 2 * (i > 0)),
                     0);
    ck_assert_float_eq(d.view[0].camera.fx, 20 * (float)asked[i].width / 32);
    same_rays(&d, &rig);
  }
  /* photographs of 4000 pixels are not what anybody means: the first folder not above 1600 */
  rig.lens[0].width = 4000, rig.lens[0].height = 3000;
  put_colmap("sparse/0", &rig, 0);
  ck_ok(reload_as("test", NULL));
  ck_assert(d.view[0].camera.width == 8 && d.downscale == 0);
  ck_ok(reload_as("test", &(sf_dataset_options){.downscale = 1})); /* unless somebody says so */
  ck_assert(d.view[0].camera.width == 32 && d.downscale == 1);
}

/* In the one size that the camera took: shrunk by the smallest factor that brings them to 1600 pixels. */
TEST(photographs_are_shrunk_unasked)
{
  layout_rig rig = orbit();
  rig.lens[0].width = 3301, rig.lens[0].height = 40;
  rig.lens[0].param[0] = rig.lens[0].param[1] = 3000;
  rig.lens[0].param[2] = 1650, rig.lens[0].param[3] = 20;
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, 3301, 40, 255);
  ck_ok(reload_as("test", NULL));
  ck_assert_int_eq(d.view[0].camera.width, 1100);
  ck_assert_int_eq(d.view[0].camera.height, 13);
  ck_assert_float_eq_tol(d.view[0].camera.fx, 1000, 1e-3f);
  rig.lens[0].width = 3300, rig.lens[0].height = 39; /* what fills whole boxes of 3 x 3 */
  same_rays(&d, &rig);
  ck_ok(reload_as("test", &(sf_dataset_options){.downscale = 1}));
  ck_assert_int_eq(d.view[0].camera.width, 3301);
  ck_ok(reload_as("test", &(sf_dataset_options){.downscale = 20}));
  ck_assert_int_eq(d.view[0].camera.width, 165);
  rig.lens[0].height = 40;
  same_rays(&d, &rig);
}

LOOP_TEST(each_picture_has_its_own_camera, 2)
{
  layout_rig rig = orbit();
  rig.lenses = 3;
  rig.lens[1] = (layout_lens){2, 0, "SIMPLE_PINHOLE", 8, 20, 3, {11, 4, 10}};
  rig.lens[2] = (layout_lens){900, 4, "OPENCV", 24, 10, 8, {25, 26, 12, 5, 0, 0, 0, 0}};
  for (int v = 0; v < VIEWS; v++) rig.view[v].lens = rig.lens[v % 3].id;
  put_colmap("sparse/0", &rig, _i);
  ck_ok(sf_make_dir(in("images")));
  for (int v = 0; v < VIEWS; v++) {
    char name[80];
    snprintf(name, sizeof name, "images/%s", rig.view[v].name);
    put_picture(name, rig.lens[v % 3].width, rig.lens[v % 3].height, v, 255);
  }
  reload("train");
  ck_assert_int_eq(d.count, VIEWS - 3);
  same_rays(&d, &rig);
}

/* One camera 4 units away (3.2 in the model) that looks along +y, a picture of one pixel a sample: where a pixel of
 * slopes up to m is seen, the ray meets the cube of half edge m D / (1 + m) first. */
typedef struct mark {
  int x, y, width, height;
  uint16_t value, alpha;
} mark;

static double shown_of(uint16_t value, uint16_t alpha, const mark *marks, int n)
{
  static const double back[3] = {0, -1, 0}, at[3] = {0, -4, 0};
  enum { SIDE = 24 };
  layout_rig rig = {.lenses = 1, .views = 1, .lens = {{7, 1, "PINHOLE", SIDE, SIDE, 4, {30, 30, 12, 12}}}};
  sf_image image = {SIDE, SIDE, malloc(SIDE * SIDE * 8)};
  strcpy(rig.view[0].name, "p00.png");
  rig.view[0].lens = 7;
  look(rig.view[0].to_world, at, back);
  put_json("transforms_train.json", &rig, "", "train", 0, 1), put_json("transforms_test.json", &rig, "", "train", 0, 1);
  for (int i = 0; i < SIDE * SIDE * 4; i++) image.rgba[i] = i % 4 < 3 ? value : alpha;
  for (const mark *m = marks; m < marks + n; m++)
    for (int i = 0; i < m->width * m->height; i++) {
      uint16_t *p = image.rgba + 4 * ((m->y + i / m->width) * SIDE + m->x + i % m->width);
      for (int k = 0; k < 4; k++) p[k] = k < 3 ? m->value : m->alpha;
    }
  ck_ok(sf_make_dir(in("train")));
  ck_ok(sf_image_save_png(&image, in("train/p00.png")));
  sf_image_free(&image);
  reload("train");
  ck_assert(d.count == 1 && d.scale == 0.8f);
  return (double)d.view[0].shown;
}

static double cube_of(double pixel)
{
  const double m = fabs(pixel + 0.5 - 12) / 30;
  return 3.2 * m / (1 + m);
}

TEST(pictures_say_how_far_the_box_has_to_reach)
{
  enum { GREY = 128 * 257, FULL = 65535, HALF = 127 * 257 };
  static const struct {
    uint16_t value, alpha;
    mark m;
    double pixel;
  } rows[] = {{GREY, 0, {20, 12, 1, 1, GREY, FULL}, 20},
              {GREY, 0, {11, 2, 1, 1, GREY, FULL}, 2},
              {0, 0, {20, 12, 1, 1, 0, FULL}, 20}, /* alpha tells: black counts */
              {GREY, HALF, {3, 12, 1, 1, GREY, FULL}, 3},
              {0, FULL, {19, 12, 1, 1, GREY, FULL}, 19}, /* no alpha: black or white may be the background */
              {FULL, FULL, {19, 12, 1, 1, GREY, FULL}, 19},
              {GREY, FULL, {0, 0, 1, 1, GREY, FULL}, 23}};
  const double bound = 1e-5; /* of floats: origins and directions */
  for (int i = 0; i < COUNT(rows); i++)
    ck_assert_double_eq_tol(shown_of(rows[i].value, rows[i].alpha, &rows[i].m, 1), cube_of(rows[i].pixel), bound);
  ck_assert(shown_of(GREY, 0, NULL, 0) == 0);
  /* 2 of 66 pixels do not decide, 3 of 67 do. */
  for (int n = 1; n <= 3; n++) {
    const mark two[2] = {{8, 8, 8, 8, GREY, FULL}, {23, 11, 1, n, GREY, FULL}};
    ck_assert_double_eq_tol(shown_of(GREY, 0, two, 2), cube_of(n < 3 ? 15 : 23), bound);
  }
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
