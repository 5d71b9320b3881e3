/* What the parts of the page share, with the page of make reproduce: the template's functions. They read the numbers
 * that they show from the page's JSON and say where they are from; text between tags is escaped. */
#ifndef SF_PAGE_INTERNAL_H
#define SF_PAGE_INTERNAL_H
#include "base/text.h"
#include "page/draw.h"
#include "page/page.h"

/* The template, in the order of the page. */
extern const char html_report[];        /* what every operation cost */
extern const char html_report_prices[]; /* the same work under other prices */
extern const char html_report_proof[];  /* quality, counts, limits, origin */

typedef struct html_view {
  const sf_page *page; /* for what is no number: pixels, spikes */
  const cJSON *json;
  sf_status status; /* the first value that was not there */
} html_view;

/* A value by its path; one that is not there has no node and stays in v->status. */
sf_template_value html_at(html_view *v, const char *format, ...) __attribute__((format(printf, 2, 3)));
double html_real(html_view *v, const char *format, ...) __attribute__((format(printf, 2, 3))); /* NaN where null */
const char *html_text(html_view *v, const char *format, ...) __attribute__((format(printf, 2, 3)));

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
