/* Which mutant a run has: none is 0. Called by the netlist when it starts. */
#include <stdlib.h>

int sf_mutant(void);
int sf_mutant(void)
{
  const char *text = getenv("SF_MUTANT");
  return text ? atoi(text) : 0;
}
