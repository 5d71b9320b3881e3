/* The views of a split: which they are, their pictures, their cameras in pixels. */
#include "src/scene/capture.h"
#include "src/scene/lens.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Of a focal length and of an optical centre: beyond them rays lose all precision, and then their direction. */
static const float FOCAL_MIN = 1e-3f, PIXELS_MAX = 1e9f;

typedef struct loading {
  sf_dataset *data;
  const sf_capture *capture;
  const sf_dataset_options *options;
  int *chosen; /* [data->count] frames of the views */
} loading;

/* ---- cameras ---- */

static const char *lens_name(const sf_lens *lens)
{
  if (lens->model) return lens->model;
  if (lens->p1 != 0 || lens->p2 != 0) return "OPENCV";
  if (lens->k2 != 0) return "RADIAL";
  if (lens->k1 != 0) return "SIMPLE_RADIAL";
  return lens->fl_y > 0 && lens->fl_y != lens->fl_x ? "PINHOLE" : "SIMPLE_PINHOLE";
}

/* Pixels of the stated size -> pixels of the picture; at most half a pixel of difference in shape is rounding. */
static sf_status set_lens(sf_camera *camera, const sf_lens *lens, const sf_image *image, const char *where)
{
  double w = image->width, h = image->height, sx = 1, sy = 1;
  if (lens->width > 0) sx = w / lens->width;
  if (lens->height > 0) sy = h / lens->height;
  if (!(lens->width > 0)) sx = sy;
  if (!(lens->height > 0)) sy = sx;
  if (lens->width > 0 && lens->height > 0 && fabs(lens->height * sx - h) > 0.5 + 0.5 * sx &&
      fabs(lens->width * sy - w) > 0.5 + 0.5 * sy)
    return sf_fail(SF_E_FORMAT, "%s: the picture has %g x %g pixels, its camera says %g x %g", where, w, h, lens->width,
                   lens->height);
  double fx = lens->fl_x > 0 ? lens->fl_x * sx : 0.5 * w / tan(0.5 * lens->angle_x);
  double fy = fx;
  if (lens->fl_y > 0)
    fy = lens->fl_y * sy;
  else if (lens->fl_x > 0)
    fy = lens->fl_x * sy;
  else if (lens->angle_y > 0)
    fy = 0.5 * h / tan(0.5 * lens->angle_y);
  camera->width = image->width, camera->height = image->height;
  camera->fx = (float)fx, camera->fy = (float)fy;
  camera->cx = (float)(lens->has_cx ? lens->cx * sx : 0.5 * w);
  camera->cy = (float)(lens->has_cy ? lens->cy * sy : 0.5 * h);
  camera->k1 = (float)lens->k1, camera->k2 = (float)lens->k2;
  camera->p1 = (float)lens->p1, camera->p2 = (float)lens->p2;
  if (!(camera->fx > FOCAL_MIN && camera->fy > FOCAL_MIN && camera->fx < PIXELS_MAX && camera->fy < PIXELS_MAX))
    return sf_fail(SF_E_RANGE, "%s: focal length of %g x %g pixels", where, fx, fy);
  if (!(fabsf(camera->cx) < PIXELS_MAX && fabsf(camera->cy) < PIXELS_MAX))
    return sf_fail(SF_E_RANGE, "%s: optical centre at pixel %g, %g", where, (double)camera->cx, (double)camera->cy);
  return sf_lens_check(camera, where);
}

static sf_status set_pose(sf_camera *camera, const sf_frame *frame, const sf_dataset *data, const char *where)
{
  for (int i = 0; i < 12; i++) camera->to_world[i] = (float)frame->to_world[i];
  for (int i = 0; i < 3; i++) {
    float *position = &camera->to_world[4 * i + 3];
    if (!data->ndc) *position *= data->scale;
    if (data->offset[i] != 0) /* it may take most of a position away */
      *position = (float)(frame->to_world[4 * i + 3] * (double)data->scale + (double)data->offset[i]);
    if (!isfinite(*position))
      return sf_fail(SF_E_RANGE, "%s: position times scale %g is not finite", where, (double)data->scale);
  }
  return sf_ok();
}

/* ---- pictures ---- */

/* A picture's own fault names the picture; the frame says where it was asked for. */
static sf_status in_frame(sf_status status, const char *list, int number)
{
  if (status.code == SF_OK) return status;
  return sf_fail(status.code, "%s (frame %d of %s)", status.message, number, list);
}

static float mean_brightness(const sf_image *image)
{
  uint64_t sum = 0, weight = 0;
  const size_t n = (size_t)image->width * (size_t)image->height;
  for (size_t i = 0; i < n; i++) {
    const uint16_t *p = image->rgba + 4 * i;
    sum += (uint64_t)(((uint32_t)p[0] + p[1] + p[2]) / 3) * p[3] >> 16, weight += p[3];
  }
  return weight ? (float)((double)sum / (double)weight * 65536 / 65535) : 0;
}

/* The factor asked for, or the smallest that brings the picture to what is chosen unasked. */
static int factor_of(const sf_capture *capture, const sf_image *image)
{
  const int side = image->width > image->height ? image->width : image->height;
  return capture->shrink ? capture->shrink : (side + SF_LONG_SIDE - 1) / SF_LONG_SIDE;
}

static void shrink_camera(sf_camera *camera, const sf_image *image, int factor)
{
  const float shrink = 1.0f / (float)factor;
  camera->width = image->width, camera->height = image->height;
  camera->fx *= shrink, camera->fy *= shrink, camera->cx *= shrink, camera->cy *= shrink;
}

