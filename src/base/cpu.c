#include "base/cpu.h"
#include <stdlib.h>
#include <string.h>

static const char *const names[] = {"portable", "avx2", "avx512", "avx512bf16", "amx"};
enum { NAMES = sizeof names / sizeof *names };

/* NAMES: nothing is asked for, or something else. */
static int most(const char *text)
{
  int i = 0;
  while (text && i < NAMES && strcmp(text, names[i])) i++;
  return text ? i : NAMES;
}

bool sf_cpu_may(sf_cpu has)
{
  return (int)has <= most(getenv("SPIKEFIELD_CPU"));
}

sf_status sf_cpu_check(void)
{
  const char *text = getenv("SPIKEFIELD_CPU");
  if (!text || most(text) < NAMES) return sf_ok();
  return sf_fail(SF_E_RANGE, "SPIKEFIELD_CPU=%.40s: expected portable, avx2, avx512, avx512bf16 or amx", text);
}
