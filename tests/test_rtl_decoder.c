/* Decoders (C1, C2 and C3 alone, inputs with every sample) and biases on the accelerator against the fixed-point core,
 * bit for bit, and against the cycle model, in the build that runs the nets with densities. */
#include "ck_run.h"
#include "tests/rtl_fixture.h"

static const int inputs_of[] = {150, 30, SF_DIR_MAX, 1};
enum { SIZES = sizeof inputs_of / sizeof *inputs_of };

/* Runs the batch that was drawn, on a fresh accelerator without stalls: results, counters, cycles of the model. */
static void check_cycles(const fx_net *net, int n, uint64_t seed)
{
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(net, seed, 0);
  run_batch(dut, net, n, &counts, seed);
  same_counts(dut, &counts, seed);
  same_cycles(dut, net, n, seed);
  ck_assert_uint_ge(modelled_cycles(net, n).cycles, sf_cycles_least(net, &counts, &sf_engine_default));
}

LOOP_TEST(trained_size_decoders, SIZES)
{
  random_source r = {300 + (uint64_t)_i, 0};
  random_decoder_make(&net_of_test, &r, inputs_of[_i], false);
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, r.seed, _i * 25);
  for (int i = 0; i < 4; i++) {
    draw_batch(&shared, &r, BATCH, false);
    run_batch(dut, &net_of_test.net, BATCH, &counts, r.seed);
  }
  same_counts(dut, &counts, r.seed);
  ck_assert_uint_gt(counts.layer[FX_C1].spikes[1], 0); /* the case is not an empty one */
  if (inputs_of[_i] > 1) ck_assert_uint_gt(counts.layer[FX_C2].spikes[1], 0);
  ck_assert_uint_eq(counts.layer[FX_D1].updates[0] + counts.layer[FX_D2].special[0] + counts.rays, 0);
}

LOOP_TEST(extreme_decoders, 10)
{
  for (uint64_t i = 0; i < 16; i++) {
    random_source r = {1000 + (uint64_t)_i * 16 + i, 0};
    random_decoder_make(&net_of_test, &r, draw(&r, 0, 1) ? inputs_of[i % SIZES] : (int)draw(&r, 1, SF_DIR_MAX), true);
    check_net(&net_of_test.net, &r, 24, true, (int)draw(&r, 0, 3) * 25);
  }
}

/* Every mode with every number of steps, with each set of biases. */
LOOP_TEST(modes_steps_and_biases, 4)
{
  for (int steps = 1; steps <= SF_T_MAX; steps++)
    for (int biases = 0; biases < 8; biases++) {
      random_source r = {2000 + (uint64_t)(_i * 64 + steps * 8 + biases), 0};
      random_decoder_make(&net_of_test, &r, inputs_of[biases % 2], false);
      fx_net *net = &net_of_test.net;
      net->mode = _i, net->steps = steps;
      net->layer[FX_C1].bias = biases & 1 ? 2047 : 0;
      net->layer[FX_C2].bias = biases >> 1 & 1, net->layer[FX_C3].bias = biases >> 2;
      check_net(net, &r, 4, true, 10);
    }
}

LOOP_TEST(cycles_are_those_of_the_model, 4)
{
  for (uint64_t i = 0; i < 8; i++) {
    random_source r = {5000 + (uint64_t)_i * 8 + i, 0};
    random_decoder_make(&net_of_test, &r, _i ? (int)draw(&r, 1, SF_DIR_MAX) : inputs_of[i % SIZES], _i > 0);
    net_of_test.net.steps = (int)draw(&r, 1, SF_T_MAX);
    draw_batch(&shared, &r, BATCH, _i > 0);
    check_cycles(&net_of_test.net, BATCH, r.seed);
  }
}

/* One row of 150 inputs and one of biases per cycle, and one in which the sums move on: no other cycle is lost between
 * two samples. */
