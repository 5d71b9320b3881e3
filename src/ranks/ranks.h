/* One program on many processors: alone, over forked processes of its own (--jobs), or as one of N ranks that mpirun or
 * srun started. Numbered units of work are dealt out, and what comes of them depends neither on how many there are nor
 * on who did what: results are handed over by unit, in order. Rank 0 alone takes results, reads and writes checkpoints,
 * and talks; it works on units, too.
 *
 * MPI is looked for at build time (libopenmpi-dev) and loaded where a launcher's environment variables are there: a
 * program that is started by itself never touches it. */
#ifndef SF_RANKS_RANKS_H
#define SF_RANKS_RANKS_H
#include "base/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SF_JOBS_MAX = 256 };

typedef struct sf_ranks sf_ranks;

typedef struct sf_ranks_options {
  bool (*interrupted)(void); /* the program was asked to stop; kept */
  int processes;             /* of a program that is alone: units go to so many forked processes, 0: to itself */
  int argc;                  /* the command line, which has to be that of every rank */
  char **argv;
  double patience; /* seconds that an interrupted rank waits for an answer of another; 0: 3 */
} sf_ranks_options;

/* Every rank has to be the same program with the same command line. SF_E_UNSUPPORTED: started as one of many, but there
 * is no MPI. *ranks is there whether this fails or not, unless it is SF_E_MEMORY. */
sf_status sf_ranks_open(sf_ranks **ranks, const sf_ranks_options *options);
/* Waits for all ranks, unless one of them is lost. */
void sf_ranks_close(sf_ranks *ranks);
int sf_ranks_rank(const sf_ranks *ranks);  /* 0 of a program that is alone; NULL is alone and without processes */
int sf_ranks_size(const sf_ranks *ranks);  /* 1 of a program that is alone */
bool sf_ranks_lost(const sf_ranks *ranks); /* one of them does not answer any more: nothing can be done together */
/* Before sf_ranks_open, by the launcher's word: how many it started, 1 without it. */
int sf_ranks_launched(void);
/* Whether this process is to tell what became of the program: rank 0, or one that it does not answer any more. */
bool sf_ranks_talks(const sf_ranks *ranks);

/* A failure of work on a unit, for rank 0 to tell: of the system of another rank, it names that rank. */
sf_status sf_ranks_named(const sf_ranks *ranks, sf_status status);

/* The functions below are called by every rank, in the same order. */

/* SF_OK where it is that on every rank; else every rank gets the failure of the first that has one, which is named
 * unless it is rank 0. */
sf_status sf_ranks_agree(sf_ranks *ranks, sf_status mine);
/* SF_E_UNSUPPORTED names the first rank whose text is not rank 0's, and `what` it is. At most 64 characters. */
sf_status sf_ranks_same(sf_ranks *ranks, const char *what, const char *text);
/* Rank 0's bytes to all. */
sf_status sf_ranks_broadcast(sf_ranks *ranks, void *data, size_t size);
/* all[size of mine][ranks], by rank, on rank 0; elsewhere all may be NULL. */
sf_status sf_ranks_gather(sf_ranks *ranks, const void *mine, size_t size, void *all);
/* Elements of `size` bytes, of which this rank has filled edge[rank] .. edge[rank + 1] - 1: afterwards every rank has
 * all. edge[ranks + 1], the same everywhere. */
sf_status sf_ranks_share(sf_ranks *ranks, void *data, size_t size, const size_t *edge);
/* Bytes out_edge[i] .. out_edge[i + 1] - 1 of out go to rank i, in_edge[i] .. of in come from it. [ranks + 1] each. */
sf_status sf_ranks_exchange(sf_ranks *ranks, const void *out, const size_t *out_edge, void *in, const size_t *in_edge);
/* Bytes that this rank sent with these two so far. */
uint64_t sf_ranks_sent(const sf_ranks *ranks);

typedef struct sf_deal {
  uint64_t first, end; /* units first .. end - 1; read on rank 0 alone */
  size_t result_size;  /* bytes; without pointers, also to constants: each rank has them elsewhere */
  /* Anywhere: fills *result, which is zeroed. In a thread of its own on ranks, where it may be parallel. May poll
   * sf_ranks_stop and end early. */
  void (*work)(void *user, uint64_t unit, void *result);
  /* On rank 0, in its main thread, by unit in order. False: enough; units behind it are dropped, whatever their state.
   * A sum of real numbers that is made here has one order and so the same bits. */
  bool (*take)(void *user, uint64_t unit, const void *result);
  bool any_order; /* take each result when it comes: for what does not depend on the order, and is kept at once */
  /* On rank 0, in its main thread, several times a second where others work. May be NULL. */
  void (*tick)(void *user);
  void *user;
} sf_deal;

/* SF_E_STOPPED: interrupted; the units begun were told to end early and were taken as they are. A process that is lost
 * is an error that names its unit. A rank that is lost ends the job, which is the launcher's part; until then rank 0
 * takes what is there. */
sf_status sf_ranks_deal(sf_ranks *ranks, const sf_deal *deal);
/* In work: the unit at work is to end early, because the program was interrupted or because there is enough. */
bool sf_ranks_stop(const sf_ranks *ranks);
#endif
