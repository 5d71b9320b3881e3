/* sf_grid_weight, sf_trilinear, sf_grid against src/fx/grid.c. */
#include "Vsf_grid.h"
#include "Vsf_grid_weight.h"
#include "Vsf_trilinear.h"
#include "tests/rtl_unit_grid.h"
extern "C" {
#include "src/fx/round.h"
}

enum { CORNERS = FX_GRID_CORNERS };

enum { PAIRS = CORNERS / 2, WEIGHT_LATENCY = 4 };

/* Gives a pair of corners in every cycle and checks the one of WEIGHT_LATENCY cycles before. */
struct weight_bench {
  VerilatedContext context;
  Vsf_grid_weight top{&context};
  struct pair {
    int x, y, z, pair;
    uint32_t weight[2];
  } given[WEIGHT_LATENCY] = {};
  uint64_t cycle = 0;

  ~weight_bench() { top.final(); }
  void next(const pair &p)
  {
    pair &slot = given[cycle % WEIGHT_LATENCY];
    top.x_i = (uint8_t)p.x, top.y_i = (uint8_t)p.y, top.z_i = (uint8_t)p.z, top.pair_i = (uint8_t)p.pair;
    top.clk_i = 0, top.eval();
    if (cycle >= WEIGHT_LATENCY && (top.weight0_o != slot.weight[0] || top.weight1_o != slot.weight[1]))
      ck_abort_msg("place (%d, %d, %d) pair %d: %u, %u, expected %u, %u", slot.x, slot.y, slot.z, slot.pair,
                   top.weight0_o, top.weight1_o, slot.weight[0], slot.weight[1]);
    slot = p;
    top.clk_i = 1, top.eval();
    cycle++;
  }
};

/* Every place in a cell in long runs; every x-y with 16 values of z in short ones. */
TEST(weights_of_every_place)
{
  weight_bench b;
  for (int z = _i; z<256; z += unit_length()> 1 ? 1 : 17)
    for (int y = 0; y < 256; y++)
      for (int x = 0; x < 256; x++) {
        const int32_t g[3] = {x, y, z};
        int32_t weight[CORNERS];
        uint32_t sum = 0;
        fx_grid_weights(g, weight);
        for (int pair = 0; pair < PAIRS; pair++) {
          b.next({x, y, z, pair, {(uint32_t)weight[2 * pair], (uint32_t)weight[2 * pair + 1]}});
          sum += (uint32_t)weight[2 * pair] + (uint32_t)weight[2 * pair + 1];
        }
        if (sum != 65536) ck_abort_msg("place (%d, %d, %d): weights sum to %u", x, y, z, sum);
      }
  for (int i = 0; i < WEIGHT_LATENCY; i++) b.next({0, 0, 0, 0, {65536, 0}});
}

/* ---- sf_trilinear ---- */

static int expected_feature(int64_t sum, int shift)
{
  const int64_t exact = fx_rshift_round(sum, shift), limit = FX_INPUT_MAX;
  return (int)(exact > limit ? limit : exact < -limit ? -limit : exact);
}

struct cell_of_test {
  int32_t g[3];
  int8_t entry[CORNERS][2];
  int shift;
  bool last;
  int feature[2];
};

static cell_of_test draw_cell(random_draw &draw)
{
  cell_of_test c = {};
  int32_t weight[CORNERS];
  const int kind = (int)draw(0, 3);
  int64_t sum[2] = {0, 0};
  for (int a = 0; a < 3; a++) c.g[a] = (int32_t)(kind == 1 ? (draw(0, 1) ? 255 : 0) : draw(0, 255));
  fx_grid_weights(c.g, weight);
  c.shift = (int)draw(0, 31), c.last = draw(0, 1);
  const int8_t rail = draw(0, 1) ? 127 : -128;
  for (int corner = 0; corner < CORNERS; corner++)
    for (int i = 0; i < 2; i++) {
      c.entry[corner][i] = kind == 2 ? rail : kind == 3 ? (draw(0, 1) ? 127 : -128) : (int8_t)draw(-128, 127);
      sum[i] += weight[corner] * c.entry[corner][i];
    }
  for (int i = 0; i < 2; i++) c.feature[i] = expected_feature(sum[i], c.shift);
  return c;
}

