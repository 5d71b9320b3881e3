/* COLMAP layout: a sparse model and the pictures that it was made from, or smaller ones. */
#include "src/scene/colmap.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

typedef struct tables {
  char cameras[4096], images[4096], points[4096]; /* points: "" where there are none */
  bool binary;
} tables;

static bool find_tables(const char *dir, tables *t)
{
  static const char *const folder[] = {"sparse/0/", "sparse/", "colmap/sparse/0/"};
  static const char *const ending[] = {".bin", ".txt"};
  for (int i = 0; i < 6; i++) {
    char name[64];
    snprintf(name, sizeof name, "%scameras", folder[i / 2]);
    if (sf_join(t->cameras, dir, name, ending[i % 2]).code != SF_OK || !sf_is_file(t->cameras)) continue;
    snprintf(name, sizeof name, "%simages", folder[i / 2]);
    if (sf_join(t->images, dir, name, ending[i % 2]).code != SF_OK || !sf_is_file(t->images)) continue;
    snprintf(name, sizeof name, "%spoints3D", folder[i / 2]);
    if (sf_join(t->points, dir, name, ending[i % 2]).code != SF_OK || !sf_is_file(t->points)) t->points[0] = 0;
    t->binary = i % 2 == 0;
    return true;
  }
  return false;
}

bool sf_colmap_there(const char *dir)
{
  tables t;
  return find_tables(dir, &t);
}

/* World to camera with OpenCV axes (y down, z ahead) -> camera to world with OpenGL axes. */
static void set_pose(sf_frame *frame, const sf_colmap_image *image)
{
  double length = 0;
  for (int i = 0; i < 4; i++) length += image->q[i] * image->q[i];
  length = sqrt(length); /* 1 but for the digits that were written */
  const double w = image->q[0] / length, x = image->q[1] / length, y = image->q[2] / length, z = image->q[3] / length;
  const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                       2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                       2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  for (int i = 0; i < 3; i++) {
    double *m = frame->to_world + 4 * i;
    m[0] = r[i], m[1] = -r[3 + i], m[2] = -r[6 + i];
    m[3] = -(r[i] * image->t[0] + r[3 + i] * image->t[1] + r[6 + i] * image->t[2]);
  }
}

static int by_name(const void *a, const void *b)
{
  const sf_colmap_image *one = a, *other = b;
  return strcmp(one->name, other->name);
}

static int by_id(const void *a, const void *b)
{
  const sf_colmap_camera *one = a, *other = b;
  return (one->id > other->id) - (one->id < other->id);
}

static sf_status check_cameras(const sf_colmap *model, const char *path)
{
  for (int i = 1; i < model->cameras; i++)
    if (model->camera[i].id == model->camera[i - 1].id)
      return sf_fail(SF_E_FORMAT, "%s: camera %lld is listed twice", path, (long long)model->camera[i].id);
  return sf_ok();
}

static sf_status set_frame(sf_frame *frame, const sf_colmap *model, int i, const char *folder, const tables *t)
{
  const sf_colmap_image *image = &model->image[i];
  const sf_colmap_camera key = {.id = image->camera};
  const sf_colmap_camera *camera =
      model->cameras ? bsearch(&key, model->camera, (size_t)model->cameras, sizeof key, by_id) : NULL;
  if (!camera)
    return sf_fail(SF_E_FORMAT, "%s: image %lld (%s) is of camera %lld, which %s does not list", t->images,
                   (long long)image->id, image->name, (long long)image->camera, t->cameras);
  frame->lens = camera->lens;
  frame->own_size = true, frame->number = i;
  set_pose(frame, image);
  if ((size_t)snprintf(frame->file_path, sizeof frame->file_path, "%s/%s", folder, image->name) >=
      sizeof frame->file_path)
    return sf_fail(SF_E_RANGE, "%s: image %lld (%.80s...): name too long", t->images, (long long)image->id,
                   image->name);
  return sf_ok();
}

static sf_status take_model(sf_capture *c, sf_colmap *model, const char *dir, const tables *t, int downscale)
{
  char folder[64];
  double width = 0, height = 0;
  if (!model->images) return sf_fail(SF_E_RANGE, "%s: zero views", t->images);
  qsort(model->image, (size_t)model->images, sizeof *model->image, by_name);
  for (int i = 1; i < model->images; i++)
    if (!strcmp(model->image[i - 1].name, model->image[i].name))
      return sf_fail(SF_E_FORMAT, "%s: images %lld and %lld have the same name %.200s", t->images,
                     (long long)model->image[i - 1].id, (long long)model->image[i].id, model->image[i].name);
  if (model->cameras) qsort(model->camera, (size_t)model->cameras, sizeof *model->camera, by_id);
  SF_TRY(check_cameras(model, t->cameras));
  for (int i = 0; i < model->cameras; i++) {
    const sf_lens *lens = &model->camera[i].lens;
    if (lens->width > width) width = lens->width;
    if (lens->height > height) height = lens->height;
  }
  SF_TRY(sf_pictures_choose(dir, downscale, width, height, folder, &c->shrink));
  c->frame = calloc((size_t)model->images, sizeof *c->frame);
  if (!c->frame) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", t->images, model->images);
  for (; c->count < model->images; c->count++) SF_TRY(set_frame(&c->frame[c->count], model, c->count, folder, t));
  sf_capture_note_full_size(c, dir, model->image[0].name);
  c->point = model->point, c->points = model->points;
  model->point = NULL;
  return sf_ok();
}

sf_status sf_colmap_read(sf_capture *capture, const char *dir, const sf_dataset_options *options)
{
  tables t;
  sf_colmap model = {0};
  capture->layout = SF_LAYOUT_COLMAP;
  if (!find_tables(dir, &t)) return sf_fail(SF_E_IO, "%s: no sparse model is there", dir);
  strcpy(capture->list, t.images);
  const char *points = t.points[0] ? t.points : NULL;
  sf_status status = t.binary ? sf_colmap_read_binary(&model, t.cameras, t.images, points)
                              : sf_colmap_read_text(&model, t.cameras, t.images, points);
  if (status.code == SF_OK) status = take_model(capture, &model, dir, &t, options->downscale);
  sf_colmap_free(&model);
  return status;
}

/* sparse/1 and on hold what COLMAP could not join to sparse/0: by their size on disk. */
sf_status sf_colmap_check_others(sf_dataset *data)
{
  static const char *const ending[] = {".bin", ".txt"};
  char path[4096], largest[4096] = "";
  struct stat info;
  if (!strstr(data->list, "/sparse/0/") || stat(data->list, &info)) return sf_ok();
  off_t most = info.st_size;
  for (int i = 2; i < 40; i++) {
    char name[40];
    snprintf(name, sizeof name, "sparse/%d/images", i / 2);
    if (sf_join(path, data->path, name, ending[i % 2]).code != SF_OK || stat(path, &info) || info.st_size <= most)
      continue;
    most = info.st_size;
    strcpy(largest, path);
  }
  if (!largest[0]) return sf_ok();
  return sf_warn(data, "%s: another model is larger: %s is not used", data->list, largest);
}
