/* LLFF, COLMAP and instant-ngp against the Blender layout of the same cameras; lenses; what is refused. */
#include "folder_fixture.h"
#include "layout_fixture.h"
#include "spikefield/io.h"
#include "spikefield/rng.h"
#include "spikefield/scene.h"
#include "src/scene/lens.h"
#include <math.h>

enum { WIDTH = 16, HEIGHT = 12, VIEWS = 17 };

/* ---- a rig, and the folders made of it ---- */

static void put(const char *name, const layout_file *file)
{
  FILE *f = fopen(in(name), "wb");
  ck_assert_ptr_nonnull(f);
  ck_assert_uint_eq(fwrite(file->bytes, 1, file->size, f), file->size);
  ck_assert_int_eq(fclose(f), 0);
}

static void put_picture(const char *name, int width, int height, int value, int alpha)
{
  sf_image image = {width, height, malloc((size_t)width * (size_t)height * 8)};
  for (int i = 0; i < width * height * 4; i++)
    image.rgba[i] = (uint16_t)((i % 4 < 3 ? value : i < width * 8 ? alpha : 255) * 257);
  ck_good(sf_image_save_png(&image, in(name)));
  sf_image_free(&image);
}

/* Row-major from back (unit), up about z. */
static void look(double m[12], const double at[3], const double back[3])
{
  const double flat = hypot(back[0], back[1]), right[3] = {-back[1] / flat, back[0] / flat, 0};
  const double up[3] = {back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2],
                        back[0] * right[1] - back[1] * right[0]};
  for (int i = 0; i < 3; i++) m[4 * i] = right[i], m[4 * i + 1] = up[i], m[4 * i + 2] = back[i], m[4 * i + 3] = at[i];
}

/* About (3, -2, 1) at distances around 5, with a tilted up direction if asked; a lens for all. */
static layout_rig orbit(void)
{
  layout_rig rig = {
      .lenses = 1, .views = VIEWS, .lens = {{7, 1, "PINHOLE", WIDTH, HEIGHT, 4, {20, 21, WIDTH / 2.0, HEIGHT / 2.0}}}};
  for (int v = 0; v < VIEWS; v++) {
    const double turn = 0.9 * v, height = 0.1 + 0.04 * v, flat = sqrt(1 - height * height), away = 5 + 0.3 * sin(3 * v);
    const double back[3] = {flat * cos(turn), flat * sin(turn), height};
    const double at[3] = {3 + away * back[0], -2 + away * back[1], 1 + away * back[2]};
    snprintf(rig.view[v].name, sizeof rig.view[v].name, "p%02d.png", v);
    look(rig.view[v].to_world, at, back);
    rig.view[v].lens = 7;
  }
  for (rig.points = 0; rig.points < 64; rig.points++)
    for (unsigned k = 0; k < 3; k++)
      rig.point[rig.points][k] = (k == 0 ? 3 : k == 1 ? -2 : 1) + 6 * sf_random_float(1, k, (uint64_t)rig.points) - 3;
  return rig;
}

/* Side by side, all looking along +x, with a little turn: forward-facing. */
static layout_rig row(void)
{
  layout_rig rig = {
      .lenses = 1, .views = VIEWS, .lens = {{1, 0, "SIMPLE_PINHOLE", 4 * WIDTH, 4 * HEIGHT, 3, {60, 32, 24}}}};
  for (int v = 0; v < VIEWS; v++) {
    double back[3] = {-1, 0.02 * (v - 8), 0.05 * sin(v)};
    const double length = sqrt(1 + back[1] * back[1] + back[2] * back[2]),
                 at[3] = {5 + 0.1 * cos(v), 0.2 * v, -3 + 0.3 * sin(2 * v)};
    for (int i = 0; i < 3; i++) back[i] /= length;
    look(rig.view[v].to_world, at, back);
    snprintf(rig.view[v].name, sizeof rig.view[v].name, "p%02d.png", v);
    rig.view[v].lens = 1;
  }
  return rig;
}

/* In another order than the names', as COLMAP lists them. */
static layout_rig shuffled(const layout_rig *rig)
{
  layout_rig other = *rig;
  for (int v = 0; v < rig->views; v++) other.view[v] = rig->view[(5 * v + 3) % rig->views];
  return other;
}

static void put_colmap(const char *dir, const layout_rig *rig, int text)
{
  static layout_file file;
  char name[100];
  ck_good(sf_make_dir(in(dir)));
  snprintf(name, sizeof name, "%s/cameras.%s", dir, text ? "txt" : "bin");
  layout_cameras(&file, rig, text), put(name, &file);
  snprintf(name, sizeof name, "%s/images.%s", dir, text ? "txt" : "bin");
  layout_images(&file, rig, text), put(name, &file);
  snprintf(name, sizeof name, "%s/points3D.%s", dir, text ? "txt" : "bin");
  if (rig->points) layout_points(&file, rig, text), put(name, &file);
}