static sf_status load_view(sf_view *view, const sf_frame *frame, const loading *l)
{
  char path[4096], where[4096 + 400], camera[48] = "";
  const char *list = l->capture->list;
  if (frame->lens.camera >= 0) snprintf(camera, sizeof camera, ", camera %lld", (long long)frame->lens.camera);
  snprintf(where, sizeof where, "%s: frame %d (%s%s)", list, frame->number, frame->file_path, camera);
  strcpy(view->name, frame->file_path);
  view->lens = lens_name(&frame->lens);
  SF_TRY(set_pose(&view->camera, frame, l->data, where));
  SF_TRY(sf_picture_find(path, l->data->path, frame->file_path));
  SF_TRY(in_frame(sf_picture_load(&view->image, path), list, frame->number));
  SF_TRY(set_lens(&view->camera, &frame->lens, &view->image, where));
  view->brightness = mean_brightness(&view->image);
  const int shrink = factor_of(l->capture, &view->image);
  if (shrink > 1) {
    SF_TRY(in_frame(sf_image_downscale(&view->image, shrink, path), list, frame->number));
    shrink_camera(&view->camera, &view->image, shrink);
  }
  view->shown = l->data->ndc ? 0 : sf_shown(view);
  if (l->options->cameras_only) free(view->image.rgba), view->image.rgba = NULL;
  return sf_ok();
}

/* First fault in the order of the views, whatever the order of the threads. */
static sf_status first_fault(const loading *l, const sf_status *status)
{
  const sf_dataset *data = l->data;
  const sf_frame *first = &l->capture->frame[l->chosen[0]];
  for (int i = 0; i < data->count; i++) {
    if (status[i].code != SF_OK) return status[i];
    const sf_frame *frame = &l->capture->frame[l->chosen[i]];
    const sf_image *one = &data->view[0].image, *other = &data->view[i].image;
    bool same = one->width == other->width && one->height == other->height;
    if (!same && !(first->own_size && frame->own_size))
      return sf_fail(SF_E_FORMAT,
                     "%s: pictures of different sizes: frame %d (%s) has %d x %d, frame %d (%s) has %d x %d",
                     l->capture->list, first->number, data->view[0].name, one->width, one->height, frame->number,
                     data->view[i].name, other->width, other->height);
  }
  return sf_ok();
}

static sf_status load_chosen(loading *l)
{
  sf_dataset *data = l->data;
  if (data->count == 0) return sf_ok();
  const int count = data->count;
  sf_status *status = calloc((size_t)count, sizeof *status);
  data->view = calloc((size_t)count, sizeof *data->view);
  if (!status || !data->view) {
    free(status);
    return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", l->capture->list, count);
  }
#pragma omp parallel for schedule(dynamic)
  for (int i = 0; i < count; i++) status[i] = load_view(&data->view[i], &l->capture->frame[l->chosen[i]], l);
  sf_status first = first_fault(l, status);
  free(status);
  return first;
}

/* ---- which views ---- */

static bool wanted(const sf_capture *c, int index)
{
  bool held_out = index % SF_HOLD_OUT == 0;
  if (index < c->first) return false;
  return c->part == SF_ALL_VIEWS || held_out == (c->part == SF_ONLY_HELD_OUT);
}

static bool picture_is_there(const sf_dataset *data, const sf_frame *frame)
{
  char path[4096];
  struct stat info;
  return sf_picture_find(path, data->path, frame->file_path).code == SF_OK && !stat(path, &info);
}

/* chosen: all views of the split that have their picture; half of them missing is a fault of the whole. */
static sf_status choose(loading *l, int *listed)
{
  const sf_capture *c = l->capture;
  int missing = 0, first = -1;
  *listed = 0;
  for (int f = 0; f < c->count; f++) {
    if (!wanted(c, f)) continue;
    ++*listed;
    if (picture_is_there(l->data, &c->frame[f])) {
      l->chosen[l->data->total++] = f;
    } else {
      missing++;
      if (first < 0) first = f;
    }
  }
  if (!*listed)
    return sf_fail(SF_E_RANGE, "%s: zero views: all %d are held out for testing (every %dth)", c->list, c->count,
                   SF_HOLD_OUT);
  if (!missing) return sf_ok();
  char path[4096];
  SF_TRY(sf_picture_find(path, l->data->path, c->frame[first].file_path));
  if (2 * missing < *listed)
    return sf_warn(l->data, "%s: %d of %d pictures are missing, the first is %s (frame %d)", c->list, missing, *listed,
                   path, c->frame[first].number);
  return sf_fail(SF_E_IO, "cannot read %s: No such file or directory (frame %d of %s; %d of %d pictures are missing)",
                 path, c->frame[first].number, c->list, missing, *listed);
}

sf_status sf_views_load(sf_dataset *data, const sf_capture *capture, const sf_dataset_options *options)
{
  loading l = {data, capture, options, calloc((size_t)capture->count, sizeof(int))};
  int listed;
  if (!l.chosen) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", capture->list, capture->count);
  sf_status status = choose(&l, &listed);
  if (status.code == SF_OK) {
    int *all = l.chosen, left = data->total > options->first ? data->total - options->first : 0;
    data->count = options->limit && options->limit < left ? options->limit : left;
    l.chosen += data->count ? options->first : 0;
    status = load_chosen(&l);
    l.chosen = all;
  }
  free(l.chosen);
  return status;
}
