/* Where the energy of the paper ledger goes: by step, by layer. */
#include "page/internal.h"

enum { WIDTH = 480, ROW = 46, BAR = 20 };

uint64_t html_layer_fj(const fx_counts *counts, int layer, int step)
{
  return counts->layer[layer].mac[step] * SF_MAC_FJ + counts->layer[layer].sop[step] * SF_SOP_FJ;
}

static uint64_t step_fj(const fx_counts *counts, int step)
{
  uint64_t sum = 0;
  for (int l = 0; l < SF_LAYERS; l++) sum += html_layer_fj(counts, l, step);
  return sum;
}

static uint64_t layer_fj(const fx_counts *counts, int layer, int steps)
{
  uint64_t sum = 0;
  for (int t = 0; t < steps; t++) sum += html_layer_fj(counts, layer, t);
  return sum;
}

/* One segment of a stacked bar, named inside where there is room. */
static double segment(FILE *out, double x, double y, double scale, const sf_page *page, int l, int t, const char *name)
{
  const uint64_t fj = html_layer_fj(&page->report->measure.core, l, t);
  char style[24], key[40], tip[96], text[HTML_NUMBER];
  if (fj == 0) return x;
  const double width = (double)fj * scale;
  snprintf(style, sizeof style, "bar l%d", l);
  snprintf(key, sizeof key, "page.layer_fj[%d][%d]", l, t);
  snprintf(tip, sizeof tip, "%s, step %d: %s", fx_layer_name(l), t + 1, html_energy(text, (double)fj));
  svg_bar(out, x, y, width > 1.2 ? width - 1 : width, BAR, style, key, fj, tip);
  if (width > 26)
    svg_text(out, x + (width - 1) / 2, y + 14.5, fx_layer_reads_spikes(l) ? "in dark mid" : "in mid", "%s", name);
  return x + width;
}

static void by_step(FILE *out, const sf_page *page)
{
  const fx_counts *c = &page->report->measure.core;
  const int steps = page->report->net->steps;
  uint64_t all = sf_energy_fj(c), top = 0;
  char text[HTML_NUMBER];
  for (int t = 0; t < steps; t++) top = step_fj(c, t) > top ? step_fj(c, t) : top;
  svg_begin(out, "svg-by-step", WIDTH, ROW * steps, "Energy by time step", "One bar per step, stacked by layer");
  for (int t = 0; t < steps; t++) {
    const uint64_t fj = step_fj(c, t);
    double x = 0;
    svg_text(out, 0, ROW * t + 15, "lab", "step %d", t + 1);
    svg_text(out, WIDTH, ROW * t + 15, "num end", "%s  (%.1f %%)", html_energy(text, (double)fj),
             all ? 100.0 * (double)fj / (double)all : 0);
    for (int l = 0; l < SF_LAYERS; l++)
      x = segment(out, x, ROW * t + 20, top ? WIDTH / (double)top : 0, page, l, t, fx_layer_name(l));
  }
  svg_end(out);
}

static void by_layer(FILE *out, const sf_page *page)
{
  const fx_counts *c = &page->report->measure.core;
  const int steps = page->report->net->steps;
  uint64_t all = sf_energy_fj(c), top = 0;
  char text[HTML_NUMBER], name[16];
  for (int l = 0; l < SF_LAYERS; l++) top = layer_fj(c, l, steps) > top ? layer_fj(c, l, steps) : top;
  const int first = fx_net_first_layer(page->report->net);
  svg_begin(out, "svg-by-layer", WIDTH, ROW * (SF_LAYERS - first), "Energy by layer",
            "One bar per layer, stacked by step");
  for (int l = first; l < SF_LAYERS; l++) {
    const double y = ROW * (l - first);
    const uint64_t fj = layer_fj(c, l, steps);
    double x = 0;
    svg_text(out, 0, y + 15, "lab", "%s: %s", fx_layer_name(l),
             c->layer[l].mac[0] ? "multiplies (MAC)" : "adds on spikes (SOP)");
    svg_text(out, WIDTH, y + 15, "num end", "%s  (%.1f %%)", html_energy(text, (double)fj),
             all ? 100.0 * (double)fj / (double)all : 0);
    for (int t = 0; t < steps; t++) {
      snprintf(name, sizeof name, "t%d", t + 1);
      x = segment(out, x, y + 20, top ? WIDTH / (double)top : 0, page, l, t, name);
    }
  }
  svg_end(out);
}

void html_energy_section(FILE *out, const sf_page *page)
{
  const sf_ledger *l = &page->report->ledger;
  fprintf(out, "<section id=\"energy\">\n<h2>Where the energy goes</h2>\n<p>Paper ledger: ");
  html_put_count(out, "counts.total.mac", sf_event_total(&page->report->measure.core, SF_EVENT_MAC));
  fprintf(out, " MAC at 4.6 pJ are ");
  html_put_energy(out, "ledger.mac_fj", l->mac_fj);
  fprintf(out, ", ");
  html_put_count(out, "counts.total.sop", sf_event_total(&page->report->measure.core, SF_EVENT_SOP));
  fprintf(out, " SOP at 0.9 pJ are ");
  html_put_energy(out, "ledger.sop_fj", l->sop_fj);
  fprintf(out, ".</p>\n<div class=\"grid\">\n");
  html_figure_begin(out, "fig-energy-step", "", "By time step.",
                    "The first step also pays for what happens once per sample or ray.");
  by_step(out, page);
  html_figure_end(out);
  html_figure_begin(out, "fig-energy-layer", "", "By layer.", "Each bar is divided into its time steps.");
  by_layer(out, page);
  html_figure_end(out);
  fprintf(out, "</div>\n</section>\n");
}
