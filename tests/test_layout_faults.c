/* Folders of posed pictures in which something is missing, broken or odd: passed over with a warning, or refused in one
 * line. */
#include "ck_run.h"
#include "layout_folder.h"

TEST(a_few_missing_pictures_are_passed_over)
{
  const layout_rig rig = orbit();
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  unlink(in("images/p03.png")), unlink(in("images/p09.png"));
  reload("train");
  ck_assert_int_eq(d.count, 12);
  ck_assert_int_eq(d.total, 12);
  ck_assert_int_eq(d.warnings, 1);
  ck_assert_ptr_nonnull(strstr(d.warning[0], "2 of 14 pictures are missing"));
  ck_assert_ptr_nonnull(strstr(d.warning[0], "images/p03.png"));
  same_rays(&d, &rig);
  ck_ok(reload_as("train", &(sf_dataset_options){.downscale = 1, .first = 2, .limit = 1}));
  ck_assert_str_eq(d.view[0].name, "images/p04.png");
  reload("test"); /* is whole */
  ck_assert(d.count == 3 && d.warnings == 0);
  for (int v = 1; v < 8; v++) {
    char name[40];
    snprintf(name, sizeof name, "images/p%02d.png", v);
    unlink(in(name));
  }
  ck_bad(reload_as("train", NULL), SF_E_IO, "images/p01.png", "8 of 14 pictures are missing");
}

TEST(other_endings_are_found)
{
  layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  for (int v = 0; v < VIEWS; v++) snprintf(rig.view[v].name, sizeof rig.view[v].name, v % 2 ? "p%02d.JPG" : "p%02d", v);
  put_colmap("sparse/0", &rig, 0);
  reload("test");
  ck_assert_int_eq(d.count, 3);
  ck_assert_int_eq(rename(in("images/p00.png"), in("images/p00.JPEG")), 0);
  reload("test");
  ck_assert_int_eq(d.count, 3);
}

/* Two of its files start with UTF-8's mark, as some editors leave it. */
TEST(a_mark_before_a_text_is_skipped)
{
  static layout_file file, marked;
  const layout_rig rig = orbit();
  put_colmap("sparse/0", &rig, 1);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  for (int i = 0; i < 2; i++) {
    if (i)
      layout_images(&file, &rig, 1);
    else
      layout_cameras(&file, &rig, 1);
    marked.size = 0;
    layout_text(&marked, "\xef\xbb\xbf"), layout_text(&marked, file.bytes);
    put(i ? "sparse/0/images.txt" : "sparse/0/cameras.txt", &marked);
  }
  reload("train");
  same_rays(&d, &rig);
}

static bool warned(const sf_dataset *d, const char *word, const char *name)
{
  for (int i = 0; i < d->warnings; i++)
    if (strstr(d->warning[i], word) && strstr(d->warning[i], name)) return true;
  return false;
}

TEST(the_survey_names_what_looks_wrong)
{
  layout_rig rig = orbit();
  rig.lenses = 3;
  rig.lens[1] = (layout_lens){8, 1, "PINHOLE", WIDTH, HEIGHT, 4, {60, 20, 1, 6}};
  rig.lens[2] = (layout_lens){9, 1, "PINHOLE", WIDTH, HEIGHT, 4, {2, 2, 8, 6}};
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_colmap("sparse/0", &rig, 0);
  for (int v = 0; v < VIEWS; v++) {
    char name[80];
    snprintf(name, sizeof name, "images/%s", rig.view[v].name);
    put_picture(name, WIDTH, HEIGHT, v == 6 ? 20 : 100 + v, 255);
  }
  reload("train");
  ck_ok(sf_dataset_survey(&d));
  ck_assert(warned(&d, "exposure", "images/p06.png") && warned(&d, "-2.", "1 of 14"));
  ck_assert_int_eq(d.warnings, 1);
  rig.view[2].lens = 8, rig.view[3].lens = 9;
  memcpy(rig.view[12].to_world, rig.view[11].to_world, sizeof rig.view[11].to_world);
  for (int i = 0; i < 3; i++) rig.view[10].to_world[4 * i + 3] += 40 * rig.view[10].to_world[4 * i + 2];
  for (int i = 0; i < 12; i++)
    if (i % 4 == 0 || i % 4 == 2) rig.view[5].to_world[i] *= -1; /* turns its back */
  put_colmap("sparse/0", &rig, 0);
  reload("train");
  ck_assert(warned(&d, "do not look at the scene", "images/p05.png"));
  ck_ok(sf_dataset_survey(&d));
  ck_assert(warned(&d, "factor 2", "images/p02.png"));
  ck_assert(warned(&d, "stretched", "images/p02.png"));
  ck_assert(warned(&d, "optical centre", "images/p02.png"));
  ck_assert(warned(&d, "field of view: 152 degrees", "images/p03.png"));
  ck_assert(warned(&d, "pose of another", "images/p12.png: that of images/p11.png"));
  ck_assert(warned(&d, "far outside", "images/p10.png"));
}

