/* transforms_*.json beside two small pictures, and the rays of the cameras that were accepted. */
#include "fuzz.h"
#include "spikefield/io.h"
#include "spikefield/model.h"
#include "spikefield/scene.h"
#include <math.h>

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

static void use_rays(const sf_dataset *data)
{
  const sf_config config = sf_config_default();
  sf_steps steps;
  FUZZ_EXPECT(sf_steps_make(&steps, &config, 1).code == SF_OK);
  for (int i = 0; i < data->count; i++) {
    const sf_camera *camera = &data->view[i].camera;
    for (int corner = 0; corner < 4; corner++) {
      float origin[3], direction[3];
      sf_camera_ray(camera, corner & 1 ? 0.5f : (float)camera->width - 0.5f,
                    corner & 2 ? 0.5f : (float)camera->height - 0.5f, origin, direction);
      for (int a = 0; a < 3; a++) FUZZ_EXPECT(isfinite(origin[a]) && isfinite(direction[a]));
      const sf_lattice lattice = sf_ray_lattice(&steps, origin, direction);
      FUZZ_EXPECT(lattice.count >= 0 && lattice.count <= config.lattice);
    }
  }
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
    use_rays(&set);
    sf_dataset_free(&set);
  }
  return 0;
}
