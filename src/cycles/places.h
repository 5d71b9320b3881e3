/* The places in their sets at which look-ups find their lines: misses of every cache of so many sets and any ways. */
#ifndef SF_CYCLES_PLACES_H
#define SF_CYCLES_PLACES_H
#include "fx/cache.h"

typedef struct sf_places {
  uint32_t sets;              /* a power of two */
  uint32_t *line;             /* [sets][FX_WAYS_MAX], the last one used first; owned */
  uint64_t asked;             /* look-ups */
  uint64_t hits[FX_WAYS_MAX]; /* by place */
} sf_places;

sf_status sf_places_open(sf_places *places, uint32_t sets);
void sf_places_close(sf_places *places);
void sf_places_empty(sf_places *places);
void sf_places_look_up(sf_places *places, const uint32_t *line, int n);
/* LRU keeps in a set what it would keep in fewer ways, in front. */
uint64_t sf_places_misses(const sf_places *places, int ways);
#endif
