/* libspikefield: the fixed-point core as a C library. A scene (.snn, written by sf_export) is loaded once and gives
 * the bits of the accelerator: densities and colours of samples, pixels of rays and of whole frames, the spikes,
 * membranes and currents behind them, every event counted, the energy in femtojoules.
 *
 *   spikefield_scene *scene;
 *   spikefield_status status = spikefield_scene_open(&scene, "scene.snn");
 *   if (status.code != SPIKEFIELD_OK) { puts(status.message); ... }
 *   spikefield_frame(scene, NULL, &camera, pixels, &counts);
 *   spikefield_scene_close(scene);
 *
 * cc example.c $(pkg-config --cflags --libs spikefield)      (a whole program: docs/example.c)
 *
 * Rules of the house
 *   threads   A scene never changes after it is opened: any number of threads may use it at once, each with its own
 *             counts and outputs. Close it when the last one is done.
 *   memory    Arrays belong to the caller and have the shapes stated; nothing of the caller is kept.
 *   errors    Returned, never printed; no function ends the program. An output is only meaningful after SPIKEFIELD_OK;
 *             counts are added to on success and untouched otherwise.
 *   bits      Integers out are the same on every machine, with any number of threads. Of the inputs only poses and
 *             positions are real numbers; they pass one rounding to integers (spikefield_position, _direction).
 *
 * Units. The scene box is [0,1)^3 in box units; model units are those the scene was trained in: box = (model *
 * to_box_scale + to_box_offset) * stretch, per axis; a box edge below is the longest. A data set in the Blender layout
 * has model = world * 0.8 unless trained otherwise. Qa.b: a fixed-point number with b fraction bits. The formats are
 * those of the default widths; a build with others (ARCH) has a soname of its own. */
#ifndef SPIKEFIELD_SPIKEFIELD_H
#define SPIKEFIELD_SPIKEFIELD_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The version of the library, the programs and their data: it is set here alone. */
#define SPIKEFIELD_VERSION_MAJOR 1 /* of the soname: changes with every change of a type or a function below */
#define SPIKEFIELD_VERSION_MINOR 1
#define SPIKEFIELD_VERSION_PATCH 0
#define SPIKEFIELD_JOINED(major, minor, patch) #major "." #minor "." #patch
#define SPIKEFIELD_TEXT(major, minor, patch) SPIKEFIELD_JOINED(major, minor, patch)
#define SPIKEFIELD_VERSION SPIKEFIELD_TEXT(SPIKEFIELD_VERSION_MAJOR, SPIKEFIELD_VERSION_MINOR, SPIKEFIELD_VERSION_PATCH)

#if defined(__GNUC__)
#define SPIKEFIELD_API __attribute__((visibility("default")))
#else
#define SPIKEFIELD_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Neurons of the widest layer, which is the library's own: of one built for 256 its pkg-config file defines it so. */
#ifndef SPIKEFIELD_LANES
#define SPIKEFIELD_LANES 128
#endif

/* Sizes of the accelerator; a scene's own are in spikefield_scene_info. */
enum {
  SPIKEFIELD_LAYERS = 5,    /* D1 D2 C1 C2 C3 */
  SPIKEFIELD_STEPS_MAX = 8, /* time steps */
  SPIKEFIELD_FEATURES_MAX = 32,
  SPIKEFIELD_DIRECTIONS = 16, /* spherical harmonics of a direction */
  SPIKEFIELD_INPUT_MAX = 2047 /* features and harmonics: -2047..2047 */
};
/* Layers: D1 features -> spikes, D2 spikes -> density and the values h, C1 harmonics and h -> spikes,
 * C2 spikes -> spikes, C3 spikes -> colour. */
typedef enum { SPIKEFIELD_D1, SPIKEFIELD_D2, SPIKEFIELD_C1, SPIKEFIELD_C2, SPIKEFIELD_C3 } spikefield_layer;

typedef enum {
  SPIKEFIELD_OK = 0,
  SPIKEFIELD_E_IO,          /* the operating system refused: missing file, no permission */
  SPIKEFIELD_E_FORMAT,      /* not a .snn file, or a damaged one */
  SPIKEFIELD_E_RANGE,       /* a number is outside its stated range */
  SPIKEFIELD_E_MEMORY,      /* an allocation failed */
  SPIKEFIELD_E_UNSUPPORTED, /* well-formed, but beyond this version */
  SPIKEFIELD_E_USAGE,       /* a pointer is NULL that may not be */
  SPIKEFIELD_E_DIFFERENCE,  /* for programs that compare; the library never returns it */
  SPIKEFIELD_E_STOPPED      /* a callback returned false */
} spikefield_code;

