/* PSNR against energy for t = 1..T: what another time step buys. */
#include "page/internal.h"
#include <math.h>

enum { WIDTH = 520, HEIGHT = 340, LEFT = 44, RIGHT = 12, TOP = 24, BOTTOM = 48 };

typedef struct axes {
  double x1, y0, y1; /* energy from 0 to x1, PSNR from y0 to y1 */
} axes;

static double at_x(const axes *a, double fj)
{
  return LEFT + (WIDTH - LEFT - RIGHT) * fj / a->x1;
}

static double at_y(const axes *a, double psnr)
{
  return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (psnr - a->y0) / (a->y1 - a->y0);
}

/* A picture that equals the photograph has no PSNR. */
static bool drawn(const sf_page_prefix *p)
{
  return isfinite(p->psnr);
}

static int points(const sf_page *page)
{
  int n = 0;
  for (int t = 0; t < SF_T_MAX; t++) n += drawn(&page->prefix[t]);
  return n;
}

static axes choose_axes(const sf_page *page)
{
  axes a = {.x1 = 0, .y0 = INFINITY, .y1 = -INFINITY};
  for (int t = 0; t < SF_T_MAX; t++) {
    const sf_page_prefix *p = &page->prefix[t];
    a.x1 = fmax(a.x1, (double)p->fj);
    if (drawn(p)) a.y0 = fmin(a.y0, p->psnr), a.y1 = fmax(a.y1, p->psnr);
  }
  if (page->whole) a.x1 = fmax(a.x1, (double)page->report->ledger.ann_fj);
  const double pad = fmax((a.y1 - a.y0) * 0.12, 0.1);
  a.x1 = a.x1 > 0 ? a.x1 * 1.06 : 1, a.y0 -= pad, a.y1 += pad;
  return a;
}

static void draw_axes(FILE *out, const axes *a)
{
  static const char *const unit[] = {"fJ", "pJ", "nJ", "\xc2\xb5J", "mJ", "J"};
  double scale = 1;
  int u = 0;
  for (; u < 5 && a->x1 / scale >= 1000; u++) scale *= 1000;
  const double dx = svg_tick(a->x1 / scale, 6), dy = svg_tick(a->y1 - a->y0, 6);
  for (double y = ceil(a->y0 / dy) * dy; y <= a->y1; y += dy) {
    svg_line(out, LEFT, at_y(a, y), WIDTH - RIGHT, at_y(a, y), "gridline");
    svg_text(out, LEFT - 8, at_y(a, y) + 4, "num mut end", "%g", round(y / dy) * dy);
  }
  for (double x = 0; x * scale <= a->x1; x += dx) {
    svg_line(out, at_x(a, x * scale), HEIGHT - BOTTOM, at_x(a, x * scale), HEIGHT - BOTTOM + 5, "ax");
    svg_text(out, at_x(a, x * scale), HEIGHT - BOTTOM + 20, "num mut mid", "%g", x);
  }
  svg_line(out, LEFT, HEIGHT - BOTTOM, WIDTH - RIGHT, HEIGHT - BOTTOM, "ax");
  svg_text(out, 0, TOP - 12, "mut", "PSNR, dB");
  svg_text(out, WIDTH - RIGHT, HEIGHT - 8, "mut end", "energy of the view, %s (paper ledger)", unit[u]);
}

static void draw_points(FILE *out, const sf_page *page, const axes *a)
{
  char to = 'M';
  fprintf(out, "<path class=\"curve\" d=\"");
  for (int t = 0; t < SF_T_MAX; t++) {
    if (!drawn(&page->prefix[t])) continue;
    fprintf(out, "%c%.1f %.1f", to, at_x(a, (double)page->prefix[t].fj), at_y(a, page->prefix[t].psnr));
    to = 'L';
  }
  fprintf(out, "\"/>\n");
  for (int t = 0; t < SF_T_MAX; t++) {
    const sf_page_prefix *p = &page->prefix[t];
    if (!drawn(p)) continue;
    const bool chosen = t + 1 == page->report->net->steps;
    const double x = at_x(a, (double)p->fj), y = at_y(a, p->psnr);
    char text[HTML_NUMBER];
    fprintf(out,
            "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%d\" class=\"%s\" data-key=\"page.prefix[%d].energy_fj\" "
            "data-value=\"%llu\"><title>t = %d: %.2f dB, %s</title></circle>\n",
            x, y, chosen ? 8 : 5, chosen ? "dot chosen" : "dot", t, (unsigned long long)p->fj, t + 1, p->psnr,
            html_energy(text, (double)p->fj));
    svg_text(out, x, y - (chosen ? 14 : 11), chosen ? "lab mid" : "num mid", "%d", t + 1);
  }
}