/* The cell's data stand at the inputs until its fourth pair, as the queue before it keeps them. */
LOOP_TEST(sums_of_random_cells, 3)
{
  unit<Vsf_trilinear> u((uint64_t)_i + 20);
  random_draw draw((uint64_t)_i + 20);
  std::deque<cell_of_test> sent;
  u.top.valid_i = 0;
  u.reset();
  cell_of_test c = draw_cell(draw);
  for (int pair = 0, cells = 0; cells < 20000 * unit_length();) {
    u.top.valid_i = !draw.percent(40 * _i);
    u.top.place_i = (uint32_t)(c.g[0] | c.g[1] << 8 | c.g[2] << 16);
    u.top.entries_i = 0;
    for (int i = 0; i < 4; i++) u.top.entries_i |= (uint32_t)(uint8_t)c.entry[2 * pair + i / 2][i % 2] << 8 * i;
    u.top.shift_i = (uint8_t)c.shift, u.top.last_i = c.last;
    u.settle();
    ck_assert_int_eq(u.top.pop_o, u.top.valid_i && pair == PAIRS - 1);
    if (u.top.valid_o) {
      ck_assert(!sent.empty());
      for (int i = 0; i < 2; i++) {
        const int got = (int)(u.top.features_o << (20 - 12 * i)) >> 20;
        ck_assert_msg(got == sent.front().feature[i], "cell %d feature %d, shift %d: %d, expected %d", cells, i,
                      sent.front().shift, got, sent.front().feature[i]);
      }
      ck_assert_int_eq(u.top.last_o, sent.front().last);
      sent.pop_front();
      cells++;
    }
    const bool end = u.top.pop_o;
    pair = (pair + u.top.valid_i) % PAIRS;
    u.edge();
    if (!end) continue;
    sent.push_back(c);
    c = draw_cell(draw);
  }
}

/* ---- sf_grid ---- */

struct grid_bench {
  unit<Vsf_grid> u;
  random_draw draw;
  const grid_fixture *table = nullptr;
  pair_memory memory = {};
  int stall = 0;
  struct sample {
    uint32_t pos[3];
    int16_t f[2 * FX_LEVELS_MAX];
  };
  std::deque<sample> flying; /* accepted; not all of its features have come */
  struct pair {
    uint32_t entry[2];
    bool tile;
  };
  std::deque<pair> pairs;                    /* that must be asked for */
  uint64_t memory_begins = 0;                /* cycle before which the memory takes nothing */
  uint64_t asked = 0, ask_most = UINT64_MAX; /* pairs that it has taken, that it takes */
  sample next;
  int level = 0, accepted = 0, done = 0;
  sink_stalls sink;
  held output, request;

