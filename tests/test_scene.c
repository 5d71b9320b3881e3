/* Cameras, the Blender loader. */
#include "ck_run.h"
#include "base/io.h"
#include "folder_fixture.h"
#include "scene/scene.h"
#include <math.h>

static void put_text(const char *path, const char *text)
{
  FILE *f = fopen(path, "wb");
  ck_assert_ptr_nonnull(f);
  fputs(text, f);
  ck_assert_int_eq(fclose(f), 0);
}

/* ---- cameras ---- */

TEST(rays_follow_opengl_axes)
{
  sf_camera c = {
      .width = 4, .height = 2, .fx = 2, .fy = 4, .cx = 2, .cy = 1, .to_world = {1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7}};
  float o[3], d[3];
  sf_camera_ray(&c, 2, 1, o, d);
  ck_assert(o[0] == 5 && o[1] == 6 && o[2] == 7);
  ck_assert(d[0] == 0 && d[1] == 0 && d[2] == -1);
  sf_camera_ray(&c, 4, 1, o, d); /* one focal length to the right: 45 degrees; floats round to 2^-24 */
  ck_assert_float_eq_tol(d[0], sqrtf(0.5f), 1e-7f);
  ck_assert_float_eq_tol(d[2], -sqrtf(0.5f), 1e-7f);
  sf_camera_ray(&c, 2, 5, o, d); /* down the picture is down in the world */
  ck_assert_float_eq_tol(d[1], -sqrtf(0.5f), 1e-7f);
  /* x to y, y to z, z to x: the ray through the centre looks along -x */
  const float turned[12] = {0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0};
  memcpy(c.to_world, turned, sizeof turned);
  sf_camera_ray(&c, 2, 1, o, d);
  ck_assert(d[0] == -1 && d[1] == 0 && d[2] == 0);
}

/* A spacing of the points that the function counts is a pixel of the picture at the middle of the box. */
TEST(points_of_the_box_lie_a_pixel_apart)
{
  sf_view view[2] = {{.camera = {.width = 100,
                                 .height = 100,
                                 .fx = 80,
                                 .fy = 80,
                                 .cx = 50,
                                 .cy = 50,
                                 .to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2}}}};
  sf_dataset data = {.view = view, .count = 1};
  const int points = sf_dataset_pixels(&data, 4);
  float at[2];
  ck_assert(sf_camera_project(&view[0].camera, (float[3]){8 / (float)points, 0, 0}, at));
  ck_assert_float_eq_tol(at[0], 51, 1e-4f);
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), points / 4);
  view[1] = view[0]; /* twice the focal length at four times the distance: 120 px at 5 units in the mean */
  view[1].camera.fx = view[1].camera.fy = 160, view[1].camera.to_world[11] = 8, data.count = 2;
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 48);
  view[1].camera.fx = view[1].camera.fy = 1e-6f, view[0] = view[1];
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 1);
  for (int v = 0; v < 2; v++) view[v].camera.fx = 80, view[v].camera.fy = 80, view[v].camera.to_world[11] = 0;
  ck_assert_int_eq(sf_dataset_pixels(&data, 64), 1 << 20); /* cameras in the middle */
}

/* ---- the loader ---- */

#define UNIT "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]"
#define FRAME(file, matrix) "{\"file_path\":\"" file "\",\"transform_matrix\":" matrix "}"
#define ANGLE "\"camera_angle_x\":1.5707963267948966,"

static void put_picture(const char *name, int width, int height, int value)
{
  sf_image image = {width, height, malloc((size_t)width * (size_t)height * 8)};
  for (int i = 0; i < width * height * 4; i++) image.rgba[i] = (uint16_t)(value * 257);
  ck_ok(sf_image_save_png(&image, in(name)));
  sf_image_free(&image);
}

static sf_dataset d; /* what a test looks at */

static sf_status load(const char *json, const char *split, sf_dataset_options options)
{
  sf_dataset_free(&d);
  if (json) put_text(in("transforms_train.json"), json);
  if (json) put_text(in("transforms_test.json"), json);
  return sf_dataset_load(&d, folder, split, &options);
}

