#ifndef SF_RANKS_INTERNAL_H
#define SF_RANKS_INTERNAL_H
#include "ranks/mpi_link.h"
#include "ranks/ranks.h"
#include <stdatomic.h>

enum { SF_TAG_DATA = 1, SF_TAG_UNIT, SF_TAG_STOP, SF_TAG_DISMISS, SF_TAG_RESULT, SF_TAG_BYE };

struct sf_ranks {
  sf_ranks_options options;
  int rank, size;
  sf_mpi_link *link; /* NULL: alone */
  char (*host)[64];  /* [size] on rank 0 */
  atomic_bool enough;
  uint64_t sent; /* bytes, by sf_ranks_share and sf_ranks_exchange */
  bool broken;   /* a rank does not answer: nothing can be done together any more */
  bool deserted; /* it is rank 0 that does not answer */
};

/* Those who work on units: forked processes, or the ranks of a job. */
typedef struct sf_crew sf_crew;
struct sf_crew {
  int count;
  double patience;                                      /* seconds for units that were told to end; 0: no limit */
  sf_status (*give)(sf_crew *, int who, uint64_t unit); /* who: 0 .. count - 1, not at work */
  int (*wait)(sf_crew *, int ms);                       /* somebody whose result is there, or who is lost; or -1 */
  sf_status (*read)(sf_crew *, int who, void *result);  /* of whom wait named */
  void (*stop)(sf_crew *);                              /* all end their units early */
  void (*name)(sf_crew *, int who, char *text, size_t size);
  sf_status (*end)(sf_crew *, const sf_status *status); /* none of them works any more; frees it */
};
sf_status sf_crew_fork(sf_crew **crew, const sf_deal *deal, int processes);
sf_status sf_crew_ranks(sf_crew **crew, const sf_deal *deal, sf_ranks *ranks);
/* The other side of sf_crew_ranks: works on units until rank 0 says what became of the deal. */
sf_status sf_ranks_serve(sf_ranks *ranks, const sf_deal *deal);

/* A thread that works on one unit at a time. */
typedef struct sf_hand sf_hand;
sf_status sf_hand_open(sf_hand **hand, const sf_deal *deal);
void sf_hand_give(sf_hand *hand, uint64_t unit);
bool sf_hand_done(sf_hand *hand); /* the result is there */
const void *sf_hand_take(sf_hand *hand);
void sf_hand_close(sf_hand *hand); /* when it is at work, after that */

/* A message of one rank. SF_E_STOPPED when the program was interrupted and none comes. */
sf_status sf_ranks_wait(sf_ranks *ranks, int from, int *tag, size_t *size);
sf_status sf_ranks_receive(sf_ranks *ranks, int from, int tag, void *data, size_t size);
sf_status sf_ranks_send(sf_ranks *ranks, int to, int tag, const void *data, size_t size);
/* "rank 3 on node7" */
void sf_ranks_name(const sf_ranks *ranks, int rank, char *text, size_t size);
void sf_ranks_nap(void);
/* A wait for another rank: where it is and when the program was interrupted in it; begins as zeros. */
typedef struct sf_pause {
  int times;
  double since;
} sf_pause;
/* One rest of it, short at first: answers in the middle of a computation come soon. SF_E_STOPPED: as sf_ranks_wait. */
sf_status sf_ranks_pause(sf_ranks *ranks, int rank, sf_pause *pause);
#endif
