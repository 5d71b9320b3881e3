/* Time against energy of a frame over builds of the accelerator, from one recorded run. */
#ifndef SF_CYCLES_EXPLORE_H
#define SF_CYCLES_EXPLORE_H
#include "cycles/cycles.h"
#include "energy/energy.h"

typedef struct sf_build {
  sf_engine engine;
  fx_cache_shape cache;
} sf_build;

/* What a frame waits for. Engine, cache and memory work at the same time: the slowest of them is the time of a frame.
 */
typedef enum { SF_BOUND_ENGINE, SF_BOUND_LOOKUPS, SF_BOUND_LINES, SF_BOUNDS } sf_bound;
extern const char *const sf_bound_names[SF_BOUNDS]; /* "engine", "look-ups", "lines" */

typedef struct sf_explored {
  sf_build build;
  double bound[SF_BOUNDS]; /* cycles of a frame: of the cycle model; a pair of corners (TensoRF: a line) a cycle; two
                              cycles for the words of a line that missed */
  double cycles;           /* the largest */
  double energy_mj;        /* of a frame, the ledger with everything */
  double misses;           /* per look-up */
  bool front;              /* no other is faster and needs no more energy, or needs less and is no slower */
} sf_explored;

enum { SF_EXPLORED_MAX = 2048 };
typedef struct sf_explore {
  uint64_t rays, samples; /* recorded, whole tiles */
  uint64_t modelled;      /* of these samples through the cycle model */
  double share;           /* of the frame's rays that were recorded */
  int count, built, board,
      fewest; /* points; those of this build, of the board's; the front's one with the least energy */
  sf_explored point[SF_EXPLORED_MAX];
} sf_explore;

typedef struct sf_explore_job {
  const fx_scene *scene;
  const sf_dataset *data;
  const sf_view *view;
  const sf_technology *technology;
  uint64_t ray_limit, model_limit; /* about so many rays, samples through the model, at most; 0: the defaults */
  bool (*tick)(void *user, const char *what, int done, int total); /* from one thread at a time; false stops; or NULL */
  void *user;
} sf_explore_job;

/* Records tiles spread over the view: their counts, the look-ups of all caches at once, and samples for the cycle model
 * of all engines. Does not depend on the threads. *explore is the caller's to free(). */
sf_status sf_explore_run(const sf_explore_job *job, sf_explore **explore);

/* The front, this build and the board's. */
void sf_explore_print(FILE *out, const sf_explore *explore, double clock_mhz);
/* Every point. */
cJSON *sf_explore_json(const sf_explore *explore, double clock_mhz);
#endif
