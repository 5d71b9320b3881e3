/* sf_ray_top on a board. firmware/'s driver programs it over the link. The field lies in the board's memory. */
#ifndef SF_SIM_BOARD_BOARD_H
#define SF_SIM_BOARD_BOARD_H
#include "sim/board/link.h"
#include "sim/ray/request.h"

typedef struct sf_board {
  sf_link link;
  const fx_scene *scene; /* kept */
  const char *path;      /* of the scene, for messages; kept */
  sf_bus bus;
  sf_status trouble;                                            /* of the bus, since the driver was called: the first */
  sf_frame writes;                                              /* not yet sent */
  uint32_t segment;                                             /* of them: the last one's first word */
  uint32_t window_from, window_words, window[SF_LINK_READ_MAX]; /* counters that were read ahead */
  uint32_t polled, polls;                                       /* the last register read, and how often in a row */
  uint32_t refused;                                             /* register of the first refused write, or UINT32_MAX */
} sf_board;

/* Seconds without a byte until a command is sent again. A board that works answers in a hundredth of it. */
#define SF_BOARD_PATIENCE 1.0

/* Greets, probes, fills the memory, programs, starts. The scene must outlive it. SF_E_UNSUPPORTED: another version or
 * other sizes, a scene that does not fit. */
sf_status sf_board_open(sf_board **board, const char *port, double patience, const fx_scene *scene, const char *path);
void sf_board_close(sf_board *board);
/* Programs net, encoder and compositor again, after a soft reset. The memory keeps its contents. */
sf_status sf_board_load(sf_board *board);
/* n rays in, n pixels out. */
sf_status sf_board_run(sf_board *board, const sf_ray_request *request, int n, fx_pixel *pixel);
/* Counters of the nets and of the field since they were cleared. layer_busy[SF_LAYERS]. */
typedef struct sf_board_counters {
  fx_counts counts;
  sf_field_counters field;
  uint64_t cycles, busy, stalls, layer_busy[SF_LAYERS];
} sf_board_counters;
sf_status sf_board_clear(sf_board *board);
sf_status sf_board_read(sf_board *board, sf_board_counters *counters);
fx_cache_shape sf_board_cache(sf_board *board);
#endif
