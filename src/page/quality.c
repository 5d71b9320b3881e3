/* PSNR against energy for t = 1..T: what another time step buys. */
#include "page/internal.h"
#include <math.h>

enum { WIDTH = 520, HEIGHT = 340, LEFT = 44, RIGHT = 12, TOP = 24, BOTTOM = 48 };

typedef struct point {
  double fj, psnr; /* PSNR NaN: not drawn */
} point;

typedef struct plot {
  html_view *v;
  int points;
  point point[SF_T_MAX];
  double twin_fj;    /* NaN: no line */
  double x1, y0, y1; /* energy from 0 to x1, PSNR from y0 to y1 */
} plot;

static double at_x(const plot *p, double fj)
{
  return LEFT + (WIDTH - LEFT - RIGHT) * fj / p->x1;
}

static double at_y(const plot *p, double psnr)
{
  return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (psnr - p->y0) / (p->y1 - p->y0);
}

static plot read_plot(html_view *v)
{
  plot p = {.v = v, .twin_fj = NAN, .x1 = 0, .y0 = INFINITY, .y1 = -INFINITY};
  if (cJSON_IsTrue(html_at(v, "page.whole").node)) p.x1 = p.twin_fj = html_real(v, "energy_ann_fj");
  p.points = cJSON_GetArraySize(html_at(v, "page.prefix").node);
  for (int t = 0; t < p.points && t < SF_T_MAX; t++) {
    const double fj = html_real(v, "page.prefix[%d].energy_fj", t), psnr = html_real(v, "page.prefix[%d].psnr", t);
    p.point[t] = (point){fj, psnr};
    p.x1 = fmax(p.x1, fj), p.y0 = fmin(p.y0, psnr), p.y1 = fmax(p.y1, psnr); /* fmin, fmax: without NaN */
  }
  const double pad = fmax((p.y1 - p.y0) * 0.12, 0.1);
  p.x1 = p.x1 > 0 ? p.x1 * 1.06 : 1, p.y0 -= pad, p.y1 += pad;
  return p;
}

static void draw_axes(FILE *out, const plot *a)
{
  double scale;
  const char *unit = html_unit(a->x1, &scale);
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
  svg_text(out, WIDTH - RIGHT, HEIGHT - 8, "mut end", "energy of the view, %s (paper ledger)", unit);
}

static void draw_points(FILE *out, const plot *p)
{
  char to = 'M';
  fprintf(out, "<path class=\"curve\" d=\"");
  for (int t = 0; t < p->points; t++) {
    if (!isfinite(p->point[t].psnr)) continue;
    fprintf(out, "%c%.1f %.1f", to, at_x(p, p->point[t].fj), at_y(p, p->point[t].psnr));
    to = 'L';
  }
  fprintf(out, "\"/>\n");
  for (int t = 0; t < p->points; t++) {
    const bool chosen = t + 1 == (int)html_real(p->v, "t_r");
    const sf_template_value value = html_at(p->v, "page.prefix[%d].energy_fj", t);
    const double fj = p->point[t].fj, psnr = p->point[t].psnr;
    char text[HTML_NUMBER];
    if (!isfinite(psnr)) continue;
    fprintf(out, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%d\" class=\"%s\" data-key=\"%s\" data-value=\"", at_x(p, fj),
            at_y(p, psnr), chosen ? 8 : 5, chosen ? "dot chosen" : "dot", value.path);
    html_put_exact(out, value.node);
    fprintf(out, "\"><title>t = %d: %.2f dB, %s</title></circle>\n", t + 1, psnr, html_energy(text, fj));
    svg_text(out, at_x(p, fj), at_y(p, psnr) - (chosen ? 14 : 11), chosen ? "lab mid" : "num mid", "%d", t + 1);
  }
}

/* Whether a label of two lines whose right or left end is at x, y would touch a point or its number. */
static bool crowded(const plot *p, double x, double y, bool end)
{
  const double left = end ? x - 90 : x, right = left + 90;
  for (int t = 0; t < p->points; t++) {
    const double px = at_x(p, p->point[t].fj), py = at_y(p, p->point[t].psnr); /* NaN is nowhere */
    if (px > left - 14 && px < right + 14 && py > y - 24 && py < y + 54) return true;
  }
  return right > WIDTH || left < LEFT;
}

static void draw_twin(FILE *out, const plot *p)
{
  const double x = at_x(p, p->twin_fj), high = TOP + 8, low = HEIGHT - BOTTOM - 28;
  char text[HTML_NUMBER];
  if (isnan(p->twin_fj)) return;
  svg_line(out, x, TOP, x, HEIGHT - BOTTOM, "twin");
  for (int i = 0; i < 4; i++) {
    const bool end = i < 2;
    const double at = end ? x - 6 : x + 6, y = i % 2 ? low : high;
    if (crowded(p, at, y, end)) continue;
    svg_text(out, at, y, end ? "mut end" : "mut", "ReLU twin");
    svg_text(out, at, y + 18, end ? "mut end" : "mut", "%s", html_energy(text, p->twin_fj));
    return;
  }
}

HTML_FUNCTION(quality)
{
  html_view *v = user;
  const plot p = read_plot(v);
  (void)value;
  svg_begin(out, "svg-quality", WIDTH, HEIGHT, "PSNR against energy", "One point per number of time steps");
  draw_axes(out, &p);
  draw_twin(out, &p);
  draw_points(out, &p);
  svg_end(out);
  return v->status;
}
