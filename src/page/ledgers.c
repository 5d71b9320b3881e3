/* The same events under every set of assumptions: savings, energies by what they are spent on, the paper's readings. */
#include "page/internal.h"
#include <math.h>
#include <string.h>

enum { WIDTH = 480 };

/* ---- savings around zero ---- */

typedef struct saving_row {
  const char *title, *against;
  double saving;
  char key[64];
} saving_row;

enum { READINGS = 3 };

static void ledger_rows(const sf_page *page, saving_row row[SF_SPIKING_LEDGERS])
{
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
    row[g] = (saving_row){sf_ledger_texts[g].title, sf_ledger_texts[sf_ledger_texts[g].baseline].title,
                          page->report->ledgers.saving[g], ""};
    snprintf(row[g].key, sizeof row[g].key, "ledgers.list[%d].saving_percent", g);
  }
}

static void reading_rows(const sf_page *page, saving_row row[READINGS])
{
  const sf_ledger *p = &page->report->ledger;
  row[0] = (saving_row){"h counted once per sample", "ReLU twin", sf_saving_percent(p->h_once_fj, p->ann_fj),
                        "ledger.h_once_saving_percent"};
  row[1] = (saving_row){"h counted as spikes", "ReLU twin", sf_saving_percent(p->h_spikes_fj, p->ann_fj),
                        "ledger.h_spikes_saving_percent"};
  row[2] = (saving_row){"twin reads the direction once per ray too", "ReLU twin, direction once per ray",
                        sf_saving_percent(p->spiking_fj, p->ann_hoisted_fj), "ledger.hoisted_saving_percent"};
}

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
    if (!isfinite(row[i].saving)) continue;
    low = fmin(low, row[i].saving), high = fmax(high, row[i].saving);
  }
  /* Room for the numbers on the sides that are used. */
  const double left = low < 0 ? 88 : 0, scale = (WIDTH - left - 88) / fmax(high - low, 1), zero = left - low * scale;
  svg_begin(out, id, WIDTH, TOP + ROW * n, title, "Bars to the right: energy saved; to the left: more energy spent");
  if (low < 0) svg_text(out, zero - 8, 12, "mut end", "\xe2\x86\x90 spends more");
  svg_text(out, zero + 8, 12, "mut", "saves \xe2\x86\x92");
  for (int i = 0; i < n; i++) {
    const double y = TOP + ROW * i, saving = isfinite(row[i].saving) ? row[i].saving : 0, width = fabs(saving) * scale;
    char text[HTML_NUMBER];
    place_title(out, row[i].title, zero, y + 12);
    fprintf(out,
            "<rect x=\"%.2f\" y=\"%g\" width=\"%.2f\" height=\"16\" class=\"bar %s\" data-key=\"%s\" "
            "data-value=\"%.17g\"><title>",
            saving < 0 ? zero - width : zero, y + 18, width, saving < 0 ? "loss" : "spk", row[i].key, saving);
    sf_xml_escape(out, row[i].title), fprintf(out, ", against "), sf_xml_escape(out, row[i].against);
    fprintf(out, "</title></rect>\n");
    svg_text(out, saving < 0 ? zero - width - 6 : zero + width + 6, y + 31,
             saving < 0 ? "num strong end" : "num strong", "%s", html_percent(text, row[i].saving));
  }
  svg_line(out, zero, 2, zero, TOP + ROW * n, "ax");
  svg_end(out);
}

static void savings(FILE *out, const sf_page *page)
{
  saving_row ledger[SF_SPIKING_LEDGERS], reading[READINGS];
  ledger_rows(page, ledger);
  reading_rows(page, reading);
  fprintf(out, "<div class=\"grid\">\n");
  html_figure_begin(
      out, "fig-savings", "", "Saved, by ledger.",
      "The spiking network against its ReLU twin, priced in the same way. The width-correct ledger prices the "
      "events of the paper ledger anew; those below it add to it. The twin of the paper ledger "
      "multiplies the direction of a ray at every sample, the others once per ray as the spiking "
      "network does.");
  saving_bars(out, "svg-savings", "Savings of every ledger", ledger, SF_SPIKING_LEDGERS);
  html_figure_end(out);
  if (fx_net_constants_per_sample(page->report->net)) { /* no h, and the direction comes with every sample */
    fprintf(out, "</div>\n");
    return;
  }
  html_figure_begin(
      out, "fig-readings", "", "Other readings of the paper ledger.",
      "h, which the density network hands to C1, changes at every step: its products are counted at every "
      "step here. The literature can also be read in these ways.");
  saving_bars(out, "svg-readings", "Savings of other readings of the paper ledger", reading, READINGS);
  html_figure_end(out);
  fprintf(out, "</div>\n");
}

/* ---- energies, by what they are spent on ---- */

