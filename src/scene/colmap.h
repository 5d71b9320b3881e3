/* The tables of a COLMAP sparse model (colmap.github.io/format.html), whichever of its two forms is on disk. */
#ifndef SF_SCENE_COLMAP_H
#define SF_SCENE_COLMAP_H
#include "src/scene/capture.h"

enum { SF_COLMAP_PARAMS = 16 };
typedef struct sf_colmap_camera {
  int64_t id;
  sf_lens lens;
} sf_colmap_camera;

typedef struct sf_colmap_image {
  int64_t id, camera;
  double q[4], t[3]; /* world to camera, OpenCV axes: w, x, y, z; metres or whatever the unit is */
  char name[256];
} sf_colmap_image;

typedef struct sf_colmap {
  const char *path; /* of the table that is being read, for messages */
  sf_colmap_camera *camera;
  sf_colmap_image *image;
  double (*point)[3];
  int cameras, images, points;
  int room[3];
} sf_colmap;
void sf_colmap_free(sf_colmap *model);

/* Each reads one table into the model; `path` outlives it. */
sf_status sf_colmap_read_binary(sf_colmap *model, const char *cameras, const char *images, const char *points);
sf_status sf_colmap_read_text(sf_colmap *model, const char *cameras, const char *images, const char *points);

/* How many numbers a camera model has, by its number or name; -1: unknown. */
int sf_colmap_model(int number, const char *name, const char **known);
/* `where`: "FILE: camera 3 at byte 40". A model that is known but not modelled is refused by name. */
sf_status sf_colmap_add_camera(sf_colmap *model, const char *where, int64_t id, const char *name, double width,
                               double height, const double *params);
sf_status sf_colmap_add_image(sf_colmap *model, const char *where, const sf_colmap_image *image);
sf_status sf_colmap_add_point(sf_colmap *model, const char *where, const double point[3]);
#endif
