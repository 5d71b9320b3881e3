/* What a board sends, byte for byte; besides, the input as the payload of a sound frame. A frame that is accepted is
 * written again and comes back the same. */
#include "fuzz.h"
#include "sim/board/frame.h"

static void expect_again(const sf_frame *frame)
{
  static uint8_t line[SF_FRAME_BYTES];
  sf_frame_reader reader = {.count = 0};
  sf_frame again;
  sf_wrong wrong = SF_WRONG_NOTHING;
  FUZZ_EXPECT(frame->words <= SF_FRAME_WORDS);
  const size_t size = sf_frame_write(frame, line);
  FUZZ_EXPECT(size <= sizeof line);
  int frames = 0;
  for (size_t i = 0; i < size; i++) frames += sf_frame_read(&reader, line[i], &again, &wrong);
  FUZZ_EXPECT(frames == 1 && wrong == SF_WRONG_NOTHING);
  FUZZ_EXPECT(again.number == frame->number && again.command == frame->command && again.words == frame->words);
  FUZZ_EXPECT(!memcmp(again.word, frame->word, frame->words * sizeof *frame->word));
}

/* A frame whose payload are the bytes at hand, and whose header counts them. */
static void send_sound(const uint8_t *data, size_t size)
{
  sf_frame frame = {.words = (uint32_t)(size / 4 < SF_FRAME_WORDS ? size / 4 : SF_FRAME_WORDS)};
  if (size) frame.number = data[0], frame.command = data[size - 1];
  memcpy(frame.word, data, frame.words * sizeof *frame.word);
  expect_again(&frame);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  sf_frame_reader reader = {.count = 0};
  sf_frame frame;
  sf_wrong wrong = SF_WRONG_NOTHING;
  send_sound(data, size);
  for (size_t i = 0; i < size; i++) {
    if (!sf_frame_read(&reader, data[i], &frame, &wrong)) continue;
    FUZZ_EXPECT(wrong < SF_WRONG_GREETING && sf_wrong_text(wrong));
    if (wrong == SF_WRONG_NOTHING) expect_again(&frame);
  }
  return 0;
}
