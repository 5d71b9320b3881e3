/* A folder of posed pictures: which layout it has, and the way from its reader to the views. */
#include "src/scene/capture.h"
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

const char *const sf_layout_names[] = {"blender", "llff", "colmap", "ingp"};

static void capture_free(sf_capture *capture)
{
  free(capture->frame), free(capture->point);
  memset(capture, 0, sizeof *capture);
}

bool sf_dataset_has_warning(const sf_dataset *data, const char *text)
{
  int i = 0;
  while (i < data->warnings && strcmp(data->warning[i], text) != 0) i++;
  return i < data->warnings;
}

void sf_dataset_warn(FILE *out, const char *program, const sf_dataset *data, const sf_dataset *told)
{
  for (int i = 0; i < data->warnings; i++)
    if (!told || !sf_dataset_has_warning(told, data->warning[i]))
      fprintf(out, "%s: warning: %s\n", program, data->warning[i]);
}

static sf_status check_options(const char *dir, const sf_dataset_options *options)
{
  if (strlen(dir) >= sizeof((sf_dataset *)0)->path) return sf_fail(SF_E_IO, "%.80s...: name too long", dir);
  if (options->downscale < 0) return sf_fail(SF_E_RANGE, "%s: downscale factor %d is below 0", dir, options->downscale);
  if (options->limit < 0 || options->first < 0)
    return sf_fail(SF_E_RANGE, "%s: %d views from view %d on", dir, options->limit, options->first);
  if (!(options->scale >= 0) || isinf(options->scale))
    return sf_fail(SF_E_RANGE, "%s: scale %g is not a positive number", dir, (double)options->scale);
  return sf_ok();
}

/* A folder with both holds the same poses twice. LLFF's rows alone know depths, for NDC; COLMAP's tables alone know
 * each camera and its lens. */
static sf_status read_poses(sf_dataset *data, sf_capture *c, const sf_dataset_options *options)
{
  const bool llff = sf_llff_there(data->path), colmap = sf_colmap_there(data->path);
  if (!llff) return sf_colmap_read(c, data->path, options);
  const sf_status status = sf_llff_read(c, data->path, options);
  if (!colmap) return status;
  const bool forward = sf_forward_facing(c);
  if (status.code && (forward || !c->count)) return status; /* else its rows were read, and are not used */
  SF_TRY(sf_warn(data, "%s: poses_bounds.npy and a COLMAP model are both there: %s", data->path,
                 forward ? "the views face forward, so poses_bounds.npy is used"
                         : "the views do not face forward, so the COLMAP model is used"));
  if (forward) return sf_ok();
  capture_free(c);
  return sf_colmap_read(c, data->path, options);
}

static sf_status read_capture(sf_dataset *data, sf_capture *c, const char *split, const sf_dataset_options *options)
{
  const char *dir = data->path;
  const bool poses = sf_llff_there(dir) || sf_colmap_there(dir);
  data->downscale = options->downscale;
  if (!sf_is_folder(dir)) return sf_fail(SF_E_IO, "%s: no such folder", dir);
  if (sf_transforms_there(dir) || !poses) {
    if (!data->downscale) data->downscale = 1;
    c->shrink = data->downscale;
    SF_TRY(sf_transforms_read(c, dir, split));
    return poses ? sf_warn(data, "%s: other poses are there too: %s is used", dir, c->list) : sf_ok();
  }
  if (!strcmp(split, "test"))
    c->part = SF_ONLY_HELD_OUT;
  else if (!strcmp(split, "train"))
    c->part = SF_ALL_BUT_HELD_OUT;
  else
    return sf_fail(SF_E_IO, "%s: no split %.40s: expected train or test", dir, split);
  const int part = c->part;
  SF_TRY(read_poses(data, c, options));
  sf_capture_note_poses(c, c->count);
  c->part = part;
  return sf_ok();
}

/* What places the scene, and the size that an optical centre is stated for. */
static bool must_look(const sf_capture *c, const sf_lens *lens)
{
  if (c->layout != SF_LAYOUT_BLENDER && !c->placed) return true;
  return (lens->has_cx || lens->has_cy) && !(lens->width > 0 && lens->height > 0);
}

/* The first picture that can be read; its own faults are told when it is loaded. */
static sf_sight look(const sf_dataset *data, const sf_capture *c)
{
  sf_sight sight = {0};
  sf_image image = {0};
  char path[4096];
  for (int f = 0; f < c->count && !image.rgba; f++)
    if (must_look(c, &c->frame[f].lens) && sf_picture_find(path, data->path, c->frame[f].file_path).code == SF_OK &&
        sf_is_file(path))
      if (sf_picture_load(&image, path).code != SF_OK) break;
  if (!image.rgba) return sight;
  sight.width = image.width, sight.height = image.height;
  const size_t n = (size_t)image.width * (size_t)image.height;
  for (size_t i = 0; i < n && !sight.transparent; i++) sight.transparent = image.rgba[4 * i + 3] == 0;
  sf_image_free(&image);
  return sight;
}