TEST(loads_camera_angle)
{
  put_picture("a.png", 8, 4, 7);
  put_picture("b.png", 8, 4, 9);
  ck_ok(load("{" ANGLE
             "\"frames\":[" FRAME("./a", UNIT) "," FRAME("b.png", "[[2,0,0,1],[0,0,-3,2],[0,1,0,3],[0,0,0,1]]") "]}",
             "train", (sf_dataset_options){.downscale = 1}));
  ck_assert_int_eq(d.count, 2);
  ck_assert_str_eq(d.view[0].name, "a");
  ck_assert_str_eq(d.view[1].name, "b.png");
  ck_assert_uint_eq(d.view[1].image.rgba[5], 9 * 257);
  const sf_camera *c = &d.view[1].camera;
  ck_assert_float_eq_tol(c->fx, 4, 1e-6f); /* half the width over tan 45 degrees */
  ck_assert_float_eq_tol(c->fy, 4, 1e-6f);
  ck_assert(c->cx == 4 && c->cy == 2 && c->width == 8 && c->height == 4);
  const float e[12] = {1, 0, 0, 0.8f, 0, 0, -1, 1.6f, 0, 1, 0, 2.4f}; /* normalised columns, position * 0.8 */
  for (int i = 0; i < 12; i++) ck_assert_float_eq_tol(c->to_world[i], e[i], 1e-6f);
  ck_assert(d.scale == 0.8f);
  sf_dataset_free(&d);
  ck_assert_ptr_null(d.view);
}

TEST(options_and_stated_intrinsics)
{
  put_picture("a.png", 8, 4, 7);
  put_picture("b.png", 8, 4, 9);
  /* stated for 16 x 8, the pictures are half of that; frame b has a field of view of its own */
  ck_ok(load("{\"fl_x\":10,\"fl_y\":12,\"cx\":7,\"cy\":5,\"w\":16,\"h\":8,\"k1\":0,\"frames\":[" FRAME(
                 "a", UNIT) ",{\"fl_x\":20,\"file_path\":\"b\",\"transform_matrix\":" UNIT "}]}",
             "test", (sf_dataset_options){.downscale = 2, .scale = 0.5f}));
  ck_assert(d.view[0].camera.fx == 2.5f && d.view[0].camera.fy == 3.0f);
  ck_assert(d.view[0].camera.cx == 1.75f && d.view[0].camera.cy == 1.25f);
  ck_assert(d.view[1].camera.fx == 5.0f && d.view[1].camera.fy == 5.0f);
  ck_assert(d.view[0].camera.width == 4 && d.view[0].image.height == 2);
  ck_assert(d.view[0].camera.to_world[3] == 0.5f && d.view[0].camera.to_world[11] == 1.5f);
  ck_ok(load(NULL, "test", (sf_dataset_options){.downscale = 1, .limit = 1}));
  ck_assert_int_eq(d.count, 1);
  ck_ok(load("{\"fl_x\":10,\"fl_y\":12,\"frames\":[" FRAME(
                 "a", UNIT) ",{\"camera_angle_x\":1.5707963267948966,\"file_path\":\"b\",\"transform_matrix\":" UNIT
                            "}]}",
             "test", (sf_dataset_options){.downscale = 1}));
  ck_assert(d.view[0].camera.fx == 10.0f && d.view[0].camera.fy == 12.0f);
  ck_assert_float_eq_tol(d.view[1].camera.fx, 4, 1e-6f);
  ck_assert_float_eq_tol(d.view[1].camera.fy, 4, 1e-6f);
}

/* Of 16 x 8 where the pictures have half of that: by one number as by both. */
TEST(one_side_states_the_size)
{
  static const char *const size[] = {"\"w\":16,\"h\":8", "\"w\":16", "\"h\":8"};
  float scale = 0;
  put_picture("a.png", 8, 4, 0);
  for (int i = 0; i < 3; i++) {
    char json[400];
    snprintf(json, sizeof json,
             "{%s,\"fl_x\":20,\"cx\":6,\"cy\":5,\"frames\":[" FRAME("a", UNIT) "," FRAME(
                 "a", "[[0,0,1,4],[0,1,0,2],[-1,0,0,0],[0,0,0,1]]") "]}",
             size[i]);
    put_text(in("transforms.json"), json);
    ck_ok(sf_dataset_load(&d, folder, "train", NULL));
    const sf_camera *c = &d.view[0].camera;
    ck_assert(c->fx == 10 && c->fy == 10 && c->cx == 3 && c->cy == 2.5f);
    if (!i) scale = d.scale;
    ck_assert_float_gt(scale, 1); /* of what is seen: 0.2 of the distance */
    ck_assert(d.scale == scale);
  }
}