/* Pixels of a rectangle that are rather red, rather blue, or dark. */
static void count_colours(const sf_image *image, int x0, int x1, int y0, int y1, int seen[3])
{
  for (int y = y0; y < y1; y++)
    for (int x = x0; x < x1; x++) {
      const uint16_t *p = image->rgba + 4 * (y * image->width + x);
      seen[0] += p[0] > 50000 && p[2] < 20000;
      seen[1] += p[2] > 50000 && p[0] < 20000;
      seen[2] += p[0] < 20000 && p[2] < 20000;
    }
}

/* Words at the top of both panels, the colours and the scale in the foot: its bar is as long as it says. */
TEST(the_plan_has_words_and_a_scale)
{
  enum { SIZE = 600 };
  const layout_rig rig = orbit();
  OWNED(sf_dataset) held;
  OWNED(sf_image) image;
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  reload("train"), load(&held, "test");
  ck_ok(sf_plan_draw(&d, &held, SIZE, &image));
  for (int side = 0; side < 2; side++) {
    int seen[3] = {0};
    count_colours(&image, side * SIZE, side * SIZE + 300, 12, 28, seen);
    ck_assert_int_gt(seen[2], 200);
  }
  int left[3] = {0}, right[3] = {0}, longest = 0, run = 0;
  count_colours(&image, 0, SIZE, SIZE, image.height, left);
  count_colours(&image, SIZE, 2 * SIZE, SIZE, image.height, right);
  ck_assert(left[0] > 100 && left[1] > 100 && right[2] > 100);
  for (int x = SIZE; x < 2 * SIZE; x++) {
    run = image.rgba[4 * ((SIZE + SF_PLAN_FOOT / 2) * image.width + x)] < 20000 ? run + 1 : 0;
    longest = run > longest ? run : longest;
  }
  double most = 0;
  for (int s = 0; s < 2; s++)
    for (int v = 0; v < (s ? held : d).count; v++)
      for (int i = 0; i < 3; i++) most = fmax(most, fabs((double)(s ? held : d).view[v].camera.to_world[4 * i + 3]));
  const double length = (longest - 1) * 1.15 * most / (0.5 * SIZE); /* model units */
  ck_assert_msg(fabs(length - 0.5) < 0.01, "the bar is %g long", length);
}

/* From above and from the side: each camera's own point has its colour, the box's edges are grey. */
TEST(the_plan_shows_every_camera)
{
  enum { SIZE = 200 };
  const layout_rig rig = orbit();
  sf_dataset held;
  OWNED(sf_image) image;
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  reload("train"), load(&held, "test");
  ck_ok(sf_plan_draw(&d, &held, SIZE, &image));
  ck_assert(image.width == 2 * SIZE && image.height == SIZE + SF_PLAN_FOOT);
  double most = 0;
  for (int v = 0; v < d.count; v++)
    for (int i = 0; i < 3; i++) most = fmax(most, fabs((double)d.view[v].camera.to_world[4 * i + 3]));
  for (int v = 0; v < held.count; v++)
    for (int i = 0; i < 3; i++) most = fmax(most, fabs((double)held.view[v].camera.to_world[4 * i + 3]));
  for (int v = 0; v < held.count; v++) { /* drawn last */
    const float *m = held.view[v].camera.to_world;
    const double half = 0.5 * SIZE, reach = 1.15 * most;
    for (int side = 0; side < 2; side++) {
      const int x = side * SIZE + (int)floor(half + half * (double)m[3] / reach);
      const int y = (int)floor(half - half * (double)m[side ? 11 : 7] / reach);
      const uint16_t *p = image.rgba + 4 * (y * 2 * SIZE + x);
      ck_assert_msg(p[0] > 50000 && p[2] < 20000, "camera %d, panel %d: %d %d %d", v, side, p[0], p[1], p[2]);
    }
  }
  sf_dataset_free(&held);
}

