/* Points of a ray in occupied cells, found in two ways. */
#ifndef SF_TESTS_MARCH_FIXTURE_H
#define SF_TESTS_MARCH_FIXTURE_H
#include "ck_run.h"
#include "render/march.h"
#include <string.h>

/* Every instruction set finds the points of sf_march_next. */
static inline void check_points(const sf_march *march)
{
  static const char *const isa[] = {"portable", "avx2", "avx512", "avx512bf16", "amx"};
  uint64_t expected[SF_STEPS_MAX / 64] = {0}, found[SF_STEPS_MAX / 64];
  float x[3];
  for (int n = 0; (n = sf_march_next(march, n, x)) >= 0; n++) expected[n / 64] |= (uint64_t)1 << n % 64;
  for (size_t i = 0; i < sizeof isa / sizeof *isa; i++) {
    const sf_kernels *k = sf_kernels_select(isa[i]);
    if (!k) continue;
    for (int word = 0; word < SF_STEPS_MAX / 64; word++) found[word] = k->march(march, word);
    ck_assert_msg(!memcmp(found, expected, sizeof found), "%s finds other points", isa[i]);
  }
}
#endif
