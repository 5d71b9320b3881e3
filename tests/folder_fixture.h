/* A folder of one's own for the tests that write files. */
#ifndef SF_TESTS_FOLDER_FIXTURE_H
#define SF_TESTS_FOLDER_FIXTURE_H
#include "ck_run.h"
#include <dirent.h>
#include "base/io.h"
#include "base/rng.h"
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

/* The whole of a small file, with a zero behind it; to be freed. */
static inline char *read_whole(const char *path, size_t *size)
{
  char *data;
  ck_ok(sf_read_file(path, (size_t)1 << 30, &data, size));
  return data;
}

static inline void ck_text(const char *path, const char *wanted)
{
  size_t size;
  char *text = read_whole(path, &size);
  ck_assert_str_eq(text, wanted);
  free(text);
}

static inline bool same_files(const char *a, const char *b)
{
  size_t size[2];
  char *const data[2] = {read_whole(a, &size[0]), read_whole(b, &size[1])};
  const bool same = size[0] == size[1] && !memcmp(data[0], data[1], size[0]);
  free(data[0]), free(data[1]);
  return same;
}

/* Cut at every length, and one byte wrong at every place: never a crash, and a cut file is always refused. */
static inline void ck_damage(const char *path, sf_status (*load)(const char *), bool refuse_flips)
{
  size_t n;
  char *data = read_whole(path, &n);
  for (size_t i = 0; i < n; i++) {
    put_file(in("bad"), data, i);
    const sf_status s = load(in("bad"));
    ck_assert_msg(s.code == SF_E_FORMAT, "cut to %zu of %zu bytes: code %d %s", i, n, s.code, s.message);
    ck_assert_msg(strstr(s.message, "/bad"), "'%s' does not name the file", s.message);
  }
  for (size_t i = 0; i < n; i++) {
    const char right = data[i];
    data[i] ^= (char)(1 + sf_random_below(4, 0, i, 255));
    put_file(in("bad"), data, n);
    data[i] = right;
    ck_assert_msg(load(in("bad")).code != SF_OK || !refuse_flips, "byte %zu wrong: accepted", i);
  }
  free(data);
}
#endif
