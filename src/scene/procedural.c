/* Procedural scenes in the Blender layout. */
#include "base/io.h"
#include "base/rng.h"
#include "scene/scene.h"
#include "src/scene/stage.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define ANGLE_X 0.6911112070083618 /* of the Synthetic-NeRF scenes, as is the distance */
#define DISTANCE 4.031128874149275
enum { SAMPLES = 4 }; /* per axis and pixel */

static sf_status find_scene(const char *name, int *index)
{
  char known[200] = "";
  for (*index = 0; sf_procedural_names[*index]; ++*index) {
    if (!strcmp(name, sf_procedural_names[*index])) return sf_ok();
    size_t n = strlen(known);
    snprintf(known + n, sizeof known - n, "%s%s", n ? ", " : "", sf_procedural_names[*index]);
  }
  return sf_fail(SF_E_USAGE, "unknown scene '%.60s': expected one of %s", name, known);
}

static uint64_t all_shapes(const sf_stage *stage)
{
  return stage->shapes == 64 ? UINT64_MAX : ((uint64_t)1 << stage->shapes) - 1;
}

/* Straight from premultiplied; what is not there at all is black. */
static void unpremultiply(const double sum[4], double straight[4])
{
  straight[3] = fmin(fmax(sum[3], 0), 1);
  for (int c = 0; c < 3; c++) straight[c] = sum[3] > 0 ? fmin(sum[c] / sum[3], 1) : 0;
}

sf_status sf_procedural_trace(const char *name, const float origin[3], const float direction[3], float rgba[4])
{
  int index;
  SF_TRY(find_scene(name, &index));
  sf_stage stage;
  sf_stage_build(&stage, index);
  sf_stage_ray ray;
  double length = 0, sum[4], straight[4];
  for (int i = 0; i < 3; i++) length += (double)direction[i] * direction[i];
  if (!(length > 0) || !isfinite(length)) return sf_fail(SF_E_RANGE, "scene %s: a ray without direction", name);
  for (int i = 0; i < 3; i++) ray.origin[i] = origin[i], ray.direction[i] = direction[i] / sqrt(length);
  sf_stage_trace(&stage, &ray, all_shapes(&stage), sum);
  unpremultiply(sum, straight);
  for (int i = 0; i < 4; i++) rgba[i] = (float)straight[i];
  return sf_ok();
}

static void pixel_ray(const sf_camera *camera, double px, double py, sf_stage_ray *ray)
{
  float origin[3], direction[3];
  double length = 0;
  sf_camera_ray(camera, (float)px, (float)py, origin, direction);
  for (int i = 0; i < 3; i++) length += (double)direction[i] * direction[i];
  for (int i = 0; i < 3; i++) ray->origin[i] = origin[i], ray->direction[i] = direction[i] / sqrt(length);
}

static void render_pixel(const sf_stage *stage, const sf_camera *camera, int x, int y, uint16_t out[4])
{
  sf_stage_ray ray;
  uint64_t candidates = 0;
  double sum[4] = {0}, one[4], straight[4];
  /* The shapes that this pixel can see, found once: 0.75 > half the pixel's diagonal. */
  pixel_ray(camera, x + 0.5, y + 0.5, &ray);
  for (int i = 0; i < stage->shapes; i++)
    if (sf_shape_near(&stage->shape[i], &ray, 0.75 / fmin(camera->fx, camera->fy))) candidates |= (uint64_t)1 << i;
  for (int k = 0; k < SAMPLES * SAMPLES && (candidates || stage->fogs); k++) {
    pixel_ray(camera, x + (k % SAMPLES + 0.5) / SAMPLES, y + (k / SAMPLES + 0.5) / SAMPLES, &ray);
    sf_stage_trace(stage, &ray, candidates, one);
    for (int c = 0; c < 4; c++) sum[c] += one[c] / (SAMPLES * SAMPLES);
  }
  unpremultiply(sum, straight);
  for (int c = 0; c < 4; c++) out[c] = (uint16_t)lrint(straight[c] * 65535);
}

static sf_status render_view(const sf_stage *stage, const sf_camera *camera, const char *path)
{
  sf_image image = {camera->width, camera->height, NULL};
  image.rgba = malloc((size_t)image.width * (size_t)image.height * 4 * sizeof *image.rgba);
  if (!image.rgba) return sf_fail(SF_E_MEMORY, "%s: no memory for the picture", path);
#pragma omp parallel for schedule(dynamic, 4)
  for (int y = 0; y < image.height; y++)
    for (int x = 0; x < image.width; x++)
      render_pixel(stage, camera, x, y, image.rgba + ((size_t)y * image.width + x) * 4);
  sf_status status = sf_image_save_png(&image, path);
  sf_image_free(&image);
  return status;
}

/* Views spread evenly over the upper hemisphere by the two-dimensional golden-ratio sequence (Roberts 2018), turned
 * by the seed; each split has an offset of its own. Near the pole `up` would be lost, so the elevation ends at 72
 * degrees. */
