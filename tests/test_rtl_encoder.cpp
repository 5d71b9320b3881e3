/* sf_encoder against fx_grid_features and fx_sh, as the packets that the engine takes. */
#include "Vsf_encoder.h"
#include "Vsf_encoder_1.h"
#include "tests/rtl_unit_grid.h"

enum { VALUES = 4 }; /* of a beat */

struct beat {
  uint64_t data;
  bool user, last;
};

static void add_beats(std::deque<beat> &beats, const int16_t *value, int n, bool user, bool last)
{
  for (int i = 0; i < n; i += VALUES) {
    beat b = {0, user && i == 0, last && i + VALUES >= n};
    for (int j = 0; j < VALUES && i + j < n; j++) b.data |= (uint64_t)(uint16_t)value[i + j] << 16 * j;
    beats.push_back(b);
  }
}

template <class module, int bytes, int ways> struct encoder_bench {
  unit<module> u;
  random_draw draw;
  const grid_fixture *table = nullptr;
  axi_memory memory;
  cache_model model{bytes, ways};
  field_events events;
  int stall = 0, n_dir = 0, frac = 0, first_percent = 0;
  std::deque<beat> expected, next; /* of accepted samples; of the one on offer */
  uint32_t next_pos[3];
  int tile_percent = 5;
  int64_t known = 1; /* positions that come again and again, but for fresh_percent of the samples */
  int fresh_percent = 100;
  static const uint64_t known_seed = 7;
  int accepted = 0, done = 0;
  bool in_ray = false, waits_for_valid = false; /* waits_for_valid: a sink that is ready for a beat that it sees */
  sink_stalls sink;
  held output;

  explicit encoder_bench(uint64_t seed) : u(seed), draw(seed)
  {
    u.top.s_valid_i = u.top.m_axis_tready_i = u.top.m_axi_arready_i = u.top.m_axi_rvalid_i = u.top.cfg_we_i = 0;
    u.top.base_i = memory.base = any_base(draw);
    u.top.planes_i = u.top.line_valid_i = u.top.line_empty_i = 0, u.top.line0_i = u.top.line1_i = 0;
    u.top.line_room_i = 1; /* of planes alone */
    u.reset();
  }
  void load(const grid_fixture *fixture, int directions, int lsb)
  {
    memory.source = table = fixture, n_dir = directions, frac = lsb, in_ray = false;
    u.top.m_axi_arready_i = u.top.m_axi_rvalid_i = 0; /* the memory rests */
    configure_levels(u, fixture->grid);
    configure(u, 0x80, fixture->grid.levels);
    configure(u, 0x81, n_dir < FX_SH ? n_dir : draw(FX_SH, 31)); /* no more than there are */
    configure(u, 0x82, frac);
  }
  void timing(int latency, int spread, int stalls, int first)
  {
    memory.latency = latency, memory.spread = spread, memory.stall = stalls;
    stall = sink.percent = stalls, sink.until = 0, first_percent = first;
  }
  void clear(bool hard)
  {
    forget_offers(); /* reset withdraws at once */
    u.top.rst_ni = !hard, u.top.clear_i = !hard;
    cycle(0);
    u.top.rst_ni = 1, u.top.clear_i = 0, u.top.s_valid_i = 0;
    expected.clear(), in_ray = false;
    forget_offers();
    accepted = done;
    memory.clear(hard), model.empty();
    for (int i = 0; i < 3; i++) cycle(0); /* events of before are still on their way to the outputs */
    events = field_events(), memory.asked = 0, model.lookups = model.misses = 0;
  }
  void cycle(int more)
  {
    if (!u.top.s_valid_i && more > 0 && !draw.percent(stall)) offer();
    u.top.m_axis_tready_i = waits_for_valid ? 0 : !sink(draw, u.cycle);
    show_anything(u, draw, 0x83);
    memory.drive(u, draw);
    u.settle();
    if (waits_for_valid) u.top.m_axis_tready_i = u.top.m_axis_tvalid_o, u.settle();
    const bool quiet = !u.top.rst_ni || u.top.clear_i, taken = u.top.s_valid_i && u.top.s_ready_o;
    memory.sample(u, draw);
    events.sample(u);
    if (u.top.waits_o) ck_assert(u.top.m_axis_tready_i); /* the nets wait, too */
    output.check(u.top.m_axis_tvalid_o, u.top.m_axis_tready_i, u.top.m_axis_tdata_o);
    if (taken && !quiet) {
      expected.insert(expected.end(), next.begin(), next.end());
      look_up();
      accepted++;
    }
    if (u.top.m_axis_tvalid_o && u.top.m_axis_tready_i && !quiet) take();
    u.edge();
    if (taken) u.top.s_valid_i = 0;
  }
  uint64_t run(int samples) { return run_samples(*this, samples); }

  bool idle() const { return expected.empty() && memory.queue.empty(); }
  void same_counts() { events.same(model, memory); }

private:
  void forget_offers() { output = held(); }
  void look_up()
  {
    if (u.top.s_tile_i) model.empty();
    for (int l = 0; l < table->grid.levels; l++)
      for (int corner = 0; corner < FX_GRID_CORNERS; corner += 2)
        model.pair(table->entry(next_pos, l, corner), table->entry(next_pos, l, corner + 1));
  }
  void offer()
  {
    uint32_t pos[3];
    int16_t f[2 * FX_LEVELS_MAX], v[3], dir[FX_SH];
    const bool first = !in_ray || draw.percent(first_percent);
    const bool fresh = draw.percent(fresh_percent);
    const uint64_t place = (uint64_t)draw(0, known - 1);
    for (uint64_t a = 0; a < 3; a++)
      pos[a] = fresh ? table->coordinate(draw) : (uint32_t)sf_random_below(known_seed, a, place, 1 << SF_POS_FRAC);
    for (int a = 0; a < 3; a++) v[a] = (int16_t)draw(-17000, 17000);
    fx_grid_features(&table->grid, pos, f, nullptr);
    fx_sh(v, frac, dir);
    next.clear();
    if (first) add_beats(next, dir, n_dir, true, false);
    add_beats(next, f, 2 * table->grid.levels, first && n_dir == 0, true);
    std::copy_n(pos, 3, next_pos);
    set_position(u.top.s_pos_i, pos);
    u.top.s_tile_i = draw.percent(tile_percent);
    u.top.s_dir_i = (uint64_t)(uint16_t)v[2] << 32 | (uint64_t)(uint16_t)v[1] << 16 | (uint16_t)v[0];
    u.top.s_first_i = first, u.top.s_valid_i = 1, in_ray = true;
  }
  void take()
  {
    ck_assert_msg(!expected.empty(), "a beat that belongs to no sample");
    const beat b = expected.front();
    ck_assert_msg(u.top.m_axis_tdata_o == b.data, "sample %d (%d levels, %d harmonics): beat %016llx, expected %016llx",
                  done, table->grid.levels, n_dir, (unsigned long long)u.top.m_axis_tdata_o,
                  (unsigned long long)b.data);
    ck_assert_int_eq(u.top.m_axis_tuser_o, b.user);
    ck_assert_int_eq(u.top.m_axis_tlast_o, b.last);
    expected.pop_front();
    done += b.last;
  }
};

