#include "sim/wave_file.h"
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { HEAD = 9, LENGTH = 8, MORE = 1 << 20 }; /* a section: its kind, then its length, big-endian, itself included */

/* Sections follow each other up to the end of the file; the lengths are written last. */
static bool is_whole(int file)
{
  const off_t size = lseek(file, 0, SEEK_END);
  off_t at = 0;
  while (at < size) {
    unsigned char head[HEAD];
    uint64_t length = 0;
    if (pread(file, head, HEAD, at) != HEAD) return false;
    for (int i = 1; i < HEAD; i++) length = length << 8 | head[i];
    if (length < LENGTH || length > (uint64_t)(size - at - 1)) return false;
    at += 1 + (off_t)length;
  }
  return size > 0;
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
