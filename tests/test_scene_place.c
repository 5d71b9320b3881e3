/* Where the readers of data sets place a scene, in numbers: kept as texts. Rays of the views that lie there. */
#include "ck_run.h"
#include "src/scene/capture.h"
#include "tests/expected.h"
#include <math.h>

enum { VIEWS = 6, POINTS = 5 };
typedef struct rig {
  sf_capture capture;
  sf_frame frame[VIEWS];
  double point[POINTS][3];
  sf_sight sight;
  sf_dataset_options options;
} rig;

/* From `at`, looking along `ahead` (any length), the picture's up towards +y, turned by `roll`. */
static void pose(sf_frame *frame, const double at[3], const double ahead[3], double roll)
{
  double back[3], right[3], up[3];
  const double length = sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1] + ahead[2] * ahead[2]);
  for (int i = 0; i < 3; i++) back[i] = -ahead[i] / length;
  const double flat = hypot(back[0], back[2]);
  right[0] = back[2] / flat, right[1] = 0, right[2] = -back[0] / flat;
  up[0] = back[1] * right[2], up[1] = back[2] * right[0] - back[0] * right[2], up[2] = -back[1] * right[0];
  for (int i = 0; i < 3; i++) {
    frame->to_world[4 * i] = cos(roll) * right[i] + sin(roll) * up[i];
    frame->to_world[4 * i + 1] = cos(roll) * up[i] - sin(roll) * right[i];
    frame->to_world[4 * i + 2] = back[i], frame->to_world[4 * i + 3] = at[i];
  }
}

/* About (3, -2, 1), at different distances, from above. */
static void about(rig *r)
{
  const double middle[3] = {3, -2, 1};
  for (int v = 0; v < VIEWS; v++) {
    const double a = 1.1 * v, away = 2 + 0.1 * v;
    const double at[3] = {middle[0] + away * cos(a), middle[1] + 0.3 * (v % 3), middle[2] + away * sin(a)};
    const double ahead[3] = {middle[0] - at[0], middle[1] - at[1], middle[2] - at[2]};
    pose(&r->frame[v], at, ahead, 0.02 * v);
  }
}

/* Side by side, looking along -z. */
static void ahead(rig *r)
{
  for (int v = 0; v < VIEWS; v++)
    pose(&r->frame[v], (double[3]){0.3 * v - 0.5, 0.1 * (v % 2), 0.05 * v}, (double[3]){0.02 * v - 0.05, 0.03, -1}, 0);
}

static void make_rig(rig *r, sf_layout layout, void (*stand)(rig *))
{
  memset(r, 0, sizeof *r);
  r->capture.layout = layout, r->capture.frame = r->frame, r->capture.count = VIEWS, r->capture.near = 2;
  strcpy(r->capture.list, "list");
  for (int v = 0; v < VIEWS; v++) {
    snprintf(r->frame[v].file_path, sizeof r->frame[v].file_path, "p%d", v);
    r->frame[v].lens = (sf_lens){.fl_x = 60, .fl_y = 50, .width = 40, .height = 30, .camera = -1};
  }
  stand(r);
}

static void numbers(FILE *out, const char *title, const double *list, int n)
{
  fprintf(out, "  %s", title);
  for (int i = 0; i < n; i++) fprintf(out, " %.7g", rint(list[i] * 1e8) / 1e8 + 0.0);
  fprintf(out, "\n");
}

/* Places the rig and says all of it. */
static void say(FILE *out, const char *title, rig *r)
{
  sf_dataset data = {.path = "d"};
  fprintf(out, "%s\n", title);
  sf_status status = sf_place(&data, &r->capture, &r->options, &r->sight);
  if (status.code == SF_OK) status = sf_check_sight(&data, &r->capture, &r->sight);
  if (status.code) fprintf(out, "  %d %s\n", status.code, status.message);
  fprintf(out, "  layout %d scale %.7g own %.7g bound %d ndc %d near %g focal %.7g %.7g offset %.6g %.6g %.6g\n",
          data.layout, (double)data.scale, (double)data.own_scale, data.bound, data.ndc, (double)data.ndc_near,
          (double)data.ndc_focal[0], (double)data.ndc_focal[1], (double)data.offset[0], (double)data.offset[1],
          (double)data.offset[2]);
  numbers(out, "world", data.world, 12);
  for (int v = 0; v < r->capture.count; v++) numbers(out, r->frame[v].file_path, r->frame[v].to_world, 12);
  for (int n = 0; n < data.points; n++)
    fprintf(out, "  point %.6g %.6g %.6g\n", (double)data.point[3 * n], (double)data.point[3 * n + 1],
            (double)data.point[3 * n + 2]);
  for (int i = 0; i < data.warnings; i++) fprintf(out, "  %s\n", data.warning[i]);
  free(data.point), free(data.warning);
}

