/* A folder of one's own for the tests that write files. */
#ifndef SF_TESTS_FOLDER_FIXTURE_H
#define SF_TESTS_FOLDER_FIXTURE_H
#include "ck_run.h"
#include <dirent.h>
#include <unistd.h>

static char folder[200];

static inline void make_folder(void)
{
  const char *base = getenv("TMPDIR");
  snprintf(folder, sizeof folder, "%s/sf-test-XXXXXX", base && *base ? base : "/tmp");
  ck_assert_ptr_nonnull(mkdtemp(folder));
}

static inline int entries(void)
{
  DIR *dir = opendir(folder);
  int n = 0;
  for (struct dirent *e; (e = readdir(dir));) n += strcmp(e->d_name, ".") && strcmp(e->d_name, "..");
  closedir(dir);
  return n;
}

static inline void remove_folder(void)
{
  char command[300];
  snprintf(command, sizeof command, "rm -rf '%s'", folder);
  ck_assert_int_eq(system(command), 0);
}

static inline const char *in(const char *name)
{
  static char path[8][300];
  static int turn;
  char *p = path[turn++ % 8];
  snprintf(p, sizeof path[0], "%s/%s", folder, name);
  return p;
}

/* Without the syncing of sf_write_file, which would dominate loops of them. */
static inline void put_file(const char *path, const void *data, size_t n)
{
  unlink(path); /* some file systems sync a file that is cut and written again */
  FILE *f = fopen(path, "wb");
  ck_assert_ptr_nonnull(f);
  ck_assert_uint_eq(fwrite(data, 1, n, f), n);
  ck_assert_int_eq(fclose(f), 0);
}
#endif
