/* Cameras, posed images, procedural scenes. */
#ifndef SF_SCENE_SCENE_H
#define SF_SCENE_SCENE_H
#include "image/image.h"
#include "base/status.h"
#include <stdbool.h>
#include <stdio.h>

#define SF_NEAR 0.2 /* model units from where on a ray is looked at; torch-ngp's min_near */

typedef struct sf_camera {
  int width, height;
  float fx, fy, cx, cy; /* pixels */
  float to_world[12];   /* row-major 3x4, OpenGL axes (x right, y up, looks along -z), model units */
  float k1, k2, p1, p2; /* of the lens, as OpenCV; all 0: a pinhole */
} sf_camera;

/* Model units: the scene box is [-bound, bound]^3. Blender data: position * 0.8 as torch-ngp. */
typedef struct sf_view {
  char name[256]; /* of the picture, below the folder */
  sf_camera camera;
  const char *lens; /* its camera model, as COLMAP names it; a literal */
  float brightness; /* mean of r, g, b, weighted by alpha, 0..1 */
  float shown;      /* half edge of the least cube about the origin that 97 % of what the picture shows look into, model
                     * units; what has no alpha, and black or white where no alpha is, does not count; 0: nothing, NDC */
  sf_image image;   /* rgba NULL when the split has no picture for it, or none was to be kept */
} sf_view;

typedef enum { SF_LAYOUT_BLENDER, SF_LAYOUT_LLFF, SF_LAYOUT_COLMAP, SF_LAYOUT_INGP } sf_layout;
extern const char *const sf_layout_names[]; /* "blender", "llff", "colmap", "ingp" */

/* What lies in a folder, and one split of its views. docs/data.md says how each layout is understood. */
typedef struct sf_dataset {
  char path[4096];
  char list[4096]; /* the file that names pictures and poses; of a COLMAP model, its table of images */
  sf_layout layout;
  sf_view *view;
  int count;       /* loaded */
  int total;       /* in the split, loaded or not */
  int downscale;   /* that was asked for; where the layout has one size, 1 for 0 */
  float scale;     /* model = world * scale + offset, world as the layout's reader turns it */
  float own_scale; /* what scale would be if the options named none */
  float offset[3]; /* of the origin */
  int32_t bound;   /* proposed half edge of the scene box for INGP, model units: 1, 2, 4, ... 64 */
  /* Forward-facing: model space is NDC (Mildenhall et al. 2020, appendix C) times `scale`; to_world stays in units
   * where the near plane is at distance ndc_near. */
  bool ndc;
  float ndc_near;
  float ndc_focal[2]; /* focal length over half the picture, along x and y */
  int listed;         /* views in the list that names the training views, held-out ones too; 0: there is none */
  int32_t poses;      /* hash of their poses, whatever is loaded; 0: unknown */
  int32_t picture;    /* hash of the first one's file, where a transforms file lists them; 0: unknown */
  double world[12];   /* row-major 3x4: the layout's own coordinates (OpenGL camera axes) to world */
  float *point;       /* [points][3] sparse points, model units (not where ndc); NULL: none are known */
  int points;
  char (*warning)[400]; /* one line each: what looks wrong, and was passed over */
  int warnings;
} sf_dataset;

typedef struct sf_dataset_options {
  int downscale;     /* of the full-size photographs, which are 1; 0: the size that docs/data.md says for the layout */
  float scale;       /* 0 = default of the layout */
  int limit;         /* load at most this many views, 0 = all */
  int first;         /* leave out this many views before; with limit 1, a large set is walked without holding it all */
  bool cameras_only; /* pictures are read, for their size and brightness, but not kept */
} sf_dataset_options;

/* One of these, looked for in this order (docs/data.md):
 *   Blender      transforms_SPLIT.json
 *   instant-ngp  transforms.json
 *   LLFF         poses_bounds.npy, images or images_N
 *   COLMAP       sparse/0 or sparse: cameras, images and perhaps points3D, .bin or .txt; images or images_N
 * split: "train", "test". Where the folder names no test views, every 8th view, from the first on, is the test split.
 * Every fault names file and place. count is 0 where first is beyond the last view. Fewer than half of the pictures of
 * a split missing: a warning, total counts those that are there. */
