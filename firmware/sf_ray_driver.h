/* Driver of sf_ray_top: what comes on top of sf_driver.h when encoder and compositor are in hardware too. */
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
} sf_ray_blob;

/* After sf_driver_load, whose soft reset has stopped the rays: programming and start. SF_DRIVER_REFUSED: RAY_ERROR;
 * SF_DRIVER_MISFIT: levels or n_dir, which the block does not check. */
sf_driver_code sf_ray_driver_load(const sf_bus *bus, const sf_ray_blob *rays);
/* First bit of a RAY_ERROR register as text, "no error" for 0. */
const char *sf_ray_driver_error_text(uint32_t error);
#endif
