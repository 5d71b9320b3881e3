/* sf_stream_in or sf_stream_out, cycle by cycle against a model: random sizes, stalls, bubbles, bad packets, clears in
 * any cycle. Exit status 0 equal, 1 different. -DUNIT=NAME -DUNIT_NAME chooses the unit. */
#include "tests/mutate/unit.h"
#include <cstdlib>
#include <deque>

static bool percent(int p)
{
  return draw(0, 99) < p;
}

static void expect(uint64_t actual, uint64_t expected, const char *what, int cycle)
{
  if (actual == expected) return;
  printf("%s at cycle %d: expected %llx, actual %llx\n", what, cycle, (unsigned long long)expected,
         (unsigned long long)actual);
  exit(1);
}

static void edge()
{
  top.clk_i = 1, top.eval();
  top.clk_i = 0, top.eval();
}

/* Asserted without a clock edge: the reset is asynchronous. */
static void reset()
{
  top.rst_ni = 0, top.eval();
  top.rst_ni = 1, top.eval();
}

#ifdef UNIT_sf_stream_in
struct packet {
  bool first = false;
  int16_t dir[160] = {0}, feature[32] = {0};
};

/* The unit's rules, a packet at a time. */
struct model {
  int n_feature = 1, n_dir = 0, beat = 0, dir_beats = 0;
  bool bad = false, had_one = false;
  packet coming;
  std::deque<packet> inside;

  bool ready(bool enable) const { return bad || (enable && inside.size() < 2); }
  int beats(bool first) const { return (first ? (n_dir + 3) / 4 : 0) + (n_feature + 3) / 4; }
  bool is_first(bool user) const { return beat ? coming.first : user; }
  bool last(bool user) const { return beat == beats(is_first(user)) - 1; }
  bool needs_direction() const { return !had_one || n_feature == 0; }
  void clear() { beat = 0, bad = had_one = false, inside.clear(); }
  void take(uint64_t data, bool user, bool wrong)
  {
    const bool end = last(user);
    if (beat == 0) {
      coming = packet();
      coming.first = user;
      dir_beats = user ? (n_dir + 3) / 4 : 0;
    }
    for (int i = 0; i < 4; i++) {
      const int16_t value = (int16_t)(data >> 16 * i);
      if (beat < dir_beats)
        coming.dir[4 * beat + i] = value;
      else
        coming.feature[4 * (beat - dir_beats) + i] = value;
    }
    beat = end ? 0 : beat + 1;
    bad = wrong;
    if (end && !wrong) inside.push_back(coming), had_one = true;
  }
};

static uint64_t value(int wide_percent)
{
  const int v = percent(20) ? (percent(50) ? -2048 : 2047) : (int)draw(-2048, 2047);
  if (percent(wide_percent)) return percent(50) ? (uint16_t)(1 << draw(11, 15)) : (uint16_t) ~(1 << draw(11, 15));
  return (uint16_t)v;
}

