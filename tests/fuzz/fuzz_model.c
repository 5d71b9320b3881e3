/* The float model: loading, and two rays through what was accepted. */
#include "fuzz.h"
#include "mutate_header.h"
#include "snn/model.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  static const float origin[6] = {0, 0, 3, 0.5f, -2, 0.25f}, direction[6] = {0, 0, -1, 0, 1, 0}, white[3] = {1, 1, 1};
  sf_model model;
  float rgb[6], depth[2], alpha[2], samples[2];
  if (!fuzz_good(sf_model_load(&model, fuzz_file(data, size)))) {
    FUZZ_EXPECT(!model.value && !model.occupancy);
    return 0;
  }
  FUZZ_EXPECT(fuzz_good(sf_config_check(&model.config)));
  FUZZ_EXPECT(model.t_r >= 1 && model.t_r <= model.config.steps);
  fuzz_good(sf_render_rays(&model, origin, direction, 2, 0, white, rgb, depth, alpha, samples));
  sf_model_free(&model);
  return 0;
}
