/* When the lines of planes are read: rtl/sf_planes_reads.sv, rtl/sf_cache.sv and rtl/sf_fetch.sv, two lines at most at
 * a time, each as the clock cycle of an event. Inside src/cycles. */
#ifndef SF_CYCLES_LINES_H
#define SF_CYCLES_LINES_H
#include "fx/cache.h"

enum { LINES_RING = 128, PIPE_MAX = 8 };

/* Stages that move together, and stand while the last one cannot leave. */
typedef struct pipe {
  unsigned stages, count;
  uint64_t came[PIPE_MAX], left[PIPE_MAX]; /* of the last stage, by number % PIPE_MAX */
} pipe;

typedef struct lines {
  fx_cache cache;
  uint64_t latency;
  uint32_t line[LINES_RING][2]; /* these four by number % LINES_RING */
  uint64_t taken[LINES_RING], queued[LINES_RING], came[LINES_RING];
  uint64_t count, misses;
  uint64_t pop[LINES_RING]; /* of lines from the memory */
  pipe reads, tags;
  uint64_t issued, pair_left, tag_entered, head, head_left, asked, second_beat[2];
  bool blank; /* nothing was looked up since the cache was emptied */
} lines;

sf_status lines_open(lines *l, const fx_cache_shape *shape, int latency);
void lines_close(lines *l);
/* The next two lines, one of even and one of odd number, or one line twice; ready to be asked for at `ready`. empty:
 * the cache is emptied before them. Returns when their entries come; l->issued says when they were asked for. */
uint64_t lines_next(lines *l, const uint32_t line[2], uint64_t ready, bool empty);
#endif
