/* The text of a transforms_*.json file, checked. */
#include "src/scene/capture.h"
#include "base/io.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { PICTURE_BYTES = 256 << 20 };

sf_status sf_number_parse(const cJSON *json, const char *key, const char *where, double low, double high, double *value,
                          bool *given)
{
  const cJSON *item = cJSON_GetObjectItemCaseSensitive(json, key);
  if (given) *given = *given || item;
  if (!item) return sf_ok();
  if (!cJSON_IsNumber(item)) return sf_fail(SF_E_FORMAT, "%s: %s is not a number", where, key);
  if (!isfinite(item->valuedouble)) return sf_fail(SF_E_RANGE, "%s: %s is not finite", where, key);
  if (!(item->valuedouble > low && item->valuedouble < high))
    return sf_fail(SF_E_RANGE, "%s: %s is %g: expected more than %g and less than %g", where, key, item->valuedouble,
                   low, high);
  *value = item->valuedouble;
  return sf_ok();
}

/* Of the lenses only OpenCV's first four numbers are modelled: others would be rendered wrongly in silence. */
static sf_status parse_distortion(sf_lens *lens, const cJSON *json, const char *where)
{
  static const char *const more[] = {"k3", "k4", "k5", "k6"};
  static const char *const models[] = {"PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", NULL};
  const double most = 1e6;
  for (size_t i = 0; i < sizeof more / sizeof *more; i++) {
    double value = 0;
    SF_TRY(sf_number_parse(json, more[i], where, -HUGE_VAL, HUGE_VAL, &value, NULL));
    if (value != 0)
      return sf_fail(SF_E_UNSUPPORTED, "%s: lens distortion %s = %g: k1, k2, p1 and p2 alone are modelled", where,
                     more[i], value);
  }
  SF_TRY(sf_number_parse(json, "k1", where, -most, most, &lens->k1, NULL));
  SF_TRY(sf_number_parse(json, "k2", where, -most, most, &lens->k2, NULL));
  SF_TRY(sf_number_parse(json, "p1", where, -most, most, &lens->p1, NULL));
  SF_TRY(sf_number_parse(json, "p2", where, -most, most, &lens->p2, NULL));
  if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(json, "is_fisheye")))
    return sf_fail(SF_E_UNSUPPORTED, "%s: is_fisheye: a fisheye lens is not modelled", where);
  const char *model = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, "camera_model"));
  if (!model) return sf_ok();
  for (int i = 0; models[i]; i++) {
    if (strcmp(model, models[i]) != 0) continue;
    lens->model = models[i];
    return sf_ok();
  }
  return sf_fail(SF_E_UNSUPPORTED,
                 "%s: camera_model %.40s: expected PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL or OPENCV", where,
                 model);
}

sf_status sf_lens_parse(sf_lens *lens, const cJSON *json, const char *where)
{
  const double pixels = 1e7;
  SF_TRY(parse_distortion(lens, json, where));
  SF_TRY(sf_number_parse(json, "fl_x", where, 0, pixels, &lens->fl_x, NULL));
  SF_TRY(sf_number_parse(json, "fl_y", where, 0, pixels, &lens->fl_y, NULL));
  SF_TRY(sf_number_parse(json, "w", where, 0, pixels, &lens->width, NULL));
  SF_TRY(sf_number_parse(json, "h", where, 0, pixels, &lens->height, NULL));
  SF_TRY(sf_number_parse(json, "cx", where, -pixels, pixels, &lens->cx, &lens->has_cx));
  SF_TRY(sf_number_parse(json, "cy", where, -pixels, pixels, &lens->cy, &lens->has_cy));
  SF_TRY(sf_number_parse(json, "camera_angle_x", where, 0, M_PI, &lens->angle_x, NULL));
  return sf_number_parse(json, "camera_angle_y", where, 0, M_PI, &lens->angle_y, NULL);
}

/* Lengths of the columns are taken out: some exporters leave a scale in them. */
static sf_status normalise_rotation(double m[12], const char *where)
{
  double c[3][3];
  for (int k = 0; k < 3; k++) {
    double length = hypot(hypot(m[k], m[4 + k]), m[8 + k]);
    if (!(length > 1e-12) || !isfinite(length))
      return sf_fail(SF_E_RANGE, "%s: transform_matrix column %d has length %g", where, k, length);
    for (int i = 0; i < 3; i++) c[k][i] = m[4 * i + k] / length;
  }
  for (int k = 0; k < 3; k++) {
    const double *a = c[k], *b = c[(k + 1) % 3], cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if (!(fabs(cosine) < 0.02)) /* digits that were cut off leave 1e-3 */
      return sf_fail(SF_E_RANGE,
                     "%s: transform_matrix is no rotation: columns %d and %d are not at right angles "
                     "(cosine %.3g)",
                     where, k, (k + 1) % 3, cosine);
  }
  for (int k = 0; k < 3; k++)
    for (int i = 0; i < 3; i++) m[4 * i + k] = c[k][i];
  return sf_ok();
}

