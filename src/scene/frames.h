/* The text of a transforms_*.json file, checked, before any picture is opened. */
#ifndef SPIKEFIELD_SCENE_FRAMES_H
#define SPIKEFIELD_SCENE_FRAMES_H
#include "spikefield/status.h"
#include <cjson/cJSON.h>
#include <stdbool.h>

/* Lengths in pixels of the size below; 0 = not given. */
typedef struct sf_lens {
  double fl_x, fl_y, cx, cy, width, height, angle_x, angle_y;
  bool has_cx, has_cy;
} sf_lens;

typedef struct sf_frame {
  char file_path[256]; /* as in the file, without a leading "./" */
  float to_world[12];  /* columns of the rotation have length 1; translation in world units */
  sf_lens lens;        /* the file's values overridden by the frame's own */
  bool own_size;       /* the frame itself states w and h */
} sf_frame;

/* `frame` is one element of "frames", `index` its place; `path` is the JSON file, for messages. */
sf_status sf_frame_parse(sf_frame *frame, const cJSON *json, const sf_lens *shared, const char *path, int index);
/* Reads the lens fields that `json` (file or frame) states into *lens; `where` starts each message. */
sf_status sf_lens_parse(sf_lens *lens, const cJSON *json, const char *where);

#endif
