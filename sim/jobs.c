#include "sim/jobs.h"
#include "cli/cli.h"
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

/* AHEAD: units per process that may be finished before their turn; then it waits. */
enum { TICK_MS = 100, AHEAD = 4 };

typedef struct process {
  pid_t pid; /* 0: ended */
  int socket;
  bool busy;
  uint64_t unit;
} process;

typedef struct pool {
  const sf_jobs *jobs;
  process process[SF_JOBS_MAX];
  uint64_t begun, taken; /* next unit to begin, to take */
  uint64_t window;
  char *result; /* [window][result_size], unit u at u % window */
  bool *ready;  /* [window] */
  bool enough, stopping;
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
static void serve(const sf_jobs *jobs, int socket, pid_t parent)
{
  uint64_t unit;
  signal(SIGINT, SIG_IGN);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  void *result = malloc(jobs->result_size);
  if (!result || getppid() != parent) _exit(1);
  while (read_all(socket, &unit, sizeof unit)) {
    memset(result, 0, jobs->result_size);
    jobs->work(jobs->user, unit, result);
    if (!write_all(socket, result, jobs->result_size)) break;
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
    return sf_fail(SF_E_MEMORY, "process %d of %d: %s", index + 1, p->jobs->processes, strerror(errno));
  }
  if (pid == 0) {
    for (int i = 0; i < index; i++) close(p->process[i].socket);
    close(pair[0]);
    serve(p->jobs, pair[1], parent);
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

static sf_status give(pool *p, process *q)
{
  if (q->busy || p->stopping || p->begun == p->jobs->end || p->begun >= p->taken + p->window) return sf_ok();
  q->busy = true;
  q->unit = p->begun++;
  return write_all(q->socket, &q->unit, sizeof q->unit) ? sf_ok() : lost(q);
}

static sf_status receive(pool *p, process *q)
{
  const uint64_t slot = q->unit % p->window;
  if (!q->busy || !read_all(q->socket, p->result + slot * p->jobs->result_size, p->jobs->result_size)) return lost(q);
  q->busy = false;
  p->ready[slot] = true;
  return sf_ok();
}

static void take_in_order(pool *p)
{
  for (; !p->enough && p->taken < p->begun && p->ready[p->taken % p->window]; p->taken++) {
    const uint64_t slot = p->taken % p->window;
    p->ready[slot] = false;
    p->enough = !p->jobs->take(p->jobs->user, p->taken, p->result + slot * p->jobs->result_size);
  }
}

static void ask_to_stop(pool *p)
{
  if (p->stopping || !sf_cli_interrupted()) return;
  p->stopping = true;
  for (int i = 0; i < p->jobs->processes; i++)
    if (p->process[i].pid) kill(p->process[i].pid, SIGTERM);
}

static sf_status turn(pool *p)
{
  struct pollfd wait[SF_JOBS_MAX];
  const int n = p->jobs->processes;
  ask_to_stop(p);
  for (int i = 0; i < n; i++) {
    SF_TRY(give(p, &p->process[i]));
    wait[i] = (struct pollfd){.fd = p->process[i].busy ? p->process[i].socket : -1, .events = POLLIN};
  }
  if (poll(wait, (nfds_t)n, TICK_MS) > 0)
    for (int i = 0; i < n; i++)
      if (wait[i].revents) SF_TRY(receive(p, &p->process[i]));
  take_in_order(p);
  if (p->jobs->tick) p->jobs->tick(p->jobs->user);
  return sf_ok();
}

static bool finished(const pool *p)
{
  return p->enough || (p->taken == p->begun && (p->stopping || p->begun == p->jobs->end));
}

static void end_all(pool *p)
{
  for (int i = 0; i < p->jobs->processes; i++) {
    process *q = &p->process[i];
    if (!q->pid) continue;
    kill(q->pid, SIGKILL);
    waitpid(q->pid, NULL, 0);
    close(q->socket);
  }
}

static sf_status run(pool *p)
{
  for (int i = 0; i < p->jobs->processes; i++) SF_TRY(start(p, i));
  while (!finished(p)) SF_TRY(turn(p));
  return p->stopping && !p->enough ? sf_fail(SF_E_STOPPED, "stopped") : sf_ok();
}

sf_status sf_jobs_run(const sf_jobs *jobs)
{
  pool p = {.jobs = jobs, .begun = jobs->first, .taken = jobs->first, .window = (uint64_t)jobs->processes * AHEAD};
  p.result = calloc(p.window, jobs->result_size);
  p.ready = calloc(p.window, sizeof *p.ready);
  const sf_status status = p.result && p.ready ? run(&p)
                                               : sf_fail(SF_E_MEMORY, "no memory for %d process%s", jobs->processes,
                                                         jobs->processes == 1 ? "" : "es");
  end_all(&p);
  free(p.result);
  free(p.ready);
  return status;
}
