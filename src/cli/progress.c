/* Progress on stderr, and the stop flag. */
#include "cli/cli.h"
#include "base/clock.h"
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

/* The one piece of global state: a signal handler can reach nothing else. */
static volatile sig_atomic_t stop_requested;

static void request_stop(int signal)
{
  (void)signal;
  stop_requested = 1;
}

void sf_cli_catch_signals(void)
{
  struct sigaction action;
  memset(&action, 0, sizeof action);
  action.sa_handler = request_stop;
  action.sa_flags = (int)SA_RESETHAND | SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
}

bool sf_cli_interrupted(void)
{
  return stop_requested != 0;
}

void sf_progress_begin(sf_progress *progress, bool quiet)
{
  progress->terminal = isatty(STDERR_FILENO) == 1;
  progress->quiet = quiet;
  progress->width = 0;
  /* A terminal sees the first line at once; a log of a short run stays empty. */
  progress->last = sf_seconds() - (progress->terminal ? 10 : 0);
}

bool sf_progress_due(const sf_progress *progress)
{
  return !progress->quiet && sf_seconds() - progress->last >= (progress->terminal ? 0.1 : 5);
}

static int terminal_columns(void)
{
  struct winsize size;
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 ? size.ws_col : 80;
}

void sf_progress_show(sf_progress *progress, const char *format, ...)
{
  if (progress->quiet || (!progress->terminal && !sf_progress_due(progress))) return;
  char line[512];
  va_list args;
  va_start(args, format);
  vsnprintf(line, sizeof line, format, args);
  va_end(args);
  progress->last = sf_seconds();
  if (progress->terminal) {
    /* A line that wraps cannot be overwritten. */
    int columns = terminal_columns() - 1, n = (int)strlen(line);
    if (n > columns) line[n = columns] = 0;
    fprintf(stderr, "\r%s%*s", line, progress->width > n ? progress->width - n : 0, "");
    progress->width = n;
  } else {
    fprintf(stderr, "%s\n", line);
  }
  fflush(stderr);
}

void sf_progress_end(sf_progress *progress)
{
  if (progress->terminal && !progress->quiet && progress->width) fputc('\n', stderr);
  progress->width = 0;
}