static void add_points(rig *r, double spread)
{
  for (int n = 0; n < POINTS; n++)
    for (int i = 0; i < 3; i++) r->point[n][i] = (i == 0 ? 3 : i == 1 ? -2 : 1) + spread * sin(1 + 3 * n + i);
  r->point[0][0] += spread;
  r->capture.point = r->point, r->capture.points = POINTS;
}

static void orbits(FILE *out)
{
  rig r;
  make_rig(&r, SF_LAYOUT_COLMAP, about), say(out, "colmap", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about), r.sight.transparent = true, say(out, "colmap, transparent", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about), r.options.scale = 3, say(out, "colmap, a scale of one's own", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about), r.capture.first = 3, say(out, "colmap, guided by three", &r);
  for (int k = 0; k < 6; k++) {
    make_rig(&r, SF_LAYOUT_COLMAP, about), add_points(&r, 0.7 * exp2(k)), say(out, "colmap, points", &r);
  }
  for (int k = 0; k < 3; k++) { /* the farthest camera decides */
    make_rig(&r, SF_LAYOUT_COLMAP, about);
    for (int i = 0; i < 3; i++) r.frame[2].to_world[4 * i + 3] += 5 * (k + 1) * r.frame[2].to_world[4 * i + 2];
    say(out, "colmap, one far off", &r);
  }
  make_rig(&r, SF_LAYOUT_COLMAP, ahead), say(out, "colmap, side by side", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about);
  for (int v = 1; v < VIEWS; v++) memcpy(r.frame[v].to_world, r.frame[0].to_world, sizeof r.frame[0].to_world);
  say(out, "colmap, all from one place", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about), r.sight.transparent = true;
  for (int v = 0; v < VIEWS; v++)
    for (int i = 0; i < 3; i++) r.frame[v].to_world[4 * i + 3] = 0;
  say(out, "colmap, all at the origin", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about); /* up along x: another axis has to be taken */
  for (int v = 0; v < VIEWS; v++)
    for (int k = 0; k < 4; k++) {
      double *m = r.frame[v].to_world, x = m[k];
      m[k] = m[4 + k], m[4 + k] = m[8 + k], m[8 + k] = x;
    }
  say(out, "colmap, up along x", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about);
  for (int v = 1; v < VIEWS; v += 2)
    for (int i = 0; i < 3; i++) r.frame[v].to_world[4 * i] *= -1, r.frame[v].to_world[4 * i + 1] *= -1;
  say(out, "colmap, no common up", &r);
}

/* Each of the words that a lens may have, or lack. */
static void lenses(FILE *out)
{
  static const struct {
    sf_lens lens;
    int width, height;
  } rows[] = {{{.fl_x = 60, .fl_y = 50, .width = 40, .height = 30}, 0, 0},
              {{.fl_x = 60, .width = 40, .height = 30}, 0, 0},
              {{.fl_x = 60, .fl_y = 50}, 80, 70},
              {{.fl_x = 60, .fl_y = 50, .width = 40}, 80, 70},
              {{.fl_x = 60, .fl_y = 50, .height = 35}, 80, 70},
              {{.angle_x = 0.9}, 0, 0},
              {{.angle_x = 0.9, .width = 40, .height = 30}, 80, 70},
              {{.angle_x = 0.9}, 80, 70},
              {{.fl_x = 60, .fl_y = 50}, 0, 0},
              {{.fl_x = 60, .fl_y = 50, .width = 40, .height = 30, .cx = 10, .has_cx = true}, 0, 0},
              {{.fl_x = 60, .fl_y = 50, .width = 40, .height = 30, .cy = 10, .has_cy = true}, 0, 0},
              {{.fl_x = 60, .fl_y = 50, .cx = 10, .has_cx = true, .cy = 40, .has_cy = true}, 0, 0},
              {{.fl_x = 60, .fl_y = 50, .cx = 10, .has_cx = true, .cy = 40, .has_cy = true}, 80, 70}};
  for (int i = 0; i < COUNT(rows); i++)
    for (int forward = 0; forward < 2; forward++) {
      rig r;
      char title[40];
      make_rig(&r, forward ? SF_LAYOUT_LLFF : SF_LAYOUT_COLMAP, forward ? ahead : about);
      for (int v = 0; v < VIEWS; v++) r.frame[v].lens = rows[i].lens;
      r.sight = (sf_sight){!forward, rows[i].width, rows[i].height};
      r.capture.count = 3;
      snprintf(title, sizeof title, "lens %d, %s", i, forward ? "ahead" : "about");
      say(out, title, &r);
    }
}

