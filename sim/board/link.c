#include "sim/board/link.h"
#include "cli/cli.h"
#include "base/clock.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <linux/serial.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

enum { TRIES = 6, ANSWER = 0x80, REFUSAL = 0xee, STATUS_SIZE = 1, STATUS_SILENT = 2, READ_BYTES = 4096 };
#define LINK_NAME 0x5346u /* "SF" */
enum { LINK_VERSION = 1 };

/* ---- the port ---- */

/* 3 Mbaud, eight bits, no translation. A pseudo-terminal accepts the rate and ignores it. */
static sf_status set_line(sf_link *l)
{
  struct termios line;
  if (tcgetattr(l->file, &line)) return sf_fail(SF_E_IO, "%s: no serial port", l->port);
  cfmakeraw(&line);
  line.c_cflag |= CLOCAL | CREAD;
  line.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS);
  cfsetispeed(&line, B3000000), cfsetospeed(&line, B3000000);
  if (tcsetattr(l->file, TCSANOW, &line)) return sf_fail(SF_E_IO, "%s: no serial port of 3 Mbaud", l->port);
  /* An FTDI chip holds short answers back for 16 ms unless it is told not to. A port without this switch is slower. */
  struct serial_struct serial;
  if (!ioctl(l->file, TIOCGSERIAL, &serial)) {
    serial.flags |= ASYNC_LOW_LATENCY;
    ioctl(l->file, TIOCSSERIAL, &serial);
  }
  tcflush(l->file, TCIOFLUSH);
  return sf_ok();
}

static sf_status open_port(sf_link *l)
{
  l->file = open(l->port, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (l->file < 0) return sf_fail(SF_E_IO, "%s: no board there: %s", l->port, strerror(errno));
  if (flock(l->file, LOCK_EX | LOCK_NB)) return sf_fail(SF_E_IO, "%s: another program uses this port", l->port);
  return set_line(l);
}

/* Waits for the port. False if nothing came within the time. */
static bool ready(const sf_link *l, short what, double until)
{
  while (!sf_cli_interrupted()) {
    const double left = until - sf_seconds();
    struct pollfd poll_for = {.fd = l->file, .events = what};
    if (left <= 0) return false;
    const int n = poll(&poll_for, 1, left < 0.1 ? (int)(left * 1000) + 1 : 100);
    if (n > 0) return true;
    if (n < 0 && errno != EINTR) return false;
  }
  return false;
}

static sf_status gone(const sf_link *l)
{
  if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "%s: stopped", l->port);
  return sf_fail(SF_E_IO, "%s: the board is gone: %s", l->port, errno ? strerror(errno) : "the port was closed");
}

static sf_status put(sf_link *l, const uint8_t *byte, size_t n)
{
  for (size_t at = 0; at < n;) {
    if (!ready(l, POLLOUT, sf_seconds() + l->patience)) {
      if (sf_cli_interrupted()) return gone(l);
      return sf_fail(SF_E_IO, "%s: the port takes no bytes", l->port);
    }
    const ssize_t some = write(l->file, byte + at, n - at);
    if (some < 0 && errno != EAGAIN && errno != EINTR) return gone(l);
    if (some > 0) at += (size_t)some;
  }
  l->faults.bytes_out += n;
  return sf_ok();
}

/* ---- commands ---- */

typedef enum { HEARD_ANSWER, HEARD_NOTHING, HEARD_DAMAGE, HEARD_REFUSAL } heard;

/* Answers to earlier commands are ignored. */
static bool take_byte(sf_link *l, uint8_t byte, uint8_t command, sf_frame *answer, heard *result, sf_wrong *wrong)
{
  if (!sf_frame_read(&l->reader, byte, answer, wrong)) return false;
  if (*wrong != SF_WRONG_NOTHING) {
    *result = HEARD_DAMAGE;
    return true;
  }
  if (answer->command == REFUSAL && answer->words == 0) {
    *wrong = (sf_wrong)answer->number;
    *result = HEARD_REFUSAL;
    return true;
  }
  *result = HEARD_ANSWER;
  return answer->number == l->number && answer->command == (command | ANSWER) && answer->words > 0;
}

static sf_status listen(sf_link *l, uint8_t command, sf_frame *answer, heard *result, sf_wrong *wrong)
{
  uint8_t byte[READ_BYTES];
  double until = sf_seconds() + l->patience;
  while (ready(l, POLLIN, until)) {
    errno = 0;
    const ssize_t n = read(l->file, byte, sizeof byte);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) return gone(l);
    if (n > 0) until = sf_seconds() + l->patience, l->faults.bytes_in += (uint64_t)n;
    /* After a damaged answer the host asks again, so nothing useful follows one. */
    for (ssize_t i = 0; i < n; i++)
      if (take_byte(l, byte[i], command, answer, result, wrong)) return sf_ok();
  }
  if (sf_cli_interrupted()) return gone(l);
  *result = HEARD_NOTHING;
  return sf_ok();
}

