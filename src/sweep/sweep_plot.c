/* Gnuplot scripts of a sweep, with their data inside. */
#include "report/plot.h"
#include "base/io.h"
#include "sweep/sweep.h"
#include <math.h>

/* ---- PSNR against float along every width ---- */

static bool along(const sf_sweep *sweep, const sf_point *point, int axis)
{
  return sf_point_on_axis(sweep, point, axis) && !isnan(point->figure[SF_POINT_PSNR_FLOAT]);
}

static void plot_widths(FILE *out, const sf_sweep *sweep, const char *name)
{
  int shown[SF_AXES] = {0}, lines = 0;
  sf_plot_head(out, name, "Picture quality and width, one parameter at a time", "bits", "PSNR against float, dB",
               "outside right top");
  fprintf(out, "set xtics 1\n");
  for (int axis = 0; axis < SF_AXIS_TABLE; axis++) {
    fprintf(out, "$axis%d << EOD\n", axis);
    for (int i = 0; i < sweep->count; i++)
      if (along(sweep, &sweep->point[i], axis))
        fprintf(out, "%d %.6g\n", sweep->point[i].axis[axis], sweep->point[i].figure[SF_POINT_PSNR_FLOAT]),
            shown[axis]++;
    fprintf(out, "EOD\n");
  }
  const double centre = sweep->centre->figure[SF_POINT_PSNR_FLOAT];
  bool any = !isnan(centre); /* else equal to float: no line */
  for (int axis = 0; axis < SF_AXIS_TABLE; axis++) any |= shown[axis] > 1;
  fputs(any ? "plot " : "set xrange [0:1]\nset yrange [0:1]\nplot ", out);
  for (int axis = 0; axis < SF_AXIS_TABLE; axis++)
    if (shown[axis] > 1)
      fprintf(out,
              "$axis%d using 1:2 smooth unique with linespoints linecolor '%s' linewidth 2 pointtype 7 pointsize 0.7 "
              "title '%s', ",
              axis, sf_plot_colour[lines++ % SF_PLOT_COLOURS], sf_axes[axis].title[sweep->centre->backbone]);
  if (isnan(centre))
    fprintf(out, "NaN notitle\n");
  else
    fprintf(out, "%.6g with lines linecolor '#999999' dashtype 2 title 'centre'\n", centre);
}

/* ---- PSNR against one cost ---- */

static bool beaten(const sf_sweep *sweep, const sf_point *point, int cost)
{
  for (int i = 0; i < sweep->count; i++)
    if (sf_point_beats(&sweep->point[i], point, &cost, 1)) return true;
  return false;
}

static void write_points(FILE *out, const sf_sweep *sweep, const char *block, int cost, bool front)
{
  fprintf(out, "$%s << EOD\n", block);
  for (int i = 0; i < sweep->count; i++) {
    const sf_point *p = &sweep->point[i];
    char name[128];
    if (isnan(p->figure[SF_POINT_PSNR_TRUTH]) || beaten(sweep, p, cost) == front) continue;
    sf_point_short_name(sweep, p, name, sizeof name);
    fprintf(out, "%.6g %.6g \"%s\"\n", p->figure[cost], p->figure[SF_POINT_PSNR_TRUTH], name);
  }
  fprintf(out, "EOD\n");
}

/* The window of the front and the centre: points far behind them would flatten it. */
static void frame_front(FILE *out, const sf_sweep *sweep, int cost)
{
  const double *centre = sweep->centre->figure;
  double low = centre[SF_POINT_PSNR_TRUTH], high = low, most = centre[cost];
  for (int i = 0; i < sweep->count; i++) {
    const double *figure = sweep->point[i].figure;
    if (isnan(figure[SF_POINT_PSNR_TRUTH]) || beaten(sweep, &sweep->point[i], cost)) continue;
    low = fmin(low, figure[SF_POINT_PSNR_TRUTH]), high = fmax(high, figure[SF_POINT_PSNR_TRUTH]);
    most = fmax(most, figure[cost]);
  }
  fprintf(out, "set xrange [0:%.6g]\nset yrange [%.6g:%.6g]\nset format x '%%.1s%%c'\n", 1.1 * most, low - 0.3,
          high + 0.5 + 0.2 * (high - low));
}

static void plot_cost(FILE *out, const sf_sweep *sweep, const char *name, int cost)
{
  sf_plot_head(out, name, "Picture quality and cost", sf_point_figures[cost].title,
               sf_point_figures[SF_POINT_PSNR_TRUTH].title, "right bottom");
  frame_front(out, sweep, cost);
  write_points(out, sweep, "others", cost, false);
  write_points(out, sweep, "front", cost, true);
  fprintf(out,
          "$centre << EOD\n%.6g %.6g\nEOD\n"
          "plot $others using 1:2 with points linecolor '#bbbbbb' pointtype 7 pointsize 0.5 title 'beaten', "
          "$front using 1:2 smooth unique with linespoints linecolor '%s' linewidth 2 pointtype 7 pointsize 0.9 title "
          "'front', $front using 1:2:3 with labels rotate by 60 left offset 0.3,0.4 font ',10' notitle, "
          "$centre using 1:2 with points linecolor '%s' pointtype 6 pointsize 2 title 'centre'\n",
          sweep->centre->figure[cost], sweep->centre->figure[SF_POINT_PSNR_TRUTH], sf_plot_colour[0],
          sf_plot_colour[1]);
}

static void plot_energy(FILE *out, const sf_sweep *sweep, const char *name)
{
  plot_cost(out, sweep, name, SF_POINT_ENERGY);
}
static void plot_bytes(FILE *out, const sf_sweep *sweep, const char *name)
{
  plot_cost(out, sweep, name, SF_POINT_BYTES);
}
static void plot_traffic(FILE *out, const sf_sweep *sweep, const char *name)
{
  plot_cost(out, sweep, name, SF_POINT_TRAFFIC);
}

static const struct {
  const char *name;
  void (*write)(FILE *out, const sf_sweep *sweep, const char *name);
} plots[] = {{"widths", plot_widths},
             {"front-energy", plot_energy},
             {"front-bytes", plot_bytes},
             {"front-traffic", plot_traffic}};

sf_status sf_sweep_plots(const sf_sweep *sweep, int *count)
{
  char path[sizeof sweep->dir + 64];
  snprintf(path, sizeof path, "%s/plots", sweep->dir);
  SF_TRY(sf_make_dir(path));
  for (*count = 0; *count < (int)(sizeof plots / sizeof *plots); ++*count) {
    sf_writer writer;
    snprintf(path, sizeof path, "%s/plots/%s.gp", sweep->dir, plots[*count].name);
    SF_TRY(sf_writer_open(&writer, path));
    plots[*count].write(writer.file, sweep, plots[*count].name);
    SF_TRY(sf_writer_commit(&writer));
  }
  return sf_ok();
}