typedef struct spikefield_status {
  spikefield_code code;
  char message[400]; /* one line: what, where (file, tensor, ray, sample) and what was expected; "" when OK */
} spikefield_status;

/* The version of the library that runs, "MAJOR.MINOR.PATCH"; SPIKEFIELD_VERSION is the one compiled against. */
SPIKEFIELD_API const char *spikefield_version(void);
/* SPIKEFIELD_LANES of the library that runs: what the shapes below depend on. */
SPIKEFIELD_API int32_t spikefield_lanes(void);

/* ---- scenes ---- */

typedef struct spikefield_scene spikefield_scene;

/* *scene is NULL after a failure. Closing NULL is fine. `data` is the contents of a .snn file, copied; `name` stands
 * for the file in messages. */
SPIKEFIELD_API spikefield_status spikefield_scene_open(spikefield_scene **scene, const char *path);
SPIKEFIELD_API spikefield_status spikefield_scene_open_memory(spikefield_scene **scene, const void *data, size_t size,
                                                              const char *name);
SPIKEFIELD_API void spikefield_scene_close(spikefield_scene *scene);

typedef enum { SPIKEFIELD_HYBRID, SPIKEFIELD_DECAY, SPIKEFIELD_NO_DECAY, SPIKEFIELD_RADIX } spikefield_mode;
typedef struct spikefield_scene_info {
  int32_t inputs[SPIKEFIELD_LAYERS], outputs[SPIKEFIELD_LAYERS]; /* of each layer */
  int32_t theta[SPIKEFIELD_LAYERS];                              /* thresholds in membrane LSB; 0 in D2 and C3 */
  int32_t leak_q12[SPIKEFIELD_LAYERS];
  spikefield_mode mode;
  int32_t steps;         /* time steps the scene asks for */
  int32_t grid_levels;   /* of the hash grid; 0: a TensoRF scene */
  int32_t features;      /* per sample, 2 per level; of a TensoRF scene the inputs of its decoder */
  int32_t directions;    /* harmonics that the net reads, the first of the 16 */
  int32_t max_samples;   /* per ray */
  int32_t occupancy_res; /* cells per axis */
  int32_t step_q24;      /* between samples, box edges in Q0.24; the shortest */
  int32_t background_q16[3];
  int64_t grid_entries, grid_bytes, weight_bytes, occupancy_bytes;
  double to_box_scale, to_box_offset[3], stretch[3]; /* stretch: 1 but where a TensoRF box has unequal edges */
  double step;          /* between samples, model units; the shortest, where steps grow with the distance */
  double direction_lsb; /* value of one LSB of the harmonics */
} spikefield_scene_info;
SPIKEFIELD_API spikefield_status spikefield_scene_describe(const spikefield_scene *scene, spikefield_scene_info *info);

/* ---- how to run ---- */

/* Where a thread cannot be created, the OpenMP runtime ends the program; threads = 1 creates none.
 * NULL wherever options are taken, or all zero: the defaults. */
typedef struct spikefield_options {
  int32_t steps;   /* time steps, 1..8; 0: the scene's */
  int32_t threads; /* of spikefield_rays and _frame, 1..1024; 0: all of the machine (OMP_NUM_THREADS). No more than its
                      processors, or than one for 256 rays, are started */
  /* Now and then, from one thread at a time, with rays done and rays in all; false stops: SPIKEFIELD_E_STOPPED. */
  bool (*progress)(void *user, uint64_t done, uint64_t total);
  void *user;
} spikefield_options;

