/* For the tests of the accelerator: batches of samples through the core and through the hardware, compared. */
#ifndef SF_TESTS_RTL_FIXTURE_H
#define SF_TESTS_RTL_FIXTURE_H
#include "sim/compare.h"
#include "cycles/cycles.h"
#include "tests/dut_fixture.h"
#include "tests/random_net.h"

enum { BATCH = 64, RAYS_PER_BATCH = 8 };

typedef struct batch {
  fx_ray ray[BATCH];
  int16_t f[BATCH][SF_DIR_MAX];
  sf_dut_sample sample[BATCH];
  fx_trace trace[BATCH];
  fx_out out[BATCH];
  sf_dut_result result[BATCH];
  sf_dut_trace dut_trace[BATCH];
} batch;
static batch shared; /* each test runs in a process of its own */
static random_net net_of_test;

static inline sf_dut *open_with(const sf_dut_options *options, const fx_net *net)
{
  const fx_scene scene = {.net = *net};
  sf_dut *dut;
  ck_ok(sf_dut_open(&dut, &scene, options));
  return dut;
}

static inline sf_dut *open_dut(const fx_net *net, uint64_t seed, int stalls)
{
  return open_with(&(sf_dut_options){.seed = seed, .stall_percent = stalls}, net);
}

static inline void draw_batch(batch *b, random_source *r, int n, bool extreme)
{
  for (int i = 0; i < n; i++) {
    draw_values(r, b->ray[i].dir, FX_SH, extreme);
    draw_values(r, b->f[i], SF_DIR_MAX, extreme);
    b->sample[i] = (sf_dut_sample){&b->ray[i], i == 0 || draw(r, 0, BATCH / RAYS_PER_BATCH - 1) == 0, b->f[i]};
  }
}

static inline void expect_core(batch *b, const fx_net *net, int n, fx_counts *counts)
{
  int32_t base[SF_LANES] = {0};
  for (int i = 0; i < n; i++) {
    fx_net_next(net, b->ray[i].dir, b->sample[i].first, b->f[i], base, &b->out[i], &b->trace[i], counts);
  }
}

static inline void same_samples(const batch *b, const fx_net *net, int n, uint64_t seed)
{
  for (int i = 0; i < n; i++) {
    sf_difference d;
    const bool same = sf_compare_sample(net, &b->trace[i], &b->out[i], &b->result[i], &b->dut_trace[i], &d);
    ck_assert_msg(same, "seed %llu sample %d: layer %d step %d neuron %d %s: expected %lld, actual %lld, cycle %llu",
                  (unsigned long long)seed, i, d.layer, d.step, d.neuron, d.wire, (long long)d.expected,
                  (long long)d.actual, (unsigned long long)d.cycle);
  }
}

static inline void same_counts(sf_dut *dut, const fx_counts *expected, uint64_t seed)
{
  fx_counts actual;
  sf_difference d;
  uint64_t cycles, busy, stalls;
  ck_ok(sf_dut_counts(dut, &actual, &cycles, &busy, &stalls));
  ck_assert_msg(sf_compare_counts(expected, &actual, 0, &d),
                "seed %llu: layer %d step %d %s: expected %lld, actual %lld", (unsigned long long)seed, d.layer, d.step,
                d.wire, (long long)d.expected, (long long)d.actual);
  ck_assert_uint_le(busy, cycles);
}

/* Runs the batch and adds its events to *counts. */
static inline void run_batch(sf_dut *dut, const fx_net *net, int n, fx_counts *counts, uint64_t seed)
{
  expect_core(&shared, net, n, counts);
  ck_ok(sf_dut_run_traced(dut, shared.sample, n, shared.result, shared.dut_trace));
  same_samples(&shared, net, n, seed);
}

/* What the cycle model says of the first n samples of the batch that was run. */
static inline sf_cycle_totals modelled_cycles(const fx_net *net, int n)
{
  sf_cycle_model *model = sf_cycle_model_create(net, &sf_engine_default);
  ck_assert_ptr_nonnull(model);
  for (int i = 0; i < n; i++) {
    const sf_cycle_sample shape = sf_cycle_sample_make(net, &shared.trace[i], shared.sample[i].first);
    sf_cycle_model_add(model, &shape);
  }
  sf_cycle_model_drain(model);
  const sf_cycle_totals totals = *sf_cycle_model_totals(model);
  ck_assert_uint_eq(totals.samples, (uint64_t)n);
  sf_cycle_model_free(model);
  return totals;
}

/* Every counter of time, of a run whose streams never made it wait. */
static inline void same_cycles(sf_dut *dut, const fx_net *net, int n, uint64_t seed)
{
  const sf_cycle_totals model = modelled_cycles(net, n);
  sf_driver_counters c;
  ck_assert_int_eq(sf_driver_read_counters(&dut->bus, &c), SF_DRIVER_OK);
  ck_assert_msg(c.cycles == model.cycles, "seed %llu: %llu cycles, the model's are %llu", (unsigned long long)seed,
                (unsigned long long)c.cycles, (unsigned long long)model.cycles);
  ck_assert_uint_eq(c.busy, model.any_busy);
  ck_assert_uint_eq(c.stall_in, model.waits);
  ck_assert_uint_eq(c.stall_out, model.stalls);
  for (int l = 0; l < SF_LAYERS; l++) ck_assert_uint_eq(c.layer_busy[l], model.busy[l]);
}

static inline void check_net(const fx_net *net, random_source *r, int n, bool extreme, int stalls)
{
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(net, r->seed, stalls);
  draw_batch(&shared, r, n, extreme);
  run_batch(dut, net, n, &counts, r->seed);
  same_counts(dut, &counts, r->seed);
}

static inline void typical(uint64_t seed)
{
  random_source r = {seed, 0};
  random_net_make(&net_of_test, &r, false);
  draw_batch(&shared, &r, BATCH, false);
}

#endif
