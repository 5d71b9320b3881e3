/* sf_cache: contents of every pair of entries, look-ups, misses and lines against a list of lines per set, with any
 * latency, stalls, clears and emptyings. */
#include "Vsf_cache.h"
#include "Vsf_cache_1.h"
#include "Vsf_cache_2.h"
#include "Vsf_cache_8.h"
#include "tests/rtl_unit_axi.h"

enum {
  LINES = 32 /* that there is room for */,
  ROOM = 400 /* pairs on their way, at most */,
  PATIENCE = 20000 /* cycles for a pair */
};

struct hashed_entries : entry_source {
  uint64_t n = 1 << 20;
  uint16_t entry(uint64_t index) const override { return (uint16_t)((index + 1) * 2654435761u >> 13); }
  uint64_t entries() const override { return n; }
};

template <class module, int bytes, int ways> struct cache_bench {
  unit<module> u;
  random_draw draw;
  hashed_entries table;
  axi_memory memory;
  cache_model model{bytes, ways};
  field_events events;
  struct pair {
    uint32_t entry0, entry1;
  };
  std::deque<pair> flying;
  pair next = {};
  int stall = 0, empty_percent = 0, locality = 0;
  uint64_t accepted = 0, done = 0, at = 0;
  size_t most = 0; /* lines on their way */

  explicit cache_bench(uint64_t seed) : u(seed), draw(seed)
  {
    memory.source = &table;
    u.top.s_valid_i = u.top.m_axi_rvalid_i = u.top.m_axi_arready_i = 0;
    u.top.base_i = memory.base = any_base(draw);
    u.reset();
    model.empty();
  }
  /* Neighbours, pairs that share a line, pairs of two lines in one bank, all near a place that wanders. */
  void offer()
  {
    if (draw.percent(100 - locality)) at = (uint64_t)draw(0, (int64_t)table.n - 1);
    const uint64_t near = std::min(at + (uint64_t)draw(0, 300), table.n - 2);
    const int kind = (int)draw(0, 9);
    next.entry0 = (uint32_t)near, next.entry1 = (uint32_t)near + 1;
    if (kind == 0) next.entry1 = (uint32_t)(near ^ 1);
    if (kind == 1) next.entry1 = (uint32_t)(near ^ (uint64_t)draw(1, 7));
    if (kind == 2) next.entry1 = (uint32_t)draw(0, (int64_t)table.n - 1);
    if (kind == 3) next.entry1 = (uint32_t)(near ^ (uint64_t)bytes / 2); /* same bank, often the same set */
    next.entry1 = std::min(next.entry1, (uint32_t)table.n - 1);
    if (draw(0, 1)) std::swap(next.entry0, next.entry1);
    u.top.s_entry0_i = next.entry0, u.top.s_entry1_i = next.entry1;
    u.top.s_empty_i = draw.percent(empty_percent);
    u.top.s_valid_i = 1;
  }
  void take()
  {
    ck_assert_msg(!flying.empty(), "entries of no pair");
    const pair p = flying.front();
    const uint32_t expected = (uint32_t)table.entry(p.entry1) << 16 | table.entry(p.entry0);
    ck_assert_msg(u.top.m_entries_o == expected, "pair %llu (%u, %u): %08x, expected %08x", (unsigned long long)done,
                  p.entry0, p.entry1, u.top.m_entries_o, expected);
    flying.pop_front();
    done++;
  }
  void cycle(bool more)
  {
    if (!u.top.s_valid_i && more && flying.size() < ROOM && !draw.percent(stall)) offer();
    memory.drive(u, draw);
    u.settle();
    const bool quiet = !u.top.rst_ni || u.top.clear_i, taken = u.top.s_valid_i && u.top.s_ready_o;
    memory.sample(u, draw);
    events.sample(u);
    most = std::max(most, memory.queue.size());
    if (u.top.m_valid_o && !quiet) take();
    if (taken && !quiet) {
      if (u.top.s_empty_i) model.empty();
      model.pair(next.entry0, next.entry1);
      flying.push_back(next);
      accepted++;
    }
    u.edge();
    if (taken) u.top.s_valid_i = 0;
  }
  uint64_t run(uint64_t pairs)
  {
    const uint64_t end = accepted + pairs, begin = u.cycle;
    for (uint64_t last = begin, was = done; done < end; was = done) {
      cycle(accepted < end);
      if (done != was) last = u.cycle;
      ck_assert_msg(u.cycle - last < PATIENCE, "pair %llu does not come", (unsigned long long)done);
    }
    return u.cycle - begin;
  }
  /* A pair by itself; its cycles. */
  uint64_t one(uint32_t entry0, uint32_t entry1, bool empty = false)
  {
    next = {entry0, entry1};
    u.top.s_entry0_i = entry0, u.top.s_entry1_i = entry1, u.top.s_empty_i = empty, u.top.s_valid_i = 1;
    return run(1);
  }
  void timing(int latency, int spread, int stalls, int empty, int local)
  {
    memory.latency = latency, memory.spread = spread, memory.stall = stall = stalls;
    empty_percent = empty, locality = local;
  }
  void same_counts()
  {
    for (int i = 0; i < 20; i++) cycle(false);
    ck_assert(flying.empty() && memory.queue.empty());
    events.same(model, memory);
    ck_assert_uint_eq(events.errors, memory.errors);
  }
  void clear(bool hard)
  {
    u.top.rst_ni = !hard, u.top.clear_i = !hard;
    cycle(false);
    u.top.rst_ni = 1, u.top.clear_i = 0, u.top.s_valid_i = 0;
    memory.clear(hard);
    flying.clear(), model.empty();
    done = accepted;
  }
  /* What was counted until now is not compared: a clear cuts pairs off. */
  void forget_counts()
  {
    for (int i = 0; i < 3; i++) cycle(false); /* of before are still on their way to the outputs */
    events = field_events(), memory.asked = memory.errors = 0;
    model.lookups = model.misses = 0;
  }
};

