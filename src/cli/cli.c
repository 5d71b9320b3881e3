#include "cli/cli.h"
#include "base/cpu.h"
#include "base/io.h"
#include "spikefield/spikefield.h"
#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- values ---- */

/* The whole text must be one number: strto* alone would take leading blanks and trailing text. */
static bool whole_number_text(const char *text)
{
  return *text && !isspace((unsigned char)*text);
}

static sf_status out_of_range(const sf_option *o, const char *text)
{
  return sf_fail(SF_E_USAGE, "%s %.60s is out of range: expected %.12g to %.12g", o->name, text, o->min, o->max);
}

static bool outside(const sf_option *o, double value)
{
  return o->min != o->max && !(value >= o->min && value <= o->max);
}

static sf_status set_int(const sf_option *o, const char *text)
{
  char *end;
  errno = 0;
  long value = strtol(text, &end, 10);
  if (!whole_number_text(text) || *end)
    return sf_fail(SF_E_USAGE, "%s %.60s is not a whole number", o->name, *text ? text : "''");
  if (errno || value < INT32_MIN || value > INT32_MAX) {
    if (o->min != o->max) return out_of_range(o, text);
    return sf_fail(SF_E_USAGE, "%s %.60s is out of range: it does not fit 32 bits", o->name, text);
  }
  if (outside(o, (double)value)) return out_of_range(o, text);
  *(int *)o->value = (int)value;
  return sf_ok();
}

static sf_status set_u64(const sf_option *o, const char *text)
{
  char *end;
  errno = 0;
  bool hex = text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
  unsigned long long value = strtoull(text, &end, hex ? 16 : 10);
  if (!whole_number_text(text) || *end || *text == '-' || *text == '+' || (hex && !text[2]))
    return sf_fail(SF_E_USAGE, "%s %.60s is not a whole number of 0 or more", o->name, *text ? text : "''");
  if (errno) return sf_fail(SF_E_USAGE, "%s %.60s is out of range: it does not fit 64 bits", o->name, text);
  if (outside(o, (double)value)) return out_of_range(o, text);
  *(uint64_t *)o->value = value;
  return sf_ok();
}

static sf_status set_double(const sf_option *o, const char *text)
{
  char *end;
  double value = strtod(text, &end);
  if (!whole_number_text(text) || *end)
    return sf_fail(SF_E_USAGE, "%s %.60s is not a number", o->name, *text ? text : "''");
  if (!isfinite(value)) return sf_fail(SF_E_USAGE, "%s %.60s is not a finite number", o->name, text);
  if (outside(o, value)) return out_of_range(o, text);
  *(double *)o->value = value;
  return sf_ok();
}

static sf_status set_choice(const sf_option *o, const char *text)
{
  size_t n = strlen(text);
  int index = 0;
  for (const char *choice = o->choices; choice && n; index++) {
    const char *bar = strchr(choice, '|');
    size_t length = bar ? (size_t)(bar - choice) : strlen(choice);
    if (length == n && !memcmp(choice, text, n)) {
      *(int *)o->value = index;
      return sf_ok();
    }
    choice = bar ? bar + 1 : NULL;
  }
  return sf_fail(SF_E_USAGE, "%s %.60s is unknown: expected %s", o->name, n ? text : "''", o->choices);
}

static sf_status set_value(const sf_option *o, const char *text)
{
  switch (o->type) {
  case SF_ARG_INT:
    return set_int(o, text);
  case SF_ARG_U64:
    return set_u64(o, text);
  case SF_ARG_DOUBLE:
    return set_double(o, text);
  case SF_ARG_CHOICE:
    return set_choice(o, text);
  case SF_ARG_STRING:
  case SF_ARG_INPUT:
  case SF_ARG_OUTPUT:
  case SF_ARG_PLACE:
    if (!*text) return sf_fail(SF_E_USAGE, "%s needs a value that is not empty", o->name);
    *(const char **)o->value = text;
    return sf_ok();
  case SF_ARG_FLAG:
  case SF_ARG_GROUP:
    break;
  }
  *(bool *)o->value = true;
  return sf_ok();
}

/* ---- outputs ---- */

static bool folder_info(const char *path, struct stat *info)
{
  const char *slash = strrchr(path, '/');
  char folder[4096];
  snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path) + 1 : 1, slash ? path : ".");
  return !stat(folder, info);
}

static const char *last_part(const char *path)
{
  const char *slash = strrchr(path, '/');
  return slash ? slash + 1 : path;
}

