/* For the tests of registers: accesses of whole words and of parts, values near limits, accesses without a pause. */
#ifndef SF_TESTS_REGISTER_BUS_H
#define SF_TESTS_REGISTER_BUS_H
#include "tests/dut_fixture.h"
#include "tests/random_net.h"

enum { OKAY = 0, SLVERR = 2, WHOLE = 0xf };

/* Address and data together, some bytes of the word alone. */
static inline void put_bytes(sf_dut *dut, uint32_t offset, uint32_t value, uint8_t strobe)
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

/* A master may show anything while it is not valid: addresses, values and bytes of other accesses to sf_ray_top. */
static inline void show_any_access(void *context)
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

/* Seldom a part of the word, which is refused. */
static inline uint8_t draw_strobe(random_source *s)
{
  return draw(s, 0, 9) ? WHOLE : (uint8_t)draw(s, 0, 14);
}

/* A value at or beside one of n limits, or beside the value that is there. */
static inline uint32_t near_a_limit(random_source *s, uint32_t now, const uint32_t *limit, int n)
{
  const uint32_t beside = (uint32_t)draw(s, -1, 1);
  if (draw(s, 0, 3) == 0) return now + beside;
  if (draw(s, 0, 7) == 0) return now | 1u << draw(s, 0, 31);
  return limit[draw(s, 0, n - 1)] + beside;
}

/* Registers that are written in turn, and what each write is answered; registers that are read, and what they hold. */
typedef struct accesses {
  struct {
    uint32_t offset;
    int response;
  } write[4];
  struct {
    uint32_t offset, value;
  } read[4];
} accesses;

/* The next access is offered while the response of the last one waits: as many responses as accesses, in their order;
 * address and data at once, or one of them early. EXP_BIAS, the first that is written, is read, too: it holds one of
 * the last two values. */
static inline void access_without_a_pause(sf_dut *dut, random_source *s, const accesses *a)
{
  sf_pins_in *in = &dut->in;
  int written = 0, answered = 0, asked = 0, given = 0;
  dut->each_cycle = NULL;
  in->wstrb = WHOLE;
  for (int cycle = 0; cycle < 4000; cycle++) {
    const bool both = draw(s, 0, 1);
    in->awvalid = both || draw(s, 0, 1), in->wvalid = both || draw(s, 0, 1);
    in->arvalid = draw(s, 0, 3) > 0;
    in->awaddr = a->write[written % 4].offset, in->wdata = (uint32_t)written;
    in->araddr = a->read[asked % 4].offset;
    in->bready = draw(s, 0, 2) == 0;
    in->rready = draw(s, 0, 2) == 0;
    sf_dut_tick(dut);
    if (dut->out.bvalid) ck_assert_int_eq(dut->out.bresp, a->write[answered % 4].response);
    if (dut->out.rvalid) {
      const uint32_t value = dut->out.rdata;
      if (a->read[given % 4].offset == SF_CSR_EXP_BIAS)
        ck_assert(value % 4 == 0 && value <= (uint32_t)written && value + 8 >= (uint32_t)written);
      else
        ck_assert_uint_eq(value, a->read[given % 4].value);
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
#endif