TEST(a_sample_takes_a_cycle_per_row)
{
  random_source r = {6000, 0};
  random_decoder_make(&net_of_test, &r, 150, false);
  net_of_test.net.steps = 2;
  draw_batch(&shared, &r, BATCH, false);
  fx_counts counts = {0}, actual;
  uint64_t cycles, busy, stalls;
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 1, 0);
  run_batch(dut, &net_of_test.net, BATCH, &counts, r.seed);
  ck_ok(sf_dut_counts(dut, &actual, &cycles, &busy, &stalls));
  ck_assert_uint_eq(sf_dut_layer_busy(dut)[FX_C1], 151 * BATCH);
  ck_assert_uint_lt(cycles, 152 * BATCH + 250); /* the first packet, the last sample's C2 and C3 */
}

/* ---- hard cases ---- */

static void fill_row(fx_layer *layer, int row, int8_t w)
{
  for (int o = 0; o < layer->n_out; o++) layer->w[row * SF_LANES + o] = w;
}

/* C1's current at its rails, one below and one beyond, by the neuron: 128 products of 2^16 either way, and a bias. */
TEST(currents_at_their_rails)
{
  random_source r = {6500, 0};
  random_decoder_make(&net_of_test, &r, 128, false);
  fx_net *net = &net_of_test.net;
  fx_layer *layer = &net->layer[FX_C1];
  net->mode = FX_HYBRID, net->steps = 2;
  layer->bias = 1, layer->theta = 1 << 22;
  for (int o = 0; o < SF_LANES; o++) {
    for (int i = 0; i < 128; i++) layer->w[i * SF_LANES + o] = o & 1 ? -64 : 64;
    layer->w[128 * SF_LANES + o] = (int8_t)(o / 2 % 5 - 2);
  }
  draw_batch(&shared, &r, 4, false);
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 128; j++) shared.f[i][j] = 1024;
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(net, r.seed, 0);
  run_batch(dut, net, 4, &counts, r.seed);
  same_counts(dut, &counts, r.seed);
  ck_assert_uint_eq(counts.layer[FX_C1].spikes[0], 4 * SF_LANES / 2); /* no current went round */
}

/* 0, 1: every weight and bias at the same rail, inputs too; 2, 3: biases alone, the rest is 0: C1 silent or every
 * neuron fires at every step; 4: zero inputs; 5: inputs against the bias. */
LOOP_TEST(hard_cases, 6)
{
  for (int mode = FX_HYBRID; mode <= FX_RADIX; mode++) {
    random_source r = {7000 + (uint64_t)mode, 0};
    random_decoder_make(&net_of_test, &r, SF_DIR_MAX, false);
    fx_net *net = &net_of_test.net;
    net->mode = mode, net->steps = SF_T_MAX;
    net->layer[FX_C1].bias = 2047;
    draw_batch(&shared, &r, 4, false);
    for (int l = FX_C1; l <= FX_C3; l++) {
      fx_layer *layer = &net->layer[l];
      for (int i = 0; i < fx_layer_rows(layer) && _i != 4; i++)
        fill_row(layer, i, (int8_t)(_i == 0 ? 127 : _i == 1 ? -127 : _i == 5 ? -127 : 0));
      if (_i == 2) fill_row(layer, layer->n_in, l == FX_C1 ? -127 : 127);
      if (_i == 3 || _i == 5) fill_row(layer, layer->n_in, 127);
      if (_i == 3 && l != FX_C3) layer->theta = 1, layer->k = 4096;
    }
    for (int i = 0; i < 4; i++)
      for (int j = 0; j < SF_DIR_MAX; j++) shared.f[i][j] = (int16_t)(_i == 4 ? 0 : i % 2 ? 2047 : -2047);
    check_cycles(net, 4, r.seed);
    if (_i == 2) ck_assert_uint_eq(shared.trace[0].spikes[FX_C1][0][0] | shared.trace[0].spikes[FX_C1][7][1], 0);
    if (_i == 2) ck_assert_int_eq(shared.trace[1].current[FX_C2][7][5], mode == FX_RADIX ? 255 * 127 : 127);
    if (_i == 3) ck_assert_uint_eq(shared.trace[0].spikes[FX_C1][0][0], UINT64_MAX);
    if (_i < 2) ck_assert_int_eq(abs(shared.trace[1].current[FX_C1][0][0]), (1 << 23) - !_i);
  }
}

