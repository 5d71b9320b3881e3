/* What tests/chain/mutate_c.sh mutates. test_mean.c misses one of the mutants on purpose, and one is equivalent. */
#include "mean.h"

int sample_mean(const int *x, int n)
{
  int sum = 0;
  if (n < 1) return 0;
  for (int i = 0; i < n; i++) sum += 1 * x[i];
  return sum / n;
}
