/* How much hangs on each price, at which firing rate the balance tips. */
#include "page/internal.h"
#include <math.h>
#include <stdlib.h>

enum { WIDTH = 480, ROW = 46, TOP = 22, SWINGS = 6 };

/* ---- tornado ---- */

typedef struct swing {
  int index; /* in ledgers.sensitivity */
  double less, more;
} swing;

static double width_of(const swing *s)
{
  return fabs(s->more - s->less);
}

static int by_swing(const void *a, const void *b)
{
  const swing *x = a, *y = b;
  return width_of(x) < width_of(y) ? 1 : width_of(x) > width_of(y) ? -1 : x->index - y->index;
}

static sf_template_value saving_at(html_view *v, int index, const char *key, const char *side)
{
  return html_at(v, "ledgers.sensitivity[%d].saving_percent.%s.%s", index, key, side);
}

/* Those that are worth a bar: at most SWINGS, and none below a twentieth of the largest. */
static int swings_of(html_view *v, const char *key, swing list[SF_PRICES_MAX])
{
  const int prices = cJSON_GetArraySize(html_at(v, "ledgers.sensitivity").node);
  int n = 0;
  for (int i = 0; i < prices && i < SF_PRICES_MAX; i++) {
    const double less = sf_json_real(saving_at(v, i, key, "less").node);
    const double more = sf_json_real(saving_at(v, i, key, "more").node);
    if (isfinite(less) && isfinite(more) && fabs(less - more) > 1e-9) list[n++] = (swing){i, less, more};
  }
  /* cppcheck-suppress uninitvar ; the first n are set above */
  qsort(list, (size_t)n, sizeof *list, by_swing);
  while (n > SWINGS || (n > 1 && width_of(&list[n - 1]) < width_of(&list[0]) / 20)) n--;
  return n;
}

typedef struct tornado {
  html_view *v;
  const char *key;        /* of the ledger */
  double now, low, scale; /* percent saved; pixels per percent from low on */
} tornado;

enum { X0 = 62 }; /* numbers stand at both ends */

static double x_of(const tornado *t, double percent)
{
  return X0 + (percent - t->low) * t->scale;
}

static void half_bar(FILE *out, const tornado *t, int index, const char *side, double y, const char *style,
                     const char *tip)
{
  const sf_template_value value = saving_at(t->v, index, t->key, side);
  const double to = sf_json_real(value.node), a = fmin(t->now, to), b = fmax(t->now, to);
  svg_bar(out, x_of(t, a), y, (b - a) * t->scale, 14, style, &value, tip);
}

static const char *price_words(html_view *v, const char *key)
{
  const cJSON *price;
  cJSON_ArrayForEach(price, html_at(v, "ledgers.technology.prices").node)
  {
    if (sf_json_says(price, "key", key)) return sf_json_text(price, "text");
  }
  return "";
}

static void swing_row(FILE *out, const tornado *t, const swing *s, double y)
{
  const char *price = html_text(t->v, "ledgers.sensitivity[%d].price", s->index);
  const double a = fmin(s->less, s->more), b = fmax(s->less, s->more);
  char tip[160], text[HTML_NUMBER];
  svg_text(out, 0, y + 12, "lab", "%s  (%s)", price, price_words(t->v, price));
  snprintf(tip, sizeof tip, "%s at half its price: %.2f %% saved", price, s->less);
  half_bar(out, t, s->index, "less", y + 22, "bar cheap", tip);
  snprintf(tip, sizeof tip, "%s at one and a half times its price: %.2f %% saved", price, s->more);
  half_bar(out, t, s->index, "more", y + 22, "bar dear", tip);
  svg_text(out, x_of(t, a) - 4, y + 34, "num end", "%s", html_tenths(text, a));
  svg_text(out, x_of(t, b) + 4, y + 34, "num", "%s", html_tenths(text, b));
}

