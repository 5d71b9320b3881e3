/* Open MPI behind the link, loaded when a launcher started this process. SF_MPI: the name of its library, by the build;
 * without it there is none. */
#include "ranks/mpi_link.h"
#ifdef SF_MPI
#include <dlfcn.h>
#include <mpi.h>
#include <stdlib.h>
#include <string.h>

struct sf_mpi_link {
  __typeof__(&MPI_Init_thread) init;
  __typeof__(&MPI_Comm_rank) rank;
  __typeof__(&MPI_Comm_size) size;
  __typeof__(&MPI_Iprobe) probe;
  __typeof__(&MPI_Get_count) count;
  __typeof__(&MPI_Recv) receive;
  __typeof__(&MPI_Isend) send;
  __typeof__(&MPI_Test) test;
  __typeof__(&MPI_Finalize) finalize;
  MPI_Comm world;
  MPI_Datatype byte;
  MPI_Request sending;
};

typedef struct symbol {
  const char *name;
  void *place; /* a pointer to be filled */
} symbol;

static sf_status load(sf_mpi_link *l)
{
  const symbol symbols[] = {{"MPI_Init_thread", &l->init},  {"MPI_Comm_rank", &l->rank},
                            {"MPI_Comm_size", &l->size},    {"MPI_Iprobe", &l->probe},
                            {"MPI_Get_count", &l->count},   {"MPI_Recv", &l->receive},
                            {"MPI_Isend", &l->send},        {"MPI_Test", &l->test},
                            {"MPI_Finalize", &l->finalize}, {"ompi_mpi_comm_world", &l->world},
                            {"ompi_mpi_byte", &l->byte}};
  void *library = dlopen(SF_MPI, RTLD_NOW | RTLD_GLOBAL); /* global: its own plug-ins look for it */
  if (!library)
    return sf_fail(SF_E_UNSUPPORTED, "started as one of several ranks, but MPI is not there: %s", dlerror());
  for (size_t i = 0; i < sizeof symbols / sizeof *symbols; i++) {
    void *found = dlsym(library, symbols[i].name);
    if (!found)
      return sf_fail(SF_E_UNSUPPORTED, "%s is another MPI than this program was built with: no %s", SF_MPI,
                     symbols[i].name);
    memcpy(symbols[i].place, &found, sizeof found);
  }
  return sf_ok();
}

/* Only the thread that opens the link uses it. Errors of MPI end the job: its default. */
static sf_status begin(sf_mpi_link *l, const sf_launched *launched)
{
  int provided, size, rank;
  SF_TRY(load(l));
  if (l->init(NULL, NULL, MPI_THREAD_FUNNELED, &provided) || provided < MPI_THREAD_FUNNELED)
    return sf_fail(SF_E_UNSUPPORTED, "MPI does not start beside threads");
  l->size(l->world, &size), l->rank(l->world, &rank);
  if (size == launched->size && rank == launched->rank) return sf_ok();
  return sf_fail(SF_E_UNSUPPORTED,
                 "the launcher says rank %d of %d, Open MPI says %d of %d: start with Open MPI's mpirun, or with srun "
                 "--mpi=pmix",
                 launched->rank, launched->size, rank, size);
}

sf_status sf_mpi_link_open(sf_mpi_link **link, const sf_launched *launched)
{
  *link = calloc(1, sizeof **link);
  if (!*link) return sf_fail(SF_E_MEMORY, "out of memory");
  const sf_status status = begin(*link, launched);
  if (status.code == SF_OK) return status;
  free(*link);
  *link = NULL;
  return status;
}

void sf_mpi_link_close(sf_mpi_link *l)
{
  if (l) l->finalize();
  free(l);
}

bool sf_mpi_link_probe(sf_mpi_link *l, int from, int *rank, int *tag, size_t *size)
{
  MPI_Status status;
  int there, bytes;
  l->probe(from < 0 ? MPI_ANY_SOURCE : from, MPI_ANY_TAG, l->world, &there, &status);
  if (!there) return false;
  l->count(&status, l->byte, &bytes);
  *rank = status.MPI_SOURCE, *tag = status.MPI_TAG, *size = (size_t)bytes;
  return true;
}

void sf_mpi_link_receive(sf_mpi_link *l, int from, int tag, void *data, size_t size)
{
  l->receive(data, (int)size, l->byte, from, tag, l->world, MPI_STATUS_IGNORE);
}

void sf_mpi_link_send(sf_mpi_link *l, int to, int tag, const void *data, size_t size)
{
  l->send(data, (int)size, l->byte, to, tag, l->world, &l->sending);
}

bool sf_mpi_link_sent(sf_mpi_link *l)
{
  int done;
  l->test(&l->sending, &done, MPI_STATUS_IGNORE);
  return done;
}

#else

sf_status sf_mpi_link_open(sf_mpi_link **link, const sf_launched *launched)
{
  *link = NULL;
  return sf_fail(
      SF_E_UNSUPPORTED,
      "started as one of %d ranks, but this program was built without MPI: install libopenmpi-dev, build again",
      launched->size);
}

void sf_mpi_link_close(sf_mpi_link *link)
{
  (void)link;
}

bool sf_mpi_link_probe(sf_mpi_link *link, int from, int *rank, int *tag, size_t *size)
{
  (void)link, (void)from, (void)rank, (void)tag, (void)size;
  return false;
}

void sf_mpi_link_receive(sf_mpi_link *link, int from, int tag, void *data, size_t size)
{
  (void)link, (void)from, (void)tag, (void)data, (void)size;
}

void sf_mpi_link_send(sf_mpi_link *link, int to, int tag, const void *data, size_t size)
{
  (void)link, (void)to, (void)tag, (void)data, (void)size;
}

bool sf_mpi_link_sent(sf_mpi_link *link)
{
  (void)link;
  return true;
}
#endif