static sf_status parse_matrix(double m[12], const cJSON *json, const char *where)
{
  const cJSON *rows = cJSON_GetObjectItemCaseSensitive(json, "transform_matrix");
  if (!cJSON_IsArray(rows) || cJSON_GetArraySize(rows) != 4)
    return sf_fail(SF_E_FORMAT, "%s: transform_matrix is not an array of 4 rows", where);
  for (int i = 0; i < 4; i++) {
    const cJSON *row = cJSON_GetArrayItem(rows, i);
    if (!cJSON_IsArray(row) || cJSON_GetArraySize(row) != 4)
      return sf_fail(SF_E_FORMAT, "%s: transform_matrix[%d] is not a row of 4 numbers", where, i);
    for (int k = 0; k < 4; k++) {
      const cJSON *item = cJSON_GetArrayItem(row, k);
      if (!cJSON_IsNumber(item))
        return sf_fail(SF_E_FORMAT, "%s: transform_matrix[%d][%d] is not a number", where, i, k);
      const double value = item->valuedouble;
      if (!isfinite((float)value))
        return sf_fail(SF_E_RANGE, "%s: transform_matrix[%d][%d] is not finite", where, i, k);
      if (i < 3)
        m[4 * i + k] = value;
      else if (fabs(value - (k == 3)) > 1e-5)
        return sf_fail(SF_E_RANGE, "%s: transform_matrix[3][%d] is %g: the last row must be 0 0 0 1", where, k, value);
    }
  }
  return normalise_rotation(m, where);
}

sf_status sf_frame_parse(sf_frame *frame, const cJSON *json, const sf_lens *shared, const char *path, int index)
{
  char where[4096 + 340];
  snprintf(where, sizeof where, "%s: frame %d", path, index);
  if (!cJSON_IsObject(json)) return sf_fail(SF_E_FORMAT, "%s is not an object", where);
  const char *file = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, "file_path"));
  if (!file) return sf_fail(SF_E_FORMAT, "%s: file_path is missing or not a string", where);
  if (!strncmp(file, "./", 2)) file += 2;
  size_t length = strlen(file);
  if (!length || length >= sizeof frame->file_path)
    return sf_fail(SF_E_RANGE, "%s: file_path has %zu bytes: expected 1 to %zu", where, length,
                   sizeof frame->file_path - 1);
  strcpy(frame->file_path, file);
  snprintf(where, sizeof where, "%s: frame %d (%s)", path, index, file);
  frame->number = index, frame->lens = *shared;
  if (cJSON_HasObjectItem(json, "fl_x") ||
      cJSON_HasObjectItem(json, "camera_angle_x")) /* its field of view is its own */
    frame->lens.fl_x = frame->lens.fl_y = frame->lens.angle_x = frame->lens.angle_y = 0;
  frame->own_size = cJSON_HasObjectItem(json, "w") && cJSON_HasObjectItem(json, "h");
  SF_TRY(sf_lens_parse(&frame->lens, json, where));
  if (!frame->lens.fl_x && !frame->lens.angle_x)
    return sf_fail(SF_E_FORMAT, "%s: no field of view: neither fl_x nor camera_angle_x is given", where);
  return parse_matrix(frame->to_world, json, where);
}

/* FNV-1a, folded to 1..10^9. */
static const uint64_t hash_start = UINT64_C(0xcbf29ce484222325);
static uint64_t hash_byte(uint64_t hash, uint64_t byte)
{
  return (hash ^ (byte & 255)) * UINT64_C(0x100000001b3);
}
static int32_t hash_fold(uint64_t hash)
{
  return 1 + (int32_t)(hash % 1000000000);
}

/* Poses in steps of 1/4096: what another compiler makes of them is the same. */
void sf_capture_note_poses(sf_capture *c, int count)
{
  uint64_t hash = hash_start;
  for (int f = 0; f < count; f++)
    for (int i = 0; i < 12; i++) {
      const double place = fmin(fmax(c->frame[f].to_world[i] * 4096, -1e15), 1e15);
      uint64_t word = (uint64_t)llrint(place);
      for (int byte = 0; byte < 8; byte++, word >>= 8) hash = hash_byte(hash, word);
    }
  c->listed = count;
  c->poses = count ? hash_fold(hash) : 0;
}

void sf_capture_note_picture(sf_capture *c, const char *dir, const char *file)
{
  char path[4096], *text;
  size_t size;
  struct stat info;
  uint64_t hash = hash_start;
  c->picture = 0;
  if (sf_picture_find(path, dir, file).code != SF_OK) return;
  if (stat(path, &info) || !S_ISREG(info.st_mode)) return;                   /* a pipe would wait */
  if (sf_read_file(path, PICTURE_BYTES, &text, &size).code != SF_OK) return; /* told when it is loaded */
  for (size_t i = 0; i < size; i++) hash = hash_byte(hash, (unsigned char)text[i]);
  c->picture = hash_fold(hash);
  free(text);
}

void sf_capture_note_full_size(sf_capture *c, const char *dir, const char *name)
{
  char file[4096];
  if ((size_t)snprintf(file, sizeof file, "images/%s", name) < sizeof file) sf_capture_note_picture(c, dir, file);
}
