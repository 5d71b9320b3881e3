/* The Verilated accelerator in a test: its end, its registers. */
#ifndef SF_TESTS_DUT_FIXTURE_H
#define SF_TESTS_DUT_FIXTURE_H
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
#endif
