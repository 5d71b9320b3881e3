/* What the parts of the page share, with the page of make reproduce: the template's functions. They read the numbers
 * that they show from the page's JSON and say where they are from; text between tags is escaped. */
#ifndef SF_PAGE_INTERNAL_H
#define SF_PAGE_INTERNAL_H
#include "base/text.h"
#include "page/page.h"
#include "base/template.h"

extern const char html_report[], html_style[];
extern const char html_script[]; /* without '<' and '&': the page is XML too */

typedef struct html_view {
  const sf_page *page; /* for what is no number: pixels, spikes */
  const cJSON *json;
  sf_status status; /* the first value that was not there */
} html_view;

/* A value by its path; one that is not there has no node and stays in v->status. */
sf_template_value html_at(html_view *v, const char *format, ...) __attribute__((format(printf, 2, 3)));
double html_real(html_view *v, const char *format, ...) __attribute__((format(printf, 2, 3))); /* NaN where null */
const char *html_text(html_view *v, const char *format, ...) __attribute__((format(printf, 2, 3)));

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

/* What a heat map shows of a pixel: its samples; the energy of one of them, 0 without any. */
typedef double html_pixel(const sf_golden *golden, size_t pixel);
html_pixel html_samples, html_sample_fj;
/* Prices of one event, by part and row, and how they come about. */
void html_add_units(cJSON *json, const sf_page *page);

/* Functions of the template; user is the html_view. */
#define HTML_FUNCTION(name) sf_status html_##name(FILE *out, const sf_template_value *value, void *user)
HTML_FUNCTION(golden_picture);
HTML_FUNCTION(energy_map);
HTML_FUNCTION(energy_scale);
HTML_FUNCTION(samples_map);
HTML_FUNCTION(samples_scale);
HTML_FUNCTION(steps_map);
HTML_FUNCTION(steps_scale);
HTML_FUNCTION(by_step);
HTML_FUNCTION(by_layer);
HTML_FUNCTION(raster);
HTML_FUNCTION(rates);
HTML_FUNCTION(ledger_savings);
HTML_FUNCTION(reading_savings);
HTML_FUNCTION(ledger_bars); /* of a ledger and its twin */
HTML_FUNCTION(tornado);     /* of a ledger */
HTML_FUNCTION(break_even);
HTML_FUNCTION(quality);
HTML_FUNCTION(put_count);
HTML_FUNCTION(put_energy);
HTML_FUNCTION(put_energy_in);
HTML_FUNCTION(put_energy_text);
HTML_FUNCTION(put_saving);
HTML_FUNCTION(put_real2);
HTML_FUNCTION(put_real4);
HTML_FUNCTION(put_group);
HTML_FUNCTION(put_price);
HTML_FUNCTION(put_tenths);
HTML_FUNCTION(put_percent);
HTML_FUNCTION(put_base);
HTML_FUNCTION(put_as_text);
#endif
