/* Blender layout: transforms_*.json and pictures. */
#include "spikefield/io.h"
#include "spikefield/scene.h"
#include "src/scene/frames.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#define DEFAULT_SCALE 0.8f
/* Of a focal length and of an optical centre: beyond them rays lose all precision, and then their direction. */
static const float FOCAL_MIN = 1e-3f, PIXELS_MAX = 1e9f;
const char *const sf_layout_names[] = {"blender", "llff", "colmap", "ingp"};
enum { HOLD_OUT = 8 }; /* every 8th view where the data names no test views */

static bool is_file(const char *path)
{
  struct stat info;
  return !stat(path, &info) && !S_ISDIR(info.st_mode);
}

static sf_status join(char *path, size_t room, const char *dir, const char *name, const char *tail)
{
  bool absolute = name[0] == '/';
  int n = snprintf(path, room, "%s%s%s%s", absolute ? "" : dir, absolute ? "" : "/", name, tail);
  if (n < 0 || (size_t)n >= room) return sf_fail(SF_E_IO, "%.80s.../%.80s: name too long", dir, name);
  return sf_ok();
}

/* Which file lists the views, and which share of them is this split. */
typedef struct listing {
  char path[4096];
  enum { ALL_VIEWS, ALL_BUT_HELD_OUT, ONLY_HELD_OUT } part;
} listing;

static sf_status find_listing(listing *list, const char *dir, const char *split)
{
  char name[64], test[4096];
  struct stat info;
  if (stat(dir, &info) || !S_ISDIR(info.st_mode)) return sf_fail(SF_E_IO, "%s: no such folder", dir);
  bool training = !strcmp(split, "train"), testing = !strcmp(split, "test");
  snprintf(name, sizeof name, "transforms_%.32s.json", split);
  SF_TRY(join(list->path, sizeof list->path, dir, name, ""));
  SF_TRY(join(test, sizeof test, dir, "transforms_test.json", ""));
  bool found = is_file(list->path);
  list->part = training && !is_file(test) ? ALL_BUT_HELD_OUT : ALL_VIEWS;
  if (found) return sf_ok();
  if (!training && !testing) return sf_fail(SF_E_IO, "%s: no such file", list->path);
  if (testing) list->part = ONLY_HELD_OUT;
  const char *const others[] = {"transforms_train.json", "transforms.json"};
  for (int i = training; i < 2; i++) {
    SF_TRY(join(list->path, sizeof list->path, dir, others[i], ""));
    if (is_file(list->path)) return sf_ok();
  }
  return sf_fail(SF_E_IO, "%s: neither transforms_train.json nor transforms.json is there", dir);
}

static bool wanted(const listing *list, int index)
{
  bool held_out = index % HOLD_OUT == 0;
  return list->part == ALL_VIEWS || held_out == (list->part == ONLY_HELD_OUT);
}

static sf_status parse_listing(const listing *list, const cJSON *json, const sf_dataset_options *options,
                               sf_frame **frames, int **numbers, int *count, int *total)
{
  const cJSON *array = cJSON_GetObjectItemCaseSensitive(json, "frames"), *item;
  sf_lens shared = {0};
  if (!cJSON_IsObject(json)) return sf_fail(SF_E_FORMAT, "%s: not a JSON object", list->path);
  if (!cJSON_IsArray(array)) return sf_fail(SF_E_FORMAT, "%s: the array frames is missing", list->path);
  int n = cJSON_GetArraySize(array), index = 0;
  if (!n) return sf_fail(SF_E_RANGE, "%s: zero views: the array frames is empty", list->path);
  SF_TRY(sf_lens_parse(&shared, json, list->path));
  *frames = calloc((size_t)n, sizeof **frames);
  *numbers = calloc((size_t)n, sizeof **numbers);
  if (!*frames || !*numbers) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", list->path, n);
  cJSON_ArrayForEach(item, array)
  {
    if (wanted(list, index) && (*total)++ >= options->first && (!options->limit || *count < options->limit)) {
      SF_TRY(sf_frame_parse(&(*frames)[*count], item, &shared, list->path, index));
      (*numbers)[(*count)++] = index;
    }
    index++;
  }
  if (!*total)
    return sf_fail(SF_E_RANGE, "%s: zero views: all %d are held out for testing (every %dth)", list->path, n, HOLD_OUT);
  return sf_ok();
}

