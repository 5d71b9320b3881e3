/* What the parts of the page share. Text between tags is escaped, numbers come with their place in the JSON. */
#ifndef SF_PAGE_INTERNAL_H
#define SF_PAGE_INTERNAL_H
#include "base/text.h"
#include "page/page.h"

enum { HTML_NUMBER = 48 }; /* characters of a formatted number */

/* "12 345" with narrow spaces; "70.98 mJ", the unit chosen so that 1..999 stands before it. */
const char *html_count(char text[HTML_NUMBER], uint64_t value);
const char *html_energy(char text[HTML_NUMBER], double fj);
const char *html_tenths(char text[HTML_NUMBER], double value); /* a real minus sign, one decimal */
const char *html_percent(char text[HTML_NUMBER], double percent);

/* <data> elements; key is the JSON path: "counts.layers[0].mac[1]". */
void html_put_count(FILE *out, const char *key, uint64_t value);
void html_put_energy(FILE *out, const char *key, uint64_t fj);
/* In the unit that suits `top`, for columns of one unit. */
void html_put_energy_in(FILE *out, const char *key, uint64_t fj, uint64_t top);
void html_put_saving(FILE *out, const char *key, double saving);                  /* "61.7 % saved", "7.1 % more" */
void html_put_real(FILE *out, const char *key, double value, const char *format); /* "-" where not finite */
/* <img> with the picture inside. alt is escaped. */
sf_status html_put_png(FILE *out, const uint8_t *pixel, int width, int height, const uint8_t *palette, int colours,
                       const char *alt);

/* A figure of the page: heading, explanation (HTML), then its pictures. */
void html_figure_begin(FILE *out, const char *id, const char *wide, const char *title, const char *caption);
void html_figure_end(FILE *out);

/* SVG of width x height units with a name for those who do not see it. */
void svg_begin(FILE *out, const char *id, double width, double height, const char *title, const char *description);
void svg_end(FILE *out);
void svg_text(FILE *out, double x, double y, const char *style, const char *format, ...)
    __attribute__((format(printf, 5, 6)));
void svg_line(FILE *out, double x1, double y1, double x2, double y2, const char *style);
/* style: class; tip: what a pointer shows. key and value NULL, 0: not in the JSON. */
void svg_bar(FILE *out, double x, double y, double width, double height, const char *style, const char *key,
             uint64_t value, const char *tip);
/* Step of an axis that gives at most `most` intervals up to `span`: 1, 2 or 5 times a power of ten. */
double svg_tick(double span, int most);

/* Parts of the page, in its order. */
const char *html_base_name(const char *path);
void html_head(FILE *out, const sf_page *page);
void html_basics(FILE *out, const sf_page *page);
sf_status html_pictures(FILE *out, const sf_page *page);
void html_energy_section(FILE *out, const sf_page *page);
void html_spikes(FILE *out, const sf_page *page);
void html_ledgers(FILE *out, const sf_page *page); /* html_prices follows inside */
void html_prices(FILE *out, const sf_page *page);
void html_units(FILE *out, const sf_page *page);
void html_quality(FILE *out, const sf_page *page);
void html_counts(FILE *out, const sf_page *page);
void html_limits(FILE *out, const sf_page *page);
void html_origin(FILE *out, const sf_page *page);

extern const char *const html_style[];  /* lines, NULL at the end */
extern const char *const html_script[]; /* without '<' and '&': the page is XML too */

/* Neurons of a layer by firing rate at a step; returns how many never fire. */
int html_rate_bins(const sf_page *page, int layer, int step, int bin[SF_PAGE_BINS]);
/* Paper ledger of one layer at one step. */
uint64_t html_layer_fj(const fx_counts *counts, int layer, int step);
#endif
