#include "image/codec.h"
#include "base/io.h"
#include <stdlib.h>
#include <string.h>

#define FILE_LIMIT ((size_t)1 << 31)

sf_status sf_image_load(sf_image *image, const char *path)
{
  static const unsigned char png[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, jpeg[3] = {0xff, 0xd8, 0xff};
  memset(image, 0, sizeof *image);
  char *bytes;
  size_t size;
  SF_TRY(sf_read_file(path, FILE_LIMIT, &bytes, &size));
  sf_status status;
  if (!size)
    status = sf_fail(SF_E_FORMAT, "%s: the file is empty", path);
  else if (size >= sizeof png && !memcmp(bytes, png, sizeof png))
    status = sf_png_load(image, path, (unsigned char *)bytes, size);
  else if (size >= sizeof jpeg && !memcmp(bytes, jpeg, sizeof jpeg))
    status = sf_jpeg_load(image, path, (unsigned char *)bytes, size);
  else
    status = sf_fail(SF_E_FORMAT, "%s: neither a PNG nor a JPEG image", path);
  free(bytes);
  return status;
}

/* One output pixel: `from` is the corner of its factor x factor block. */
static void average_block(const uint16_t *from, size_t row, int factor, uint16_t out[4])
{
  uint64_t weighted[3] = {0}, plain[3] = {0}, alpha = 0, n = (uint64_t)factor * (uint64_t)factor;
  for (int y = 0; y < factor; y++) {
    for (int x = 0; x < factor; x++) {
      const uint16_t *p = from + (size_t)y * row + (size_t)x * 4;
      for (int c = 0; c < 3; c++) weighted[c] += (uint64_t)p[c] * p[3], plain[c] += p[c];
      alpha += p[3];
    }
  }
  for (int c = 0; c < 3; c++) out[c] = (uint16_t)(alpha ? (weighted[c] + alpha / 2) / alpha : (plain[c] + n / 2) / n);
  out[3] = (uint16_t)((alpha + n / 2) / n);
}

sf_status sf_image_downscale(sf_image *image, int factor, const char *name)
{
  if (factor < 1) return sf_fail(SF_E_RANGE, "%s: downscale factor %d is below 1", name, factor);
  if (factor == 1) return sf_ok();
  if (image->width < factor || image->height < factor)
    return sf_fail(SF_E_RANGE, "%s: of %d x %d pixels nothing is left by a downscale factor of %d", name, image->width,
                   image->height, factor);
  sf_image small;
  SF_TRY(sf_image_alloc(&small, name, (uint64_t)(image->width / factor), (uint64_t)(image->height / factor)));
  size_t row = (size_t)image->width * 4;
  for (int y = 0; y < small.height; y++)
    for (int x = 0; x < small.width; x++)
      average_block(image->rgba + (size_t)y * factor * row + (size_t)x * factor * 4, row, factor,
                    small.rgba + ((size_t)y * small.width + x) * 4);
  free(image->rgba);
  *image = small;
  return sf_ok();
}