static void run(int cycles, int wrong_percent)
{
  model m;
  m.n_feature = percent(20) ? 32 : (int)draw(1, 32), m.n_dir = percent(20) ? 16 : (int)draw(0, 16);
  if (percent(30))
    m.n_feature = 0, m.n_dir = percent(20) ? 160 : (int)draw(1, 160); /* every packet has its direction */
  const int busy = (int)draw(20, 100), drain = (int)draw(5, 100), on = percent(50) ? 100 : 80;
  bool offered = false, user = false, last = false;
  uint64_t data = 0;
  for (int cycle = 0; cycle < cycles; cycle++) {
    const bool enable = percent(on), clear = percent(m.bad ? 20 : 1);
    if (!offered && percent(busy)) {
      offered = true;
      user = (m.beat == 0 && (m.needs_direction() || percent(30))) != percent(wrong_percent);
      last = m.last(user) != percent(wrong_percent);
      data = 0;
      for (int i = 0; i < 4; i++) data |= value(wrong_percent) << 16 * i;
    }
    const bool done = !m.inside.empty() && percent(drain);
    top.n_feature_i = m.n_feature, top.n_dir_i = m.n_dir;
    top.enable_i = enable, top.clear_i = clear, top.done_i = done;
    top.tvalid_i = offered, top.tdata_i = data, top.tuser_i = user, top.tlast_i = last;
    top.feature_index_i = draw(0, 31), top.dir_index_i = draw(0, m.n_feature ? 15 : 159);
    top.eval();
    const bool ready = m.ready(enable), taken = offered && ready && !m.bad;
    bool wide = false;
    for (int i = 0; i < 4; i++) {
      const int16_t v = (int16_t)(data >> 16 * i);
      wide |= v < -2048 || v > 2047;
    }
    const bool framing = last != m.last(user) || (m.beat == 0 && !user && m.needs_direction());
    expect(top.tready_o, ready, "tready", cycle);
    expect(top.error_packet_o, taken && framing, "error_packet", cycle);
    expect(top.error_value_o, taken && wide, "error_value", cycle);
    expect(top.valid_o, !m.inside.empty(), "valid", cycle);
    /* A begun packet may not be called empty; whether one of an error is, is open. */
    if (!m.bad) expect(top.empty_o, m.inside.empty() && m.beat == 0, "empty", cycle);
    if (!m.inside.empty()) {
      const packet &p = m.inside.front();
      expect(top.first_o, p.first, "first", cycle);
      if (top.feature_index_i < m.n_feature)
        expect(top.feature_o, p.feature[top.feature_index_i] & 0xfff, "feature", cycle);
      if (p.first && top.dir_index_i < m.n_dir) expect(top.dir_o, p.dir[top.dir_index_i] & 0xfff, "dir", cycle);
    }
    edge();
    if (clear) {
      m.clear();
    } else {
      if (done) m.inside.pop_front();
      if (taken) m.take(data, user, framing || wide);
    }
    if (ready || clear) offered = false; /* a master that stops with the block */
  }
}

int main(void)
{
  for (int i = 0; i < 150; i++) {
    top.clear_i = 0;
    reset();
    run(400, i % 3 == 0 ? 0 : i % 3 == 1 ? 1 : 5);
  }
  return 0;
}
#else

int main(void)
{
  reset();
  std::deque<uint64_t> beats;
  for (int cycle = 0; cycle < 40000; cycle++) {
    const int busy = cycle / 1000 % 5 * 25, take = cycle / 5000 % 4 * 33 + 1;
    const bool valid = percent(busy), clear = percent(1), ready_i = percent(take);
    const uint32_t sigma = (uint32_t)draw(0, (1 << 28) - 1),
                   c[3] = {(uint32_t)draw(0, (1 << 20) - 1), (uint32_t)draw(0, (1 << 20) - 1),
                           (uint32_t)draw(0, (1 << 20) - 1)};
    top.valid_i = valid, top.clear_i = clear, top.tready_i = ready_i, top.sigma_i = sigma;
    top.colour_i = (uint64_t)c[2] << 40 | (uint64_t)c[1] << 20 | c[0];
    top.eval();
    const bool room = beats.empty() || (beats.size() == 1 && ready_i);
    expect(top.ready_o, room, "ready", cycle);
    expect(top.tvalid_o, !beats.empty(), "tvalid", cycle);
    if (!beats.empty()) {
      expect(top.tdata_o, beats.front(), "tdata", cycle);
      expect(top.tlast_o, beats.size() == 1, "tlast", cycle);
    }
    edge();
    if (!beats.empty() && ready_i) beats.pop_front();
    if (room && valid) {
      beats.push_back((uint64_t)c[0] << 32 | sigma);
      beats.push_back((uint64_t)c[2] << 32 | c[1]);
    }
    if (clear) beats.clear();
    if (percent(1)) reset(), beats.clear();
  }
  return 0;
}
#endif
