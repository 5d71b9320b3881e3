/* Rays through the core and through a board, many at a time, because waiting for answers of a serial line is slow.
 * Every pixel and the sums of all counters are compared. At a difference the rays are sent again, one by one, then
 * sample by sample. */
#ifndef SF_SIM_BOARD_BATCH_H
#define SF_SIM_BOARD_BATCH_H
#include "energy/energy.h"
#include "sim/board/board.h"
#include "sim/cosim.h"

enum { SF_BATCH_RAYS = 256 };

typedef struct sf_batch_ray {
  fx_ray ray;
  fx_pixel core, board;
  fx_counts counts;       /* the core's, of this ray */
  fx_memory_counts field; /* of the run up to this ray, with it */
  size_t first;           /* of its samples */
  int n;
  bool stops, new_tile;
} sf_batch_ray;

typedef struct sf_batch {
  sf_board *board;
  sf_observer core;
  fx_memory memory;
  sf_memory_recount lines;
  sf_batch_ray *ray; /* [SF_BATCH_RAYS] */
  int count;
  sf_ray_sample *sample;
  size_t samples, room;
  uint64_t tile;
  bool in_tile;
  fx_memory_counts before; /* of the field, when this batch began */
  sf_board_counters sum;   /* the board's, of this batch */
  sf_cosim_place place;    /* of a difference: `ray` is its place in the batch */
} sf_batch;

/* Close it whether this fails or not. */
sf_status sf_batch_open(sf_batch *batch, sf_board *board);
void sf_batch_close(sf_batch *batch);
/* The core's pixel of a ray is there at once, the board's after sf_batch_run. There is room for SF_BATCH_RAYS. */
sf_status sf_batch_add(sf_batch *batch, const fx_ray *ray, uint64_t tile);
/* SF_E_DIFFERENCE: `place` says where, the message what. */
sf_status sf_batch_run(sf_batch *batch);
/* The next batch: `ray` and `sum` are of this one until then. */
void sf_batch_begin(sf_batch *batch);
#endif
