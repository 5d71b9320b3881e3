/* sf_ray_track: samples on their way to the encoder and to the compositor, and the early end of a ray. There is no
 * function in C like it; the model here is the list of what must come out where, and which samples count. */
#include "Vsf_ray_track.h"
#include "tests/rtl_unit.h"
#include <deque>

enum { DEPTH = 16, POS_WORDS = 3 };

struct sample {
  bool first = false, last = false, empty = false;
  bool tile = false; /* counts on the first sample alone */
  uint32_t pos[POS_WORDS] = {};
  uint64_t dir = 0, distance = 0;
  uint32_t delta = 0;
  uint64_t ray = 0; /* counted by the model */
};

static uint64_t wide(random_draw &draw, int bits)
{
  const uint64_t high = (uint64_t)draw(0, (1 << 16) - 1) << 32, low = (uint64_t)draw(0, UINT32_MAX - 1);
  return (high | low) & (((uint64_t)1 << bits) - 1);
}

static sample draw_sample(random_draw &draw)
{
  sample s;
  for (int i = 0; i < POS_WORDS; i++) s.pos[i] = (uint32_t)wide(draw, i == 2 ? 8 : 32);
  s.dir = wide(draw, 48), s.distance = wide(draw, 44), s.delta = (uint32_t)wide(draw, 25);
  s.tile = draw.percent(30);
  return s;
}

struct bench {
  unit<Vsf_ray_track> u;
  random_draw draw;
  sink_stalls encoder_stalls, compositor_stalls;
  std::deque<sample> held, compositor; /* at the input, one at most; what must still come out */
  bool inside = false, drop = false, broken = false;
  bool taken_any = false, new_tile = false; /* new_tile: since the last position */
  uint64_t ray = 0, composed = 0;           /* of the last sample in, of the last one out */
  int stop_percent = 0;
  uint64_t accepted = 0, dropped = 0, stops = 0, deepest = 0;

  explicit bench(uint64_t seed, int stall = 0) : u(seed), draw(seed)
  {
    encoder_stalls.percent = compositor_stalls.percent = stall;
    u.top.valid_i = 0, u.top.encode_ready_i = 0, u.top.take_i = 0, u.top.stop_i = 0, u.top.enable_i = 1;
    u.reset();
  }

  void forget()
  {
    held.clear(), compositor.clear();
    inside = drop = broken = taken_any = new_tile = false;
    ray = 0;
  }

  void offer(const sample &s)
  {
    u.top.valid_i = 1;
    u.top.first_i = s.first, u.top.last_i = s.last, u.top.empty_i = s.empty;
    u.top.tile_i = s.tile;
    for (int i = 0; i < POS_WORDS; i++) u.top.pos_i[i] = s.pos[i];
    u.top.dir_i = s.dir, u.top.delta_i = s.delta, u.top.distance_i = s.distance;
  }

  void same_encoder(const sample &e)
  {
    ck_assert_uint_eq(u.top.encode_first_o, e.first);
    ck_assert_uint_eq(u.top.encode_tile_o, new_tile || (e.first && e.tile));
    for (int i = 0; i < POS_WORDS; i++) ck_assert_uint_eq(u.top.encode_pos_o[i], e.pos[i]);
    if (e.first) ck_assert_uint_eq(u.top.encode_dir_o, e.dir);
  }

  void same_compositor()
  {
    const sample &e = compositor.front();
    ck_assert_uint_eq(u.top.first_o, e.first);
    ck_assert_uint_eq(u.top.last_o, e.last);
    ck_assert_uint_eq(u.top.empty_o, e.empty);
    ck_assert_uint_eq(u.top.delta_o, e.delta);
    ck_assert_uint_eq(u.top.distance_o, e.distance);
  }

  bool swallows() const { return broken || (inside && drop); }

  /* The order is wrong: a ray that begins inside another or not at all; an empty one is a ray of its own. */
  bool wrong(const sample &s) const { return s.first == inside || (s.empty && !(s.first && s.last)); }

