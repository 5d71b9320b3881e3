/* The accelerator disturbed at work: reset in mid-frame by pin and by register, snapshot and clear, stalls. Afterwards
 * it works as if nothing had been. */
#include "ck_run.h"
#include "tests/rtl_fixture.h"

enum { PATIENCE = 4000 };

/* Everything is programmed anew; results and counters are right from the first sample on. */
static void works(sf_dut *dut)
{
  fx_counts counts = {0};
  typical(61);
  dut->in.s_valid = dut->in.m_ready = false;
  ck_ok(sf_dut_load(dut, &net_of_test.net));
  ck_assert_uint_eq(get(dut, SF_CSR_ERROR), 0);
  run_batch(dut, &net_of_test.net, 3, &counts, 61);
  same_counts(dut, &counts, 61);
}

/* Samples in with bubbles; results are taken now and then. One cycle. */
typedef struct feed {
  uint64_t words[SF_PACKET_MAX];
  int beat, beats, sample;
  uint32_t m_percent; /* chance that a result beat is taken */
} feed;

static void feed_cycle(sf_dut *dut, feed *f, random_source *r)
{
  if (f->beat == f->beats) {
    f->beats = sf_dut_packet(&net_of_test.net, &shared.sample[f->sample++ % 3], f->words);
    f->beat = 0;
  }
  if (!dut->in.s_valid) dut->in.s_valid = draw(r, 0, 3) > 0;
  dut->in.s_data = f->words[f->beat];
  dut->in.s_user = f->beat == 0 && shared.sample[(f->sample - 1) % 3].first;
  dut->in.s_last = f->beat == f->beats - 1;
  dut->in.m_ready = draw(r, 0, 99) < (int64_t)f->m_percent;
  sf_dut_tick(dut);
  if (!dut->in.s_valid || !dut->out.s_ready) return;
  f->beat++;
  dut->in.s_valid = false;
}

static sf_dut *begin(uint64_t seed, fx_input_mode mode)
{
  typical(60);
  net_of_test.net.mode = mode;
  return open_dut(&net_of_test.net, seed, 20);
}

static void hard_reset(sf_dut *dut, int cycles)
{
  dut->in.rst_n = false;
  dut->in.s_valid = dut->in.m_ready = false;
  for (int i = 0; i < cycles; i++) {
    sf_dut_tick(dut);
    if (i > 0) ck_assert(!dut->out.m_valid && !dut->out.bvalid && !dut->out.rvalid && !dut->out.tap_valid);
  }
  dut->in.rst_n = true;
  dut->phase = SF_PHASE_IDLE;
  sf_dut_tick(dut);
  ck_assert(!dut->out.s_ready && !dut->out.irq);
  ck_assert_uint_eq(get(dut, SF_CSR_STATUS) & (SF_CSR_STATUS_RUNNING | SF_CSR_STATUS_ACTIVE | SF_CSR_STATUS_ERROR), 0);
}

static void program_and_start(sf_dut *dut)
{
  const sf_net_blob blob = sf_dut_blob(&net_of_test.net);
  ck_assert_int_eq(sf_driver_program(&dut->bus, &blob), SF_DRIVER_OK);
  ck_assert_int_eq(sf_driver_start(&dut->bus), SF_DRIVER_OK);
  dut->net = net_of_test.net;
}

/* The block keeps no direction: a first sample that brings none is refused. */
static void has_no_direction(sf_dut *dut)
{
  uint64_t words[SF_PACKET_MAX];
  sf_dut_sample without = shared.sample[0];
  without.first = false;
  dut->in.s_last = sf_dut_packet(&net_of_test.net, &without, words) == 1;
  dut->in.s_data = words[0], dut->in.s_user = false, dut->in.s_valid = true;
  sf_dut_tick(dut);
  ck_assert(dut->out.s_ready);
  dut->in.s_valid = false;
  ck_assert_uint_eq(get(dut, SF_CSR_ERROR), SF_CSR_ERROR_PACKET);
}