/* Of the picture that states no size, whatever the first states. */
TEST(a_later_size_is_looked_at)
{
  put_picture("a.png", 8, 4, 0);
  put_text(in("transforms_train.json"),
           "{" ANGLE "\"frames\":[{\"file_path\":\"a\",\"w\":8,\"h\":4,\"cx\":4,\"transform_matrix\":" UNIT
           "},{\"file_path\":\"a\",\"cx\":200,\"transform_matrix\":" UNIT "}]}");
  ck_ok(sf_dataset_load(&d, folder, "train", NULL));
  ck_assert_int_eq(d.warnings, 1);
  ck_assert_ptr_nonnull(strstr(d.warning[0], "not look at the scene"));
}

TEST(every_eighth_view_is_held_out)
{
  char json[4000] = "{" ANGLE "\"frames\":[";
  for (int i = 0; i < 17; i++) {
    char name[20];
    snprintf(name, sizeof name, "v%d.png", i);
    put_picture(name, 2, 2, i);
    snprintf(json + strlen(json), 200, "%s{\"file_path\":\"%s\",\"transform_matrix\":" UNIT "}", i ? "," : "", name);
  }
  strcat(json, "]}");
  for (int named = 0; named < 2; named++) {
    OWNED(sf_dataset) train, test;
    put_text(in(named ? "transforms_train.json" : "transforms.json"), json);
    ck_ok(sf_dataset_load(&train, folder, "train", NULL));
    ck_ok(sf_dataset_load(&test, folder, "test", NULL));
    ck_assert_int_eq(train.count, 14);
    ck_assert_int_eq(test.count, 3);
    for (int i = 0; i < 14; i++) ck_assert_uint_eq(train.view[i].image.rgba[0] / 257, (unsigned)(i + 1 + i / 7));
    for (int i = 0; i < 3; i++) ck_assert_uint_eq(test.view[i].image.rgba[0] / 257, (unsigned)(8 * i));
  }
  put_text(in("transforms_train.json"), "{" ANGLE "\"frames\":[" FRAME("v1", UNIT) "]}");
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_RANGE, "zero views", "transforms_train.json");
}

