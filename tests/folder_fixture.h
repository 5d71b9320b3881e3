/* A folder of one's own for the tests that write files, and the two ways in which a status is judged. */
#ifndef SF_TESTS_FOLDER_FIXTURE_H
#define SF_TESTS_FOLDER_FIXTURE_H
#include "base/status.h"
#include <check.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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

#define ck_good(call)                                                                                                  \
  do {                                                                                                                 \
    sf_status s_ = (call);                                                                                             \
    ck_assert_msg(s_.code == SF_OK, "unexpected failure: %s", s_.message);                                             \
  } while (0)

/* Fails with this code, and the message holds both words and stays on one line. */
static inline void ck_bad(sf_status s, sf_code code, const char *word, const char *other)
{
  ck_assert_msg(s.code == code, "code %d instead of %d: '%s'", s.code, code, s.message);
  ck_assert_msg(strstr(s.message, word), "'%s' does not name '%s'", s.message, word);
  ck_assert_msg(strstr(s.message, other), "'%s' does not name '%s'", s.message, other);
  ck_assert_ptr_null(strchr(s.message, '\n'));
}

#endif
