/* The places in their sets at which look-ups find their lines: misses of every cache of so many sets and any ways. */
#ifndef SF_CYCLES_RANKS_H
#define SF_CYCLES_RANKS_H
#include "fx/cache.h"

typedef struct sf_ranks {
  uint32_t sets;              /* a power of two */
  uint32_t *line;             /* [sets][FX_WAYS_MAX], the last one used first; owned */
  uint64_t asked;             /* look-ups */
  uint64_t hits[FX_WAYS_MAX]; /* by place */
} sf_ranks;

sf_status sf_ranks_open(sf_ranks *ranks, uint32_t sets);
void sf_ranks_close(sf_ranks *ranks);
void sf_ranks_empty(sf_ranks *ranks);
void sf_ranks_look_up(sf_ranks *ranks, const uint32_t *line, int n);
/* LRU keeps in a set what it would keep in fewer ways, in front. */
uint64_t sf_ranks_misses(const sf_ranks *ranks, int ways);
#endif
