/* PNG in memory: pictures that go into another file. */
#include "image/image.h"
#include <png.h>
#include <stdlib.h>

sf_status sf_png_encode(const uint8_t *pixel, int width, int height, const uint8_t *palette, int colours, void **data,
                        size_t *size)
{
  png_image image = {.version = PNG_IMAGE_VERSION,
                     .width = (png_uint_32)width,
                     .height = (png_uint_32)height,
                     .format = palette ? PNG_FORMAT_RGBA_COLORMAP : PNG_FORMAT_RGB,
                     .colormap_entries = palette ? (png_uint_32)colours : 0};
  *data = NULL, *size = 0;
  if (width < 1 || height < 1 || width > 1 << 14 || height > 1 << 14 || (palette && (colours < 1 || colours > 256)))
    return sf_fail(SF_E_RANGE, "an image of %d x %d pixels cannot be encoded", width, height);
  png_alloc_size_t room = PNG_IMAGE_PNG_SIZE_MAX(image);
  void *buffer = malloc(room);
  if (!buffer) return sf_fail(SF_E_MEMORY, "no memory for a PNG of %d x %d pixels", width, height);
  if (!png_image_write_to_memory(&image, buffer, &room, 0, pixel, 0, palette)) {
    free(buffer);
    return sf_fail(SF_E_FORMAT, "cannot encode an image of %d x %d pixels: %s", width, height, image.message);
  }
  *data = buffer, *size = room;
  return sf_ok();
}
