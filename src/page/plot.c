/* Values over one axis, row below row. */
#include "page/draw.h"
#include <math.h>

enum { WIDTH = 480, LEFT = 10, RIGHT = WIDTH - 10, ROW = 74, PLOT = 46, FOOT = 36 };

static double place(const html_axis *axis, int i)
{
  const double first = axis->x[0], span = axis->x[axis->n - 1] - first;
  return span > 0 ? LEFT + (RIGHT - LEFT) * (axis->x[i] - first) / span : (LEFT + RIGHT) / 2.0;
}

static void range_of(const html_row *row, int n, double *low, double *high)
{
  *low = row->low, *high = row->high;
  if (*low != *high) return;
  *low = *high = 0;
  for (int i = 0; i < n; i++)
    if (!isnan(row->y[i])) *low = fmin(*low, row->y[i]), *high = fmax(*high, row->y[i]);
  if (*low == *high) *high = *low + 1;
}

static double height(double value, double low, double high, double foot)
{
  return foot - PLOT * (fmax(low, fmin(high, value)) - low) / (high - low);
}

static void put_line(FILE *out, const html_axis *axis, const html_row *row, double low, double high, double foot)
{
  bool down = false;
  fprintf(out, "<path class=\"curve %s\" d=\"", row->style);
  for (int i = 0; i < axis->n; i++) {
    if (isnan(row->y[i])) {
      down = false;
      continue;
    }
    fprintf(out, "%c%.1f %.1f", down ? 'L' : 'M', place(axis, i), height(row->y[i], low, high, foot));
    down = true;
  }
  fprintf(out, "\"/>\n");
}

static void put_bars(FILE *out, const html_axis *axis, const html_row *row, double low, double high, double foot)
{
  const double zero = height(0, low, high, foot), room = (RIGHT - LEFT) / (double)(axis->n > 1 ? axis->n - 1 : 1);
  const double width = fmax(0.8, fmin(12, 0.7 * room));
  fprintf(out, "<path class=\"columns %s\" stroke-width=\"%.1f\" d=\"", row->style, width);
  for (int i = 0; i < axis->n; i++)
    if (!isnan(row->y[i]) && row->y[i] != 0)
      fprintf(out, "M%.1f %.1fV%.1f", place(axis, i), zero, height(row->y[i], low, high, foot));
  fprintf(out, "\"/>\n");
}

static void put_row(FILE *out, const html_axis *axis, const html_row *row, int top)
{
  const double foot = top + 22 + PLOT;
  double low, high;
  range_of(row, axis->n, &low, &high);
  svg_text(out, 0, top + 14, "lab", "%s", row->title);
  svg_text(out, WIDTH, top + 14, "num mut end", low < 0 ? "%.3g to %.3g %s" : "%.0g to %.4g %s", low, high, row->unit);
  svg_line(out, LEFT, height(0, low, high, foot), RIGHT, height(0, low, high, foot), "ax");
  if (axis->mark >= 0 && axis->mark < axis->n)
    svg_line(out, place(axis, axis->mark), top + 20, place(axis, axis->mark), foot, "mark");
  if (row->bars)
    put_bars(out, axis, row, low, high, foot);
  else
    put_line(out, axis, row, low, high, foot);
}

void html_rows(FILE *out, const char *id, const char *title, const html_axis *axis, const html_row *row, int rows)
{
  const int foot = ROW * rows;
  svg_begin(out, id, WIDTH, foot + FOOT, title, axis->title);
  for (int i = 0; i < rows && axis->n > 0; i++) put_row(out, axis, &row[i], ROW * i);
  if (axis->n > 0) {
    svg_text(out, 0, foot + 16, "num mut", "%.4g", axis->x[0]);
    svg_text(out, WIDTH, foot + 16, "num mut end", "%.4g", axis->x[axis->n - 1]);
  }
  svg_text(out, (LEFT + RIGHT) / 2.0, foot + 16, "mut mid", "%s", axis->title);
  svg_end(out);
}
