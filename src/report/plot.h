/* What plots share: gnuplot scripts. */
#ifndef SF_REPORT_PLOT_H
#define SF_REPORT_PLOT_H
#include "base/status.h"
#include <cjson/cJSON.h>
#include <stddef.h>
#include <stdio.h>

/* The head of NAME.gp, which writes NAME.svg; Okabe and Ito's colours,
 * told apart by all eyes. */
void sf_plot_head(FILE *out, const char *name, const char *title, const char *x, const char *y, const char *key);
/* Text of a title between single quotes: what could end it is replaced. */
void sf_plot_quote(char *to, size_t size, const char *from);
/* The name in a script's path, .../NAME.gp, which draws NAME.svg; SF_E_USAGE, "--plot PATH: expected NAME.gp", of
 * another. */
sf_status sf_plot_name(const char *path, char name[256]);
/* Writes the script at path that draws two audits side by side (sf_audits_compare): energy of the ledger with neuron
 * updates by kind, mJ per view. SF_E_USAGE as above, SF_E_IO. */
sf_status sf_plot_comparison(const char *path, const cJSON *comparison);
/* Writes the script at path that draws energy over time of all builds, the front, this build and the board's. Errors as
 * above. */
typedef struct sf_explore sf_explore;
sf_status sf_plot_explored(const char *path, const sf_explore *explore, double clock_mhz);
enum { SF_PLOT_COLOURS = 7 };
extern const char *const sf_plot_colour[SF_PLOT_COLOURS];
#endif
