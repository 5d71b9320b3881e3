/* The golden image and, beside it, what each of its pixels cost. */
#include "page/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { HEAT = 255 }; /* colours of a heat map; index 0 is transparent: no samples */

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

static void heat_palette(uint8_t palette[4 * (HEAT + 1)], int colours)
{
  memset(palette, 0, 4);
  for (int i = 1; i <= colours; i++) {
    heat_colour(colours > 1 ? (i - 1) / (double)(colours - 1) : 0.5, palette + 4 * i);
    palette[4 * i + 3] = 255;
  }
}

static double plane_value(const sf_golden *g, sf_plane plane, size_t i)
{
  return sf_plane_is_integer(plane) ? sf_golden_int(g, plane)[i] : (double)sf_golden_real(g, plane)[i];
}

static sf_status heat_map(FILE *out, const sf_golden *g, sf_plane plane, double top, const char *alt)
{
  const size_t n = (size_t)g->width * (size_t)g->height;
  uint8_t palette[4 * (HEAT + 1)], *index = malloc(n);
  if (!index) return sf_fail(SF_E_MEMORY, "no memory for a picture of %d x %d pixels", g->width, g->height);
  heat_palette(palette, HEAT);
  for (size_t i = 0; i < n; i++) {
    const double x = top > 0 ? plane_value(g, plane, i) / top : 0;
    index[i] = x > 0 ? (uint8_t)(1 + (int)((HEAT - 1) * (x < 1 ? x : 1) + 0.5)) : 0;
  }
  const sf_status status = html_put_png(out, index, g->width, g->height, palette, HEAT + 1, alt);
  free(index);
  return status;
}

/* Bar below a heat map. unit: what one of `value` is; values are multiples of `scale`. */
static void colour_bar(FILE *out, const char *id, double top, double scale, const char *unit)
{
  enum { WIDTH = 480, X0 = 10, X1 = WIDTH - 10 };
  const double shown = top / scale, step = svg_tick(shown, 5);
  char title[160];
  snprintf(title, sizeof title, "Colour scale from 0 to %.4g %s", shown, unit);
  svg_begin(out, id, WIDTH, 42, title, title);
  fprintf(out, "<defs><linearGradient id=\"%s-g\">", id);
  for (int i = 0; i < 10; i++)
    fprintf(out, "<stop offset=\"%.4f\" stop-color=\"#%02x%02x%02x\"/>", i / 9.0, viridis[i][0], viridis[i][1],
            viridis[i][2]);
  fprintf(out, "</linearGradient></defs>\n<rect x=\"%d\" y=\"4\" width=\"%d\" height=\"12\" fill=\"url(#%s-g)\"/>\n",
          X0, X1 - X0, id);
  /* Round numbers, then the largest value with the unit at the end. */
  for (double v = 0; X0 + (X1 - X0) * v / shown < X1 - 100; v += step) {
    const double x = X0 + (X1 - X0) * v / shown;
    svg_line(out, x, 16, x, 21, "ax");
    svg_text(out, x, 36, "num mid", "%.4g", v);
  }
  svg_line(out, X1, 16, X1, 21, "ax");
  svg_text(out, WIDTH, 36, "num end", "%.4g %s", shown, unit);
  svg_end(out);
}

static double plane_top(const sf_golden *g, sf_plane plane, double *mean)
{
  const size_t n = (size_t)g->width * (size_t)g->height;
  double top = 0, sum = 0;
  size_t hits = 0;
  for (size_t i = 0; i < n; i++) {
    const double x = plane_value(g, plane, i);
    top = x > top ? x : top, sum += x, hits += x > 0;
  }
  *mean = hits ? sum / (double)hits : 0;
  return top;
}

/* ---- the four pictures ---- */

static sf_status golden_picture(FILE *out, const sf_page *page)
{
  const sf_golden *g = &page->golden;
  const size_t n = (size_t)g->width * (size_t)g->height;
  uint8_t *rgb = malloc(3 * n);
  if (!rgb) return sf_fail(SF_E_MEMORY, "no memory for a picture of %d x %d pixels", g->width, g->height);
  for (size_t i = 0; i < n; i++)
    for (int c = 0; c < 3; c++)
      rgb[3 * i + (size_t)c] = (uint8_t)((sf_golden_int(g, SF_PLANE_FX_R + c)[i] * 255u + 32767u) / 65535u);
  html_figure_begin(out, "fig-golden", "", "Golden image.",
                    "What the fixed-point core computes, bit for bit what the accelerator computes. The ring marks "
                    "the ray whose spikes are shown below.");
  fprintf(out, "<div class=\"plate\">");
  const sf_status status =
      html_put_png(out, rgb, g->width, g->height, NULL, 0, "The view as the fixed-point core renders it");
  if (page->ray.samples > 0)
    fprintf(out,
            "<svg class=\"over\" viewBox=\"0 0 %d %d\" aria-hidden=\"true\"><circle cx=\"%g\" cy=\"%g\" r=\"%g\" "
            "class=\"halo\"/><circle cx=\"%g\" cy=\"%g\" r=\"%g\" class=\"ring\"/></svg>",
            g->width, g->height, page->ray.x + 0.5, page->ray.y + 0.5, g->width * 0.02, page->ray.x + 0.5,
            page->ray.y + 0.5, g->width * 0.02);
  fprintf(out, "</div>\n");
  html_figure_end(out);
  free(rgb);
  return status;
}