/* Whether a label of two lines whose right or left end is at x, y would touch a point or its number. */
static bool crowded(const sf_page *page, const axes *a, double x, double y, bool end)
{
  const double left = end ? x - 90 : x, right = left + 90;
  for (int t = 0; t < SF_T_MAX; t++) {
    const double px = at_x(a, (double)page->prefix[t].fj), py = at_y(a, page->prefix[t].psnr);
    if (drawn(&page->prefix[t]) && px > left - 14 && px < right + 14 && py > y - 24 && py < y + 54) return true;
  }
  return right > WIDTH || left < LEFT;
}

static void draw_twin(FILE *out, const sf_page *page, const axes *a)
{
  const double x = at_x(a, (double)page->report->ledger.ann_fj), high = TOP + 8, low = HEIGHT - BOTTOM - 28;
  char text[HTML_NUMBER];
  if (!page->whole) return;
  svg_line(out, x, TOP, x, HEIGHT - BOTTOM, "twin");
  for (int i = 0; i < 4; i++) {
    const bool end = i < 2;
    const double at = end ? x - 6 : x + 6, y = i % 2 ? low : high;
    if (crowded(page, a, at, y, end)) continue;
    svg_text(out, at, y, end ? "mut end" : "mut", "ReLU twin");
    svg_text(out, at, y + 18, end ? "mut end" : "mut", "%s", html_energy(text, (double)page->report->ledger.ann_fj));
    return;
  }
}

static void prefix_table(FILE *out, const sf_page *page)
{
  fprintf(out, "<div class=\"scroll\"><table class=\"narrow\"><caption>The same points as numbers</caption><thead><tr>"
               "<th class=\"n\">t</th><th class=\"n\">PSNR, dB</th><th class=\"n\">SSIM</th><th class=\"n\">energy</th>"
               "</tr></thead><tbody>\n");
  for (int t = 0; t < SF_T_MAX; t++) {
    const sf_page_prefix *p = &page->prefix[t];
    char key[48];
    fprintf(out, "<tr%s><th class=\"n\">%d</th><td class=\"n\">",
            t + 1 == page->report->net->steps ? " class=\"chosen\"" : "", t + 1);
    snprintf(key, sizeof key, "page.prefix[%d].psnr", t);
    html_put_real(out, key, p->psnr, "%.2f");
    snprintf(key, sizeof key, "page.prefix[%d].ssim", t);
    fprintf(out, "</td><td class=\"n\">");
    html_put_real(out, key, p->ssim, "%.4f");
    snprintf(key, sizeof key, "page.prefix[%d].energy_fj", t);
    fprintf(out, "</td><td class=\"n\">");
    html_put_energy(out, key, p->fj);
    fprintf(out, "</td></tr>\n");
  }
  fprintf(out, "</tbody></table></div>\n");
}

void html_quality(FILE *out, const sf_page *page)
{
  fprintf(out, "<section id=\"quality\">\n<h2>Picture quality against energy</h2>\n");
  if (!points(page) || page->prefix[0].fj == 0) {
    fprintf(out, "<p>%s</p>\n",
            !page->prefix[0].fj      ? "No ray of the view has samples: there is nothing to plot."
            : page->view->image.rgba ? "The picture equals the photograph: there is no PSNR to plot."
                                     : "The view has no photograph to compare with: PSNR is not measured.");
    prefix_table(out, page);
  } else {
    const axes a = choose_axes(page);
    char caption[512];
    snprintf(
        caption, sizeof caption,
        "The fixed-point core draws the view with 1 to %d time steps. PSNR measures the likeness to the photograph "
        "(higher is better; 1 dB is 21 %% less squared error). The large point, t = %d, is what this report audits: "
        "a network learns after how many steps to stop, and more of them may harm. The dashed line is what the "
        "ReLU twin spends.",
        SF_T_MAX, page->report->net->steps);
    html_figure_begin(out, "fig-quality", "split", "One more step: what it costs, what it brings.", caption);
    svg_begin(out, "svg-quality", WIDTH, HEIGHT, "PSNR against energy", "One point per number of time steps");
    draw_axes(out, &a);
    draw_twin(out, page, &a);
    draw_points(out, page, &a);
    svg_end(out);
    prefix_table(out, page);
    html_figure_end(out);
  }
  fprintf(out, "</section>\n");
}
