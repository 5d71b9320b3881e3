/* Lenses against OpenCV's equations, and as every layout brings them. */
#include "ck_run.h"
#include "tests/expected.h"
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

/* A lens: bent there and straightened back; the slopes as differences say; what folds is refused, and where. */
TEST(lenses_bend_and_straighten)
{
  const sf_camera lens = {.width = 40,
                          .height = 30,
                          .fx = 30,
                          .fy = 28,
                          .cx = 19,
                          .cy = 16,
                          .k1 = -0.2f,
                          .k2 = 0.05f,
                          .p1 = 0.01f,
                          .p2 = -0.02f};
  for (int i = 0; i < 35; i++) {
    const double x = 0.3 * (i % 7 - 3), y = 0.3 * (i / 7 - 2), r2 = x * x + y * y;
    const double k1 = (double)lens.k1, k2 = (double)lens.k2, p1 = (double)lens.p1, p2 = (double)lens.p2;
    const double gain = 1 + k1 * r2 + k2 * r2 * r2, straight[2] = {x, y};
    double bent[2], again[2];
    sf_lens_bend(&lens, straight, bent);
    ck_assert_double_eq_tol(bent[0], x * gain + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), 1e-15);
    ck_assert_double_eq_tol(bent[1], y * gain + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y, 1e-15);
    sf_lens_straighten(&lens, bent, again);
    ck_assert_double_eq_tol(again[0], x, 1e-12);
    ck_assert_double_eq_tol(again[1], y, 1e-12);
  }
  ck_ok(sf_lens_check(&lens, "w"));
  for (int k = 0; k < 4; k++) {
    sf_camera folded = {.width = 40, .height = 30, .fx = 30, .fy = 28, .cx = 19, .cy = 16};
    ck_assert(!sf_lens_bends(&folded));
    float *number[4] = {&folded.k1, &folded.k2, &folded.p1, &folded.p2};
    *number[k] = k < 2 ? -0.9f : 0.6f;
    ck_assert(sf_lens_bends(&folded));
    static char text[4][80] = {"k1 -0.9, k2 0, p1 0, p2 0) cannot be undone at pixel (0, 0)",
                               "k1 0, k2 -0.9, p1 0, p2 0) cannot be undone at pixel (0, 0)",
                               "p1 0.6, p2 0) cannot be undone at pixel (0, 0)",
                               "p1 0, p2 0.6) cannot be undone at pixel (0, 0)"};
    ck_bad(sf_lens_check(&folded, "w"), SF_E_RANGE, "w: the lens", text[k]);
  }
  const sf_camera plain = {.width = 1 << 20, .height = 1 << 20, .fx = 1, .fy = 1};
  ck_ok(sf_lens_check(&plain, "w"));
}

/* The strongest lens of each kind that can be undone. */
static void lens_limits(FILE *out)
{
  for (int kind = 0; kind < 10; kind++) {
    double good = 0, bad = 40;
    for (int i = 0; i < 40; i++) {
      const float k = (float)(0.5 * (good + bad)), sign = kind % 2 ? 1 : -1;
      sf_camera lens = {.width = 40, .height = 30, .fx = 30, .fy = 28, .cx = 19, .cy = 16};
      float *number[4] = {&lens.k1, &lens.k2, &lens.p1, &lens.p2};
      if (kind < 8) *number[kind / 2] = sign * k;
      if (kind >= 8) lens.k1 = -0.3f * k, lens.k2 = 0.1f * k, lens.p1 = sign * k, lens.p2 = 0.7f * k;
      *(sf_lens_check(&lens, "w").code ? &bad : &good) = (double)k;
    }
    fprintf(out, "kind %d: %.4f\n", kind, good);
  }
}

TEST(lenses_at_their_limits)
{
  ck_expected_text("lens-limits.txt", out, lens_limits(out));
}

/* Only what lies before the camera is seen. */
TEST(points_are_before_the_camera_or_not)
{
  const sf_camera c = {.width = 40,
                       .height = 30,
                       .fx = 50,
                       .fy = 40,
                       .cx = 20,
                       .cy = 15,
                       .to_world = {0, 0, 1, 3, 1, 0, 0, 4, 0, 1, 0, 5}}; /* looks along -x */
  float pixel[2] = {-1, -1};
  for (int i = 0; i < 4; i++) {
    const float behind[3] = {3 + 0.4f * (float)i, 4.1f, 5.2f};
    ck_assert(!sf_camera_project(&c, behind, pixel));
    ck_assert(pixel[0] == -1 && pixel[1] == -1);
  }
  ck_assert(sf_camera_project(&c, (float[3]){1, 4.4f, 5.3f}, pixel));
  ck_assert_float_eq_tol(pixel[0], 20 + 50 * 0.2f, 1e-4f);
  ck_assert_float_eq_tol(pixel[1], 15 - 40 * 0.15f, 1e-4f);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = tear_down};
