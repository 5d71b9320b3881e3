/* Where pictures are made: one scene, one data set, one of four backends. Views are loaded one at a time. */
#ifndef SF_SIM_STUDIO_H
#define SF_SIM_STUDIO_H
#include "sim/board/board.h"
#include "sim/ray/ray.h"
#include "golden/golden.h"

typedef enum { SF_BACKEND_FLOAT, SF_BACKEND_FIXED, SF_BACKEND_RTL, SF_BACKEND_BOARD } sf_backend;
extern const char *const sf_backend_names[]; /* "float", "fixed", "rtl", "board" */

typedef struct sf_studio_options {
  sf_backend backend;
  const char *scene, *data, *split;
  const char *model;   /* float: NULL = model.safetensors beside the scene */
  const char *kernels; /* fixed: as sf_golden_job */
  int steps;           /* 0 = the scene's t_r */
  int downscale;       /* as sf_dataset_options */
  float scale;         /* model units per world unit, 0 = the scene's */
  uint64_t seed;       /* rtl: of the random reset values */
  const char *port;    /* board: its serial port */
  double patience;     /* board: see sf_board_open */
} sf_studio_options;

typedef struct sf_studio {
  sf_studio_options options;
  fx_scene scene;
  char scene_sha256[65];
  char model_path[4096];                   /* float */
  sf_model model;                          /* float */
  sf_ray_dut *rays;                        /* rtl */
  sf_board *board;                         /* board */
  bool (*tick)(void *user, size_t pixels); /* as sf_golden_job; set by the caller, or NULL */
  void *user;
} sf_studio;
/* The strings of the options are kept, not copied. Close it even after a failure. */
sf_status sf_studio_open(sf_studio *studio, const sf_studio_options *options);
void sf_studio_close(sf_studio *studio);

/* One view and, once rendered, its picture. */
typedef struct sf_shot {
  sf_dataset data; /* of this view alone; data.total views in the split */
  const sf_view *view;
  int index;
  sf_window window; /* the whole view, until the caller chooses another */
  sf_golden golden;
  double psnr, ssim; /* NaN: not measured */
} sf_shot;
/* index: of the split, from 0. view is NULL where index is beyond the last one. */
sf_status sf_shot_load(const sf_studio *studio, int index, sf_shot *shot);
/* The view of a camera of your own, named "camera", without a picture. If options.data is NULL, the scene alone has to
 * do; a forward-facing one is then refused with SF_E_USAGE. */
sf_status sf_shot_from(const sf_studio *studio, const sf_camera *camera, sf_shot *shot);
sf_status sf_shot_render(const sf_studio *studio, sf_shot *shot);
/* PSNR and SSIM of what an EXR file holds, in place of a rendering. SF_E_FORMAT: it has another size or no colours. */
sf_status sf_shot_measure(const sf_studio *studio, sf_shot *shot, const char *path);
sf_status sf_shot_save(const sf_studio *studio, const sf_shot *shot, const char *path); /* EXR */
/* The data set's picture of a rendered shot, PNG. SF_E_FORMAT: it has none. */
sf_status sf_shot_save_truth(const sf_studio *studio, const sf_shot *shot, const char *path);
void sf_shot_free(sf_shot *shot);

/* The argument of --crop: "X,Y,WIDTH,HEIGHT" with at least one pixel. SF_E_USAGE. */
sf_status sf_window_parse(const char *text, sf_window *window);

/* The accelerator makes the pixels from the positions of their samples. The core renders beside it, so that a
 * difference is reported at its first pixel. The core also does what the accelerator does not: marching, and counts of
 * saturations and grid bytes. */
sf_status sf_golden_rtl(const sf_golden_job *job, sf_ray_dut *rays, sf_golden *golden);
/* The same from a board, tile by tile. The pixels are the board's. Counters are compared as sums over a tile, so the
 * events of single pixels are the core's. */
sf_status sf_golden_board(const sf_golden_job *job, sf_board *board, sf_golden *golden);

/* For both: tiles of the view that overlap the window, from left to right and top to bottom. tile: place of
 * its first pixel in the window, and its size there. */
typedef sf_status (*sf_tile_fn)(const sf_golden_job *job, const sf_window *tile, void *user, sf_golden *golden);
sf_status sf_each_tile(const sf_golden_job *job, sf_tile_fn work, void *user, sf_golden *golden);
/* The number of the tile that a pixel of the view is in. */
uint64_t sf_tile_number(int across, int down);
#endif
