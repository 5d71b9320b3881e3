/* A board of which there is none: rtl/board/sf_board.sv, Verilated, behind a pseudo-terminal, with what may happen to
 * bytes on a line and with boards that are not as they should be.
 *
 * usage: sf_board LINK [--noise N] [--seed S] [--defect N] [--version V] [--mute N] [--idle SECONDS]
 *   LINK        a name for the pseudo-terminal: sim_render --backend board --port LINK
 *   --noise     of 100 000 bytes in each direction so many are lost, doubled, changed, or come from nowhere
 *   --defect    every N-th word of eight bytes of the field's memory has a bit that is always the contrary
 *   --version   what register VERSION holds
 *   --mute      after so many commands the board answers no more
 *   --idle      ends when no byte has come for so long (default 600) */
#include "Vsf_board.h"
#include "tests/serial_line.h"
extern "C" {
#include "firmware/sf_driver.h"
#include "sim/board/link.h"
}
#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>
#include <vector>

enum { CLOCK_HZ = 50000000, CYCLES_A_TURN = 400, SETTLE = 40 };
static const double CYCLES_A_BIT = (double)CLOCK_HZ / SF_BOARD_BAUD; /* sim/board.mk */

struct options {
  const char *link = nullptr;
  long noise = 0, seed = 1, defect = -1, version = -1, mute = -1, idle = 600;
};

static options parse(int argc, char **argv)
{
  options o;
  struct {
    const char *name;
    long *value;
  } const table[] = {{"--noise", &o.noise},     {"--seed", &o.seed}, {"--defect", &o.defect},
                     {"--version", &o.version}, {"--mute", &o.mute}, {"--idle", &o.idle}};
  bool good = argc >= 2 && argc % 2 == 0;
  for (int i = 2; i + 1 < argc; i += 2) {
    bool known = false;
    for (const auto &t : table)
      if (!strcmp(argv[i], t.name)) *t.value = strtol(argv[i + 1], nullptr, 0), known = true;
    good = good && known;
  }
  if (!good)
    fprintf(stderr, "usage: sf_board LINK [--noise N] [--seed S] [--defect N] [--version V] [--mute N] [--idle S]\n");
  if (!good) exit(2);
  o.link = argv[1];
  return o;
}

/* Frames on their way, as an unsound board sees and makes them. */
struct unsound {
  const options &o;
  sf_frame_reader reader = {};
  long commands = 0;
  uint32_t asked = 0; /* register of the last READ */
  explicit unsound(const options &of) : o(of) {}
  bool muted() const { return o.mute >= 0 && commands > o.mute; }
  static void put(const sf_frame &frame, std::vector<uint8_t> &to)
  {
    uint8_t byte[SF_FRAME_BYTES];
    const size_t n = sf_frame_write(&frame, byte);
    to.insert(to.end(), byte, byte + n);
  }
  void command(sf_frame &f)
  {
    commands++;
    if (f.command == SF_LINK_READ) asked = f.word[0];
    if (f.command != SF_LINK_MEMORY || o.defect < 1) return;
    for (uint32_t at = 1; at < f.words; at += 2)
      if ((f.word[0] + at / 2) % (uint32_t)o.defect == 0) f.word[at] ^= 1 << 6;
  }
  void answer(sf_frame &f) const
  {
    if (o.version >= 0 && f.command == (SF_LINK_READ | 0x80) && asked == SF_CSR_VERSION)
      f.word[2] = (uint32_t)o.version;
  }
  void pass(uint8_t byte, bool to_board, sf_frame_reader &from, std::vector<uint8_t> &to)
  {
    sf_frame frame;
    sf_wrong wrong;
    if (o.defect < 0 && o.version < 0 && o.mute < 0) {
      to.push_back(byte);
      return;
    }
    if (!sf_frame_read(&from, byte, &frame, &wrong) || wrong != SF_WRONG_NOTHING) return;
    if (to_board)
      command(frame);
    else
      answer(frame);
    if (!muted()) put(frame, to);
  }
};

