/* The window of counters: places, snapshots and clears, walks beside samples and accesses. */
#include "ck_run.h"
#include "tests/rtl_fixture.h"

static bool has_meaning(int event, int layer, int step)
{
  return layer < SF_LAYERS || (layer == 7 && ((event == 0 && step < 6) || (event == 1 && step < SF_LAYERS)));
}

static uint32_t place_offset(int place)
{
  return SF_CSR_COUNTERS + 8 * (uint32_t)place;
}

/* second: during the walk of the first one; 0: none. */
static void commands(sf_dut *dut, uint32_t first, uint32_t second)
{
  dut->bus.write(dut->bus.context, SF_CSR_CTRL, first);
  if (second) dut->bus.write(dut->bus.context, SF_CSR_CTRL, second);
  wait_for_walk(dut);
}

/* All counters are 0 after power-on, without a command; later the places that no counter has read 0. */
LOOP_TEST(places_of_the_window, 2)
{
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = NULL;
  ck_ok(sf_dut_open_bare(&dut, &(sf_dut_options){.seed = 110 + (uint64_t)_i, .stall_percent = 20}));
  wait_for_walk(dut); /* after power-on */
  commands(dut, SF_CSR_CTRL_SNAPSHOT, 0);
  for (uint32_t word = 0; word < 2 * PLACES; word++) ck_assert_uint_eq(get(dut, SF_CSR_COUNTERS + 4 * word), 0);
  typical(110);
  ck_ok(sf_dut_load(dut, &net_of_test.net));
  run_batch(dut, &net_of_test.net, 4, &counts, 110);
  commands(dut, SF_CSR_CTRL_SNAPSHOT, 0);
  for (int i = 0; i < PLACES; i++)
    if (!has_meaning(i / 64, i / 8 % 8, i % 8)) ck_assert_uint_eq(get(dut, place_offset(i)), 0);
}

static void read_window(sf_dut *dut, uint32_t words[2 * PLACES])
{
  for (uint32_t i = 0; i < 2 * PLACES; i++) words[i] = get(dut, SF_CSR_COUNTERS + 4 * i);
}

/* Neither events nor a clear change it, and a command that comes during a walk is one of its own. */
TEST(the_window_is_of_the_last_snapshot)
{
  static uint32_t words[2][2 * PLACES];
  static const uint32_t zero[2 * PLACES];
  fx_counts counts = {0};
  typical(113);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 113, 0);
  for (int during = 0; during < 2; during++) {
    run_batch(dut, &net_of_test.net, 3, &counts, 113);
    same_counts(dut, &counts, 113);
    read_window(dut, words[0]);
    if (during) {
      commands(dut, SF_CSR_CTRL_SNAPSHOT, SF_CSR_CTRL_CLEAR);
    } else {
      run_batch(dut, &net_of_test.net, 2, &counts, 113);
      read_window(dut, words[1]);
      ck_assert_mem_eq(words[0], words[1], sizeof words[0]);
      commands(dut, SF_CSR_CTRL_CLEAR, 0);
    }
    read_window(dut, words[1]);
    ck_assert_mem_eq(words[0], words[1], sizeof words[0]);
    counts = (fx_counts){0};
  }
  commands(dut, SF_CSR_CTRL_CLEAR, SF_CSR_CTRL_SNAPSHOT);
  read_window(dut, words[1]);
  ck_assert_mem_eq(words[1], zero, sizeof zero);
}

/* A counter that was read and waits to be taken stays what it is, whatever a walk writes meanwhile. */
TEST(a_response_that_waits)
{
  fx_counts counts = {0};
  typical(111);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 111, 0);
  run_batch(dut, &net_of_test.net, 5, &counts, 111);
  commands(dut, SF_CSR_CTRL_SNAPSHOT, 0);
  const int place = 7 * 8; /* samples */
  dut->in.araddr = place_offset(place), dut->in.arvalid = true, dut->in.rready = false;
  sf_dut_tick(dut);
  ck_assert(dut->out.arready);
  dut->in.arvalid = false;
  dut->bus.write(dut->bus.context, SF_CSR_CTRL, SF_CSR_CTRL_CLEAR);
  for (int walk = 0; walk < 2; walk++) {
    for (int i = 0; i < PLACES + 10; i++) {
      dut->in.araddr = place_offset(i % PLACES);
      sf_dut_tick(dut);
      ck_assert(dut->out.rvalid);
      ck_assert_uint_eq(dut->out.rdata, 5);
    }
    dut->bus.write(dut->bus.context, SF_CSR_CTRL, SF_CSR_CTRL_SNAPSHOT);
  }
  dut->in.rready = true;
  sf_dut_tick(dut);
  ck_assert_uint_eq(get(dut, place_offset(place)), 0);
}

/* A packet that has begun: the block is active and D1 waits, but a walk is no time of the engine's. */
TEST(a_walk_takes_no_time)
{
  sf_driver_counters c[2];
  uint64_t at[2];
  typical(112);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 112, 0);
  ck_assert_uint_eq(get(dut, SF_CSR_STATUS), SF_CSR_STATUS_RUNNING);
  uint64_t words[SF_PACKET_MAX];
  sf_dut_packet(&net_of_test.net, &shared.sample[0], words);
  dut->in.s_valid = dut->in.s_user = true, dut->in.s_data = words[0], dut->in.s_last = false;
  sf_dut_tick(dut);
  ck_assert(dut->out.s_ready);
  dut->in.s_valid = false;
  ck_assert_uint_eq(get(dut, SF_CSR_STATUS), SF_CSR_STATUS_RUNNING | SF_CSR_STATUS_ACTIVE);
  for (int i = 0; i < 2; i++) {
    at[i] = dut->cycle;
    ck_assert_int_eq(sf_driver_read_counters(&dut->bus, &c[i]), SF_DRIVER_OK);
  }
  ck_assert_uint_eq(c[1].cycles - c[0].cycles, at[1] - at[0] - PLACES);
  ck_assert_uint_eq(c[1].stall_in - c[0].stall_in, at[1] - at[0] - PLACES - 1); /* nor is the cycle that waits for it */
  ck_assert_uint_eq(c[1].busy + c[1].stall_out, 0);
}

/* Samples that come while a walk clears or copies wait for its end, and are counted whole. */
TEST(samples_that_come_during_a_walk)
{
  typical(114);
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 114, 0);
  for (int round = 0; round < 6; round++) {
    fx_counts counts = {0};
    run_batch(dut, &net_of_test.net, 3, &counts, 114);
    dut->bus.write(dut->bus.context, SF_CSR_CTRL,
                   round % 2 ? SF_CSR_CTRL_CLEAR | SF_CSR_CTRL_SNAPSHOT : SF_CSR_CTRL_CLEAR);
    for (int i = 0; i < 100 * round; i++) sf_dut_tick(dut);
    ck_assert_uint_ne(get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS, 0);
    counts = (fx_counts){0};
    run_batch(dut, &net_of_test.net, 2, &counts, 114);
    same_counts(dut, &counts, 114);
    commands(dut, SF_CSR_CTRL_CLEAR, 0);
  }
}
