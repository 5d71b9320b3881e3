/* The registers against a model of csr.def: what reads back, what is refused and how, the interrupt, the bus. */
#include "ck_run.h"
#include "tests/register_bus.h"
#include "tests/register_model.h"
#include "tests/rtl_fixture.h"

enum { TRIALS = 4000, ACCESSES = 6000 };

/* ---- both ---- */

static const uint32_t limit[] = {0, 1, 3, 8, 15, 16, 32, 128, 160, 256, 512, 4096, 8192, 1 << 16, 1 << 23, 1u << 31};

static void write_bytes(sf_dut *dut, registers *r, uint32_t offset, uint32_t value, uint8_t strobe)
{
  if (strobe == WHOLE)
    put(dut, offset, value);
  else
    put_bytes(dut, offset, value, strobe);
  const uint32_t error = strobe == WHOLE ? model_write(r, offset, value) : model_refuse(r, SF_CSR_ERROR_ADDRESS);
  ck_assert_msg(!dut->bus_hung && dut->bus_response == (error ? SLVERR : OKAY),
                "%x to %x, bytes %x: response %d, expected errors %x", value, offset, strobe, dut->bus_response, error);
  dut->in.s_valid = !r->running; /* nothing is accepted that comes before a start */
  sf_dut_tick(dut);
  ck_assert(r->running || !dut->out.s_ready);
  dut->in.s_valid = false;
  ck_assert_msg(dut->out.irq == ((r->irq_pending & r->irq_enable) != 0), "%x to %x: interrupt %d", value, offset,
                dut->out.irq);
}

static void write_both(sf_dut *dut, registers *r, uint32_t offset, uint32_t value)
{
  write_bytes(dut, r, offset, value, WHOLE);
}

static void read_both(sf_dut *dut, registers *r, uint32_t offset)
{
  const uint32_t actual = get(dut, offset), expected = model_read(r, offset);
  ck_assert_msg(actual == expected, "%x reads %x, expected %x", offset, actual, expected);
  ck_assert_uint_eq(dut->out.rresp, 0);
}

/* A master may show anything while it is not valid: addresses and values of the other registers. */
static void show_anything(void *context)
{
  sf_dut *dut = context;
  random_source s = {7, dut->cycle * 4};
  if (!dut->in.awvalid) dut->in.awaddr = 4 * (uint32_t)draw(&s, 0, SF_CSR_BIAS / 4);
  if (!dut->in.wvalid) dut->in.wdata = draw(&s, 0, 1) ? (uint32_t)draw(&s, 0, 15) : UINT32_MAX;
}

static sf_dut *begin(registers *r, uint64_t seed)
{
  sf_dut *dut;
  ck_ok(sf_dut_open_bare(&dut, &(sf_dut_options){.seed = seed, .stall_percent = 20}));
  wait_for_walk(dut); /* after power-on */
  ck_assert(!outside((uint32_t)dut->cycle, PLACES, PLACES + 100));
  *r = (registers){.irq_pending = SF_CSR_IRQ_ENABLE_COUNTERS};
  dut->each_cycle = show_anything, dut->each_cycle_context = dut;
  for (uint32_t offset = 0; offset <= SF_CSR_BIAS; offset += 4) read_both(dut, r, offset);
  return dut;
}

/* ---- the check at start ---- */

static uint32_t size_of(random_source *s, uint32_t most)
{
  const int64_t kind = draw(s, 0, 3);
  return kind == 0 ? 1 : kind == 1 ? most : (uint32_t)draw(s, 1, most);
}

static void put_layer(sf_dut *dut, registers *r, int layer, const uint32_t value[KINDS])
{
  for (int kind = 0; kind < KINDS; kind++)
    write_both(dut, r, SF_CSR_D1_N_IN + (uint32_t)(LAYER_STRIDE * layer + 4 * kind), value[kind]);
}