TEST(cameras_that_all_look_away_are_refused)
{
  layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms_train.json", &rig, "", "images", 0,
           1); /* Blender: about the origin; these are about (3, -2, 1) */
  for (int v = 0; v < VIEWS; v++)
    for (int i = 0; i < 12; i++)
      if (i % 4 == 0 || i % 4 == 2) rig.view[v].to_world[i] *= -1;
  put_json("transforms_train.json", &rig, "", "images", 0, 1);
  ck_bad(reload_as("train", NULL), SF_E_RANGE, "transforms_train.json", "no view looks at the scene");
}

/* OpenCV's axes, taken for OpenGL's: about the scene, but looking out. A few such views are named one by one. */
LOOP_TEST(cameras_that_turn_their_backs_are_told, 3)
{
  static const int every[] = {1, 3, 8};
  layout_rig rig = orbit();
  for (int v = 0; v < VIEWS; v += every[_i])
    for (int i = 0; i < 12; i++)
      if (i % 4 == 1 || i % 4 == 2) rig.view[v].to_world[i] *= -1;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms.json", &rig, "", "images", 0, 1);
  reload("train");
  ck_assert(warned(&d, _i ? "6 of 17" : "17 of 17", "turn their backs") == (_i < 2));
  ck_assert(warned(&d, "3 of 17", "do not look at the scene") == (_i == 2));
}

LOOP_TEST(mirrored_poses_are_told, 2)
{
  layout_rig rig = orbit();
  for (int v = 2; v < VIEWS; v += 3)
    for (int i = 0; i < 3; i++) rig.view[v].to_world[4 * i] *= -1;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms.json", &rig, "", "images", 0, 1);
  reload("test");
  ck_assert(warned(&d, "5 of 17 poses are mirrored", "images/p02.png"));
  unlink(in("transforms.json"));
  put_llff(&rig, 0, 4, 40);
  reload("train");
  ck_assert(warned(&d, "poses_bounds.npy: 5 of 17 poses are mirrored", "images/p02.png"));
  memcpy(rig.view[4].to_world, rig.view[3].to_world, sizeof rig.view[4].to_world);
  for (int i = 0; i < 3; i++) rig.view[4].to_world[4 * i + 2] = rig.view[4].to_world[4 * i + _i];
  put_llff(&rig, 0, 4, 40);
  ck_bad(reload_as("train", NULL), SF_E_RANGE, "row 4", "not at right angles");
}

/* The one that is used is said to be the smaller; equal ones need no word. */
LOOP_TEST(a_larger_model_beside_is_told, 2)
{
  layout_rig rig = orbit(), part = rig;
  part.views = 9;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_colmap("sparse/0", &part, _i);
  put_colmap("sparse/1", &part, _i);
  reload("train");
  ck_assert_int_eq(d.warnings, 0);
  put_colmap("sparse/2", &rig, _i);
  reload("train");
  ck_assert(d.count == 7 && d.warnings == 1);
  ck_assert(warned(&d, "another model is larger", _i ? "sparse/2/images.txt" : "sparse/2/images.bin"));
}

/* Quaternions of two digits: axes at right angles and of length 1 all the same. */
LOOP_TEST(rounded_quaternions_are_rotations, 2)
{
  const layout_rig rig = orbit();
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  ck_ok(sf_write_file(in("sparse/0/cameras.txt"), "1 PINHOLE 16 12 20 20 8 6\n", 26));
  const char images[] = "1 0.71 0.71 0 0 0 0 4 1 p00.png\n\n2 0.71 0 0.7 0 0 0 4 1 p01.png\n\n";
  ck_ok(sf_write_file(in("sparse/0/images.txt"), images, sizeof images - 1));
  unlink(in("sparse/0/cameras.bin"));
  reload(_i ? "train" : "test");
  const float *m = d.view[0].camera.to_world;
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++)
      ck_assert_double_eq_tol((double)(m[a] * m[b] + m[4 + a] * m[4 + b] + m[8 + a] * m[8 + b]), a == b, 1e-6);
}

