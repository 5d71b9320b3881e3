/* transforms_*.json beside two small pictures, and the rays of the cameras that were accepted. */
#include "data_set.h"
#include "fuzz.h"
#include "base/io.h"
#include "scene/scene.h"

static void put_picture(const char *name, int width, int height)
{
  char path[300];
  uint16_t pixel[64 * 4] = {0};
  snprintf(path, sizeof path, "%s/%s", fuzz_folder(), name);
  FUZZ_EXPECT(fuzz_good(sf_image_save_png(&(sf_image){width, height, pixel}, path)));
}

/* Two data sets whose list of views is the fuzzer's input: Blender's, and instant-ngp's, whose scene has to be placed
 * where the list does not say it. Neither has a list for tests. */
enum { SETS = 2 };
static const char *make_data_set(int which, const char *input)
{
  static const char *const folder[SETS] = {"data", "cube"}, *const list[SETS] = {"transforms_train", "transforms"};
  static char data[SETS][300];
  char path[340];
  if (data[which][0]) return data[which];
  snprintf(data[which], sizeof data[which], "%s/%s", fuzz_folder(), folder[which]);
  FUZZ_EXPECT(fuzz_good(sf_make_dir(data[which])));
  snprintf(path, sizeof path, "%s/a.png", folder[which]), put_picture(path, 4, 3);
  snprintf(path, sizeof path, "%s/b.png", folder[which]), put_picture(path, 8, 6);
  put_picture("c.png", 4, 3);
  snprintf(path, sizeof path, "%s/%s.json", data[which], list[which]);
  FUZZ_EXPECT(!symlink(input, path));
  return data[which];
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  static const char *const split[] = {"train", "test"};
  const char *input = fuzz_file(data, size);
  for (int i = 0; i < 2 * SETS; i++) {
    sf_dataset set;
    const sf_dataset_options options = {.downscale = 1 + i / 2, .limit = 16};
    if (!fuzz_good(sf_dataset_load(&set, make_data_set(i / 2, input), split[i % 2], &options))) {
      FUZZ_EXPECT(!set.view);
      continue;
    }
    FUZZ_EXPECT(set.count > 0 && set.count <= 16);
    fuzz_use_views(&set);
    FUZZ_EXPECT(fuzz_good(sf_dataset_survey(&set)));
    sf_dataset_free(&set);
  }
  return 0;
}
