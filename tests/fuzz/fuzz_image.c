/* PNG and JPEG pictures of a data set. */
#include "fuzz.h"
#include "spikefield/image.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_image image;
  if (!fuzz_good(sf_image_load(&image, fuzz_file(data, size)))) {
    FUZZ_EXPECT(!image.rgba);
    return 0;
  }
  FUZZ_EXPECT(image.width > 0 && image.height > 0);
  fuzz_touch(image.rgba, (size_t)image.width * (size_t)image.height * 8);
  fuzz_good(sf_image_downscale(&image, 2, "input"));
  sf_image_free(&image);
  return 0;
}
