/* Forked processes as workers: --jobs, without a launcher and with or without MPI. */
#include "ranks/internal.h"
#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

typedef struct process {
  pid_t pid; /* 0: ended */
  int socket;
  bool busy;
  uint64_t unit;
} process;

typedef struct pool {
  sf_crew crew; /* first: the crew is the pool */
  const sf_deal *deal;
  process process[SF_JOBS_MAX];
} pool;

static bool read_all(int socket, void *data, size_t size)
{
  for (size_t done = 0; done < size;) {
    const ssize_t n = read(socket, (char *)data + done, size - done);
    if (n <= 0 && !(n < 0 && errno == EINTR)) return false;
    done += n > 0 ? (size_t)n : 0;
  }
  return true;
}

/* Without SIGPIPE: the other side may have been killed. */
static bool write_all(int socket, const void *data, size_t size)
{
  for (size_t done = 0; done < size;) {
    const ssize_t n = send(socket, (const char *)data + done, size - done, MSG_NOSIGNAL);
    if (n <= 0 && !(n < 0 && errno == EINTR)) return false;
    done += n > 0 ? (size_t)n : 0;
  }
  return true;
}

/* ---- a process ---- */

/* The terminal's interrupt reaches every process of its group, but the parent alone decides: it sends SIGTERM. */
static void serve(const sf_deal *deal, int socket, pid_t parent)
{
  uint64_t unit;
  signal(SIGINT, SIG_IGN);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  void *result = malloc(deal->result_size);
  if (!result || getppid() != parent) _exit(1);
  while (read_all(socket, &unit, sizeof unit)) {
    memset(result, 0, deal->result_size);
    deal->work(deal->user, unit, result);
    if (!write_all(socket, result, deal->result_size)) break;
  }
  _exit(0);
}

static sf_status start(pool *p, int index)
{
  int pair[2];
  const pid_t parent = getpid();
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair))
    return sf_fail(SF_E_IO, "no connection to a process: %s", strerror(errno));
  fflush(NULL); /* or both processes would write what is still buffered */
  const pid_t pid = fork();
  if (pid < 0) {
    close(pair[0]), close(pair[1]);
    return sf_fail(SF_E_MEMORY, "process %d of %d: %s", index + 1, p->crew.count, strerror(errno));
  }
  if (pid == 0) {
    for (int i = 0; i < index; i++) close(p->process[i].socket);
    close(pair[0]);
    serve(p->deal, pair[1], parent);
  }
  close(pair[1]);
  p->process[index] = (process){.pid = pid, .socket = pair[0]};
  return sf_ok();
}

/* ---- the parent ---- */

static sf_status lost(process *q)
{
  int state = 0;
  waitpid(q->pid, &state, 0);
  q->pid = 0;
  close(q->socket);
  if (WIFSIGNALED(state))
    return sf_fail(SF_E_IO, "the process at work on unit %" PRIu64 " was ended by signal %d", q->unit, WTERMSIG(state));
  return sf_fail(SF_E_IO, "the process at work on unit %" PRIu64 " ended with status %d", q->unit, WEXITSTATUS(state));
}

static sf_status give(sf_crew *crew, int who, uint64_t unit)
{
  process *q = &((pool *)crew)->process[who];
  q->busy = true;
  q->unit = unit;
  return write_all(q->socket, &q->unit, sizeof q->unit) ? sf_ok() : lost(q);
}

static int wait_for(sf_crew *crew, int ms)
{
  pool *p = (pool *)crew;
  struct pollfd wait[SF_JOBS_MAX];
  for (int i = 0; i < crew->count; i++)
    wait[i] = (struct pollfd){.fd = p->process[i].busy ? p->process[i].socket : -1, .events = POLLIN};
  if (poll(wait, (nfds_t)crew->count, ms) <= 0) return -1;
  for (int i = 0; i < crew->count; i++)
    if (wait[i].revents) return i;
  return -1;
}

static sf_status read_result(sf_crew *crew, int who, void *result)
{
  pool *p = (pool *)crew;
  process *q = &p->process[who];
  if (!read_all(q->socket, result, p->deal->result_size)) return lost(q);
  q->busy = false;
  return sf_ok();
}

static void stop(sf_crew *crew)
{
  pool *p = (pool *)crew;
  for (int i = 0; i < crew->count; i++)
    if (p->process[i].pid) kill(p->process[i].pid, SIGTERM);
}

static void name(sf_crew *crew, int who, char *text, size_t size)
{
  snprintf(text, size, "process %ld", (long)((pool *)crew)->process[who].pid);
}

static sf_status end(sf_crew *crew, const sf_status *status)
{
  const sf_status kept = *status;
  pool *p = (pool *)crew;
  for (int i = 0; i < crew->count; i++) {
    process *q = &p->process[i];
    if (!q->pid) continue;
    kill(q->pid, SIGKILL);
    waitpid(q->pid, NULL, 0);
    close(q->socket);
  }
  free(p);
  return kept;
}

/* Whatever happens to this process ends the others, too. */
sf_status sf_crew_fork(sf_crew **crew, const sf_deal *deal, int processes)
{
  pool *p = calloc(1, sizeof *p);
  if (!p) return sf_fail(SF_E_MEMORY, "no memory for %d processes", processes);
  p->crew = (sf_crew){processes, 0, give, wait_for, read_result, stop, name, end};
  p->deal = deal;
  *crew = &p->crew;
  for (int i = 0; i < processes; i++) {
    const sf_status status = start(p, i);
    if (status.code != SF_OK) return end(&p->crew, &status);
  }
  return sf_ok();
}
