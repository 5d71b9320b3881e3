/* The completion of a program's command line for bash, from the table that parses it. */
#include "cli/cli.h"
#include "spikefield/spikefield.h"
#include <stdio.h>
#include <string.h>

typedef enum { NOTHING, WORDS, FILES } offer;

/* What is offered after the option: a choice has its words, a number has none. */
static offer offer_of(const sf_option *o)
{
  switch (o->type) {
  case SF_ARG_CHOICE:
    return WORDS;
  case SF_ARG_INPUT:
  case SF_ARG_OUTPUT:
  case SF_ARG_PLACE:
    return FILES;
  case SF_ARG_STRING:
    return o->argument && strstr(o->argument, "FILE") ? FILES : NOTHING;
  default:
    return NOTHING;
  }
}

static bool takes_value(const sf_option *o)
{
  return o->type != SF_ARG_FLAG && !strncmp(o->name, "--", 2);
}

static void print_choices(const char *choices)
{
  for (const char *c = choices; *c; c++) putchar(*c == '|' ? ' ' : *c);
}

/* "    --net) words='snn ann' ;;" */
static void print_case(const sf_option *o)
{
  printf("  ");
  if (o->letter) printf("-%c | ", o->letter);
  printf("%s) ", o->name);
  switch (offer_of(o)) {
  case WORDS:
    printf("words='");
    print_choices(o->choices);
    printf("' ;;\n");
    break;
  case FILES:
    printf("files=yes ;;\n");
    break;
  case NOTHING:
    printf("return ;;\n");
  }
}

static void print_names(const sf_cli *cli)
{
  for (const sf_option *o = cli->options; o && o->name; o++) {
    if (strncmp(o->name, "--", 2) != 0) continue;
    if (o->letter) printf("-%c ", o->letter);
    printf("%s ", o->name);
  }
  printf("-h --help --version");
}

static bool lists_words(const sf_cli *cli)
{
  for (const sf_option *o = cli->options; o && o->name; o++)
    if (!strcmp(o->name, "--list")) return cli->words;
  return false;
}

void sf_cli_print_completion(const sf_cli *cli)
{
  const char *p = cli->program;
  printf("# Completion of %s %s for bash, as %s --completion prints it.\n", p, SPIKEFIELD_VERSION, p);
  printf("_spikefield_%s()\n{\n", p);
  printf("  local word=${COMP_WORDS[COMP_CWORD]} option=${COMP_WORDS[COMP_CWORD - 1]} files=no words=\n"
         "  [[ $option != = ]] || option=${COMP_WORDS[COMP_CWORD - 2]}\n"
         "  [[ $word != = ]] || word=\n"
         "  case $option in\n");
  for (const sf_option *o = cli->options; o && o->name; o++)
    if (takes_value(o)) print_case(o);
  printf("  *) if [[ $word == -* ]]; then words='");
  print_names(cli);
  if (lists_words(cli))
    printf("'; else words=$(\"$1\" --list 2>/dev/null); fi ;;\n");
  else
    printf("'; else files=yes; fi ;;\n");
  printf("  esac\n"
         "  if [[ $files == yes ]]; then\n"
         "    compopt -o filenames 2>/dev/null\n"
         "    mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
         "  else\n"
         "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")\n"
         "  fi\n}\ncomplete -F _spikefield_%s %s\n",
         p, p);
}