static void put_pictures(const char *dir, const layout_rig *rig, int width, int height, int alpha)
{
  char name[100];
  ck_good(sf_make_dir(in(dir)));
  for (int v = 0; v < rig->views; v++) {
    snprintf(name, sizeof name, "%s/%s", dir, rig->view[v].name);
    put_picture(name, width, height, 10 + v, alpha);
  }
}

static void put_json(const char *name, const layout_rig *rig, const char *more, const char *pictures, int first,
                     int step)
{
  FILE *f = fopen(in(name), "w");
  const layout_lens *lens = &rig->lens[0];
  fprintf(f, "{%s\"fl_x\":%.17g,\"fl_y\":%.17g,\"w\":%d,\"h\":%d,\"frames\":[", more, lens->param[0], lens->param[1],
          lens->width, lens->height);
  for (int v = first; v < rig->views; v += step) {
    const double *m = rig->view[v].to_world;
    fprintf(f, "%s{\"file_path\":\"./%s/%s\",\"transform_matrix\":[", v > first ? "," : "", pictures,
            rig->view[v].name);
    for (int i = 0; i < 3; i++)
      fprintf(f, "[%.17g,%.17g,%.17g,%.17g],", m[4 * i], m[4 * i + 1], m[4 * i + 2], m[4 * i + 3]);
    fprintf(f, "[0,0,0,1]]}");
  }
  fprintf(f, "]}");
  ck_assert_int_eq(fclose(f), 0);
}

/* ---- rays of the rig itself, in doubles ---- */

typedef struct ray {
  double o[3], d[3];
} ray;

static ray rig_ray(const layout_view *view, const layout_lens *lens, double px, double py)
{
  const double *m = view->to_world, *p = lens->param;
  const int two = lens->model == 1 || lens->model == 4;
  const double x = (px - p[1 + two]) / p[0], y = -(py - p[2 + two]) / p[two];
  ray r;
  double length = 0;
  for (int i = 0; i < 3; i++) {
    r.o[i] = m[4 * i + 3], r.d[i] = m[4 * i] * x + m[4 * i + 1] * y - m[4 * i + 2];
    length += r.d[i] * r.d[i];
  }
  for (int i = 0; i < 3; i++) r.d[i] /= sqrt(length);
  return r;
}

/* A point of the layout in model units. */
static void to_model(const sf_dataset *d, const double p[3], double out[3])
{
  for (int i = 0; i < 3; i++)
    out[i] = (d->world[4 * i] * p[0] + d->world[4 * i + 1] * p[1] + d->world[4 * i + 2] * p[2] + d->world[4 * i + 3]) *
                 (double)d->scale +
             (double)d->offset[i];
}

static double from_ray(const float o[3], const float d[3], const double p[3])
{
  double along = 0, sum = 0;
  for (int i = 0; i < 3; i++) along += (p[i] - (double)o[i]) * (double)d[i];
  for (int i = 0; i < 3; i++) sum += pow(p[i] - (double)o[i] - along * (double)d[i], 2);
  return sqrt(sum);
}

static const layout_view *named(const layout_rig *rig, const char *name)
{
  const char *slash = strrchr(name, '/');
  for (int v = 0; v < rig->views; v++)
    if (!strcmp(rig->view[v].name, slash ? slash + 1 : name)) return &rig->view[v];
  ck_abort_msg("no view %s", name);
  return NULL;
}

/* Every loaded view's rays are those of the rig: both ends of a piece of the rig's ray, brought into model units, lie
 * on the loaded one, and its origin is the camera's. Floats at distances below 4 units: 1e-6. */
static void same_rays(const sf_dataset *d, const layout_rig *rig)
{
  for (int v = 0; v < d->count; v++) {
    const sf_camera *c = &d->view[v].camera;
    const layout_view *view = named(rig, d->view[v].name);
    const layout_lens *lens = &rig->lens[0];
    for (int k = 0; k < rig->lenses; k++)
      if (rig->lens[k].id == view->lens) lens = &rig->lens[k];
    const double sx = (double)lens->width / c->width, sy = (double)lens->height / c->height;
    for (int n = 0; n < 12; n++) {
      const float px = (float)c->width * (float)(n % 4) / 3, py = (float)c->height * (float)(n / 4) / 2;
      const ray r = rig_ray(view, lens, px * sx, py * sy);
      float o[3], dir[3];
      double at[3], end[3], far[3], ahead = 0;
      sf_dataset_ray(d, &d->view[v], px, py, o, dir);
      to_model(d, r.o, at);
      for (int i = 0; i < 3; i++) far[i] = r.o[i] + 3 * r.d[i];
      to_model(d, far, end);
      for (int i = 0; i < 3; i++) ck_assert_double_eq_tol(at[i], (double)o[i], 2e-6);
      for (int i = 0; i < 3; i++) ahead += (end[i] - at[i]) * (double)dir[i];
      ck_assert_double_eq_tol(from_ray(o, dir, end), 0, 4e-6);
      ck_assert_double_gt(ahead, 0);
    }
  }
}

