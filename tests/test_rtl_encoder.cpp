/* sf_encoder against fx_grid_features and fx_sh, as the packets that the engine takes. */
#include "Vsf_encoder.h"
#include "Vsf_encoder_4.h"
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

/* Slices of the memory ports: one of a number, or of a wide one. */
static uint32_t slice(const uint32_t &all, int)
{
  return all;
}
template <class words> static uint32_t slice(const words &all, int port)
{
  return all[port];
}

template <class module, int ports> struct encoder_bench {
  unit<module> u;
  random_draw draw;
  const grid_fixture *table = nullptr;
  table_memory memory[ports] = {};
  int stall = 0, n_dir = 0, frac = 0, first_percent = 0;
  std::deque<beat> expected, next; /* of accepted samples; of the one on offer */
  int accepted = 0, done = 0;
  bool in_ray = false, waits_for_valid = false; /* waits_for_valid: a sink that is ready for a beat that it sees */
  sink_stalls sink;
  held output, request[ports];

  explicit encoder_bench(uint64_t seed) : u(seed), draw(seed)
  {
    u.top.s_valid_i = u.top.m_axis_tready_i = u.top.mem_req_ready_i = u.top.mem_rsp_valid_i = u.top.cfg_we_i = 0;
    u.reset();
  }
  void load(const grid_fixture *fixture, int directions, int lsb)
  {
    for (table_memory &m : memory) m.table = fixture;
    table = fixture, n_dir = directions, frac = lsb, in_ray = false;
    configure_levels(u, fixture->grid);
    configure(u, 0x80, fixture->grid.levels);
    configure(u, 0x81, n_dir < FX_SH ? n_dir : draw(FX_SH, 31)); /* no more than there are */
    configure(u, 0x82, frac);
  }
  void timing(int latency, int spread, int stalls, int first)
  {
    for (table_memory &m : memory) m.latency = latency, m.spread = spread, m.stall = stalls;
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
    for (table_memory &m : memory) {
      if (hard) m.queue.clear();
      for (table_memory::request &r : m.queue) r.entry = 0; /* answers to nobody, perhaps from a larger table */
    }
  }
  void cycle(int more)
  {
    if (!u.top.s_valid_i && more > 0 && !draw.percent(stall)) offer();
    u.top.m_axis_tready_i = waits_for_valid ? 0 : !sink(draw, u.cycle);
    show_anything(u, draw, 0x83);
    drive_memory();
    u.settle();
    if (waits_for_valid) u.top.m_axis_tready_i = u.top.m_axis_tvalid_o, u.settle();
    const bool quiet = !u.top.rst_ni || u.top.clear_i, taken = u.top.s_valid_i && u.top.s_ready_o;
    for (int p = 0; p < ports; p++) {
      const bool valid = u.top.mem_req_valid_o >> p & 1;
      request[p].check(valid, memory[p].ready, slice(u.top.mem_req_addr_o, p));
      memory[p].sample(draw, u.cycle, valid, slice(u.top.mem_req_addr_o, p));
    }
    output.check(u.top.m_axis_tvalid_o, u.top.m_axis_tready_i, u.top.m_axis_tdata_o);
    if (taken && !quiet) {
      expected.insert(expected.end(), next.begin(), next.end());
      accepted++;
    }
    if (u.top.m_axis_tvalid_o && u.top.m_axis_tready_i && !quiet) take();
    u.edge();
    if (taken) u.top.s_valid_i = 0;
  }
  uint64_t run(int samples)
  {
    const int end = done + samples;
    const uint64_t begin = u.cycle;
    while (done < end) {
      cycle(end - accepted);
      ck_assert_uint_lt(u.cycle - begin, (uint64_t)samples * 20000);
    }
    return u.cycle - begin;
  }

  bool idle() const
  {
    bool none = expected.empty();
    for (const table_memory &m : memory) none = none && m.queue.empty();
    return none;
  }

private:
  void forget_offers()
  {
    output = held();
    for (held &r : request) r = held();
  }
  void drive_memory()
  {
    uint64_t ready = 0, answers = 0, words = 0;
    for (int p = 0; p < ports; p++) {
      memory[p].drive(draw, u.cycle);
      ready |= (uint64_t)memory[p].ready << p, answers |= (uint64_t)memory[p].answers << p;
      words |= (uint64_t)memory[p].word << 16 * p;
    }
    u.top.mem_req_ready_i = (uint8_t)ready, u.top.mem_rsp_valid_i = (uint8_t)answers, u.top.mem_rsp_data_i = words;
  }
  void offer()
  {
    uint32_t pos[3];
    int16_t f[2 * FX_LEVELS_MAX], v[3], dir[FX_SH];
    const bool first = !in_ray || draw.percent(first_percent);
    for (int a = 0; a < 3; a++) pos[a] = table->coordinate(draw), v[a] = (int16_t)draw(-17000, 17000);
    fx_grid_features(&table->grid, pos, f, nullptr);
    fx_sh(v, frac, dir);
    next.clear();
    if (first) add_beats(next, dir, n_dir, true, false);
    add_beats(next, f, 2 * table->grid.levels, first && n_dir == 0, true);
    set_position(u.top.s_pos_i, pos);
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

typedef encoder_bench<Vsf_encoder, 1> one_port;
typedef encoder_bench<Vsf_encoder_4, 4> four_ports;

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
  }
}

