/* Cameras as text: what a command line and a page's address carry. */
#include "scene/scene.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { POSE = 12, LENS = 4, NUMBERS = 6 + POSE };
static const double FAR_AWAY = 1e6; /* of every number: no scene is so large */

static sf_status malformed(void)
{
  return sf_fail(SF_E_USAGE,
                 "a camera is W,H,FX,FY,CX,CY and the 12 numbers of its pose, row by row, perhaps K1,K2,P1,P2: "
                 "parted by commas, finite, at most 1e6");
}

/* Of list[most]; false: something else than numbers and commas. */
static bool read_numbers(const char *text, float *list, int most, int *count)
{
  for (*count = 0; *count < most; text++) {
    char *end;
    /* strtod takes more than numbers: blanks, hexadecimal, words. */
    if (strspn(text, "+-.0123456789eE") == 0) return false;
    const double value = strtod(text, &end);
    if (end == text || (size_t)(end - text) > strspn(text, "+-.0123456789eE")) return false;
    if (!(fabs(value) <= FAR_AWAY)) return false;
    list[(*count)++] = (float)value;
    text = end;
    if (*text == 0) return true;
    if (*text != ',') return false;
  }
  return false;
}

static bool is_size(float value)
{
  return value >= 1 && value <= SF_CAMERA_SIDE && value == floorf(value);
}

sf_status sf_camera_parse(const char *text, sf_camera *camera)
{
  float list[NUMBERS + LENS] = {0};
  int count;
  if (!read_numbers(text, list, NUMBERS + LENS, &count)) return malformed();
  if (count != NUMBERS && count != NUMBERS + LENS) return malformed();
  if (!is_size(list[0]) || !is_size(list[1]))
    return sf_fail(SF_E_USAGE, "a camera has 1 to %d pixels on a side", SF_CAMERA_SIDE);
  if (!(list[2] > 0) || !(list[3] > 0)) return sf_fail(SF_E_USAGE, "a camera's focal lengths are above 0");
  *camera = (sf_camera){.width = (int)list[0], .height = (int)list[1], .fx = list[2], .fy = list[3]};
  camera->cx = list[4], camera->cy = list[5];
  memcpy(camera->to_world, list + 6, sizeof camera->to_world);
  const float *lens = list + NUMBERS;
  camera->k1 = lens[0], camera->k2 = lens[1], camera->p1 = lens[2], camera->p2 = lens[3];
  return sf_ok();
}

void sf_camera_print(const sf_camera *camera, char text[SF_CAMERA_TEXT])
{
  const float lens[LENS] = {camera->k1, camera->k2, camera->p1, camera->p2};
  int used = snprintf(text, SF_CAMERA_TEXT, "%d,%d,%.9g,%.9g,%.9g,%.9g", camera->width, camera->height,
                      (double)camera->fx, (double)camera->fy, (double)camera->cx, (double)camera->cy);
  for (int i = 0; i < POSE; i++)
    used += snprintf(text + used, (size_t)(SF_CAMERA_TEXT - used), ",%.9g", (double)camera->to_world[i]);
  if (lens[0] == 0 && lens[1] == 0 && lens[2] == 0 && lens[3] == 0) return;
  for (int i = 0; i < LENS; i++)
    used += snprintf(text + used, (size_t)(SF_CAMERA_TEXT - used), ",%.9g", (double)lens[i]);
}
