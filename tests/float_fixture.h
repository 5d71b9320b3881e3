/* A small random model and random inputs for the tests of the float part. */
#ifndef SF_TESTS_FLOAT_FIXTURE_H
#define SF_TESTS_FLOAT_FIXTURE_H
#include "snn/model.h"
#include "base/rng.h"
#include <math.h>

static inline float test_random(uint64_t index)
{
  return 2 * sf_random_float(7, 1, index) - 1;
}

/* gain spreads the weights so that neurons fire. */
static inline sf_model test_model(sf_net_kind net, sf_input_mode mode, int hidden, int steps, float gain)
{
  sf_config c = sf_config_default();
  c.net = net;
  c.mode = mode;
  c.hidden = hidden;
  c.steps = net == SF_NET_ANN ? 1 : steps;
  c.levels = 4;
  c.log2_hash = 9;
  c.base_res = 4;
  c.finest_res = 32;
  c.occ_res = 8;
  c.lattice = 64;
  sf_model m;
  if (sf_model_create(&m, &c).code) return (sf_model){0};
  for (size_t i = 0; i < m.size; i++) m.value[i] = gain * test_random(i);
  for (int i = 0; i < SF_LAYERS; i++) sf_model_param(&m, SF_P_LEAK)[i] = 0.4f * test_random(1u << 20 | i);
  return m;
}
/* Instruction sets, and how far their backward passes may be from the portable one: contracted multiply-adds over 8
 * steps and 64 lanes; the surrogate's 2^-14 with AVX-512; with bfloat16 operands, a relative rounding of 2^-9 in each
 * of the three products in a row, of random sign. */
static const struct {
  const char *isa;
  float bound;
} backward_bounds[] = {{"avx2", 2e-5f}, {"avx512", 1e-4f}, {"avx512bf16", 1e-2f}, {"amx", 1e-2f}};

/* Largest difference relative to the largest magnitude of the reference. */
static inline float distance(const float *a, const float *reference, size_t n)
{
  float worst = 0, scale = 0;
  for (size_t i = 0; i < n; i++) {
    worst = fmaxf(worst, fabsf(a[i] - reference[i]));
    scale = fmaxf(scale, fabsf(reference[i]));
  }
  return worst / scale;
}
#endif
