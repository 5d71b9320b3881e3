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

enum { PLACES = 512 /* of the window of counters: a cycle for each of them */ };

static inline void wait_for_walk(sf_dut *dut)
{
  for (const uint64_t begin = dut->cycle; get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS;)
    ck_assert_uint_lt(dut->cycle, begin + 4 * PLACES);
}

/* Beats of a ray, again and again, for so many cycles; every pixel is taken. */
static inline void cut_off(sf_dut *dut, const sf_ray_request *q, int cycles)
{
  for (int at = 0; cycles-- > 0;) {
    const sf_ray_beat beat = sf_ray_beat_of(q, at % q->n);
    dut->in.ray_valid = true, dut->in.pixel_ready = true;
    dut->in.ray_user = at % q->n == 0, dut->in.ray_last = at % q->n == q->n - 1;
    memcpy(dut->in.ray_data, beat.data, sizeof beat.data);
    dut->in.ray_data[3] |= (uint64_t)1 << 49; /* of a new tile: there is something to ask for */
    sf_dut_tick(dut);
    at += dut->out.ray_ready;
  }
  dut->in.ray_valid = dut->in.pixel_ready = false;
}

/* No first sample, or two of them; then what is discarded: how many of so many cycles take a beat. */
static inline int beats_out_of_order(sf_dut *dut, bool user, int cycles)
{
  int discarded = 0;
  for (int beat = 0; beat <= user; beat++) {
    dut->in.ray_valid = true, dut->in.ray_user = user, dut->in.ray_last = false;
    do sf_dut_tick(dut);
    while (!dut->out.ray_ready);
  }
  for (int i = 0; i < cycles; i++) {
    sf_dut_tick(dut);
    discarded += dut->out.ray_ready;
  }
  dut->in.ray_valid = false;
  ck_assert_uint_eq(get(dut, SF_CSR_RAY_ERROR), SF_CSR_RAY_ERROR_ORDER);
  ck_assert(dut->out.irq);
  return discarded;
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
