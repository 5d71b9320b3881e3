/* Resuming a training run, and one iteration of it. */
#include "fuzz.h"
#include "mutate_header.h"
#include "train/train.h"

static sf_dataset *one_view(void)
{
  static uint16_t pixel[4 * 4 * 4];
  static sf_view view = {.name = "view",
                         .camera = {.width = 4,
                                    .height = 4,
                                    .fx = 5,
                                    .fy = 5,
                                    .cx = 2,
                                    .cy = 2,
                                    .to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2.5f}},
                         .image = {4, 4, pixel}};
  static sf_dataset data = {.path = "data", .view = &view, .count = 1, .scale = 0.8f};
  for (size_t i = 0; i < sizeof pixel / sizeof *pixel; i++) pixel[i] = (uint16_t)(i * 977);
  return &data;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_train_options options = sf_train_defaults();
  sf_train_stats stats;
  sf_trainer *trainer;
  options.samples = 256;
  if (!fuzz_good(sf_trainer_create(&trainer, one_view(), &options, fuzz_file(data, size)))) {
    FUZZ_EXPECT(!trainer);
    return 0;
  }
  stats = sf_trainer_stats(trainer);
  FUZZ_EXPECT(stats.progress >= 0 && stats.progress <= 1 && stats.iteration >= 0);
  const sf_config *config = &sf_trainer_model(trainer)->config;
  const bool small = config->levels <= 2 && config->occ_res <= 16 && config->hidden <= 32;
  if (small && fuzz_good(sf_trainer_step(trainer, &stats)))
    FUZZ_EXPECT(stats.t_star >= 1 && stats.t_star <= config->steps && stats.t_r >= 1 && stats.t_r <= config->steps);
  sf_trainer_free(trainer);
  return 0;
}