static void stacked(FILE *out, const sf_page *page, int ledger, double y, double top, const char *name)
{
  const sf_ledgers *l = &page->report->ledgers;
  char key[64], style[24], tip[96], text[HTML_NUMBER];
  double x = 0;
  svg_text(out, 0, y + 14, "lab", "%s", name);
  svg_text(out, WIDTH, y + 14, "num strong end", "%s", html_energy(text, (double)l->total[ledger]));
  for (int p = 0; p < SF_PARTS; p++) {
    const double width = top > 0 ? WIDTH * (double)l->part[ledger][p] / top : 0;
    if (l->part[ledger][p] == 0) continue;
    snprintf(key, sizeof key, "ledgers.list[%d].parts_fj.%s", ledger, sf_part_names[p]);
    snprintf(style, sizeof style, "bar p%d", p);
    snprintf(tip, sizeof tip, "%s: %s", sf_part_titles[p], html_energy(text, (double)l->part[ledger][p]));
    svg_bar(out, x, y + 20, width, 22, style, key, l->part[ledger][p], tip);
    if (width > 10 + 8.2 * (double)strlen(sf_part_titles[p]))
      svg_text(out, x + width / 2, y + 35, p == SF_PART_MAC || p == SF_PART_SOP ? "in mid" : "part mid", "%s",
               sf_part_titles[p]);
    x += width;
  }
}

static void ledger_figure(FILE *out, const sf_page *page, int ledger)
{
  const sf_ledgers *l = &page->report->ledgers;
  const int twin = sf_ledger_texts[ledger].baseline;
  const double top = fmax((double)l->total[ledger], (double)l->total[twin]);
  char id[48], caption[700];
  snprintf(id, sizeof id, "fig-ledger-%s", sf_ledger_texts[ledger].key);
  snprintf(caption, sizeof caption, "%s%s.%s", strncmp(sf_ledger_texts[ledger].meaning, "and ", 4) ? "" : "As before, ",
           sf_ledger_texts[ledger].meaning, l->interpolated[ledger] ? " Some prices are interpolated." : "");
  fprintf(out, "<figure id=\"%s\">\n<figcaption><b>", id);
  sf_xml_escape(out, sf_ledger_texts[ledger].title);
  fprintf(out, "</b>: ");
  snprintf(id, sizeof id, "ledgers.list[%d].saving_percent", ledger);
  html_put_saving(out, id, l->saving[ledger]);
  fprintf(out, ". ");
  sf_xml_escape(out, caption);
  fprintf(out, "</figcaption>\n");
  snprintf(id, sizeof id, "svg-ledger-%s", sf_ledger_texts[ledger].key);
  svg_begin(out, id, WIDTH, 98, "Spiking network and twin", "Two bars, divided into what the energy is spent on");
  stacked(out, page, ledger, 0, top, "spiking network");
  stacked(out, page, twin, 50, top, sf_ledger_texts[twin].title);
  svg_end(out);
  html_figure_end(out);
}

static void parts_table(FILE *out, const sf_page *page)
{
  const sf_ledgers *l = &page->report->ledgers;
  uint64_t top = 0;
  for (int g = 0; g < SF_LEDGERS; g++) top = l->total[g] > top ? l->total[g] : top;
  fprintf(out, "<div class=\"scroll\"><table><caption>Every ledger, by what the energy is spent on</caption>\n<thead>"
               "<tr><th>ledger</th><th class=\"n\">total</th>");
  for (int p = 0; p < SF_PARTS; p++)
    fprintf(out, "<th class=\"n\"><i class=\"key p%d\"></i>%s</th>", p, sf_part_titles[p]);
  fprintf(out, "</tr></thead>\n<tbody>\n");
  for (int i = 0; i < 2 * SF_SPIKING_LEDGERS; i++) { /* a ledger, then its twin */
    const int g = i % 2 ? sf_ledger_texts[i / 2].baseline : i / 2;
    char key[64];
    fprintf(out, "<tr%s><th>", i % 2 ? "" : " class=\"first\"");
    sf_xml_escape(out, sf_ledger_texts[g].title);
    fprintf(out, "</th><td class=\"n strong\">");
    snprintf(key, sizeof key, "ledgers.list[%d].total_fj", g);
    html_put_energy_in(out, key, l->total[g], top);
    for (int p = 0; p < SF_PARTS; p++) {
      fprintf(out, "</td><td class=\"n\">");
      snprintf(key, sizeof key, "ledgers.list[%d].parts_fj.%s", g, sf_part_names[p]);
      if (l->part[g][p] > 0)
        html_put_energy_in(out, key, l->part[g][p], top);
      else
        fprintf(out, "\xe2\x80\x93");
    }
    fprintf(out, "</td></tr>\n");
  }
  fprintf(out, "</tbody></table></div>\n");
}

void html_ledgers(FILE *out, const sf_page *page)
{
  fprintf(out,
          "<section id=\"ledgers\">\n<h2>The same work under other assumptions</h2>\n"
          "<p>Counting operations is exact; pricing them is a choice. Each ledger prices the same counted events, and "
          "each is compared with its ReLU twin \xe2\x80\x93 the same layers without spikes, on the same samples "
          "\xe2\x80\x93 "
          "priced in the same way.</p>\n");
  savings(out, page);
  fprintf(out, "<p class=\"note\">Below, each ledger has a scale of its own: compare lengths within a ledger, numbers "
               "between them.</p>\n<div class=\"grid\">\n");
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) ledger_figure(out, page, g);
  fprintf(out, "</div>\n");
  parts_table(out, page);
  fprintf(out, "</section>\n");
  html_prices(out, page);
}
