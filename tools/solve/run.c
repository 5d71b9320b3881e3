/* Programs that are run: their logs, their progress, how they end. */
#include "base/io.h"
#include "tools/solve/solve.h"
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { TAIL = 8192 };

/* The last bytes of the log; "" where nothing is there yet. */
static void read_tail(const char *log, char tail[TAIL + 1])
{
  *tail = 0;
  FILE *file = fopen(log, "r");
  if (!file) return;
  if (!fseek(file, 0, SEEK_END)) {
    const long size = ftell(file);
    if (!fseek(file, size > TAIL ? size - TAIL : 0, SEEK_SET)) tail[fread(tail, 1, TAIL, file)] = 0;
  }
  fclose(file);
}

static void watch_log(sf_progress *progress, const char *log, const solve_watch *watch)
{
  char tail[TAIL + 1];
  const char *last = NULL;
  if (!watch || !sf_progress_due(progress)) return;
  read_tail(log, tail);
  for (const char *at = tail; (at = strstr(at, watch->key)); at += strlen(watch->key)) last = at + strlen(watch->key);
  if (last) watch->show(progress, last, watch->total);
}

/* The last line that says something, of a log that a program left. */
static void last_line(const char *log, char line[160])
{
  char tail[TAIL + 1];
  read_tail(log, tail);
  for (size_t size = strlen(tail); size && strchr("\r\n ", tail[size - 1]);) tail[--size] = 0;
  const char *start = strrchr(tail, '\n');
  snprintf(line, 160, "%s", start ? start + 1 : tail);
}

/* Where the shell would find it. */
static bool in_path(const char *program)
{
  const char *path = getenv("PATH");
  for (const char *at = path ? path : "/usr/bin:/bin"; *at;) {
    char file[4096];
    const size_t n = strcspn(at, ":");
    if (snprintf(file, sizeof file, "%.*s/%s", (int)n, at, program) < (int)sizeof file && !access(file, X_OK))
      return true;
    at += n + (at[n] == ':');
  }
  return false;
}

sf_status solve_installed(const char *program, const char *package)
{
  if (in_path(program)) return sf_ok();
  return sf_fail(SF_E_IO, "%s is not installed: apt-get install %s", program, package);
}

static void become(const char *const *argv, const char *log)
{
  const int out = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0666), in = open("/dev/null", O_RDONLY);
  if (out < 0 || in < 0 || dup2(in, 0) < 0 || dup2(out, 1) < 0 || dup2(out, 2) < 0) _exit(126);
  setenv("QT_QPA_PLATFORM", "offscreen", 1); /* COLMAP opens a display otherwise */
  execvp(argv[0], (char *const *)(uintptr_t)argv);
  _exit(126);
}

sf_status solve_run(solve_job *job, const char *const *argv, const char *log, const char *package,
                    const solve_watch *watch)
{
  int result = 0;
  bool told = false;
  SF_TRY(solve_installed(argv[0], package));
  if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "interrupted");
  const pid_t child = fork();
  if (child < 0) return sf_fail(SF_E_IO, "cannot start %s: %s", argv[0], strerror(errno));
  if (!child) become(argv, log);
  for (pid_t ended = 0; ended != child;) {
    ended = waitpid(child, &result, WNOHANG);
    if (ended < 0 && errno != EINTR) return sf_fail(SF_E_IO, "cannot wait for %s: %s", argv[0], strerror(errno));
    if (ended == child) break;
    if (sf_cli_interrupted() && !told) told = true, kill(child, SIGTERM);
    watch_log(&job->progress, log, watch);
    usleep(20000);
  }
  if (sf_cli_interrupted()) return sf_fail(SF_E_STOPPED, "interrupted");
  if (WIFEXITED(result) && !WEXITSTATUS(result)) return sf_ok();
  char line[160];
  last_line(log, line);
  return sf_fail(SF_E_IO, "%s failed: %s (its log is %s)", argv[0], *line ? line : "no word", log);
}
