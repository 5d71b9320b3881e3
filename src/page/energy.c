/* Where the energy of the paper ledger goes: by step, by layer. */
#include "page/internal.h"

enum { WIDTH = 480, ROW = 46, BAR = 20 };

static double cell_fj(html_view *v, int layer, int step)
{
  return html_real(v, "page.layer_fj[%d][%d]", layer, step);
}

static double step_fj(html_view *v, int step)
{
  double sum = 0;
  for (int l = 0; l < SF_LAYERS; l++) sum += cell_fj(v, l, step);
  return sum;
}

static double layer_fj(html_view *v, int layer, int steps)
{
  double sum = 0;
  for (int t = 0; t < steps; t++) sum += cell_fj(v, layer, t);
  return sum;
}

/* One segment of a stacked bar, named inside where there is room. */
static double segment(FILE *out, double x, double y, double scale, html_view *v, int l, int t, const char *name)
{
  const sf_template_value value = html_at(v, "page.layer_fj[%d][%d]", l, t);
  const double fj = sf_json_real(value.node), width = fj * scale;
  char style[24], tip[96], text[HTML_NUMBER];
  if (!(fj > 0)) return x;
  snprintf(style, sizeof style, "bar l%d", l);
  snprintf(tip, sizeof tip, "%s, step %d: %s", html_text(v, "counts.layers[%d].name", l), t + 1, html_energy(text, fj));
  svg_bar(out, x, y, width > 1.2 ? width - 1 : width, BAR, style, &value, tip);
  if (width > 26)
    svg_text(out, x + (width - 1) / 2, y + 14.5, fx_layer_reads_spikes(l) ? "in dark mid" : "in mid", "%s", name);
  return x + width;
}

static void share(FILE *out, double y, double fj, double all)
{
  char text[HTML_NUMBER];
  svg_text(out, WIDTH, y, "num end", "%s  (%.1f %%)", html_energy(text, fj), all > 0 ? 100 * fj / all : 0);
}

HTML_FUNCTION(by_step)
{
  html_view *v = user;
  const int steps = (int)html_real(v, "t_r");
  const double all = html_real(v, "energy_spiking_fj");
  double top = 0;
  (void)value;
  for (int t = 0; t < steps; t++) top = step_fj(v, t) > top ? step_fj(v, t) : top;
  svg_begin(out, "svg-by-step", WIDTH, ROW * steps, "Energy by time step", "One bar per step, stacked by layer");
  for (int t = 0; t < steps; t++) {
    double x = 0;
    svg_text(out, 0, ROW * t + 15, "lab", "step %d", t + 1);
    share(out, ROW * t + 15, step_fj(v, t), all);
    for (int l = 0; l < SF_LAYERS; l++)
      x = segment(out, x, ROW * t + 20, top > 0 ? WIDTH / top : 0, v, l, t, html_text(v, "counts.layers[%d].name", l));
  }
  svg_end(out);
  return v->status;
}

HTML_FUNCTION(by_layer)
{
  html_view *v = user;
  const int steps = (int)html_real(v, "t_r");
  const double all = html_real(v, "energy_spiking_fj");
  double top = 0;
  int rows = 0, row = 0;
  (void)value;
  for (int l = 0; l < SF_LAYERS; l++) {
    top = layer_fj(v, l, steps) > top ? layer_fj(v, l, steps) : top;
    rows += html_real(v, "counts.layers[%d].n_out", l) > 0;
  }
  svg_begin(out, "svg-by-layer", WIDTH, ROW * rows, "Energy by layer", "One bar per layer, stacked by step");
  for (int l = 0; l < SF_LAYERS; l++) {
    double x = 0, y = ROW * row;
    if (!(html_real(v, "counts.layers[%d].n_out", l) > 0)) continue;
    svg_text(out, 0, y + 15, "lab", "%s: %s", html_text(v, "counts.layers[%d].name", l),
             html_real(v, "counts.layers[%d].mac[0]", l) > 0 ? "multiplies (MAC)" : "adds on spikes (SOP)");
    share(out, y + 15, layer_fj(v, l, steps), all);
    for (int t = 0; t < steps; t++) {
      char name[16];
      snprintf(name, sizeof name, "t%d", t + 1);
      x = segment(out, x, y + 20, top > 0 ? WIDTH / top : 0, v, l, t, name);
    }
    row++;
  }
  svg_end(out);
  return v->status;
}
