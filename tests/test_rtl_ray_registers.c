/* The registers of sf_ray_top against a model of csr.def: what reads back, what is refused and how, the interrupt, both
 * windows behind one bus, and what reaches the encoder. */
#include "ck_run.h"
#include "quant/quant.h"
#include "sim/ray/ray.h"
#include "tests/dut_fixture.h"
#include "tests/fx_fixture.h"
#include "tests/random_net.h"

enum { ACCESSES = 8000, RAYS = 4, SAMPLES_MAX = 1024, OKAY = 0, SLVERR = 2, WHOLE = 0xf };
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

/* Address and data together, some bytes of the word alone. */
static void put_bytes(sf_dut *dut, uint32_t offset, uint32_t value, uint8_t strobe)
{
  sf_pins_in *in = &dut->in;
  in->awaddr = offset, in->wdata = value, in->wstrb = strobe;
  in->awvalid = in->wvalid = true, in->bready = false;
  do sf_dut_tick(dut);
  while (!dut->out.awready);
  in->awvalid = in->wvalid = false, in->bready = true;
  do sf_dut_tick(dut);
  while (!dut->out.bvalid);
  in->bready = false;
  dut->bus_response = dut->out.bresp;
}

static void same_interrupt(sf_dut *dut, const registers *r)
{
  sf_dut_tick(dut);
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

/* A master may show anything while it is not valid: addresses, values and bytes of other accesses. */
static void show_anything(void *context)
{
  sf_dut *dut = context;
  static const uint32_t shown[] = {SF_CSR_CTRL,         SF_CSR_RAY_CTRL,       SF_CSR_RAY_ERROR,  SF_CSR_RAY_TRANS_STOP,
                                   SF_CSR_ENCODER_DATA, SF_CSR_RAY_IRQ_ENABLE, SF_CSR_FIELD_BASE, 0x454};
  random_source s = {7, dut->cycle * 5};
  if (!dut->in.awvalid) dut->in.awaddr = shown[draw(&s, 0, 7)];
  if (!dut->in.wvalid) dut->in.wdata = draw(&s, 0, 1) ? (uint32_t)draw(&s, 0, 15) : UINT32_MAX;
  if (!dut->in.arvalid) dut->in.araddr = shown[draw(&s, 0, 7)];
  dut->in.ray_user = draw(&s, 0, 1);
}

static sf_dut *begin(uint64_t seed)
{
  sf_dut *dut;
  ck_ok(sf_dut_open_pins(&dut, &(sf_dut_options){.seed = seed, .stall_percent = 20}, sf_pins_open_rays));
  dut->each_cycle = show_anything, dut->each_cycle_context = dut;
  return dut;
}

static uint32_t near_a_limit(random_source *s, uint32_t now)
{
  static const uint32_t limit[] = {0, 1, 16, 1024, 2048, 1 << 16, 1 << 17, 1 << 18, 1 << 20, 1 << 21, 1u << 31};
  const uint32_t beside = (uint32_t)draw(s, -1, 1);
  if (draw(s, 0, 3) == 0) return now + beside;
  if (draw(s, 0, 7) == 0) return 1u << draw(s, 0, 31) | (uint32_t)draw(s, 0, 1);
  return limit[draw(s, 0, sizeof limit / sizeof *limit - 1)] + beside;
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
  random_source s = {200 + (uint64_t)_i, 0};
  registers r = {0};
  OWNED(sf_dut) *dut = begin(s.seed);
  int running = 0, refused = 0;
  for (uint32_t offset = WINDOW; offset < SF_CSR_FIELD_STALLS_HIGH + 8; offset += 4) read_both(dut, &r, offset);
  for (int i = 0; i < ACCESSES; i++) {
    const int64_t kind = draw(&s, 0, 99);
    const uint32_t offset = WINDOW + 4 * (uint32_t)(draw(&s, 0, 9) ? draw(&s, 0, 21) : draw(&s, 0, 255));
    const uint8_t strobe = draw(&s, 0, 9) ? WHOLE : (uint8_t)draw(&s, 0, 14);
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
      write_both(dut, &r, offset, near_a_limit(&s, model_read(&r, offset)), strobe);
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

/* The next access is offered while the response of the last one waits, in either window: as many responses as accesses,
 * in their order. */
TEST(accesses_without_a_pause)
{
  static const struct {
    uint32_t offset;
    int response;
  } write[] = {
      {SF_CSR_EXP_BIAS, OKAY}, {SF_CSR_RAY_STATUS, SLVERR}, {SF_CSR_ID, SLVERR}, {SF_CSR_RAY_IRQ_ENABLE, OKAY}};
  static const uint32_t read[][2] = {{SF_CSR_ID, SF_CSR_ID_RESET},
                                     {SF_CSR_RAY_MAX_SAMPLES, 333},
                                     {SF_CSR_RAY_TRANS_STOP, 99},
                                     {SF_CSR_VERSION, SF_CSR_VERSION_RESET}};
  random_source s = {220, 0};
  OWNED(sf_dut) *dut = begin(s.seed);
  sf_pins_in *in = &dut->in;
  put(dut, SF_CSR_RAY_MAX_SAMPLES, 333);
  put(dut, SF_CSR_RAY_TRANS_STOP, 99);
  dut->each_cycle = NULL;
  int written = 0, answered = 0, asked = 0, given = 0;
  in->wstrb = WHOLE, in->wdata = 0;
  for (int cycle = 0; cycle < 4000; cycle++) {
    const bool both = draw(&s, 0, 1); /* address and data at once, or one of them early */
    in->awvalid = both || draw(&s, 0, 1), in->wvalid = both || draw(&s, 0, 1);
    in->arvalid = draw(&s, 0, 3) > 0;
    in->awaddr = write[written % 4].offset;
    in->araddr = read[asked % 4][0];
    in->bready = draw(&s, 0, 2) == 0;
    in->rready = draw(&s, 0, 2) == 0;
    sf_dut_tick(dut);
    if (dut->out.bvalid) ck_assert_int_eq(dut->out.bresp, write[answered % 4].response);
    if (dut->out.rvalid) {
      ck_assert_uint_eq(dut->out.rdata, read[given % 4][1]);
      ck_assert_uint_eq(dut->out.rresp, OKAY);
    }
    answered += dut->out.bvalid && in->bready;
    given += dut->out.rvalid && in->rready;
    const bool taken = dut->out.awready && in->awvalid;
    ck_assert(taken == (dut->out.wready && in->wvalid));
    written += taken;
    asked += dut->out.arready && in->arvalid;
    ck_assert(written >= answered && written <= answered + 1);
    ck_assert(asked >= given && asked <= given + 1);
  }
  ck_assert_int_gt(written, 400);
  ck_assert_int_gt(asked, 400);
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

/* ---- the encoder's words ---- */

static sf_ray_sample samples[RAYS][SAMPLES_MAX];

static void renders(sf_ray_dut *rays, uint64_t seed)
{
  const fx_scene *scene = rays->scene;
  fx_ray ray[RAYS];
  fx_pixel expected, actual[RAYS];
  fx_counts counts = {0};
  sf_ray_request request[RAYS];
  uint64_t count = 0;
  for (uint64_t i = 0; i < RAYS; i++) {
    ray[i] = random_ray(scene, seed, i);
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &expected, &counts));
    sf_ray_samples(scene, &ray[i], samples[i], (int)expected.samples);
    request[i] = (sf_ray_request){&ray[i], samples[i], (int)expected.samples, false, i == 0};
    count += expected.samples;
  }
  ck_assert_uint_gt(count, 0);
  ck_ok(sf_ray_dut_run(rays, request, RAYS, actual));
  for (int i = 0; i < RAYS; i++) {
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &expected, &counts));
    ck_assert_mem_eq(actual[i].colour, expected.colour, sizeof expected.colour);
    ck_assert_uint_eq(actual[i].depth, expected.depth);
  }
}

