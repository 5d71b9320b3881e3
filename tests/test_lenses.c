/* Lenses against OpenCV's equations, and as every layout brings them. */
#include "ck_run.h"
#include "layout_folder.h"
#include "src/scene/lens.h"

static sf_camera make_camera(double k1, double k2, double p1, double p2)
{
  return (sf_camera){.width = 200,
                     .height = 150,
                     .fx = 180,
                     .fy = 170,
                     .cx = 97,
                     .cy = 80,
                     .to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0},
                     .k1 = (float)k1,
                     .k2 = (float)k2,
                     .p1 = (float)p1,
                     .p2 = (float)p2};
}

static const double lenses[][4] = {{0.0578421, -0.0805099, -0.000980296, 0.00015575}, /* fox */
                                   {-0.28, 0.07, 0.0002, 0.00002},
                                   {0.3, 0.1, 0, 0},
                                   {-0.05, 0, 0.02, -0.03}};

LOOP_TEST(a_lens_is_undone_to_1e4_of_a_pixel, COUNT(lenses))
{
  const double *k = lenses[_i];
  const sf_camera c = make_camera(k[0], k[1], k[2], k[3]);
  ck_ok(sf_lens_check(&c, "lens"));
  for (int y = 0; y <= 150; y += 3)
    for (int x = 0; x <= 200; x += 4) {
      const double bent[2] = {(x - 97) / 180.0, (y - 80) / 170.0};
      double straight[2], again[2];
      sf_lens_straighten(&c, bent, straight);
      sf_lens_bend(&c, straight, again);
      ck_assert_double_eq_tol(again[0] * 180, bent[0] * 180, 1e-4);
      ck_assert_double_eq_tol(again[1] * 170, bent[1] * 170, 1e-4);
      /* the ray, in floats: a point on it is seen at the pixel, to the rounding of 200 px */
      float o[3], d[3], pixel[2], p[3];
      sf_camera_ray(&c, (float)x, (float)y, o, d);
      for (int i = 0; i < 3; i++) p[i] = 5 * d[i];
      ck_assert(sf_camera_project(&c, p, pixel));
      ck_assert_float_eq_tol(pixel[0], (float)x, 1e-4f);
      ck_assert_float_eq_tol(pixel[1], (float)y, 1e-4f);
    }
}

/* By hand from OpenCV's formula at x = 0.3, y = -0.2: r2 = 0.13. */
TEST(a_lens_bends_as_opencv_says)
{
  const sf_camera c = make_camera(0.1, -0.2, 0.01, 0.02);
  double bent[2];
  sf_lens_bend(&c, (double[2]){0.3, -0.2}, bent);
  const double gain = 1 + 0.1 * 0.13 - 0.2 * 0.0169;
  ck_assert_double_eq_tol(bent[0], 0.3 * gain + 2 * 0.01 * 0.3 * -0.2 + 0.02 * (0.13 + 2 * 0.09), 1e-9);
  ck_assert_double_eq_tol(bent[1], -0.2 * gain + 0.01 * (0.13 + 2 * 0.04) + 2 * 0.02 * 0.3 * -0.2, 1e-9);
  ck_assert_double_eq_tol(bent[0], 0.307886, 1e-6);
  ck_assert_double_eq_tol(bent[1], -0.202224, 1e-6);
  /* y down the picture: positive p1 pulls points down, so the centre's ray looks up */
  const sf_camera down = make_camera(0, 0, 0.05, 0);
  float o[3], d[3];
  sf_camera_ray(&down, 197, 80, o, d);
  ck_assert_float_gt(d[1], 0);
}

TEST(a_lens_that_folds_is_refused)
{
  const sf_camera folds = make_camera(-1.2, 0, 0, 0), bends = make_camera(-0.2, 0, 0, 0);
  ck_ok(sf_lens_check(&bends, "cameras.bin: camera 3"));
  ck_bad(sf_lens_check(&folds, "cameras.bin: camera 3"), SF_E_RANGE, "cameras.bin: camera 3",
         "cannot be undone at pixel");
  layout_rig rig = orbit();
  rig.lens[0] = (layout_lens){7, 2, "SIMPLE_RADIAL", WIDTH, HEIGHT, 4, {8, 8, 6, -1.2}};
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  ck_bad(reload_as("train", NULL), SF_E_RANGE, "camera 7", "cannot be undone");
}

/* The same picture taken through a lens, by COLMAP's models and by instant-ngp's names: a point is seen where the lens
 * says. */
LOOP_TEST(lenses_come_from_every_layout, 6)
{
  static const layout_lens kinds[] = {{7, 2, "SIMPLE_RADIAL", WIDTH, HEIGHT, 4, {20, 8, 6, 0.1}},
                                      {7, 3, "RADIAL", WIDTH, HEIGHT, 5, {20, 8, 6, 0.1, -0.05}},
                                      {7, 4, "OPENCV", WIDTH, HEIGHT, 8, {20, 20, 8, 6, 0.1, -0.05, 0.01, 0.02}}};
  static const float wanted[][4] = {{0.1f, 0, 0, 0}, {0.1f, -0.05f, 0, 0}, {0.1f, -0.05f, 0.01f, 0.02f}};
  layout_rig rig = orbit();
  rig.lens[0] = kinds[_i % 3];
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  if (_i < 3) {
    put_colmap("sparse/0", &rig, 0);
  } else {
    char more[200];
    const float *k = wanted[_i % 3];
    snprintf(more, sizeof more, "\"cx\":8,\"cy\":6,\"k1\":%g,\"k2\":%g,\"p1\":%g,\"p2\":%g,", (double)k[0],
             (double)k[1], (double)k[2], (double)k[3]);
    rig.lens[0].param[1] = 20;
    put_json("transforms.json", &rig, more, "images", 0, 1);
  }
  reload("train");
  const sf_camera *c = &d.view[0].camera;
  ck_assert_str_eq(d.view[0].lens, kinds[_i % 3].name);
  ck_assert(c->k1 == wanted[_i % 3][0] && c->k2 == wanted[_i % 3][1]);
  ck_assert(c->p1 == wanted[_i % 3][2] && c->p2 == wanted[_i % 3][3]);
  ck_assert(c->fx == 20 && c->fy == 20 && c->cx == 8 && c->cy == 6);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