/* The driver always begins with a soft reset; after a hard one it is not needed, at power-on or in mid-frame. */
LOOP_TEST(a_hard_reset_is_enough, 2)
{
  random_source r = {68, (uint64_t)_i << 32};
  OWNED(sf_dut) *dut = NULL;
  ck_ok(sf_dut_open_bare(&dut, &(sf_dut_options){.seed = 68 + (uint64_t)_i}));
  for (int trial = 0; trial < 6; trial++) {
    fx_counts counts = {0};
    if (trial % 2)
      random_decoder_make(&net_of_test, &r, 30, false);
    else
      random_net_make(&net_of_test, &r, false);
    draw_batch(&shared, &r, 6, false);
    program_and_start(dut);
    run_batch(dut, &net_of_test.net, 6, &counts, r.seed);
    same_counts(dut, &counts, r.seed);
    feed f = {.m_percent = 30 * (uint32_t)(trial % 3)};
    for (int64_t cycle = draw(&r, 1, 700); cycle > 0; cycle--) feed_cycle(dut, &f, &r);
    hard_reset(dut, 1 + trial % 3);
    program_and_start(dut);
    has_no_direction(dut);
    hard_reset(dut, 1);
  }
}

/* Waits for the phase at the pins, then strikes at once. */
LOOP_TEST(soft_reset_in_every_phase, SF_PHASES)
{
  random_source r = {63, (uint64_t)_i << 32};
  OWNED(sf_dut) *dut = begin(63, FX_HYBRID);
  for (int trial = 0; trial < 3; trial++) {
    feed f = {.m_percent = 30};
    int cycle = 0;
    typical(60);
    ck_ok(sf_dut_load(dut, &net_of_test.net));
    for (; cycle < PATIENCE && (cycle < trial * 200 || dut->phase != (sf_phase)_i); cycle++) feed_cycle(dut, &f, &r);
    ck_assert_int_lt(cycle, PATIENCE);
    dut->in.s_valid = dut->in.m_ready = false;
    sf_driver_reset(&dut->bus);
    ck_assert_uint_eq(get(dut, SF_CSR_STATUS) & (SF_CSR_STATUS_RUNNING | SF_CSR_STATUS_ACTIVE), 0);
    for (int i = 0; i < 300; i++) { /* nothing that was inside comes out */
      dut->in.m_ready = true;
      sf_dut_tick(dut);
      ck_assert(!dut->out.m_valid && !dut->out.tap_valid);
    }
    works(dut);
  }
}

/* In every cycle of some samples: nothing of them comes out afterwards, and the net that is there goes on. */
LOOP_TEST(soft_reset_in_every_cycle, 2)
{
  enum { CYCLES = 420, SILENCE = 50 };
  random_source r = {64, 0};
  OWNED(sf_dut) *dut = begin(64, _i ? FX_RADIX : FX_HYBRID);
  dut->stall_percent = 0;
  for (int delay = 0; delay < CYCLES; delay++) {
    feed f = {.m_percent = 100};
    fx_counts counts = {0};
    for (int cycle = 0; cycle < delay; cycle++) feed_cycle(dut, &f, &r);
    dut->in.s_valid = dut->in.m_ready = false;
    sf_driver_reset(&dut->bus);
    dut->in.m_ready = true;
    for (int i = 0; i < SILENCE; i++) {
      sf_dut_tick(dut);
      ck_assert_msg(!dut->out.m_valid && !dut->out.tap_valid, "%d cycles on: something comes out", delay);
    }
    dut->in.m_ready = false;
    ck_assert_int_eq(sf_driver_start(&dut->bus), SF_DRIVER_OK);
    run_batch(dut, &net_of_test.net, 2, &counts, 64);
  }
}

/* What the core counts of the samples from..to-1 that feed_cycle sends. */
static fx_counts counts_of(uint64_t from, uint64_t to)
{
  fx_counts counts = {0}, unwanted = {0};
  int32_t base[SF_LANES];
  fx_out out;
  for (uint64_t i = 0; i < to; i++) {
    const sf_dut_sample *s = &shared.sample[i % 3];
    fx_counts *at = i >= from ? &counts : &unwanted;
    if (s->first) fx_net_direction(&net_of_test.net, s->ray->dir, base, at);
    fx_net_sample(&net_of_test.net, s->f, base, &out, NULL, at);
  }
  return counts;
}

static uint64_t window(sf_dut *dut, int event, int layer, int step)
{
  const uint32_t at = SF_CSR_COUNTERS + 8u * (uint32_t)(64 * event + 8 * layer + step);
  const uint32_t low = get(dut, at);
  return low | (uint64_t)get(dut, at + 4) << 32;
}

