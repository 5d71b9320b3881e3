/* Command lines: values, refusals, outputs, help, exit status, signals, progress. */
#include "ck_run.h"
#include "cli/cli.h"
#include "base/io.h"
#include "folder_fixture.h"
#include <signal.h>
#include <sys/wait.h>

typedef struct values {
  bool flag;
  int number, choice;
  uint64_t seed;
  double beta;
  const char *text;
} values;

static sf_status parse_line(const sf_cli *cli, const char **positional, const char *line)
{
  static char copy[500];
  char *argv[20] = {"prog"};
  int argc = 1;
  snprintf(copy, sizeof copy, "%s", line);
  for (char *word = strtok(copy, " "); word; word = strtok(NULL, " ")) argv[argc++] = strcmp(word, "''") ? word : "";
  return sf_cli_parse(cli, argc, argv, positional);
}

static sf_status parse(values *v, const char **positional, const char *line)
{
  const sf_option options[] = {{"--flag", 'f', SF_ARG_FLAG, &v->flag, 0, 0, NULL, NULL, "a flag"},
                               {"--number", 'n', SF_ARG_INT, &v->number, -5, 10, NULL, "N", "a number"},
                               {"--any", 0, SF_ARG_INT, &v->number, 0, 0, NULL, "N", "any number"},
                               {"--seed", 0, SF_ARG_U64, &v->seed, 0, 0, NULL, "N", "a seed"},
                               {"--beta", 'b', SF_ARG_DOUBLE, &v->beta, 0, 1, NULL, "B", "a weight"},
                               {"--mode", 0, SF_ARG_CHOICE, &v->choice, 0, 0, "hybrid|decay|no-decay", NULL, "a mode"},
                               {"--out", 'o', SF_ARG_STRING, &v->text, 0, 0, NULL, "FILE", "a file"},
                               {0}};
  const sf_cli cli = {"prog", "prog IN [OUT] [options]", "Does it.", NULL, options, 1, 2, false, NULL, NULL};
  return parse_line(&cli, positional, line);
}

static sf_status parse_paths(const char *line, const char **positional)
{
  const char *output = NULL, *log = NULL, *start = NULL, *word = NULL;
  const sf_option options[] = {{"--output", 'o', SF_ARG_OUTPUT, &output, 0, 0, NULL, "FILE", "a file"},
                               {"--log", 0, SF_ARG_PLACE, &log, 0, 0, NULL, "FILE", "a log"},
                               {"--start", 0, SF_ARG_INPUT, &start, 0, 0, NULL, "FILE", "an input"},
                               {"--word", 0, SF_ARG_STRING, &word, 0, 0, NULL, "WORD", "no file"},
                               {0}};
  const sf_cli cli = {"prog", "prog IN", "Does it.", NULL, options, 1, 2, false, NULL, NULL};
  return parse_line(&cli, positional, line);
}

TEST(cli_values)
{
  values v = {0};
  const char *p[2];
  ck_ok(parse(&v, p, "in -f -n -5 --seed 18446744073709551615 --beta=1e-7 --mode no-decay out -o file"));
  ck_assert(v.flag);
  ck_assert_int_eq(v.number, -5);
  ck_assert_uint_eq(v.seed, UINT64_MAX);
  ck_assert(v.beta == 1e-7);
  ck_assert_int_eq(v.choice, 2);
  ck_assert_str_eq(v.text, "file");
  ck_assert_str_eq(p[0], "in");
  ck_assert_str_eq(p[1], "out");
  ck_ok(parse(&v, p, "-n10 --seed=0x10 --any -2147483648 -- -in"));
  ck_assert_int_eq(v.number, INT32_MIN);
  ck_assert_uint_eq(v.seed, 16);
  ck_assert_str_eq(p[0], "-in");
  ck_assert_ptr_null(p[1]);
  ck_ok(parse(&v, p, "-"));
  ck_assert_str_eq(p[0], "-");
}

