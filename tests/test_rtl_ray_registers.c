/* The registers of sf_ray_top against a model of csr.def: what reads back, what is refused and how, the interrupt, both
 * windows behind one bus, and what reaches the encoder. */
#include "ck_run.h"
#include "quant/quant.h"
#include "sim/ray/ray.h"
#include "tests/register_bus.h"

enum { ACCESSES = 8000 };
enum { WINDOW = 0x400, WINDOW_END = 0x800 };

/* ---- the model ---- */

/* As they read. A value that does not fit is kept as an illegal one, so that the check at start sees it. */
typedef struct registers {
  bool running, broken; /* broken: input is discarded until the soft reset */
  uint32_t error, irq_enable, trans_stop, max_samples, background[3], address, base;
} registers;

static bool bad_value(const registers *r)
{
  bool bad = r->trans_stop >= 1 << 20 || r->max_samples < 1 || r->max_samples > 1024;
  for (int o = 0; o < 3; o++) bad |= r->background[o] > 1 << 16;
  return bad || r->base % SF_LINE_BYTES;
}

static void store(registers *r, uint32_t offset, uint32_t value)
{
  if (offset == SF_CSR_RAY_TRANS_STOP) {
    r->trans_stop = value >> 20 ? (1 << 21) - 1 : value;
  } else if (offset == SF_CSR_RAY_MAX_SAMPLES) {
    r->max_samples = value >> 11 ? 0 : value;
  } else if (offset == SF_CSR_ENCODER_ADDRESS) {
    r->address = value & 0xfff;
  } else if (offset == SF_CSR_ENCODER_DATA) {
    r->address = (r->address + 1) & 0xfff;
  } else if (offset == SF_CSR_FIELD_BASE) {
    r->base = value;
  } else {
    r->background[(offset - SF_CSR_RAY_BACKGROUND_R) / 4] = value >> 17 ? (1 << 18) - 1 : value;
  }
}

/* Bits that the write sets in RAY_ERROR: it was refused. */
static uint32_t model_write(registers *r, uint32_t offset, uint32_t value, uint8_t strobe)
{
  uint32_t error = 0;
  const bool programming = offset >= SF_CSR_RAY_TRANS_STOP && offset <= SF_CSR_FIELD_BASE;
  if (strobe != WHOLE) {
    error = SF_CSR_RAY_ERROR_ADDRESS;
  } else if (programming) {
    if (r->running)
      error = SF_CSR_RAY_ERROR_BUSY;
    else
      store(r, offset, value);
  } else if (offset == SF_CSR_RAY_CTRL) {
    if (value & SF_CSR_RAY_CTRL_START) {
      error = r->running ? SF_CSR_RAY_ERROR_BUSY : bad_value(r) ? SF_CSR_RAY_ERROR_VALUE : 0;
      r->running |= !error;
    }
  } else if (offset == SF_CSR_RAY_ERROR) {
    r->error &= ~value;
  } else if (offset == SF_CSR_RAY_IRQ_ENABLE) {
    r->irq_enable = value & 0x1f;
  } else {
    error = SF_CSR_RAY_ERROR_ADDRESS;
  }
  r->error |= error;
  return error;
}

static uint32_t model_read(const registers *r, uint32_t offset)
{
  switch (offset) {
  case SF_CSR_RAY_STATUS:
    return (r->running ? SF_CSR_RAY_STATUS_RUNNING : 0) | (r->error ? SF_CSR_RAY_STATUS_ERROR : 0);
  case SF_CSR_RAY_ERROR:
    return r->error;
  case SF_CSR_RAY_IRQ_ENABLE:
    return r->irq_enable;
  case SF_CSR_RAY_TRANS_STOP:
    return r->trans_stop;
  case SF_CSR_RAY_MAX_SAMPLES:
    return r->max_samples;
  case SF_CSR_RAY_BACKGROUND_R:
  case SF_CSR_RAY_BACKGROUND_G:
  case SF_CSR_RAY_BACKGROUND_B:
    return r->background[(offset - SF_CSR_RAY_BACKGROUND_R) / 4];
  case SF_CSR_ENCODER_ADDRESS:
    return r->address;
  case SF_CSR_FIELD_BASE:
    return r->base;
  case SF_CSR_FIELD_CACHE:
    return SF_CSR_FIELD_CACHE_RESET;
  case SF_CSR_FIELD_KINDS:
    return SF_CSR_FIELD_KINDS_RESET;
  default:
    return 0;
  }
}

