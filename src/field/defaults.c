/* Configurations to begin with. */
#include "field/model.h"

sf_config sf_config_default(void)
{
  return (sf_config){.net = SF_NET_SNN,
                     .mode = SF_HYBRID,
                     .steps = SF_T_MAX,
                     .levels = 16,
                     .log2_hash = 19,
                     .base_res = 16,
                     .finest_res = 2048,
                     .hidden = 128,
                     .theta = {1, 1, 1},
                     .scale = 0.8f,
                     .lattice = 1024,
                     .occ_res = 128,
                     .stop = 0.01,
                     .bound = 1};
}

void sf_config_bound(sf_config *c, int bound)
{
  c->bound = bound;
  c->dt_gamma = bound > 1 ? 1.0f / 128 : 0;
  c->finest_res = bound < 16 ? 2048 * bound : 32768;
}

sf_config sf_tensorf_default(float scale, int ndc)
{
  static const float half[3] = {1.5f, 1.67f, 1};
  sf_config c = sf_config_default();
  sf_tensorf *f = &c.tensorf;
  c.backbone = SF_TENSORF;
  c.scale = scale;
  for (int i = 0; i < 3; i++) {
    c.theta[i] = 0.5f;
    f->box[1][i] = (ndc ? half[i] : 1.5f) * scale;
    f->box[0][i] = -f->box[1][i];
    f->density[i] = ndc && i ? 4 : 16;
    f->appearance[i] = ndc && i ? 12 : 48;
  }
  f->features = 27;
  f->feature_freqs = f->view_freqs = ndc ? 0 : 2;
  f->activation = ndc ? SF_RELU : SF_SOFTPLUS;
  f->shift = ndc ? 0 : -10;
  f->distance_scale = 25 / scale;
  f->step_ratio = 0.5f;
  f->near = ndc ? 0 : 2 * scale;
  f->far = ndc ? 1e6f : 6 * scale;
  f->ndc = ndc;
  f->weight_stop = SF_WEIGHT_STOP_FIRST;
  sf_tensorf_resolution(f->box, 128 * 128 * 128, f->resolution);
  return c;
}

void sf_tensorf_bound(sf_config *c, int bound)
{
  sf_tensorf *f = &c->tensorf;
  for (int i = 0; i < 3; i++) f->box[1][i] = (float)bound, f->box[0][i] = -f->box[1][i];
  f->distance_scale = 25 * 1.5f / (float)bound;
  f->near = (float)SF_NEAR;
  f->far = 1e6f;
  sf_tensorf_resolution(f->box, 128 * 128 * 128, f->resolution);
}
