/* Blender and instant-ngp layouts: which transforms_*.json lists the views of a split, and what it says of them all. */
#include "spikefield/io.h"
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

static sf_status find_list(sf_capture *c, const char *dir, const char *split)
{
  char name[64], test[4096];
  bool training = !strcmp(split, "train"), testing = !strcmp(split, "test");
  snprintf(name, sizeof name, "transforms_%.32s.json", split);
  SF_TRY(sf_join(c->list, dir, name, ""));
  SF_TRY(sf_join(test, dir, "transforms_test.json", ""));
  bool found = sf_is_file(c->list);
  c->part = training && !sf_is_file(test) ? SF_ALL_BUT_HELD_OUT : SF_ALL_VIEWS;
  if (found) return sf_ok();
  if (!training && !testing) return sf_fail(SF_E_IO, "%s: no such file", c->list);
  if (testing) c->part = SF_ONLY_HELD_OUT;
  static const char *const others[] = {"transforms_train.json", "transforms.json"};
  for (int i = training; i < 2; i++) {
    SF_TRY(sf_join(c->list, dir, others[i], ""));
    if (!sf_is_file(c->list)) continue;
    if (i == 1) c->layout = SF_LAYOUT_INGP;
    return sf_ok();
  }
  return sf_fail(SF_E_IO,
                 "%s: no data set: neither transforms_train.json, transforms.json, poses_bounds.npy nor "
                 "sparse/0/cameras.bin or .txt is there",
                 dir);
}

/* instant-ngp: cube = position * scale + offset, in a box of aabb_scale about the middle of the unit cube. */
static sf_status parse_box(sf_capture *c, const cJSON *json)
{
  double aabb = 0;
  const cJSON *offset = cJSON_GetObjectItemCaseSensitive(json, "offset");
  c->box_scale = 0.33;
  SF_TRY(sf_number_parse(json, "aabb_scale", c->list, 0, 129, &aabb, NULL));
  if (aabb != floor(aabb) || ((int)aabb & ((int)aabb - 1)))
    return sf_fail(SF_E_RANGE, "%s: aabb_scale is %g: expected a power of two up to 128", c->list, aabb);
  SF_TRY(sf_number_parse(json, "scale", c->list, 0, 1e9, &c->box_scale, &c->placed));
  for (int i = 0; i < 3; i++) {
    const cJSON *item = offset ? cJSON_GetArrayItem(offset, i) : NULL;
    c->box_offset[i] = item ? item->valuedouble : 0.5;
    if (offset && (!cJSON_IsNumber(item) || !(fabs(c->box_offset[i]) < 1e9)))
      return sf_fail(SF_E_FORMAT, "%s: offset is not an array of 3 numbers", c->list);
  }
  c->aabb_scale = aabb > 0 ? (int32_t)aabb : 1;
  if (offset || aabb > 0) c->placed = true;
  if (aabb > 0) c->layout = SF_LAYOUT_INGP;
  return sf_ok();
}

static sf_status parse_list(sf_capture *c, const cJSON *json)
{
  const cJSON *array = cJSON_GetObjectItemCaseSensitive(json, "frames"), *item;
  sf_lens shared = {.camera = -1};
  if (!cJSON_IsObject(json)) return sf_fail(SF_E_FORMAT, "%s: not a JSON object", c->list);
  if (!cJSON_IsArray(array)) return sf_fail(SF_E_FORMAT, "%s: the array frames is missing", c->list);
  int n = cJSON_GetArraySize(array);
  if (!n) return sf_fail(SF_E_RANGE, "%s: zero views: the array frames is empty", c->list);
  SF_TRY(sf_lens_parse(&shared, json, c->list));
  SF_TRY(parse_box(c, json));
  c->frame = calloc((size_t)n, sizeof *c->frame);
  if (!c->frame) return sf_fail(SF_E_MEMORY, "%s: no memory for %d views", c->list, n);
  cJSON_ArrayForEach(item, array)
  {
    SF_TRY(sf_frame_parse(&c->frame[c->count], item, &shared, c->list, c->count));
    c->count++;
  }
  return sf_ok();
}

sf_status sf_transforms_read(sf_capture *capture, const char *dir, const char *split)
{
  cJSON *json;
  capture->layout = SF_LAYOUT_BLENDER;
  SF_TRY(find_list(capture, dir, split));
  SF_TRY(sf_json_load(capture->list, &json));
  sf_status status = parse_list(capture, json);
  cJSON_Delete(json);
  return status;
}