static void load(sf_dataset *d, const char *split)
{
  ck_good(sf_dataset_load(d, folder, split, NULL));
}

/* Names ascend, every 8th is held out, and each picture is the one of its pose. */
static void same_splits(const layout_rig *rig)
{
  sf_dataset d;
  for (int testing = 0; testing < 2; testing++) {
    load(&d, testing ? "test" : "train");
    ck_assert_int_eq(d.count, testing ? (VIEWS + 7) / 8 : VIEWS - (VIEWS + 7) / 8);
    for (int i = 0; i < d.count; i++) {
      const int v = testing ? 8 * i : i + 1 + i / 7;
      ck_assert_ptr_eq(named(rig, d.view[i].name), &rig->view[v]);
      ck_assert_uint_eq(d.view[i].image.rgba[4 * WIDTH * HEIGHT - 4] / 257, (unsigned)(10 + v));
    }
    same_rays(&d, rig);
    sf_dataset_free(&d);
  }
}

/* ---- layouts ---- */

START_TEST(colmap_has_the_rays_of_its_poses)
{
  const layout_rig rig = orbit(), listed = shuffled(&rig);
  sf_dataset d;
  put_colmap(_i & 2 ? "sparse" : "sparse/0", &listed, _i & 1);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  same_splits(&rig);
  load(&d, "train");
  ck_assert_int_eq(d.layout, SF_LAYOUT_COLMAP);
  const char *const list[] = {"sparse/0/images.bin", "sparse/0/images.txt", "sparse/images.bin", "sparse/images.txt"};
  ck_assert_str_eq(d.list, in(list[_i]));
  ck_assert_str_eq(d.view[0].lens, "PINHOLE");
  ck_assert(!d.ndc && d.bound == 1); /* all points lie between the cameras */
  ck_assert_int_eq(d.points, rig.points);
  double mean = 0, middle[3];
  for (int v = 0; v < d.count; v++) {
    const float *m = d.view[v].camera.to_world;
    mean += sqrt((double)(m[3] * m[3] + m[7] * m[7] + m[11] * m[11])) / d.count;
  }
  ck_assert_double_eq_tol(mean, 1.32, 0.02);   /* of the training views; it is exact for all */
  to_model(&d, (double[3]){3, -2, 1}, middle); /* what they look at is the origin; held to the mean by 1 in 1000 */
  for (int i = 0; i < 3; i++) ck_assert_double_eq_tol(middle[i], 0, 2e-3);
  ck_assert_double_gt(d.world[10] / sqrt(d.world[8] * d.world[8] + d.world[9] * d.world[9] + d.world[10] * d.world[10]),
                      0.99);
  double p[3];
  to_model(&d, rig.point[5], p);
  for (int i = 0; i < 3; i++) ck_assert_double_eq_tol(p[i], (double)d.point[15 + i], 1e-6);
  sf_dataset_free(&d);
}
END_TEST

START_TEST(instant_ngp_has_the_rays_of_its_poses)
{
  layout_rig rig = orbit();
  sf_dataset d;
  for (int v = 0; v < VIEWS; v++)
    for (int i = 0; i < 3; i++) rig.view[v].to_world[4 * i + 3] -= i == 0 ? 3 : i == 1 ? -2 : 1;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms.json", &rig, "\"aabb_scale\":4,", "images", 0, 1);
  same_splits(&rig);
  load(&d, "test");
  ck_assert_int_eq(d.layout, SF_LAYOUT_INGP);
  ck_assert(d.scale == 0.33f && d.bound == 2 && d.offset[0] == 0);
  sf_dataset_free(&d);
  /* its own cube: 0.5 p + (0.6, 0.5, 0.4), of which the middle is the origin and the box has half edge 1 */
  put_json("transforms.json", &rig, "\"aabb_scale\":1,\"scale\":0.25,\"offset\":[0.6,0.5,0.4],", "images", 0, 1);
  same_splits(&rig);
  load(&d, "test");
  ck_assert(d.scale == 0.5f && d.bound == 1);
  ck_assert_float_eq_tol(d.offset[0], 0.2f, 1e-6f);
  ck_assert_float_eq_tol(d.offset[2], -0.2f, 1e-6f);
  sf_dataset_free(&d);
  ck_good(sf_dataset_load(&d, folder, "test", &(sf_dataset_options){.downscale = 1, .scale = 1}));
  ck_assert_float_eq_tol(d.offset[0], 0.4f, 1e-6f); /* the box's middle stays in the origin */
  sf_dataset_free(&d);
}
END_TEST

START_TEST(an_object_on_nothing_fills_the_box)
{
  const layout_rig rig = orbit();
  sf_dataset d;
  put_pictures("images", &rig, WIDTH, HEIGHT, 0); /* the first rows are transparent */
  put_json("transforms.json", &rig, "", "images", 0, 1);
  same_splits(&rig);
  load(&d, "train");
  ck_assert_int_eq(d.bound, 1);
  /* half the picture's height over the focal length, at the middle distance of 5 to 5.3 */
  ck_assert_double_eq_tol(1 / (double)d.scale, 5.0 * 6 / 21, 0.3 * 6 / 21);
  sf_dataset_free(&d);
}
END_TEST

