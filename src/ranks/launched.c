#include "ranks/mpi_link.h"
#include <stdlib.h>

/* -1: not there, or no number. */
static int number(const char *name)
{
  const char *text = getenv(name);
  char *end;
  if (!text || !*text) return -1;
  const long value = strtol(text, &end, 10);
  return *end || value < 0 || value > 1 << 24 ? -1 : (int)value;
}

/* mpirun of Open MPI; srun, whose tasks talk to each other where it brings PMIx along; another MPI's mpirun, which
 * cannot serve but has to be noticed. A script that srun or mpirun started hands its place on to what it starts.
 */
sf_launched sf_mpi_link_launched(void)
{
  const int ompi = number("OMPI_COMM_WORLD_SIZE"), tasks = number("SLURM_STEP_NUM_TASKS"), pmi = number("PMI_SIZE");
  if (ompi > 0) return (sf_launched){ompi, number("OMPI_COMM_WORLD_RANK"), true};
  if (tasks > 1 && number("SLURM_PROCID") >= 0)
    return (sf_launched){tasks, number("SLURM_PROCID"), getenv("PMIX_RANK") != NULL};
  if (pmi > 1) return (sf_launched){pmi, number("PMI_RANK"), true};
  return (sf_launched){1, 0, false};
}