static void place_camera(sf_camera *camera, const sf_procedural_options *options, int split, int index)
{
  const double g = 1.32471795724474602596;
  double u = sf_random_float(options->seed, (uint64_t)split, 0) + (index + 1) / g;
  double v = sf_random_float(options->seed, (uint64_t)split, 1) + (index + 1) / (g * g);
  double azimuth = 2 * M_PI * (u - floor(u)), height = 0.04 + 0.91 * (v - floor(v)), flat = sqrt(1 - height * height);
  double back[3] = {flat * cos(azimuth), flat * sin(azimuth), height};
  double right[3] = {-sin(azimuth), cos(azimuth), 0};
  double up[3] = {-height * cos(azimuth), -height * sin(azimuth), flat};
  memset(camera, 0, sizeof *camera);
  camera->width = options->width, camera->height = options->height;
  camera->fx = camera->fy = (float)(0.5 * options->width / tan(0.5 * ANGLE_X));
  camera->cx = 0.5f * (float)options->width, camera->cy = 0.5f * (float)options->height;
  for (int i = 0; i < 3; i++) {
    camera->to_world[4 * i] = (float)right[i], camera->to_world[4 * i + 1] = (float)up[i];
    camera->to_world[4 * i + 2] = (float)back[i], camera->to_world[4 * i + 3] = (float)(DISTANCE * back[i]);
  }
}

static bool add_frame(cJSON *frames, const char *file_path, const sf_camera *camera)
{
  cJSON *frame = cJSON_CreateObject(), *matrix;
  if (!cJSON_AddItemToArray(frames, frame) || !cJSON_AddStringToObject(frame, "file_path", file_path)) return false;
  if (!(matrix = cJSON_AddArrayToObject(frame, "transform_matrix"))) return false;
  for (int i = 0; i < 4; i++) {
    double row[4] = {0, 0, 0, 1};
    for (int k = 0; k < 4 && i < 3; k++) row[k] = camera->to_world[4 * i + k];
    if (!cJSON_AddItemToArray(matrix, cJSON_CreateDoubleArray(row, 4))) return false;
  }
  return true;
}

typedef struct writing {
  const sf_procedural_options *options;
  const char *dir;
  sf_stage stage;
  int done;
  bool (*progress)(void *user, int done, int total);
  void *user;
} writing;

static sf_status write_views(writing *job, const char *split, int split_index, int count, cJSON *frames)
{
  const int all = job->options->train_views + job->options->test_views;
  for (int i = 0; i < count; i++) {
    char path[4096], file_path[64];
    sf_camera camera;
    snprintf(file_path, sizeof file_path, "./%s/r_%d", split, i);
    if ((size_t)snprintf(path, sizeof path, "%s/%s/r_%d.png", job->dir, split, i) >= sizeof path)
      return sf_fail(SF_E_IO, "cannot write %.80s...: name too long", job->dir);
    place_camera(&camera, job->options, split_index, i);
    SF_TRY(render_view(&job->stage, &camera, path));
    if (!add_frame(frames, file_path, &camera)) return sf_fail(SF_E_MEMORY, "%s: no memory", path);
    job->done++;
    if (job->progress && !job->progress(job->user, job->done, all) && job->done < all)
      return sf_fail(SF_E_STOPPED, "interrupted after %d pictures", job->done);
  }
  return sf_ok();
}

/* The list of views comes last: where it stands, its pictures do. */
static sf_status write_split(writing *job, const char *split, int split_index, int count)
{
  char path[4096];
  if ((size_t)snprintf(path, sizeof path, "%s/%s", job->dir, split) >= sizeof path - 32)
    return sf_fail(SF_E_IO, "cannot write %.80s...: name too long", job->dir);
  SF_TRY(sf_make_dir(path));
  snprintf(path, sizeof path, "%s/transforms_%s.json", job->dir, split);
  unlink(path); /* an older list would describe pictures that are about to change */
  cJSON *json = cJSON_CreateObject();
  cJSON *angle = cJSON_AddNumberToObject(json, "camera_angle_x", ANGLE_X);
  cJSON *frames = cJSON_AddArrayToObject(json, "frames");
  sf_status status = angle && frames ? write_views(job, split, split_index, count, frames)
                                     : sf_fail(SF_E_MEMORY, "%s: no memory", path);
  if (status.code == SF_OK) status = sf_json_save(json, path);
  cJSON_Delete(json);
  return status;
}

sf_status sf_procedural_write(const char *name, const char *dir, const sf_procedural_options *options,
                              bool (*progress)(void *user, int done, int total), void *user)
{
  writing job = {.options = options, .dir = dir, .progress = progress, .user = user};
  int index;
  SF_TRY(find_scene(name, &index));
  if (options->width < 1 || options->height < 1 || options->width > 16384 || options->height > 16384)
    return sf_fail(SF_E_RANGE, "scene %s: pictures of %d x %d pixels: expected 1 to 16384", name, options->width,
                   options->height);
  if (options->train_views < 1 || options->test_views < 1 || options->train_views > 100000 ||
      options->test_views > 100000)
    return sf_fail(SF_E_RANGE, "scene %s: %d and %d views: expected 1 to 100000", name, options->train_views,
                   options->test_views);
  sf_stage_build(&job.stage, index);
  SF_TRY(sf_make_dir(dir));
  SF_TRY(write_split(&job, "train", 0, options->train_views));
  return write_split(&job, "test", 1, options->test_views);
}
