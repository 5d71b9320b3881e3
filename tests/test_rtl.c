/* The accelerator against the fixed-point core, bit for bit: outputs, spikes, membranes, rows, counters. Random nets,
 * tables, streams; the hard cases are in test_rtl_hard.c. */
#include "ck_run.h"
#include "tests/rtl_fixture.h"

LOOP_TEST(trained_size_nets, 3)
{
  random_source r = {(uint64_t)_i + 100, 0};
  random_net_make(&net_of_test, &r, false);
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, r.seed, _i * 30);
  for (int i = 0; i < 8; i++) {
    draw_batch(&shared, &r, BATCH, false);
    run_batch(dut, &net_of_test.net, BATCH, &counts, r.seed);
  }
  same_counts(dut, &counts, r.seed);
  ck_assert_uint_gt(counts.layer[FX_D1].spikes[0], 0); /* the case is not an empty one */
  ck_assert_uint_gt(counts.layer[FX_C1].spikes[1], 0);
  ck_assert_uint_gt(counts.layer[FX_C2].spikes[1], 0);
}

/* A net whose time does not hang on the streams: with stalls the model is within a hundredth. */
TEST(stalls_hide_behind_the_engine)
{
  typical(77);
  fx_counts counts = {0}, actual;
  uint64_t cycles, busy, stalls;
  random_source r = {78, 0};
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 5, 20);
  draw_batch(&shared, &r, BATCH, false);
  run_batch(dut, &net_of_test.net, BATCH, &counts, r.seed);
  ck_ok(sf_dut_counts(dut, &actual, &cycles, &busy, &stalls));
  const double model = (double)modelled_cycles(&net_of_test.net, BATCH).cycles;
  ck_assert_double_eq_tol((double)cycles, model, 0.01 * model);
}

static void compare_cycles(random_source *r, int n, bool extreme)
{
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, r->seed, 0);
  draw_batch(&shared, r, n, extreme);
  run_batch(dut, &net_of_test.net, n, &counts, r->seed);
  same_cycles(dut, &net_of_test.net, n, r->seed);
}

static void check_cycles(uint64_t seed, int n, bool extreme)
{
  random_source r = {seed, 0};
  random_net_make(&net_of_test, &r, extreme);
  compare_cycles(&r, n, extreme);
}

/* While the streams never make it wait the model is exact, and so are each layer's busy cycles and the stalls. */
LOOP_TEST(cycles_are_those_of_the_model, 6)
{
  for (uint64_t i = 0; i < 4; i++) check_cycles(5000 + (uint64_t)_i * 4 + i, BATCH, _i > 0);
}

/* Between two layers nothing else is at work: a cycle in which the accelerator takes itself for idle is missing. */
LOOP_TEST(cycles_of_a_sample_alone, 6)
{
  for (uint64_t i = 0; i < 8; i++) check_cycles(5100 + (uint64_t)_i * 8 + i, 1, _i > 0);
}

/* C1's h comes once, and C2 has turns that fire nothing. */
LOOP_TEST(cycles_of_radix, SF_T_MAX)
{
  for (uint64_t i = 0; i < 4; i++) {
    random_source r = {5200 + (uint64_t)_i * 4 + i, 0};
    random_net_make(&net_of_test, &r, true);
    net_of_test.net.mode = FX_RADIX, net_of_test.net.steps = _i + 1;
    random_net_limit(&net_of_test.net);
    compare_cycles(&r, i % 2 ? BATCH : 1, true);
  }
}

LOOP_TEST(extreme_nets, 25)
{
  for (uint64_t i = 0; i < 16; i++) {
    random_source r = {1000 + (uint64_t)_i * 16 + i, 0};
    random_net_make(&net_of_test, &r, true);
    check_net(&net_of_test.net, &r, 24, true, (int)draw(&r, 0, 3) * 25);
  }
}

