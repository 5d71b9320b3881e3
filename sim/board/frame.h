/* Frames on a board's serial line. A frame stands between two END bytes; an END or ESC inside is written as two bytes.
 * It has a header (number, command, words of payload), the payload, and a CRC-32 of all of it, little-endian. Mirror:
 * rtl/board/sf_link_rx.sv, rtl/board/sf_link_tx.sv, rtl/board/sf_link_crc.sv */
#ifndef SF_SIM_BOARD_FRAME_H
#define SF_SIM_BOARD_FRAME_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SF_FRAME_WORDS = 508 /* of a payload, at most */, SF_FRAME_BARE = 4 * (SF_FRAME_WORDS + 2) };
enum { SF_FRAME_BYTES = 2 * SF_FRAME_BARE + 2 /* on the line, at most */ };

typedef struct sf_frame {
  uint8_t number, command;
  uint32_t words, word[SF_FRAME_WORDS];
} sf_frame;

/* bytes[SF_FRAME_BYTES]; returns how many. */
size_t sf_frame_write(const sf_frame *frame, uint8_t *bytes);

/* What is wrong with a frame. The board uses the same numbers. */
typedef enum {
  SF_WRONG_NOTHING,
  SF_WRONG_BYTE,     /* a broken byte, or a half of an escaped one */
  SF_WRONG_LONG,     /* longer than a frame can be */
  SF_WRONG_LENGTH,   /* not as long as it says */
  SF_WRONG_CRC,      /* as long as it says, and changed */
  SF_WRONG_GREETING, /* of the board alone: no HELLO since it was reset */
  SF_WRONG_ORDER,    /* neither the next number nor the last one again */
  SF_WRONG_COMMAND   /* none that it knows */
} sf_wrong;
const char *sf_wrong_text(sf_wrong wrong);

/* Zero it. */
typedef struct sf_frame_reader {
  uint8_t byte[SF_FRAME_BARE];
  size_t count;
  bool escaped, broken, too_long;
} sf_frame_reader;
/* A byte of the line. True where it ends a frame: *frame, unless it is *wrong. */
bool sf_frame_read(sf_frame_reader *reader, uint8_t byte, sf_frame *frame, sf_wrong *wrong);
#endif
