/* How the house draws in a page: SVG, numbers as text, heat maps. The energy report and the pages of sf_view share it,
 * with the style sheet that its classes are of. */
#ifndef SF_PAGE_DRAW_H
#define SF_PAGE_DRAW_H
#include "base/text.h"
#include "base/template.h"

extern const char html_style[];
extern const char html_script[]; /* without '<' and '&': the report is XML too */

enum { HTML_NUMBER = 48 }; /* characters of a formatted number */
/* "12 345" with narrow spaces; "70.98 mJ", the unit chosen so that 1..999 stands before it. */
const char *html_count(char text[HTML_NUMBER], uint64_t value);
const char *html_energy(char text[HTML_NUMBER], double fj);
const char *html_tenths(char text[HTML_NUMBER], double value); /* a real minus sign, one decimal */
const char *html_percent(char text[HTML_NUMBER], double percent);
/* The unit in which `top` is 1..999, and its fJ. */
const char *html_unit(double top_fj, double *scale);
/* All digits, as in the JSON; 0 of null. */
void html_put_exact(FILE *out, const cJSON *node);
void html_base64(FILE *out, const uint8_t *data, size_t size);
/* <img> with the picture inside. alt is escaped. */
sf_status html_put_png(FILE *out, const uint8_t *pixel, int width, int height, const uint8_t *palette, int colours,
                       const char *alt);

/* SVG of width x height units with a name for those who do not see it; all of these are escaped. */
void svg_begin(FILE *out, const char *id, double width, double height, const char *title, const char *description);
void svg_end(FILE *out);
void svg_text(FILE *out, double x, double y, const char *style, const char *format, ...)
    __attribute__((format(printf, 5, 6)));
void svg_line(FILE *out, double x1, double y1, double x2, double y2, const char *style);
/* style: class; tip: what a pointer shows. */
void svg_bar(FILE *out, double x, double y, double width, double height, const char *style,
             const sf_template_value *value, const char *tip);
void svg_percents(FILE *out, double x0, double x1, double width, double y); /* labels of an axis from 0 to 100 % */
/* Step of an axis that gives at most `most` intervals up to `span`: 1, 2 or 5 times a power of ten. */
double svg_tick(double span, int most);

/* Colours of a heat map from low to high, RGBA; index 0 is transparent: nothing there. Monotone in lightness. */
enum { HTML_HEAT = 255 };
void html_heat_palette(uint8_t palette[4 * (HTML_HEAT + 1)], int colours);
/* The scale below a heat map. */
void html_colour_bar(FILE *out, const char *id, double low, double high, const char *unit);

/* Values over one axis, row below row, each with a scale of its own. */
typedef struct html_row {
  const char *title, *unit;
  const char *style; /* class of its line or bars */
  const double *y;   /* [n]; NaN: a gap */
  bool bars;
  double low, high; /* of the scale; equal: of the values and 0 */
} html_row;
typedef struct html_axis {
  const double *x; /* [n], ascending */
  int n;
  const char *title;
  int mark; /* this one stands out; -1: none */
} html_axis;
void html_rows(FILE *out, const char *id, const char *title, const html_axis *axis, const html_row *row, int rows);
#endif