START_TEST(blender_has_the_rays_of_its_poses)
{
  layout_rig rig = orbit();
  sf_dataset d;
  for (int v = 0; v < VIEWS; v++)
    for (int i = 0; i < 3; i++) rig.view[v].to_world[4 * i + 3] -= i == 0 ? 3 : i == 1 ? -2 : 1;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms_train.json", &rig, "", "images", 1, 2);
  put_json("transforms_test.json", &rig, "", "images", 0, 2);
  load(&d, "train");
  ck_assert_int_eq(d.layout, SF_LAYOUT_BLENDER);
  ck_assert_str_eq(d.list, in("transforms_train.json"));
  ck_assert_int_eq(d.count, VIEWS / 2);
  same_rays(&d, &rig);
  sf_dataset_free(&d);
}
END_TEST

static void put_llff(const layout_rig *rig, int single, double near, double far)
{
  static layout_file file;
  layout_npy(&file, rig, single, near, far);
  put("poses_bounds.npy", &file);
}

/* The point on the rig's ray, brought into NDC by its definition, lies on the ray that is handed out; the origin is on
 * the near plane. */
START_TEST(forward_facing_rays_are_ndc)
{
  const layout_rig rig = row();
  sf_dataset d;
  put_llff(&rig, _i, 4, 40);
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  load(&d, "test");
  ck_assert_int_eq(d.layout, SF_LAYOUT_LLFF);
  ck_assert_str_eq(d.list, in("poses_bounds.npy"));
  ck_assert(d.ndc && d.bound == 1 && d.ndc_near == 1);
  ck_assert_float_eq_tol(d.ndc_focal[0], 60 / 32.0f, 1e-6f);
  ck_assert_float_eq_tol(d.ndc_focal[1], 60 / 24.0f, 1e-6f);
  ck_assert(d.view[0].camera.fx == 15 && d.view[0].camera.width == WIDTH);
  const double scale = (double)d.scale, tolerance = _i ? 3e-6 : 2e-6;
  sf_dataset unit = d;
  unit.scale = 1;
  for (int n = 0; n < 12 * d.count; n++) {
    const sf_view *view = &d.view[n / 12];
    const double px = WIDTH * (n % 4) / 3.0, py = HEIGHT * (n / 4 % 3) / 2.0, depth[4] = {0.01, 5, 50, 1e9};
    const ray r = rig_ray(named(&rig, view->name), &rig.lens[0], 4 * px, 4 * py);
    float o[3], dir[3];
    sf_dataset_ray(&d, view, (float)px, (float)py, o, dir);
    ck_assert_float_eq(o[2], -d.scale);
    ck_assert_double_eq_tol(sqrt((double)(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2])), 1, 1e-6);
    for (int k = 0; k < 4; k++) {
      double far[3], p[3], ndc[3];
      for (int i = 0; i < 3; i++) far[i] = r.o[i] + depth[k] * r.d[i];
      to_model(&unit, far, p);
      if (k == 0) p[2] = fmin(p[2], -0.1); /* before the near plane the line goes on */
      ndc[0] = -(double)d.ndc_focal[0] * p[0] / p[2], ndc[1] = -(double)d.ndc_focal[1] * p[1] / p[2];
      ndc[2] = 1 + 2 / p[2];
      for (int i = 0; i < 3; i++) ndc[i] *= scale;
      if (k > 0) ck_assert_double_eq_tol(from_ray(o, dir, ndc), 0, tolerance);
      if (k > 0)
        for (int i = 0; i < 3; i++) ck_assert_double_le(fabs(ndc[i]), 1 + 1e-6);
    }
  }
  sf_dataset_free(&d);
}
END_TEST

/* NeRF's recentring: the mean pose becomes the identity; the nearest depth is at 4 / 3. */
START_TEST(forward_facing_poses_are_recentred)
{
  const layout_rig rig = row();
  sf_dataset one, other;
  double sum[12] = {0};
  put_llff(&rig, 0, 4, 40);
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  load(&one, "train"), load(&other, "test");
  for (int v = 0; v < VIEWS; v++) {
    const sf_dataset *d = v % 8 ? &one : &other;
    const sf_view *view = &d->view[v % 8 ? v - 1 - v / 8 : v / 8];
    ck_assert_ptr_eq(named(&rig, view->name), &rig.view[v]);
    for (int i = 0; i < 12; i++) sum[i] += (double)view->camera.to_world[i] / VIEWS;
  }
  for (int i = 0; i < 3; i++) {
    ck_assert_double_eq_tol(sum[4 * i + 3], 0, 1e-6);
    ck_assert_double_eq_tol(sum[4 * i + 2], i == 2 ? sum[10] : 0, 1e-6);
  }
  ck_assert_double_gt(sum[10], 0.98);
  ck_assert_double_eq_tol(sum[1], 0, 1e-6);
  const double *w = one.world;
  ck_assert_double_eq_tol(sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), 1 / (0.75 * 4), 1e-12);
  sf_dataset_free(&one), sf_dataset_free(&other);
}
END_TEST