/* ---- both ---- */

static void same_interrupt(sf_dut *dut, const registers *r)
{
  dut->in.ray_valid = !r->running; /* nothing is accepted that comes before a start */
  sf_dut_tick(dut);
  ck_assert(r->running || !dut->out.ray_ready);
  dut->in.ray_valid = false;
  ck_assert_int_eq(dut->out.irq, (r->error & r->irq_enable) != 0);
}

static void write_both(sf_dut *dut, registers *r, uint32_t offset, uint32_t value, uint8_t strobe)
{
  if (strobe == WHOLE)
    put(dut, offset, value);
  else
    put_bytes(dut, offset, value, strobe);
  const uint32_t error = model_write(r, offset, value, strobe);
  ck_assert_msg(!dut->bus_hung && dut->bus_response == (error ? SLVERR : OKAY),
                "%x to %x, bytes %x: response %d, expected errors %x", value, offset, strobe, dut->bus_response, error);
  same_interrupt(dut, r);
}

static void read_both(sf_dut *dut, const registers *r, uint32_t offset)
{
  const uint32_t actual = get(dut, offset), expected = model_read(r, offset);
  ck_assert_msg(actual == expected, "%x reads %x, expected %x", offset, actual, expected);
}

static void soft_reset_both(sf_dut *dut, registers *r)
{
  put(dut, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
  ck_assert_int_eq(dut->bus_response, OKAY);
  r->running = r->broken = false, r->error = 0;
  same_interrupt(dut, r);
}

static sf_dut *begin(uint64_t seed)
{
  sf_dut *dut;
  ck_ok(sf_dut_open_pins(&dut, &(sf_dut_options){.seed = seed, .stall_percent = 20}, sf_pins_open_rays));
  dut->each_cycle = show_any_access, dut->each_cycle_context = dut;
  return dut;
}

/* A sample that belongs to no ray. */
static void beat_out_of_order(sf_dut *dut, registers *r)
{
  if (!r->running) return;
  void (*noise)(void *) = dut->each_cycle;
  dut->each_cycle = NULL;
  dut->in.ray_valid = true, dut->in.ray_user = false;
  sf_dut_tick(dut);
  ck_assert(dut->out.ray_ready);
  dut->in.ray_valid = false;
  sf_dut_tick(dut); /* out of the register at the input */
  dut->each_cycle = noise;
  if (!r->broken) r->error |= SF_CSR_RAY_ERROR_ORDER;
  r->broken = true;
}

static void program_legal(sf_dut *dut, registers *r, random_source *s)
{
  write_both(dut, r, SF_CSR_RAY_TRANS_STOP, draw(s, 0, 1) ? (1 << 20) - 1 : 0, WHOLE);
  write_both(dut, r, SF_CSR_RAY_MAX_SAMPLES, draw(s, 0, 1) ? 1024 : 1, WHOLE);
  write_both(dut, r, SF_CSR_FIELD_BASE, draw(s, 0, 1) ? UINT32_MAX - 15 : 16, WHOLE);
  for (uint32_t o = 0; o < 3; o++)
    write_both(dut, r, SF_CSR_RAY_BACKGROUND_R + 4 * o, draw(s, 0, 1) ? 1 << 16 : 0, WHOLE);
}

LOOP_TEST(any_access_in_any_state, 2)
{
  static const uint32_t limit[] = {0, 1, 16, 1024, 2048, 1 << 16, 1 << 17, 1 << 18, 1 << 20, 1 << 21, 1u << 31};
  random_source s = {200 + (uint64_t)_i, 0};
  registers r = {0};
  OWNED(sf_dut) *dut = begin(s.seed);
  int running = 0, refused = 0;
  for (uint32_t offset = WINDOW; offset < SF_CSR_FIELD_STALLS_HIGH + 8; offset += 4) read_both(dut, &r, offset);
  for (int i = 0; i < ACCESSES; i++) {
    const int64_t kind = draw(&s, 0, 99);
    const uint32_t offset = WINDOW + 4 * (uint32_t)(draw(&s, 0, 9) ? draw(&s, 0, 21) : draw(&s, 0, 255));
    const uint8_t strobe = draw_strobe(&s);
    running += r.running;
    if (kind < 30) {
      read_both(dut, &r, offset);
    } else if (kind < 40) {
      write_both(dut, &r, SF_CSR_RAY_CTRL, (uint32_t)draw(&s, 0, 3) | 1u << draw(&s, 0, 31), strobe);
    } else if (kind < 46) {
      soft_reset_both(dut, &r);
    } else if (kind < 49) {
      beat_out_of_order(dut, &r);
    } else if (kind < 52 && !r.running) {
      program_legal(dut, &r, &s);
    } else {
      const uint32_t before = r.error;
      write_both(dut, &r, offset, near_a_limit(&s, model_read(&r, offset), limit, COUNT(limit)), strobe);
      refused += r.error != before;
      read_both(dut, &r, offset);
    }
    if (kind % 8 == 0) read_both(dut, &r, SF_CSR_RAY_STATUS);
  }
  ck_assert_int_gt(running, ACCESSES / 10);
  ck_assert_int_gt(refused, ACCESSES / 20);
}

/* What is not one of the ray registers is sf_top's, and its interrupt comes through. */
TEST(the_other_window)
{
  registers r = {0};
  OWNED(sf_dut) *dut = begin(210);
  write_both(dut, &r, SF_CSR_RAY_BACKGROUND_G, 77, WHOLE);
  ck_assert_uint_eq(get(dut, SF_CSR_ID), SF_CSR_ID_RESET);
  put(dut, SF_CSR_EXP_BIAS, 4321);
  ck_assert_int_eq(dut->bus_response, OKAY);
  ck_assert_uint_eq(get(dut, SF_CSR_EXP_BIAS), 4321);
  for (uint32_t offset = WINDOW - 4; offset <= WINDOW_END; offset += WINDOW + 4) {
    put(dut, offset, 1); /* nobody's there */
    ck_assert_int_eq(dut->bus_response, SLVERR);
    ck_assert_uint_eq(get(dut, SF_CSR_ERROR), SF_CSR_ERROR_ADDRESS);
    put(dut, SF_CSR_ERROR, SF_CSR_ERROR_ADDRESS);
  }
  read_both(dut, &r, SF_CSR_RAY_ERROR);
  same_interrupt(dut, &r);
  put(dut, SF_CSR_IRQ_ENABLE, SF_CSR_IRQ_ENABLE_ERROR);
  sf_dut_tick(dut);
  ck_assert(dut->out.irq);
  read_both(dut, &r, SF_CSR_RAY_BACKGROUND_G);
}

/* In either window. */
TEST(accesses_without_a_pause)
{
  static const accesses both_windows = {
      {{SF_CSR_EXP_BIAS, OKAY}, {SF_CSR_RAY_STATUS, SLVERR}, {SF_CSR_ID, SLVERR}, {SF_CSR_RAY_IRQ_ENABLE, OKAY}},
      {{SF_CSR_ID, SF_CSR_ID_RESET}, {SF_CSR_RAY_MAX_SAMPLES, 333}, {SF_CSR_RAY_TRANS_STOP, 99}, {SF_CSR_EXP_BIAS, 0}}};
  random_source s = {220, 0};
  OWNED(sf_dut) *dut = begin(s.seed);
  put(dut, SF_CSR_RAY_MAX_SAMPLES, 333);
  put(dut, SF_CSR_RAY_TRANS_STOP, 99);
  access_without_a_pause(dut, &s, &both_windows);
}

/* In which cycle of twelve a sample out of order was taken that is offered in cycle `beat`, and a write that is offered
 * from cycle `write` on; -1: not at all. */
typedef struct beside {
  int accepted, written;
} beside;

static beside error_beside_write(sf_dut *dut, registers *r, uint32_t offset, uint32_t value, int beat, int write)
{
  sf_pins_in *in = &dut->in;
  beside at = {-1, -1};
  soft_reset_both(dut, r);
  write_both(dut, r, SF_CSR_RAY_CTRL, SF_CSR_RAY_CTRL_START, WHOLE);
  in->awaddr = offset, in->wdata = value, in->wstrb = WHOLE, in->bready = true, in->ray_user = false;
  for (int cycle = 0; cycle < 12; cycle++) {
    in->ray_valid = cycle == beat;
    in->awvalid = in->wvalid = at.written < 0 && cycle >= write;
    sf_dut_tick(dut);
    if (in->ray_valid && dut->out.ray_ready) at.accepted = cycle;
    if (in->awvalid && dut->out.awready) at.written = cycle;
  }
  in->bready = false;
  ck_assert_int_ge(at.written, write);
  return at;
}

static sf_dut *begin_quietly(uint64_t seed, registers *r)
{
  sf_dut *dut = begin(seed);
  dut->each_cycle = NULL, dut->stall_percent = 0;
  program_legal(dut, r, &(random_source){seed, 0});
  return dut;
}

/* An error that comes while RAY_ERROR is written, in every cycle around it: cleared if it was there, else kept. It is
 * there a cycle after the beat that is out of order. */
TEST(an_error_beside_its_clearing)
{
  int kept = 0, cleared = 0;
  registers r = {0};
  OWNED(sf_dut) *dut = begin_quietly(230, &r);
  for (int beat = 0; beat < 6; beat++)
    for (int write = 0; write < 6; write++) {
      const beside at = error_beside_write(dut, &r, SF_CSR_RAY_ERROR, 0xf, beat, write);
      ck_assert_int_eq(at.accepted, beat);
      ck_assert_uint_eq(get(dut, SF_CSR_RAY_ERROR), at.accepted + 1 >= at.written ? SF_CSR_RAY_ERROR_ORDER : 0);
      *(at.accepted + 1 >= at.written ? &kept : &cleared) += 1;
    }
  ck_assert(kept > 5 && cleared > 5);
}

/* A sample out of order in every cycle around a soft reset: one that comes beside it is dropped like any other. */
TEST(an_error_beside_a_soft_reset)
{
  int together = 0;
  registers r = {0};
  OWNED(sf_dut) *dut = begin_quietly(231, &r);
  for (int beat = 0; beat < 6; beat++)
    for (int write = 0; write < 6; write++) {
      const beside at = error_beside_write(dut, &r, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET, beat, write);
      together += at.accepted == at.written;
      ck_assert_uint_eq(get(dut, SF_CSR_RAY_ERROR), 0);
    }
  ck_assert_int_gt(together, 3);
}

/* A response that waits is gone after a reset. */
TEST(a_hard_reset_drops_responses)
{
  OWNED(sf_dut) *dut = begin(260);
  sf_pins_in *in = &dut->in;
  dut->each_cycle = NULL;
  in->wstrb = WHOLE, in->wdata = 0, in->bready = in->rready = false;
  in->awaddr = in->araddr = SF_CSR_RAY_IRQ_ENABLE;
  in->awvalid = in->wvalid = in->arvalid = true;
  sf_dut_tick(dut);
  ck_assert(dut->out.awready && dut->out.arready);
  in->awvalid = in->wvalid = in->arvalid = false;
  sf_dut_tick(dut);
  ck_assert(dut->out.bvalid && dut->out.rvalid);
  in->rst_n = false;
  sf_dut_tick(dut);
  in->rst_n = true;
  sf_dut_tick(dut);
  ck_assert(!dut->out.bvalid && !dut->out.rvalid);
}
