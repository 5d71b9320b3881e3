/* Spike raster of one ray; how often the neurons of each layer fire at each step. */
#include "page/internal.h"

static const char *const raster_id[SF_LAYERS] = {"svg-raster-d1", "", "svg-raster-c1", "svg-raster-c2", ""};
static const char *const rates_id[SF_LAYERS] = {"svg-rates-d1", "", "svg-rates-c1", "svg-rates-c2", ""};

enum { RATES_WIDTH = 360, STEP = 82, PLOT = 44, RATES_TOP = 18 };

static bool fired(const sf_page_ray *ray, int sample, int l, int t, int neuron)
{
  return ray->spikes[sample][l][t][neuron / 64] >> neuron % 64 & 1;
}

static void raster_of(FILE *out, const sf_page *page, int l)
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

HTML_FUNCTION(raster)
{
  html_view *v = user;
  (void)value;
  for (int l = 0; l < SF_LAYERS; l++)
    if (fx_layer_fires(l) && v->page->report->net->layer[l].n_out > 0) raster_of(out, v->page, l);
  return v->status;
}

/* The histogram of one step, y at its foot. */
static void rates_of_step(FILE *out, html_view *v, int l, int t, double y, int top)
{
  const char *name = html_text(v, "counts.layers[%d].name", l);
  const sf_template_value bins = html_at(v, "page.rate_bins.%s[%d]", name, t);
  const int n = cJSON_GetArraySize(bins.node), never = (int)html_real(v, "page.never_fire.%s[%d]", name, t);
  const double mean = html_real(v, "counts.layers[%d].firing_rate[%d]", l, t), w = RATES_WIDTH / (double)n;
  for (int b = 0; b < n; b++) {
    const sf_template_value value = html_at(v, "%s[%d]", bins.path, b);
    const int neurons = (int)sf_json_real(value.node);
    const double height = PLOT * neurons / (double)top;
    char style[24], tip[96];
    if (neurons == 0) continue;
    snprintf(style, sizeof style, "bar l%d", l);
    snprintf(tip, sizeof tip, "%d neurons fire in %d to %d %% of the samples at step %d", neurons, b * 100 / n,
             (b + 1) * 100 / n, t + 1);
    svg_bar(out, b * w, y - height, w - 1, height, style, &value, tip);
  }
  svg_line(out, 0, y, RATES_WIDTH, y, "ax");
  svg_line(out, mean * RATES_WIDTH, y - PLOT - 4, mean * RATES_WIDTH, y, "mark");
  svg_text(out, 0, y - PLOT - 8, "num mut", "step %d", t + 1);
  svg_text(out, RATES_WIDTH, y - PLOT - 8, "num end", "mean %.2f %%", 100 * mean);
  if (never > 0) svg_text(out, RATES_WIDTH / 2.0, y - PLOT - 8, "num mut mid", "%d never fire", never);
}

/* Neurons by firing rate, one histogram per step above the other. */
static void rates_of(FILE *out, html_view *v, int l)
{
  const char *name = html_text(v, "counts.layers[%d].name", l);
  const int steps = (int)html_real(v, "t_r");
  const cJSON *bins, *bin;
  int top = 1;
  char title[64];
  cJSON_ArrayForEach(bins, html_at(v, "page.rate_bins.%s", name).node)
  {
    cJSON_ArrayForEach(bin, bins) top = bin->valueint > top ? bin->valueint : top;
  }
  snprintf(title, sizeof title, "Firing rates of layer %s", name);
  svg_begin(out, rates_id[l], RATES_WIDTH, RATES_TOP + STEP * steps + 34, title,
            "Histogram of the firing rates of the neurons, one per step");
  svg_text(out, 0, 13, "lab", "%s", name);
  svg_text(out, RATES_WIDTH, 13, "num mut end", "highest bar: %d of %.0f neurons", top,
           html_real(v, "counts.layers[%d].n_out", l));
  for (int t = 0; t < steps; t++) rates_of_step(out, v, l, t, RATES_TOP + STEP * t + 24 + PLOT, top);
  svg_percents(out, 0, RATES_WIDTH, RATES_WIDTH, RATES_TOP + STEP * steps + 8);
  svg_text(out, RATES_WIDTH / 2.0, RATES_TOP + STEP * steps + 26, "mut mid", "firing rate of a neuron");
  svg_end(out);
}

HTML_FUNCTION(rates)
{
  html_view *v = user;
  (void)value;
  for (int l = 0; l < SF_LAYERS; l++)
    if (fx_layer_fires(l) && html_real(v, "counts.layers[%d].n_out", l) > 0) rates_of(out, v, l);
  return v->status;
}