static void other_layouts(FILE *out)
{
  static const int aabb[] = {1, 2, 16};
  rig r;
  make_rig(&r, SF_LAYOUT_BLENDER, about), add_points(&r, 1), say(out, "blender", &r);
  make_rig(&r, SF_LAYOUT_BLENDER, about), r.options.scale = 0.3f, say(out, "blender, a scale of one's own", &r);
  for (int i = 0; i < 6; i++) {
    make_rig(&r, SF_LAYOUT_INGP, about);
    r.capture.placed = true, r.capture.aabb_scale = aabb[i % 3], r.capture.box_scale = 0.25;
    for (int k = 0; k < 3; k++) r.capture.box_offset[k] = 0.2 * k - 0.3;
    r.options.scale = i < 3 ? 0 : 0.7f;
    if (i == 2) add_points(&r, 1);
    say(out, "instant-ngp", &r);
  }
  make_rig(&r, SF_LAYOUT_LLFF, ahead), add_points(&r, 1), say(out, "llff", &r);
  make_rig(&r, SF_LAYOUT_LLFF, ahead), r.options.scale = 0.4f, r.capture.near = 7, say(out, "llff, scale 0.4", &r);
  make_rig(&r, SF_LAYOUT_LLFF, about), say(out, "llff, about", &r);
}

/* Views that look elsewhere, and poses that a sign turned. */
static void wrong_views(FILE *out)
{
  rig r;
  for (int wrong = 1; wrong <= VIEWS; wrong++) {
    make_rig(&r, SF_LAYOUT_BLENDER, about);
    for (int v = 0; v < VIEWS; v++)
      for (int i = 0; i < 3; i++) r.frame[v].to_world[4 * i + 3] -= i == 0 ? 3 : i == 1 ? -2 : 1;
    for (int v = 0; v < wrong; v++)
      for (int i = 0; i < 3; i++)
        r.frame[VIEWS - 1 - v].to_world[4 * i + 1] *= -1, r.frame[VIEWS - 1 - v].to_world[4 * i + 2] *= -1;
    say(out, "blender, some look back", &r);
    r.capture.first = 2, say(out, "the same, of a split", &r);
  }
  make_rig(&r, SF_LAYOUT_BLENDER, about), r.frame[3].to_world[3] += 80, r.frame[4].to_world[7] -= 50;
  say(out, "blender, two look elsewhere", &r);
  make_rig(&r, SF_LAYOUT_COLMAP, about);
  for (int v = 2; v < 5; v += 2)
    for (int i = 0; i < 3; i++) r.frame[v].to_world[4 * i] *= -1;
  r.capture.first = 1, say(out, "colmap, two mirrored", &r);
}

TEST(places_whole)
{
  ck_expected_text("places-about.txt", out, orbits(out));
  ck_expected_text("places-lenses.txt", out, lenses(out));
  ck_expected_text("places-layouts.txt", out, other_layouts(out));
  ck_expected_text("places-wrong.txt", out, wrong_views(out));
}

/* ---- what faces forward ---- */

/* One view of those side by side is other, by less and by more than what is taken. */
static void turned_by(rig *r, double degrees)
{
  const double a = degrees * M_PI / 180;
  pose(&r->frame[2], (double[3]){0, 0, 0}, (double[3]){sin(a), 0, -cos(a)}, 0);
}

static void ahead_by(rig *r, double by)
{
  r->frame[2].to_world[11] = -by;
}

static void aside_by(rig *r, double by)
{
  for (int v = 0; v < VIEWS; v++) r->frame[v].to_world[3] = v & 1 ? by : -by;
}

static void wide_by(rig *r, double degrees)
{
  for (int v = 0; v < VIEWS; v++) r->frame[v].lens.fl_x = 20 / tan(degrees * M_PI / 360);
}

static void high_by(rig *r, double degrees)
{
  for (int v = 0; v < VIEWS; v++) r->frame[v].lens.fl_y = 15 / tan(degrees * M_PI / 360);
}

static void along_by(rig *r, double angle)
{
  for (int v = 0; v < VIEWS; v++) {
    const double a = (v - 2.5) / 2.5 * angle * M_PI / 180;
    pose(&r->frame[v], (double[3]){0, 0, 0}, (double[3]){sin(a), 0, -cos(a)}, 0);
  }
}

static void straight(rig *r)
{
  for (int v = 0; v < VIEWS; v++) pose(&r->frame[v], (double[3]){0, 0, 0}, (double[3]){0, 0, -1}, 0);
}

