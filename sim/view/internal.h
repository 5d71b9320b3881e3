/* What the parts of the viewer share. */
#ifndef SF_SIM_VIEW_INTERNAL_H
#define SF_SIM_VIEW_INTERNAL_H
#include "sim/replay.h"
#include "sim/studio/studio.h"
#include "sim/view/viewer.h"
#include <pthread.h>

struct sf_viewer {
  sf_viewer_options options;
  sf_studio fixed;         /* owns the scene */
  int file_steps;          /* of the scene's file */
  fx_scene at[SF_T_MAX];   /* the scene with 1.. steps: the same contents */
  fx_core *core[SF_T_MAX]; /* of these, opened when first asked for */
  sf_studio real;          /* float; model_path "" without a model */
  sf_dataset data;         /* one view without its picture: the space that cameras are in */
  int views;               /* of the split; 0 without data */
  sf_camera home;          /* where the page begins */
  sf_technology technology;
  pthread_mutex_t drawing; /* one picture is computed at a time, tile by tile */
  pthread_mutex_t rtl_turn;
  sf_studio rtl; /* scene_sha256 "" until it is opened */
  pthread_mutex_t photo_turn;
  sf_shot photo;     /* the last view that was asked for; view NULL: none yet */
  sf_replay *replay; /* or NULL */
  cJSON *difference; /* of it: an object, empty where the file tells nothing */
  char *scene_path;  /* of it, malloc'ed */
};

/* Replay and difference; scene, data and split, where the options name none. */
sf_status sf_viewer_load_difference(sf_viewer *v);
double sf_viewer_middle(const fx_scene *scene, int axis); /* of the box, model units */

/* ---- a view, and what is drawn of it ---- */

/* What a request looks at: a camera of the page's or a view of the data set's. */
typedef struct sf_sight {
  sf_dataset data; /* shares everything with the viewer's but the view */
  sf_view view;    /* without a picture */
  int index;       /* of the data set's view, -1: a free camera */
  int steps;
  sf_window window;
} sf_sight;
sf_status sf_sight_of(sf_viewer *v, const sf_view_ask *ask, sf_sight *sight);
/* The photograph of a view, kept until another one is asked for; photo_turn is held by the caller. */
sf_status sf_viewer_photo(sf_viewer *v, int index, const sf_shot **shot);
/* Whether there is a float model, with so many steps. */
sf_status sf_viewer_need_model(const sf_viewer *v, int steps);
sf_status sf_viewer_core(sf_viewer *v, int steps, fx_core **core); /* `drawing` is held by the caller */

/* Pixels x + i * stride, y + j * stride of the picture. */
typedef struct sf_tile {
  int x, y, across, down, stride;
  float *rgb;   /* [down][across][3], 1.0 = white */
  float *value; /* [down][across] of the map; NaN: none here */
  fx_counts counts;
} sf_tile;

typedef enum {
  SF_MAP_NONE,
  SF_MAP_SAMPLES,
  SF_MAP_SPIKES,
  SF_MAP_SPIKES_D1,
  SF_MAP_SPIKES_C1,
  SF_MAP_SPIKES_C2,
  SF_MAP_SOPS,
  SF_MAP_LEDGER, /* and the spiking ledgers behind it */
  SF_MAP_SATURATED = SF_MAP_LEDGER + SF_SPIKING_LEDGERS,
  SF_MAP_MISSES,
  SF_MAP_PHOTO,
  SF_MAP_FLOAT,
  SF_MAP_RTL,
  SF_MAPS
} sf_map;
typedef struct sf_map_text {
  const char *key, *title, *unit;
  const char *meaning;
} sf_map_text;
void sf_map_describe(int map, sf_map_text *text);
int sf_map_find(const char *key); /* -1: there is none */
/* A map of the events of single rays; of the cache's misses, which follow from the rays before it. */
bool sf_map_counts(int map);
bool sf_map_lists(int map);
double sf_map_of_cost(int map, const fx_pixel *pixel, const fx_cost *cost);
/* NaN where the energy cannot be told. */
double sf_map_of_counts(const sf_viewer *v, const fx_scene *scene, int map, const fx_counts *counts,
                        const fx_memory_counts *memory);

/* Colours, and the values of one map, of one source. */
sf_status sf_tile_fixed(sf_viewer *v, const sf_sight *sight, int map, sf_tile *tile);
sf_status sf_tile_float(sf_viewer *v, const sf_sight *sight, sf_tile *tile);
sf_status sf_tile_rtl(sf_viewer *v, const sf_sight *sight, sf_tile *tile);
sf_status sf_tile_photo(sf_viewer *v, const sf_sight *sight, sf_tile *tile);

/* ---- the story of a ray ---- */

/* A sample, from the front. */
typedef struct sf_story_sample {
  int32_t at;            /* lattice point */
  uint32_t pos[3];       /* Q0.24 */
  uint32_t sigma;        /* U16.12 per box edge */
  uint32_t weight;       /* Q.20 */
  uint32_t left;         /* transmittance behind it, Q.20 */
  uint32_t colour[3];    /* U4.16 */
  bool decoded;          /* went through the nets: all but TensoRF's of no weight */
  int16_t f[SF_DIR_MAX]; /* inputs of the nets */
  fx_cost cost;
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS];
  int32_t membrane[SF_T_MAX], current[SF_T_MAX]; /* of one neuron */
} sf_story_sample;
typedef struct sf_story {
  const fx_scene *scene;
  fx_ray ray;
  int layer, neuron; /* whose membranes are kept */
  fx_pixel pixel;
  fx_counts counts;
  int count, room;
  sf_story_sample *sample;
  /* While it is being told. */
  int next;       /* the first that waits to be decoded */
  int32_t at;     /* the last point that was read */
  fx_pixel light; /* what has been composited */
  bool behind;    /* the ray has ended: what is read is not used */
  int32_t base[SF_LANES];
  fx_trace trace;
} sf_story;
/* Layer and neuron are the caller's, and in range. Free it even after a failure. */
sf_status sf_story_tell(sf_story *story, const fx_scene *scene, const fx_ray *ray);
void sf_story_free(sf_story *story);
/* "along", "raster-D1" .., "neuron": parts of a page, as strings of an object. sample: which stands out. */
sf_status sf_story_draw(const sf_story *story, int sample, cJSON *to);

/* ---- answers ---- */

#define SF_VIEWER_ANSWER(name) sf_status sf_viewer_##name(void *user, const sf_view_ask *ask, sf_view_reply *reply)
SF_VIEWER_ANSWER(picture); /* tiles, as they come */
SF_VIEWER_ANSWER(save);    /* kind: exr, png, command */
SF_VIEWER_ANSWER(story);   /* of pixel x, y */
SF_VIEWER_ANSWER(replay);  /* of pixel x, y, for sf_cosim */
SF_VIEWER_ANSWER(difference);
SF_VIEWER_ANSWER(signals); /* for GTKWave */
#endif
