/* What the fuzzing targets share. A target is one file fuzz_NAME.c with LLVMFuzzerTestOneInput(): libFuzzer calls it
 * (make fuzz), or replay.c with the files named on its command line (make check). See docs/fuzzing.md. */
#ifndef SF_TESTS_FUZZ_FUZZ_H
#define SF_TESTS_FUZZ_FUZZ_H
#include "base/status.h"
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Ends the process as a crash does, naming what did not hold. */
#define FUZZ_EXPECT(condition)                                                                                         \
  do {                                                                                                                 \
    if (condition) break;                                                                                              \
    fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);                                     \
    abort();                                                                                                           \
  } while (0)

/* The input as a file of memory: readers take a path, and a disk would be slower. The same path every time. */
static inline const char *fuzz_file(const uint8_t *data, size_t size)
{
  static char path[64];
  static int fd = -1;
  if (fd < 0) {
    fd = memfd_create("input", 0);
    FUZZ_EXPECT(fd >= 0);
    snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
  }
  FUZZ_EXPECT(!ftruncate(fd, 0));
  for (size_t done = 0; done < size;) {
    const ssize_t n = pwrite(fd, data + done, size - done, (off_t)done);
    FUZZ_EXPECT(n > 0);
    done += (size_t)n;
  }
  return path;
}

static char fuzz_folder_path[256];

static inline void fuzz_folder_remove(void)
{
  char command[300];
  snprintf(command, sizeof command, "rm -rf '%s'", fuzz_folder_path);
  if (system(command)) fprintf(stderr, "cannot remove %s\n", fuzz_folder_path);
}

/* A folder of the target's own, made at the first call and removed at the end. */
static inline const char *fuzz_folder(void)
{
  if (fuzz_folder_path[0]) return fuzz_folder_path;
  const char *base = getenv("TMPDIR");
  snprintf(fuzz_folder_path, sizeof fuzz_folder_path, "%s/sf-fuzz-XXXXXX", base && *base ? base : "/tmp");
  FUZZ_EXPECT(mkdtemp(fuzz_folder_path));
  atexit(fuzz_folder_remove);
  return fuzz_folder_path;
}

/* An error says what is wrong, on one line; no small input needs more memory than there is. Returns whether there was
 * none. */
static inline int fuzz_good(sf_status status)
{
  if (status.code == SF_OK) return 1;
  FUZZ_EXPECT(status.code != SF_E_MEMORY);
  FUZZ_EXPECT(status.message[0] && !strchr(status.message, '\n'));
  return 0;
}

/* Reads every byte, so that the sanitizers see what was not written. */
static inline void fuzz_touch(const void *data, size_t size)
{
  static volatile uint8_t sink;
  uint8_t sum = 0;
  for (size_t i = 0; i < size; i++) sum = (uint8_t)(sum ^ ((const uint8_t *)data)[i]);
  sink = sum;
  (void)sink;
}
#endif