START_TEST(poses_decide_what_faces_forward)
{
  layout_rig rig = orbit();
  sf_dataset d;
  rig.lens[0].param[1] = WIDTH / 2.0; /* one focal length */
  put_llff(&rig, 0, 2, 9);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  load(&d, "train");
  ck_assert(d.layout == SF_LAYOUT_LLFF && !d.ndc && d.bound > 1);
  sf_dataset_free(&d);
  rig = row(); /* but one of them stands behind the nearest thing */
  put_llff(&rig, 0, 4, 40);
  ck_good(sf_make_dir(in("sparse/0")));
  load(&d, "train");
  ck_assert(d.ndc && d.warnings == 0);
  sf_dataset_free(&d);
  rig.view[3].to_world[3] += 3.5;
  put_llff(&rig, 0, 4, 40);
  load(&d, "train");
  ck_assert(!d.ndc);
  sf_dataset_free(&d);
}
END_TEST

/* Both files there: forward-facing poses are read for their depths, others for their lenses; transforms.json always. */
START_TEST(one_layout_wins_and_says_so)
{
  layout_rig rig = row();
  sf_dataset d;
  put_llff(&rig, 0, 4, 40), put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, 4 * WIDTH, 4 * HEIGHT, 255);
  load(&d, "train");
  ck_assert(d.layout == SF_LAYOUT_LLFF && d.warnings == 1 && strstr(d.warning[0], "poses_bounds.npy is used"));
  sf_dataset_free(&d);
  put_llff(&rig, 0, 0.001, 40); /* nothing is behind so near a plane */
  load(&d, "train");
  ck_assert(d.layout == SF_LAYOUT_COLMAP && d.warnings == 1 && strstr(d.warning[0], "COLMAP model is used"));
  sf_dataset_free(&d);
  rig.lens[0].param[1] = rig.lens[0].param[0];
  put_json("transforms.json", &rig, "", "images", 0, 1);
  load(&d, "train");
  ck_assert(d.layout == SF_LAYOUT_INGP && d.warnings == 1 && strstr(d.warning[0], "transforms.json is used"));
  sf_dataset_free(&d);
}
END_TEST

START_TEST(pictures_of_the_size_asked_for)
{
  layout_rig rig = orbit();
  sf_dataset d;
  static const struct {
    int downscale, width;
  } asked[] = {{1, 32}, {2, 16}, {4, 8}, {8, 4}};
  rig.lens[0].width = 32, rig.lens[0].height = 24;
  rig.lens[0].param[2] = 16, rig.lens[0].param[3] = 12;
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, 32, 24, 255), put_pictures("images_2", &rig, 16, 12, 255);
  put_pictures("images_4", &rig, 8, 6, 255);
  for (int i = 0; i < 4; i++) {
    ck_good(sf_dataset_load(&d, folder, "test", &(sf_dataset_options){.downscale = asked[i].downscale}));
    ck_assert_int_eq(d.view[0].camera.width, asked[i].width);
    ck_assert_int_eq(strncmp(d.view[0].name,
                             i == 0   ? "images/"
                             : i == 1 ? "images_2/"
                                      : "images_4/",
                             7 + 2 * (i > 0)),
                     0);
    ck_assert_float_eq(d.view[0].camera.fx, 20 * (float)asked[i].width / 32);
    same_rays(&d, &rig);
    sf_dataset_free(&d);
  }
  /* photographs of 4000 pixels are not what anybody means: the first not above 1600 */
  rig.lens[0].width = 4000, rig.lens[0].height = 3000;
  put_colmap("sparse/0", &rig, 0);
  ck_good(sf_dataset_load(&d, folder, "test", NULL));
  ck_assert_int_eq(d.view[0].camera.width, 8);
  sf_dataset_free(&d);
}
END_TEST

START_TEST(each_picture_has_its_own_camera)
{
  layout_rig rig = orbit();
  sf_dataset d;
  rig.lenses = 3;
  rig.lens[1] = (layout_lens){2, 0, "SIMPLE_PINHOLE", 8, 20, 3, {11, 4, 10}};
  rig.lens[2] = (layout_lens){900, 4, "OPENCV", 24, 10, 8, {25, 26, 12, 5, 0, 0, 0, 0}};
  for (int v = 0; v < VIEWS; v++) rig.view[v].lens = rig.lens[v % 3].id;
  put_colmap("sparse/0", &rig, _i);
  ck_good(sf_make_dir(in("images")));
  for (int v = 0; v < VIEWS; v++) {
    char name[80];
    snprintf(name, sizeof name, "images/%s", rig.view[v].name);
    put_picture(name, rig.lens[v % 3].width, rig.lens[v % 3].height, v, 255);
  }
  load(&d, "train");
  ck_assert_int_eq(d.count, VIEWS - 3);
  same_rays(&d, &rig);
  sf_dataset_free(&d);
}
END_TEST

