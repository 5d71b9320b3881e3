/* Where the first inputs of the fuzzing targets are written. */
#ifndef SF_TESTS_FUZZ_SEEDS_H
#define SF_TESTS_FUZZ_SEEDS_H
#include "fuzz.h"
#include "base/io.h"

static const char *seed_root;

/* ROOT/TARGET/NAME, the folder made. */
static inline const char *seed_path(const char *target, const char *name)
{
  static char path[2][4200];
  static int turn;
  char *p = path[turn++ % 2];
  snprintf(p, sizeof path[0], "%s/%s", seed_root, target);
  FUZZ_EXPECT(fuzz_good(sf_make_dir(p)));
  snprintf(p, sizeof path[0], "%s/%s/%s", seed_root, target, name);
  return p;
}

static inline void put(const char *target, const char *name, const void *data, size_t size)
{
  FUZZ_EXPECT(fuzz_good(sf_write_file(seed_path(target, name), data, size)));
}

static inline void put_text(const char *target, const char *name, const char *text)
{
  put(target, name, text, strlen(text));
}
#endif
