/* For the benches of sf_cache and sf_encoder: a memory behind an AXI4 read port that watches the rules, and a cache as
 * a list of lines per set. C++. */
#ifndef SF_TESTS_RTL_UNIT_AXI_H
#define SF_TESTS_RTL_UNIT_AXI_H
#include "tests/rtl_unit.h"
#include <algorithm>
#include <deque>
#include <vector>

enum { LINE_BYTES = 16, LINE_ENTRIES = 8, BEAT_BYTES = 8 };

/* Of a table of up to 2^28 bytes, anywhere in 32 bits. */
static inline uint32_t any_base(random_draw &draw)
{
  return (uint32_t)draw(0, ((INT64_C(1) << 32) - (1 << 28)) / LINE_BYTES) * LINE_BYTES;
}

/* Two bytes of the memory at an entry's place. */
struct entry_source {
  virtual uint16_t entry(uint64_t index) const = 0;
  virtual uint64_t entries() const = 0;
  virtual ~entry_source() = default;
};

/* Bursts of two beats, answered in order; each waits at least `latency` cycles, at most that and `spread`. */
struct axi_memory {
  const entry_source *source = nullptr;
  uint32_t base = 0;
  int latency = 1, spread = 0, stall = 0, error_percent = 0;
  struct burst {
    uint64_t line, due;
    bool stale;
  };
  std::deque<burst> queue;
  uint64_t asked = 0, filled = 0, errors = 0, begins = 0; /* begins: the cycle before which nothing is taken */
  bool second = false, waiting = false;
  uint32_t waiting_address = 0;

  template <class module> void drive(unit<module> &u, random_draw &draw)
  {
    u.top.m_axi_arready_i = u.cycle >= begins && !draw.percent(stall);
    const bool answers = !queue.empty() && queue.front().due <= u.cycle && !draw.percent(stall);
    u.top.m_axi_rvalid_i = answers;
    u.top.m_axi_rdata_i = answers ? beat(queue.front(), second) : (uint64_t)draw(0, INT64_MAX - 1);
    u.top.m_axi_rresp_i = answers && !draw.percent(error_percent) ? 0 : (uint8_t)draw(answers, 3);
  }
  /* After settling: what the clock edge will do. */
  template <class module> void sample(unit<module> &u, random_draw &draw)
  {
    const bool valid = u.top.m_axi_arvalid_o;
    const uint32_t address = u.top.m_axi_araddr_o;
    if (waiting && u.top.rst_ni)
      ck_assert_msg(valid && address == waiting_address, "cycle %d: a request changed or went", (int)u.cycle);
    waiting = valid && !u.top.m_axi_arready_i, waiting_address = address;
    if (u.top.m_axi_rvalid_i) {
      errors += u.top.m_axi_rresp_i != 0 && !queue.front().stale && !u.top.clear_i; /* none of lines that are dropped */
      if (second) filled += !queue.front().stale, queue.pop_front();
      second = !second;
    }
    if (valid && u.top.m_axi_arready_i && u.top.rst_ni) take(address, u.cycle, draw);
  }
  /* After a clear (or a reset, with which the memory forgets everything). */
  void clear(bool hard)
  {
    for (burst &b : queue) b.stale = true;
    stale_waits = waiting && !hard;
    if (hard) queue.clear(), second = false, waiting = false;
  }
  bool stale_waits = false; /* the request on offer is one of before a clear */

private:
  void take(uint32_t address, uint64_t cycle, random_draw &draw)
  {
    ck_assert_uint_eq(address % LINE_BYTES, 0);
    const uint64_t line = (uint32_t)(address - base) / LINE_BYTES;
    if (!stale_waits)
      ck_assert_msg(line * LINE_ENTRIES < source->entries(), "line %u is beyond the table", (uint32_t)line);
    if (!stale_waits) /* nothing is asked before the last answer of before a clear */
      for (const burst &b : queue) ck_assert(!b.stale);
    queue.push_back({line, cycle + (uint64_t)(latency + draw(0, spread)), stale_waits});
    asked += !stale_waits, stale_waits = false;
  }
  uint64_t beat(const burst &b, bool upper) const
  {
    uint64_t value = 0;
    for (uint64_t i = 0; i < 4; i++) {
      const uint64_t index = b.line * LINE_ENTRIES + 4 * upper + i;
      value |= (uint64_t)(!b.stale && index < source->entries() ? source->entry(index) : 0xdead) << 16 * i;
    }
    return value;
  }
};

/* What a cache of this shape must count, written down as it is explained, not as it is built. */
struct cache_model {
  size_t sets, ways;
  std::vector<std::deque<uint64_t>> used; /* per set, the line used last in front */
  uint64_t lookups = 0, misses = 0;

  cache_model(int bytes, int n_ways)
      : sets((size_t)bytes / LINE_BYTES / (size_t)n_ways), ways((size_t)n_ways), used(sets)
  {
  }
  void empty()
  {
    for (std::deque<uint64_t> &set : used) set.clear();
  }
  void look_up(uint64_t line)
  {
    std::deque<uint64_t> &set = used[line % sets];
    const auto found = std::find(set.begin(), set.end(), line);
    lookups++;
    if (found != set.end())
      set.erase(found);
    else
      misses++;
    set.push_front(line);
    if (set.size() > ways) set.pop_back();
  }
  void pair(uint64_t entry0, uint64_t entry1)
  {
    look_up(entry0 / LINE_ENTRIES);
    if (entry1 / LINE_ENTRIES != entry0 / LINE_ENTRIES) look_up(entry1 / LINE_ENTRIES);
  }
};

/* The block's own counts, from its event outputs. */
struct field_events {
  uint64_t lookups = 0, misses = 0, fills = 0, stalls = 0, errors = 0;
  template <class module> void sample(const unit<module> &u)
  {
    lookups += u.top.lookups_o, misses += u.top.misses_o, fills += u.top.filled_o, stalls += u.top.waits_o;
    errors += u.top.error_o;
  }
  void same(const cache_model &model, const axi_memory &memory) const
  {
    ck_assert_msg(lookups == model.lookups && misses == model.misses, "%llu look-ups, %llu misses; expected %llu, %llu",
                  (unsigned long long)lookups, (unsigned long long)misses, (unsigned long long)model.lookups,
                  (unsigned long long)model.misses);
    ck_assert_uint_eq(fills, misses);
    ck_assert_uint_eq(memory.asked, misses);
  }
};
#endif
