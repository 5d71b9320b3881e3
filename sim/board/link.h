/* A board at the other end of a serial line: commands and their answers. A frame that was lost or damaged is
 * sent again, and the board obeys each command once. Mirror: rtl/board/sf_link.sv, rtl/board/sf_link_commands.sv */
#ifndef SF_SIM_BOARD_LINK_H
#define SF_SIM_BOARD_LINK_H
#include "base/status.h"
#include "sim/board/frame.h"

enum { SF_LINK_HELLO = 1, SF_LINK_WRITE, SF_LINK_READ, SF_LINK_MEMORY, SF_LINK_STREAM };
enum { SF_LINK_PIXEL_WORDS = 12, SF_LINK_PIXELS = 42 /* that the board keeps */, SF_LINK_BEAT_WORDS = 8 };
/* The largest payload of each. */
enum { SF_LINK_READ_MAX = SF_FRAME_WORDS - 2, SF_LINK_BEATS_MAX = (SF_FRAME_WORDS - 1) / SF_LINK_BEAT_WORDS };

/* What went wrong on the way and was sent again. */
typedef struct sf_link_faults {
  uint64_t commands, bytes_out, bytes_in; /* of all */
  uint64_t silent;                        /* no answer in time */
  uint64_t at_board[SF_WRONG_COMMAND + 1], at_host[SF_WRONG_COMMAND + 1];
} sf_link_faults;

typedef struct sf_link {
  const char *port; /* kept */
  int file;
  double patience; /* seconds without a byte until a command is sent again */
  uint8_t number;
  uint32_t memory_bytes, clock_hz; /* as the board says */
  sf_frame_reader reader;
  sf_link_faults faults;
} sf_link;

/* Opens the port and greets the board. SF_E_IO: no such port, or no board that answers. */
sf_status sf_link_open(sf_link *link, const char *port, double patience);
void sf_link_close(sf_link *link);
/* Drops what an earlier host left in the board: samples and pixels. */
sf_status sf_link_greet(sf_link *link);
/* frame: the command, then its answer, whose first word, the status, was 0. SF_E_IO names what failed. */
sf_status sf_link_call(sf_link *link, sf_frame *frame);
/* "3 frames sent again: 2 changed on the way (CRC) to the board, 1 without an answer", or "" where none was. */
void sf_link_faults_text(const sf_link *link, char text[400]);
#endif
