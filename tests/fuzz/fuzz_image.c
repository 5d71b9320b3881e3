/* PNG and JPEG pictures of a data set. A PNG's checksums are mended first: libpng refuses every chunk with a wrong one.
 */
#include "firmware/sf_tile.h"
#include "fuzz.h"
#include "image/image.h"

static uint32_t big_endian(const uint8_t *at)
{
  return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

/* Chunks behind the signature: length, type, as many bytes, CRC of type and bytes. */
static void mend_chunks(uint8_t *data, size_t size)
{
  enum { SIGNATURE = 8, AROUND = 12 };
  for (size_t at = SIGNATURE; at + AROUND <= size;) {
    const uint32_t length = big_endian(data + at);
    if (length > size - at - AROUND) break;
    const uint32_t crc = sf_crc32(0, data + at + 4, length + 4);
    for (uint32_t i = 0; i < 4; i++) data[at + 8 + length + i] = (uint8_t)(crc >> (24 - 8 * i));
    at += AROUND + length;
  }
}

static const char *mended(const uint8_t *data, size_t size)
{
  if (size < 8 || memcmp(data, "\x89PNG\r\n\x1a\n", 8) != 0) return fuzz_file(data, size);
  uint8_t *copy = malloc(size);
  FUZZ_EXPECT(copy);
  memcpy(copy, data, size);
  mend_chunks(copy, size);
  const char *path = fuzz_file(copy, size);
  free(copy);
  return path;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_image image;
  if (!fuzz_good(sf_image_load(&image, mended(data, size)))) {
    FUZZ_EXPECT(!image.rgba);
    return 0;
  }
  FUZZ_EXPECT(image.width > 0 && image.height > 0);
  fuzz_touch(image.rgba, (size_t)image.width * (size_t)image.height * 8);
  fuzz_good(sf_image_downscale(&image, 2, "input"));
  fuzz_touch(image.rgba, (size_t)image.width * (size_t)image.height * 8);
  sf_image_free(&image);
  return 0;
}