/* A legal net, often at its limits. */
static void program_legal(sf_dut *dut, registers *r, random_source *s)
{
  const bool decoder = draw(s, 0, 2) == 0;
  const uint32_t d1 = decoder ? 0 : size_of(s, SF_LANES), c1 = size_of(s, SF_LANES), c2 = size_of(s, SF_LANES);
  const uint32_t d2 = decoder ? 0 : size_of(s, SF_OUT_MAX);
  const uint32_t dir = draw(s, 0, 1) ? (uint32_t)draw(s, 0, 1) * FX_SH : (uint32_t)draw(s, 0, FX_SH);
  const uint32_t c1_in = decoder ? size_of(s, SF_DIR_MAX) : d2 - 1 + dir;
  const uint32_t n[SF_LAYERS][2] = {
      {decoder ? 0 : size_of(s, SF_FEATURE_MAX), d1}, {d1, d2}, {c1_in ? c1_in : 1, c1}, {c1, c2}, {c2, 3}};
  for (int l = 0; l < SF_LAYERS; l++) {
    const uint32_t leak = size_of(s, LEAK_ONE), theta = size_of(s, (1 << 23) - 1);
    put_layer(dut, r, l, (uint32_t[]){n[l][0], n[l][1], leak, l == FX_D2 || l == FX_C3 ? 0 : theta});
  }
  write_both(dut, r, SF_CSR_MODE, (uint32_t)draw(s, 0, 2));
  write_both(dut, r, SF_CSR_STEPS, size_of(s, SF_T_MAX));
  for (uint32_t offset = SF_CSR_EXP_MUL; offset <= SF_CSR_SIGMOID_BIAS; offset += 4)
    write_both(dut, r, offset, size_of(s, offset == SF_CSR_EXP_SHIFT || offset == SF_CSR_SIGMOID_SHIFT ? 31 : 65535));
  write_both(dut, r, SF_CSR_BIAS, draw(s, 0, 1) ? 0x307ff : 0);
}

/* Sizes that have to agree: they go over a limit together. 0: no partner. */
static uint32_t partner(uint32_t offset)
{
  switch (offset) {
  case SF_CSR_D1_N_OUT:
    return SF_CSR_D2_N_IN;
  case SF_CSR_C1_N_OUT:
    return SF_CSR_C2_N_IN;
  case SF_CSR_C2_N_OUT:
    return SF_CSR_C3_N_IN;
  default:
    return 0;
  }
}

