/* A job of several ranks without a launcher: forked processes that talk through shared memory, in place of MPI. The
 * program that includes it has the link; the library's own stays out of it. One test, which forks before anything is
 * parallel: OpenMP does not survive a fork. */
#ifndef SF_TESTS_RANKS_FIXTURE_H
#define SF_TESTS_RANKS_FIXTURE_H
#include "ck_run.h"
#include "ranks/mpi_link.h"
#include "ranks/ranks.h"
#include <signal.h>
#include <stdatomic.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

enum { JOB = 3, MESSAGE_MAX = 8 << 20 };

/* A message on its way from one rank to another. */
typedef struct letter {
  atomic_int full;
  int tag;
  size_t size;
  char data[MESSAGE_MAX];
} letter;

struct sf_mpi_link {
  int rank;
  letter (*post)[JOB]; /* [from][to], shared */
  int to, tag;         /* what is to be sent */
  const void *data;
  size_t size;
  bool waiting;
};

static struct sf_mpi_link job_link;
static pid_t job_child[JOB];

static inline void job_lost(int rank)
{
  int status = 0;
  if (job_link.rank == 0 && rank > 0 && waitpid(job_child[rank], &status, WNOHANG) == job_child[rank]) {
    job_child[rank] = 0;
    ck_assert_msg(WIFEXITED(status) && !WEXITSTATUS(status), "rank %d has failed: %d", rank, status);
  }
}

sf_status sf_mpi_link_open(sf_mpi_link **link, const sf_launched *launched)
{
  ck_assert(launched->messages && launched->size == JOB && launched->rank == job_link.rank);
  *link = &job_link;
  return sf_ok();
}

void sf_mpi_link_close(sf_mpi_link *link)
{
  (void)link;
}

bool sf_mpi_link_probe(sf_mpi_link *link, int from, int *rank, int *tag, size_t *size)
{
  for (int r = 0; r < JOB; r++) {
    letter *l = &link->post[r][link->rank];
    if (r == link->rank || (from >= 0 && r != from)) continue;
    if (!atomic_load(&l->full)) {
      if (job_child[r]) job_lost(r);
      continue;
    }
    *rank = r, *tag = l->tag, *size = l->size;
    return true;
  }
  return false;
}

void sf_mpi_link_receive(sf_mpi_link *link, int from, int tag, void *data, size_t size)
{
  letter *l = &link->post[from][link->rank];
  while (!atomic_load(&l->full)) usleep(20);
  ck_assert(l->tag == tag && l->size == size);
  if (size) memcpy(data, l->data, size);
  atomic_store(&l->full, 0);
}

bool sf_mpi_link_sent(sf_mpi_link *link)
{
  letter *l = &link->post[link->rank][link->to];
  if (!link->waiting) return true;
  if (atomic_load(&l->full)) return false;
  l->tag = link->tag, l->size = link->size;
  if (link->size) memcpy(l->data, link->data, link->size);
  atomic_store(&l->full, 1);
  link->waiting = false;
  return true;
}

void sf_mpi_link_send(sf_mpi_link *link, int to, int tag, const void *data, size_t size)
{
  ck_assert(size <= MESSAGE_MAX && !link->waiting);
  link->to = to, link->tag = tag, link->data = data, link->size = size, link->waiting = true;
  sf_mpi_link_sent(link);
}

static inline bool never_interrupted(void)
{
  return false;
}

/* Runs `part` on every rank of a job. */
static inline void job_run(bool (*part)(sf_ranks *ranks))
{
  char number[16];
  const pid_t parent = getpid();
  sf_ranks *ranks;
  job_link = (struct sf_mpi_link){.post = mmap(NULL, sizeof(letter[JOB][JOB]), PROT_READ | PROT_WRITE,
                                               MAP_SHARED | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0)};
  ck_assert_ptr_ne(job_link.post, MAP_FAILED);
  fflush(NULL);
  for (int r = 1; r < JOB && !job_link.rank; r++) {
    job_child[r] = fork();
    ck_assert_int_ge(job_child[r], 0);
    if (job_child[r]) continue;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(3);
    job_link.rank = r;
    memset(job_child, 0, sizeof job_child);
  }
  snprintf(number, sizeof number, "%d", JOB);
  setenv("OMPI_COMM_WORLD_SIZE", number, 1);
  snprintf(number, sizeof number, "%d", job_link.rank);
  setenv("OMPI_COMM_WORLD_RANK", number, 1);
  char *argv[] = {"program", NULL};
  const sf_status opened =
      sf_ranks_open(&ranks, &(sf_ranks_options){.interrupted = never_interrupted, .argc = 1, .argv = argv});
  const bool good = opened.code == SF_OK && part(ranks);
  sf_ranks_close(ranks);
  if (job_link.rank) _exit(good ? 0 : 4);
  ck_assert_msg(good, "rank 0: %s", opened.message);
  for (int r = 1; r < JOB; r++) {
    int status = 0;
    if (!job_child[r]) continue;
    ck_assert_int_eq(waitpid(job_child[r], &status, 0), job_child[r]);
    ck_assert_msg(WIFEXITED(status) && !WEXITSTATUS(status), "rank %d has failed: %d", r, status);
  }
}
#endif
