/* For the unit benches of the RTL: one Verilated module with random reset values, its clock, random stalls. C++. */
#ifndef SF_TESTS_RTL_UNIT_H
#define SF_TESTS_RTL_UNIT_H
extern "C" {
#include "ck_run.h"
#include "base/rng.h"
#include "src/fx/unit.h"
}
#include "verilated.h"
#include <cstdlib>

struct random_draw {
  uint64_t seed, next = 0;
  explicit random_draw(uint64_t s) : seed(s) {}
  int64_t operator()(int64_t low, int64_t high)
  {
    return low + (int64_t)sf_random_below(seed, 0, next++, (uint64_t)(high - low + 1));
  }
  bool percent(int p) { return (*this)(0, 99) < p; }
};

/* A sink that stalls in `percent` of the cycles and, if at all, now and then for long enough to fill every queue. */
struct sink_stalls {
  int percent = 0;
  uint64_t until = 0;
  bool operator()(random_draw &draw, uint64_t cycle)
  {
    if (cycle < until) return true;
    if (percent > 0 && draw(0, 1999) == 0) until = cycle + (uint64_t)draw(1, 600);
    return draw.percent(percent);
  }
};

/* A cycle: set inputs, settle(), look at outputs, edge(). */
template <class module> struct unit {
  VerilatedContext context;
  module top;
  uint64_t cycle = 0;
  explicit unit(uint64_t seed) : top(prepare(context, seed)) {}
  ~unit()
  {
    Verilated::threadContextp(&context); /* where the module's scopes are, if it has any */
    top.final();
  }
  void settle() { top.eval(); }
  void edge()
  {
    top.clk_i = 1, top.eval();
    top.clk_i = 0, top.eval();
    cycle++;
  }
  void reset()
  {
    top.clk_i = 0, top.clear_i = 0, top.rst_ni = 0, top.eval();
    edge();
    top.rst_ni = 1;
  }

private:
  static VerilatedContext *prepare(VerilatedContext &context, uint64_t seed)
  {
    context.randReset(2);
    context.randSeed((int)(seed % 0x7fffffff) + 1); /* 0 would mean the time of day */
    return &context;
  }
};

/* Benches take seconds; SF_UNIT_LONG=N makes them N times as long. */
static inline int unit_length()
{
  const char *text = getenv("SF_UNIT_LONG");
  const int n = text ? atoi(text) : 1;
  return n > 0 ? n : 1;
}
#endif