typedef encoder_bench<Vsf_encoder, 32768, 4> usual;
typedef encoder_bench<Vsf_encoder_1, 1024, 1> small;

template <class bench> static void random_scenes(uint64_t seed)
{
  bench b(seed);
  for (int n = 0; n < 15 * unit_length(); n++) {
    const grid_fixture fixture(b.draw, n % 4 ? (int)b.draw(1, 16) : n % 8 ? 1 : 16, n % 5 == 4);
    b.load(&fixture, n % 3 ? (int)b.draw(0, 16) : 16, (int)b.draw(0, 11));
    b.timing((int)b.draw(1, 60), (int)b.draw(0, 3) * 40, n % 3 == 0 ? 0 : n % 3 == 1 ? 20 : 70, (int)b.draw(0, 4) * 25);
    b.waits_for_valid = n % 5 == 1;
    b.run(100);
    for (int i = 0; i < 20; i++) b.cycle(0); /* and no beat more */
    ck_assert(b.idle());
    b.same_counts();
    b.clear(false); /* another table follows */
  }
}

LOOP_TEST(random_scenes_through_the_usual_cache, 3)
{
  random_scenes<usual>((uint64_t)_i + 60);
}

LOOP_TEST(random_scenes_through_a_small_one, 3)
{
  random_scenes<small>((uint64_t)_i + 65);
}