/* Nothing of a ledger that no price moves, or that has no saving. */
HTML_FUNCTION(tornado)
{
  html_view *v = user;
  swing list[SF_PRICES_MAX];
  const char *name = html_text(v, "%s.title", value->path);
  tornado t = {
      .v = v, .key = html_text(v, "%s.key", value->path), .now = html_real(v, "%s.saving_percent", value->path)};
  const int n = swings_of(v, t.key, list);
  if (!isfinite(t.now) || n == 0) return v->status;
  double high = t.now;
  t.low = t.now;
  for (int i = 0; i < n; i++) {
    t.low = fmin(t.low, fmin(list[i].less, list[i].more));
    high = fmax(high, fmax(list[i].less, list[i].more));
  }
  t.scale = (WIDTH - 2 * X0) / fmax(high - t.low, 1e-6);
  char id[48], title[96], text[HTML_NUMBER];
  snprintf(id, sizeof id, "svg-tornado-%s", t.key);
  snprintf(title, sizeof title, "Sensitivity of the %s ledger", name);
  fprintf(out, "<div><h3>");
  sf_xml_escape(out, name);
  fprintf(out, "</h3>\n");
  svg_begin(out, id, WIDTH, TOP + ROW * n + 4, title,
            "Saving when a price is halved or raised by half, largest change first");
  svg_line(out, x_of(&t, t.now), TOP - 4, x_of(&t, t.now), TOP + ROW * n + 2, "ax");
  svg_text(out, fmin(fmax(x_of(&t, t.now), 60), WIDTH - 60), 12, "num mid", "now %s", html_percent(text, t.now));
  for (int i = 0; i < n; i++) swing_row(out, &t, &list[i], TOP + ROW * i);
  svg_end(out);
  fprintf(out, "</div>\n");
  return v->status;
}

/* ---- break-even ---- */

static const char *ledger_title(html_view *v, const char *key)
{
  const cJSON *ledger;
  cJSON_ArrayForEach(ledger, html_at(v, "ledgers.list").node)
  {
    if (sf_json_says(ledger, "key", key)) return sf_json_text(ledger, "title");
  }
  return "";
}

static void break_even_row(FILE *out, html_view *v, int i, double y)
{
  enum { LEFT = 8, RIGHT = WIDTH - 8 };
  const sf_template_value value = html_at(v, "ledgers.break_even[%d].firing_rate", i);
  const double now = html_real(v, "ledgers.firing_rate"), at_now = LEFT + (RIGHT - LEFT) * fmin(now, 1);
  const double even = sf_json_real(value.node);
  svg_text(out, 0, y + 14, "lab", "%s against %s", ledger_title(v, html_text(v, "ledgers.break_even[%d].ledger", i)),
           ledger_title(v, html_text(v, "ledgers.break_even[%d].twin", i)));
  svg_line(out, LEFT, y + 32, RIGHT, y + 32, "gridline");
  if (isnan(even)) {
    svg_text(out, WIDTH, y + 14, "num strong end bad", "none");
  } else {
    const double at = LEFT + (RIGHT - LEFT) * fmin(even, 1);
    svg_line(out, LEFT, y + 32, at, y + 32, "gain");
    fprintf(out, "<path d=\"M%.1f %.1fl-7 -10h14z\" class=\"even\" data-key=\"%s\" data-value=\"%.17g\"/>\n", at,
            y + 30, value.path, even);
    if (even > 1)
      svg_text(out, WIDTH, y + 14, "num strong end good", ">100 %%");
    else
      svg_text(out, WIDTH, y + 14, now < even ? "num strong end good" : "num strong end bad", "%.2f %%", 100 * even);
  }
  fprintf(out,
          "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"6\" class=\"dot chosen\"><title>measured: %.2f %%</title></circle>\n",
          at_now, y + 32, 100 * now);
}

HTML_FUNCTION(break_even)
{
  html_view *v = user;
  const int rows = cJSON_GetArraySize(html_at(v, "page.pairs").node);
  (void)value;
  svg_begin(out, "svg-break-even", WIDTH, ROW * rows + 22, "Break-even firing rates",
            "One line per comparison, from 0 to 100 %");
  for (int i = 0; i < rows; i++) break_even_row(out, v, i, ROW * i);
  svg_percents(out, 8, WIDTH - 8, WIDTH, ROW * rows + 16);
  svg_end(out);
  return v->status;
}
