/* Blender and instant-ngp layouts: which transforms_*.json lists the views of a split, and what it says of them all. */
#include "base/json.h"
#include "src/scene/capture.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

bool sf_transforms_there(const char *dir)
{
  static const char *const name[] = {"transforms_train.json", "transforms_test.json", "transforms.json"};
  char path[4096];
  for (int i = 0; i < 3; i++)
    if (sf_join(path, dir, name[i], "").code == SF_OK && sf_is_file(path)) return true;
  return false;
}

static sf_status find_list(sf_capture *c, const char *dir, const char *split, char list[4096])
{
  char name[64], test[4096];
  bool training = !strcmp(split, "train"), testing = !strcmp(split, "test");
  snprintf(name, sizeof name, "transforms_%.32s.json", split);
  SF_TRY(sf_join(list, dir, name, ""));
  SF_TRY(sf_join(test, dir, "transforms_test.json", ""));
  bool found = sf_is_file(list);
  c->part = training && !sf_is_file(test) ? SF_ALL_BUT_HELD_OUT : SF_ALL_VIEWS;
  if (found) return sf_ok();
  if (!training && !testing) return sf_fail(SF_E_IO, "%s: no such file", list);
  if (testing) c->part = SF_ONLY_HELD_OUT;
  static const char *const others[] = {"transforms_train.json", "transforms.json"};
  for (int i = training; i < 2; i++) {
    SF_TRY(sf_join(list, dir, others[i], ""));
    if (!sf_is_file(list)) continue;
    if (i == 1) c->layout = SF_LAYOUT_INGP;
    return sf_ok();
  }
  return sf_fail(SF_E_IO,
                 "%s: no data set: neither transforms_train.json, transforms.json, poses_bounds.npy nor "
                 "sparse/0/cameras.bin or .txt is there",
                 dir);
}

/* instant-ngp: cube = position * scale + offset, in a box of aabb_scale about the middle of the unit cube. */
static sf_status parse_box(sf_capture *c, const cJSON *json, const char *path)
{
  double aabb = 0;
  const cJSON *offset = cJSON_GetObjectItemCaseSensitive(json, "offset");
  c->box_scale = 0.33;
  SF_TRY(sf_number_parse(json, "aabb_scale", path, 0, 129, &aabb, NULL));
  if (aabb != floor(aabb) || ((int)aabb & ((int)aabb - 1)))
    return sf_fail(SF_E_RANGE, "%s: aabb_scale is %g: expected a power of two up to 128", path, aabb);
  SF_TRY(sf_number_parse(json, "scale", path, 0, 1e9, &c->box_scale, &c->placed));
  for (int i = 0; i < 3; i++) {
    const cJSON *item = offset ? cJSON_GetArrayItem(offset, i) : NULL;
    c->box_offset[i] = item ? item->valuedouble : 0.5;
    if (offset && (!cJSON_IsNumber(item) || !(fabs(c->box_offset[i]) < 1e9)))
      return sf_fail(SF_E_FORMAT, "%s: offset is not an array of 3 numbers", path);
  }
  c->aabb_scale = aabb > 0 ? (int32_t)aabb : 1;
  if (offset || aabb > 0) c->placed = true;
  if (aabb > 0) c->layout = SF_LAYOUT_INGP;
  return sf_ok();
}

/* Behind those that are there. */
static sf_status parse_frames(sf_capture *c, const cJSON *json, const char *path)
{
  const cJSON *array = cJSON_GetObjectItemCaseSensitive(json, "frames"), *item;
  sf_lens shared = {.camera = -1};
  if (!cJSON_IsArray(array)) return sf_fail(SF_E_FORMAT, "%s: the array frames is missing", path);
  const int n = cJSON_GetArraySize(array), before = c->count;
  if (!n) return sf_fail(SF_E_RANGE, "%s: zero views: the array frames is empty", path);
  SF_TRY(sf_lens_parse(&shared, json, path));
  sf_frame *larger = realloc(c->frame, (size_t)(before + n) * sizeof *larger);
  if (!larger) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", path, n);
  c->frame = larger;
  memset(larger + before, 0, (size_t)n * sizeof *larger);
  cJSON_ArrayForEach(item, array)
  {
    SF_TRY(sf_frame_parse(&c->frame[c->count], item, &shared, path, c->count - before));
    c->count++;
  }
  return sf_ok();
}

/* box: the file says where the scene lies; its poses are needed for it where no words do. */
static sf_status read_list(sf_capture *c, const char *path, bool box, bool frames)
{
  cJSON *json;
  SF_TRY(sf_json_load(path, &json));
  sf_status status = cJSON_IsObject(json) ? sf_ok() : sf_fail(SF_E_FORMAT, "%s: not a JSON object", path);
  if (!status.code && box) status = parse_box(c, json, path);
  if (!status.code && (frames || (c->layout == SF_LAYOUT_INGP && !c->placed))) status = parse_frames(c, json, path);
  cJSON_Delete(json);
  return status;
}

static void note(sf_capture *c, const char *dir)
{
  sf_capture_note_poses(c, c->count);
  if (c->count) sf_capture_note_picture(c, dir, c->frame[0].file_path);
}

/* The training views' list where another one is asked for: it may be faulty, and nobody is told then. */
static void note_other(sf_capture *c, const char *dir, const char *training)
{
  sf_capture other = {0};
  if (read_list(&other, training, false, true).code == SF_OK) note(&other, dir);
  c->poses = other.poses, c->listed = other.listed, c->picture = other.picture;
  free(other.frame);
}

/* The training views' file alone decides where the scene lies: all splits have the same coordinates. */
sf_status sf_transforms_read(sf_capture *c, const char *dir, const char *split)
{
  char training[4096];
  SF_TRY(find_list(c, dir, split, c->list));
  const int part = c->part;
  c->layout = SF_LAYOUT_BLENDER;
  const bool known = find_list(c, dir, "train", training).code == SF_OK;
  if (!known) strcpy(training, c->list);
  c->part = part;
  const bool same = !strcmp(training, c->list);
  SF_TRY(read_list(c, training, true, same));
  c->first = same ? 0 : c->count;
  if (known && same) note(c, dir);
  if (same) return sf_ok();
  note_other(c, dir, training);
  return read_list(c, c->list, false, true);
}
