/* sf_link behind a serial line, against the host's own side of it (sim/board/link.c) in a thread: what reaches
 * registers, memory and rays is what the host sent, once and in order, whatever happens to bytes on the way. */
#include "Vsf_link.h"
#include "Vsf_link_slow.h"
#include "tests/serial_line.h"
extern "C" {
#include "sim/board/link.h"
}
#include <atomic>
#include <fcntl.h>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>
#include <vector>

enum { MEMORY_WORDS = 128, REGISTERS = 2048, STEPS = 60 };

struct arrival {
  int kind; /* of SF_LINK_* */
  uint32_t at;
  uint64_t value;
  bool operator==(const arrival &o) const { return kind == o.kind && at == o.at && value == o.value; }
};
typedef std::vector<arrival> arrivals;

/* What lies behind sf_link: registers that answer late or refuse, a memory, an accelerator that makes of the beats of a
 * ray one pixel of their sum. */
template <class module> struct surroundings {
  module &top;
  random_draw &draw;
  arrivals log;
  uint32_t reg[REGISTERS] = {0};
  int read_wait = -1, write_wait = -1;
  bool have_address = false, have_data = false;
  uint64_t sum = 0;
  std::deque<uint64_t> pixels;
  surroundings(module &t, random_draw &d) : top(t), draw(d) {}
  static bool refuses(uint32_t offset) { return offset % 64 == 60; }

  void before()
  {
    top.m_axil_awready_i = !have_address && draw.percent(60);
    top.m_axil_wready_i = !have_data && draw.percent(60);
    top.m_axil_arready_i = read_wait < 0 && draw.percent(60);
    top.m_axil_bvalid_i = write_wait == 0;
    top.m_axil_rvalid_i = read_wait == 0;
    top.m_axis_tready_i = pixels.size() < 3 && draw.percent(50);
    top.s_axis_tvalid_i = !pixels.empty();
    for (int i = 0; i < 12; i++) top.s_axis_tdata_i[i] = pixels.empty() ? 0 : word(pixels.front(), i);
  }
  static uint32_t word(uint64_t pixel, int i) { return (uint32_t)(pixel >> 32 * (i % 2)) + (uint32_t)i; }

  uint32_t address, data, read_address;
  void write_channel()
  {
    if (top.m_axil_awvalid_o && top.m_axil_awready_i) have_address = true, address = top.m_axil_awaddr_o;
    if (top.m_axil_wvalid_o && top.m_axil_wready_i) have_data = true, data = top.m_axil_wdata_o;
    if (write_wait > 0) write_wait--;
    if (top.m_axil_bvalid_i && top.m_axil_bready_o) write_wait = -1;
    if (!have_address || !have_data) return;
    have_address = have_data = false;
    log.push_back({SF_LINK_WRITE, address, data});
    reg[address / 4] = data;
    top.m_axil_bresp_i = refuses(address) ? 2 : 0;
    write_wait = (int)draw(0, 9);
  }
  void read_channel()
  {
    if (read_wait > 0) read_wait--;
    if (top.m_axil_rvalid_i && top.m_axil_rready_o) read_wait = -1;
    if (!top.m_axil_arvalid_o || !top.m_axil_arready_i) return;
    read_address = top.m_axil_araddr_o;
    top.m_axil_rdata_i = reg[read_address / 4];
    top.m_axil_rresp_i = refuses(read_address) ? 2 : 0;
    read_wait = (int)draw(0, 9);
  }
  void after()
  {
    write_channel();
    read_channel();
    if (top.memory_we_o) log.push_back({SF_LINK_MEMORY, top.memory_address_o, top.memory_data_o});
    if (top.s_axis_tvalid_i && top.s_axis_tready_o) pixels.pop_front();
    if (!top.m_axis_tvalid_o || !top.m_axis_tready_i) return;
    const uint64_t low = (uint64_t)top.m_axis_tdata_o[1] << 32 | top.m_axis_tdata_o[0];
    log.push_back({SF_LINK_STREAM, (uint32_t)top.m_axis_tuser_o << 1 | top.m_axis_tlast_o, low});
    for (int i = 2; i < 8; i++) ck_assert_uint_eq(top.m_axis_tdata_o[i] & (i == 7 ? 0x3fffffff : ~0u), i * 0x01010101u);
    sum = (top.m_axis_tuser_o ? 0 : sum) + low;
    if (top.m_axis_tlast_o) pixels.push_back(sum);
  }
};

