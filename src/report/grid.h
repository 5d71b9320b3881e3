/* Tables of text cells: filled row by row, then written as Markdown, CSV and JSON. */
#ifndef SF_REPORT_GRID_H
#define SF_REPORT_GRID_H
#include "base/status.h"
#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdio.h>

enum { SF_GRID_COLUMNS = 20, SF_GRID_CELL = 200 };
typedef struct sf_grid {
  char name[300], title[400]; /* of its CSV file; heading, empty: none */
  int left;                   /* columns of text, the first ones; further ones to the right are numbers */
  bool text_last;             /* the last column is text, too */
  int rows, columns, at;
  char (*cell)[SF_GRID_COLUMNS][SF_GRID_CELL]; /* [rows]; the first row is the head; owned */
  char *note;                                  /* below the table, or NULL; owned */
} sf_grid;

/* All tables of a report, in order. The first failure stays in status, and nothing is added after it. */
typedef struct sf_grids {
  sf_grid *grid; /* owned */
  int count;
  sf_status status;
} sf_grids;

/* A new table at the end of the list; the functions below fill it. */
void sf_grid_begin(sf_grids *list, int left, const char *name, const char *title);
void sf_grid_row(sf_grids *list);
void sf_grid_cell(sf_grids *list, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* "-" for NaN; with a spread that is not NaN "1.23 +- 0.04". */
void sf_grid_number(sf_grids *list, int digits, double value);
void sf_grid_spread(sf_grids *list, int digits, double value, double spread);
void sf_grid_energy(sf_grids *list, double mj, double spread);
void sf_grid_note(sf_grids *list, const char *format, ...) __attribute__((format(printf, 2, 3)));
void sf_grids_free(sf_grids *list);

void sf_grid_markdown(FILE *out, const sf_grid *grid); /* reads as plain text, too */
void sf_grid_csv(FILE *out, const sf_grid *grid);
cJSON *sf_grid_json(const sf_grid *grid); /* NULL: no memory */
#endif
