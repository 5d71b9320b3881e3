/* How much hangs on each price, at which firing rate the balance tips, and where the prices are from. */
#include "page/internal.h"
#include <math.h>
#include <stdlib.h>

enum { WIDTH = 480, ROW = 46, TOP = 22, SWINGS = 6 };

/* ---- tornado ---- */

typedef struct swing {
  int index; /* in ledgers->sensitivity */
  double less, more;
} swing;

static int by_swing(const void *a, const void *b)
{
  const swing *x = a, *y = b;
  const double p = fabs(x->more - x->less), q = fabs(y->more - y->less);
  return p < q ? 1 : p > q ? -1 : x->index - y->index;
}

/* Those that are worth a bar: at most SWINGS, and none below a twentieth of the largest. */
static int swings_of(const sf_ledgers *l, int ledger, swing list[SF_PRICES_MAX])
{
  int n = 0;
  for (int i = 0; i < l->sensitivities; i++) {
    const double less = l->sensitivity[i].less[ledger], more = l->sensitivity[i].more[ledger];
    if (isfinite(less) && isfinite(more) && fabs(less - more) > 1e-9) list[n++] = (swing){i, less, more};
  }
  /* cppcheck-suppress uninitvar ; the first n are set above */
  qsort(list, (size_t)n, sizeof *list, by_swing);
  while (n > SWINGS || (n > 1 && fabs(list[n - 1].more - list[n - 1].less) < fabs(list[0].more - list[0].less) / 20))
    n--;
  return n;
}

static void half_bar(FILE *out, const char *key, double from, double to, double x0, double scale, double low, double y,
                     const char *style, const char *tip)
{
  const double a = fmin(from, to), b = fmax(from, to);
  fprintf(out,
          "<rect x=\"%.2f\" y=\"%g\" width=\"%.2f\" height=\"14\" class=\"bar %s\" data-key=\"%s\" "
          "data-value=\"%.17g\"><title>%s</title></rect>\n",
          x0 + (a - low) * scale, y, (b - a) * scale, style, key, to, tip);
}

static void tornado(FILE *out, const sf_page *page, int ledger)
{
  const sf_ledgers *l = &page->report->ledgers;
  swing list[SF_PRICES_MAX];
  const int n = swings_of(l, ledger, list);
  const double now = l->saving[ledger];
  double low = now, high = now;
  char id[48], title[96], text[HTML_NUMBER];
  for (int i = 0; i < n; i++) {
    low = fmin(low, fmin(list[i].less, list[i].more));
    high = fmax(high, fmax(list[i].less, list[i].more));
  }
  /* Numbers stand at both ends. */
  const double x0 = 62, scale = (WIDTH - 2 * x0) / fmax(high - low, 1e-6);
  snprintf(id, sizeof id, "svg-tornado-%s", sf_ledger_texts[ledger].key);
  snprintf(title, sizeof title, "Sensitivity of the %s ledger", sf_ledger_texts[ledger].title);
  fprintf(out, "<div><h3>");
  sf_xml_escape(out, sf_ledger_texts[ledger].title);
  fprintf(out, "</h3>\n");
  svg_begin(out, id, WIDTH, TOP + ROW * n + 4, title,
            "Saving when a price is halved or raised by half, largest change first");
  const double mid = x0 + (now - low) * scale;
  svg_line(out, mid, TOP - 4, mid, TOP + ROW * n + 2, "ax");
  svg_text(out, fmin(fmax(mid, 60), WIDTH - 60), 12, "num mid", "now %s", html_percent(text, now));
  for (int i = 0; i < n; i++) {
    const sf_price *price = &l->technology.price[l->sensitivity[list[i].index].price];
    const double y = TOP + ROW * i, a = fmin(list[i].less, list[i].more), b = fmax(list[i].less, list[i].more);
    char key[96], tip[160];
    svg_text(out, 0, y + 12, "lab", "%s  (%s)", price->key, price->text);
    snprintf(key, sizeof key, "ledgers.sensitivity[%d].saving_percent.%s.less", list[i].index,
             sf_ledger_texts[ledger].key);
    snprintf(tip, sizeof tip, "%s at half its price: %.2f %% saved", price->key, list[i].less);
    half_bar(out, key, now, list[i].less, x0, scale, low, y + 22, "cheap", tip);
    snprintf(key, sizeof key, "ledgers.sensitivity[%d].saving_percent.%s.more", list[i].index,
             sf_ledger_texts[ledger].key);
    snprintf(tip, sizeof tip, "%s at one and a half times its price: %.2f %% saved", price->key, list[i].more);
    half_bar(out, key, now, list[i].more, x0, scale, low, y + 22, "dear", tip);
    svg_text(out, x0 + (a - low) * scale - 4, y + 34, "num end", "%s", html_tenths(text, a));
    svg_text(out, x0 + (b - low) * scale + 4, y + 34, "num", "%s", html_tenths(text, b));
  }
  svg_end(out);
  fprintf(out, "</div>\n");
}

