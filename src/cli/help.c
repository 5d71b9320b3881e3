/* --help: options in groups, a text's lines within 80 columns. */
#include "cli/cli.h"
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum { LEFT = 28, WIDTH = 80, COLUMN = 9 /* of a default */, DEFAULTS = 2 };

/* The text up to its first tab. The defaults follow the tab. */
static int words_of(const char *text)
{
  return (int)strcspn(text, "\t");
}

static bool has_defaults(const sf_option *first)
{
  for (const sf_option *o = first; o->name && o->type != SF_ARG_GROUP; o++)
    if (o->help && strchr(o->help, '\t')) return true;
  return false;
}

/* The default of a number. */
static void print_value(const sf_option *o)
{
  switch (o->type) {
  case SF_ARG_INT:
    printf("%*d", COLUMN, *(const int *)o->value);
    break;
  case SF_ARG_U64:
    printf("%*llu", COLUMN, (unsigned long long)*(const uint64_t *)o->value);
    break;
  case SF_ARG_DOUBLE:
    printf("%*g", COLUMN, *(const double *)o->value);
    break;
  default:
    printf("%*s", COLUMN, "?");
  }
}

/* of: each column's list, from the option on whose defaults are printed; NULL: a heading. */
static void print_defaults(const char *text, const sf_option *const of[DEFAULTS])
{
  for (int i = 0; i < DEFAULTS; i++) {
    const char *tab = strchr(text, '\t');
    text = tab ? tab + 1 : text; /* one stands for both */
    if (of && words_of(text) == 1 && *text == '#')
      print_value(of[i]);
    else
      printf("%*.*s", COLUMN, words_of(text), text);
  }
}

/* Prints words in lines of `room` from column LEFT on, where the cursor is. The defaults end the first line. */
static void print_text(const char *text, const sf_option *const of[DEFAULTS], int room)
{
  const char *end = text + words_of(text);
  for (bool first = true; first || text < end; first = false) {
    int n = (int)(end - text), cut = n;
    if (n > room) {
      for (cut = room; cut > 0 && text[cut] != ' ';) cut--;
      n = cut = cut ? cut : room;
    }
    if (!first) printf("%*s", LEFT, "");
    printf("%.*s", n, text);
    if (first && *end) printf("%*s", room - n, ""), print_defaults(end, of);
    putchar('\n');
    for (text += cut; text < end && *text == ' ';) text++;
  }
}

static void print_option(char letter, const char *name, const char *argument, const char *help,
                         const sf_option *const of[DEFAULTS], int room)
{
  char left[80];
  int n =
      letter ? snprintf(left, sizeof left, "  -%c, %s", letter, name) : snprintf(left, sizeof left, "      %s", name);
  if (argument && n < (int)sizeof left) n += snprintf(left + n, sizeof left - (size_t)n, " %s", argument);
  if (n < LEFT)
    printf("%-*s", LEFT, left);
  else
    printf("%s\n%*s", left, LEFT, "");
  print_text(help, of, room);
}

static void print_one(const sf_cli *cli, const sf_option *o, int room)
{
  const ptrdiff_t at = o - cli->options;
  const sf_option *const of[DEFAULTS] = {cli->defaults ? cli->defaults[0] + at : o,
                                         cli->defaults ? cli->defaults[1] + at : o};
  const char *argument = o->type == SF_ARG_FLAG ? NULL : o->argument ? o->argument : o->choices ? o->choices : "VALUE";
  print_option(o->letter, o->name, argument, o->help ? o->help : "", of, room);
  if (o->type == SF_ARG_CHOICE && o->argument && o->choices) printf("%*s%s\n", LEFT, "", o->choices);
}

static void print_heading(const sf_cli *cli, const char *title, bool defaults)
{
  if (!defaults || !cli->columns) {
    printf("\n%s:\n", title);
    return;
  }
  printf("\n%s:%*s", title, WIDTH - DEFAULTS * COLUMN - (int)strlen(title) - 1, "");
  print_defaults(cli->columns, NULL);
  putchar('\n');
}

void sf_cli_help(const sf_cli *cli)
{
  bool groups = false;
  int room = WIDTH - LEFT;
  printf("Usage: %s\n", cli->usage ? cli->usage : cli->program);
  if (cli->summary) printf("\n%s\n", cli->summary);
  if (!cli->options || cli->options->type != SF_ARG_GROUP) printf("\nOptions:\n");
  for (const sf_option *o = cli->options; o && o->name; o++) {
    if (o->type != SF_ARG_GROUP) {
      print_one(cli, o, room);
      continue;
    }
    const bool defaults = has_defaults(o + 1);
    print_heading(cli, o->name, defaults);
    room = WIDTH - LEFT - (defaults ? DEFAULTS * COLUMN : 0);
    groups = true;
  }
  if (groups) printf("\nHelp:\n");
  print_option('h', "--help", NULL, "show this text", NULL, WIDTH - LEFT);
  print_option(0, "--version", NULL, "show the version", NULL, WIDTH - LEFT);
  if (cli->examples)
    printf("\nExamples:\n%s%s", cli->examples, cli->examples[strlen(cli->examples) - 1] == '\n' ? "" : "\n");
}
