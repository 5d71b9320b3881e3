/* Decoders behind sf_image_load. `bytes` holds the whole file `path`. On failure the image is empty. */
#ifndef SF_IMAGE_CODEC_H
#define SF_IMAGE_CODEC_H
#include "image/image.h"
#include <stdbool.h>

sf_status sf_png_load(sf_image *image, const char *path, const unsigned char *bytes, size_t size);
sf_status sf_jpeg_load(sf_image *image, const char *path, const unsigned char *bytes, size_t size);

/* Refuses absurd sizes before any memory is asked for, then allocates the pixels. */
sf_status sf_image_alloc(sf_image *image, const char *path, uint64_t width, uint64_t height);

/* Deflate packs at most 1032 : 1. A damaged or hostile size must not cost gigabytes before it is noticed. */
static inline bool sf_deflate_holds(size_t packed, uint64_t bytes)
{
  return bytes / 1100 <= packed;
}

#endif