/* ---- the same build ---- */

static void next_net(sf_dut *dut, random_source *r, bool decoder)
{
  fx_counts counts = {0};
  if (decoder)
    random_decoder_make(&net_of_test, r, draw(r, 0, 1) ? 150 : 30, true);
  else
    random_net_make(&net_of_test, r, true);
  ck_ok(sf_dut_load(dut, &net_of_test.net));
  draw_batch(&shared, r, 24, true);
  run_batch(dut, &net_of_test.net, 24, &counts, r->seed);
  same_counts(dut, &counts, r->seed);
}

/* An INGP net, a decoder, and an INGP net again, and so on, in one simulation without a reset of the block. */
LOOP_TEST(nets_take_turns, 3)
{
  random_source r = {8000 + (uint64_t)_i, 0};
  random_net_make(&net_of_test, &r, true);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, r.seed, _i * 30);
  for (int i = 0; i < 7; i++) next_net(dut, &r, i % 2);
}

/* With densities and biases: the direction's row of biases once a ray, C2's and C3's cost no cycle. */
LOOP_TEST(biases_of_other_nets, 3)
{
  for (uint64_t i = 0; i < 8; i++) {
    random_source r = {9000 + (uint64_t)_i * 8 + i, 0};
    random_net_make(&net_of_test, &r, i % 2);
    fx_layer *l = net_of_test.net.layer;
    for (int id = FX_C1; id <= FX_C3; id++) {
      l[id].bias = id == FX_C1 ? (int32_t)draw(&r, 1, 2047) : 1;
      for (int o = 0; o < l[id].n_out; o++) l[id].w[l[id].n_in * SF_LANES + o] = (int8_t)draw(&r, -127, 127);
    }
    draw_batch(&shared, &r, BATCH, i % 2);
    check_cycles(&net_of_test.net, BATCH, r.seed);
  }
}

TEST(a_bias_without_a_place_is_refused)
{
  random_source r = {10, 0};
  random_decoder_make(&net_of_test, &r, 150, false);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 11, 20);
  net_of_test.net.layer[FX_D2].bias = 1;
  ck_assert_int_ne(sf_dut_load(dut, &net_of_test.net).code, SF_OK);
}

/* Nobody takes a result for a long time: nothing is lost. Soft reset at many moments leaves no trace. */
TEST(soft_reset_at_any_time)
{
  random_source r = {30, 0};
  random_decoder_make(&net_of_test, &r, 30, false);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 17, 0);
  for (int delay = 1; delay < 400; delay += 23) {
    uint64_t words[SF_PACKET_MAX];
    draw_batch(&shared, &r, 4, false);
    const int beats = sf_dut_packet(&net_of_test.net, &shared.sample[0], words);
    dut->in.m_ready = false;
    for (int cycle = 0, beat = 0; cycle < delay; cycle++) {
      dut->in.s_valid = true;
      dut->in.s_data = words[beat];
      dut->in.s_user = beat == 0;
      dut->in.s_last = beat == beats - 1;
      sf_dut_tick(dut);
      if (dut->out.s_ready) beat = (beat + 1) % beats;
    }
    dut->in.s_valid = false;
    fx_counts counts = {0};
    ck_ok(sf_dut_load(dut, &net_of_test.net));
    run_batch(dut, &net_of_test.net, 4, &counts, r.seed);
    same_counts(dut, &counts, r.seed);
  }
}

int ck_timeout = 120;
