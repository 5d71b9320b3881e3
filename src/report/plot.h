/* What plots share: gnuplot scripts. */
#ifndef SF_REPORT_PLOT_H
#define SF_REPORT_PLOT_H
#include <stddef.h>
#include <stdio.h>

/* The head of NAME.gp, which writes NAME.svg; Okabe and Ito's colours,
 * told apart by all eyes. */
void sf_plot_head(FILE *out, const char *name, const char *title, const char *x, const char *y, const char *key);
/* Text of a title between single quotes: what could end it is replaced. */
void sf_plot_quote(char *to, size_t size, const char *from);
enum { SF_PLOT_COLOURS = 7 };
extern const char *const sf_plot_colour[SF_PLOT_COLOURS];
#endif
