/* cameras.txt, images.txt, points3D.txt: a line per entry, two per image; lines with # in front are comments. */
#include "base/io.h"
#include "src/scene/colmap.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FILE_LIMIT ((size_t)1 << 34)

typedef struct lines {
  const char *path;
  char *next, *end;
  int number; /* of the line returned last, from 1 */
} lines;

/* NUL-terminated; NULL at the end. blank: whether empty lines count. */
static char *next_line(lines *l, bool blank)
{
  while (l->next < l->end) {
    char *line = l->next, *stop = memchr(line, '\n', (size_t)(l->end - line));
    l->next = stop ? stop + 1 : l->end;
    if (stop) *stop = 0;
    l->number++;
    if (*line == '#') continue;
    if (blank || line[strspn(line, " \t\r")]) return line;
  }
  return NULL;
}

static void say_where(const lines *l, char where[4300])
{
  snprintf(where, 4300, "%s:%d", l->path, l->number);
}

/* `n` numbers; *at moves behind them. */
static sf_status take_numbers(char **at, int n, double *value, const char *where, const char *expected)
{
  for (int i = 0; i < n; i++) {
    char *end;
    value[i] = strtod(*at, &end);
    if (end == *at || (*end && !strchr(" \t\r", *end)))
      return sf_fail(SF_E_FORMAT, "%s: number %d cannot be read: expected %s", where, i + 1, expected);
    *at = end;
  }
  return sf_ok();
}

static sf_status take_word(char **at, char *word, size_t room, const char *where, const char *expected)
{
  *at += strspn(*at, " \t");
  const size_t length = strcspn(*at, " \t\r");
  if (!length || length >= room) return sf_fail(SF_E_FORMAT, "%s: expected %s", where, expected);
  memcpy(word, *at, length);
  word[length] = 0;
  *at += length;
  return sf_ok();
}

static sf_status as_id(double value, const char *where, int64_t *id)
{
  if (!(fabs(value) < 2147483648.0) || value != floor(value))
    return sf_fail(SF_E_RANGE, "%s: %g is no identifier", where, value);
  *id = (int64_t)value;
  return sf_ok();
}

static sf_status read_cameras(sf_colmap *model, lines *l)
{
  static const char expected[] = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]";
  char where[4300], name[64];
  for (char *at; (at = next_line(l, false));) {
    double id, size[2], param[SF_COLMAP_PARAMS];
    const char *known;
    int64_t number = 0;
    say_where(l, where);
    SF_TRY(take_numbers(&at, 1, &id, where, expected));
    SF_TRY(as_id(id, where, &number));
    SF_TRY(take_word(&at, name, sizeof name, where, expected));
    const int params = sf_colmap_model(-1, name, &known);
    if (params < 0) return sf_fail(SF_E_UNSUPPORTED, "%s: camera %g: unknown camera model %.40s", where, id, name);
    SF_TRY(take_numbers(&at, 2, size, where, expected));
    SF_TRY(take_numbers(&at, params, param, where, expected));
    at += strspn(at, " \t\r");
    if (*at && *at != '#')
      return sf_fail(SF_E_FORMAT, "%s: camera %g: more than the %d values of %s", where, id, params, name);
    snprintf(where, sizeof where, "%s:%d: camera %g", l->path, l->number, id);
    SF_TRY(sf_colmap_add_camera(model, where, number, name, size[0], size[1], param));
  }
  return sf_ok();
}

/* Nothing, or X Y POINT3D_ID in triples: another line means that the lines of points were left out. */
static sf_status check_image_points(char *at, const char *where)
{
  int n = 0;
  for (at += strspn(at, " \t\r"); *at; at += strspn(at, " \t\r"), n++) {
    char *end;
    strtod(at, &end);
    if (end == at || (*end && !strchr(" \t\r", *end))) break;
    at = end;
  }
  if (!*at && n % 3 == 0) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: expected X Y POINT3D_ID of the image in the line before, or an empty line", where);
}

static sf_status read_images(sf_colmap *model, lines *l)
{
  static const char expected[] = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
  char where[4300];
  for (char *at; (at = next_line(l, false));) {
    double value[9];
    sf_colmap_image image = {0};
    say_where(l, where);
    SF_TRY(take_numbers(&at, 9, value, where, expected));
    memcpy(image.q, value + 1, sizeof image.q);
    memcpy(image.t, value + 5, sizeof image.t);
    SF_TRY(as_id(value[0], where, &image.id));
    SF_TRY(as_id(value[8], where, &image.camera));
    at += strspn(at, " \t");
    at[strcspn(at, "\r")] = 0; /* a name may hold spaces */
    if (strlen(at) >= sizeof image.name)
      return sf_fail(SF_E_RANGE, "%s: a name of %zu bytes: expected at most %zu", where, strlen(at),
                     sizeof image.name - 1);
    strcpy(image.name, at);
    SF_TRY(sf_colmap_add_image(model, where, &image));
    at = next_line(l, true);
    if (!at) break; /* the last line of points may be missing where there are none */
    say_where(l, where);
    SF_TRY(check_image_points(at, where));
  }
  return sf_ok();
}

static sf_status read_points(sf_colmap *model, lines *l)
{
  char where[4300];
  for (char *at; (at = next_line(l, false));) {
    double value[4];
    say_where(l, where);
    SF_TRY(take_numbers(&at, 4, value, where, "POINT3D_ID X Y Z R G B ERROR TRACK[]"));
    SF_TRY(sf_colmap_add_point(model, where, value + 1));
  }
  return sf_ok();
}

static sf_status read_table(sf_colmap *model, const char *path, sf_status (*table)(sf_colmap *, lines *))
{
  char *text;
  size_t size;
  SF_TRY(sf_read_file(path, FILE_LIMIT, &text, &size));
  const size_t mark = size >= 3 && !memcmp(text, "\xef\xbb\xbf", 3) ? 3 : 0; /* of UTF-8 */
  lines l = {.path = path, .next = text + mark, .end = text + size};
  const char *zero = memchr(text, 0, size);
  const sf_status status =
      zero ? sf_fail(SF_E_FORMAT, "%s: not a text: a zero at byte %zu", path, (size_t)(zero - text)) : table(model, &l);
  free(text);
  return status;
}

sf_status sf_colmap_read_text(sf_colmap *model, const char *cameras, const char *images, const char *points)
{
  SF_TRY(read_table(model, cameras, read_cameras));
  SF_TRY(read_table(model, images, read_images));
  return points ? read_table(model, points, read_points) : sf_ok();
}
