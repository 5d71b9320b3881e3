/* poses_bounds.npy beside small pictures. */
#include "fuzz.h"
#include "base/io.h"
#include "scene/scene.h"
#include "data_set.h"
#include <math.h>

static const char *make_data_set(const char *input)
{
  static char data[300];
  char path[400];
  if (data[0]) return data;
  snprintf(data, sizeof data, "%s/data", fuzz_folder());
  snprintf(path, sizeof path, "%s/images_2", data);
  FUZZ_EXPECT(fuzz_good(sf_make_dir(path)));
  for (int v = 0; v < 4; v++) {
    uint16_t pixel[8 * 6 * 4] = {0};
    snprintf(path, sizeof path, "%s/images_2/p%02d.png", data, v);
    FUZZ_EXPECT(fuzz_good(sf_image_save_png(&(sf_image){8, 6, pixel}, path)));
  }
  snprintf(path, sizeof path, "%s/poses_bounds.npy", data);
  FUZZ_EXPECT(!symlink(input, path));
  return data;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_dataset set;
  const char *folder = make_data_set(fuzz_file(data, size));
  if (!fuzz_good(sf_dataset_load(&set, folder, "train", &(sf_dataset_options){.downscale = 2}))) {
    FUZZ_EXPECT(!set.view && !set.warning);
    return 0;
  }
  fuzz_use_views(&set);
  FUZZ_EXPECT(fuzz_good(sf_dataset_survey(&set)));
  sf_dataset_free(&set);
  return 0;
}
