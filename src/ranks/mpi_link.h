/* Messages between the processes that a launcher started: MPI, or nothing where the build found none. */
#ifndef SF_RANKS_MPI_LINK_H
#define SF_RANKS_MPI_LINK_H
#include "base/status.h"
#include <stdbool.h>
#include <stddef.h>

typedef struct sf_mpi_link sf_mpi_link;

/* How many processes the launcher says it started, and which of them this is; 1 and 0 without a launcher. */
typedef struct sf_launched {
  int size, rank;
  bool messages; /* the launcher lets them talk to each other */
} sf_launched;
sf_launched sf_mpi_link_launched(void);

sf_status sf_mpi_link_open(sf_mpi_link **link, const sf_launched *launched);
/* Every process has to come here. */
void sf_mpi_link_close(sf_mpi_link *link);
/* Whether a message is there: from this rank, or from = -1 from any. */
bool sf_mpi_link_probe(sf_mpi_link *link, int from, int *rank, int *tag, size_t *size);
void sf_mpi_link_receive(sf_mpi_link *link, int from, int tag, void *data, size_t size);
/* Begins to send; the data stays where it is until sf_mpi_link_sent. One message at a time. */
void sf_mpi_link_send(sf_mpi_link *link, int to, int tag, const void *data, size_t size);
bool sf_mpi_link_sent(sf_mpi_link *link);
#endif
