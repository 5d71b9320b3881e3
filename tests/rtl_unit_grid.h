/* For the benches of sf_grid and sf_encoder: grids of every kind of level, positions on faces and ends, something that
 * answers pairs of entries in order after any time. C++. */
#ifndef SF_TESTS_RTL_UNIT_GRID_H
#define SF_TESTS_RTL_UNIT_GRID_H
#include "tests/rtl_unit_axi.h"
#include <deque>
#include <vector>

enum { GRID_LOG2_MAX = 14, GRID_STRIDE_MAX = 24 };

struct grid_fixture : entry_source {
  fx_grid grid = {};
  std::vector<int8_t> table;

  /* entries: 0 over their whole range, 1 at the rails */
  grid_fixture(random_draw &draw, int levels, int entries)
  {
    grid.levels = levels;
    for (int l = 0; l < levels; l++) add_level(draw, l);
    table.resize((size_t)grid.entries * FX_GRID_FEATURES);
    for (int8_t &e : table) e = (int8_t)(entries == 0 ? draw(-128, 127) : draw(0, 1) ? 127 : -128);
    grid.table = table.data();
  }

  /* The entry that a corner of the position's cell reads, in wide unsigned numbers. */
  uint32_t entry(const uint32_t pos[3], int level, int corner) const
  {
    uint64_t c[3];
    for (int a = 0; a < 3; a++) {
      const uint64_t eighth_bits = ((uint64_t)pos[a] * (uint64_t)grid.scale_q16[level] + (1ull << 31)) >> 32;
      c[a] = (eighth_bits + 128) / 256 + (uint64_t)(corner >> a & 1);
    }
    const uint64_t stride = (uint64_t)grid.stride[level], size = 1ull << grid.log2_size[level];
    const uint64_t index = stride ? c[0] + stride * c[1] + stride * stride * c[2]
                                  : (c[0] ^ c[1] * 2654435761ull ^ c[2] * 805459861ull) % size;
    return (uint32_t)(index + (uint64_t)grid.offset[level]);
  }

  uint16_t entry(uint64_t index) const override
  {
    ck_assert_uint_lt(index, entries());
    return (uint16_t)((uint8_t)table[2 * index] | (uint8_t)table[2 * index + 1] << 8);
  }
  uint64_t entries() const override { return (uint64_t)grid.entries; }

  /* Anywhere, at both ends, or within 2 LSB of where a level steps to the next 1/256 of a cell or to the next cell. */
  uint32_t coordinate(random_draw &draw) const
  {
    const int64_t last = (1 << SF_POS_FRAC) - 1;
    const int kind = (int)draw(0, 3), level = (int)draw(0, grid.levels - 1);
    if (kind == 0) return (uint32_t)draw(0, last);
    if (kind == 1) return (uint32_t)(draw(0, 1) ? last - draw(0, 1) : draw(0, 1));
    const int64_t cells = (int64_t)grid.scale_q16[level] >> 16, part = kind == 2 ? 256 : 1;
    const int64_t eighths = draw(0, cells * 256 / part) * part + (kind == 2 ? 128 : 0);
    const int64_t at = (eighths * 2 - 1) * ((int64_t)1 << 31) / grid.scale_q16[level] + draw(-2, 2);
    return (uint32_t)(at < 0 ? 0 : at > last ? last : at);
  }

private:
  void add_level(random_draw &draw, int l)
  {
    const bool dense = draw.percent(40);
    if (draw.percent(30)) grid.entries += draw(0, 40); /* nobody says that levels follow one another, or are aligned */
    grid.offset[l] = grid.entries;
    grid.shift[l] = (int32_t)(draw.percent(20) ? draw(0, 31) : draw(9, 14));
    if (dense) {
      grid.stride[l] = (int32_t)draw(3, GRID_STRIDE_MAX);
      grid.scale_q16[l] = (int32_t)draw(1, ((int64_t)(grid.stride[l] - 2) << 16) | 0x7fff);
      grid.log2_size[l] = (int32_t)draw(0, 27); /* not read */
      const int64_t far = ((((1ll << 24) - 1) * grid.scale_q16[l] + (1ll << 31)) >> 32) + 128;
      if ((far >> 8) + 2 > grid.stride[l]) grid.scale_q16[l] = (grid.stride[l] - 2) << 16;
      grid.entries += (int64_t)grid.stride[l] * grid.stride[l] * grid.stride[l];
    } else {
      grid.log2_size[l] = (int32_t)draw(0, GRID_LOG2_MAX);
      grid.scale_q16[l] = (int32_t)(draw.percent(20) ? INT32_MAX - draw(0, 9) : draw(1, 1 << draw(1, 28)));
      grid.entries += (int64_t)1 << grid.log2_size[l];
    }
  }
};

