/* sf_exp_neg and sf_composite against fx_exp_neg and fx_composite_*. */
#include "Vsf_composite.h"
#include "Vsf_exp_neg.h"
#include "tests/rtl_unit.h"
#include <deque>

template <class T, size_t n> static T pick(random_draw &draw, const T (&table)[n])
{
  return table[draw(0, (int64_t)n - 1)];
}

static uint64_t wide(random_draw &draw, int bits)
{
  const uint64_t high = (uint64_t)draw(0, (1 << 16) - 1) << 32, low = (uint64_t)draw(0, UINT32_MAX - 1);
  return (high | low) & (((uint64_t)1 << bits) - 1);
}

/* ---- exp(-tau) ---- */

enum { EXP_LATENCY = 9, TAU_MAX = 32 << SF_TRANS_FRAC };

struct exp_bench {
  unit<Vsf_exp_neg> u{1};
  uint64_t tau[EXP_LATENCY] = {}; /* on their way */

  void next(uint64_t value)
  {
    uint64_t &slot = tau[u.cycle % EXP_LATENCY];
    u.top.tau_i = value;
    u.settle();
    if (u.cycle >= EXP_LATENCY && u.top.e_o != fx_exp_neg(slot))
      ck_abort_msg("tau %llu: expected %u, actual %u", (unsigned long long)slot, fx_exp_neg(slot), u.top.e_o);
    slot = value;
    u.edge();
  }
};

/* Every input up to the clamp, then up to the widest that a product of density and distance gives. */
TEST(exp_neg)
{
  exp_bench b;
  random_draw draw(1);
  for (uint64_t tau = 0; tau <= TAU_MAX + 16; tau++) b.next(tau);
  for (int bit = 25; bit <= 36; bit++)
    for (int i = -2; i <= (bit < 36 ? 2 : 0); i++) b.next(((uint64_t)1 << bit) + (uint64_t)(int64_t)i);
  for (int i = 0; i < 100000 * unit_length(); i++) b.next(wide(draw, 36));
  for (int i = 0; i < EXP_LATENCY; i++) b.next(0);
}

/* ---- compositor ---- */

enum { PATIENCE = 10000, RAY_MAX = 40, STOP_LATENCY = 20, SAMPLE_CYCLES, PIXEL_CYCLES = 7 };

struct sample {
  fx_out out = {};
  int32_t delta = 0;
  uint64_t distance = 0;
  bool first = false, last = false, empty = false;
};

/* What the core would make of the samples that were given, and how far the hardware is. */
struct bench {
  unit<Vsf_composite> u;
  random_draw draw;
  int stall;
  int32_t background[3] = {};
  std::deque<fx_pixel> expected;                                    /* pixels that have not come yet */
  uint64_t pixels = 0, stops = 0, stops_expected = 0, taken_at = 0; /* taken_at: cycle of the last sample */
  fx_pixel now = {};
  bool open = false;

  bench(uint64_t seed, int stall_percent) : u(seed), draw(seed), stall(stall_percent)
  {
    u.top.valid_i = 0, u.top.ready_i = 0;
    u.top.weighed_i = u.top.decoded_i = 0, u.top.weight_i = 0;
    u.reset();
  }

  /* Between rays only. */
  void program(uint32_t trans_stop, uint32_t max_samples)
  {
    static const int32_t ends[] = {0, 1, 32768, 65535, 65536};
    u.top.trans_stop_i = trans_stop, u.top.max_samples_i = (uint16_t)max_samples;
    for (int32_t &colour : background) colour = draw.percent(50) ? pick(draw, ends) : (int32_t)wide(draw, 16);
    u.top.background_i = (uint64_t)background[0] | (uint64_t)background[1] << 17 | (uint64_t)background[2] << 34;
  }

  void same_pixel()
  {
    ck_assert(!expected.empty());
    const fx_pixel e = expected.front();
    const uint64_t mask = ((uint64_t)1 << 40) - 1, w0 = u.top.colour_o[0], w1 = u.top.colour_o[1],
                   w2 = u.top.colour_o[2], w3 = u.top.colour_o[3];
    ck_assert_uint_eq(u.top.weight_sum_o + u.top.transmittance_o, FX_TRANS_ONE); /* conservation */
    ck_assert_uint_eq(u.top.transmittance_o, e.transmittance);
    ck_assert_uint_eq(u.top.weight_sum_o, e.weight_sum);
    ck_assert_uint_eq(u.top.samples_o, e.samples);
    ck_assert_uint_eq((w0 | w1 << 32) & mask, e.colour[0]);
    ck_assert_uint_eq((w1 >> 8 | w2 << 24) & mask, e.colour[1]);
    ck_assert_uint_eq(w2 >> 16 | w3 << 16, e.colour[2]);
    ck_assert_uint_eq(u.top.depth_o, e.depth);
    expected.pop_front();
    pixels++;
  }

