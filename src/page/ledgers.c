/* The same events under every set of assumptions: savings, energies by what they are spent on, the paper's readings. */
#include "page/internal.h"
#include <math.h>
#include <string.h>

enum { WIDTH = 480 };

/* ---- savings around zero ---- */

typedef struct saving_row {
  const char *title, *against;
  sf_template_value saving;
} saving_row;

enum { ROWS = 8 };

/* On the side of the line that has more room, and never beyond the picture. */
static void place_title(FILE *out, const char *title, double zero, double y)
{
  const double width = 9.5 * (double)strlen(title); /* at most: of bold letters on a small screen */
  if (zero > WIDTH / 2.0)
    svg_text(out, fmax(zero - 8, width), y, "lab end", "%s", title);
  else
    svg_text(out, fmax(fmin(zero + 8, WIDTH - width), 0), y, "lab", "%s", title);
}

/* Percentages to the right of zero are saved, to the left spent in addition. */
static void saving_bars(FILE *out, const char *id, const char *title, const saving_row *row, int n)
{
  enum { ROW = 42, TOP = 22 };
  double low = 0, high = 0;
  for (int i = 0; i < n; i++) {
    const double saving = sf_json_real(row[i].saving.node);
    if (isfinite(saving)) low = fmin(low, saving), high = fmax(high, saving);
  }
  /* Room for the words above and the numbers on the sides that are used. */
  const double left = low < 0 ? 120 : 0, scale = (WIDTH - left - 88) / fmax(high - low, 1), zero = left - low * scale;
  svg_begin(out, id, WIDTH, TOP + ROW * n, title, "Bars to the right: energy saved; to the left: more energy spent");
  if (low < 0) svg_text(out, zero - 8, 12, "mut end", "\xe2\x86\x90 spends more");
  svg_text(out, zero + 8, 12, "mut", "saves \xe2\x86\x92");
  for (int i = 0; i < n; i++) {
    const double shown = sf_json_real(row[i].saving.node), saving = isfinite(shown) ? shown : 0;
    const double y = TOP + ROW * i, width = fabs(saving) * scale;
    char text[HTML_NUMBER], tip[128];
    place_title(out, row[i].title, zero, y + 12);
    snprintf(tip, sizeof tip, "%s, against %s", row[i].title, row[i].against);
    svg_bar(out, saving < 0 ? zero - width : zero, y + 18, width, 16, saving < 0 ? "bar loss" : "bar spk",
            &row[i].saving, tip);
    svg_text(out, saving < 0 ? zero - width - 6 : zero + width + 6, y + 31,
             saving < 0 ? "num strong end" : "num strong", "%s", html_percent(text, shown));
  }
  svg_line(out, zero, 2, zero, TOP + ROW * n, "ax");
  svg_end(out);
}

HTML_FUNCTION(ledger_savings)
{
  html_view *v = user;
  const int pairs = cJSON_GetArraySize(html_at(v, "page.pairs").node);
  saving_row row[ROWS];
  int n = 0;
  (void)value;
  for (; n < pairs && n < ROWS; n++) {
    const int ledger = (int)html_real(v, "page.pairs[%d].of[0]", n),
              twin = (int)html_real(v, "page.pairs[%d].of[1]", n);
    row[n] = (saving_row){html_text(v, "ledgers.list[%d].title", ledger), html_text(v, "ledgers.list[%d].title", twin),
                          html_at(v, "ledgers.list[%d].saving_percent", ledger)};
  }
  saving_bars(out, "svg-savings", "Savings of every ledger", row, n);
  return v->status;
}

HTML_FUNCTION(reading_savings)
{
  html_view *v = user;
  const saving_row row[] = {{"h counted once per sample", "ReLU twin", html_at(v, "ledger.h_once_saving_percent")},
                            {"h counted as spikes", "ReLU twin", html_at(v, "ledger.h_spikes_saving_percent")},
                            {"twin reads the direction once per ray too", "ReLU twin, direction once per ray",
                             html_at(v, "ledger.hoisted_saving_percent")}};
  (void)value;
  saving_bars(out, "svg-readings", "Savings of other readings of the paper ledger", row, 3);
  return v->status;
}

/* ---- energies, by what they are spent on ---- */

static void stacked(FILE *out, html_view *v, const sf_template_value *ledger, double y, double top, const char *name)
{
  char style[24], tip[96], text[HTML_NUMBER];
  const cJSON *part;
  double x = 0;
  int p = 0;
  svg_text(out, 0, y + 14, "lab", "%s", name);
  svg_text(out, WIDTH, y + 14, "num strong end", "%s", html_energy(text, html_real(v, "%s.total_fj", ledger->path)));
  cJSON_ArrayForEach(part, html_at(v, "titles.parts").node)
  {
    const sf_template_value value = html_at(v, "%s.parts_fj.%s", ledger->path, part->string);
    const double fj = sf_json_real(value.node), width = top > 0 ? WIDTH * fj / top : 0;
    const char *title = part->valuestring;
    snprintf(style, sizeof style, "bar p%d", p++);
    if (!(fj > 0)) continue;
    snprintf(tip, sizeof tip, "%s: %s", title, html_energy(text, fj));
    svg_bar(out, x, y + 20, width, 22, style, &value, tip);
    if (width > 10 + 8.2 * (double)strlen(title))
      svg_text(out, x + width / 2, y + 35, p <= SF_PART_SOP + 1 ? "in mid" : "part mid", "%s", title);
    x += width;
  }
}

HTML_FUNCTION(ledger_bars)
{
  html_view *v = user;
  char id[48];
  const double top = fmax(html_real(v, "%s.total_fj", value[0].path), html_real(v, "%s.total_fj", value[1].path));
  snprintf(id, sizeof id, "svg-ledger-%s", html_text(v, "%s.key", value[0].path));
  svg_begin(out, id, WIDTH, 98, "Spiking network and twin", "Two bars, divided into what the energy is spent on");
  stacked(out, v, &value[0], 0, top, "spiking network");
  stacked(out, v, &value[1], 50, top, html_text(v, "%s.title", value[1].path));
  svg_end(out);
  return v->status;
}