static void tornado_figure(FILE *out, const sf_page *page)
{
  int drawn = 0;
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
    swing list[SF_PRICES_MAX];
    drawn += isfinite(page->report->ledgers.saving[g]) && swings_of(&page->report->ledgers, g, list) > 0;
  }
  if (drawn == 0) return; /* nothing was counted */
  html_figure_begin(out, "fig-tornado", "", "If a price is wrong by half.",
                    "The saving, in percent, when one price is halved (<i class=\"key cheap\"></i>\xe2\x88\x92"
                    "50 %) or raised by "
                    "half (<i class=\"key dear\"></i>+50 %) and the others stay. The longer the bar, the more the "
                    "answer hangs on that price. The largest six prices are shown, none whose bar is below a "
                    "twentieth of the longest; each ledger has a scale of its own.");
  fprintf(out, "<div class=\"grid\">\n");
  for (int g = 0; g < SF_SPIKING_LEDGERS; g++) {
    swing list[SF_PRICES_MAX];
    if (isfinite(page->report->ledgers.saving[g]) && swings_of(&page->report->ledgers, g, list) > 0)
      tornado(out, page, g);
  }
  fprintf(out, "</div>\n");
  html_figure_end(out);
}

/* ---- break-even ---- */

static void break_even_row(FILE *out, const sf_page *page, int i, double y)
{
  enum { W = WIDTH, X0 = 8, X1 = W - 8 };
  const sf_break_even *b = &page->report->ledgers.break_even[i];
  const double now = page->report->ledgers.rate, at_now = X0 + (X1 - X0) * fmin(now, 1);
  svg_text(out, 0, y + 14, "lab", "%s against %s", sf_ledger_texts[b->ledger].title, sf_ledger_texts[b->twin].title);
  svg_line(out, X0, y + 32, X1, y + 32, "gridline");
  if (isnan(b->rate)) {
    svg_text(out, W, y + 14, "num strong end bad", "none");
  } else {
    const double at = X0 + (X1 - X0) * fmin(b->rate, 1);
    svg_line(out, X0, y + 32, at, y + 32, "gain");
    fprintf(out,
            "<path d=\"M%.1f %.1fl-7 -10h14z\" class=\"even\" data-key=\"ledgers.break_even[%d].firing_rate\" "
            "data-value=\"%.17g\"/>\n",
            at, y + 30, i, b->rate);
    if (b->rate > 1)
      svg_text(out, W, y + 14, "num strong end good", ">100 %%");
    else
      svg_text(out, W, y + 14, now < b->rate ? "num strong end good" : "num strong end bad", "%.2f %%", 100 * b->rate);
  }
  fprintf(out,
          "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"6\" class=\"dot chosen\"><title>measured: %.2f %%</title></circle>\n",
          at_now, y + 32, 100 * now);
}

static void break_even_figure(FILE *out, const sf_page *page)
{
  enum { W = WIDTH, STEP = 46 };
  char caption[400];
  snprintf(
      caption, sizeof caption,
      "The mean firing rate at which the spiking network costs exactly what its twin does (triangle), and the "
      "measured rate, %.2f %% (dot). A dot to the left of its triangle, on the coloured stretch, saves energy. Above "
      "100 %%: cheaper at any rate; none: dearer at any rate.",
      100 * page->report->ledgers.rate);
  html_figure_begin(out, "fig-break-even", "", "Break-even firing rate.", caption);
  svg_begin(out, "svg-break-even", W, STEP * SF_SPIKING_LEDGERS + 22, "Break-even firing rates",
            "One line per comparison, from 0 to 100 %");
  for (int i = 0; i < SF_SPIKING_LEDGERS; i++) break_even_row(out, page, i, STEP * i);
  for (int i = 0; i <= 4; i++)
    svg_text(out,
             i == 0   ? 0
             : i == 4 ? W
                      : 8 + (W - 16) * i / 4.0,
             STEP * SF_SPIKING_LEDGERS + 16,
             i == 0   ? "num mut"
             : i == 4 ? "num mut end"
                      : "num mut mid",
             "%d %%", 25 * i);
  svg_end(out);
  html_figure_end(out);
}

/* ---- prices ---- */

static void price_table(FILE *out, const sf_technology *t)
{
  fprintf(out, "<div><div class=\"scroll\"><table id=\"table-prices\"><caption>Prices: ");
  sf_xml_escape(out, t->title);
  fprintf(out,
          "</caption>\n<thead><tr><th>operation</th><th class=\"n\">price</th><th>source</th></tr></thead>\n<tbody>\n");
  for (int i = 0; i < t->count; i++) {
    fprintf(out, "<tr><th><code>");
    sf_xml_escape(out, t->price[i].key);
    fprintf(out, "</code></th><td class=\"n\"><data data-key=\"ledgers.technology.prices[%d].fj\" value=\"%llu\">", i,
            (unsigned long long)t->price[i].fj);
    sf_xml_escape(out, t->price[i].text);
    fprintf(out, "</data></td><td>");
    sf_xml_escape(out, t->price[i].source);
    fprintf(out, "</td></tr>\n");
  }
  fprintf(
      out,
      "</tbody></table></div>\n<p class=\"note\">Integer prices carry the width in bits; memories carry their size in "
      "bytes and are priced per access of 64 bits. Widths and sizes between are interpolated.</p></div>\n</div>\n");
}

void html_prices(FILE *out, const sf_page *page)
{
  fprintf(out, "<section id=\"prices\">\n<h2>How much hangs on the prices</h2>\n");
  tornado_figure(out, page);
  fprintf(out, "<div class=\"grid\">\n");
  break_even_figure(out, page);
  price_table(out, &page->report->ledgers.technology);
  html_units(out, page);
  fprintf(out, "</section>\n");
}
