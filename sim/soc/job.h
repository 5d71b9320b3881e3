/* A tile for the firmware: its image in memory, and what it must print and leave behind. */
#ifndef SF_SIM_SOC_JOB_H
#define SF_SIM_SOC_JOB_H
#include "fx/memory.h"

/* Header, scene and rays[height][width] as firmware/sf_tile.h says. *image is malloc'ed. The scene passes
 * fx_scene_check. SF_E_RANGE when image and pixels do not fit in the system's memory. */
sf_status sf_soc_image_make(const fx_scene *scene, const fx_ray *rays, int width, int height, uint8_t **image,
                            size_t *size);

/* Where the firmware leaves the pixels of an image, in bytes from the image's beginning. */
size_t sf_soc_image_pixels_at(const uint8_t *image);

/* SF_E_DIFFERENCE names the first pixel and field that differs. width: pixels per row, for the message. */
sf_status sf_soc_compare_pixels(const fx_pixel *core, const fx_pixel *firmware, size_t n, int width);

/* Every line of the firmware's output that begins with "audit " against what it must be for these counts and pixels:
 * events per layer, samples, rays, energy in fJ, checksum; with `field`, of TensoRF, also its look-ups and misses.
 * SF_E_DIFFERENCE quotes both lines. */
sf_status sf_soc_compare_audit(const fx_counts *core, const fx_memory_counts *field, const fx_pixel *pixels, size_t n,
                               const char *output);
#endif