LOOP_TEST(random_scenes_through_one_port, 3)
{
  random_scenes<one_port>((uint64_t)_i + 60);
}

LOOP_TEST(random_scenes_through_four_ports, 3)
{
  random_scenes<four_ports>((uint64_t)_i + 65);
}

/* `requests`: of a sample at the busiest port. */
template <class bench> static void full_speed(int levels, int latency, int first, int requests)
{
  const int samples = 60;
  bench b(70);
  const grid_fixture fixture(b.draw, levels, 0);
  b.load(&fixture, 16, 6);
  b.timing(latency, 0, 0, first);
  const int cycles = (int)b.run(samples);
  ck_assert_msg(cycles <= samples * requests + latency + 80,
                "%d levels, latency %d, %d %% first: %d cycles for %d requests", levels, latency, first, cycles,
                samples * requests);
}

/* Samples cost their requests alone, even at one sample per ray, for which three rays on their way hide less. */
TEST(a_request_in_every_cycle)
{
  for (int levels = 8; levels <= 16; levels += 4) {
    for (int latency = 1; latency <= 91; latency += 30) full_speed<one_port>(levels, latency, 10, 8 * levels);
    for (int latency = 1; latency <= 61; latency += 30) full_speed<one_port>(levels, latency, 100, 8 * levels);
  }
  for (int latency = 1; latency <= 91; latency += 30) full_speed<four_ports>(16, latency, 10, 32);
}

/* A direction that waits for the harmonics of the one before holds up nothing but a third one. */
TEST(a_direction_that_waits)
{
  enum { HARMONICS = 2 * FX_SH + 15 };
  one_port b(75);
  const grid_fixture fixture(b.draw, 1, 0);
  b.load(&fixture, FX_SH, 6);
  b.timing(1, 0, 0, 100);
  while (b.accepted < 2) b.cycle(1); /* two rays */
  const uint64_t begin = b.u.cycle;
  b.timing(1, 0, 0, 0);
  while (b.accepted < 4) b.cycle(1); /* two more samples of the second */
  ck_assert_uint_lt(b.u.cycle - begin, 20);
  b.timing(1, 0, 0, 100);
  while (b.accepted < 5) b.cycle(1);
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

TEST(reset_on_the_way_through_one_port)
{
  reset_on_the_way<one_port>();
}

TEST(reset_on_the_way_through_four_ports)
{
  reset_on_the_way<four_ports>();
}

/* The levels of a real scene: 16, dense and hashed tables of up to 2^19 entries. */
TEST(sizes_of_a_real_scene)
{
  random_draw draw(90);
  grid_fixture fixture(draw, 16, 0);
  fx_grid &grid = fixture.grid;
  grid.entries = 0;
  for (int l = 0; l < 16; l++) {
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
  four_ports b(90);
  b.load(&fixture, 16, 6);
  b.timing(40, 10, 5, 10);
  b.run(1000 * unit_length());
}

int ck_timeout = 3600;
