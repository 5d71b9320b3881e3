/* The vector kit: a folder with which any simulator checks the accelerator, or another block with its ports, against
 * the fixed-point core: programming, stimulus, everything expected, RTL, a bench in plain SystemVerilog. docs/kit.md */
#ifndef SF_SIM_KIT_KIT_H
#define SF_SIM_KIT_KIT_H
#include "fx/fx.h"
#include "base/io.h"
#include "scene/scene.h"

#define SF_KIT_FIRST "program.hex" /* of its files, the first to be written */
enum { SF_KIT_VERSION = 1, SF_KIT_SAMPLES_MAX = 4096 };

typedef struct sf_kit_options {
  const char *scene_path; /* of the scene file: named and hashed in the manifest */
  uint64_t seed;          /* of rays and of the bench's stalls */
  int rays, samples;      /* at most this many; samples 1..SF_KIT_SAMPLES_MAX */
} sf_kit_options;

typedef struct sf_kit_report {
  int rays, samples, beats, writes, files;
  uint64_t bytes;
} sf_kit_report;

/* SF_E_USAGE if the folder holds anything but a kit, complete or not. */
sf_status sf_kit_check_folder(const char *folder);
/* The same seed draws the rays that sf_cosim draws; of each, the first 12 samples at most. SF_E_FORMAT when none of
 * them has a sample. */
sf_status sf_kit_write(const char *folder, const fx_scene *scene, const sf_dataset *data, const sf_kit_options *options,
                       sf_kit_report *report);

/* ---- inside of the kit ---- */

/* A ray that has samples in the kit. */
typedef struct sf_kit_ray {
  uint64_t number; /* of the drawing */
  int view, x, y, samples;
  fx_ray ray;
} sf_kit_ray;

typedef struct sf_kit_sample {
  int ray;
  bool first;
  int16_t f[SF_DIR_MAX]; /* [fx_net_inputs] */
  fx_out out;
  fx_trace trace;
} sf_kit_sample;

/* Samples drawn for a kit: rays of random pixels, and of each the samples that meet something, at most `limit` in all.
 * base: what each lane of a readout starts from. counts: events of all samples. */
typedef struct sf_kit_draw {
  sf_kit_ray *ray;
  sf_kit_sample *sample;
  int rays, samples, limit;
  int32_t base[SF_LANES];
  fx_counts counts;
  const fx_scene *scene;
} sf_kit_draw;

sf_status sf_kit_draw_samples(sf_kit_draw *draw, const fx_scene *scene, const sf_dataset *data,
                              const sf_kit_options *options);
void sf_kit_draw_free(sf_kit_draw *draw);

/* Files of the source tree that go with every kit (tools/embed.sh): bench, Makefile, README, and rtl/ in the order in
 * which it compiles. */
typedef struct sf_kit_file {
  const char *name; /* in the kit */
  const unsigned char *data;
  size_t size;
} sf_kit_file;
extern const sf_kit_file sf_kit_files[]; /* ends with name == NULL */

/* Files as they are written, each hashed into `list`. */
typedef struct sf_kit_output {
  const char *folder;
  cJSON *list;
  int files;
  uint64_t bytes;
} sf_kit_output;
typedef struct sf_kit_writer {
  sf_writer writer;
  const char *name;
} sf_kit_writer;
sf_status sf_kit_path(const sf_kit_output *output, const char *name, char path[4096]);
sf_status sf_kit_begin(const sf_kit_output *output, sf_kit_writer *file, const char *name);
sf_status sf_kit_end(sf_kit_output *output, sf_kit_writer *file);

/* Of sf_ray_top: its programming (ray_program.hex), and rays, memory, pixels and counters. */
sf_status sf_kit_program_rays(sf_kit_output *output, const fx_scene *scene, uint32_t base, int *writes);
sf_status sf_kit_rays(sf_kit_output *output, const sf_kit_draw *draw);
/* The register window; what depends on the clock (cycles, stalls) is 0 there and not compared. */
sf_status sf_kit_counters(sf_kit_output *output, const char *name, const fx_counts *counts);

/* Programming, stimulus, outputs, taps, counters as $readmemh images, and the sizes of all of them. */
sf_status sf_kit_images(sf_kit_output *output, const sf_kit_draw *draw, const sf_kit_options *options,
                        sf_kit_report *report);
#endif