struct board {
  VerilatedContext context;
  Vsf_board top;
  serial_sender to_board{CYCLES_A_BIT};
  serial_receiver from_board{CYCLES_A_BIT};
  byte_noise out, in;
  unsound fault;
  sf_frame_reader commands = {}, answers = {};
  std::deque<uint8_t> to_host;
  uint64_t cycles = 0, bytes_to = 0, bytes_from = 0;
  explicit board(const options &o)
      : top((context.randReset(2), context.randSeed((int)(o.seed % 0x7fffffff) + 1), &context)),
        out((uint64_t)o.seed + 1), in((uint64_t)o.seed + 2), fault(o)
  {
    out.per_100000 = in.per_100000 = (int)o.noise;
    top.rst_ni = 0, top.rx_i = 1, top.clk_i = 0, top.eval();
    cycle(), cycle();
    top.rst_ni = 1;
  }
  void cycle()
  {
    top.rx_i = to_board.level();
    top.clk_i = 1, top.eval();
    top.clk_i = 0, top.eval();
    cycles++;
    const int byte = top.rst_ni ? from_board.take(top.tx_o) : -1;
    if (byte < 0) return;
    bytes_from++;
    std::vector<uint8_t> bytes;
    fault.pass((uint8_t)byte, false, answers, bytes);
    for (uint8_t b : bytes) in.pass(b, to_host);
  }
  void give(const uint8_t *bytes, ssize_t n)
  {
    std::vector<uint8_t> passed;
    std::deque<uint8_t> noisy;
    for (ssize_t i = 0; i < n; i++) out.pass(bytes[i], noisy);
    for (uint8_t b : noisy) fault.pass(b, true, commands, passed);
    bytes_to += passed.size();
    to_board.waiting.insert(to_board.waiting.end(), passed.begin(), passed.end());
  }
  bool idle() const { return to_board.idle() && from_board.idle() && !(top.lamps_o & 2); }
};

static volatile sig_atomic_t stopped;
static void stop(int)
{
  stopped = 1;
}

/* Our own opening of the other end keeps the pseudo-terminal alive between two hosts. */
static int open_terminal(const char *link)
{
  const int file = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
  const char *name = file >= 0 && !grantpt(file) && !unlockpt(file) ? ptsname(file) : nullptr;
  const int other = name ? open(name, O_RDWR | O_NOCTTY | O_NONBLOCK) : -1;
  struct termios line;
  if (other < 0 || tcgetattr(other, &line)) return -1;
  cfmakeraw(&line);
  tcsetattr(other, TCSANOW, &line);
  unlink(link);
  return symlink(name, link) ? -1 : file;
}

static void serve(board &b, int terminal, long idle)
{
  int quiet = 0;
  while (!stopped) {
    uint8_t bytes[4096];
    const ssize_t n = read(terminal, bytes, sizeof bytes);
    if (n > 0) b.give(bytes, n), quiet = 0;
    quiet = b.idle() ? quiet + 1 : 0;
    if (quiet <= SETTLE)
      for (int i = 0; i < CYCLES_A_TURN; i++) b.cycle();
    const std::vector<uint8_t> back(b.to_host.begin(), b.to_host.end());
    const ssize_t written = back.empty() ? 0 : write(terminal, back.data(), back.size());
    if (written > 0) b.to_host.erase(b.to_host.begin(), b.to_host.begin() + written);
    if (quiet <= SETTLE || !b.to_host.empty()) continue;
    struct pollfd wait = {terminal, POLLIN, 0};
    if (poll(&wait, 1, (int)(1000 * idle)) == 0) return;
  }
}

int main(int argc, char **argv)
{
  const options o = parse(argc, argv);
  signal(SIGTERM, stop), signal(SIGINT, stop);
  const int terminal = open_terminal(o.link);
  if (terminal < 0) {
    fprintf(stderr, "sf_board: %s: %s\n", o.link, strerror(errno));
    return 1;
  }
  board b(o);
  serve(b, terminal, o.idle);
  unlink(o.link);
  fprintf(stderr,
          "sf_board: %llu cycles, %llu bytes to the board and %llu back at %d baud; to the board %llu bytes lost, %llu "
          "doubled, %llu changed, %llu from nowhere; back "
          "%llu, %llu, "
          "%llu, %llu\n",
          (unsigned long long)b.cycles, (unsigned long long)b.bytes_to, (unsigned long long)b.bytes_from, SF_BOARD_BAUD,
          (unsigned long long)b.out.done[0], (unsigned long long)b.out.done[1], (unsigned long long)b.out.done[2],
          (unsigned long long)b.out.done[3], (unsigned long long)b.in.done[0], (unsigned long long)b.in.done[1],
          (unsigned long long)b.in.done[2], (unsigned long long)b.in.done[3]);
  return 0;
}
