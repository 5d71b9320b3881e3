/* The memory of an image. */
#include "image/codec.h"
#include <stdlib.h>
#include <string.h>

#define MAX_PIXELS ((uint64_t)1 << 28)

sf_status sf_image_alloc(sf_image *image, const char *path, uint64_t width, uint64_t height)
{
  image->rgba = NULL;
  if (!width || !height || width > MAX_PIXELS || height > MAX_PIXELS || width * height > MAX_PIXELS)
    return sf_fail(SF_E_RANGE, "%s: an image of %ju x %ju pixels; the limit is %ju pixels", path, (uintmax_t)width,
                   (uintmax_t)height, (uintmax_t)MAX_PIXELS);
  image->width = (int)width, image->height = (int)height;
  image->rgba = malloc((size_t)(width * height) * 4 * sizeof *image->rgba);
  if (!image->rgba)
    return sf_fail(SF_E_MEMORY, "%s: no memory for %ju x %ju pixels", path, (uintmax_t)width, (uintmax_t)height);
  return sf_ok();
}

void sf_image_free(sf_image *image)
{
  free(image->rgba);
  memset(image, 0, sizeof *image);
}
