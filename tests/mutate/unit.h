/* The unit that -DUNIT=NAME -DUNIT_NAME chooses, and random numbers. */
#ifndef SF_TESTS_MUTATE_UNIT_H
#define SF_TESTS_MUTATE_UNIT_H
extern "C" {
#include "base/rng.h"
}
#include <cstdint>
#include <cstdio>
#define HEADER_OF(name) HEADER_TEXT(V##name.h)
#define HEADER_TEXT(text) #text
#define HEADER(name) HEADER_OF(name)
#define MODEL_OF(name) V##name
#define MODEL(name) MODEL_OF(name)
#include HEADER(UNIT)

static MODEL(UNIT) top;
static uint64_t drawn;

static int64_t draw(int64_t low, int64_t high)
{
  return low + (int64_t)sf_random_below(1, 0, drawn++, (uint64_t)(high - low + 1));
}
#endif