/* Answers in order; each pair waits at least `latency` cycles, at most that and `spread`. */
struct pair_memory {
  const grid_fixture *table;
  int latency, spread, stall;
  struct request {
    uint32_t entry0, entry1;
    uint64_t due;
  };
  std::deque<request> queue;

  bool ready = false, answers = false; /* in this cycle */
  uint32_t word = 0;

  void drive(random_draw &draw, uint64_t cycle)
  {
    ready = !draw.percent(stall);
    answers = !queue.empty() && queue.front().due <= cycle;
    word = (uint32_t)draw(0, UINT32_MAX - 1);
    if (answers) word = (uint32_t)table->entry(queue.front().entry1) << 16 | table->entry(queue.front().entry0);
  }
  /* After settling: what the clock edge will do. True when a pair was taken. */
  bool sample(random_draw &draw, uint64_t cycle, bool valid, uint32_t entry0, uint32_t entry1)
  {
    if (answers) queue.pop_front();
    if (!valid || !ready) return false;
    queue.push_back({entry0, entry1, cycle + (uint64_t)(latency + draw(0, spread))});
    return true;
  }
};

/* One cycle of the write port, while nothing is on its way. */
template <class module> static void configure(unit<module> &u, int address, int64_t value)
{
  u.top.cfg_we_i = 1, u.top.cfg_addr_i = (uint8_t)address, u.top.cfg_data_i = (uint32_t)value;
  u.edge();
  u.top.cfg_we_i = 0;
}

/* The write port's address, up to `last`, and its data mean nothing but in a write. */
template <class module> static void show_anything(unit<module> &u, random_draw &draw, int last)
{
  u.top.cfg_addr_i = (uint8_t)(draw(0, 1) ? draw(0, last) : last - draw(0, 3));
  u.top.cfg_data_i = (uint32_t)draw(0, UINT32_MAX - 1);
}

template <class module> static void configure_levels(unit<module> &u, const fx_grid &grid)
{
  for (int l = 0; l < grid.levels; l++) {
    const int64_t parameter[] = {grid.scale_q16[l], grid.stride[l], grid.log2_size[l], grid.offset[l], grid.shift[l]};
    for (int i = 0; i < 5; i++) configure(u, 8 * l + i, parameter[i]);
  }
}

/* A stream that was offered stays, unchanged, until it is taken. */
struct held {
  bool waiting = false;
  uint64_t value = 0;
  void check(bool valid, bool ready, uint64_t now)
  {
    if (waiting) ck_assert_msg(valid && now == value, "a stream withdrew or changed what it offered");
    waiting = valid && !ready, value = now;
  }
};

template <class words> static void set_position(words &to, const uint32_t pos[3])
{
  to[0] = pos[0] | pos[1] << 24, to[1] = pos[1] >> 8 | pos[2] << 16, to[2] = pos[2] >> 16;
}

/* Cycles until a bench has done more samples. */
template <class bench> uint64_t run_samples(bench &b, int samples)
{
  const int end = b.done + samples;
  const uint64_t begin = b.u.cycle;
  while (b.done < end) {
    b.cycle(end - b.accepted);
    ck_assert_uint_lt(b.u.cycle - begin, (uint64_t)samples * 20000);
  }
  return b.u.cycle - begin;
}
#endif
