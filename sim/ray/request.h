/* Rays as sf_ray_top takes them, pixels as it gives them, and how a scene programs it. The Verilated block and a board
 * share this. */
#ifndef SF_SIM_RAY_REQUEST_H
#define SF_SIM_RAY_REQUEST_H
#include "firmware/sf_ray_driver.h"
#include "fx/memory.h"

typedef struct sf_ray_sample {
  uint32_t pos[3]; /* Q0.24 */
  int32_t delta_q24;
  uint64_t distance_q16; /* below 2^44 */
} sf_ray_sample;

/* The samples of one ray, n >= 0. The hardware may stop before the last one, by the core's own rule. new_tile: the
 * first ray of a tile, before which the field's cache is emptied. stops: the hardware has to find the end at sample n -
 * 1, which is not marked as the last. Once the pixel has come, one more sample, marked as the last, ends the ray. */
typedef struct sf_ray_request {
  const fx_ray *ray;
  const sf_ray_sample *sample;
  int n;
  bool stops, new_tile;
} sf_ray_request;

/* base: address of the field in the block's memory. */
sf_ray_blob sf_ray_blob_of(const fx_scene *scene, uint32_t base);
sf_planes_blob sf_ray_planes_of(const fx_tensorf *field);

/* Sample `at` of a ray on the stream, and the one behind the last of a ray that stops. */
typedef struct sf_ray_beat {
  uint64_t data[4];
  bool user, last;
} sf_ray_beat;
sf_ray_beat sf_ray_beat_of(const sf_ray_request *request, int at);
fx_pixel sf_ray_pixel_of(const uint64_t word[6]);

sf_status sf_compare_field(const fx_memory_counts *core, const sf_field_counters *rtl);

/* The most samples of a ray: all its lattice points, which TensoRF may need before enough of them are decoded. */
enum { SF_RAY_SAMPLES_MAX = 4096 };
/* The first n samples of the ray's march. */
void sf_ray_samples(const fx_scene *scene, const fx_ray *ray, sf_ray_sample *sample, int n);
/* The samples that the core took for its pixel. With these the counters equal the core's. sample[SF_RAY_SAMPLES_MAX] */
sf_ray_request sf_ray_request_as(const fx_scene *scene, const fx_ray *ray, const fx_pixel *core, sf_ray_sample *sample);
#endif