  void enter(const sample &s)
  {
    if (broken || (inside && drop && !wrong(s))) {
      dropped += !broken;
      inside = broken ? inside : !s.last;
      return;
    }
    if (wrong(s)) {
      broken = true;
      return;
    }
    sample in = s;
    ray += s.first, in.ray = ray, inside = !s.last;
    compositor.push_back(in);
    new_tile = new_tile || (s.first && s.tile);
    if (!s.empty) new_tile = false;
    accepted++;
    if (compositor.size() > deepest) deepest = compositor.size();
  }

  /* True when the sample that is offered, if any, is taken. */
  bool cycle(const sample *s = nullptr)
  {
    u.top.encode_ready_i = !encoder_stalls(draw, u.cycle);
    const bool take = !compositor.empty() && !compositor_stalls(draw, u.cycle);
    u.top.take_i = take;
    u.top.stop_i = taken_any && draw.percent(stop_percent);
    u.settle();
    const bool moves = !held.empty() && (swallows() || (u.top.encode_ready_i && compositor.size() < DEPTH));
    const bool in = moves && !swallows() && !wrong(held.front());
    ck_assert_uint_eq(u.top.ready_o, held.empty() && (u.top.enable_i || swallows()));
    ck_assert_uint_eq(u.top.valid_o, !compositor.empty());
    ck_assert_uint_eq(u.top.encode_valid_o, in && !held.front().empty);
    ck_assert_uint_eq(u.top.idle_o, compositor.empty() && (held.empty() || broken));
    ck_assert_uint_eq(u.top.error_order_o, moves && !broken && wrong(held.front()));
    if (u.top.valid_o) same_compositor();
    if (u.top.encode_valid_o) same_encoder(held.front());
    const bool stop_here = u.top.stop_i && composed == ray, given = s && u.top.ready_o;
    stops += stop_here && inside;
    const uint64_t before = ray;
    if (moves) enter(held.front()), held.pop_front();
    if (given) held.push_back(*s);
    drop = ray == before && (drop || stop_here);
    if (take) composed = compositor.front().ray, taken_any = true, compositor.pop_front();
    u.edge();
    return given;
  }

  void give(const sample &s)
  {
    while (draw.percent(encoder_stalls.percent)) cycle();
    offer(s);
    for (int i = 0; !cycle(&s); i++)
      if (i == 5000) ck_abort_msg("not taken at cycle %llu", (unsigned long long)u.cycle);
    u.top.valid_i = 0;
  }

  void drain()
  {
    for (int i = 0; !held.empty() || !compositor.empty(); i++) {
      if (i == 5000) ck_abort_msg("not idle at cycle %llu", (unsigned long long)u.cycle);
      cycle();
    }
    u.settle();
    ck_assert(u.top.idle_o);
  }
};

static void random_ray(bench &b)
{
  const int n = (int)(b.draw.percent(50) ? b.draw(1, 3) : b.draw(1, 60));
  if (b.draw.percent(15)) {
    sample s = draw_sample(b.draw);
    s.first = s.last = s.empty = true;
    b.give(s);
  }
  for (int i = 0; i < n; i++) {
    sample s = draw_sample(b.draw);
    s.first = i == 0, s.last = i == n - 1;
    b.give(s);
  }
}

/* Stalls, and rays that end early in any cycle: what was inside comes out, what comes later is dropped, and the next
 * ray loses nothing. */
LOOP_TEST(random_rays, 8)
{
  bench b(100 + (uint64_t)_i, _i % 4 * 30);
  static const int stop[] = {0, 2, 10, 60};
  for (int round = 0; round < 8 * unit_length(); round++) {
    b.stop_percent = stop[round % 4];
    for (int ray = 0; ray < 60; ray++) random_ray(b);
    b.drain();
  }
  ck_assert_uint_gt(b.accepted, 1000);
  ck_assert_uint_gt(b.dropped, 100);
  ck_assert_uint_gt(b.stops, 50);
  if (b.compositor_stalls.percent) ck_assert_uint_eq(b.deepest, DEPTH);
}