typedef cache_bench<Vsf_cache, 32768, 4> usual;
typedef cache_bench<Vsf_cache_1, 1024, 1> small;
typedef cache_bench<Vsf_cache_2, 4096, 2> two_ways;
typedef cache_bench<Vsf_cache_8, 2048, 8> eight_ways;

template <class bench> static void random_pairs(uint64_t seed)
{
  bench b(seed);
  for (int n = 0; n < 12 * unit_length(); n++) {
    b.table.n = (uint64_t)1 << b.draw(4, 20);
    b.timing((int)b.draw(1, 90), (int)b.draw(0, 3) * 30,
             n % 3 == 0   ? 0
             : n % 3 == 1 ? 20
                          : 70,
             (int)b.draw(0, 2), (int)b.draw(0, 2) * 49);
    b.memory.error_percent = n % 4 == 3 ? 3 : 0;
    b.at = 0;
    b.run(4000);
    b.same_counts();
    b.clear(false); /* a smaller table may follow: nothing of this one must be there */
    b.forget_counts();
  }
}

LOOP_TEST(pairs_through_the_usual_cache, 3)
{
  random_pairs<usual>((uint64_t)_i + 10);
}
LOOP_TEST(pairs_through_a_small_one, 3)
{
  random_pairs<small>((uint64_t)_i + 20);
}
LOOP_TEST(pairs_through_two_ways, 3)
{
  random_pairs<two_ways>((uint64_t)_i + 30);
}
LOOP_TEST(pairs_through_eight_ways, 3)
{
  random_pairs<eight_ways>((uint64_t)_i + 40);
}

/* Clear or reset in any cycle, also twice in a row; the memory goes on answering. */
template <class bench> static void clears(uint64_t seed)
{
  bench b(seed);
  for (int delay = 0; delay < 600; delay += 1 + delay / 60) {
    b.timing((int)b.draw(1, 90), 20, (int)b.draw(0, 1) * 40, 1, (int)b.draw(0, 1) * 95);
    for (int i = 0; i < delay; i++) b.cycle(true);
    b.clear(delay % 3 == 0);
    if (delay % 3 == 1) b.clear(false);
    b.forget_counts();
    b.run(60);
    b.same_counts();
  }
}

TEST(clear_of_the_usual_cache)
{
  clears<usual>(50);
}
TEST(clear_of_a_small_one)
{
  clears<small>(51);
}

