/* How every gnuplot script begins. */
#include "report/plot.h"

const char *const sf_plot_colour[SF_PLOT_COLOURS] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                     "#56b4e9", "#e69f00", "#000000"};

void sf_plot_quote(char *to, size_t size, const char *from)
{
  snprintf(to, size, "%s", from);
  for (char *c = to; *c; c++)
    if (*c == '\'' || *c == '\n' || *c == '\\') *c = '_';
}

void sf_plot_head(FILE *out, const char *name, const char *title, const char *x, const char *y, const char *key)
{
  fprintf(out,
          "# gnuplot %s.gp writes %s.svg\n"
          "set terminal svg size 1060,600 noenhanced background '#ffffff' font 'DejaVu Sans,15' linewidth 1.5\n"
          "set output '%s.svg'\n"
          "set encoding utf8\n"
          "set title '%s'\nset xlabel '%s'\nset ylabel '%s'\n"
          "set key %s\nset grid linecolor '#dddddd' linetype 1\nset border 3\nset tics nomirror\n",
          name, name, name, title, x, y, key);
}