static fx_counts read_window(sf_dut *dut)
{
  fx_counts counts = {.samples = window(dut, 0, 7, 0), .rays = window(dut, 0, 7, 1)};
  for (int l = 0; l < SF_LAYERS; l++) {
    for (int e = 0; e < SF_EVENTS; e++)
      for (int t = 0; t < SF_T_MAX; t++) counts.layer[l].event[e][t] = window(dut, e, l, t);
  }
  return counts;
}

static void same_events(const fx_counts *expected, const fx_counts *actual)
{
  sf_difference d;
  ck_assert_msg(sf_compare_counts(expected, actual, 0, &d), "layer %d step %d %s: expected %lld, actual %lld", d.layer,
                d.step, d.wire, (long long)d.expected, (long long)d.actual);
}

static void end_of_walk(sf_dut *dut)
{
  dut->in.m_ready = true; /* or the sample at work could not end */
  for (int i = 0; get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS; i++) ck_assert_int_lt(i, PATIENCE);
}

static void send_rest(sf_dut *dut, feed *f, random_source *r)
{
  while (f->beat != f->beats || dut->in.s_valid) feed_cycle(dut, f, r);
  dut->in.m_ready = true;
  for (int i = 0; i < PATIENCE; i++) sf_dut_tick(dut);
}

/* Asked for at any moment, a snapshot is of whole samples, and no event is lost between it and a clear. */
LOOP_TEST(snapshot_and_clear_at_work, 8)
{
  random_source r = {64, (uint64_t)_i << 32};
  OWNED(sf_dut) *dut = begin(64, _i & 4 ? FX_RADIX : FX_HYBRID);
  feed f = {.m_percent = 80};
  const bool clear = _i & 1;
  for (int64_t cycle = draw(&r, 400, 1500); cycle > 0; cycle--) feed_cycle(dut, &f, &r);
  while (dut->in.s_valid) feed_cycle(dut, &f, &r); /* a beat that was offered may not be taken back */
  put(dut, SF_CSR_CTRL, SF_CSR_CTRL_SNAPSHOT | (clear ? SF_CSR_CTRL_CLEAR : 0));
  end_of_walk(dut);
  const fx_counts actual = read_window(dut), expected = counts_of(0, actual.samples);
  ck_assert_uint_gt(actual.samples, 0);
  same_events(&expected, &actual);
  send_rest(dut, &f, &r);
  fx_counts after;
  ck_ok(sf_dut_counts(dut, &after, NULL, NULL, NULL));
  const fx_counts rest = counts_of(clear ? actual.samples : 0, (uint64_t)f.sample);
  same_events(&rest, &after);
}

/* Streams that trickle, so that every step of every layer has a bubble or back-pressure, with and without membranes at
 * their rails. */
LOOP_TEST(all_steps_under_stalls, FX_RADIX + 1)
{
  random_source r = {67, (uint64_t)_i << 32};
  for (int saturating = 0; saturating < 2; saturating++) {
    random_net_make(&net_of_test, &r, false);
    fx_net *net = &net_of_test.net;
    net->mode = _i;
    net->steps = SF_T_MAX;
    for (int l = 0; saturating && l < SF_LAYERS; l++) {
      draw_weights(&r, &net->layer[l], 1);
      net->layer[l].k = 0;
      if (net->layer[l].theta) net->layer[l].theta = l == FX_C2 && _i != FX_RADIX ? (1 << 23) - 1 : 1;
    }
    random_net_limit(net);
    draw_batch(&shared, &r, BATCH, false);
    for (int i = 0; saturating && i < BATCH; i++) {
      for (int k = 0; k < FX_SH; k++) shared.ray[i].dir[k] = 2047;
      for (int k = 0; k < SF_FEATURE_MAX; k++) shared.f[i][k] = 2047;
    }
    fx_counts counts = {0};
    OWNED(sf_dut) *dut = open_dut(net, r.seed, 90);
    run_batch(dut, net, BATCH, &counts, r.seed);
    same_counts(dut, &counts, r.seed);
    ck_assert(!saturating || _i < FX_NODECAY || (counts.saturated[FX_C1] && counts.saturated[FX_C2]));
  }
}