static const struct {
  const char *line, *name, *problem;
} bad_lines[] = {
    {"in --nope", "--nope", "unknown option"},     {"in -x", "-x", "unknown option"},
    {"in --numbe 3", "--numbe", "unknown"},        {"in --number", "--number", "needs a value"},
    {"in -n --flag", "--number", "needs a value"}, {"in --number 11", "--number", "out of range"},
    {"in -n -6", "--number", "-5 to 10"},          {"in -n 3x", "--number", "not a whole number"},
    {"in -n 1.5", "--number", "not a whole"},      {"in -n 99999999999999999999", "--number", "out of range"},
    {"in --any 2147483648", "--any", "32 bits"},   {"in --number ''", "--number", "not a whole number"},
    {"in --seed -1", "--seed", "not a whole"},     {"in --seed 18446744073709551616", "--seed", "64 bits"},
    {"in --seed 0x", "--seed", "not a whole"},     {"in --beta nan", "--beta", "not a finite number"},
    {"in --beta inf", "--beta", "not a finite"},   {"in --beta 1e999", "--beta", "not a finite"},
    {"in --beta 1.01", "--beta", "out of range"},  {"in --beta one", "--beta", "not a number"},
    {"in --mode sum", "--mode", "hybrid|decay"},   {"in --mode hyb", "--mode", "unknown"},
    {"in --flag=1", "--flag", "takes no value"},   {"in --out=", "--out", "empty"},
    {"a b c", "'c'", "unexpected argument"},       {"-f", "missing argument", "prog IN"},
};

LOOP_TEST(cli_refused, COUNT(bad_lines))
{
  values v = {0};
  const char *p[2];
  ck_bad(parse(&v, p, bad_lines[_i].line), SF_E_USAGE, bad_lines[_i].name, bad_lines[_i].problem);
}

/* What would be lost at the end is refused at the start; nothing stays behind, and no file is changed. */
TEST(cli_outputs)
{
  static const char *const lines[][3] = {
      {"a -o a", "--output", "is the input"},        {"b -o ./a", "--output", "is the input"},
      {"a --log b", "--log", "is the input"},        {"in --start a -o b", "--output", "also --start"},
      {"in -o c --log c", "--output", "also --log"}, {"in --log d/../c -o c", "--output", "also --log"}};
  static const char *const unwritable[] = {"in -o none/c", "in -o d", "in -o a/c", "in -o /dev/null"};
  static const char *const good[] = {"a -o c --log d",  "d --log d -o d/a", "in --start c -o x",
                                     "in --log none/c", "in --word c -o c", "in --start c -o c"};
  const char *p[2];
  ck_assert_int_eq(chdir(folder), 0);
  ck_ok(sf_write_file("a", "a", 1));
  ck_assert_int_eq(symlink("a", "b"), 0);
  ck_ok(sf_make_dir("d"));
  for (int i = 0; i < COUNT(lines); i++) ck_bad(parse_paths(lines[i][0], p), SF_E_USAGE, lines[i][1], lines[i][2]);
  for (int i = 0; i < COUNT(unwritable); i++)
    ck_bad(parse_paths(unwritable[i], p), SF_E_IO, "cannot write", strrchr(unwritable[i], ' ') + 1);
  for (int i = 0; i < COUNT(good); i++) ck_ok(parse_paths(good[i], p));
  ck_assert_int_eq(entries(), 3);
}

/* How a process ends that does this. */
static int end_of(void (*act)(void))
{
  int status;
  const pid_t child = fork();
  if (child == 0) {
    act();
    _exit(9);
  }
  ck_assert_int_eq(waitpid(child, &status, 0), child);
  return status;
}

static void ask_for_help(void)
{
  values v = {0};
  const char *p[2];
  if (freopen(in("help"), "w", stdout)) parse(&v, p, "--help");
}

