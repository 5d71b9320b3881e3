/* Small trainings of TensoRF. */
#ifndef SF_TESTS_VM_FIXTURE_H
#define SF_TESTS_VM_FIXTURE_H
#include "train_fixture.h"
#include "train/vm.h"

static inline sf_train_options small_vm(sf_net_kind net)
{
  sf_train_options o = sf_train_defaults_tensorf(&data);
  o.config.net = net;
  o.config.steps = net == SF_NET_ANN ? 1 : T;
  o.config.hidden = 32;
  o.config.occ_res = 16;
  o.voxels = 24;
  o.rays = 128;
  o.samples = 4096;
  o.stage1 = 12;
  o.stage2 = 28;
  for (int a = 0; a < 3; a++) o.config.tensorf.resolution[a] = 16;
  return o;
}

/* A ball of density in the field, so that there is something to mask: the first component of mode 0 is a smooth bump
 * on the plane and along the line. */
static inline void put_ball(sf_model *m)
{
  const sf_tensorf *f = &m->config.tensorf;
  memset(m->value, 0, m->param[SF_P_APP_PLANE].offset * sizeof(float));
  float *plane = sf_model_param(m, SF_P_DENSITY_PLANE), *line = sf_model_param(m, SF_P_DENSITY_LINE);
  for (int y = 0; y < f->resolution[1]; y++)
    for (int x = 0; x < f->resolution[0]; x++) {
      const float u = (float)x / (float)(f->resolution[0] - 1) - 0.45f,
                  v = (float)y / (float)(f->resolution[1] - 1) - 0.5f;
      plane[((size_t)y * f->resolution[0] + x) * 16] = 30 * expf(-40 * (u * u + v * v));
    }
  for (int z = 0; z < f->resolution[2]; z++) {
    const float w = (float)z / (float)(f->resolution[2] - 1) - 0.55f;
    line[(size_t)z * 16] = expf(-40 * w * w);
  }
}
#endif
