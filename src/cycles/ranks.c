#include "cycles/ranks.h"
#include <stdlib.h>
#include <string.h>

sf_status sf_ranks_open(sf_ranks *ranks, uint32_t sets)
{
  *ranks = (sf_ranks){.sets = sets, .line = malloc(sets * FX_WAYS_MAX * sizeof *ranks->line)};
  if (!ranks->line) return sf_fail(SF_E_MEMORY, "no memory for %u sets", sets);
  sf_ranks_empty(ranks);
  return sf_ok();
}

void sf_ranks_close(sf_ranks *ranks)
{
  free(ranks->line);
  ranks->line = NULL;
}

void sf_ranks_empty(sf_ranks *ranks)
{
  memset(ranks->line, 0xff, ranks->sets * FX_WAYS_MAX * sizeof *ranks->line);
}

void sf_ranks_look_up(sf_ranks *ranks, const uint32_t *line, int n)
{
  ranks->asked += (uint64_t)n;
  for (int i = 0; i < n; i++) {
    uint32_t *set = ranks->line + (size_t)(line[i] & (ranks->sets - 1)) * FX_WAYS_MAX, before = line[i];
    for (int at = 0; at < FX_WAYS_MAX; at++) { /* each moves back by one, up to where the line was */
      const uint32_t here = set[at];
      set[at] = before, before = here;
      if (here != line[i]) continue;
      ranks->hits[at]++;
      break;
    }
  }
}

uint64_t sf_ranks_misses(const sf_ranks *ranks, int ways)
{
  uint64_t hits = 0;
  for (int at = 0; at < ways; at++) hits += ranks->hits[at];
  return ranks->asked - hits;
}