typedef struct bad_npy {
  const char *descr, *order, *shape;
  int bytes; /* of numbers */
  sf_code code;
  const char *problem;
} bad_npy;
static const bad_npy bad_npys[] = {
    {">f8", "False", "(17, 17)", 2312, SF_E_UNSUPPORTED, "dtype >f8 (most significant byte first)"},
    {"<i8", "False", "(17, 17)", 2312, SF_E_UNSUPPORTED, "dtype <i8: expected <f8 or <f4"},
    {"|O", "False", "(17, 17)", 2312, SF_E_UNSUPPORTED, "dtype |O"},
    {"<f8", "True", "(17, 17)", 2312, SF_E_UNSUPPORTED, "fortran_order"},
    {"<f8", "False", "(17, 15)", 2040, SF_E_FORMAT, "shape (17, 15): expected"},
    {"<f8", "False", "(289,)", 2312, SF_E_FORMAT, "shape (289,): expected"},
    {"<f8", "False", "(17, 17)", 2311, SF_E_FORMAT, "cut short: 2311 bytes"},
    {"<f8", "False", "(17, 17)", 2313, SF_E_FORMAT, "too long: 2313 bytes"},
    {"<f8", "False", "(0, 17)", 0, SF_E_RANGE, "0 rows"},
    {"<f8", "False", "(17, 17)", 2312, SF_E_RANGE, "row 0: column 0 of the rotation"},
};

LOOP_TEST(bad_numpy_files_are_named, COUNT(bad_npys))
{
  static layout_file file;
  const bad_npy *bad = &bad_npys[_i];
  layout_npy_header(&file, bad->descr, bad->order, bad->shape);
  for (int i = 0; i < bad->bytes; i++) layout_put(&file, 0, 1);
  put("poses_bounds.npy", &file);
  ck_bad(reload_as("train", NULL), bad->code, "poses_bounds.npy", bad->problem);
}

TEST(positions_without_precision_are_named)
{
  layout_rig rig = row();
  rig.view[5].to_world[7] = 3e38;
  put_llff(&rig, 0, 4, 40);
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  ck_bad(reload_as("train", NULL), SF_E_RANGE, "poses_bounds.npy", "row 5: the position is 3e+38");
}

/* Every shorter file is refused by name: none is read beyond its end, none is taken for whole. */
LOOP_TEST(truncated_files_are_named, 4)
{
  static const char *const names[] = {"poses_bounds.npy", "sparse/0/cameras.bin", "sparse/0/images.bin",
                                      "sparse/0/points3D.bin"};
  static layout_file file;
  layout_rig rig = orbit();
  rig.views = 3, rig.points = 4;
  if (_i == 0) {
    layout_npy(&file, &rig, 0, 1, 2);
  } else {
    put_colmap("sparse/0", &rig, 0);
    if (_i == 1) layout_cameras(&file, &rig, 0);
    if (_i == 2) layout_images(&file, &rig, 0);
    if (_i == 3) layout_points(&file, &rig, 0);
  }
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put(names[_i], &file);
  ck_ok(reload_as("train", NULL));
  const size_t whole = file.size;
  for (file.size = 0; file.size < whole; file.size += 1 + file.size / 40) {
    put(names[_i], &file);
    ck_bad(reload_as("train", NULL), SF_E_FORMAT, names[_i], _i ? "cut short" : "");
    ck_assert_ptr_null(d.view);
  }
  file.size = whole + 1;
  put(names[_i], &file);
  ck_bad(reload_as("train", NULL), SF_E_FORMAT, names[_i], "too");
}

LOOP_TEST(camera_models_are_refused_by_name, 4)
{
  static const layout_lens other[] = {{5, 5, "OPENCV_FISHEYE", WIDTH, HEIGHT, 8, {20, 20, 8, 6}},
                                      {5, 6, "FULL_OPENCV", WIDTH, HEIGHT, 8, {20, 20, 8, 6}},
                                      {5, 7, "FOV", WIDTH, HEIGHT, 5, {20, 20, 8, 6, 1}},
                                      {5, 10, "THIN_PRISM_FISHEYE", WIDTH, HEIGHT, 8, {20, 20, 8, 6}}};
  layout_rig rig = orbit();
  rig.lens[rig.lenses++] = other[_i];
  if (other[_i].params == 8 && other[_i].model > 5) { /* 12 numbers: the rest from a camera behind it */
    rig.lens[rig.lenses++] = other[0];
  }
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_colmap("sparse/0", &rig, 0);
  ck_bad(reload_as("train", NULL), SF_E_UNSUPPORTED, "cameras.bin: camera 5", other[_i].name);
}

