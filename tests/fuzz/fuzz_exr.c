/* EXR images. */
#include "fuzz.h"
#include "image/image.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  int width, height, n;
  sf_exr_channel *channel;
  if (!fuzz_good(sf_exr_load(fuzz_file(data, size), &width, &height, &channel, &n))) {
    FUZZ_EXPECT(!channel);
    return 0;
  }
  FUZZ_EXPECT(width > 0 && height > 0 && n > 0);
  for (int i = 0; i < n; i++) {
    FUZZ_EXPECT(strlen(channel[i].name) < sizeof channel[i].name);
    fuzz_touch(channel[i].data, (size_t)width * (size_t)height * 4);
  }
  sf_exr_free(channel, n);
  return 0;
}