static sf_status load(sf_dataset *data, sf_capture *c, const char *split, const sf_dataset_options *options)
{
  SF_TRY(read_capture(data, c, split, options));
  memcpy(data->list, c->list, sizeof data->list);
  data->listed = c->listed, data->poses = c->poses, data->picture = c->picture;
  if (c->layout == SF_LAYOUT_COLMAP) SF_TRY(sf_colmap_check_others(data));
  const sf_sight sight = look(data, c);
  SF_TRY(sf_place(data, c, options, &sight));
  SF_TRY(sf_views_load(data, c, options));
  return sf_check_sight(data, c, &sight);
}

sf_status sf_dataset_load(sf_dataset *data, const char *dir, const char *split, const sf_dataset_options *options)
{
  static const sf_dataset_options defaults = {0};
  sf_capture capture = {0};
  if (!options) options = &defaults;
  memset(data, 0, sizeof *data);
  SF_TRY(check_options(dir, options));
  strcpy(data->path, dir);
  const sf_status status = load(data, &capture, split, options);
  capture_free(&capture);
  if (status.code != SF_OK) sf_dataset_free(data);
  return status;
}

sf_status sf_dataset_agree(const sf_dataset *train, const sf_dataset *test)
{
  if (train->ndc == test->ndc && train->bound == test->bound && train->scale == test->scale &&
      train->ndc_near == test->ndc_near && !memcmp(train->offset, test->offset, sizeof train->offset) &&
      !memcmp(train->ndc_focal, test->ndc_focal, sizeof train->ndc_focal) &&
      !memcmp(train->world, test->world, sizeof train->world))
    return sf_ok();
  return sf_fail(SF_E_FORMAT,
                 "%s: its views lie in other coordinates than those of %s: scale %g and %g, bound %d and %d, %s and %s",
                 test->list, train->list, (double)test->scale, (double)train->scale, test->bound, train->bound,
                 test->ndc ? "NDC" : "no NDC", train->ndc ? "NDC" : "none");
}

sf_space sf_dataset_space(const sf_dataset *data)
{
  return (sf_space){.scale = data->own_scale,
                    .bound = data->bound,
                    .ndc = data->ndc,
                    .views = data->listed,
                    .poses = data->poses,
                    .picture = data->picture};
}

/* Made scenes may share their cameras: then a picture tells them apart. */
static sf_status check_picture(const sf_space *learned, const char *name, sf_dataset *data)
{
  if (!learned->picture || !data->picture || learned->picture == data->picture) return sf_ok();
  return sf_warn(
      data,
      "%s: learned from other pictures: %s has the same cameras, but another first picture. Is this the data "
      "that it learned from, edited or written anew?",
      name, data->path);
}

/* Where space and box are alike, the cameras tell two scenes apart. */
static sf_status check_poses(const sf_space *learned, const char *name, sf_dataset *data)
{
  if (!learned->poses || !data->poses) return sf_ok();
  if (learned->poses == data->poses) return check_picture(learned, name, data);
  return sf_fail(
      SF_E_RANGE,
      "%s: learned from a list of %d views, %s lists %d and their poses differ: this is another scene's data, or its "
      "cameras have changed (further views: transforms_test.json alone in a folder)",
      name, learned->views, data->path, data->listed);
}

static bool unlike(float a, float b)
{
  return !(fabsf(a - b) <= 0.01f * fmaxf(a, b));
}

sf_status sf_space_check(const sf_space *learned, const char *name, sf_dataset *data)
{
  const sf_space here = sf_dataset_space(data);
  if (!(learned->scale > 0)) return sf_ok();
  if (learned->ndc != here.ndc)
    return sf_fail(SF_E_RANGE, "%s: learned from data %s NDC rays, %s: %s NDC: this is another scene's data", name,
                   learned->ndc ? "with" : "without", data->list, here.ndc ? "with" : "without");
  if (!unlike(learned->scale, here.scale) && learned->bound == here.bound) return check_poses(learned, name, data);
  return sf_fail(SF_E_RANGE,
                 "%s: learned from data of scale %.4g and bound %d, %s: scale %.4g and bound %d: this is another "
                 "scene's data",
                 name, (double)learned->scale, learned->bound, data->list, (double)here.scale, here.bound);
}

void sf_dataset_free(sf_dataset *data)
{
  for (int i = 0; data->view && i < data->count; i++) sf_image_free(&data->view[i].image);
  free(data->view), free(data->point), free(data->warning);
  memset(data, 0, sizeof *data);
}
