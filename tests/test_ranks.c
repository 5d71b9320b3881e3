/* Units of work over processes, and in the program itself: order, early end, lost processes, interruption; no process
 * stays behind. Ranks of mpirun are in tests/chain/ranks.sh. */
#include "ck_run.h"
#include "base/rng.h"
#include "cli/cli.h"
#include "ranks/ranks.h"
#include <errno.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { UNITS = 40, NEVER = 1000 };

typedef struct answer {
  uint64_t unit, value;
  char bulk[20000]; /* more than a socket takes at once */
  bool cut;
} answer;

typedef struct task {
  uint64_t stop_at, die_at, interrupt_at; /* units */
  bool any_order;
  uint64_t next, sum, cut; /* seen by take */
} task;

static uint64_t value_of(uint64_t unit)
{
  return sf_random_u64(3, 0, unit) >> 32;
}

static void nap(uint64_t microseconds)
{
  const struct timespec t = {.tv_nsec = (long)microseconds * 1000};
  nanosleep(&t, NULL);
}

static void work(void *user, uint64_t unit, void *result)
{
  const task *t = user;
  answer *a = result;
  if (unit == t->die_at) raise(SIGKILL);
  nap(sf_random_below(1, 0, unit, 3000)); /* so they finish out of order */
  for (int i = 0; unit >= t->interrupt_at && i < 1000 && !a->cut; i++) nap(5000), a->cut = sf_cli_interrupted();
  a->unit = unit;
  a->value = value_of(unit);
  memset(a->bulk, (int)unit, sizeof a->bulk);
}

static bool take(void *user, uint64_t unit, const void *result)
{
  task *t = user;
  const answer *a = result;
  if (!t->any_order) ck_assert_uint_eq(unit, t->next);
  t->next++;
  ck_assert_uint_eq(a->unit, unit);
  ck_assert_int_eq(a->bulk[sizeof a->bulk - 1], (char)unit);
  t->sum += a->value;
  t->cut += a->cut;
  if (unit + 1 == t->interrupt_at) kill(getpid(), SIGINT);
  return unit != t->stop_at;
}

static sf_status run(task *t, int processes, uint64_t first)
{
  const sf_deal deal = {.first = first,
                        .end = UNITS,
                        .result_size = sizeof(answer),
                        .work = work,
                        .take = take,
                        .any_order = t->any_order,
                        .user = t};
  const sf_ranks_options how = {.interrupted = sf_cli_interrupted, .processes = processes};
  sf_ranks *ranks;
  t->next = first;
  ck_ok(sf_ranks_open(&ranks, &how));
  ck_assert_int_eq(sf_ranks_size(ranks), 1);
  const sf_status status = sf_ranks_deal(ranks, &deal);
  sf_ranks_close(ranks);
  ck_assert_int_eq(waitpid(-1, NULL, WNOHANG), -1); /* no child is left, not even a dead one */
  ck_assert_int_eq(errno, ECHILD);
  return status;
}

static uint64_t sum_of(uint64_t first, uint64_t end)
{
  uint64_t sum = 0;
  for (uint64_t u = first; u < end; u++) sum += value_of(u);
  return sum;
}

TEST(same_for_any_number_of_processes)
{
  static const int processes[] = {0, 1, 2, 3, 7, 50};
  for (int i = 0; i < COUNT(processes); i++) {
    task whole = {.stop_at = NEVER, .die_at = NEVER, .interrupt_at = NEVER}, early = whole;
    early.stop_at = 17;
    ck_ok(run(&whole, processes[i], 5));
    ck_assert_uint_eq(whole.sum, sum_of(5, UNITS));
    ck_ok(run(&early, processes[i], 0));
    ck_assert_uint_eq(early.sum, sum_of(0, 18));
  }
}

/* A slow unit keeps none of those behind it waiting. */
TEST(in_any_order)
{
  for (int processes = 0; processes <= 3; processes++) {
    task t = {.stop_at = NEVER, .die_at = NEVER, .interrupt_at = NEVER, .any_order = true};
    ck_ok(run(&t, processes, 3));
    ck_assert_uint_eq(t.next, UNITS);
    ck_assert_uint_eq(t.sum, sum_of(3, UNITS));
  }
}

/* A rank that is told so by its launcher and cannot be one says it. */
TEST(launchers)
{
  static const struct {
    const char *size, *rank;
  } by[] = {{"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"}, {"SLURM_STEP_NUM_TASKS", "SLURM_PROCID"}};
  const sf_ranks_options how = {.interrupted = sf_cli_interrupted};
  for (int i = 0; i < COUNT(by); i++) {
    ck_assert_int_eq(sf_ranks_launched(), 1);
    setenv(by[i].size, "3", 1), setenv(by[i].rank, "2", 1);
    ck_assert_int_eq(sf_ranks_launched(), 3);
    ck_assert(!sf_ranks_talks(NULL));
    setenv(by[i].rank, "0", 1);
    ck_assert(sf_ranks_talks(NULL));
    setenv(by[i].size, "1", 1);
    ck_assert_int_eq(sf_ranks_launched(), 1);
    unsetenv(by[i].size), unsetenv(by[i].rank);
  }
  sf_ranks *ranks;
  setenv("SLURM_STEP_NUM_TASKS", "3", 1), setenv("SLURM_PROCID", "2", 1), unsetenv("PMIX_RANK");
  ck_bad(sf_ranks_open(&ranks, &how), SF_E_UNSUPPORTED, "3 tasks", "--mpi=pmix");
  sf_ranks_close(ranks);
}

TEST(a_process_dies)
{
  for (int processes = 1; processes <= 3; processes++) {
    task t = {.stop_at = NEVER, .die_at = 11, .interrupt_at = NEVER};
    ck_bad(run(&t, processes, 0), SF_E_IO, "unit 11 was ended by signal 9", "");
  }
}

/* Units begun end early and are taken; none is begun after. */
TEST(interrupted)
{
  sf_cli_catch_signals();
  task t = {.stop_at = NEVER, .die_at = NEVER, .interrupt_at = 9};
  ck_assert_int_eq(run(&t, 3, 0).code, SF_E_STOPPED);
  ck_assert_uint_ge(t.next, 9);
  ck_assert_uint_le(t.next, 9 + 3);
  ck_assert_uint_eq(t.cut, t.next - 9);
  ck_assert_uint_eq(t.sum, sum_of(0, t.next));
}

TEST(interrupted_alone)
{
  sf_cli_catch_signals();
  task t = {.stop_at = NEVER, .die_at = NEVER, .interrupt_at = 9};
  ck_assert_int_eq(run(&t, 0, 0).code, SF_E_STOPPED);
  ck_assert_uint_eq(t.next, 9);
  ck_assert_uint_eq(t.sum, sum_of(0, 9));
}
