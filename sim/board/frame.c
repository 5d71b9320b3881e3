#include "sim/board/frame.h"
#include "firmware/sf_tile.h"

enum { END = 0xc0, ESC = 0xdb, ESC_END = 0xdc, ESC_ESC = 0xdd, WORD = 4 };

const char *sf_wrong_text(sf_wrong wrong)
{
  static const char *const text[] = {"",
                                     "a byte is broken",
                                     "too long",
                                     "bytes are missing or too many (length)",
                                     "changed on the way (CRC)",
                                     "the board was reset",
                                     "out of order",
                                     "a command that the board does not know"};
  return (unsigned)wrong < sizeof text / sizeof *text ? text[wrong]
                                                      : "refused for a reason that this program does not know";
}

/* ---- to the line ---- */

static uint8_t *put_byte(uint8_t *to, uint8_t byte)
{
  if (byte != END && byte != ESC) return *to = byte, to + 1;
  to[0] = ESC, to[1] = byte == END ? ESC_END : ESC_ESC;
  return to + 2;
}

static uint8_t *put_word(uint8_t *to, uint32_t word, uint32_t *crc)
{
  const uint8_t byte[WORD] = {(uint8_t)word, (uint8_t)(word >> 8), (uint8_t)(word >> 16), (uint8_t)(word >> 24)};
  if (crc) *crc = sf_crc32(*crc, byte, WORD);
  for (int i = 0; i < WORD; i++) to = put_byte(to, byte[i]);
  return to;
}

size_t sf_frame_write(const sf_frame *frame, uint8_t *bytes)
{
  uint32_t crc = 0;
  uint8_t *to = bytes;
  *to++ = END;
  to = put_word(to, frame->words << 16 | (uint32_t)frame->command << 8 | frame->number, &crc);
  for (uint32_t i = 0; i < frame->words; i++) to = put_word(to, frame->word[i], &crc);
  to = put_word(to, crc, NULL);
  *to++ = END;
  return (size_t)(to - bytes);
}

/* ---- from the line ---- */

static uint32_t word_at(const uint8_t *byte)
{
  return byte[0] | (uint32_t)byte[1] << 8 | (uint32_t)byte[2] << 16 | (uint32_t)byte[3] << 24;
}

static sf_wrong parse(const sf_frame_reader *r, sf_frame *frame)
{
  if (r->broken || r->escaped) return SF_WRONG_BYTE;
  if (r->too_long) return SF_WRONG_LONG;
  const uint32_t header = r->count >= WORD ? word_at(r->byte) : 0;
  *frame = (sf_frame){.number = (uint8_t)header, .command = (uint8_t)(header >> 8), .words = header >> 16};
  if (r->count < 2 * WORD || r->count != WORD * ((size_t)frame->words + 2)) return SF_WRONG_LENGTH;
  if (sf_crc32(0, r->byte, (uint32_t)r->count - WORD) != word_at(r->byte + r->count - WORD)) return SF_WRONG_CRC;
  for (uint32_t i = 0; i < frame->words; i++) frame->word[i] = word_at(r->byte + WORD * (i + 1));
  return SF_WRONG_NOTHING;
}

static void put(sf_frame_reader *r, uint8_t byte)
{
  if (r->count < sizeof r->byte)
    r->byte[r->count++] = byte;
  else
    r->too_long = true;
}

bool sf_frame_read(sf_frame_reader *r, uint8_t byte, sf_frame *frame, sf_wrong *wrong)
{
  if (byte == END) {
    const bool empty = r->count == 0 && !r->escaped && !r->broken;
    if (!empty) *wrong = parse(r, frame);
    *r = (sf_frame_reader){.count = 0};
    return !empty;
  }
  const bool escaped = r->escaped;
  r->escaped = byte == ESC;
  if (escaped && byte != ESC_END && byte != ESC_ESC) r->broken = true;
  if (byte != ESC) put(r, !escaped ? byte : byte == ESC_END ? END : ESC);
  return false;
}