/* Every mode with every number of steps, at the ends of the leak. */
LOOP_TEST(modes_and_steps, 4)
{
  static const int32_t leak[] = {0, 1, 2048, 4095, 4096};
  random_source r = {2000 + (uint64_t)_i, 0};
  random_net_make(&net_of_test, &r, false);
  fx_net *net = &net_of_test.net;
  net->mode = _i;
  for (int steps = 1; steps <= SF_T_MAX; steps++) {
    net->steps = steps;
    for (int l = 0; l < SF_LAYERS; l++) net->layer[l].k = leak[(steps + l) % 5];
    check_net(net, &r, 4, true, 10);
  }
}

static void tiny_net(random_net *n)
{
  memset(n, 0, sizeof *n);
  bind_weights(n);
  net_sizes(&n->net, 2, 1, 1, 1, 1, 1);
  n->net.steps = 1;
  for (int l = 0; l < SF_LAYERS; l++)
    n->net.layer[l].theta = l == FX_D2 || l == FX_C3 ? 0 : 1, n->net.layer[l].k = 2048;
  n->weights[FX_D1][0] = 100;
  n->weights[FX_C1][0] = 50;
  n->weights[FX_C2][0] = 3;
  n->net.exp_in = (fx_scale){1, 0, 0};
  n->net.sigmoid_in = (fx_scale){1, 0, 0};
}

/* The argument of a table is its bias when the multiplier is 0: both tables over their range, ends included. */
TEST(tables)
{
  tiny_net(&net_of_test);
  fx_net *net = &net_of_test.net;
  OWNED(sf_dut) *dut = open_dut(net, 9, 0);
  static const int32_t ends[] = {-131072, -131071, -57345, -57344, -53249, -53248, -4096, -1,    0,      1,      15,
                                 16,      65535,   65536,  131071, 49152,  49151,  53247, 53248, -32768, -32767, 32767};
  random_source r = {77, 0};
  memset(&shared, 0, sizeof shared);
  shared.sample[0] = (sf_dut_sample){&shared.ray[0], true, shared.f[0]};
  for (int i = 0; i < 150; i++) {
    const bool listed = i < (int)(sizeof ends / sizeof *ends);
    net->exp_in = (fx_scale){0, 3, listed ? ends[i] : (int32_t)draw(&r, -62000, 67000)};
    net->sigmoid_in = (fx_scale){0, 31, listed ? ends[i] : (int32_t)draw(&r, -33000, 33000)};
    fx_counts counts = {0};
    ck_ok(sf_dut_load(dut, net));
    run_batch(dut, net, 1, &counts, (uint64_t)i);
  }
}

/* ---- streams ---- */

/* Nobody takes a result for a long time: input stops being accepted, nothing is lost. */
TEST(long_back_pressure)
{
  typical(43);
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 3, 0);
  uint64_t words[SF_PACKET_MAX];
  int accepted = 0;
  expect_core(&shared, &net_of_test.net, BATCH, &counts);
  for (int i = 0; i < BATCH; i++) {
    const int beats = sf_dut_packet(&net_of_test.net, &shared.sample[i], words);
    int beat = 0;
    for (int cycle = 0; beat < beats && cycle < 3000; cycle++) {
      dut->in.s_valid = true;
      dut->in.s_data = words[beat];
      dut->in.s_user = beat == 0 && shared.sample[i].first;
      dut->in.s_last = beat == beats - 1;
      sf_dut_tick(dut);
      if (dut->out.s_ready) beat++;
    }
    if (beat < beats) break;
    accepted++;
  }
  ck_assert_int_ge(accepted, 3);
  ck_assert_int_lt(accepted, 20); /* it has only so many buffers */
  dut->in.m_ready = true;
  for (int i = 0, beat = 0, cycle = 0; i < accepted; cycle++) {
    ck_assert_int_lt(cycle, 100000);
    dut->in.s_valid = false;
    sf_dut_tick(dut);
    if (!dut->out.m_valid) continue;
    const uint64_t first = (uint64_t)shared.out[i].colour[0] << 32 | shared.out[i].sigma;
    const uint64_t second = (uint64_t)shared.out[i].colour[2] << 32 | shared.out[i].colour[1];
    ck_assert_uint_eq(dut->out.m_data, beat ? second : first);
    ck_assert_int_eq(dut->out.m_last, beat);
    i += beat;
    beat = !beat;
  }
}