/* ---- the host ---- */

struct host {
  sf_link link;
  random_draw draw;
  arrivals sent;
  uint32_t reg[REGISTERS] = {0};
  uint64_t sum = 0;
  bool inside = false;
  std::deque<uint64_t> pixels;
  sf_status status = sf_ok();
  explicit host(uint64_t seed) : draw(seed) {}

  uint32_t word()
  {
    return draw.percent(30) ? (draw.percent(50) ? 0xc0dbdcddu : 0xc0c0dbdbu) : (uint32_t)draw(0, 0xffffffff);
  }
  sf_status write()
  {
    sf_frame f = {};
    f.command = SF_LINK_WRITE;
    uint32_t refused = 0, first = 0, written = 0;
    for (int64_t segments = draw(1, 5); segments > 0; segments--) {
      const uint32_t offset = (uint32_t)draw(0, REGISTERS - 1) * 4, count = (uint32_t)draw(1, 12);
      f.word[f.words++] = count << 16 | offset;
      for (uint32_t i = 0; i < count; i++) {
        const uint32_t value = f.word[f.words++] = word();
        sent.push_back({SF_LINK_WRITE, offset, value});
        reg[offset / 4] = value;
        written++;
        if (surroundings<Vsf_link>::refuses(offset) && !refused++) first = offset;
      }
    }
    SF_TRY(sf_link_call(&link, &f));
    if (f.words != 3 || f.word[1] != (refused << 16 | written) || f.word[2] != first)
      return sf_fail(SF_E_DIFFERENCE, "answer of WRITE");
    return sf_ok();
  }
  sf_status read()
  {
    const uint32_t count = (uint32_t)draw(1, draw.percent(10) ? SF_LINK_READ_MAX : 20),
                   first = (uint32_t)draw(0, REGISTERS - 1 - count);
    sf_frame f = {};
    f.command = SF_LINK_READ, f.words = 2, f.word[0] = 4 * first, f.word[1] = count;
    SF_TRY(sf_link_call(&link, &f));
    uint32_t refused = 0;
    for (uint32_t i = 0; i < count && f.words == count + 2; i++) {
      refused += surroundings<Vsf_link>::refuses(4 * (first + i));
      if (f.word[2 + i] != reg[first + i]) return sf_fail(SF_E_DIFFERENCE, "register %u", first + i);
    }
    return f.words == count + 2 && f.word[1] == refused << 16 ? sf_ok() : sf_fail(SF_E_DIFFERENCE, "answer of READ");
  }
  sf_status memory()
  {
    const uint32_t count = (uint32_t)draw(1, 20), first = (uint32_t)draw(0, MEMORY_WORDS - count);
    sf_frame f = {};
    f.command = SF_LINK_MEMORY, f.word[f.words++] = first;
    for (uint32_t i = 0; i < count; i++) {
      const uint32_t low = f.word[f.words++] = word(), high = f.word[f.words++] = word();
      sent.push_back({SF_LINK_MEMORY, first + i, (uint64_t)high << 32 | low});
    }
    return sf_link_call(&link, &f);
  }
  void beat(uint32_t *to, bool user, bool last)
  {
    const uint64_t low = (uint64_t)word() << 32 | word();
    to[0] = (uint32_t)low, to[1] = (uint32_t)(low >> 32);
    for (uint32_t i = 2; i < 8; i++)
      to[i] = (i * 0x01010101u & 0x3fffffff) | (i == 7 ? (uint32_t)user << 30 | (uint32_t)last << 31 : 0);
    sum = (user ? 0 : sum) + low;
    if (last) pixels.push_back(sum);
    sent.push_back({SF_LINK_STREAM, (uint32_t)user << 1 | last, low});
  }
  sf_status stream()
  {
    const uint32_t beats = (uint32_t)draw(0, 30);
    uint32_t given = 0;
    sf_frame f = {}, all = {};
    for (uint32_t i = 0; i < beats; i++) {
      const bool last = draw.percent(30) || pixels.size() + 1 >= 60;
      beat(all.word + 8 * i, !inside, last);
      inside = !last;
    }
    while (given < beats || pixels.size() > 40) {
      f.command = SF_LINK_STREAM, f.words = 1 + 8 * (beats - given);
      f.word[0] =
          4u << 16 |
          (uint32_t)(pixels.empty() || given < beats ? 0 : draw(0, (int64_t)std::min<size_t>(pixels.size(), 42)));
      memcpy(f.word + 1, all.word + 8 * given, 32 * (beats - given));
      SF_TRY(sf_link_call(&link, &f));
      given += f.word[1] & 0xffff;
      SF_TRY(take_pixels(f));
    }
    return sf_ok();
  }
  sf_status take_pixels(const sf_frame &f)
  {
    const uint32_t n = f.word[1] >> 16;
    if (f.words != 3 + 12 * n || n > pixels.size()) return sf_fail(SF_E_DIFFERENCE, "answer of STREAM: %u pixels", n);
    for (uint32_t i = 0; i < n; i++, pixels.pop_front())
      for (uint32_t w = 0; w < 12; w++)
        if (f.word[3 + 12 * i + w] != surroundings<Vsf_link>::word(pixels.front(), (int)w))
          return sf_fail(SF_E_DIFFERENCE, "pixel %u word %u", i, w);
    return sf_ok();
  }
  void run()
  {
    status = sf_link_greet(&link);
    for (int i = 0; i < STEPS && status.code == SF_OK; i++) switch (draw(0, 3)) {
      case 0:
        status = write();
        break;
      case 1:
        status = read();
        break;
      case 2:
        status = memory();
        break;
      default:
        status = stream();
      }
  }
};