static sf_status energy_picture(FILE *out, const sf_page *page)
{
  static const char *const unit[] = {"fJ", "pJ", "nJ", "\xc2\xb5J", "mJ"};
  double mean, scale = 1;
  const double top = plane_top(&page->golden, SF_PLANE_ENERGY, &mean);
  int u = 0;
  char caption[300], a[HTML_NUMBER], b[HTML_NUMBER];
  for (; u < 4 && top / scale >= 1000; u++) scale *= 1000;
  snprintf(caption, sizeof caption,
           "Paper ledger. %s at most, %s on average where there are samples; nothing where the ray meets only empty "
           "space (grey).",
           html_energy(a, top), html_energy(b, mean));
  html_figure_begin(out, "fig-energy-map", "", "Energy per pixel.", caption);
  fprintf(out, "<div class=\"plate\">");
  SF_TRY(heat_map(out, &page->golden, SF_PLANE_ENERGY, top, "Heat map of the energy of every pixel"));
  fprintf(out, "</div>\n");
  if (top > 0) colour_bar(out, "svg-energy-scale", top, scale, unit[u]);
  html_figure_end(out);
  return sf_ok();
}

static sf_status samples_picture(FILE *out, const sf_page *page)
{
  double mean;
  const double top = plane_top(&page->golden, SF_PLANE_SAMPLES, &mean);
  char caption[400];
  snprintf(
      caption, sizeof caption,
      "Points at which the network was asked: %.0f at most, %.1f on average where there are any (grey: none). Specks "
      "beside the scene are samples in empty space that the occupancy grid takes for occupied.",
      top, mean);
  html_figure_begin(out, "fig-samples-map", "", "Samples per pixel.", caption);
  fprintf(out, "<div class=\"plate\">");
  SF_TRY(heat_map(out, &page->golden, SF_PLANE_SAMPLES, top, "Heat map of the samples of every pixel"));
  fprintf(out, "</div>\n");
  if (top > 0) colour_bar(out, "svg-samples-scale", top, 1, "samples");
  html_figure_end(out);
  return sf_ok();
}

static void step_legend(FILE *out, const uint64_t of[SF_T_MAX + 1])
{
  enum { CELL = 60 };
  uint64_t hits = 0;
  for (int t = 1; t <= SF_T_MAX; t++) hits += of[t];
  svg_begin(out, "svg-steps-scale", 480, 50, "Colours of the steps", "Share of the pixels that need t steps");
  for (int t = 1; t <= SF_T_MAX; t++) {
    uint8_t rgb[3];
    heat_colour((t - 1) / (double)(SF_T_MAX - 1), rgb);
    fprintf(out, "<rect x=\"%d\" y=\"4\" width=\"%d\" height=\"12\" fill=\"#%02x%02x%02x\"/>\n", (t - 1) * CELL,
            CELL - 2, rgb[0], rgb[1], rgb[2]);
    svg_text(out, (t - 0.5) * CELL - 1, 32, "num mid", "t = %d", t);
    svg_text(out, (t - 0.5) * CELL - 1, 48, "num mid mut", "%.1f %%", hits ? 100.0 * (double)of[t] / (double)hits : 0);
  }
  svg_end(out);
}

static sf_status steps_picture(FILE *out, const sf_page *page)
{
  uint64_t of[SF_T_MAX + 1] = {0};
  uint8_t palette[4 * (HEAT + 1)];
  const size_t n = (size_t)page->golden.width * (size_t)page->golden.height;
  if (!page->steps) return sf_ok();
  heat_palette(palette, SF_T_MAX);
  for (size_t i = 0; i < n; i++) of[page->steps[i]]++;
  html_figure_begin(out, "fig-steps-map", "", "Time steps a pixel needs.",
                    "Fewest steps after which its colour is within 4/255 of the nearest it comes to the photograph at "
                    "any t = 1..8; below, shares of the pixels that have samples. The network runs t<sub>r</sub> "
                    "steps everywhere: the budget that it was trained with weighs quality against energy "
                    "(by \xce\xb2) and its weights were fitted to it, so that t<sub>r</sub> may exceed what most "
                    "pixels need.");
  fprintf(out, "<div class=\"plate\">");
  SF_TRY(html_put_png(out, page->steps, page->golden.width, page->golden.height, palette, SF_T_MAX + 1,
                      "Map of the number of time steps that every pixel needs"));
  fprintf(out, "</div>\n");
  step_legend(out, of);
  html_figure_end(out);
  return sf_ok();
}

sf_status html_pictures(FILE *out, const sf_page *page)
{
  fprintf(out,
          "<section id=\"pictures\">\n<h2>The view, and what each pixel costs</h2>\n<div class=\"grid pictures\">\n");
  SF_TRY(golden_picture(out, page));
  SF_TRY(energy_picture(out, page));
  SF_TRY(samples_picture(out, page));
  SF_TRY(steps_picture(out, page));
  fprintf(out, "</div>\n</section>\n");
  return sf_ok();
}
