/* The golden image and, beside it, what each of its pixels cost. */
#include "page/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { HEAT = HTML_HEAT }; /* index 0: no samples */

/* viridis (van der Walt and Smith, 2015, CC0) at ten equal distances: monotone in lightness, safe for the colour-blind.
 */
static const uint8_t viridis[10][3] = {{68, 1, 84},    {72, 40, 120},  {62, 74, 137},  {49, 104, 142}, {38, 130, 142},
                                       {31, 158, 137}, {53, 183, 121}, {109, 205, 89}, {180, 222, 44}, {253, 231, 37}};

static void heat_colour(double x, uint8_t rgb[3])
{
  const double at = 9 * (x < 0 ? 0 : x > 1 ? 1 : x);
  const int i = at >= 9 ? 8 : (int)at;
  for (int c = 0; c < 3; c++) rgb[c] = (uint8_t)(viridis[i][c] + (at - i) * (viridis[i + 1][c] - viridis[i][c]) + 0.5);
}

void html_heat_palette(uint8_t palette[4 * (HEAT + 1)], int colours)
{
  memset(palette, 0, 4);
  for (int i = 1; i <= colours; i++) {
    heat_colour(colours > 1 ? (i - 1) / (double)(colours - 1) : 0.5, palette + 4 * i);
    palette[4 * i + 3] = 255;
  }
}

double html_samples(const sf_golden *g, size_t i)
{
  return sf_golden_int(g, SF_PLANE_SAMPLES)[i];
}

double html_sample_fj(const sf_golden *g, size_t i)
{
  const double samples = html_samples(g, i);
  return samples > 0 ? (double)sf_golden_real(g, SF_PLANE_ENERGY)[i] / samples : 0;
}

/* Colours from low to high; none where the pixel has no samples. */
static sf_status heat_map(FILE *out, const sf_golden *g, html_pixel *value, double low, double high, const char *alt)
{
  const size_t n = (size_t)g->width * (size_t)g->height;
  uint8_t palette[4 * (HEAT + 1)], *index = malloc(n);
  if (!index) return sf_fail(SF_E_MEMORY, "no memory for a picture of %d x %d pixels", g->width, g->height);
  html_heat_palette(palette, HEAT);
  for (size_t i = 0; i < n; i++) {
    const double x = high > low ? (value(g, i) - low) / (high - low) : 1;
    index[i] = html_samples(g, i) > 0 ? (uint8_t)(1 + (int)((HEAT - 1) * fmax(0, fmin(x, 1)) + 0.5)) : 0;
  }
  const sf_status status = html_put_png(out, index, g->width, g->height, palette, HEAT + 1, alt);
  free(index);
  return status;
}

enum { BAR_WIDTH = 480, X0 = 10, X1 = BAR_WIDTH - 10, END = 100, BEGIN = 60 }; /* room of the labels at the ends */

/* The ends of the scale, the unit with the upper one; round numbers between them. */
static void bar_labels(FILE *out, double low, double high, const char *unit)
{
  const double span = high - low, step = svg_tick(span, 5), first = low > 0 ? X0 + BEGIN : X0;
  if (low > 0) {
    svg_line(out, X0, 16, X0, 21, "ax");
    svg_text(out, 0, 36, "num", "%.4g", low);
  }
  for (double v = ceil(low / step) * step; span > 0 && X0 + (X1 - X0) * (v - low) / span < X1 - END; v += step) {
    const double x = X0 + (X1 - X0) * (v - low) / span;
    if (x < first) continue;
    svg_line(out, x, 16, x, 21, "ax");
    svg_text(out, x, 36, "num mid", "%.4g", v);
  }
  svg_line(out, X1, 16, X1, 21, "ax");
  svg_text(out, BAR_WIDTH, 36, "num end", "%.4g %s", high, unit);
}

void html_colour_bar(FILE *out, const char *id, double low, double high, const char *unit)
{
  char title[160];
  snprintf(title, sizeof title, "Colour scale from %.4g to %.4g %s", low, high, unit);
  svg_begin(out, id, BAR_WIDTH, 42, title, title);
  fprintf(out, "<defs><linearGradient id=\"%s-g\">", id);
  for (int i = 0; i < 10; i++)
    fprintf(out, "<stop offset=\"%.4f\" stop-color=\"#%02x%02x%02x\"/>", i / 9.0, viridis[i][0], viridis[i][1],
            viridis[i][2]);
  fprintf(out, "</linearGradient></defs>\n<rect x=\"%d\" y=\"4\" width=\"%d\" height=\"12\" fill=\"url(#%s-g)\"/>\n",
          X0, X1 - X0, id);
  bar_labels(out, low, high, unit);
  svg_end(out);
}

