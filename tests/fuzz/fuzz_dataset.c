/* transforms_*.json beside two small pictures, and the rays of the cameras that were accepted. */
#include "data_set.h"
#include "fuzz.h"
#include "spikefield/io.h"
#include "spikefield/scene.h"

static void put_picture(const char *name, int width, int height)
{
  char path[300];
  uint16_t pixel[64 * 4] = {0};
  snprintf(path, sizeof path, "%s/%s", fuzz_folder(), name);
  FUZZ_EXPECT(fuzz_good(sf_image_save_png(&(sf_image){width, height, pixel}, path)));
}

/* transforms_train.json is the fuzzer's input; there is no transforms_test.json. */
static const char *make_data_set(const char *input)
{
  static char data[300];
  char path[340];
  if (data[0]) return data;
  snprintf(data, sizeof data, "%s/data", fuzz_folder());
  FUZZ_EXPECT(fuzz_good(sf_make_dir(data)));
  put_picture("data/a.png", 4, 3);
  put_picture("data/b.png", 8, 6);
  put_picture("c.png", 4, 3);
  snprintf(path, sizeof path, "%s/transforms_train.json", data);
  FUZZ_EXPECT(!symlink(input, path));
  return data;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  static const char *const split[] = {"train", "test"};
  const char *folder = make_data_set(fuzz_file(data, size));
  for (int i = 0; i < 2; i++) {
    sf_dataset set;
    if (!fuzz_good(sf_dataset_load(&set, folder, split[i], &(sf_dataset_options){.downscale = 1, .limit = 16}))) {
      FUZZ_EXPECT(!set.view);
      continue;
    }
    FUZZ_EXPECT(set.count > 0 && set.count <= 16);
    fuzz_use_views(&set);
    sf_dataset_free(&set);
  }
  return 0;
}
