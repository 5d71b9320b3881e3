/* Tables of text cells. */
#include "report/grid.h"
#include "base/json.h"
#include "base/text.h"
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* ---- filling ---- */

static sf_grid *last(sf_grids *list)
{
  return list->status.code || !list->count ? NULL : &list->grid[list->count - 1];
}

static void no_memory(sf_grids *list)
{
  list->status = sf_fail(SF_E_MEMORY, "no memory for the tables");
}

void sf_grid_begin(sf_grids *list, int left, const char *name, const char *title)
{
  if (list->status.code) return;
  sf_grid *grid = realloc(list->grid, (size_t)(list->count + 1) * sizeof *grid);
  if (!grid) {
    no_memory(list);
    return;
  }
  list->grid = grid;
  grid = &list->grid[list->count++];
  *grid = (sf_grid){.left = left};
  snprintf(grid->name, sizeof grid->name, "%s", name);
  snprintf(grid->title, sizeof grid->title, "%s", title);
  sf_grid_row(list);
}

void sf_grid_row(sf_grids *list)
{
  sf_grid *grid = last(list);
  if (!grid) return;
  void *cell = realloc(grid->cell, (size_t)(grid->rows + 1) * sizeof *grid->cell);
  if (!cell) {
    no_memory(list);
    return;
  }
  grid->cell = cell;
  memset(grid->cell[grid->rows++], 0, sizeof *grid->cell);
  grid->at = 0;
}

void sf_grid_cell(sf_grids *list, const char *format, ...)
{
  sf_grid *grid = last(list);
  if (!grid || grid->at == SF_GRID_COLUMNS) return;
  char *text = grid->cell[grid->rows - 1][grid->at];
  va_list args;
  va_start(args, format);
  vsnprintf(text, SF_GRID_CELL, format, args);
  va_end(args);
  for (char *c = text; *c; c++)
    if (*c == '|') *c = '/';
  if (++grid->at > grid->columns) grid->columns = grid->at;
}

void sf_grid_spread(sf_grids *list, int digits, double value, double spread)
{
  const double shown = fabs(value) < 0.5 * pow(10, -digits) ? 0 : value; /* no "-0.00" */
  if (isnan(value))
    sf_grid_cell(list, "-");
  else if (isnan(spread))
    sf_grid_cell(list, "%.*f", digits, shown);
  else
    sf_grid_cell(list, "%.*f +- %.*f", digits, shown, digits, spread);
}

void sf_grid_number(sf_grids *list, int digits, double value)
{
  sf_grid_spread(list, digits, value, NAN);
}

void sf_grid_energy(sf_grids *list, double mj, double spread)
{
  sf_grid_spread(list, fabs(mj) >= 100 ? 2 : fabs(mj) >= 1 ? 3 : 5, mj, spread);
}

void sf_grid_note(sf_grids *list, const char *format, ...)
{
  sf_grid *grid = last(list);
  if (!grid) return;
  va_list args;
  va_start(args, format);
  if (vasprintf(&grid->note, format, args) < 0) grid->note = NULL, no_memory(list);
  va_end(args);
}

void sf_grids_free(sf_grids *list)
{
  for (int i = 0; i < list->count; i++) free(list->grid[i].cell), free(list->grid[i].note);
  free(list->grid);
  *list = (sf_grids){.status = sf_ok()};
}

/* ---- writing ---- */

static bool is_text(const sf_grid *grid, int column)
{
  return column < grid->left || (grid->text_last && column == grid->columns - 1);
}

static void rule(FILE *out, const sf_grid *grid, const int width[SF_GRID_COLUMNS])
{
  for (int c = 0; c < grid->columns; c++) {
    const bool text = is_text(grid, c);
    fputc('|', out);
    for (int i = 0; i < width[c] + (text ? 2 : 1); i++) fputc('-', out);
    if (!text) fputc(':', out);
  }
  fprintf(out, "|\n");
}

void sf_grid_markdown(FILE *out, const sf_grid *grid)
{
  int width[SF_GRID_COLUMNS] = {0};
  for (int r = 0; r < grid->rows; r++)
    for (int c = 0; c < grid->columns; c++) {
      const int n = (int)strlen(grid->cell[r][c]);
      if (n > width[c]) width[c] = n;
    }
  if (*grid->title) fprintf(out, "## %s\n\n", grid->title);
  for (int r = 0; r < grid->rows; r++) {
    for (int c = 0; c < grid->columns; c++)
      fprintf(out, is_text(grid, c) ? "| %-*s " : "| %*s ", width[c], grid->cell[r][c]);
    fprintf(out, "|\n");
    if (r == 0) rule(out, grid, width);
  }
  fprintf(out, "\n");
  if (grid->note) fprintf(out, "%s\n\n", grid->note);
}

void sf_grid_csv(FILE *out, const sf_grid *grid)
{
  for (int r = 0; r < grid->rows; r++)
    for (int c = 0; c < grid->columns; c++) {
      sf_csv_text(out, grid->cell[r][c]);
      fputc(c + 1 < grid->columns ? ',' : '\n', out);
    }
}

static cJSON *row_json(const sf_grid *grid, int row)
{
  cJSON *list = cJSON_CreateArray(), *text = cJSON_CreateObject();
  for (int c = 0; c < grid->columns; c++) {
    sf_json_add_text(text, "cell", grid->cell[row][c]);
    cJSON_AddItemToArray(list, cJSON_DetachItemFromObjectCaseSensitive(text, "cell"));
  }
  cJSON_Delete(text);
  return list;
}

cJSON *sf_grid_json(const sf_grid *grid)
{
  cJSON *json = cJSON_CreateObject();
  if (!json) return NULL;
  sf_json_add_text(json, "name", grid->name);
  sf_json_add_text(json, "title", grid->title);
  cJSON_AddItemToObject(json, "columns", row_json(grid, 0));
  cJSON *rows = cJSON_AddArrayToObject(json, "rows");
  for (int r = 1; r < grid->rows; r++) cJSON_AddItemToArray(rows, row_json(grid, r));
  if (grid->note) sf_json_add_text(json, "note", grid->note);
  return json;
}
