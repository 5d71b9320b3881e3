#include "sim/wave_file.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { HEAD = 9, LENGTH = 8, MORE = 1 << 20 }; /* a section: its kind, then its length, big-endian, itself included */

/* Kinds of sections: widths of the nets, and their names, packed in three ways. */
enum { GEOMETRY = 1 << 3, HIERARCHY = 1 << 4 | 1 << 6 | 1 << 7, KINDS = 31 };

/* Sections follow each other up to the end of the file; the lengths are written last. The nets stand behind the values:
 * where they are missing, the file ends with a length that its writer only believed to have written. */
static bool is_whole(int file)
{
  const off_t size = lseek(file, 0, SEEK_END);
  off_t at = 0;
  unsigned seen = 0;
  while (at < size) {
    unsigned char head[HEAD];
    uint64_t length = 0;
    if (pread(file, head, HEAD, at) != HEAD) return false;
    for (int i = 1; i < HEAD; i++) length = length << 8 | head[i];
    if (length < LENGTH || length > (uint64_t)(size - at - 1)) return false;
    at += 1 + (off_t)length;
    seen |= 1U << (head[0] & KINDS);
  }
  return (seen & GEOMETRY) && (seen & HIERARCHY);
}

/* Writes until the disk refuses: why it does, or 0 if it does not. The file was useless before. */
static int refusal(int file)
{
  static const char nothing[4096];
  lseek(file, 0, SEEK_END);
  for (ssize_t n, done = 0; done < MORE; done += n) /* where there is room for less than that, the next one says why */
    if ((n = write(file, nothing, sizeof nothing)) <= 0) return n < 0 ? errno : EIO;
  return 0;
}

sf_status sf_wave_file_check(const char *path)
{
  const int file = open(path, O_RDWR | O_CLOEXEC);
  if (file < 0) return sf_fail(SF_E_IO, "cannot write %s: %s", path, strerror(errno));
  const bool whole = is_whole(file);
  const int error = whole ? 0 : refusal(file);
  close(file);
  if (whole) return sf_ok();
  return sf_fail(SF_E_IO, "cannot write %s: %s", path,
                 error ? strerror(error) : "the waveform is cut short; the disk may have been full");
}

/* A signal handler can reach nothing else. */
static char told[4096 + 128], doomed[4][4096 + 64];

static void give_up(int signal)
{
  (void)signal;
  for (int i = 0; i < 4; i++)
    if (doomed[i][0]) unlink(doomed[i]);
  if (write(STDERR_FILENO, told, strlen(told)) < 0) _exit(2);
  _exit(1);
}

void sf_wave_file_guard(const char *wave, const char *const more[2])
{
  if (!wave) {
    signal(SIGBUS, SIG_DFL);
    return;
  }
  snprintf(told, sizeof told, "%s: cannot write %s: %s\n", program_invocation_short_name, wave, strerror(ENOSPC));
  snprintf(doomed[0], sizeof doomed[0], "%s", wave);
  snprintf(doomed[1], sizeof doomed[1], "%s.hier", wave);
  for (int i = 0; i < 2; i++) snprintf(doomed[2 + i], sizeof doomed[0], "%s", more && more[i] ? more[i] : "");
  signal(SIGBUS, give_up);
}