/* Events per layer and time step. Zero it first; every call adds. NULL where no counts are wanted. */
typedef struct spikefield_layer_counts {
  uint64_t mac[SPIKEFIELD_STEPS_MAX];     /* multiply-accumulates; C1's for the harmonics: once per ray, step 0 */
  uint64_t sop[SPIKEFIELD_STEPS_MAX];     /* synaptic operations: spikes in * neurons out */
  uint64_t spikes[SPIKEFIELD_STEPS_MAX];  /* neurons that fired */
  uint64_t updates[SPIKEFIELD_STEPS_MAX]; /* membrane or accumulator updates */
  uint64_t weight[SPIKEFIELD_STEPS_MAX];  /* bytes of weights read */
  uint64_t state_r[SPIKEFIELD_STEPS_MAX], state_w[SPIKEFIELD_STEPS_MAX]; /* bytes of membranes */
  uint64_t special[SPIKEFIELD_STEPS_MAX];                                /* exp (D2) and sigmoid (C3) evaluations */
} spikefield_layer_counts;
typedef struct spikefield_counts {
  spikefield_layer_counts layer[SPIKEFIELD_LAYERS];
  uint64_t samples, rays;                        /* through the nets; rays with at least one sample */
  uint64_t grid_bytes;                           /* of the hash grid read */
  uint64_t march_steps;                          /* points tested against the occupancy grid */
  uint64_t saturated[SPIKEFIELD_LAYERS];         /* saturation events */
  uint64_t saturated_samples[SPIKEFIELD_LAYERS]; /* samples with at least one of them */
  uint64_t saturated_features;
  uint64_t field_samples, field_mac; /* TensoRF: points whose density was read; products of the field */
} spikefield_counts;
SPIKEFIELD_API void spikefield_counts_add(spikefield_counts *sum, const spikefield_counts *more);

/* 4600 fJ per MAC, 900 fJ per SOP (fp32 at 45 nm); UINT64_MAX: does not fit. The ReLU twin: the same layers on as many
 * samples, every synapse a MAC, once. */
SPIKEFIELD_API uint64_t spikefield_energy_fj(const spikefield_counts *counts);
SPIKEFIELD_API uint64_t spikefield_relu_energy_fj(const spikefield_scene *scene, uint64_t samples);

/* ---- samples ---- */

typedef struct spikefield_sample {
  uint32_t density;   /* U16.12 per box edge, before multiplication by the step; of a TensoRF scene 0: no net has it */
  uint32_t colour[3]; /* U4.16 */
} spikefield_sample;

/* What one sample left at every layer and time step; 41 KB. */
typedef struct spikefield_trace {
  /* D1, C1, C2: neuron n is bit n % 64 of word n / 64. */
  uint64_t spikes[SPIKEFIELD_LAYERS][SPIKEFIELD_STEPS_MAX][SPIKEFIELD_LANES / 64];
  /* D1, C1, C2: before firing and reset; D2 [0], C3 [0..2]: the accumulator after the step, of radix the sum of
   * currents, each step's weighing half of the one before. */
  int32_t membrane[SPIKEFIELD_LAYERS][SPIKEFIELD_STEPS_MAX][SPIKEFIELD_LANES];
  int32_t current[SPIKEFIELD_LAYERS][SPIKEFIELD_STEPS_MAX][SPIKEFIELD_LANES]; /* exact sums;
                                                                                 of radix in C2 that of all steps */
} spikefield_trace;

/* What the accelerator shows of a sample at a layer and step: its ports tap_*, bits as in a trace. Neurons that the
 * layer does not have are 0. */
typedef struct spikefield_shown {
  uint64_t spikes[SPIKEFIELD_LANES / 64]; /* D1, C1, C2 */
  uint64_t rows[SPIKEFIELD_LANES / 64];   /* presynaptic neurons added up: C2 at the step, D2 and C3 at any step */
  int32_t membrane[SPIKEFIELD_LANES];     /* D1, C1, C2: after firing and reset */
} spikefield_shown;
/* `options` are those of the call that gave the trace. */
SPIKEFIELD_API spikefield_status spikefield_trace_shown(const spikefield_scene *scene,
                                                        const spikefield_options *options,
                                                        const spikefield_trace *trace, int32_t layer, int32_t step,
                                                        spikefield_shown *shown);

/* What its window of counters reads after these events, at (event * 8 + layer) * 8 + step (docs/registers.md). Cycles
 * and stalls, which are time and no events, are 0; so are the rays of a TensoRF scene, counted where its field is.
 * Without a scene or counts the window stays as it is. */
enum { SPIKEFIELD_COUNTERS = 512 };
SPIKEFIELD_API void spikefield_counter_window(const spikefield_scene *scene, const spikefield_counts *counts,
                                              uint64_t window[SPIKEFIELD_COUNTERS]);

/* A point in model units to box units, Q0.24. E_RANGE outside the box. */
SPIKEFIELD_API spikefield_status spikefield_position(const spikefield_scene *scene, const float model[3],
                                                     uint32_t position[3]);
/* Viewing direction (of any length > 0) to spherical harmonics of degree 3. Of a TensoRF scene, which has none, to the
 * unit vector in harmonics[0..2], Q1.14; the others are 0. */
