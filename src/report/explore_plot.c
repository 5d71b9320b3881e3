/* Gnuplot script of builds: energy of a frame over its time. */
#include "report/plot.h"
#include "base/io.h"
#include "cycles/explore.h"

static void put_points(FILE *out, const char *block, const sf_explore *e, double clock_mhz, bool front)
{
  fprintf(out, "$%s << EOD\n", block);
  for (int i = 0; i < e->count; i++)
    if (e->point[i].front || !front)
      fprintf(out, "%.6g %.6g\n", e->point[i].cycles / clock_mhz / 1e3, e->point[i].energy_mj);
  fprintf(out, "EOD\n");
}

static void put_one(FILE *out, const char *block, const sf_explored *p, double clock_mhz)
{
  fprintf(out, "$%s << EOD\n%.6g %.6g\nEOD\n", block, p->cycles / clock_mhz / 1e3, p->energy_mj);
}

sf_status sf_plot_explored(const char *path, const sf_explore *e, double clock_mhz)
{
  char name[256], x[100];
  sf_writer writer;
  SF_TRY(sf_plot_name(path, name));
  SF_TRY(sf_writer_open(&writer, path));
  FILE *out = writer.file;
  snprintf(x, sizeof x, "ms per frame at %.0f MHz (cycle model)", clock_mhz);
  sf_plot_head(out, name, "Builds of the accelerator: time and energy of a frame", x,
               "mJ per frame, everything counted", "outside right top");
  fprintf(out, "set logscale xy 2\n");
  put_points(out, "builds", e, clock_mhz, false);
  put_points(out, "front", e, clock_mhz, true);
  put_one(out, "built", &e->point[e->built], clock_mhz);
  put_one(out, "board", &e->point[e->board], clock_mhz);
  fprintf(
      out,
      "plot $builds using 1:2 with points linecolor '#bbbbbb' pointtype 7 pointsize 0.4 title 'builds', "
      "$front using 1:2 with linespoints linecolor '%s' linewidth 2 pointtype 7 pointsize 0.9 title 'Pareto front', "
      "$built using 1:2 with points linecolor '%s' pointtype 6 pointsize 2 linewidth 2 title 'this build', "
      "$board using 1:2 with points linecolor '%s' pointtype 4 pointsize 2 linewidth 2 title 'the board'\n",
      sf_plot_colour[0], sf_plot_colour[1], sf_plot_colour[2]);
  SF_TRY(sf_writer_commit(&writer));
  fprintf(stderr, "wrote %s; gnuplot makes %s.svg of it\n", path, name);
  return sf_ok();
}
