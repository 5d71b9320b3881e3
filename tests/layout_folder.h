/* A rig of cameras, folders in every layout made of it, and what the readers must say of them. */
#ifndef SF_TESTS_LAYOUT_FOLDER_H
#define SF_TESTS_LAYOUT_FOLDER_H
#include "folder_fixture.h"
#include "layout_fixture.h"
#include "base/io.h"
#include "base/rng.h"
#include "scene/scene.h"
#include <math.h>

enum { WIDTH = 16, HEIGHT = 12, VIEWS = 17 };

/* ---- a rig, and the folders made of it ---- */

static inline void put(const char *name, const layout_file *file)
{
  FILE *f = fopen(in(name), "wb");
  ck_assert_ptr_nonnull(f);
  ck_assert_uint_eq(fwrite(file->bytes, 1, file->size, f), file->size);
  ck_assert_int_eq(fclose(f), 0);
}

static inline void put_picture(const char *name, int width, int height, int value, int alpha)
{
  sf_image image = {width, height, malloc((size_t)width * (size_t)height * 8)};
  for (int i = 0; i < width * height * 4; i++)
    image.rgba[i] = (uint16_t)((i % 4 < 3 ? value : i < width * 8 ? alpha : 255) * 257);
  ck_ok(sf_image_save_png(&image, in(name)));
  sf_image_free(&image);
}

/* Row-major from back (unit), up about z. */
static inline void look(double m[12], const double at[3], const double back[3])
{
  const double flat = hypot(back[0], back[1]), right[3] = {-back[1] / flat, back[0] / flat, 0};
  const double up[3] = {back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2],
                        back[0] * right[1] - back[1] * right[0]};
  for (int i = 0; i < 3; i++) m[4 * i] = right[i], m[4 * i + 1] = up[i], m[4 * i + 2] = back[i], m[4 * i + 3] = at[i];
}

/* About (3, -2, 1) at distances around 5, with a tilted up direction if asked; a lens for all. */
static inline layout_rig orbit(void)
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
static inline layout_rig row(void)
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
static inline layout_rig shuffled(const layout_rig *rig)
{
  layout_rig other = *rig;
  for (int v = 0; v < rig->views; v++) other.view[v] = rig->view[(5 * v + 3) % rig->views];
  return other;
}

static inline void put_colmap(const char *dir, const layout_rig *rig, int text)
{
  static layout_file file;
  char name[100];
  ck_ok(sf_make_dir(in(dir)));
  snprintf(name, sizeof name, "%s/cameras.%s", dir, text ? "txt" : "bin");
  layout_cameras(&file, rig, text), put(name, &file);
  snprintf(name, sizeof name, "%s/images.%s", dir, text ? "txt" : "bin");
  layout_images(&file, rig, text), put(name, &file);
  snprintf(name, sizeof name, "%s/points3D.%s", dir, text ? "txt" : "bin");
  if (rig->points) layout_points(&file, rig, text), put(name, &file);
}

static inline void put_pictures(const char *dir, const layout_rig *rig, int width, int height, int alpha)
{
  char name[100];
  ck_ok(sf_make_dir(in(dir)));
  for (int v = 0; v < rig->views; v++) {
    snprintf(name, sizeof name, "%s/%s", dir, rig->view[v].name);
    put_picture(name, width, height, 10 + v, alpha);
  }
}

static inline void put_json(const char *name, const layout_rig *rig, const char *more, const char *pictures, int first,
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

static inline ray rig_ray(const layout_view *view, const layout_lens *lens, double px, double py)
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
static inline void to_model(const sf_dataset *d, const double p[3], double out[3])
{
  for (int i = 0; i < 3; i++)
    out[i] = (d->world[4 * i] * p[0] + d->world[4 * i + 1] * p[1] + d->world[4 * i + 2] * p[2] + d->world[4 * i + 3]) *
                 (double)d->scale +
             (double)d->offset[i];
}

static inline double from_ray(const float o[3], const float d[3], const double p[3])
{
  double along = 0, sum = 0;
  for (int i = 0; i < 3; i++) along += (p[i] - (double)o[i]) * (double)d[i];
  for (int i = 0; i < 3; i++) sum += pow(p[i] - (double)o[i] - along * (double)d[i], 2);
  return sqrt(sum);
}

static inline const layout_view *named(const layout_rig *rig, const char *name)
{
  const char *slash = strrchr(name, '/');
  for (int v = 0; v < rig->views; v++)
    if (!strcmp(rig->view[v].name, slash ? slash + 1 : name)) return &rig->view[v];
  ck_abort_msg("no view %s", name);
  return NULL;
}

/* Every loaded view's rays are those of the rig: both ends of a piece of the rig's ray, brought into model units, lie
 * on the loaded one, and its origin is the camera's. Floats at distances below 4 units: 1e-6. */
static inline void same_rays(const sf_dataset *d, const layout_rig *rig)
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

static inline void load(sf_dataset *set, const char *split)
{
  ck_ok(sf_dataset_load(set, folder, split, NULL));
}

static sf_dataset d; /* what a test looks at */

static inline sf_status reload_as(const char *split, const sf_dataset_options *options)
{
  sf_dataset_free(&d);
  return sf_dataset_load(&d, folder, split, options);
}

static inline void reload(const char *split)
{
  ck_ok(reload_as(split, NULL));
}

static inline void tear_down(void)
{
  sf_dataset_free(&d);
  remove_folder();
}

/* Names ascend, every 8th is held out, and each picture is the one of its pose. */
static inline void same_splits(const layout_rig *rig)
{
  for (int testing = 0; testing < 2; testing++) {
    reload(testing ? "test" : "train");
    ck_assert_int_eq(d.count, testing ? (VIEWS + 7) / 8 : VIEWS - (VIEWS + 7) / 8);
    for (int i = 0; i < d.count; i++) {
      const int v = testing ? 8 * i : i + 1 + i / 7;
      ck_assert_ptr_eq(named(rig, d.view[i].name), &rig->view[v]);
      ck_assert_uint_eq(d.view[i].image.rgba[4 * WIDTH * HEIGHT - 4] / 257, (unsigned)(10 + v));
    }
    same_rays(&d, rig);
  }
}

static inline void put_llff(const layout_rig *rig, int single, double near, double far)
{
  static layout_file file;
  layout_npy(&file, rig, single, near, far);
  put("poses_bounds.npy", &file);
}
#endif
