/* sf_sh against fx_sh. */
#include "Vsf_sh.h"
#include "tests/rtl_unit.h"

typedef unit<Vsf_sh> sh_unit;

static uint64_t pack(const int16_t v[3])
{
  return (uint64_t)(uint16_t)v[2] << 32 | (uint64_t)(uint16_t)v[1] << 16 | (uint16_t)v[0];
}

/* Offers a direction until it is taken. */
static void offer(sh_unit &u, const int16_t v[3], int n, int frac)
{
  const uint64_t begin = u.cycle;
  u.top.n_i = (uint8_t)n, u.top.frac_i = (uint8_t)frac;
  u.top.unit_i = pack(v), u.top.valid_i = 1;
  for (bool taken = false; !taken; u.edge()) {
    u.settle();
    taken = u.top.ready_o;
    ck_assert_msg(taken || u.cycle - begin < 100, "not ready again after 100 cycles");
  }
  u.top.valid_i = 0, u.top.unit_i = 0x123456789abc;
}

/* Returns the cycles from the first after the offer to the last value. A value that waits must not change. */
static uint64_t receive(sh_unit &u, random_draw &draw, int stall, const int16_t v[3], int n, int frac)
{
  int16_t expected[FX_SH];
  const uint64_t begin = u.cycle;
  fx_sh(v, frac, expected);
  for (int i = 0; i < n;) {
    u.top.ready_i = !draw.percent(stall);
    u.settle();
    ck_assert_uint_lt(u.cycle - begin, 5000);
    if (u.top.valid_o) {
      const int got = (int16_t)(u.top.dir_o << 4) >> 4;
      ck_assert_msg(got == expected[i], "(%d, %d, %d), LSB 2^-%d: harmonic %d is %d, expected %d", v[0], v[1], v[2],
                    frac, i, got, expected[i]);
      ck_assert_int_eq(u.top.last_o, i == n - 1);
      i += u.top.ready_i;
    }
    u.edge();
  }
  return u.cycle - begin;
}

static void one(sh_unit &u, random_draw &draw, int stall, const int16_t v[3], int n, int frac)
{
  offer(u, v, n, frac);
  const uint64_t cycles = receive(u, draw, stall, v, n, frac);
  if (stall == 0) ck_assert_uint_eq(cycles, (uint64_t)(2 * n + 14));
  u.top.ready_i = 1;
  for (int i = 0; i < 3; i++) { /* and no value more */
    u.settle();
    ck_assert(!u.top.valid_o);
    u.edge();
  }
}

/* Each axis over its whole range, the others at ends and in between: all of their values in long runs. */
LOOP_TEST(axes_over_their_range, 3)
{
  static const int16_t other[] = {0, 1, -1, 16384, -16384, 11585, -9459, INT16_MIN, INT16_MAX};
  const int count = (int)(sizeof other / sizeof *other), stride = unit_length() > 1 ? 1 : 61;
  sh_unit u(1);
  random_draw draw(1);
  u.reset();
  for (int value = INT16_MIN + _i; value <= INT16_MAX; value += stride) {
    int16_t v[3] = {other[draw(0, count - 1)], other[draw(0, count - 1)], other[draw(0, count - 1)]};
    v[_i] = (int16_t)value;
    one(u, draw, 0, v, 16, value & 1 ? 11 : (int)draw(0, 11));
  }
}

TEST(corners)
{
  static const int16_t axis[] = {0, 1, -1, 16384, -16384, 16385, -16385, INT16_MIN, INT16_MAX, 8192};
  sh_unit u(2);
  random_draw draw(2);
  u.reset();
  for (int i = 0; i < 1000; i++) {
    const int16_t v[3] = {axis[i % 10], axis[i / 10 % 10], axis[i / 100]};
    one(u, draw, 0, v, 16, 11);
  }
}

LOOP_TEST(random_directions_and_stalls, 3)
{
  sh_unit u((uint64_t)_i + 3);
  random_draw draw((uint64_t)_i + 3);
  u.reset();
  for (int i = 0; i < 2000 * unit_length(); i++) {
    const int limit = draw.percent(20) ? 32767 : 16384;
    const int16_t v[3] = {(int16_t)draw(-limit, limit), (int16_t)draw(-limit, limit), (int16_t)draw(-limit, limit)};
    one(u, draw, 1 + 30 * _i, v, (int)draw(1, 16), (int)draw(0, 11));
  }
}

/* Clear and reset at every cycle of a direction leave nothing of it behind. */
TEST(reset_on_the_way)
{
  const int16_t full[3] = {-16384, 16384, 16384}, v[3] = {9459, -9459, 9459};
  sh_unit u(9);
  random_draw draw(9);
  u.reset();
  for (int delay = 0; delay < 60; delay++) {
    offer(u, full, 16, 11);
    u.top.ready_i = delay % 3 != 0;
    for (int i = 0; i < delay; i++) u.edge();
    if (delay & 1) {
      u.top.rst_ni = 0;
      u.edge();
      u.top.rst_ni = 1;
    } else {
      u.top.clear_i = 1;
      u.edge();
      u.top.clear_i = 0;
    }
    one(u, draw, 0, v, 16, 10);
  }
}

int ck_timeout = 600;
