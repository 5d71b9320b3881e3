/* Command lines: one argument per line. */
#include "fuzz.h"
#include "cli/cli.h"
#include <math.h>

enum { ARGUMENTS = 16 };

/* These print and leave. */
static bool asks_for_help(const char *word)
{
  return !strcmp(word, "-h") || !strcmp(word, "--help") || !strcmp(word, "--version") || !strcmp(word, "--completion");
}

static int split(char *text, char *argv[ARGUMENTS])
{
  static char program[] = "program";
  int argc = 1;
  argv[0] = program;
  for (char *word = text; word && argc < ARGUMENTS - 1;) {
    char *end = strchr(word, '\n');
    if (end) *end++ = 0;
    if (!asks_for_help(word)) argv[argc++] = word;
    word = end;
  }
  argv[argc] = NULL;
  return argc;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  bool flag = false;
  int number = 0, choice = 0;
  uint64_t seed = 0;
  double real = 0;
  const char *name = "", *positional[2];
  const sf_option options[] = {{.name = "--json", .type = SF_ARG_FLAG, .value = &flag},
                               {.name = "--view", .letter = 'v', .type = SF_ARG_INT, .value = &number, .max = 9},
                               {.name = "--seed", .type = SF_ARG_U64, .value = &seed},
                               {.name = "--beta", .type = SF_ARG_DOUBLE, .value = &real},
                               {.name = "--out", .letter = 'o', .type = SF_ARG_STRING, .value = &name},
                               {.name = "--mode", .type = SF_ARG_CHOICE, .value = &choice, .choices = "one|two"},
                               {0}};
  const sf_cli cli = {.program = "program", .options = options, .min_positional = 1, .max_positional = 2};
  char *argv[ARGUMENTS], *text = malloc(size + 1);
  FUZZ_EXPECT(text);
  memcpy(text, data, size);
  text[size] = 0;
  if (fuzz_good(sf_cli_parse(&cli, split(text, argv), argv, positional))) {
    FUZZ_EXPECT(positional[0] && number >= 0 && number <= 9 && choice >= 0 && choice < 2);
    FUZZ_EXPECT(isfinite(real));
    fuzz_touch(name, strlen(name));
  }
  free(text);
  return 0;
}
