/* What the tables of a sparse model may say. */
#include "src/scene/colmap.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const struct {
  const char *name;
  int params;
} models[] = {{"SIMPLE_PINHOLE", 3},
              {"PINHOLE", 4},
              {"SIMPLE_RADIAL", 4},
              {"RADIAL", 5},
              {"OPENCV", 8},
              {"OPENCV_FISHEYE", 8},
              {"FULL_OPENCV", 12},
              {"FOV", 5},
              {"SIMPLE_RADIAL_FISHEYE", 4},
              {"RADIAL_FISHEYE", 5},
              {"THIN_PRISM_FISHEYE", 12},
              {"RAD_TAN_THIN_PRISM_FISHEYE", 16}};
enum { MODELS = sizeof models / sizeof *models };

void sf_colmap_free(sf_colmap *model)
{
  free(model->camera), free(model->image), free(model->point);
  memset(model, 0, sizeof *model);
}

int sf_colmap_model(int number, const char *name, const char **known)
{
  for (int i = 0; i < MODELS; i++) {
    if (name ? strcmp(name, models[i].name) != 0 : i != number) continue;
    *known = models[i].name;
    return models[i].params;
  }
  return -1;
}

static sf_status grow(void **array, int count, int *room, size_t size, const char *where)
{
  if (count < *room) return sf_ok();
  const int more = *room ? 2 * *room : 64;
  void *larger = realloc(*array, (size_t)more * size);
  if (!larger) return sf_fail(SF_E_MEMORY, "%s: no memory for %d of its kind", where, more);
  *array = larger, *room = more;
  return sf_ok();
}

/* p: as the model orders them. */
static bool set_params(sf_lens *lens, const double *p)
{
  const char *model = lens->model;
  const bool two = !strcmp(model, "PINHOLE") || !strcmp(model, "OPENCV");
  lens->fl_x = p[0], lens->fl_y = p[two];
  lens->cx = p[1 + two], lens->cy = p[2 + two];
  lens->has_cx = lens->has_cy = true;
  const double *k = p + 3 + two;
  if (!strcmp(model, "SIMPLE_RADIAL")) lens->k1 = k[0];
  if (!strcmp(model, "RADIAL")) lens->k1 = k[0], lens->k2 = k[1];
  if (!strcmp(model, "OPENCV")) lens->k1 = k[0], lens->k2 = k[1], lens->p1 = k[2], lens->p2 = k[3];
  return two || !strcmp(model, "SIMPLE_PINHOLE") || !strcmp(model, "SIMPLE_RADIAL") || !strcmp(model, "RADIAL");
}

sf_status sf_colmap_add_camera(sf_colmap *model, const char *where, int64_t id, const char *name, double width,
                               double height, const double *params)
{
  sf_lens lens = {.width = width, .height = height, .camera = id};
  const int n = sf_colmap_model(-1, name, &lens.model);
  if (n < 0) return sf_fail(SF_E_UNSUPPORTED, "%s: unknown camera model %.40s", where, name);
  if (!(width >= 1 && height >= 1 && width < 1e6 && height < 1e6))
    return sf_fail(SF_E_RANGE, "%s: %g x %g pixels", where, width, height);
  for (int i = 0; i < n; i++)
    if (!isfinite(params[i])) return sf_fail(SF_E_RANGE, "%s: parameter %d of %s is not finite", where, i, name);
  if (!set_params(&lens, params))
    return sf_fail(SF_E_UNSUPPORTED,
                   "%s: camera model %s is not modelled: expected SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL or "
                   "OPENCV (COLMAP's image_undistorter makes PINHOLE)",
                   where, name);
  if (!(lens.fl_x > 0 && lens.fl_y > 0 && lens.fl_x < 1e7 && lens.fl_y < 1e7))
    return sf_fail(SF_E_RANGE, "%s: focal length of %g x %g pixels", where, lens.fl_x, lens.fl_y);
  if (!(fabs(lens.cx) < 1e7 && fabs(lens.cy) < 1e7))
    return sf_fail(SF_E_RANGE, "%s: optical centre at pixel %g, %g", where, lens.cx, lens.cy);
  void *array = model->camera;
  SF_TRY(grow(&array, model->cameras, &model->room[0], sizeof *model->camera, where));
  model->camera = array;
  model->camera[model->cameras++] = (sf_colmap_camera){id, lens};
  return sf_ok();
}

sf_status sf_colmap_add_image(sf_colmap *model, const char *where, const sf_colmap_image *image)
{
  double length = 0;
  for (int i = 0; i < 4; i++) length += image->q[i] * image->q[i];
  if (!(fabs(length - 1) < 1e-2))
    return sf_fail(SF_E_RANGE, "%s: the rotation is no unit quaternion: its length is %g", where, sqrt(length));
  for (int i = 0; i < 3; i++)
    if (!(fabs(image->t[i]) < 1e12)) return sf_fail(SF_E_RANGE, "%s: the position is %g", where, image->t[i]);
  if (!image->name[0]) return sf_fail(SF_E_FORMAT, "%s: no name", where);
  void *array = model->image;
  SF_TRY(grow(&array, model->images, &model->room[1], sizeof *model->image, where));
  model->image = array;
  model->image[model->images++] = *image;
  return sf_ok();
}

sf_status sf_colmap_add_point(sf_colmap *model, const char *where, const double point[3])
{
  for (int i = 0; i < 3; i++)
    if (!(fabs(point[i]) < 1e12)) return sf_fail(SF_E_RANGE, "%s: coordinate %d is %g", where, i, point[i]);
  void *array = model->point;
  SF_TRY(grow(&array, model->points, &model->room[2], sizeof *model->point, where));
  model->point = array;
  memcpy(model->point[model->points++], point, sizeof *model->point);
  return sf_ok();
}