/* ---- the four pictures ---- */

HTML_FUNCTION(golden_picture)
{
  const sf_page *page = ((const html_view *)user)->page;
  const sf_golden *g = &page->golden;
  const size_t n = (size_t)g->width * (size_t)g->height;
  uint8_t *rgb = malloc(3 * n);
  (void)value;
  if (!rgb) return sf_fail(SF_E_MEMORY, "no memory for a picture of %d x %d pixels", g->width, g->height);
  for (size_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++)
      rgb[3 * i + (size_t)c] = (uint8_t)((sf_golden_int(g, SF_PLANE_FX_R + c)[i] * 255u + 32767u) / 65535u);
  const sf_status status =
      html_put_png(out, rgb, g->width, g->height, NULL, 0, "The view as the fixed-point core renders it");
  if (page->ray.samples > 0)
    fprintf(out,
            "<svg class=\"over\" viewBox=\"0 0 %d %d\" aria-hidden=\"true\"><circle cx=\"%g\" cy=\"%g\" r=\"%g\" "
            "class=\"halo\"/><circle cx=\"%g\" cy=\"%g\" r=\"%g\" class=\"ring\"/></svg>",
            g->width, g->height, page->ray.x + 0.5, page->ray.y + 0.5, g->width * 0.02, page->ray.x + 0.5,
            page->ray.y + 0.5, g->width * 0.02);
  free(rgb);
  return status;
}

HTML_FUNCTION(energy_map)
{
  html_view *v = user;
  (void)value;
  return heat_map(out, &v->page->golden, html_sample_fj, html_real(v, "page.energy_per_sample.least_fj"),
                  html_real(v, "page.energy_per_sample.most_fj"), "Heat map of the energy per sample of every pixel");
}

HTML_FUNCTION(energy_scale)
{
  html_view *v = user;
  double scale;
  const double low = html_real(v, "page.energy_per_sample.least_fj"),
               high = html_real(v, "page.energy_per_sample.most_fj");
  const char *unit = html_unit(high, &scale);
  (void)value;
  html_colour_bar(out, "svg-energy-scale", low / scale, high / scale, unit);
  return v->status;
}

HTML_FUNCTION(samples_map)
{
  html_view *v = user;
  (void)value;
  return heat_map(out, &v->page->golden, html_samples, 0, html_real(v, "page.samples_per_pixel.most"),
                  "Heat map of the samples of every pixel");
}

HTML_FUNCTION(samples_scale)
{
  html_view *v = user;
  (void)value;
  html_colour_bar(out, "svg-samples-scale", 0, html_real(v, "page.samples_per_pixel.most"), "samples");
  return v->status;
}

HTML_FUNCTION(steps_map)
{
  const sf_page *page = ((const html_view *)user)->page;
  uint8_t palette[4 * (HEAT + 1)];
  (void)value;
  html_heat_palette(palette, SF_T_MAX);
  return html_put_png(out, page->steps, page->golden.width, page->golden.height, palette, SF_T_MAX + 1,
                      "Map of the number of time steps that every pixel needs");
}

HTML_FUNCTION(steps_scale)
{
  enum { CELL = 60 };
  html_view *v = user;
  double hits = 0;
  (void)value;
  for (int t = 1; t <= SF_T_MAX; t++) hits += html_real(v, "page.steps_needed[%d]", t);
  svg_begin(out, "svg-steps-scale", 480, 50, "Colours of the steps", "Share of the pixels that need t steps");
  for (int t = 1; t <= SF_T_MAX; t++) {
    uint8_t rgb[3];
    heat_colour((t - 1) / (double)(SF_T_MAX - 1), rgb);
    fprintf(out, "<rect x=\"%d\" y=\"4\" width=\"%d\" height=\"12\" fill=\"#%02x%02x%02x\"/>\n", (t - 1) * CELL,
            CELL - 2, rgb[0], rgb[1], rgb[2]);
    svg_text(out, (t - 0.5) * CELL - 1, 32, "num mid", t == 1 ? "t = %d" : "%d", t);
    const double percent = hits > 0 ? 100.0 * html_real(v, "page.steps_needed[%d]", t) / hits : 0;
    svg_text(out, (t - 0.5) * CELL - 1, 48, "num mid mut", percent < 9.95 ? "%.1f %%" : "%.0f %%", percent);
  }
  svg_end(out);
  return v->status;
}