/* ---- lenses ---- */

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

START_TEST(a_lens_is_undone_to_1e4_of_a_pixel)
{
  const double *k = lenses[_i];
  const sf_camera c = make_camera(k[0], k[1], k[2], k[3]);
  ck_good(sf_lens_check(&c, "lens"));
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
END_TEST

/* By hand from OpenCV's formula at x = 0.3, y = -0.2: r2 = 0.13. */
START_TEST(a_lens_bends_as_opencv_says)
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
END_TEST

START_TEST(a_lens_that_folds_is_refused)
{
  const sf_camera folds = make_camera(-1.2, 0, 0, 0), bends = make_camera(-0.2, 0, 0, 0);
  ck_good(sf_lens_check(&bends, "cameras.bin: camera 3"));
  ck_bad(sf_lens_check(&folds, "cameras.bin: camera 3"), SF_E_RANGE, "cameras.bin: camera 3",
         "cannot be undone at pixel");
  layout_rig rig = orbit();
  sf_dataset d;
  rig.lens[0] = (layout_lens){7, 2, "SIMPLE_RADIAL", WIDTH, HEIGHT, 4, {8, 8, 6, -1.2}};
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_RANGE, "camera 7", "cannot be undone");
}
END_TEST

/* The same picture taken through a lens, by COLMAP's models and by instant-ngp's names: a point is seen where the lens
 * says. */
START_TEST(lenses_come_from_every_layout)
{
  static const layout_lens kinds[] = {{7, 2, "SIMPLE_RADIAL", WIDTH, HEIGHT, 4, {20, 8, 6, 0.1}},
                                      {7, 3, "RADIAL", WIDTH, HEIGHT, 5, {20, 8, 6, 0.1, -0.05}},
                                      {7, 4, "OPENCV", WIDTH, HEIGHT, 8, {20, 20, 8, 6, 0.1, -0.05, 0.01, 0.02}}};
  static const float wanted[][4] = {{0.1f, 0, 0, 0}, {0.1f, -0.05f, 0, 0}, {0.1f, -0.05f, 0.01f, 0.02f}};
  layout_rig rig = orbit();
  sf_dataset d;
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
  load(&d, "train");
  const sf_camera *c = &d.view[0].camera;
  ck_assert_str_eq(d.view[0].lens, kinds[_i % 3].name);
  ck_assert(c->k1 == wanted[_i % 3][0] && c->k2 == wanted[_i % 3][1]);
  ck_assert(c->p1 == wanted[_i % 3][2] && c->p2 == wanted[_i % 3][3]);
  ck_assert(c->fx == 20 && c->fy == 20 && c->cx == 8 && c->cy == 6);
  sf_dataset_free(&d);
}
END_TEST

/* ---- what looks wrong, and what is refused ---- */

START_TEST(a_few_missing_pictures_are_passed_over)
{
  const layout_rig rig = orbit();
  sf_dataset d;
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  unlink(in("images/p03.png")), unlink(in("images/p09.png"));
  load(&d, "train");
  ck_assert_int_eq(d.count, 12);
  ck_assert_int_eq(d.total, 12);
  ck_assert_int_eq(d.warnings, 1);
  ck_assert_ptr_nonnull(strstr(d.warning[0], "2 of 14 pictures are missing"));
  ck_assert_ptr_nonnull(strstr(d.warning[0], "images/p03.png"));
  same_rays(&d, &rig);
  sf_dataset_free(&d);
  ck_good(sf_dataset_load(&d, folder, "train", &(sf_dataset_options){.downscale = 1, .first = 2, .limit = 1}));
  ck_assert_str_eq(d.view[0].name, "images/p04.png");
  sf_dataset_free(&d);
  load(&d, "test"); /* is whole */
  ck_assert(d.count == 3 && d.warnings == 0);
  sf_dataset_free(&d);
  for (int v = 1; v < 8; v++) {
    char name[40];
    snprintf(name, sizeof name, "images/p%02d.png", v);
    unlink(in(name));
  }
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_IO, "images/p01.png", "8 of 14 pictures are missing");
}
END_TEST

START_TEST(other_endings_are_found)
{
  layout_rig rig = orbit();
  sf_dataset d;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  for (int v = 0; v < VIEWS; v++) snprintf(rig.view[v].name, sizeof rig.view[v].name, v % 2 ? "p%02d.JPG" : "p%02d", v);
  put_colmap("sparse/0", &rig, 0);
  load(&d, "test");
  ck_assert_int_eq(d.count, 3);
  sf_dataset_free(&d);
}
END_TEST

static bool warned(const sf_dataset *d, const char *word, const char *name)
{
  for (int i = 0; i < d->warnings; i++)
    if (strstr(d->warning[i], word) && strstr(d->warning[i], name)) return true;
  return false;
}

