/* Spike raster of one ray; how often the neurons of each layer fire at each step. */
#include "page/internal.h"
#include <math.h>

static const char *const raster_id[SF_LAYERS] = {"svg-raster-d1", "", "svg-raster-c1", "svg-raster-c2", ""};
static const char *const rates_id[SF_LAYERS] = {"svg-rates-d1", "", "svg-rates-c1", "svg-rates-c2", ""};

static bool fired(const sf_page_ray *ray, int sample, int l, int t, int neuron)
{
  return ray->spikes[sample][l][t][neuron / 64] >> neuron % 64 & 1;
}

static void raster(FILE *out, const sf_page *page, int l)
{
  enum { WIDTH = 360, LEFT = 30, TOP = 18, ROW = 2 };
  const sf_page_ray *ray = &page->ray;
  const int steps = page->report->net->steps, n = page->report->net->layer[l].n_out;
  const double sample = (WIDTH - LEFT) / (double)ray->samples, gap = sample / (steps * 4 + 1),
               cell = (sample - gap) / steps;
  uint64_t spikes = 0;
  char title[64];
  snprintf(title, sizeof title, "Spikes of layer %s", fx_layer_name(l));
  svg_begin(out, raster_id[l], WIDTH, TOP + ROW * n + 36, title,
            "Neurons from top to bottom, samples and steps from left to right");
  fprintf(out, "<rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\" class=\"field\"/>\n<path class=\"tick l%d\" d=\"",
          LEFT, TOP, WIDTH - LEFT, ROW * n, l);
  for (int s = 0; s < ray->samples; s++)
    for (int t = 0; t < steps; t++)
      for (int o = 0; o < n; o++) {
        if (!fired(ray, s, l, t, o)) continue;
        fprintf(out, "M%.1f %dh%.1f", LEFT + s * sample + t * cell, TOP + ROW * o + 1, cell);
        spikes++;
      }
  fprintf(out, "\"/>\n");
  svg_text(out, LEFT, 13, "lab", "%s", fx_layer_name(l));
  svg_text(out, WIDTH, 13, "num end", "%.1f %% fire", 100.0 * (double)spikes / ((double)ray->samples * steps * n));
  svg_text(out, LEFT - 5, TOP + 10, "num mut end", "0");
  svg_text(out, LEFT - 5, TOP + ROW * n, "num mut end", "%d", n - 1);
  svg_text(out, LEFT, TOP + ROW * n + 16, "num mut", "front");
  svg_text(out, WIDTH, TOP + ROW * n + 16, "num mut end", "back");
  svg_text(out, (WIDTH + LEFT) / 2.0, TOP + ROW * n + 16, "num mut mid", "%d sample%s \xc3\x97 %d step%s", ray->samples,
           ray->samples == 1 ? "" : "s", steps, steps == 1 ? "" : "s");
  svg_end(out);
}

static void raster_figure(FILE *out, const sf_page *page)
{
  char caption[400];
  snprintf(
      caption, sizeof caption,
      "Pixel (%d, %d), the ring in the golden image: %s%d of its samples, front to back, each with %d step%s. One "
      "row per neuron, one mark per spike. Every mark costs one SOP per neuron that it reaches; blank costs nothing.",
      page->ray.x, page->ray.y, page->ray.samples < page->ray.all ? "the first " : "all ", page->ray.samples,
      page->report->net->steps, page->report->net->steps == 1 ? "" : "s");
  html_figure_begin(out, "fig-raster", "trio", "Spikes along one ray.", caption);
  for (int l = 0; l < SF_LAYERS; l++)
    if (fx_layer_fires(l) && page->report->net->layer[l].n_out > 0) raster(out, page, l);
  html_figure_end(out);
}

int html_rate_bins(const sf_page *page, int l, int t, int bin[SF_PAGE_BINS])
{
  int silent = 0;
  for (int b = 0; b < SF_PAGE_BINS; b++) bin[b] = 0;
  for (int o = 0; o < page->report->net->layer[l].n_out && page->sampled > 0; o++) {
    const uint64_t spikes = page->neuron[l][t][o];
    bin[spikes >= page->sampled ? SF_PAGE_BINS - 1 : (int)(spikes * SF_PAGE_BINS / page->sampled)]++;
    silent += spikes == 0;
  }
  return silent;
}