/* Groups in the order of the table, lines of at most 80 columns, defaults under their columns. */
TEST(cli_help_in_groups)
{
  static const char wanted[] =
      "Usage: prog\n\nFirst:\n  -o, --out FILE            a file\n"
      "      --an-option-with-a-long-name NUMBER\n                            what does not fit beside its name "
      "stands below, and\n"
      "                            goes on in the next line\n"
      "\nSizes:                                                              one      two\n"
      "      --size N              words of a help that goes on in          16       32\n"
      "                            the next line\n"
      "      --both N              the same for both                         7        7\n"
      "\nHelp:\n  -h, --help                show this text\n      --version             show the version\n";
  const char *out;
  int n;
  const sf_option options[] = {
      SF_GROUP("First"),
      {"--out", 'o', SF_ARG_STRING, &out, 0, 0, NULL, "FILE", "a file"},
      {"--an-option-with-a-long-name", 0, SF_ARG_INT, &n, 0, 0, NULL, "NUMBER",
       "what does not fit beside its name stands below, and goes on in the next line"},
      SF_GROUP("Sizes"),
      {"--size", 0, SF_ARG_INT, &n, 0, 0, NULL, "N", "words of a help that goes on in the next line\t16\t32"},
      {"--both", 0, SF_ARG_INT, &n, 0, 0, NULL, "N", "the same for both\t7"},
      {0}};
  const sf_cli cli = {.program = "prog", .options = options, .columns = "\tone\ttwo"};
  ck_assert_ptr_nonnull(freopen(in("help"), "w", stdout));
  sf_cli_help(&cli);
  fclose(stdout);
  ck_text(in("help"), wanted);
  ck_bad(parse_line(&cli, (const char *[]){NULL}, "Sizes"), SF_E_USAGE, "unexpected", "Sizes"); /* no option */
}

TEST(cli_help_exits_zero)
{
  ck_assert_int_eq(end_of(ask_for_help), 0);
}

TEST(cli_exit_status)
{
  const sf_cli cli = {.program = "prog"};
  ck_assert_ptr_nonnull(freopen(in("err"), "w", stderr));
  ck_assert_int_eq(sf_cli_finish(&cli, sf_ok()), 0);
  ck_assert_int_eq(ftell(stderr), 0);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_USAGE, "u")), 2);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_STOPPED, "s")), 130);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_IO, "i")), 1);
  ck_assert_int_eq(sf_cli_finish(&cli, sf_fail(SF_E_DIFFERENCE, "d")), 1);
  fclose(stderr);
  ck_text(in("err"), "prog: u (see prog --help)\nprog: s\nprog: i\nprog: d\n");
}

TEST(cli_full_standard_output_is_an_error)
{
  const sf_cli cli = {.program = "prog"};
  ck_assert_ptr_nonnull(freopen("/dev/full", "w", stdout));
  ck_assert_ptr_nonnull(freopen("/dev/null", "w", stderr));
  printf("text");
  ck_assert_int_eq(sf_cli_finish(&cli, sf_ok()), 1);
}

TEST(first_signal_asks_to_stop)
{
  sf_cli_catch_signals();
  ck_assert(!sf_cli_interrupted());
  raise(SIGINT);
  ck_assert(sf_cli_interrupted());
}

static void two_signals(void)
{
  sf_cli_catch_signals();
  raise(SIGTERM);
  raise(SIGTERM);
}

TEST(second_signal_kills)
{
  const int status = end_of(two_signals);
  ck_assert(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
}

TEST(progress_is_sparse_in_logs)
{
  sf_progress p;
  ck_assert_ptr_nonnull(freopen(in("err"), "w", stderr));
  sf_progress_begin(&p, false);
  ck_assert(!p.terminal);
  for (int i = 0; i < 100; i++) sf_progress_show(&p, "step %d", i);
  p.last -= 6;
  ck_assert(sf_progress_due(&p));
  sf_progress_show(&p, "shown");
  sf_progress_show(&p, "not shown");
  sf_progress_end(&p);
  sf_progress_begin(&p, true);
  p.last -= 6;
  ck_assert(!sf_progress_due(&p));
  sf_progress_show(&p, "quiet");
  fclose(stderr);
  ck_text(in("err"), "shown\n");
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