/* Writes of the other registers, refused words, what a master shows while it is not valid: nothing of it gets there. */
TEST(the_encoder_is_programmed_by_its_words_alone)
{
  static const fixture_sizes sizes = {4, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 21);
  scene.step_q24 = 1 << 20;
  memset(scene.occupancy, 0xff, 64);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 240, .stall_percent = 10}));
  sf_dut *dut = rays->dut;
  for (uint32_t word = 0; word < 8 * 4; word++) { /* of the four levels, and at last the three behind them */
    const uint32_t address = word < 8 * 4 - 3 ? word : 0x80 + word - (8 * 4 - 3);
    put(dut, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
    put(dut, SF_CSR_ENCODER_ADDRESS, address);
    for (uint32_t o = 0; o < 3; o++) put(dut, SF_CSR_RAY_BACKGROUND_R + 4 * o, (uint32_t)scene.background[o]);
    put(dut, SF_CSR_RAY_MAX_SAMPLES, (uint32_t)scene.max_samples);
    put(dut, SF_CSR_RAY_TRANS_STOP, (uint32_t)scene.trans_stop);
    put_bytes(dut, SF_CSR_ENCODER_DATA, 1, 7);
    put(dut, SF_CSR_RAY_ERROR, ~0u);
    dut->each_cycle = show_anything, dut->each_cycle_context = dut;
    for (int i = 0; i < 40; i++) sf_dut_tick(dut);
    dut->each_cycle = sf_memory_cycle, dut->each_cycle_context = &rays->memory;
    ck_assert_uint_eq(get(dut, SF_CSR_ENCODER_ADDRESS), address);
    ck_assert_int_eq(sf_driver_start(&dut->bus), SF_DRIVER_OK);
    put(dut, SF_CSR_RAY_CTRL, SF_CSR_RAY_CTRL_START);
    put(dut, SF_CSR_ENCODER_DATA, 1); /* while it runs */
    ck_assert_int_eq(dut->bus_response, SLVERR);
    put(dut, SF_CSR_RAY_ERROR, ~0u);
    renders(rays, word);
  }
}

/* From the first sample that is taken to the pixel that is taken, whoever works on it. */
TEST(active_until_the_pixel_has_left)
{
  enum { IDLE = SF_CSR_RAY_STATUS_RUNNING, BUSY = IDLE | SF_CSR_RAY_STATUS_ACTIVE };
  static const fixture_sizes sizes = {16, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 22);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 250}));
  sf_dut *dut = rays->dut;
  ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), IDLE);
  for (int empty = 0; empty < 2; empty++) {
    dut->in.ray_valid = dut->in.ray_user = dut->in.ray_last = true, dut->in.pixel_ready = false;
    memset(dut->in.ray_data, 0, sizeof dut->in.ray_data);
    dut->in.ray_data[3] = (uint64_t)empty << 48;
    sf_dut_tick(dut);
    ck_assert(dut->out.ray_ready);
    dut->in.ray_valid = false;
    int polls = 0;
    for (; !dut->out.pixel_valid; polls++) ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), BUSY);
    ck_assert_int_gt(polls, empty ? 0 : 20);
    for (int i = 0; i < 20; i++) ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), BUSY);
    dut->in.pixel_ready = true;
    sf_dut_tick(dut);
    ck_assert_uint_eq(get(dut, SF_CSR_RAY_STATUS), IDLE);
  }
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