  explicit grid_bench(uint64_t seed) : u(seed), draw(seed)
  {
    u.top.s_valid_i = u.top.m_ready_i = u.top.pair_ready_i = u.top.entries_valid_i = u.top.cfg_we_i = 0;
    u.reset();
  }
  void load(const grid_fixture *fixture, int latency, int spread, int stalls)
  {
    table = fixture, stall = sink.percent = stalls, sink.until = 0;
    memory.table = fixture, memory.latency = latency, memory.spread = spread, memory.stall = stalls;
    u.top.pair_ready_i = u.top.entries_valid_i = 0;
    configure_levels(u, table->grid);
    u.top.last_level_i = (uint8_t)(table->grid.levels - 1);
  }
  void clear(bool hard)
  {
    request = output = held(); /* reset withdraws at once */
    u.top.rst_ni = !hard, u.top.clear_i = !hard;
    cycle(0);
    u.top.rst_ni = 1, u.top.clear_i = 0, u.top.s_valid_i = 0;
    flying.clear(), pairs.clear(), memory.queue.clear();
    output = request = held(), level = 0, accepted = done;
  }
  /* Offers samples while `more`. */
  void cycle(int more)
  {
    if (!u.top.s_valid_i && more > 0 && !draw.percent(stall)) {
      for (int a = 0; a < 3; a++) next.pos[a] = table->coordinate(draw);
      fx_grid_features(&table->grid, next.pos, next.f, nullptr);
      set_position(u.top.s_pos_i, next.pos);
      u.top.s_tile_i = draw.percent(30);
      u.top.s_valid_i = 1;
    }
    u.top.m_ready_i = !sink(draw, u.cycle);
    memory.drive(draw, u.cycle);
    if (u.cycle < memory_begins || asked == ask_most) memory.ready = false;
    show_anything(u, draw, 0x7f);
    u.top.pair_ready_i = memory.ready, u.top.entries_valid_i = memory.answers, u.top.entries_i = memory.word;
    u.settle();
    const bool quiet = !u.top.rst_ni || u.top.clear_i, taken = u.top.s_valid_i && u.top.s_ready_o;
    const pair asks = {{u.top.pair_entry0_o, u.top.pair_entry1_o}, (bool)u.top.pair_tile_o};
    request.check(u.top.pair_valid_o, memory.ready, (uint64_t)asks.entry[1] << 32 | asks.entry[0]);
    if (memory.sample(draw, u.cycle, u.top.pair_valid_o, asks.entry[0], asks.entry[1]) && !quiet) ask(asks);
    output.check(u.top.m_valid_o, u.top.m_ready_i, u.top.m_features_o << 1 | u.top.m_last_o);
    if (u.top.m_valid_o && u.top.m_ready_i && !quiet) take();
    if (taken && !quiet) accept();
    u.edge();
    if (taken) u.top.s_valid_i = 0;
  }
  uint64_t run(int samples) { return run_samples(*this, samples); }

private:
  void accept()
  {
    flying.push_back(next);
    accepted++;
    for (int l = 0; l < table->grid.levels; l++)
      for (int i = 0; i < PAIRS; i++)
        pairs.push_back({{table->entry(next.pos, l, 2 * i), table->entry(next.pos, l, 2 * i + 1)},
                         u.top.s_tile_i && l == 0 && i == 0});
  }
  void ask(const pair &got)
  {
    ck_assert(!pairs.empty());
    const pair &p = pairs.front();
    ck_assert_msg(got.entry[0] == p.entry[0] && got.entry[1] == p.entry[1] && got.tile == p.tile,
                  "pair %u, %u (tile %d) asked for, expected %u, %u (%d), %zu before the end", got.entry[0],
                  got.entry[1], got.tile, p.entry[0], p.entry[1], p.tile, pairs.size());
    pairs.pop_front();
    asked++;
  }
  void take()
  {
    ck_assert(!flying.empty());
    const sample &s = flying.front();
    for (int i = 0; i < 2; i++) {
      const int got = (int)(u.top.m_features_o << (20 - 12 * i)) >> 20, expected = s.f[2 * level + i];
      ck_assert_msg(got == expected, "sample %d at (%u, %u, %u), level %d feature %d: %d, expected %d", done, s.pos[0],
                    s.pos[1], s.pos[2], level, i, got, expected);
    }
    const bool last = level == table->grid.levels - 1;
    ck_assert_int_eq(u.top.m_last_o, last);
    level = last ? 0 : level + 1;
    if (!last) return;
    flying.pop_front();
    done++;
  }
};

/* Grids of all sizes, entries over their range and at the rails, any latency and stalls. */
LOOP_TEST(random_grids, 4)
{
  grid_bench b((uint64_t)_i + 30);
  for (int n = 0; n < 12 * unit_length(); n++) {
    const int levels = n % 3 ? (int)b.draw(1, 16) : n % 2 ? 1 : 16;
    const grid_fixture fixture(b.draw, levels, n % 4 == 3);
    const int stall = n % 3 == 0 ? 0 : n % 3 == 1 ? 20 : 70;
    b.load(&fixture, (int)b.draw(1, 60), (int)b.draw(0, 3) * 40, stall);
    b.run(120);
    ck_assert(b.flying.empty() && b.pairs.empty() && b.memory.queue.empty());
  }
}