TEST(what_faces_forward)
{
  static const struct {
    void (*make)(rig *, double);
    double less, more;
  } rows[] = {{turned_by, 52, 55}, {turned_by, -52, -55}, {ahead_by, 1.78, 1.82}, {aside_by, 1990, 2010},
              {wide_by, 170, 175}, {high_by, 170, 175},   {along_by, 44, 46}};
  for (int i = 0; i < COUNT(rows); i++)
    for (int more = 0; more < 2; more++) {
      rig r;
      make_rig(&r, SF_LAYOUT_LLFF, straight);
      rows[i].make(&r, more ? rows[i].more : rows[i].less);
      ck_assert_msg(sf_forward_facing(&r.capture) == !more, "row %d, %s", i, more ? "more" : "less");
    }
  rig r; /* no common up, no common direction */
  make_rig(&r, SF_LAYOUT_LLFF, straight);
  for (int v = 0; v < VIEWS; v++) pose(&r.frame[v], (double[3]){0}, (double[3]){0, 0, -1}, v * M_PI / 3);
  ck_assert(!sf_forward_facing(&r.capture));
  make_rig(&r, SF_LAYOUT_LLFF, straight);
  for (int v = 0; v < VIEWS; v++)
    pose(&r.frame[v], (double[3]){0}, (double[3]){cos(v * M_PI / 3), 0, sin(v * M_PI / 3)}, 0);
  ck_assert(!sf_forward_facing(&r.capture));
}

/* ---- rays ---- */

TEST(pixels_along_the_box)
{
  sf_view view[2] = {
      {.camera = {.width = 40, .height = 30, .fx = 50, .fy = 32, .to_world = {[3] = 1, [7] = 2, [11] = 2}}},
      {.camera = {.width = 30, .height = 60, .fx = 10, .fy = 10, .to_world = {[7] = -1}}}};
  sf_dataset data = {.view = view, .count = 2, .scale = 0.5f};
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 25);  /* 2 (40 + 10) / (3 + 1) */
  ck_assert_int_eq(sf_dataset_pixels(&data, 8), 200); /* grows with the box */
  data.count = 1;
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 27); /* 80 / 3 = 26.7 */
  view[0].camera.fx = view[0].camera.fy = 1e-3f;
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 1);
  view[0].camera.fx = view[0].camera.fy = 1e9f;
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 1 << 20);
  memset(view[0].camera.to_world, 0, sizeof view[0].camera.to_world);
  view[0].camera.fx = view[0].camera.fy = 1e-5f;
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 20000); /* from the origin: as from 1e-9 */
  data.ndc = true, data.count = 2;
  ck_assert_int_eq(sf_dataset_pixels(&data, 1), 100); /* (40 + 60) / 2 / 0.5 */
  ck_assert_int_eq(sf_dataset_pixels(&data, 3), 300);
}

/* A point on the ray in the world lies on the ray in NDC, where the formula of the paper puts it. */
TEST(rays_in_ndc)
{
  rig r;
  sf_dataset data = {.path = "d"};
  make_rig(&r, SF_LAYOUT_LLFF, ahead);
  ck_ok(sf_place(&data, &r.capture, &r.options, &r.sight));
  for (int v = 0; v < VIEWS; v++) {
    sf_view view = {.camera = {.width = 40, .height = 30, .fx = 60, .fy = 50, .cx = 20, .cy = 15}};
    for (int i = 0; i < 12; i++) view.camera.to_world[i] = (float)r.frame[v].to_world[i];
    float o[3], d[3], world_o[3], world_d[3];
    const float px = 5.5f + (float)v, py = 21.5f - (float)v;
    sf_camera_ray(&view.camera, px, py, world_o, world_d);
    sf_dataset_ray(&data, &view, px, py, o, d);
    double length = 0;
    for (int i = 0; i < 3; i++) length += (double)d[i] * (double)d[i];
    ck_assert_double_eq_tol(length, 1, 1e-5);
    ck_assert_double_eq_tol(o[2] + (float)SF_NEAR * d[2], -data.scale, 1e-5);
    for (int k = 0; k < 3; k++) {
      const double t = 2 + 3 * k;
      double p[3], ndc[3];
      for (int i = 0; i < 3; i++) p[i] = (double)world_o[i] + t * (double)world_d[i];
      for (int i = 0; i < 2; i++) ndc[i] = (double)data.scale * (double)data.ndc_focal[i] * p[i] / -p[2];
      ndc[2] = (double)data.scale * (1 + 2 * (double)data.ndc_near / p[2]);
      const double along = (ndc[2] - (double)o[2]) / (double)d[2];
      ck_assert_double_gt(along, 0);
      for (int i = 0; i < 2; i++) ck_assert_double_eq_tol((double)o[i] + along * (double)d[i], ndc[i], 2e-5);
    }
  }
}
