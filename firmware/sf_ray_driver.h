/* Driver of sf_ray_top: the part for encoder and compositor. sf_driver.h has the part for the nets. */
#ifndef SF_FIRMWARE_SF_RAY_DRIVER_H
#define SF_FIRMWARE_SF_RAY_DRIVER_H
#include "firmware/sf_driver.h"

enum { SF_RAY_LEVELS_MAX = 16, SF_RAY_DIR_MAX = 16 };

/* The grid's levels and how rays end. The table itself lies in the block's external memory. */
typedef struct sf_ray_level_blob {
  uint32_t scale_q16; /* (resolution - 1), Q16.16 */
  uint32_t stride;    /* points per axis of a dense level; 0 = hashed */
  uint32_t log2_size; /* hashed: log2 of entries */
  uint32_t offset;    /* first entry */
  uint32_t shift;
} sf_ray_level_blob;
typedef struct sf_ray_blob {
  uint32_t levels, n_dir, dir_frac; /* LSB of the direction features: 2^-dir_frac */
  sf_ray_level_blob level[SF_RAY_LEVELS_MAX];
  uint32_t trans_stop, max_samples, background[3];
  uint32_t table;                   /* address of the grid's table in the block's memory, a multiple of 16 */
  uint32_t cache_bytes, cache_ways; /* of the field's cache that the program counts on; 0: any */
} sf_ray_blob;

/* TensoRF's field, whose planes and lines lie in the block's memory from `table` on. */
enum { SF_PLANES_SCALES = 4, SF_PLANES_ARRAYS = 6, SF_PLANES_FEATURES = 32 };
typedef struct sf_planes_scale_blob {
  uint32_t mul, shift;
} sf_planes_scale_blob;
typedef struct sf_planes_array_blob {
  uint32_t plane, line, point_lines; /* first lines of 16 bytes, and lines of a point */
} sf_planes_array_blob;
enum { SF_PLANES_WORDS = 39 }; /* of 32 bits, before the basis: the same ones in every program */
typedef struct sf_planes_blob {
  uint32_t res[3], relu, weight_stop, features, feature_freqs, view_freqs, frac;
  sf_planes_scale_blob scale[SF_PLANES_SCALES]; /* density_in, sigma_out, feature_in, phase_in */
  int32_t bias;                                 /* of density_in */
  sf_planes_array_blob array[SF_PLANES_ARRAYS]; /* pairs of the density, then of the appearance */
  uint32_t components[3];                       /* of the appearance's pairs */
  const int8_t *basis;                          /* [sum of components][SF_PLANES_FEATURES] */
} sf_planes_blob;

/* Counts of the field since the reset or sf_ray_driver_clear. A ray that was cut off has been counted in part. */
typedef struct sf_field_counters {
  uint64_t lookups, misses, fills, stalls; /* stalls: cycles, see FIELD_STALLS */
} sf_field_counters;

/* Programs and starts the rays, after sf_driver_load, whose soft reset has stopped them. planes: NULL for a hash grid.
 * With planes, levels and directions of `rays` are not read. SF_DRIVER_REFUSED: see RAY_ERROR. SF_DRIVER_MISFIT:
 * levels, n_dir or the decoder's inputs are wrong, which the block does not check. SF_DRIVER_CACHE: the block has
 * another cache. SF_DRIVER_FIELD: the block does not have this kind of field. */
sf_driver_code sf_ray_driver_load(const sf_bus *bus, const sf_ray_blob *rays, const sf_planes_blob *planes);
void sf_ray_driver_cache(const sf_bus *bus, uint32_t *bytes, uint32_t *ways); /* of the field, in this build */
void sf_ray_driver_field(const sf_bus *bus, sf_field_counters *counters);
void sf_ray_driver_clear(const sf_bus *bus);
/* First bit of a RAY_ERROR register as text, "no error" for 0. */
const char *sf_ray_driver_error_text(uint32_t error);
#endif