typedef struct bad_text {
  const char *cameras, *images;
  sf_code code;
  const char *where, *problem;
} bad_text;
#define CAMERA "1 PINHOLE 16 12 20 20 8 6\n"
static const bad_text bad_texts[] = {
    {"1 BLA 16 12 20 20 8 6\n", "", SF_E_UNSUPPORTED, "cameras.txt:1", "unknown camera model BLA"},
    {"# x\n1 PINHOLE 16 12 20 20 8\n", "", SF_E_FORMAT, "cameras.txt:2", "number 4 cannot be read"},
    {"1 PINHOLE 16 12 20 20 8 6 1\n", "", SF_E_FORMAT, "cameras.txt:1: camera 1", "more than the 4 values of PINHOLE"},
    {"1 PINHOLE 16 0 20 20 8 6\n", "", SF_E_RANGE, "cameras.txt:1: camera 1", "16 x 0 pixels"},
    {"1 PINHOLE 16 12 20 -20 8 6\n", "", SF_E_RANGE, "cameras.txt:1: camera 1", "focal length"},
    {"1 PINHOLE 16 12 nan 20 8 6\n", "", SF_E_RANGE, "cameras.txt:1: camera 1", "parameter 0 of PINHOLE is not finite"},
    {CAMERA CAMERA, "1 1 0 0 0 0 0 0 1 p00.png\n\n", SF_E_FORMAT, "cameras.txt", "camera 1 is listed twice"},
    {CAMERA, "", SF_E_RANGE, "images.txt", "zero views"},
    {"# none\n", "1 1 0 0 0 0 0 0 2 p00.png\n\n", SF_E_FORMAT, "image 1 (p00.png)", "cameras.txt does not list"},
    {CAMERA, "1 1 0 0 0 0 0 0 2 p00.png\n\n", SF_E_FORMAT, "image 1 (p00.png)", "camera 2"},
    {CAMERA, "1 1 0 0 0 0 0 x 1 p00.png\n\n", SF_E_FORMAT, "images.txt:1", "number 8 cannot be read"},
    {CAMERA, "1 1 0 0 0.5 0 0 0 1 p00.png\n\n", SF_E_RANGE, "images.txt:1", "no unit quaternion"},
    {CAMERA, "1 1 0 0 0 0 inf 0 1 p00.png\n\n", SF_E_RANGE, "images.txt:1", "position is inf"},
    {CAMERA, "1 1 0 0 0 0 0 0 1 p00.png\n2 1 0 0 0 0 0 0 1 p01.png\n", SF_E_FORMAT, "images.txt:2", "X Y POINT3D_ID"},
    {CAMERA, "1 1 0 0 0 0 0 0 1 p00.png\n1 2 3 4 5 \r\n", SF_E_FORMAT, "images.txt:2", "X Y POINT3D_ID"},
    {CAMERA, "1 1 0 0 0 0 0 0 1 p00.png\n\n2 1 0 0 0 0 0 1 1 p00.png\n\n", SF_E_FORMAT, "images.txt",
     "images 1 and 2 have the same name p00.png"},
    {CAMERA, "1 1 0 0 0 0 0 0 1\n\n", SF_E_FORMAT, "images.txt:1", "no name"},
};

LOOP_TEST(bad_texts_are_named, COUNT(bad_texts))
{
  const bad_text *bad = &bad_texts[_i];
  const layout_rig rig = orbit();
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  ck_ok(sf_make_dir(in("sparse/0")));
  ck_ok(sf_write_file(in("sparse/0/cameras.txt"), bad->cameras, strlen(bad->cameras)));
  ck_ok(sf_write_file(in("sparse/0/images.txt"), bad->images, strlen(bad->images)));
  ck_bad(reload_as("train", NULL), bad->code, bad->where, bad->problem);
}

TEST(folders_that_do_not_fit_are_named)
{
  const layout_rig rig = row();
  put_llff(&rig, 0, 4, 40);
  ck_bad(reload_as("train", NULL), SF_E_IO, folder, "no folder images or images_N");
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  ck_bad(reload_as("val", NULL), SF_E_IO, "no split val", "train or test");
  ck_bad(reload_as("train", &(sf_dataset_options){.downscale = 2}), SF_E_RANGE, "images_4", "1/2");
  ck_bad(reload_as("train", &(sf_dataset_options){.downscale = 1}), SF_E_RANGE, "images_4", "1/1");
  put_picture("images_4/more.png", WIDTH, HEIGHT, 1, 255);
  ck_bad(reload_as("train", NULL), SF_E_FORMAT, "poses of 17 views", "images_4 holds 18 pictures");
  unlink(in("images_4/more.png"));
  put_picture("images_4/p03.png", WIDTH, 2 * HEIGHT, 1, 255);
  ck_bad(reload_as("train", NULL), SF_E_FORMAT, "images_4/p03.png", "16 x 24 pixels, its camera says 64 x 48");
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