  /* True when a sample that is offered is taken. */
  bool cycle()
  {
    u.top.ready_i = !draw.percent(stall);
    u.settle();
    const bool taken = u.top.valid_i && u.top.ready_o;
    if (open || !expected.empty()) ck_assert(!u.top.idle_o);
    stops += u.top.stop_o;
    if (u.top.stop_o) ck_assert_uint_eq(u.cycle - taken_at, STOP_LATENCY);
    if (taken) taken_at = u.cycle;
    if (u.top.valid_o && u.top.ready_i) same_pixel();
    u.edge();
    return taken;
  }

  /* The core's rules for one more sample of the current ray. */
  void expect(const sample &s)
  {
    if (s.first || s.empty) fx_composite_begin(&now), open = true;
    if (!open) return;
    if (!s.empty) fx_composite_add(&now, &s.out, s.delta, s.distance);
    const bool stop =
        !s.empty && (now.transmittance <= u.top.trans_stop_i || now.samples >= (uint32_t)u.top.max_samples_i);
    if (!stop && !s.last && !s.empty) return;
    fx_composite_end(&now, background);
    expected.push_back(now);
    stops_expected += stop && !s.last;
    open = false;
  }

  void give(const sample &s)
  {
    while (draw.percent(stall)) cycle();
    u.top.valid_i = 1;
    u.top.first_i = s.first, u.top.last_i = s.last, u.top.empty_i = s.empty;
    u.top.sigma_i = s.out.sigma, u.top.delta_i = (uint32_t)s.delta, u.top.distance_i = s.distance;
    u.top.colour_i = s.out.colour[0] | (uint64_t)s.out.colour[1] << 20 | (uint64_t)s.out.colour[2] << 40;
    for (int i = 0; !cycle(); i++)
      if (i == PATIENCE) ck_abort_msg("no answer at cycle %llu", (unsigned long long)u.cycle);
    u.top.valid_i = 0;
    expect(s);
  }

  void drain()
  {
    for (int i = 0; !expected.empty() || !u.top.idle_o; i++) {
      if (i == PATIENCE) ck_abort_msg("no answer at cycle %llu", (unsigned long long)u.cycle);
      cycle();
    }
    ck_assert_uint_eq(stops, stops_expected);
  }
};

static const uint32_t sigma_ends[] = {0, 1, 2, 15, 4095, 4096, 65535, 1 << 20, (1 << 28) - 1, 1 << 27};
static const int32_t delta_ends[] = {0, 1, 2, 65535, 1 << 16, 1 << 20, (1 << 24) - 1, 1 << 24};
static const uint32_t colour_ends[] = {0, 1, 65535, 65536, (1 << 20) - 1};

enum kind { CORNERS, FOG, MATTER, ANYTHING, KINDS };

static sample draw_sample(random_draw &draw, int kind)
{
  sample s;
  for (uint32_t &c : s.out.colour)
    c = kind == CORNERS ? pick(draw, colour_ends) : (uint32_t)wide(draw, kind == ANYTHING ? 20 : 16);
  if (kind == CORNERS) {
    s.out.sigma = pick(draw, sigma_ends), s.delta = pick(draw, delta_ends);
    s.distance = draw.percent(50) ? ((uint64_t)1 << 44) - 1 : 0;
    return s;
  }
  s.out.sigma = (uint32_t)wide(draw, kind == FOG ? 14 : kind == MATTER ? 22 : 28);
  s.delta = (int32_t)wide(draw, kind == ANYTHING ? 24 : 17);
  s.distance = wide(draw, kind == ANYTHING ? 44 : 28);
  return s;
}

static void random_ray(bench &b, int kind)
{
  const int n = (int)(b.draw.percent(70) ? b.draw(1, 6) : b.draw(1, RAY_MAX));
  if (b.draw.percent(10)) {
    sample s = draw_sample(b.draw, kind);
    s.first = b.draw.percent(50), s.last = s.empty = true; /* empty alone begins a ray, too */
    b.give(s);
  }
  for (int i = 0; i < n; i++) {
    sample s = draw_sample(b.draw, kind);
    s.first = i == 0, s.last = i == n - 1;
    b.give(s);
  }
}

