/* The Verilated accelerator in a test: its end, its registers. */
#ifndef SF_TESTS_DUT_FIXTURE_H
#define SF_TESTS_DUT_FIXTURE_H
#include "base/rng.h"
#include "quant/quant.h"
#include "sim/ray/ray.h"
#include "sim/sim.h"
#include "ck_run.h"

static inline void sf_dut_free(sf_dut **dut)
{
  sf_dut_close(*dut);
}

static inline void sf_ray_dut_free(sf_ray_dut **rays)
{
  sf_ray_dut_close(*rays);
}

static inline uint32_t get(sf_dut *dut, uint32_t offset)
{
  const uint32_t value = dut->bus.read(dut->bus.context, offset);
  ck_assert_uint_eq(dut->out.rresp, 0);
  return value;
}

static inline void put(sf_dut *dut, uint32_t offset, uint32_t value)
{
  dut->bus.write(dut->bus.context, offset, value);
}
/* Ray i of a seed: from anywhere near the box towards its middle. */
static inline fx_ray random_ray(const fx_scene *scene, uint64_t seed, uint64_t i)
{
  float origin[3], direction[3];
  fx_ray ray;
  for (uint64_t a = 0; a < 3; a++) {
    origin[a] = 6 * sf_random_float(seed, 1, 3 * i + a) - 3;
    direction[a] = 1.6f * sf_random_float(seed, 2, 3 * i + a) - 0.8f - origin[a];
  }
  ck_ok(sf_fx_ray_make(scene, origin, direction, &ray));
  return ray;
}
#endif
