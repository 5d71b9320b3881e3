/* A small random TensoRF model. */
#ifndef SF_TESTS_TENSORF_FIXTURE_H
#define SF_TESTS_TENSORF_FIXTURE_H
#include "float_fixture.h"
#include <string.h>

/* ndc: components 16,4,4 / 48,12,12, 30 inputs, ReLU; else 16 / 48, 150 inputs, softplus. */
static inline sf_model test_tensorf(sf_net_kind net, int ndc, int hidden, int steps)
{
  sf_config c = sf_tensorf_default(2 / 3.0f, ndc);
  static const int32_t resolution[3] = {9, 7, 12};
  c.net = net;
  c.hidden = hidden;
  c.steps = net == SF_NET_ANN ? 1 : steps;
  c.occ_res = 8;
  for (int i = 0; i < 3; i++) c.tensorf.resolution[i] = resolution[i];
  sf_model m;
  if (sf_model_create(&m, &c).code) return (sf_model){0};
  for (int id = 0, n = 0; id < SF_P_COUNT; id++) {
    const sf_param *p = &m.param[id];
    if (!p->name) continue;
    const float gain = id < SF_P_BASIS ? 0.5f : id == SF_P_C3 ? 0.3f : id == SF_P_C1 ? 0.4f : 0.25f;
    for (size_t i = 0; i < p->size; i++) m.value[p->offset + i] = gain * test_random(((uint64_t)n << 32) + i);
    n++;
  }
  for (int i = 0; i < SF_LAYERS; i++) sf_model_param(&m, SF_P_LEAK)[i] = 0.4f * test_random(1u << 20 | i);
  return m;
}

/* Smooth blobs: what training makes is smooth, too. */
static inline void test_smooth(sf_model *m)
{
  for (int id = SF_P_DENSITY_PLANE; id < SF_P_BASIS; id++) {
    const sf_param *p = &m->param[id];
    const int at = id - SF_P_DENSITY_PLANE, n = (int)p->shape[p->dims - 1], width = (int)p->shape[p->dims - 2],
              height = p->dims == 3 ? (int)p->shape[0] : 1;
    float *value = sf_model_param(m, id);
    for (int c = 0; c < n; c++) {
      const float u = 3 * test_random((uint64_t)(at * 997 + c)), v = 3 * test_random((uint64_t)(at * 991 + c + 500)),
                  phase = 3 * test_random((uint64_t)(at * 983 + c + 900)), size = id < SF_P_APP_PLANE ? 1.6f : 1;
      for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
          value[(y * width + x) * n + c] =
              size * cosf(u * (float)x / (float)width * 3 + v * (float)y / (float)height * 3 + phase);
    }
  }
}

static inline sf_model test_smooth_tensorf(int ndc)
{
  sf_model m = test_tensorf(SF_NET_SNN, ndc, 64, 4);
  sf_config c = m.config;
  for (int i = 0; i < 3; i++) c.tensorf.resolution[i] = 24 + 4 * i;
  c.tensorf.shift = ndc ? 0 : -3;
  c.tensorf.distance_scale = ndc ? 1 : 6;
  sf_model larger;
  if (sf_model_create(&larger, &c).code) return (sf_model){0};
  for (int id = SF_P_BASIS; id < SF_P_COUNT; id++)
    memcpy(sf_model_param(&larger, id), sf_model_param(&m, id), larger.param[id].size * sizeof(float));
  test_smooth(&larger);
  larger.t_r = 3;
  sf_model_free(&m);
  return larger;
}
#endif