/* ---- pictures ---- */

static sf_status picture_path(char *path, size_t room, const char *dir, const char *file)
{
  const char *slash = strrchr(file, '/'), *dot = strrchr(slash ? slash : file, '.');
  bool extension = dot && (!strcasecmp(dot, ".png") || !strcasecmp(dot, ".jpg") || !strcasecmp(dot, ".jpeg"));
  SF_TRY(join(path, room, dir, file, ""));
  return extension || is_file(path) ? sf_ok() : join(path, room, dir, file, ".png");
}

/* Pixels of the stated size -> pixels of the picture; at most half a pixel of difference in shape is rounding. */
static sf_status set_lens(sf_camera *camera, const sf_lens *lens, const sf_image *image, const char *where)
{
  double w = image->width, h = image->height, sx = 1, sy = 1;
  if (lens->width > 0) sx = w / lens->width;
  if (lens->height > 0) sy = h / lens->height;
  if (lens->width > 0 && lens->height > 0 && fabs(lens->height * sx - h) > 0.5 + 0.5 * sx &&
      fabs(lens->width * sy - w) > 0.5 + 0.5 * sy)
    return sf_fail(SF_E_FORMAT, "%s: the picture has %g x %g pixels, the JSON says %g x %g", where, w, h, lens->width,
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
  if (!(camera->fx > FOCAL_MIN && camera->fy > FOCAL_MIN && camera->fx < PIXELS_MAX && camera->fy < PIXELS_MAX))
    return sf_fail(SF_E_RANGE, "%s: focal length of %g x %g pixels", where, fx, fy);
  if (!(fabsf(camera->cx) < PIXELS_MAX && fabsf(camera->cy) < PIXELS_MAX))
    return sf_fail(SF_E_RANGE, "%s: optical centre at pixel %g, %g", where, (double)camera->cx, (double)camera->cy);
  return sf_ok();
}

/* A picture's own fault names the picture; the frame says where it was asked for. */
static sf_status in_frame(sf_status status, const char *list, int number)
{
  if (status.code == SF_OK) return status;
  return sf_fail(status.code, "%s (frame %d of %s)", status.message, number, list);
}

/* A picture may lie anywhere, also outside the folder. But a device or a pipe that a data set names may never end. */
static sf_status refuse_device(const char *path)
{
  struct stat info;
  if (!stat(path, &info) && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode))
    return sf_fail(SF_E_IO, "cannot read %s: it is not a regular file", path);
  return sf_ok();
}

static sf_status load_view(sf_view *view, const sf_frame *frame, int number, const listing *list, const char *dir,
                           const sf_dataset_options *options, float scale)
{
  char path[4096], where[4096 + 340];
  snprintf(where, sizeof where, "%s: frame %d (%s)", list->path, number, frame->file_path);
  strcpy(view->name, frame->file_path);
  memcpy(view->camera.to_world, frame->to_world, sizeof view->camera.to_world);
  for (int i = 0; i < 3; i++) {
    view->camera.to_world[4 * i + 3] *= scale;
    if (!isfinite(view->camera.to_world[4 * i + 3]))
      return sf_fail(SF_E_RANGE, "%s: position times scale %g is not finite", where, scale);
  }
  SF_TRY(picture_path(path, sizeof path, dir, frame->file_path));
  SF_TRY(in_frame(refuse_device(path), list->path, number));
  SF_TRY(in_frame(sf_image_load(&view->image, path), list->path, number));
  SF_TRY(set_lens(&view->camera, &frame->lens, &view->image, where));
  if (options->downscale <= 1) return sf_ok();
  SF_TRY(in_frame(sf_image_downscale(&view->image, options->downscale, path), list->path, number));
  sf_camera *camera = &view->camera;
  float shrink = 1.0f / (float)options->downscale;
  camera->width = view->image.width, camera->height = view->image.height;
  camera->fx *= shrink, camera->fy *= shrink, camera->cx *= shrink, camera->cy *= shrink;
  return sf_ok();
}

