/* What the report's files share. */
#ifndef SF_REPORT_INTERNAL_H
#define SF_REPORT_INTERNAL_H
#include "report/grid.h"
#include "report/plot.h"
#include "report/report.h"
#include <math.h>

/* Of what is no NaN; NaN of nothing. */
typedef struct sf_mean {
  double sum;
  int count;
} sf_mean;
static inline void sf_mean_add(sf_mean *m, double value)
{
  if (!isnan(value)) m->sum += value, m->count++;
}
static inline double sf_mean_of(const sf_mean *m)
{
  return m->count ? m->sum / m->count : NAN;
}
static inline double sf_squared_error(double psnr)
{
  return pow(10, -psnr / 10);
}

/* Profile scenes: twin and spiking runs alone, on scenes of any kind. */
bool sf_report_is_pairs(const sf_reproduction *r);
/* 0: not there. */
double sf_report_number(const cJSON *json, const char *key);
/* Whether some run of the scene says what field it has. */
bool sf_report_says_field(const sf_report_scene *scene);
/* Whether the profile makes this run of the scene, or it was made. */
bool sf_report_expected(const sf_reproduction *r, int s, int run);
const char *sf_report_field(int group); /* "hash grid", "TensoRF" */
/* The name of a scene without its field. */
void sf_report_scene_name(const sf_report_scene *scene, char name[256]);
/* What the numbers of a run were measured on: scenes, seeds, views, frames. */
void sf_report_origin(const sf_reproduction *r, int scenes, int run, char text[SF_GRID_CELL]);

/* All tables, in order. The caller frees them, after a failure, too. */
sf_status sf_report_tables(const sf_reproduction *r, sf_grids *tables);
void sf_report_add_pairs(sf_grids *tables, const sf_reproduction *r);
void sf_report_add_balance(sf_grids *tables, const sf_reproduction *r); /* worth and price of a step */
void sf_report_add_models(sf_grids *tables, const sf_reproduction *r);  /* spiking and ordinary models */

void sf_report_add_comparators(sf_grids *tables, const sf_reproduction *r); /* what PATA is held against, measured */

/* The name of the i-th plot of chosen scenes; empty: there is none of them. False: there are no more. */
bool sf_report_plot(const sf_reproduction *r, int scenes, int i, char name[300]);

extern const char sf_report_page_text[]; /* reproduction.html */

/* One picture of a scene beside the truth, of JSON {"file", "truth", "crop": [x, y, side]}: whole, magnified, its
 * errors. */
sf_status sf_report_put_picture(FILE *out, const sf_reproduction *r, const cJSON *cell);
sf_status sf_report_put_crop(FILE *out, const sf_reproduction *r, const cJSON *cell);
sf_status sf_report_put_error(FILE *out, const sf_reproduction *r, const cJSON *cell);
/* The pictures that there are: a list of {"name", "view", "cells"}. NULL: no memory. A picture that cannot be read or
 * has another size than the truth is left out. */
cJSON *sf_report_pictures(const sf_reproduction *r);

/* Runs of other parameters than the first one's are a problem. */
sf_status sf_report_compare_parameters(sf_reproduction *r);
/* Numbers over the seeds, and what is computed from several runs; the group of every scene. */
void sf_report_pool(sf_reproduction *r);
sf_status sf_report_no_memory(const sf_reproduction *r);
/* Adds one line to r->problem, less the report's folder in paths. */
sf_status sf_report_problem(sf_reproduction *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* *json is NULL where the file is missing (no problem) or malformed (a problem). */
sf_status sf_report_read_json(sf_reproduction *r, const char *path, cJSON **json);

/* The audits and renderings of a run: audit-K.json, fixed-K.json, float-K.json, prefix-T-K.json of views K.
 * `reference`: the folder whose audits give the sizes of the nets; the ANN has no audits of its own. */
sf_status sf_report_load_frames(sf_reproduction *r, const char *dir, const char *reference, bool ann, sf_run *run);
/* t* over the iterations from the trainer's log; a line cut by a kill and lines repeated after a resume are dropped. */
sf_status sf_report_load_log(const char *path, sf_run *run);
#endif