SPIKEFIELD_API spikefield_status spikefield_direction(const spikefield_scene *scene, const float direction[3],
                                                      int16_t harmonics[SPIKEFIELD_DIRECTIONS]);
/* positions[n][3], Q0.24, below 2^24 -> features[n][info.features]. Of a TensoRF scene these are the decoder's inputs;
 * those that come of the direction alone are 0. */
SPIKEFIELD_API spikefield_status spikefield_features(const spikefield_scene *scene, const uint32_t *positions, size_t n,
                                                     int16_t *features, spikefield_counts *counts);

/* n samples of one ray through the nets: features[n][info.features] -> samples[n], traces[n] (NULL: none). A call with
 * samples counts as one ray, and so do the MACs of the harmonics. */
SPIKEFIELD_API spikefield_status spikefield_samples(const spikefield_scene *scene, const spikefield_options *options,
                                                    const int16_t harmonics[SPIKEFIELD_DIRECTIONS],
                                                    const int16_t *features, size_t n, spikefield_sample *samples,
                                                    spikefield_trace *traces, spikefield_counts *counts);
/* The same from positions[n][3]. Of a TensoRF scene: harmonics is what spikefield_direction gives. The samples' density
 * is the field's (from features it is 0), and all n pass the decoder, whatever they weigh. */
SPIKEFIELD_API spikefield_status spikefield_samples_at(const spikefield_scene *scene, const spikefield_options *options,
                                                       const int16_t harmonics[SPIKEFIELD_DIRECTIONS],
                                                       const uint32_t *positions, size_t n, spikefield_sample *samples,
                                                       spikefield_trace *traces, spikefield_counts *counts);

/* ---- rays and frames ---- */

/* Composited over the scene's background. weight_sum + transmittance == 1 << 20, always. */
typedef struct spikefield_pixel {
  uint64_t colour[3];                 /* exact, Q8.36 */
  uint64_t depth;                     /* sum of weight (Q.20) * distance in sample steps (Q16.16) */
  uint32_t rgba[4];                   /* the golden image's integers: 0..65535, 65535 = 1.0 */
  uint32_t weight_sum, transmittance; /* Q.20 */
  uint32_t samples;
} spikefield_pixel;

/* Mean distance from the camera of what the ray hit, model units; 0 where it hit nothing. */
SPIKEFIELD_API double spikefield_pixel_distance(const spikefield_scene *scene, const spikefield_pixel *pixel);

/* n rays on all threads: origins[n][3], directions[n][3] (of any length > 0), model units -> pixels[n]. A ray that
 * enters the box 32768 steps (spikefield_scene_info) away or farther is refused, SPIKEFIELD_E_RANGE. */
SPIKEFIELD_API spikefield_status spikefield_rays(const spikefield_scene *scene, const spikefield_options *options,
                                                 const float *origins, const float *directions, size_t n,
                                                 spikefield_pixel *pixels, spikefield_counts *counts);

/* Pinhole camera. Pixel (x, y) is seen along ((x + 0.5 - cx) / fx, -(y + 0.5 - cy) / fy, -1) in the camera's axes:
 * x right, y up, looking along -z; row 0 is the top one. */
typedef struct spikefield_camera {
  int32_t width, height; /* 1..65536 each */
  float fx, fy, cx, cy;  /* pixels; fx, fy > 0 */
  float to_model[12];    /* row-major 3x4: camera to model units */
} spikefield_camera;

/* pixels[height][width]. */
SPIKEFIELD_API spikefield_status spikefield_frame(const spikefield_scene *scene, const spikefield_options *options,
                                                  const spikefield_camera *camera, spikefield_pixel *pixels,
                                                  spikefield_counts *counts);

/* One sample of a ray, valid during the call. */
typedef struct spikefield_tap {
  uint32_t index; /* along the ray, from 0; of a TensoRF scene among those that reach the decoder */
  const int16_t *features;
  const spikefield_sample *sample;
  const spikefield_trace *trace;
} spikefield_tap;
/* One ray in the calling thread, every sample shown to `tap` on its way; false stops: SPIKEFIELD_E_STOPPED. */
SPIKEFIELD_API spikefield_status spikefield_ray_taps(const spikefield_scene *scene, const spikefield_options *options,
                                                     const float origin[3], const float direction[3],
                                                     bool (*tap)(void *user, const spikefield_tap *tap), void *user,
                                                     spikefield_pixel *pixel, spikefield_counts *counts);

#ifdef __cplusplus
}
#endif
#endif