/* One pair per cycle up to a latency of the pairs that may be on their way; before the first, the first cell;
 * behind the last answer, sums and queue. */
TEST(a_request_in_every_cycle)
{
  enum { BEFORE_AND_BEHIND = 27 };
  static const int latency[] = {1, 10, 60, 100};
  for (int i = 0; i < 4; i++)
    for (int levels = 1; levels <= 16; levels += 5) {
      grid_bench b(40);
      const grid_fixture fixture(b.draw, levels, 0);
      b.load(&fixture, latency[i], 0, 0);
      const uint64_t samples = 50, requests = samples * (uint64_t)levels * PAIRS, cycles = b.run((int)samples);
      ck_assert_msg(cycles == requests + (uint64_t)latency[i] + BEFORE_AND_BEHIND,
                    "%d levels, latency %d: %d cycles for %d requests", levels, latency[i], (int)cycles, (int)requests);
    }
}

/* While the memory takes nothing, all that fits in before it fills up: one pair waits, one index behind it. */
TEST(a_memory_that_begins_late)
{
  enum { BEHIND = 11 };
  for (int levels = 1; levels <= 16; levels += 5) {
    grid_bench b(41);
    const grid_fixture fixture(b.draw, levels, 0);
    b.load(&fixture, 10, 0, 0);
    b.memory_begins = b.u.cycle + 100;
    const uint64_t begin = b.u.cycle, requests = 20 * (uint64_t)levels * PAIRS;
    b.run(20);
    ck_assert_uint_eq(b.u.cycle - begin, 100 + requests + 10 + BEHIND);
  }
}

/* The next sample's first index is on its way while the last requests of the one before still wait: one, or two. */
TEST(an_index_behind_requests_that_wait)
{
  for (uint64_t waiting = 1; waiting <= 2; waiting++) {
    grid_bench b(42);
    const grid_fixture fixture(b.draw, 1, 0);
    b.load(&fixture, 10, 0, 0);
    b.ask_most = PAIRS - waiting;
    for (int i = 0; i < 60; i++) b.cycle(b.accepted == 0);
    for (int i = 0; i < 60; i++) b.cycle(b.accepted == 1);
    ck_assert_uint_eq(b.asked, PAIRS - waiting);
    b.ask_most = UINT64_MAX;
    for (uint64_t i = 0; i <= waiting; i++) b.cycle(0);
    ck_assert_uint_eq(b.asked, PAIRS + 1);
    while (b.done < 2) b.cycle(0);
  }
}

/* A sample that comes while the one before is at work waits for the end of a level's slots, until its cell has left. */
TEST(when_the_next_sample_is_taken)
{
  static const uint64_t SLOTS = 4, LEFT = 12;
  for (uint64_t gap = 1; gap <= LEFT + SLOTS; gap++) {
    grid_bench b(43);
    const grid_fixture fixture(b.draw, 1, 0);
    b.load(&fixture, 10, 0, 0);
    while (b.accepted < 1) b.cycle(1);
    const uint64_t begin = b.u.cycle;
    while (b.u.cycle - begin < gap - 1) b.cycle(0);
    while (b.accepted < 2) b.cycle(1);
    ck_assert_uint_eq(b.u.cycle - begin, gap <= LEFT ? (gap + SLOTS - 1) / SLOTS * SLOTS : gap);
    while (b.done < 2) b.cycle(0);
  }
}

/* Clear at any moment; the memory goes on answering what it had accepted. */
TEST(reset_on_the_way)
{
  grid_bench b(50);
  for (int delay = 0; delay < 400; delay += 1 + delay / 60) {
    const grid_fixture fixture(b.draw, (int)b.draw(1, 16), 0);
    b.load(&fixture, (int)b.draw(1, 90), 20, (int)b.draw(0, 1) * 30);
    for (int i = 0; i < delay; i++) b.cycle(1);
    b.clear(delay % 3 == 0);
    if (delay % 3 == 1) b.clear(false);
    b.run(3);
  }
}