LOOP_TEST(random_rays, 8)
{
  static const uint32_t stops[] = {0, 1, 1048, 10486, 1 << 19, (1 << 20) - 1};
  static const uint32_t limits[] = {1, 2, 5, 16, 1024};
  bench b(100 + (uint64_t)_i, _i % 4 * 30);
  for (int round = 0; round < 20 * unit_length(); round++) {
    b.program(pick(b.draw, stops), pick(b.draw, limits));
    for (int ray = 0; ray < 40; ray++) random_ray(b, (int)b.draw(0, KINDS - 1));
    b.drain();
  }
  ck_assert_uint_gt(b.stops, 20); /* rays that went on after their pixel */
  ck_assert_uint_gt(b.pixels, 800);
}

/* Rays of one sample over all small densities and distances, and every pair of corners. */
TEST(one_sample_rays)
{
  bench b(200, 0);
  b.program(0, 1024);
  sample s;
  s.first = s.last = true;
  s.out.colour[0] = 65536, s.out.colour[1] = 1, s.out.colour[2] = 1048575, s.distance = 3 << 16;
  for (uint32_t sigma = 0; sigma < 256; sigma++)
    for (int32_t delta = 0; delta < 256; delta++) {
      s.out.sigma = sigma << 4, s.delta = delta << 10;
      b.give(s);
    }
  for (uint32_t sigma : sigma_ends)
    for (int32_t delta : delta_ends) {
      s.out.sigma = sigma, s.delta = delta;
      b.give(s);
    }
  b.drain();
}

/* A sample in every SAMPLE_CYCLES cycles, and a pixel PIXEL_CYCLES behind the last. */
TEST(the_pace)
{
  bench b(210, 0);
  b.program(0, 1024);
  sample s;
  s.out.sigma = 4096, s.delta = 1 << 16;
  for (int n = 1; n < 20; n++) {
    for (int i = 0; i < n; i++) {
      const uint64_t before = b.taken_at;
      s.first = i == 0, s.last = i == n - 1;
      b.give(s);
      if (i) ck_assert_uint_eq(b.taken_at - before, SAMPLE_CYCLES);
    }
    b.drain();
    ck_assert_uint_eq(b.u.cycle - b.taken_at, SAMPLE_CYCLES + PIXEL_CYCLES);
  }
}

static void long_ray(bench &b, uint32_t sigma, int32_t delta, int n)
{
  for (int i = 0; i < n; i++) {
    sample s;
    s.first = i == 0, s.last = i == n - 1;
    s.out = {sigma, {1048575, 65536, (uint32_t)i}};
    s.delta = delta, s.distance = (uint64_t)i << 16;
    b.give(s);
  }
}

/* Nothing is lost where a ray is empty, opaque at once, at its limit, or so thin or dark that rounding takes over. */
TEST(hard_rays)
{
  bench b(300, 10);
  b.program(0, 1024);
  long_ray(b, 0, 1 << 14, 1024);          /* empty space up to the limit */
  long_ray(b, (1 << 28) - 1, 1 << 24, 3); /* opaque: the first sample takes everything */
  long_ray(b, 1, 1, 1024);                /* sigma * delta rounds to 0 */
  long_ray(b, 1 << 12, 1 << 18, 1024);    /* fog, down to where transmittance only rounds */
  long_ray(b, 40 << 12, 1 << 22, 40);     /* transmittance underflows to 0 */
  b.drain();
  b.program(0, 5);
  long_ray(b, 1 << 8, 1 << 16, 40); /* the limit cuts it */
  b.drain();
  ck_assert_uint_ge(b.stops, 3);
}

/* Reset, soft or hard, in any cycle of a ray: nothing of it is left in the next one. */
TEST(reset_in_mid_ray)
{
  bench b(400, 0);
  for (int wait = 0; wait < 60; wait++)
    for (int hard = 0; hard < 2; hard++) {
      b.program(1048, 1024);
      sample s = draw_sample(b.draw, MATTER);
      s.first = true;
      b.give(s);
      s.first = false, s.last = wait % 2;
      b.give(s);
      for (int i = 0; i < wait % 30; i++) b.cycle();
      CData &signal = hard ? b.u.top.rst_ni : b.u.top.clear_i;
      signal = !hard;
      b.u.edge();
      signal = hard;
      b.expected.clear(), b.stops = b.stops_expected, b.open = false;
      b.cycle();
      ck_assert(b.u.top.idle_o);
      ck_assert(!b.u.top.valid_o);
      s.first = false; /* the rest of the old ray is nobody's */
      b.give(s);
      for (int ray = 0; ray < 3; ray++) random_ray(b, FOG);
      b.drain();
    }
}

int ck_timeout = 120;