/* ---- the line between ---- */

template <class module> struct link_bench {
  VerilatedContext context;
  module top;
  random_draw draw;
  surroundings<module> around;
  serial_sender to_board;
  serial_receiver from_board;
  byte_noise out, in;
  std::deque<uint8_t> to_host;
  int socket_of_board;
  explicit link_bench(uint64_t seed, double cycles)
      : top((context.randReset(2), context.randSeed((int)(seed % 0x7fffffff) + 1), &context)), draw(seed + 1),
        around(top, draw), to_board(cycles), from_board(cycles), out(seed + 2), in(seed + 3)
  {
  }
  void reset()
  {
    top.rst_ni = 0, top.rx_i = 1, top.irq_i = 0, top.clk_i = 0;
    around.before();
    top.eval();
    cycle(), top.rst_ni = 1;
  }
  void cycle()
  {
    top.rx_i = to_board.level();
    around.before();
    top.eval();
    if (top.rst_ni) {
      const int byte = from_board.take(top.tx_o);
      ck_assert_int_ne(byte, -2);
      if (byte >= 0) in.pass((uint8_t)byte, to_host);
      around.after();
    }
    top.clk_i = 1, top.eval();
    top.clk_i = 0, top.eval();
  }
  void pump()
  {
    uint8_t bytes[256];
    const ssize_t n = ::read(socket_of_board, bytes, sizeof bytes);
    for (ssize_t i = 0; i < n; i++) out.pass(bytes[i], to_board.waiting);
    const std::vector<uint8_t> back(to_host.begin(), to_host.end());
    if (back.empty()) return;
    const ssize_t written = ::write(socket_of_board, back.data(), back.size());
    if (written > 0) to_host.erase(to_host.begin(), to_host.begin() + written);
  }
  void run(host &h)
  {
    int ends[2];
    ck_assert_int_eq(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
    socket_of_board = ends[0];
    h.link = sf_link{};
    h.link.port = "bench", h.link.file = ends[1], h.link.patience = 0.25;
    std::atomic<bool> done(false);
    reset();
    std::thread thread([&] { h.run(), done = true; });
    while (!done) {
      pump();
      for (int i = 0; i < 200; i++) cycle();
    }
    thread.join();
    close(ends[0]), close(ends[1]);
  }
};

static void same(const arrivals &sent, const arrivals &seen, size_t extra)
{
  for (size_t i = 0; i < seen.size(); i++) {
    ck_assert_msg(i < sent.size(), "arrival %zu of kind %d, which nobody sent", i, seen[i].kind);
    ck_assert_msg(sent[i] == seen[i], "arrival %zu: kind %d at %x is %llx, sent kind %d at %x %llx", i, seen[i].kind,
                  seen[i].at, (unsigned long long)seen[i].value, sent[i].kind, sent[i].at,
                  (unsigned long long)sent[i].value);
  }
  ck_assert_msg(seen.size() + extra >= sent.size(), "%zu of %zu arrivals", seen.size(), sent.size());
}

LOOP_TEST(everything_arrives_once, 3)
{
  link_bench<Vsf_link> bench((uint64_t)_i, 4);
  host h((uint64_t)_i + 100);
  bench.run(h);
  ck_ok(h.status);
  same(h.sent, bench.around.log, 1); /* the last beat may wait still */
  char text[400];
  sf_link_faults_text(&h.link, text);
  ck_assert_str_eq(text, "");
}

/* A clock that is no multiple of the rate, and a host whose clock is not quite the board's. */
LOOP_TEST(a_bit_of_16_and_two_thirds, 3)
{
  static const double host_is[] = {1, 0.98, 1.02};
  link_bench<Vsf_link_slow> bench((uint64_t)_i, 50.0 / 3 * host_is[_i]);
  host h((uint64_t)_i + 200);
  bench.run(h);
  ck_ok(h.status);
  same(h.sent, bench.around.log, 1);
}

LOOP_TEST(damage_is_told_and_repaired, 4)
{
  link_bench<Vsf_link> bench((uint64_t)_i + 10, 4);
  bench.out.per_100000 = bench.in.per_100000 = _i % 2 ? 300 : 60;
  host h((uint64_t)_i + 300);
  bench.run(h);
  same(h.sent, bench.around.log, 1000); /* nothing wrong, nothing twice; the end is missing where the host gave up */
  char text[400];
  sf_link_faults_text(&h.link, text);
  ck_assert_str_ne(text, "");
  if (h.status.code != SF_OK) ck_bad(h.status, SF_E_IO, "bench", "times in a row");
  if (_i % 2 == 0) ck_ok(h.status);
}

/* A board that was reset, say by its button, has forgotten what it was given. */
TEST(reset_between_commands)
{
  link_bench<Vsf_link> bench(50, 4);
  struct one : host {
    std::atomic<int> at{0};
    using host::host;
  } h(60);
  int ends[2];
  ck_assert_int_eq(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
  bench.socket_of_board = ends[0];
  h.link = sf_link{};
  h.link.port = "bench", h.link.file = ends[1], h.link.patience = 0.25;
  bench.reset();
  sf_status after;
  std::thread thread([&] {
    h.status = sf_link_greet(&h.link);
    if (h.status.code == SF_OK) h.status = h.write();
    h.at = 1;
    while (h.at != 2) usleep(100);
    after = h.write();
    h.at = 3;
  });
  size_t writes = 0;
  while (h.at != 3) {
    bench.pump();
    for (int i = 0; i < 200; i++) bench.cycle();
    if (h.at != 1) continue;
    writes = bench.around.log.size();
    bench.reset();
    h.at = 2;
  }
  thread.join();
  close(ends[0]), close(ends[1]);
  ck_ok(h.status);
  ck_bad(after, SF_E_IO, "bench", "was reset");
  ck_assert_uint_eq(bench.around.log.size(), writes);
}

int ck_timeout = 600;
