/* Command lines for the programs of tools/: one table gives parsing, checking and --help. */
#ifndef SF_CLI_CLI_H
#define SF_CLI_CLI_H
#include "base/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* STRING: any text. INPUT: a file or folder that is read. OUTPUT: a file that will be written. PLACE: a folder, or
 * something that the program itself opens before it works. GROUP: a heading of --help for the options that follow. */
typedef enum {
  SF_ARG_FLAG,
  SF_ARG_INT,
  SF_ARG_U64,
  SF_ARG_DOUBLE,
  SF_ARG_STRING,
  SF_ARG_INPUT,
  SF_ARG_OUTPUT,
  SF_ARG_PLACE,
  SF_ARG_CHOICE,
  SF_ARG_GROUP
} sf_arg_type;
typedef struct sf_option {
  const char *name; /* "--beta" */
  char letter;      /* 'o' for -o, or 0 */
  sf_arg_type type;
  void *value;         /* bool*, int*, uint64_t*, double*, const char**; CHOICE: int* index into choices */
  double min, max;     /* INT, U64, DOUBLE: inclusive, min == max: no limit; NaN and Inf are always refused */
  const char *choices; /* "hybrid|decay|no-decay" */
  const char *argument,
      *help; /* "B", "weight of the budget loss (default 5e-7)"; or "weight of ...\tpixel\t#": what
                it is without being given, in the columns of sf_cli; "#": the number in its defaults */
} sf_option;
/* clang-format off */
#define SF_GROUP(title) {title, 0, SF_ARG_GROUP, NULL, 0, 0, NULL, NULL, NULL}
/* clang-format on */
typedef struct sf_cli {
  const char *program, *usage, *summary, *examples; /* shown by --help */
  const sf_option *options;                         /* ends with name == NULL */
  int min_positional, max_positional;
  bool words;                       /* the positionals are words, not files or folders that are read */
  const char *columns;              /* headings of the columns with defaults: "\tingp\ttensorf"; or NULL */
  const sf_option *const *defaults; /* for each column the same options, with its defaults as values; or NULL */
} sf_cli;

/* Fills option values and positional[] (pointers into argv; NULL where absent). Options may follow positionals, and
 * --name=value works. --help and --version print and exit with 0. So does --completion, which `make install` uses and
 * --help does not show. SF_E_USAGE names the wrong option; an OUTPUT or PLACE must not be another file of the line.
 * SF_E_RANGE: a wrong SPIKEFIELD_CPU (base/cpu.h). SF_E_IO: an OUTPUT cannot be written. Ignores SIGXFSZ, so that a
 * file-size limit is an ordinary write error. */
sf_status sf_cli_parse(const sf_cli *cli, int argc, char **argv, const char **positional);

/* Copies options to `to` and returns the place after them. So a table may be put together from parts. */
sf_option *sf_cli_add(sf_option *to, const sf_option *list, size_t count);

/* The completion script for bash. */
void sf_cli_print_completion(const sf_cli *cli);
/* The text of --help. */
void sf_cli_help(const sf_cli *cli);

/* Fails with SF_E_USAGE, "--name why", if one of these options (the list ends with NULL) was given. The line has been
 * parsed before. */
sf_status sf_cli_refuse(const sf_cli *cli, int argc, char **argv, const char *const *names, const char *why);

/* "program: message" on stderr; returns the exit status: 0 ok, 2 usage, 130 stopped, 1 everything else. */
int sf_cli_finish(const sf_cli *cli, sf_status status);

/* Prints a word as a shell reads it: in single quotes where it needs them. */
void sf_cli_put_word(FILE *out, const char *word);

/* SIGINT and SIGTERM set a flag that long loops poll; the second signal kills. */
void sf_cli_catch_signals(void);
bool sf_cli_interrupted(void);

/* Progress on stderr: on a terminal one line that overwrites itself, elsewhere plain lines, at most one per 5 s.
 * Nothing when quiet. */
typedef struct sf_progress {
  bool terminal, quiet;
  double last;
  int width;
} sf_progress;
void sf_progress_begin(sf_progress *progress, bool quiet);
bool sf_progress_due(const sf_progress *progress);
void sf_progress_show(sf_progress *progress, const char *format, ...) __attribute__((format(printf, 2, 3)));
void sf_progress_end(sf_progress *progress); /* leaves the last line standing */
#endif