/* Works for files that do not exist yet, too. A folder may have two uses. */
static bool same_file(const char *a, const char *b)
{
  struct stat p, q;
  const bool there = !stat(a, &p);
  if (there != !stat(b, &q)) return false;
  if (!there && (strcmp(last_part(a), last_part(b)) || !folder_info(a, &p) || !folder_info(b, &q))) return false;
  return (!there || S_ISREG(p.st_mode)) && p.st_dev == q.st_dev && p.st_ino == q.st_ino;
}

/* The path that the option names, or NULL. The value of an input may also name something that is no file. */
static const char *path_of(const sf_option *o)
{
  const bool path = o->type == SF_ARG_INPUT || o->type == SF_ARG_OUTPUT || o->type == SF_ARG_PLACE;
  const char *text = path ? *(const char **)o->value : NULL;
  return text && o->type == SF_ARG_INPUT && access(text, F_OK) ? NULL : text;
}

/* Where layouts keep pictures, from the data set's folder on: train/, test/, val/, images/, images_4/. */
static bool in_picture_folder(const char *inside)
{
  static const char *const folders[] = {"train/", "test/", "val/"};
  bool in = !strncmp(inside, "images", 6) && strchr(inside, '/');
  for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) in |= !strncmp(inside, folders[i], strlen(folders[i]));
  return in;
}

/* A list of views, or a picture where a layout has pictures. Outputs of earlier runs may lie elsewhere in the folder.
 */
static bool is_of_data_set(const char *path, const char *folder)
{
  static const char *const lists[] = {"transforms.json",     "transforms_train.json", "transforms_test.json",
                                      "transforms_val.json", "poses_bounds.npy",      "cameras.bin",
                                      "images.bin",          "points3D.bin",          "cameras.txt",
                                      "images.txt",          "points3D.txt"};
  static const char *const pictures[] = {".png", ".jpg", ".jpeg"};
  struct stat info;
  if (stat(path, &info) || !S_ISREG(info.st_mode) || stat(folder, &info) || !S_ISDIR(info.st_mode)) return false;
  char *file = realpath(path, NULL), *data = realpath(folder, NULL);
  const size_t length = data ? strlen(data) : 0;
  bool of = false;
  if (file && data && !strncmp(file, data, length) && file[length] == '/') {
    const char *name = last_part(file), *end = strrchr(name, '.');
    for (size_t i = 0; i < sizeof lists / sizeof *lists; i++) of |= !strcmp(name, lists[i]);
    for (size_t i = 0; i < sizeof pictures / sizeof *pictures && end && in_picture_folder(file + length + 1); i++)
      of |= !strcasecmp(end, pictures[i]);
  }
  free(file), free(data);
  return of;
}

/* An output over an input or another output would lose one of them, at the end of the work. */
static sf_status check_outputs(const sf_cli *cli, const char *const *positional)
{
  for (const sf_option *o = cli->options; o && o->name; o++) {
    if (o->type != SF_ARG_OUTPUT && o->type != SF_ARG_PLACE) continue;
    const char *path = path_of(o);
    if (!path) continue;
    for (int i = 0; i < cli->max_positional && !cli->words && positional[i]; i++)
      if (same_file(path, positional[i]))
        return sf_fail(SF_E_USAGE, "%s %.200s is the input %.200s", o->name, path, positional[i]);
      else if (is_of_data_set(path, positional[i]))
        return sf_fail(SF_E_USAGE, "%s %.200s is a file of the data set %.200s", o->name, path, positional[i]);
    for (const sf_option *other = cli->options; other->name; other++)
      if (other != o && path_of(other) && same_file(path, path_of(other)))
        return sf_fail(SF_E_USAGE, "%s %.200s is also %s", o->name, path, other->name);
    if (o->type == SF_ARG_OUTPUT) SF_TRY(sf_writable(path));
  }
  return sf_ok();
}

/* ---- the command line ---- */

/* The option that `word` names ("--name", "--name=value", "-o", "-ovalue"); *value: the text attached to it or NULL. */
static const sf_option *find_option(const sf_cli *cli, const char *word, const char **value)
{
  bool named = word[1] == '-';
  size_t length = named ? strcspn(word, "=") : 2;
  *value = named ? (word[length] ? word + length + 1 : NULL) : (word[2] ? word + 2 : NULL);
  for (const sf_option *o = cli->options; o && o->name; o++)
    if (named ? strlen(o->name) == length && !memcmp(o->name, word, length) : o->letter && o->letter == word[1])
      return o;
  return NULL;
}