/* Sixteen rays wait inside; a stop of an old one is not that of the ray that is coming in. */
TEST(a_late_stop_hits_nobody)
{
  bench b(200);
  for (int round = 0; round < 200 * unit_length(); round++) {
    b.compositor_stalls.until = UINT64_MAX;
    for (int ray = 0; ray < DEPTH - 1; ray++) {
      sample s = draw_sample(b.draw);
      s.first = true, s.last = ray < DEPTH - 2;
      b.give(s);
    }
    b.compositor_stalls.until = 0;
    b.stop_percent = 100;
    for (int i = 0; i < DEPTH - 2; i++) b.cycle(); /* all but the last ray leave, each with a stop behind it */
    ck_assert_uint_eq(b.dropped, 0);
    ck_assert(!b.drop);
    b.stop_percent = 0;
    sample s = draw_sample(b.draw);
    s.last = true;
    b.give(s);
    b.drain();
  }
}

/* A ray that begins inside another, or that lacks its beginning; an empty one inside another, without a beginning or
 * without an end: one error, then nothing until a clear. */
TEST(wrong_order)
{
  static const struct {
    bool inside, first, last, empty;
  } wrong[] = {{false, false, false, false}, {true, true, false, false}, {true, false, false, true},
               {true, false, true, true},    {true, true, true, true},   {false, true, false, true},
               {false, false, true, true}};
  for (size_t kind = 0; kind < sizeof wrong / sizeof *wrong; kind++)
    for (int hard = 0; hard < 2; hard++) {
      bench b(300 + (uint64_t)(2 * kind + hard), 20);
      random_ray(b);
      sample s = draw_sample(b.draw);
      s.first = true;
      if (wrong[kind].inside) b.give(s);
      s.first = wrong[kind].first, s.last = wrong[kind].last, s.empty = wrong[kind].empty;
      b.give(s);
      while (!b.held.empty()) b.cycle();
      ck_assert(b.broken);
      b.u.top.enable_i = 0; /* nothing holds up what is swallowed */
      for (int i = 0; i < 100; i++) {
        sample junk = draw_sample(b.draw);
        junk.first = b.draw.percent(50), junk.last = b.draw.percent(50);
        b.give(junk);
      }
      CData &signal = hard ? b.u.top.rst_ni : b.u.top.clear_i;
      signal = !hard, b.u.top.enable_i = 1;
      b.u.edge();
      signal = hard;
      b.forget();
      for (int ray = 0; ray < 20; ray++) random_ray(b);
      b.drain();
    }
}

/* Not enabled: nothing new comes in, what is inside goes on, and a ray that has ended early is swallowed all the same.
 */
TEST(disabled)
{
  bench b(400);
  sample s = draw_sample(b.draw);
  s.first = true;
  b.give(s);
  b.u.top.enable_i = 0;
  sample next = draw_sample(b.draw);
  b.offer(next);
  for (int i = 0; i < 20; i++) ck_assert(!b.cycle(&next));
  b.stop_percent = 100;
  b.cycle();
  b.u.settle();
  ck_assert(b.drop);
  next.last = true;
  b.offer(next);
  ck_assert(b.cycle(&next));
  b.u.top.valid_i = 0;
  b.drain();
  ck_assert_uint_eq(b.dropped, 1);
}

/* Clear or reset in any cycle: nothing of the old rays is left. */
TEST(reset_in_mid_ray)
{
  bench b(500, 40);
  bool open = false;
  b.stop_percent = 20;
  for (int round = 0; round < 300; round++) {
    for (int i = (int)b.draw(0, 9); i > 0; i--) {
      sample s = draw_sample(b.draw);
      s.first = !open, s.last = b.draw.percent(30), open = !s.last;
      b.give(s);
    }
    const bool hard = b.draw.percent(50);
    CData &signal = hard ? b.u.top.rst_ni : b.u.top.clear_i;
    signal = !hard;
    b.u.edge();
    signal = hard, open = false;
    b.forget();
    b.u.settle();
    ck_assert(b.u.top.idle_o);
  }
}

int ck_timeout = 120;