static void start_both(sf_dut *dut, registers *r)
{
  write_both(dut, r, SF_CSR_CTRL, SF_CSR_CTRL_START);
  read_both(dut, r, SF_CSR_ERROR);
  read_both(dut, r, SF_CSR_STATUS);
  write_both(dut, r, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
}

LOOP_TEST(the_check_at_start, 3)
{
  random_source s = {80 + (uint64_t)_i, 0};
  registers r;
  OWNED(sf_dut) *dut = begin(&r, s.seed);
  int legal = 0;
  for (int i = 0; i < TRIALS; i++) {
    if (i % 25 == 0) {
      program_legal(dut, &r, &s);
      ck_assert_uint_eq(start_errors(&r), 0);
      start_both(dut, &r);
    }
    const registers before = r;
    uint32_t offset = SF_CSR_MODE + 4 * (uint32_t)draw(&s, 0, (SF_CSR_C3_THETA - SF_CSR_MODE) / 4);
    if (draw(&s, 0, 15) == 0) offset = SF_CSR_BIAS;
    const uint32_t value = near_a_limit(&s, model_read(&r, offset), limit, COUNT(limit)), other = partner(offset);
    write_both(dut, &r, offset, value);
    if (other && draw(&s, 0, 2)) write_both(dut, &r, other, value);
    legal += start_errors(&r) == 0;
    start_both(dut, &r);
    registers was = before;
    write_both(dut, &r, offset, model_read(&was, offset));
    if (other) write_both(dut, &r, other, model_read(&was, other));
  }
  ck_assert_int_gt(legal, TRIALS / 20);
  ck_assert_int_lt(legal, TRIALS - TRIALS / 20);
}

/* ---- any access in any state ---- */

static void random_command(sf_dut *dut, registers *r, random_source *s)
{
  static const uint32_t often[] = {SF_CSR_CTRL_START, SF_CSR_CTRL_SOFT_RESET,
                                   SF_CSR_CTRL_START | SF_CSR_CTRL_SOFT_RESET};
  const uint32_t walk = draw(s, 0, 19) ? 0 : draw(s, 0, 1) ? SF_CSR_CTRL_CLEAR : SF_CSR_CTRL_SNAPSHOT;
  write_both(dut, r, SF_CSR_CTRL, often[draw(s, 0, 2)] | walk | (uint32_t)draw(s, 0, 1) << 31);
  if (!walk) return;
  ck_assert_uint_ne(get(dut, SF_CSR_STATUS) & SF_CSR_STATUS_COUNTERS, 0);
  read_both(dut, r, SF_CSR_IRQ_PENDING); /* not before its end */
  wait_for_walk(dut);
  r->irq_pending |= SF_CSR_IRQ_ENABLE_COUNTERS;
}

static void random_weight(sf_dut *dut, registers *r, random_source *s)
{
  static const uint32_t rows[] = {0, 31, 32, 127, 128, 159, 160, 255, 256, 257, 511};
  static const uint32_t words[] = {0, 3, 4, 31, 32, 63};
  const uint32_t row = draw(s, 0, 3) ? rows[draw(s, 0, 10)] : (uint32_t)draw(s, 0, 511);
  const uint32_t address = (uint32_t)draw(s, 0, 7) << SF_CSR_WEIGHT_ADDRESS_LAYER_LSB |
                           row << SF_CSR_WEIGHT_ADDRESS_ROW_LSB | words[draw(s, 0, 5)];
  uint32_t weights = 0;
  for (int byte = 0; byte < 4; byte++)
    weights |= (uint32_t)(draw(s, 0, 11) ? draw(s, 0, 127) : draw(s, 127, 129)) << 8 * byte;
  write_both(dut, r, SF_CSR_WEIGHT_ADDRESS, address);
  write_both(dut, r, SF_CSR_WEIGHT_DATA, weights);
  read_both(dut, r, SF_CSR_WEIGHT_ADDRESS);
}

LOOP_TEST(any_access_in_any_state, 2)
{
  random_source s = {90 + (uint64_t)_i, 0};
  registers r;
  OWNED(sf_dut) *dut = begin(&r, s.seed);
  program_legal(dut, &r, &s);
  int running = 0;
  for (int i = 0; i < ACCESSES; i++) {
    const int64_t kind = draw(&s, 0, 99);
    const uint32_t offset = 4 * (uint32_t)draw(&s, 0, draw(&s, 0, 9) ? SF_CSR_BIAS / 4 + 1 : 0x7ff);
    running += r.running;
    if (kind < 40) {
      read_both(dut, &r, offset < SF_CSR_COUNTERS ? offset : 0);
    } else if (kind < 55) {
      random_command(dut, &r, &s);
    } else if (kind < 60) {
      random_weight(dut, &r, &s);
    } else if (kind < 62) {
      if (!r.running) program_legal(dut, &r, &s);
    } else if (offset != SF_CSR_CTRL) {
      write_bytes(dut, &r, offset, near_a_limit(&s, model_read(&r, offset), limit, COUNT(limit)), draw_strobe(&s));
      if (offset < SF_CSR_COUNTERS) read_both(dut, &r, offset);
    }
  }
  ck_assert_int_gt(running, ACCESSES / 10);
}

/* ---- the bus ---- */

TEST(accesses_without_a_pause)
{
  static const accesses window = {{{SF_CSR_EXP_BIAS, OKAY}, {SF_CSR_ID, SLVERR}, {SF_CSR_D1_K, OKAY}, {0x7fc, SLVERR}},
                                  {{SF_CSR_ID, SF_CSR_ID_RESET},
                                   {SF_CSR_VERSION, SF_CSR_VERSION_RESET},
                                   {SF_CSR_C2_THETA, 99},
                                   {SF_CSR_EXP_BIAS, 0}}};
  random_source s = {100, 0};
  registers r;
  OWNED(sf_dut) *dut = begin(&r, s.seed);
  put(dut, SF_CSR_C2_THETA, 99);
  access_without_a_pause(dut, &s, &window);
}

/* Refused weights, other registers, what a master shows while it is not valid: none of it reaches the weights. */
LOOP_TEST(weights_are_written_by_nothing_else, SF_LAYERS)
{
  typical(105);
  fx_counts counts = {0};
  const uint32_t first_word = (uint32_t)_i << SF_CSR_WEIGHT_ADDRESS_LAYER_LSB;
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 105, 20);
  const sf_bus *bus = &dut->bus;
  sf_driver_reset(bus);
  bus->write(bus->context, SF_CSR_WEIGHT_ADDRESS, first_word);
  bus->write(bus->context, SF_CSR_WEIGHT_DATA, 0x80010101);
  bus->write(bus->context, SF_CSR_ERROR, SF_CSR_ERROR_WEIGHT);
  bus->write(bus->context, SF_CSR_WEIGHT_ADDRESS, first_word);
  bus->write(bus->context, SF_CSR_STEPS, (uint32_t)net_of_test.net.steps);
  dut->each_cycle = show_anything, dut->each_cycle_context = dut;
  for (int i = 0; i < 100; i++) ck_assert_uint_eq(get(dut, SF_CSR_WEIGHT_ADDRESS), first_word);
  dut->each_cycle = NULL;
  ck_assert_int_eq(sf_driver_start(bus), SF_DRIVER_OK);
  bus->write(bus->context, SF_CSR_WEIGHT_DATA, 0x01010101);
  ck_assert_uint_eq(get(dut, SF_CSR_ERROR), SF_CSR_ERROR_BUSY);
  bus->write(bus->context, SF_CSR_ERROR, SF_CSR_ERROR_BUSY);
  bus->write(bus->context, SF_CSR_IRQ_PENDING, SF_CSR_IRQ_ENABLE_ERROR);
  run_batch(dut, &net_of_test.net, 4, &counts, 105);
}