/* The levels of a real scene: dense and hashed tables of up to 2^19 entries. */
static void real_sizes(grid_fixture &fixture)
{
  fx_grid &grid = fixture.grid;
  grid.entries = 0;
  for (int l = 0; l < grid.levels; l++) {
    double res = 16;
    for (int i = 0; i < l; i++) res *= 1.3819;
    const int64_t stride = (int64_t)res + 3;
    const bool dense = stride * stride * stride <= 1 << 19;
    grid.scale_q16[l] = (int32_t)((res - 1) * 65536);
    grid.stride[l] = dense ? (int32_t)stride : 0, grid.log2_size[l] = 19;
    grid.offset[l] = grid.entries, grid.shift[l] = 12;
    grid.entries += dense ? stride * stride * stride : 1 << 19;
  }
  fixture.table.resize((size_t)grid.entries * 2);
  for (size_t i = 0; i < fixture.table.size(); i++) fixture.table[i] = (int8_t)(i * 2654435761u >> 24);
  grid.table = fixture.table.data();
}

/* Positions that the cache knows, and now and then one that it does not. */
static void full_speed(int levels, int latency, int first, int fresh)
{
  const int samples = 200, pairs = samples * levels * FX_GRID_CORNERS / 2;
  usual b(70);
  grid_fixture fixture(b.draw, levels, 0);
  real_sizes(fixture);
  b.load(&fixture, 16, 6);
  b.timing(latency, 0, 0, first);
  b.tile_percent = 0;
  b.known = 8, b.fresh_percent = 0;
  b.run(40);
  b.fresh_percent = fresh;
  const uint64_t misses = b.events.misses, stalls = b.events.stalls;
  const int cycles = (int)b.run(samples), missed = (int)(b.events.misses - misses);
  ck_assert_msg(b.events.stalls - stalls <= (uint64_t)(missed * (latency + 8)), "latency %d: %d lines, %d stalls",
                latency, missed, (int)(b.events.stalls - stalls));
  /* A line costs the two cycles of its beats at most; a pair whose set is in use waits three. */
  ck_assert_msg(cycles <= pairs + pairs / 50 + 2 * missed + latency + 80,
                "%d levels, latency %d, %d %% first: %d cycles for %d pairs, %d lines", levels, latency, first, cycles,
                pairs, missed);
}

/* Samples cost a cycle per pair, even at one sample per ray, for which four rays on their way hide less. */
TEST(a_pair_in_every_cycle)
{
  for (int levels = 12; levels <= 16; levels += 4)
    for (int latency = 1; latency <= 76; latency += 25) {
      full_speed(levels, latency, 10, 0);
      full_speed(levels, latency, 10, 3);
    }
  full_speed(16, 31, 100, 0);
}

/* A direction that waits for the harmonics of the one before holds up nothing but a third one, in the register at the
 * input. */
TEST(a_direction_that_waits)
{
  enum { HARMONICS = 2 * FX_SH + 15 };
  usual b(75);
  const grid_fixture fixture(b.draw, 1, 0);
  b.load(&fixture, FX_SH, 6);
  b.timing(1, 0, 0, 100);
  while (b.accepted < 2) b.cycle(1); /* two rays */
  const uint64_t begin = b.u.cycle;
  b.timing(1, 0, 0, 0);
  while (b.accepted < 4) b.cycle(1); /* two more samples of the second */
  ck_assert_uint_lt(b.u.cycle - begin, 20);
  b.timing(1, 0, 0, 100);
  while (b.accepted < 6) b.cycle(1);
  ck_assert_uint_gt(b.u.cycle - begin, HARMONICS / 2);
  b.run(20);
}

template <class bench> static void reset_on_the_way()
{
  bench b(80);
  for (int delay = 0; delay < 400; delay += 1 + delay / 60) {
    const grid_fixture fixture(b.draw, (int)b.draw(1, 16), 0);
    b.load(&fixture, (int)b.draw(0, 16), (int)b.draw(0, 11));
    b.timing((int)b.draw(1, 90), 20, (int)b.draw(0, 1) * 30, 50);
    for (int i = 0; i < delay; i++) b.cycle(1);
    b.clear(delay % 3 == 0);
    if (delay % 3 == 1) b.clear(false);
    b.run(3); /* programming is kept */
    for (int i = 0; i < delay; i++) b.cycle(1);
    b.clear(delay % 2);
  }
}

TEST(reset_on_the_way_with_the_usual_cache)
{
  reset_on_the_way<usual>();
}

TEST(reset_on_the_way_with_a_small_one)
{
  reset_on_the_way<small>();
}

TEST(sizes_of_a_real_scene)
{
  random_draw draw(90);
  grid_fixture fixture(draw, 16, 0);
  real_sizes(fixture);
  small b(90);
  b.load(&fixture, 16, 6);
  b.timing(40, 10, 5, 10);
  b.run(1000 * unit_length());
  b.same_counts();
}

int ck_timeout = 3600;
