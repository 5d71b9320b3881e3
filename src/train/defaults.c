/* What a training does where its options say nothing. */
#include "field/field.h"
#include "train/internal.h"
#include <math.h>

sf_train_options sf_train_defaults(void)
{
  sf_train_options options = {.config = sf_config_default(),
                              .beta = 5e-7,
                              .alpha = 1e-6,
                              .search_rate = 1,
                              .opaque = 0.5,
                              .undecoded = 0.01,
                              .near_camera = 0.5,
                              .distortion = 0.001,
                              .stage1 = 2500,
                              .stage2 = 7500,
                              .seed = 1,
                              .samples = 1 << 14,
                              .lr_grid = 1e-2,
                              .lr_net = 5e-3};
  for (int i = 0; i < 3; i++) options.config.theta[i] = 0.25f;
  options.config.mode = SF_RADIX;
  return options;
}

/* TensoRF's 2 and 6 world units are for cameras 4 away; nearer and farther ones see as much of the box. */
static void see_all(sf_tensorf *f, const sf_dataset *data)
{
  const float half = 2 * data->scale, least = fminf(f->near, (float)SF_NEAR);
  for (int v = 0; v < data->count; v++) {
    const float *m = data->view[v].camera.to_world, d = sqrtf(m[3] * m[3] + m[7] * m[7] + m[11] * m[11]);
    f->near = fmaxf(fminf(f->near, d - half), least);
    f->far = fmaxf(f->far, d + half);
  }
}

sf_train_options sf_train_defaults_tensorf(const sf_dataset *data)
{
  sf_train_options options = sf_train_defaults();
  const int width = data->count ? data->view[0].camera.width : 800;
  const sf_input_mode mode = options.config.mode;
  options.config = sf_tensorf_default(data->scale, data->ndc);
  options.config.mode = mode;
  if (data->layout != SF_LAYOUT_BLENDER && !data->ndc) sf_tensorf_bound(&options.config, data->bound);
  if (data->layout == SF_LAYOUT_BLENDER) see_all(&options.config.tensorf, data);
  options.lr_grid = 0.02;
  if (!data->ndc) options.lr_net = 1e-3; /* a decoder without encodings learns with the rate of the hash grid's nets */
  options.background = data->ndc ? 0 : 1;
  options.rays = 4096;
  options.samples = 1 << 15; /* many small iterations learn faster than few large ones */
  /* TensoRF's grids are for pictures of 800 and 1008 pixels; finer ones than the pixels cost time alone. */
  options.voxels = data->ndc ? 640 * width / 1008 : width / 2;
  options.voxels = options.voxels > (data->ndc ? 640 : 300) ? (data->ndc ? 640 : 300) : options.voxels;
  return options;
}
