/* A small random TensoRF model. */
#ifndef SF_TESTS_TENSORF_FIXTURE_H
#define SF_TESTS_TENSORF_FIXTURE_H
#include "float_fixture.h"

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
#endif