sf_status sf_dataset_load(sf_dataset *data, const char *dir, const char *split, const sf_dataset_options *options);
void sf_dataset_free(sf_dataset *data);
/* In which space the views of a data set lie: what a model keeps of the data that it learned from. */
typedef struct sf_space {
  float scale;          /* own_scale; 0: nothing is known */
  int32_t bound;        /* proposed by the data */
  int32_t ndc;          /* 1: rays are in NDC */
  int32_t views, poses; /* listed, and hash of their poses; 0: nothing is known */
  int32_t picture;      /* hash of the file of the first; 0: nothing is known */
} sf_space;
sf_space sf_dataset_space(const sf_dataset *data);
/* SF_E_RANGE, which names what differs, where views of `data` cannot be of the scene that `name` learned. Scales may
 * differ by 1 %: they are computed from poses. `learned` without a scale fits everything, without poses any poses.
 * Another picture from the same camera adds a warning to `data`: it may have been edited or written anew. */
sf_status sf_space_check(const sf_space *learned, const char *name, sf_dataset *data);

/* SF_E_FORMAT unless both splits lie in the same coordinates and box: what one was learned from shows in the other. */
sf_status sf_dataset_agree(const sf_dataset *train, const sf_dataset *test);
/* "PROGRAM: warning: ..." for each, but for those of the data that was told before (NULL: none). */
void sf_dataset_warn(FILE *out, const char *program, const sf_dataset *data, const sf_dataset *told);
sf_status sf_warn(sf_dataset *data, const char *format, ...) __attribute__((format(printf, 2, 3))); /* adds one */
bool sf_dataset_has_warning(const sf_dataset *data, const char *text);

/* What looks wrong, as further warnings: exposure, focal lengths, optical centres, poses twice or far outside, the
 * proposed box. Pictures are not needed any more. */
sf_status sf_dataset_survey(sf_dataset *data);
/* A further warning where the pictures show much more than the box [-half, half]^3 of model units, or fill little of
 * it. Pictures are not needed any more. */
sf_status sf_dataset_survey_box(sf_dataset *data, double half);
/* Picture of 2 * size x (size + SF_PLAN_FOOT) pixels: from above (x, y) and from the side (x, z). Views of the training
 * split are blue, others red; the scene box and [-1, 1]^3 grey, with NDC the near plane; sparse points green. Words
 * name the panels, and in the foot the colours and a scale. Free the image. */
enum { SF_PLAN_FOOT = 40 };
sf_status sf_plan_draw(const sf_dataset *train, const sf_dataset *test, int size, sf_image *image);

/* Ray through pixel position (px, py), (0.5, 0.5) = centre of the first pixel. Unit direction. */
void sf_camera_ray(const sf_camera *camera, float px, float py, float origin[3], float direction[3]);
/* The inverse: where a point (model units) is seen. False where it is not in front of the camera. */
bool sf_camera_project(const sf_camera *camera, const float point[3], float pixel[2]);
/* The same of a view of `data`, in the space that models live in: what a trainer or a renderer is to ask. With NDC the
 * origin lies SF_NEAR before its point on the near plane (z = -scale), and infinity at z = scale. */
void sf_dataset_ray(const sf_dataset *data, const sf_view *view, float px, float py, float origin[3],
                    float direction[3]);
/* A camera as text: "W,H,FX,FY,CX,CY" and to_world row by row, with a lens K1,K2,P1,P2 behind it; model units. What is
 * printed gives the same camera again, bit for bit. SF_E_USAGE. */
enum { SF_CAMERA_SIDE = 8192 /* pixels */, SF_CAMERA_TEXT = 22 * 16 };
sf_status sf_camera_parse(const char *text, sf_camera *camera);
void sf_camera_print(const sf_camera *camera, char text[SF_CAMERA_TEXT]);

/* Mean distance of the cameras from the origin, model units; 0 without views. */
double sf_dataset_distance(const sf_dataset *data);

/* Points along an edge of [-bound, bound]^3, model units, that lie a pixel apart where the views see the middle of the
 * box: focal length over distance from the origin, in the mean of all views; with NDC, where a picture spans 2 * scale,
 * its longer side over that; 1 at least, 1 << 20 at most. */
int sf_dataset_pixels(const sf_dataset *data, int bound);

/* Procedural scenes: exact rendering of analytic shapes. names: NULL-terminated list. */
typedef struct sf_procedural_options {
  int width, height, train_views, test_views;
  uint64_t seed; /* camera positions */
} sf_procedural_options;
extern const char *const sf_procedural_names[];
/* Writes the Blender layout below dir. progress may be NULL; it is called after each picture, and false stops:
 * SF_E_STOPPED. */
sf_status sf_procedural_write(const char *name, const char *dir, const sf_procedural_options *options,
                              bool (*progress)(void *user, int done, int total), void *user);
/* Exact colour along one ray (world units), straight alpha RGBA in 0..1. */
sf_status sf_procedural_trace(const char *name, const float origin[3], const float direction[3], float rgba[4]);
#endif
