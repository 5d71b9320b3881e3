/* A sweep of widths: two points, whose files are the halves of the input, split at a byte 0x1c. What is accepted is
 * marked, printed and drawn. */
#include "fuzz.h"
#include "base/io.h"
#include "sweep/sweep.h"

/* Files of memory under the names of the points; the first is the centre. */
static const char *make_sweep(const uint8_t *data, size_t size)
{
  static char folder[300];
  static int slot[2];
  if (!folder[0]) {
    char path[400], input[40];
    snprintf(folder, sizeof folder, "%s/sweep", fuzz_folder());
    snprintf(path, sizeof path, "%s/points", folder);
    FUZZ_EXPECT(fuzz_good(sf_make_dir(path)));
    for (int s = 0; s < 2; s++) {
      slot[s] = memfd_create("point", 0);
      snprintf(path, sizeof path, "%s/points/%c.json", folder, "cd"[s]);
      snprintf(input, sizeof input, "/proc/self/fd/%d", slot[s]);
      FUZZ_EXPECT(slot[s] > 0 && !symlink(input, path));
    }
    snprintf(path, sizeof path, "%s/centre", folder);
    FUZZ_EXPECT(fuzz_good(sf_write_file(path, "c\n", 2)));
  }
  const uint8_t *split = size ? memchr(data, 0x1c, size) : NULL;
  const size_t first = split ? (size_t)(split - data) : size, second = split ? size - first - 1 : size;
  FUZZ_EXPECT(!ftruncate(slot[0], 0) && pwrite(slot[0], data, first, 0) == (ssize_t)first);
  FUZZ_EXPECT(!ftruncate(slot[1], 0) && pwrite(slot[1], split ? split + 1 : data, second, 0) == (ssize_t)second);
  return folder;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  static FILE *nowhere;
  sf_sweep sweep;
  int plots;
  if (!nowhere) nowhere = fopen("/dev/null", "w");
  FUZZ_EXPECT(nowhere);
  if (!fuzz_good(sf_sweep_load(&sweep, make_sweep(data, size)))) return 0;
  FUZZ_EXPECT(sweep.count == 2 && sweep.centre == sweep.point);
  sf_sweep_mark(&sweep);
  FUZZ_EXPECT(sweep.point[0].front || sweep.point[1].front);
  sf_sweep_print(nowhere, &sweep);
  sf_sweep_csv(nowhere, &sweep);
  FUZZ_EXPECT(fuzz_good(sf_sweep_plots(&sweep, &plots)));
  sf_sweep_free(&sweep);
  return 0;
}