/* A row is written into its own place alone: the last one first, and all of them twice. */
TEST(rows_in_any_order)
{
  typical(106);
  const sf_net_blob blob = sf_dut_blob(&net_of_test.net);
  fx_counts counts = {0};
  OWNED(sf_dut) *dut = open_dut(&net_of_test.net, 106, 0);
  const sf_bus *bus = &dut->bus;
  sf_driver_reset(bus);
  for (int order = 0; order < 2; order++)
    for (uint32_t l = 0; l < SF_LAYERS; l++)
      for (int32_t i = 0, n = blob.layer[l].n_in; i < n; i++) {
        const int32_t row = order ? n - 1 - i : (i * 7 + n - 1) % n; /* some rows again and again */
        const int8_t *w = blob.layer[l].w + row * SF_LANES;
        bus->write(bus->context, SF_CSR_WEIGHT_ADDRESS,
                   l << SF_CSR_WEIGHT_ADDRESS_LAYER_LSB | (uint32_t)row << SF_CSR_WEIGHT_ADDRESS_ROW_LSB);
        for (int32_t o = 0; o < blob.layer[l].n_out; o += 4)
          bus->write(bus->context, SF_CSR_WEIGHT_DATA,
                     (uint32_t)(uint8_t)w[o] | (uint32_t)(uint8_t)w[o + 1] << 8 | (uint32_t)(uint8_t)w[o + 2] << 16 |
                         (uint32_t)(uint8_t)w[o + 3] << 24);
      }
  ck_assert_int_eq(sf_driver_start(bus), SF_DRIVER_OK);
  run_batch(dut, &net_of_test.net, 4, &counts, 106);
}
