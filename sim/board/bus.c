/* The driver's way to the registers of a board. Writes are collected and sent together. The counters of a snapshot do
 * not change, so many are read at once. The first failure is kept, because the driver does not look for one. */
#include "sim/board/bus.h"
#include "sim/sim.h"
#include <inttypes.h>
#include <string.h>

enum { WINDOW_WORDS = 80 /* of an event: layers and steps */, COUNTERS_END = 0x2000, POLLS_MAX = 4000, WORD = 4 };

static void fail(sf_board *b, sf_status status)
{
  if (b->trouble.code == SF_OK) b->trouble = status;
}

void sf_board_flush(sf_board *b)
{
  if (!b->writes.words || b->trouble.code != SF_OK) return;
  b->writes.command = SF_LINK_WRITE;
  const sf_status status = sf_link_call(&b->link, &b->writes);
  if (status.code != SF_OK)
    fail(b, status);
  else if (b->writes.words == 3 && b->writes.word[1] >> 16 && b->refused == UINT32_MAX)
    b->refused = b->writes.word[2];
  b->writes.words = 0;
}

static void bus_write(void *context, uint32_t offset, uint32_t value)
{
  sf_board *b = context;
  sf_frame *f = &b->writes;
  b->window_words = b->polls = 0;
  if (b->trouble.code != SF_OK) return;
  if (f->words + 2 > SF_FRAME_WORDS) sf_board_flush(b);
  if (!f->words || (f->word[b->segment] & 0xffff) != offset) {
    b->segment = f->words;
    f->word[f->words++] = offset;
  }
  f->word[b->segment] += 1u << 16;
  f->word[f->words++] = value;
}

static void read_ahead(sf_board *b, uint32_t offset, uint32_t words)
{
  sf_frame f = {.command = SF_LINK_READ, .words = 2, .word = {offset, words}};
  const sf_status status = sf_link_call(&b->link, &f);
  if (status.code == SF_OK && (f.words != words + 2 || f.word[1])) {
    fail(b, sf_fail(SF_E_UNSUPPORTED, "%s: the board refuses to read register %03" PRIx32, b->link.port, offset));
  } else if (status.code != SF_OK) {
    fail(b, status);
  } else {
    memcpy(b->window, f.word + 2, words * sizeof *b->window);
    b->window_from = offset, b->window_words = words;
  }
}

static uint32_t bus_read(void *context, uint32_t offset)
{
  sf_board *b = context;
  const bool counter = offset >= SF_CSR_COUNTERS;
  sf_board_flush(b);
  b->polls = offset == b->polled ? b->polls + 1 : 0;
  b->polled = offset;
  if (b->polls > POLLS_MAX)
    fail(b, sf_fail(SF_E_DIFFERENCE, "%s: register %03" PRIx32 " stays as it is", b->link.port, offset));
  if (b->trouble.code != SF_OK) return 0;
  const uint32_t at = (offset - b->window_from) / WORD, left = (COUNTERS_END - offset) / WORD;
  if (counter && offset >= b->window_from && at < b->window_words) return b->window[at];
  read_ahead(b, offset, !counter ? 1 : left < WINDOW_WORDS ? left : WINDOW_WORDS);
  const uint32_t value = b->trouble.code == SF_OK ? b->window[0] : 0;
  if (!counter) b->window_words = 0;
  return value;
}

const sf_bus *sf_board_bus(sf_board *b)
{
  b->bus = (sf_bus){bus_read, bus_write, b};
  b->trouble = sf_ok();
  b->refused = UINT32_MAX;
  b->polls = 0;
  return &b->bus;
}

const char *sf_board_error(sf_board *b, uint32_t offset, const char *(*text)(uint32_t error))
{
  const uint32_t value = bus_read(b, offset);
  return b->trouble.code != SF_OK ? "registers do not answer" : text(value);
}

static sf_status version(sf_board *b)
{
  const uint32_t is = bus_read(b, SF_CSR_VERSION), wanted = SF_CSR_VERSION_RESET;
  SF_TRY(b->trouble);
  return sf_fail(SF_E_UNSUPPORTED,
                 "%s: the board's accelerator has version %u.%u, this program drives %u.x: build both of one source",
                 b->link.port, is >> 16, is & 0xffff, wanted >> 16);
}

sf_status sf_board_status(sf_board *b, sf_driver_code code, const char *what)
{
  sf_board_flush(b);
  SF_TRY(b->trouble);
  if (code == SF_DRIVER_VERSION) return version(b);
  if (code == SF_DRIVER_REFUSED) {
    const char *net = sf_board_error(b, SF_CSR_ERROR, sf_driver_error_text);
    const char *rays = sf_board_error(b, SF_CSR_RAY_ERROR, sf_ray_driver_error_text);
    return sf_fail(SF_E_UNSUPPORTED, "%s: %s: %s: %s; rays: %s", b->link.port, what, sf_driver_text(code), net, rays);
  }
  if (code != SF_DRIVER_OK) return sf_fail(SF_E_UNSUPPORTED, "%s: %s: %s", b->link.port, what, sf_driver_text(code));
  if (b->refused != UINT32_MAX)
    return sf_fail(SF_E_UNSUPPORTED, "%s: %s: the board refuses a write to register %03" PRIx32, b->link.port, what,
                   b->refused);
  return sf_ok();
}