#define ONE(matrix) "{" ANGLE "\"frames\":[" FRAME("a", UNIT) "," FRAME("a", matrix) "]}"
static const struct {
  const char *json;
  sf_code code;
  const char *where, *problem;
} bad_scenes[] = {
    {"{", SF_E_FORMAT, "transforms_train.json:1:", "malformed"},
    {"[]", SF_E_FORMAT, "transforms_train.json", "not a JSON object"},
    {"{" ANGLE "\"frames\":[]}", SF_E_RANGE, "transforms_train.json", "zero views"},
    {"{" ANGLE "\"x\":[]}", SF_E_FORMAT, "transforms_train.json", "frames is missing"},
    {"{\"frames\":[" FRAME("a", UNIT) "]}", SF_E_FORMAT, "frame 0 (a)", "no field of view"},
    {"{\"camera_angle_x\":0,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, "transforms_train.json", "camera_angle_x"},
    {"{\"camera_angle_x\":3.15,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, ".json", "camera_angle_x is 3.15"},
    {"{\"camera_angle_x\":1e999,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, ".json", "not finite"},
    {"{\"camera_angle_x\":\"1\",\"frames\":[" FRAME("a", UNIT) "]}", SF_E_FORMAT, ".json", "not a number"},
    {"{\"fl_x\":-3,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, ".json", "fl_x is -3"},
    {"{\"fl_x\":3,\"k3\":0.01,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_UNSUPPORTED, ".json", "k3 = 0.01"},
    {"{\"fl_x\":3,\"camera_model\":\"FISHEYE\",\"frames\":[" FRAME("a", UNIT) "]}", SF_E_UNSUPPORTED, ".json",
     "FISHEYE"},
    {"{\"fl_x\":3,\"w\":8,\"h\":8,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_FORMAT, "frame 0 (a)", "says 8 x 8"},
    {"{" ANGLE "\"frames\":[" FRAME("a", UNIT) ",3]}", SF_E_FORMAT, "frame 1", "not an object"},
    {"{" ANGLE "\"frames\":[{\"transform_matrix\":" UNIT "}]}", SF_E_FORMAT, "frame 0", "file_path"},
    {"{" ANGLE "\"frames\":[{\"file_path\":\"a\"}]}", SF_E_FORMAT, "frame 0 (a)", "transform_matrix is not"},
    {"{" ANGLE "\"frames\":[" FRAME("a", UNIT) "," FRAME("gone", UNIT) "]}", SF_E_IO, "gone.png", "frame 1 of"},
    {"{" ANGLE "\"frames\":[" FRAME("a", UNIT) "," FRAME("gone.jpg", UNIT) "]}", SF_E_IO, "gone.jpg", "No such file"},
    {"{" ANGLE "\"frames\":[" FRAME("a", UNIT) "," FRAME("cut", UNIT) "]}", SF_E_FORMAT, "cut.png", "cut short"},
    {"{" ANGLE "\"frames\":[" FRAME("a", UNIT) "," FRAME("other", UNIT) "]}", SF_E_FORMAT, "frame 0 (a) has 8 x 4",
     "frame 1 (other) has 4 x 4"},
    {"{\"fl_x\":1e-40,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, "frame 0 (a)", "focal length of 1e-40"},
    {"{\"fl_x\":3,\"cx\":1,\"w\":1e-9,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, "frame 0 (a)",
     "focal length of 2.4e+10"},
    {"{\"fl_x\":3,\"cx\":9e6,\"w\":1e-2,\"h\":1e-2,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, "frame 0 (a)",
     "optical centre at pixel 7.2e+09"},
    {"{\"fl_x\":8,\"cx\":100,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, ".json", "no view looks at the scene"},
    {"{\"fl_x\":8,\"cy\":100,\"frames\":[" FRAME("a", UNIT) "]}", SF_E_RANGE, ".json", "no view looks at the scene"},
    {"{" ANGLE "\"frames\":[" FRAME("/dev/zero", UNIT) "]}", SF_E_IO, "/dev/zero", "not a regular file"},
    {ONE("[[1,0,0,1],[0,1,0,2],[0,0,1,3]]"), SF_E_FORMAT, "frame 1 (a)", "4 rows"},
    {ONE("[[1,0,0,1],[0,1,0],[0,0,1,3],[0,0,0,1]]"), SF_E_FORMAT, "frame 1 (a)", "transform_matrix[1]"},
    {ONE("[[1,0,0,1],[0,1,0,null],[0,0,1,3],[0,0,0,1]]"), SF_E_FORMAT, "frame 1 (a)", "transform_matrix[1][3]"},
    {ONE("[[1,0,0,1],[0,1,0,1e40],[0,0,1,3],[0,0,0,1]]"), SF_E_RANGE, "frame 1 (a)",
     "transform_matrix[1][3] is not finite"},
    {ONE("[[1,0,0,1],[0,1,0,NaN],[0,0,1,3],[0,0,0,1]]"), SF_E_FORMAT, "transforms_train.json:1:", "malformed"},
    {ONE("[[1,0,0,1],[0,1,0,1],[0,0,0,3],[0,0,0,1]]"), SF_E_RANGE, "frame 1 (a)", "column 2"},
    {ONE("[[1,1,0,1],[0,0,0,1],[0,0,1,3],[0,0,0,1]]"), SF_E_RANGE, "frame 1 (a)", "no rotation"},
    {ONE("[[1,0,0,1],[0.03,1,0,1],[0,0,1,3],[0,0,0,1]]"), SF_E_RANGE, "frame 1 (a)",
     "columns 0 and 1 are not at right"},
    {ONE("[[1,0,-0.03,1],[0,1,0,1],[0,0,1,3],[0,0,0,1]]"), SF_E_RANGE, "frame 1 (a)",
     "columns 2 and 0 are not at right"},
    {ONE("[[1,0,0,1],[0,1,0,1],[0,0,1,3],[0,0,1,1]]"), SF_E_RANGE, "frame 1 (a)", "[3][2]"},
};

TEST(a_split_is_walked_view_by_view)
{
  put_picture("a.png", 4, 4, 7);
  const char *json = "{" ANGLE "\"frames\":[" FRAME("a", UNIT) "," FRAME("./a", UNIT) "," FRAME("a.png", UNIT) "]}";
  static const char *const name[] = {"a", "a", "a.png"};
  for (int i = 0; i < 3; i++) {
    ck_ok(load(json, "test", (sf_dataset_options){.first = i, .limit = 1}));
    ck_assert_int_eq(d.count, 1);
    ck_assert_int_eq(d.total, 3);
    ck_assert_str_eq(d.view[0].name, name[i]);
  }
  ck_ok(load(json, "test", (sf_dataset_options){.first = 1}));
  ck_assert_int_eq(d.count, 2);
  ck_assert_str_eq(d.view[1].name, "a.png");
  ck_ok(load(json, "test", (sf_dataset_options){.first = 3, .limit = 1}));
  ck_assert_int_eq(d.count, 0);
  ck_assert_int_eq(d.total, 3);
  ck_bad(load(json, "test", (sf_dataset_options){.first = -1}), SF_E_RANGE, "-1", folder);
}

LOOP_TEST(faults_name_file_and_frame, COUNT(bad_scenes))
{
  put_picture("a.png", 8, 4, 7);
  put_picture("other.png", 4, 4, 7);
  size_t n;
  char *data = read_whole(in("a.png"), &n);
  put_file(in("cut.png"), data, n - 20);
  free(data);
  ck_bad(load(bad_scenes[_i].json, "train", (sf_dataset_options){.downscale = 1}), bad_scenes[_i].code,
         bad_scenes[_i].where, bad_scenes[_i].problem);
  ck_assert_ptr_null(d.view);
}

TEST(own_sizes_may_differ)
{
  put_picture("a.png", 8, 4, 7);
  put_picture("other.png", 4, 6, 7);
  ck_ok(load("{\"frames\":[{\"w\":8,\"h\":4,\"fl_x\":8,\"file_path\":\"a\",\"transform_matrix\":" UNIT "},"
             "{\"w\":4,\"h\":6,\"fl_x\":8,\"file_path\":\"other\",\"transform_matrix\":" UNIT "}]}",
             "train", (sf_dataset_options){.downscale = 1}));
  ck_assert_int_eq(d.view[1].camera.height, 6);
}

TEST(folder_and_option_faults)
{
  ck_bad(sf_dataset_load(&d, in("none"), "train", NULL), SF_E_IO, "/none", "no such folder");
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_IO, folder, "transforms.json");
  ck_bad(sf_dataset_load(&d, folder, "val", NULL), SF_E_IO, "transforms_val.json", "no such file");
  put_picture("a.png", 8, 4, 7);
  const char *json = "{" ANGLE "\"frames\":[" FRAME("a", UNIT) "]}";
  ck_bad(load(json, "train", (sf_dataset_options){.downscale = 5}), SF_E_RANGE, "a.png", "8 x 4");
  ck_bad(load(json, "train", (sf_dataset_options){.downscale = 1, .scale = NAN}), SF_E_RANGE, "scale", "");
  ck_bad(load(json, "train", (sf_dataset_options){.downscale = 1, .scale = -1}), SF_E_RANGE, "scale", "");
  ck_bad(load(json, "train", (sf_dataset_options){.downscale = 1, .scale = 3e38f}), SF_E_RANGE, "frame 0 (a)",
         "not finite");
  ck_bad(load(json, "train", (sf_dataset_options){.downscale = -1}), SF_E_RANGE, "downscale", "");
}

static void tear_down(void)
{
  sf_dataset_free(&d);
  remove_folder();
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