static sf_status refusal(const sf_link *l, sf_wrong wrong)
{
  if (wrong == SF_WRONG_GREETING)
    return sf_fail(SF_E_IO, "%s: the board was reset while it was at work; start again", l->port);
  return sf_fail(SF_E_IO, "%s: the board refuses a command: %s", l->port, sf_wrong_text(wrong));
}

static sf_status give_up(const sf_link *l, heard last, sf_wrong wrong)
{
  if (last == HEARD_NOTHING)
    return sf_fail(SF_E_IO, "%s: the board does not answer (%d tries, %g s each)", l->port, TRIES, l->patience);
  return sf_fail(SF_E_IO, "%s: frames %s the board are damaged, %d times in a row: %s", l->port,
                 last == HEARD_REFUSAL ? "to" : "from", TRIES, sf_wrong_text(wrong));
}

static sf_status answered(const sf_link *l, const sf_frame *answer)
{
  if (answer->word[0] == 0) return sf_ok();
  if (answer->word[0] == STATUS_SILENT)
    return sf_fail(SF_E_IO, "%s: a register of the accelerator does not answer", l->port);
  return sf_fail(SF_E_IO, "%s: the board refuses a command: %s", l->port,
                 answer->word[0] == STATUS_SIZE ? "its size" : "an unknown status");
}

/* A disturbed line may leave bytes that nobody sent. */
static void drain(sf_link *l)
{
  uint8_t byte[READ_BYTES];
  while (read(l->file, byte, sizeof byte) > 0) {
  }
  l->reader = (sf_frame_reader){.count = 0};
}

sf_status sf_link_call(sf_link *l, sf_frame *frame)
{
  uint8_t byte[SF_FRAME_BYTES];
  heard last = HEARD_NOTHING;
  sf_wrong wrong = SF_WRONG_NOTHING;
  const uint8_t command = frame->command;
  frame->number = ++l->number;
  const size_t n = sf_frame_write(frame, byte);
  l->faults.commands++;
  for (int i = 0; i < TRIES; i++) {
    SF_TRY(put(l, byte, n));
    SF_TRY(listen(l, command, frame, &last, &wrong));
    if (last == HEARD_ANSWER) return answered(l, frame);
    if (last == HEARD_REFUSAL && wrong >= SF_WRONG_GREETING) return refusal(l, wrong);
    if (last == HEARD_NOTHING)
      l->faults.silent++;
    else
      (last == HEARD_REFUSAL ? l->faults.at_board : l->faults.at_host)[wrong]++;
    if (last == HEARD_NOTHING) drain(l);
  }
  return give_up(l, last, wrong);
}

/* ---- greeting ---- */

sf_status sf_link_greet(sf_link *l)
{
  const uint32_t word = (uint32_t)(sf_seconds() * 1e6) ^ (uint32_t)getpid() << 20;
  sf_frame frame = {.command = SF_LINK_HELLO, .words = 1, .word = {word}};
  drain(l);
  SF_TRY(sf_link_call(l, &frame));
  if (frame.words < 6 || frame.word[1] != word || frame.word[2] >> 16 != LINK_NAME)
    return sf_fail(SF_E_IO, "%s: what answers there is no spikefield board", l->port);
  if ((frame.word[2] & 0xffff) != LINK_VERSION)
    return sf_fail(SF_E_UNSUPPORTED, "%s: the board's link has version %u, this program's %d: build both of one source",
                   l->port, frame.word[2] & 0xffff, LINK_VERSION);
  l->memory_bytes = frame.word[3], l->clock_hz = frame.word[4];
  if (frame.word[5] != SF_FRAME_WORDS)
    return sf_fail(SF_E_UNSUPPORTED, "%s: the board's frames have %u words, this program's %d", l->port, frame.word[5],
                   SF_FRAME_WORDS);
  return sf_ok();
}

sf_status sf_link_open(sf_link *l, const char *port, double patience)
{
  *l = (sf_link){.port = port, .file = -1, .patience = patience, .number = (uint8_t)getpid()};
  sf_status status = open_port(l);
  if (status.code == SF_OK) status = sf_link_greet(l);
  if (status.code != SF_OK) sf_link_close(l);
  return status;
}

void sf_link_close(sf_link *l)
{
  if (l->file >= 0) close(l->file);
  l->file = -1;
}

/* ---- what happened on the way ---- */

static void add(char text[400], uint64_t n, const char *what, const char *where)
{
  const size_t at = strlen(text);
  if (n) snprintf(text + at, 400 - at, "%s%" PRIu64 " %s%s", at ? ", " : "", n, what, where);
}

void sf_link_faults_text(const sf_link *l, char text[400])
{
  text[0] = 0;
  for (int w = SF_WRONG_BYTE; w <= SF_WRONG_CRC; w++) {
    add(text, l->faults.at_board[w], sf_wrong_text((sf_wrong)w), " at the board");
    add(text, l->faults.at_host[w], sf_wrong_text((sf_wrong)w), " at the host");
  }
  add(text, l->faults.silent, "without an answer", "");
}