/* Pairs that hit take a cycle each; a memory of up to 90 cycles is hidden behind the queue when one in sixteen misses.
 */
TEST(a_pair_in_every_cycle)
{
  enum { PAIRS = 5000, KNOWN = 1000 * LINE_ENTRIES, STEP = 37, BEFORE_AND_BEHIND = 30, SET_IN_USE = 3 };
  for (int latency = 1; latency <= 91; latency += 30) {
    usual b(60);
    b.timing(latency, 0, 0, 0, 0);
    uint64_t begin = 0, known = 0, fresh = 0, together = 0;
    for (uint64_t n = 0; b.done < KNOWN + PAIRS;) {
      if (n == KNOWN && b.done == n && !begin) begin = b.u.cycle;
      if (!b.u.top.s_valid_i && n < KNOWN + PAIRS && (n != KNOWN || begin)) {
        const bool miss = n > KNOWN && n % 16 == 0;
        const uint64_t entry = miss ? KNOWN + fresh++ * STEP * LINE_ENTRIES : known++ * STEP % KNOWN;
        together += miss;
        b.next.entry0 = (uint32_t)entry, b.next.entry1 = (uint32_t)entry ^ 1;
        b.u.top.s_entry0_i = b.next.entry0, b.u.top.s_entry1_i = b.next.entry1;
        b.u.top.s_empty_i = 0, b.u.top.s_valid_i = 1, n++;
      }
      b.cycle(false);
    }
    const uint64_t cycles = b.u.cycle - begin, most = PAIRS + (uint64_t)latency + BEFORE_AND_BEHIND;
    ck_assert_msg(cycles <= most + together / 8 * SET_IN_USE, "latency %d: %d cycles for %d pairs", latency,
                  (int)cycles, PAIRS);
    b.same_counts();
  }
}

/* Nothing is waited for while nothing is asked; a line that is missing is waited for as much longer as its memory is
 * slower, and one that is there is not. */
TEST(a_line_that_is_waited_for)
{
  enum { FASTEST = 20, SLOWER = 30, STAGES = 12 };
  uint64_t before = 0;
  for (int latency = FASTEST; latency <= FASTEST + 2 * SLOWER; latency += SLOWER) {
    usual b(70);
    b.timing(latency, 0, 0, 0, 0);
    for (int i = 0; i < 1000; i++) b.cycle(false);
    ck_assert_uint_eq(b.events.stalls, 0);
    b.one(4321, 4322);
    const uint64_t stalls = b.events.stalls;
    ck_assert_msg(stalls <= (uint64_t)latency + STAGES && stalls + STAGES >= (uint64_t)latency,
                  "latency %d: %llu stalls", latency, (unsigned long long)stalls);
    if (before) ck_assert_uint_eq(stalls, before + SLOWER);
    before = stalls;
    b.one(4322, 4321);
    ck_assert_uint_eq(b.events.stalls, stalls);
    b.same_counts();
  }
}

/* A cycle for each set of a bank, once; nothing where the cache is empty still. */
TEST(emptying_costs_one_walk)
{
  enum { WALK = 32768 / 32 / 4, MORE = 4 };
  usual b(72);
  b.timing(1, 0, 0, 0, 0);
  for (int i = 0; i < 1000; i++) b.cycle(false);
  const uint64_t blank = b.one(80, 81, true), miss = b.one(8000, 8001);
  ck_assert_msg(blank <= miss + MORE, "empty still: %d cycles, a miss %d", (int)blank, (int)miss);
  for (uint32_t i = 2; i < 6; i++) {
    const uint64_t cycles = b.one(8000 * i, 8000 * i + 1, true);
    ck_assert_msg(cycles >= miss + WALK && cycles <= miss + WALK + MORE, "%d cycles, a miss %d", (int)cycles,
                  (int)miss);
    b.one(8000 * i, 8000 * i + 1);
  }
  b.same_counts();
}

/* No line is asked for that has no room. */
TEST(as_many_lines_as_there_is_room_for)
{
  usual b(73);
  b.timing(400, 0, 0, 0, 0);
  b.run(400);
  ck_assert_uint_eq(b.most, LINES);
  b.same_counts();
}

int ck_timeout = 3600;
