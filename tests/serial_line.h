/* A serial line at the pins of a Verilated module: bytes to bits and back, cycle by cycle, and what may happen to bytes
 * on the way. C++. */
#ifndef SF_TESTS_SERIAL_LINE_H
#define SF_TESTS_SERIAL_LINE_H
#include "tests/rtl_unit.h"
#include <deque>

/* Ten bits of `cycles` each, start bit first. */
struct serial_sender {
  double cycles;
  std::deque<uint8_t> waiting;
  int bit = 10;
  uint32_t bits = 0x3ff;
  double left = 0;
  explicit serial_sender(double c) : cycles(c) {}
  bool idle() const { return bit >= 10 && waiting.empty(); }
  bool level()
  {
    if (bit < 10 && (left -= 1) <= 0) bit++, left += cycles;
    if (bit >= 10 && !waiting.empty()) {
      bits = 0x200 | (uint32_t)waiting.front() << 1;
      waiting.pop_front();
      bit = 0, left = cycles;
    }
    return bit >= 10 || (bits >> bit & 1);
  }
};

struct serial_receiver {
  double cycles;
  int bit = -1;
  uint32_t bits = 0;
  double left = 0;
  explicit serial_receiver(double c) : cycles(c) {}
  bool idle() const { return bit < 0; }
  /* A byte, or -1; -2: without its stop bit. */
  int take(bool level)
  {
    if (bit < 0) {
      if (!level) bit = 0, bits = 0, left = cycles / 2;
      return -1;
    }
    if ((left -= 1) > 0) return -1;
    left += cycles;
    bits |= (uint32_t)level << bit;
    if (++bit < 10) return -1;
    bit = -1;
    return bits >> 9 & 1 ? (int)(bits >> 1 & 0xff) : -2;
  }
};

/* Of a thousand bytes, how many are lost, doubled, changed, or have a byte that nobody sent before them. */
struct byte_noise {
  random_draw draw;
  int per_100000 = 0;
  uint64_t done[4] = {0, 0, 0, 0};
  explicit byte_noise(uint64_t seed) : draw(seed) {}
  void pass(uint8_t byte, std::deque<uint8_t> &to)
  {
    const bool hit = per_100000 > 0 && draw(0, 99999) < per_100000;
    const int kind = hit ? (int)draw(0, 3) : -1;
    if (hit) done[kind]++;
    if (kind == 2) byte ^= (uint8_t)draw(1, 255);
    if (kind == 3) to.push_back(draw.percent(30) ? 0xc0 : (uint8_t)draw(0, 255));
    if (kind != 0) to.push_back(byte);
    if (kind == 1) to.push_back(byte);
  }
};
#endif
