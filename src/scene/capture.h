/* What the reader of a layout finds: every view that is listed, before any picture is opened and before the scene is
 * placed in its box. */
#ifndef SF_SCENE_CAPTURE_H
#define SF_SCENE_CAPTURE_H
#include "scene/scene.h"
#include <cjson/cJSON.h>

enum { SF_HOLD_OUT = 8 }; /* every 8th view where the data names no test views */

/* Lengths in pixels of the size below; 0 = not given. */
typedef struct sf_lens {
  double fl_x, fl_y, cx, cy, width, height, angle_x, angle_y, k1, k2, p1, p2;
  bool has_cx, has_cy;
  const char *model; /* COLMAP's name, a literal; NULL: as the numbers say */
  int64_t camera;    /* its number in the file, or -1 */
} sf_lens;

typedef struct sf_frame {
  char file_path[256]; /* below the folder */
  double to_world[12]; /* row-major 3x4, OpenGL axes; columns of the rotation have length 1 */
  sf_lens lens;
  bool own_size; /* pictures of other sizes may stand beside this one */
  int number;    /* place in the list, from 0 */
} sf_frame;

typedef struct sf_capture {
  char list[4096]; /* the file that lists the views, for messages */
  sf_layout layout;
  enum { SF_ALL_VIEWS, SF_ALL_BUT_HELD_OUT, SF_ONLY_HELD_OUT } part; /* of the frames, which are the split */
  sf_frame *frame;                                                   /* [count], owned */
  int count;
  int32_t poses;      /* hash of the poses of the list that names the training views; 0: unknown */
  int32_t picture;    /* hash of the first one's file; 0: unknown */
  int listed;         /* in that list */
  int first;          /* those before are not of the split: they say where the scene lies, and the others do not */
  int shrink;         /* the pictures, once loaded, by a box filter; 0: each to at most SF_LONG_SIDE */
  double (*point)[3]; /* [points] sparse points or NULL, owned */
  int points;
  double near;      /* LLFF: the nearest depth of all views */
  bool placed;      /* instant-ngp: the file itself says where its box is: */
  double box_scale; /* to instant-ngp's unit cube, */
  double box_offset[3];
  int32_t aabb_scale; /* edge of the box over that of the unit cube */
} sf_capture;
/* The frames, from the first on, that say where the scene lies. */
static inline int sf_capture_guides(const sf_capture *capture)
{
  return capture->first ? capture->first : capture->count;
}

/* Of doubles, for qsort. */
static inline int sf_ascending(const void *a, const void *b)
{
  const double one = *(const double *)a, other = *(const double *)b;
  return (one > other) - (one < other);
}

/* Notes the first `count` frames as the list that names the training views. */
void sf_capture_note_poses(sf_capture *capture, int count);
/* Notes `file` below `dir` as the first picture of that list, if it is there. */
void sf_capture_note_picture(sf_capture *capture, const char *dir, const char *file);
/* The same of images/name, whatever size is read. */
void sf_capture_note_full_size(sf_capture *capture, const char *dir, const char *name);

/* One reader per layout. `split` as in sf_dataset_load; on failure the caller frees what is there. */
sf_status sf_transforms_read(sf_capture *capture, const char *dir, const char *split);
sf_status sf_llff_read(sf_capture *capture, const char *dir, const sf_dataset_options *options);
sf_status sf_colmap_read(sf_capture *capture, const char *dir, const sf_dataset_options *options);
/* A warning where data->list is of a COLMAP model and a larger one lies beside it. */
sf_status sf_colmap_check_others(sf_dataset *data);
/* Whether the folder holds the layout. */
bool sf_transforms_there(const char *dir);
bool sf_llff_there(const char *dir);
bool sf_colmap_there(const char *dir);

/* `frame` is one element of "frames", `index` its place; `path` is the JSON file, for messages. */
sf_status sf_frame_parse(sf_frame *frame, const cJSON *json, const sf_lens *shared, const char *path, int index);
/* Reads the lens fields that `json` (file or frame) states into *lens; `where` starts each message. */
sf_status sf_lens_parse(sf_lens *lens, const cJSON *json, const char *where);
/* A finite number of JSON between low and high, both excluded; absent: *value stays. given may be NULL. */
sf_status sf_number_parse(const cJSON *json, const char *key, const char *where, double low, double high, double *value,
                          bool *given);

/* ---- folders ---- */

bool sf_is_file(const char *path);
bool sf_is_folder(const char *path);
/* dir/name + tail; an absolute name stands alone. */
sf_status sf_join(char path[4096], const char *dir, const char *name, const char *tail);
enum { SF_LONG_SIDE = 1600 }; /* pixels of the pictures that are chosen unasked */
/* Folder `images` or `images_N` for pictures of the full size over `downscale`; *shrink: what is left to do. With
 * downscale 0: the largest whose longer side is at most SF_LONG_SIDE, by the full width and height; else the smallest,
 * and *shrink = 0. */
sf_status sf_pictures_choose(const char *dir, int downscale, double width, double height, char folder[64], int *shrink);
/* The names of its pictures (PNG, JPEG), sorted; free each and the list. */
sf_status sf_pictures_list(const char *dir, const char *folder, char ***name, int *count);
void sf_names_free(char **name, int count);
/* The picture of a frame: the name itself, or with another ending where only that is there. */
sf_status sf_picture_find(char path[4096], const char *dir, const char *file);
/* It may lie anywhere, also outside the folder. But a device or a pipe that a data set names may never begin or end. */
sf_status sf_picture_load(sf_image *image, const char *path);

/* ---- placing ---- */

/* What must be known of one picture: whether it shows an object on nothing, and its size where the list has none. */
typedef struct sf_sight {
  bool transparent;
  int width, height;
} sf_sight;
/* Turns, moves and scales the frames' positions into model units and fills all of data but its views and path. */
sf_status sf_place(sf_dataset *data, sf_capture *capture, const sf_dataset_options *options, const sf_sight *sight);
/* Views whose rays all pass by the box of the scene: a warning; all of them: SF_E_RANGE. */
sf_status sf_check_sight(sf_dataset *data, const sf_capture *capture, const sf_sight *sight);
/* All views look about one way, and from before the nearest thing. */
bool sf_forward_facing(const sf_capture *capture);

/* ---- pictures ---- */

/* sf_view.shown of a view whose picture is there. */
float sf_shown(const sf_view *view);
/* The views of the split, pictures loaded in parallel. Frames are placed. */
sf_status sf_views_load(sf_dataset *data, const sf_capture *capture, const sf_dataset_options *options);
#endif