/* Neurons by firing rate, one histogram per step above the other. */
static void rates(FILE *out, const sf_page *page, int l)
{
  enum { WIDTH = 360, STEP = 82, PLOT = 44, TOP = 18 };
  const int steps = page->report->net->steps, n = page->report->net->layer[l].n_out;
  int bin[SF_T_MAX][SF_PAGE_BINS], silent[SF_T_MAX], top = 1;
  for (int t = 0; t < steps; t++) {
    silent[t] = html_rate_bins(page, l, t, bin[t]);
    for (int b = 0; b < SF_PAGE_BINS; b++) top = bin[t][b] > top ? bin[t][b] : top;
  }
  char title[64], tip[96], key[48];
  snprintf(title, sizeof title, "Firing rates of layer %s", fx_layer_name(l));
  svg_begin(out, rates_id[l], WIDTH, TOP + STEP * steps + 34, title,
            "Histogram of the firing rates of the neurons, one per step");
  svg_text(out, 0, 13, "lab", "%s", fx_layer_name(l));
  svg_text(out, WIDTH, 13, "num mut end", "highest bar: %d of %d neurons", top, n);
  for (int t = 0; t < steps; t++) {
    const double y = TOP + STEP * t + 24 + PLOT, w = WIDTH / (double)SF_PAGE_BINS;
    const fx_layer_counts *c = &page->report->measure.core.layer[l];
    const double mean = c->updates[t] ? (double)c->spikes[t] / (double)c->updates[t] : 0;
    for (int b = 0; b < SF_PAGE_BINS; b++) {
      char style[24];
      if (bin[t][b] == 0) continue;
      snprintf(style, sizeof style, "bar l%d", l);
      snprintf(tip, sizeof tip, "%d neurons fire in %d to %d %% of the samples at step %d", bin[t][b],
               b * 100 / SF_PAGE_BINS, (b + 1) * 100 / SF_PAGE_BINS, t + 1);
      snprintf(key, sizeof key, "page.rate_bins.%s[%d][%d]", fx_layer_name(l), t, b);
      const double height = PLOT * bin[t][b] / (double)top;
      svg_bar(out, b * w, y - height, w - 1, height, style, key, (uint64_t)bin[t][b], tip);
    }
    svg_line(out, 0, y, WIDTH, y, "ax");
    svg_line(out, mean * WIDTH, y - PLOT - 4, mean * WIDTH, y, "mark");
    svg_text(out, 0, y - PLOT - 8, "num mut", "step %d", t + 1);
    svg_text(out, WIDTH, y - PLOT - 8, "num end", "mean %.2f %%", 100 * mean);
    if (silent[t] > 0) svg_text(out, WIDTH / 2.0, y - PLOT - 8, "num mut mid", "%d never fire", silent[t]);
  }
  for (int i = 0; i <= 4; i++)
    svg_text(out, WIDTH * i / 4.0, TOP + STEP * steps + 8,
             i == 0   ? "num mut"
             : i == 4 ? "num mut end"
                      : "num mut mid",
             "%d %%", 25 * i);
  svg_text(out, WIDTH / 2.0, TOP + STEP * steps + 26, "mut mid", "firing rate of a neuron");
  svg_end(out);
}

static void rates_figure(FILE *out, const sf_page *page)
{
  char caption[400], text[HTML_NUMBER];
  snprintf(
      caption, sizeof caption,
      "How many neurons fire how often, in bins of %d %%, over %s samples spread over the view; the line is the mean "
      "of all audited samples. The lower the rates, the fewer SOPs.",
      100 / SF_PAGE_BINS, html_count(text, page->sampled));
  html_figure_begin(out, "fig-rates", "trio", "Firing rates.", caption);
  for (int l = 0; l < SF_LAYERS; l++)
    if (fx_layer_fires(l) && page->report->net->layer[l].n_out > 0) rates(out, page, l);
  html_figure_end(out);
}

void html_spikes(FILE *out, const sf_page *page)
{
  fprintf(out, "<section id=\"spikes\">\n<h2>The spikes</h2>\n");
  if (page->sampled == 0) fprintf(out, "<p>No ray of the view has samples: there is no spike.</p>\n");
  if (page->ray.samples > 0) raster_figure(out, page);
  if (page->sampled > 0) rates_figure(out, page);
  fprintf(out, "</section>\n");
}