START_TEST(the_survey_names_what_looks_wrong)
{
  layout_rig rig = orbit();
  sf_dataset d;
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
  load(&d, "train");
  ck_good(sf_dataset_survey(&d));
  ck_assert(warned(&d, "exposure", "images/p06.png") && warned(&d, "-2.", "1 of 14"));
  ck_assert_int_eq(d.warnings, 1);
  sf_dataset_free(&d);
  rig.view[2].lens = 8, rig.view[3].lens = 9;
  memcpy(rig.view[12].to_world, rig.view[11].to_world, sizeof rig.view[11].to_world);
  for (int i = 0; i < 3; i++) rig.view[10].to_world[4 * i + 3] += 40 * rig.view[10].to_world[4 * i + 2];
  for (int i = 0; i < 12; i++)
    if (i % 4 == 0 || i % 4 == 2) rig.view[5].to_world[i] *= -1; /* turns its back */
  put_colmap("sparse/0", &rig, 0);
  load(&d, "train");
  ck_assert(warned(&d, "do not look at the scene", "images/p05.png"));
  ck_good(sf_dataset_survey(&d));
  ck_assert(warned(&d, "factor 2", "images/p02.png"));
  ck_assert(warned(&d, "stretched", "images/p02.png"));
  ck_assert(warned(&d, "optical centre", "images/p02.png"));
  ck_assert(warned(&d, "field of view: 152 degrees", "images/p03.png"));
  ck_assert(warned(&d, "pose of another", "images/p12.png: that of images/p11.png"));
  ck_assert(warned(&d, "far outside", "images/p10.png"));
  sf_dataset_free(&d);
}
END_TEST

/* From above and from the side: each camera's own point has its colour, the box's edges are grey. */
START_TEST(the_plan_shows_every_camera)
{
  enum { SIZE = 200 };
  const layout_rig rig = orbit();
  sf_dataset d, held;
  sf_image image;
  put_colmap("sparse/0", &rig, 0);
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  load(&d, "train"), load(&held, "test");
  ck_good(sf_plan_draw(&d, &held, SIZE, &image));
  ck_assert(image.width == 2 * SIZE && image.height == SIZE);
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
  sf_image_free(&image);
  sf_dataset_free(&d), sf_dataset_free(&held);
}
END_TEST

START_TEST(cameras_that_all_look_away_are_refused)
{
  layout_rig rig = orbit();
  sf_dataset d;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_json("transforms_train.json", &rig, "", "images", 0,
           1); /* Blender: about the origin; these are about (3, -2, 1) */
  for (int v = 0; v < VIEWS; v++)
    for (int i = 0; i < 12; i++)
      if (i % 4 == 0 || i % 4 == 2) rig.view[v].to_world[i] *= -1;
  put_json("transforms_train.json", &rig, "", "images", 0, 1);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_RANGE, "transforms_train.json", "no view looks at the scene");
}
END_TEST

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

START_TEST(bad_numpy_files_are_named)
{
  static layout_file file;
  const bad_npy *bad = &bad_npys[_i];
  sf_dataset d;
  layout_npy_header(&file, bad->descr, bad->order, bad->shape);
  for (int i = 0; i < bad->bytes; i++) layout_put(&file, 0, 1);
  put("poses_bounds.npy", &file);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), bad->code, "poses_bounds.npy", bad->problem);
}
END_TEST

/* Every shorter file is refused by name: none is read beyond its end, none is taken for whole. */
START_TEST(truncated_files_are_named)
{
  static const char *const names[] = {"poses_bounds.npy", "sparse/0/cameras.bin", "sparse/0/images.bin",
                                      "sparse/0/points3D.bin"};
  static layout_file file;
  layout_rig rig = orbit();
  sf_dataset d;
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
  ck_good(sf_dataset_load(&d, folder, "train", NULL));
  sf_dataset_free(&d);
  const size_t whole = file.size;
  for (file.size = 0; file.size < whole; file.size += 1 + file.size / 40) {
    put(names[_i], &file);
    ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_FORMAT, names[_i], _i ? "cut short" : "");
    ck_assert_ptr_null(d.view);
  }
  file.size = whole + 1;
  put(names[_i], &file);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_FORMAT, names[_i], "too");
}
END_TEST

START_TEST(camera_models_are_refused_by_name)
{
  static const layout_lens other[] = {{5, 5, "OPENCV_FISHEYE", WIDTH, HEIGHT, 8, {20, 20, 8, 6}},
                                      {5, 6, "FULL_OPENCV", WIDTH, HEIGHT, 8, {20, 20, 8, 6}},
                                      {5, 7, "FOV", WIDTH, HEIGHT, 5, {20, 20, 8, 6, 1}},
                                      {5, 10, "THIN_PRISM_FISHEYE", WIDTH, HEIGHT, 8, {20, 20, 8, 6}}};
  layout_rig rig = orbit();
  sf_dataset d;
  rig.lens[rig.lenses++] = other[_i];
  if (other[_i].params == 8 && other[_i].model > 5) { /* 12 numbers: the rest from a camera behind it */
    rig.lens[rig.lenses++] = other[0];
  }
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  put_colmap("sparse/0", &rig, 0);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_UNSUPPORTED, "cameras.bin: camera 5", other[_i].name);
}
END_TEST

