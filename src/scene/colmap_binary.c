/* cameras.bin, images.bin, points3D.bin: least significant byte first, no padding. */
#include "base/io.h"
#include "src/scene/colmap.h"
#include <stdlib.h>
#include <string.h>

#define FILE_LIMIT ((size_t)1 << 34)

typedef struct cursor {
  const char *path;
  const unsigned char *bytes;
  size_t size, at;
} cursor;

static sf_status need(const cursor *c, uint64_t bytes, const char *what, uint64_t number)
{
  if (bytes <= c->size - c->at) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: cut short: %s %llu at byte %zu needs %llu bytes, %zu are left", c->path, what,
                 (unsigned long long)number, c->at, (unsigned long long)bytes, c->size - c->at);
}

/* The caller has asked for them. */
static uint64_t take(cursor *c, int bytes)
{
  uint64_t value = 0;
  for (int i = 0; i < bytes; i++) value |= (uint64_t)c->bytes[c->at++] << (8 * i);
  return value;
}

static double take_real(cursor *c)
{
  const uint64_t bits = take(c, 8);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

static int64_t take_id(cursor *c)
{
  return (int32_t)(uint32_t)take(c, 4);
}

/* How many follow; least: bytes that each of them needs, at the least. */
static sf_status take_count(cursor *c, uint64_t least, const char *what, uint64_t *count)
{
  SF_TRY(need(c, 8, "the number of entries, entry", 0));
  *count = take(c, 8);
  if (*count <= (c->size - c->at) / least) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: cut short: %llu %s cannot be in a file of %zu bytes", c->path,
                 (unsigned long long)*count, what, c->size);
}

static void say_where(const cursor *c, const char *what, int64_t id, char where[4300])
{
  snprintf(where, 4300, "%s: %s %lld at byte %zu", c->path, what, (long long)id, c->at);
}

static sf_status read_cameras(sf_colmap *model, cursor *c)
{
  uint64_t count;
  char where[4300];
  SF_TRY(take_count(c, 24 + 3 * 8, "cameras", &count));
  for (uint64_t i = 0; i < count; i++) {
    double param[SF_COLMAP_PARAMS];
    const char *name = NULL;
    SF_TRY(need(c, 24, "camera", i));
    const int64_t id = take_id(c);
    say_where(c, "camera", id, where);
    const int64_t number = take_id(c);
    const double width = (double)take(c, 8), height = (double)take(c, 8);
    const int params = number < 0 || number > 1000 ? -1 : sf_colmap_model((int)number, NULL, &name);
    if (params < 0) return sf_fail(SF_E_UNSUPPORTED, "%s: unknown camera model number %lld", where, (long long)number);
    SF_TRY(need(c, 8 * (uint64_t)params, "camera", i));
    for (int k = 0; k < params; k++) param[k] = take_real(c);
    SF_TRY(sf_colmap_add_camera(model, where, id, name, width, height, param));
  }
  return sf_ok();
}

static sf_status read_images(sf_colmap *model, cursor *c)
{
  uint64_t count;
  char where[4300];
  SF_TRY(take_count(c, 64 + 1 + 8, "images", &count));
  for (uint64_t i = 0; i < count; i++) {
    sf_colmap_image image = {0};
    SF_TRY(need(c, 64 + 1, "image", i));
    say_where(c, "image", (int64_t)i, where);
    image.id = take_id(c);
    for (int k = 0; k < 4; k++) image.q[k] = take_real(c);
    for (int k = 0; k < 3; k++) image.t[k] = take_real(c);
    image.camera = take_id(c);
    const unsigned char *name = c->bytes + c->at, *end = memchr(name, 0, c->size - c->at);
    if (!end) return sf_fail(SF_E_FORMAT, "%s: cut short: its name does not end", where);
    if ((size_t)(end - name) >= sizeof image.name)
      return sf_fail(SF_E_RANGE, "%s: a name of %zu bytes: expected at most %zu", where, (size_t)(end - name),
                     sizeof image.name - 1);
    memcpy(image.name, name, (size_t)(end - name));
    c->at += (size_t)(end - name) + 1;
    SF_TRY(need(c, 8, "image", i));
    const uint64_t points = take(c, 8);
    if (points > (c->size - c->at) / 24)
      return sf_fail(SF_E_FORMAT, "%s: cut short: %llu points of the picture, %zu bytes are left", where,
                     (unsigned long long)points, c->size - c->at);
    c->at += 24 * (size_t)points;
    SF_TRY(sf_colmap_add_image(model, where, &image));
  }
  return sf_ok();
}

static sf_status read_points(sf_colmap *model, cursor *c)
{
  const uint64_t fixed = 8 + 24 + 3 + 8 + 8;
  uint64_t count;
  char where[4300];
  SF_TRY(take_count(c, fixed, "points", &count));
  for (uint64_t i = 0; i < count; i++) {
    double point[3];
    SF_TRY(need(c, fixed, "point", i));
    say_where(c, "point", (int64_t)i, where);
    c->at += 8;
    for (int k = 0; k < 3; k++) point[k] = take_real(c);
    c->at += 3 + 8;
    const uint64_t track = take(c, 8);
    if (track > (c->size - c->at) / 8)
      return sf_fail(SF_E_FORMAT, "%s: cut short: a track of %llu pictures, %zu bytes are left", where,
                     (unsigned long long)track, c->size - c->at);
    c->at += 8 * (size_t)track;
    SF_TRY(sf_colmap_add_point(model, where, point));
  }
  return sf_ok();
}

static sf_status read_all(sf_colmap *model, cursor *c, sf_status (*table)(sf_colmap *, cursor *))
{
  SF_TRY(table(model, c));
  if (c->at == c->size) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: %zu bytes too many behind its last entry at byte %zu", c->path, c->size - c->at,
                 c->at);
}

static sf_status read_table(sf_colmap *model, const char *path, sf_status (*table)(sf_colmap *, cursor *))
{
  char *bytes;
  cursor c = {.path = path};
  SF_TRY(sf_read_file(path, FILE_LIMIT, &bytes, &c.size));
  c.bytes = (const unsigned char *)bytes;
  const sf_status status = read_all(model, &c, table);
  free(bytes);
  return status;
}

sf_status sf_colmap_read_binary(sf_colmap *model, const char *cameras, const char *images, const char *points)
{
  SF_TRY(read_table(model, cameras, read_cameras));
  SF_TRY(read_table(model, images, read_images));
  return points ? read_table(model, points, read_points) : sf_ok();
}