/* First fault in the order of the views, whatever the order of the threads. */
static sf_status first_fault(const sf_dataset *data, const sf_frame *frames, const int *numbers,
                             const sf_status *status, const char *list)
{
  for (int i = 0; i < data->count; i++) {
    if (status[i].code != SF_OK) return status[i];
    const sf_image *one = &data->view[0].image, *other = &data->view[i].image;
    bool same = one->width == other->width && one->height == other->height;
    if (!same && !(frames[0].own_size && frames[i].own_size))
      return sf_fail(SF_E_FORMAT,
                     "%s: pictures of different sizes: frame %d (%s) has %d x %d, frame %d (%s) has %d x %d", list,
                     numbers[0], data->view[0].name, one->width, one->height, numbers[i], data->view[i].name,
                     other->width, other->height);
  }
  return sf_ok();
}

static sf_status load_views(sf_dataset *data, const sf_frame *frames, const int *numbers, int count,
                            const listing *list, const sf_dataset_options *options)
{
  if (count == 0) return sf_ok();
  sf_status *status = calloc((size_t)count, sizeof *status);
  data->view = calloc((size_t)count, sizeof *data->view);
  if (!status || !data->view) {
    free(status);
    return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", list->path, count);
  }
  data->count = count;
#pragma omp parallel for schedule(dynamic)
  for (int i = 0; i < count; i++)
    status[i] = load_view(&data->view[i], &frames[i], numbers[i], list, data->path, options, data->scale);
  sf_status first = first_fault(data, frames, numbers, status, list->path);
  free(status);
  return first;
}

static sf_status check_options(const char *dir, const sf_dataset_options *options)
{
  if (strlen(dir) >= sizeof((sf_dataset *)0)->path) return sf_fail(SF_E_IO, "%.80s...: name too long", dir);
  if (options->downscale < 0) return sf_fail(SF_E_RANGE, "%s: downscale factor %d is below 1", dir, options->downscale);
  if (options->limit < 0 || options->first < 0)
    return sf_fail(SF_E_RANGE, "%s: %d views from view %d on", dir, options->limit, options->first);
  if (!(options->scale >= 0) || isinf(options->scale))
    return sf_fail(SF_E_RANGE, "%s: scale %g is not a positive number", dir, options->scale);
  return sf_ok();
}

sf_status sf_dataset_load(sf_dataset *data, const char *dir, const char *split, const sf_dataset_options *options)
{
  static const sf_dataset_options defaults = {.downscale = 1};
  if (!options) options = &defaults;
  memset(data, 0, sizeof *data);
  SF_TRY(check_options(dir, options));
  strcpy(data->path, dir);
  data->scale = options->scale > 0 ? options->scale : DEFAULT_SCALE, data->bound = 1;
  listing list;
  SF_TRY(find_listing(&list, dir, split));
  cJSON *json;
  SF_TRY(sf_json_load(list.path, &json));
  sf_frame *frames = NULL;
  int *numbers = NULL, count = 0;
  sf_status status = parse_listing(&list, json, options, &frames, &numbers, &count, &data->total);
  cJSON_Delete(json);
  if (status.code == SF_OK) status = load_views(data, frames, numbers, count, &list, options);
  free(frames);
  free(numbers);
  if (status.code != SF_OK) sf_dataset_free(data);
  return status;
}

void sf_dataset_free(sf_dataset *data)
{
  for (int i = 0; data->view && i < data->count; i++) sf_image_free(&data->view[i].image);
  free(data->view);
  memset(data, 0, sizeof *data);
}
