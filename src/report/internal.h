/* What the report's files share. */
#ifndef SF_REPORT_INTERNAL_H
#define SF_REPORT_INTERNAL_H
#include "report/report.h"

/* Profile scenes: twin and spiking runs alone, on scenes of any kind. */
bool sf_report_is_pairs(const sf_reproduction *r);
/* Adds one line to r->problem, less the report's folder in paths. */
sf_status sf_report_problem(sf_reproduction *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* *json is NULL where the file is missing (no problem) or malformed (a problem). */
sf_status sf_report_read_json(sf_reproduction *r, const char *path, cJSON **json);

/* The audits and renderings of a run: audit-K.json, fixed-K.json, float-K.json, prefix-T-K.json of views K.
 * `reference`: the folder whose audits give the sizes of the nets; the ANN has no audits of its own. */
sf_status sf_report_load_frames(sf_reproduction *r, const char *dir, const char *reference, bool ann, sf_run *run);
/* t* over the iterations from the trainer's log; a line cut by a kill and lines repeated after a resume are dropped. */
sf_status sf_report_load_log(const char *path, sf_run *run);

/* Gnuplot: the head of NAME.gp, which writes NAME.svg; Okabe and Ito's colours, told apart by all eyes. */
void sf_plot_head(FILE *out, const char *name, const char *title, const char *x, const char *y, const char *key);
enum { SF_PLOT_COLOURS = 7 };
extern const char *const sf_plot_colour[SF_PLOT_COLOURS];
#endif