typedef struct bad_text {
  const char *cameras, *images;
  sf_code code;
  const char *where, *problem;
} bad_text;
#define CAMERA "1 PINHOLE 16 12 20 20 8 6\n"
static const bad_text bad_texts[] = {
    {"1 BLA 16 12 20 20 8 6\n", "", SF_E_UNSUPPORTED, "cameras.txt:1", "unknown camera model BLA"},
    {"# x\n1 PINHOLE 16 12 20 20 8\n", "", SF_E_FORMAT, "cameras.txt:2", "number 4 cannot be read"},
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
    {CAMERA, "1 1 0 0 0 0 0 0 1\n\n", SF_E_FORMAT, "images.txt:1", "no name"},
};

START_TEST(bad_texts_are_named)
{
  const bad_text *bad = &bad_texts[_i];
  const layout_rig rig = orbit();
  sf_dataset d;
  put_pictures("images", &rig, WIDTH, HEIGHT, 255);
  ck_good(sf_make_dir(in("sparse/0")));
  ck_good(sf_write_file(in("sparse/0/cameras.txt"), bad->cameras, strlen(bad->cameras)));
  ck_good(sf_write_file(in("sparse/0/images.txt"), bad->images, strlen(bad->images)));
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), bad->code, bad->where, bad->problem);
}
END_TEST

START_TEST(folders_that_do_not_fit_are_named)
{
  const layout_rig rig = row();
  sf_dataset d;
  put_llff(&rig, 0, 4, 40);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_IO, folder, "no folder images or images_N");
  put_pictures("images_4", &rig, WIDTH, HEIGHT, 255);
  ck_bad(sf_dataset_load(&d, folder, "val", NULL), SF_E_IO, "no split val", "train or test");
  ck_bad(sf_dataset_load(&d, folder, "train", &(sf_dataset_options){.downscale = 2}), SF_E_RANGE, "images_4", "1/2");
  put_picture("images_4/more.png", WIDTH, HEIGHT, 1, 255);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_FORMAT, "poses of 17 views", "images_4 holds 18 pictures");
  unlink(in("images_4/more.png"));
  put_picture("images_4/p03.png", WIDTH, 2 * HEIGHT, 1, 255);
  ck_bad(sf_dataset_load(&d, folder, "train", NULL), SF_E_FORMAT, "images_4/p03.png",
         "16 x 24 pixels, its camera says 64 x 48");
}
END_TEST

static Suite *suite(void)
{
  Suite *s = suite_create("layouts");
  TCase *t = tcase_create("all");
  tcase_add_checked_fixture(t, make_folder, remove_folder);
  tcase_set_timeout(t, 60);
  tcase_add_loop_test(t, colmap_has_the_rays_of_its_poses, 0, 4);
  tcase_add_test(t, instant_ngp_has_the_rays_of_its_poses);
  tcase_add_test(t, an_object_on_nothing_fills_the_box);
  tcase_add_test(t, blender_has_the_rays_of_its_poses);
  tcase_add_loop_test(t, forward_facing_rays_are_ndc, 0, 2);
  tcase_add_test(t, forward_facing_poses_are_recentred);
  tcase_add_test(t, poses_decide_what_faces_forward);
  tcase_add_test(t, one_layout_wins_and_says_so);
  tcase_add_test(t, pictures_of_the_size_asked_for);
  tcase_add_loop_test(t, each_picture_has_its_own_camera, 0, 2);
  tcase_add_loop_test(t, a_lens_is_undone_to_1e4_of_a_pixel, 0, sizeof lenses / sizeof *lenses);
  tcase_add_test(t, a_lens_bends_as_opencv_says);
  tcase_add_test(t, a_lens_that_folds_is_refused);
  tcase_add_loop_test(t, lenses_come_from_every_layout, 0, 6);
  tcase_add_test(t, a_few_missing_pictures_are_passed_over);
  tcase_add_test(t, other_endings_are_found);
  tcase_add_test(t, the_survey_names_what_looks_wrong);
  tcase_add_test(t, the_plan_shows_every_camera);
  tcase_add_test(t, cameras_that_all_look_away_are_refused);
  tcase_add_loop_test(t, bad_numpy_files_are_named, 0, sizeof bad_npys / sizeof *bad_npys);
  tcase_add_loop_test(t, truncated_files_are_named, 0, 4);
  tcase_add_loop_test(t, camera_models_are_refused_by_name, 0, 4);
  tcase_add_loop_test(t, bad_texts_are_named, 0, sizeof bad_texts / sizeof *bad_texts);
  tcase_add_test(t, folders_that_do_not_fit_are_named);
  suite_add_tcase(s, t);
  return s;
}

int main(void)
{
  SRunner *runner = srunner_create(suite());
  srunner_run_all(runner, CK_ENV);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