static bool names_option(const sf_cli *cli, const char *word)
{
  const char *value;
  return word[0] == '-' && word[1] == '-' && word[2] && find_option(cli, word, &value);
}

static void print_version(const sf_cli *cli)
{
  printf("%s (spikefield) %s\n", cli->program, SPIKEFIELD_VERSION);
}

static void answer_and_exit(const sf_cli *cli, void (*answer)(const sf_cli *))
{
  answer(cli);
  exit(sf_cli_finish(cli, sf_ok()));
}

static sf_status take_option(const sf_cli *cli, int argc, char **argv, int *at)
{
  const char *word = argv[*at], *value;
  const sf_option *o = find_option(cli, word, &value);
  if (!o) {
    if (!strcmp(word, "--help") || !strcmp(word, "-h")) answer_and_exit(cli, sf_cli_help);
    if (!strcmp(word, "--version")) answer_and_exit(cli, print_version);
    if (!strcmp(word, "--completion")) answer_and_exit(cli, sf_cli_print_completion);
    return sf_fail(SF_E_USAGE, "unknown option %.80s", word);
  }
  if (o->type == SF_ARG_FLAG) {
    if (value) return sf_fail(SF_E_USAGE, "%s takes no value", o->name);
    return set_value(o, "");
  }
  if (!value) {
    if (*at + 1 >= argc || names_option(cli, argv[*at + 1])) return sf_fail(SF_E_USAGE, "%s needs a value", o->name);
    value = argv[++*at];
  }
  return set_value(o, value);
}

sf_option *sf_cli_add(sf_option *to, const sf_option *list, size_t count)
{
  memcpy(to, list, count * sizeof *list);
  return to + count;
}

sf_status sf_cli_parse(const sf_cli *cli, int argc, char **argv, const char **positional)
{
  signal(SIGXFSZ, SIG_IGN); /* a limit on file sizes becomes a write error that can be reported and cleaned up */
  int count = 0;
  bool options = true;
  for (int i = 0; i < cli->max_positional; i++) positional[i] = NULL;
  for (int i = 1; i < argc; i++) {
    if (options && !strcmp(argv[i], "--")) {
      options = false;
    } else if (options && argv[i][0] == '-' && argv[i][1]) {
      SF_TRY(take_option(cli, argc, argv, &i));
    } else {
      if (count == cli->max_positional) return sf_fail(SF_E_USAGE, "unexpected argument '%.80s'", argv[i]);
      positional[count++] = argv[i];
    }
  }
  if (count < cli->min_positional) {
    const char *usage = cli->usage ? cli->usage : cli->program;
    return sf_fail(SF_E_USAGE, "missing argument; usage: %.*s", (int)strcspn(usage, "\n"), usage);
  }
  SF_TRY(sf_cpu_check());
  return check_outputs(cli, positional);
}

sf_status sf_cli_refuse(const sf_cli *cli, int argc, char **argv, const char *const *names, const char *why)
{
  for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++) {
    const char *value;
    const sf_option *o = argv[i][0] == '-' && argv[i][1] ? find_option(cli, argv[i], &value) : NULL;
    if (!o) continue;
    if (!value && o->type != SF_ARG_FLAG) i++; /* its value may look like an option */
    for (const char *const *name = names; *name; name++)
      if (!strcmp(*name, o->name)) return sf_fail(SF_E_USAGE, "%s %s", *name, why);
  }
  return sf_ok();
}

int sf_cli_finish(const sf_cli *cli, sf_status status)
{
  if (fflush(stdout) || ferror(stdout)) {
    if (status.code == SF_OK) status = sf_fail(SF_E_IO, "cannot write the standard output: %s", strerror(errno));
  }
  if (status.code == SF_OK) return 0;
  if (status.code == SF_E_USAGE)
    fprintf(stderr, "%s: %s (see %s --help)\n", cli->program, status.message, cli->program);
  else
    fprintf(stderr, "%s: %s\n", cli->program, status.message);
  if (status.code == SF_E_USAGE) return 2;
  return status.code == SF_E_STOPPED ? 130 : 1;
}

void sf_cli_put_word(FILE *out, const char *word)
{
  const bool plain = *word && !word[strcspn(word, " \t\n\"'\\$`!*?[](){}<>|&;#~")];
  if (!plain) fputc('\'', out);
  for (; *word; word++) fputs(!plain && *word == '\'' ? "'\\''" : (char[]){*word, 0}, out);
  if (!plain) fputc('\'', out);
}
