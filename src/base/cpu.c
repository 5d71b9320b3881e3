#include "base/cpu.h"
#include <stdlib.h>
#include <string.h>

bool sf_cpu_may(sf_cpu has)
{
  static const char *const names[] = {"portable", "avx2", "avx512", "avx512bf16", "amx"};
  const char *most = getenv("SPIKEFIELD_CPU");
  for (int i = 0; most && i < (int)(sizeof names / sizeof *names); i++)
    if (!strcmp(most, names[i])) return (int)has <= i;
  return true;
}
