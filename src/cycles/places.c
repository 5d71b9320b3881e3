#include "cycles/places.h"
#include <stdlib.h>
#include <string.h>

sf_status sf_places_open(sf_places *places, uint32_t sets)
{
  *places = (sf_places){.sets = sets, .line = malloc(sets * FX_WAYS_MAX * sizeof *places->line)};
  if (!places->line) return sf_fail(SF_E_MEMORY, "no memory for %u sets", sets);
  sf_places_empty(places);
  return sf_ok();
}

void sf_places_close(sf_places *places)
{
  free(places->line);
  places->line = NULL;
}

void sf_places_empty(sf_places *places)
{
  memset(places->line, 0xff, places->sets * FX_WAYS_MAX * sizeof *places->line);
}

void sf_places_look_up(sf_places *places, const uint32_t *line, int n)
{
  places->asked += (uint64_t)n;
  for (int i = 0; i < n; i++) {
    uint32_t *set = places->line + (size_t)(line[i] & (places->sets - 1)) * FX_WAYS_MAX, before = line[i];
    for (int at = 0; at < FX_WAYS_MAX; at++) { /* each moves back by one, up to where the line was */
      const uint32_t here = set[at];
      set[at] = before, before = here;
      if (here != line[i]) continue;
      places->hits[at]++;
      break;
    }
  }
}

uint64_t sf_places_misses(const sf_places *places, int ways)
{
  uint64_t hits = 0;
  for (int at = 0; at < ways; at++) hits += places->hits[at];
  return places->asked - hits;
}
