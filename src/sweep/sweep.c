/* A folder of points to tables: which widths cost what, and which points no other beats. */
#include "report/internal.h"
#include "energy/energy.h"
#include "base/io.h"
#include "base/text.h"
#include "sweep/sweep.h"
#include <dirent.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS_MAX = 65536, NAME_MAX_BYTES = 256, TEXT_MAX = 4096 };

/* ---- loading ---- */

static sf_status read_backbone(const cJSON *json, const char *path, int *backbone)
{
  char name[16];
  SF_TRY(sf_json_need_text(json, path, "backbone", name, sizeof name));
  for (*backbone = 0; *backbone < SF_FIELDS; ++*backbone)
    if (!strcmp(name, sf_field_of(&(sf_config){.backbone = *backbone})->name)) return sf_ok();
  return sf_fail(SF_E_FORMAT, "%s: backbone '%s' is unknown", path, name);
}

static sf_status read_point(const cJSON *json, const char *path, sf_point *point)
{
  SF_TRY(sf_json_need_text(json, path, "name", point->name, sizeof point->name));
  SF_TRY(sf_json_need_text(json, path, "model", point->model, sizeof point->model));
  SF_TRY(read_backbone(json, path, &point->backbone));
  for (int i = 0; i < SF_AXES; i++) {
    if (!sf_axes[i].title[point->backbone]) continue;
    const double value = sf_json_number(json, sf_axes[i].name);
    const int most = i == SF_AXIS_TABLE ? 4096 : 64;
    if (!(value >= 0 && value <= most))
      return sf_fail(SF_E_FORMAT, "%s: no number '%s' in 0..%d", path, sf_axes[i].name, most);
    point->axis[i] = (int)value;
  }
  for (int i = 0; i < SF_POINT_FIGURES; i++) {
    const char *key = sf_point_figures[i].name;
    const cJSON *item;
    SF_TRY(sf_json_need(json, path, key, &item));
    point->figure[i] = sf_json_number(json, key); /* null, a PSNR of equal images, is NaN */
  }
  return sf_ok();
}

static sf_status load_point(const char *path, sf_point *point)
{
  cJSON *json;
  SF_TRY(sf_json_load(path, &json));
  const sf_status status = read_point(json, path, point);
  cJSON_Delete(json);
  return status;
}

static int is_point(const struct dirent *entry)
{
  const size_t n = strlen(entry->d_name);
  return n > 5 && n < NAME_MAX_BYTES && !strcmp(entry->d_name + n - 5, ".json");
}

static sf_status load_points(sf_sweep *sweep, struct dirent **list, int count, const char *centre, int *at)
{
  char path[sizeof sweep->dir + NAME_MAX_BYTES + 16];
  if (count > POINTS_MAX) return sf_fail(SF_E_RANGE, "%s/points: more than %d points", sweep->dir, POINTS_MAX);
  sweep->point = calloc((size_t)count + 1, sizeof *sweep->point);
  if (!sweep->point) return sf_fail(SF_E_MEMORY, "%s: no memory for %d points", sweep->dir, count);
  for (int i = 0; i < count; i++) {
    snprintf(path, sizeof path, "%s/points/%.*s", sweep->dir, NAME_MAX_BYTES, list[i]->d_name);
    SF_TRY(load_point(path, &sweep->point[sweep->count++]));
    if (!strncmp(list[i]->d_name, centre, strlen(centre)) && !strcmp(list[i]->d_name + strlen(centre), ".json"))
      *at = i;
  }
  return sf_ok();
}

static sf_status load(sf_sweep *sweep, const char *centre)
{
  char path[sizeof sweep->dir + 16];
  struct dirent **list = NULL;
  int at = -1;
  snprintf(path, sizeof path, "%s/points", sweep->dir);
  const int count = scandir(path, &list, is_point, alphasort);
  if (count < 0) return sf_fail(SF_E_IO, "%s: cannot be read", path);
  const sf_status status = load_points(sweep, list, count, centre, &at);
  for (int i = 0; i < count; i++) free(list[i]);
  free(list);
  SF_TRY(status);
  if (at < 0) return sf_fail(SF_E_FORMAT, "%s: the point '%s' that the sweep goes around is missing", path, centre);
  sweep->centre = &sweep->point[at];
  for (int i = 0; i < sweep->count; i++)
    if (sweep->point[i].backbone != sweep->centre->backbone)
      return sf_fail(SF_E_UNSUPPORTED, "%s: %s and %s have fields of different kinds: they share no widths", path,
                     sweep->centre->model, sweep->point[i].model);
  return sf_ok();
}

sf_status sf_sweep_load(sf_sweep *sweep, const char *dir)
{
  char path[sizeof sweep->dir + 16], *centre;
  size_t size;
  *sweep = (sf_sweep){0};
  if (strlen(dir) >= sizeof sweep->dir) return sf_fail(SF_E_IO, "%.200s...: path is too long", dir);
  snprintf(sweep->dir, sizeof sweep->dir, "%s", dir);
  snprintf(path, sizeof path, "%s/centre", dir);
  SF_TRY(sf_read_file(path, NAME_MAX_BYTES, &centre, &size));
  centre[strcspn(centre, "\n")] = 0;
  const sf_status status = load(sweep, centre);
  free(centre);
  if (status.code != SF_OK) sf_sweep_free(sweep);
  return status;
}

void sf_sweep_free(sf_sweep *sweep)
{
  free(sweep->point);
  *sweep = (sf_sweep){0};
}

/* ---- comparing ---- */

static double as_printed(const sf_point *point, int figure)
{
  char text[64];
  if (isnan(point->figure[figure])) return INFINITY; /* equal images */
  snprintf(text, sizeof text, sf_point_figures[figure].format, point->figure[figure]);
  return strtod(text, NULL);
}

bool sf_point_beats(const sf_point *a, const sf_point *b, const int *cost, int costs)
{
  const double gain = as_printed(a, SF_POINT_PSNR_TRUTH) - as_printed(b, SF_POINT_PSNR_TRUTH);
  bool better = gain > 0;
  if (gain < 0) return false;
  for (int i = 0; i < costs; i++) {
    const double saved = as_printed(b, cost[i]) - as_printed(a, cost[i]);
    if (saved < 0) return false;
    better = better || saved > 0;
  }
  return better;
}

void sf_sweep_mark(sf_sweep *sweep)
{
  static const int costs[] = {SF_POINT_ENERGY, SF_POINT_BYTES, SF_POINT_TRAFFIC};
  for (int i = 0; i < sweep->count; i++) {
    sweep->point[i].front = true;
    for (int j = 0; j < sweep->count && sweep->point[i].front; j++)
      sweep->point[i].front = !sf_point_beats(&sweep->point[j], &sweep->point[i], costs, 3);
  }
}

bool sf_point_on_axis(const sf_sweep *sweep, const sf_point *point, int axis)
{
  for (int i = 0; i < SF_AXES; i++)
    if (i != axis && point->axis[i] != sweep->centre->axis[i]) return false;
  return true;
}

void sf_point_short_name(const sf_sweep *sweep, const sf_point *point, char *text, size_t size)
{
  size_t used = 0;
  snprintf(text, size, "centre");
  for (int i = 0; i < SF_AXES && used < size; i++)
    if (point->axis[i] != sweep->centre->axis[i])
      used += (size_t)snprintf(text + used, size - used, "%s%s%d", used ? " " : "", sf_axes[i].letter, point->axis[i]);
}

/* ---- tables ---- */

static const int columns[] = {SF_POINT_PSNR_TRUTH,
                              SF_POINT_PSNR_FLOAT,
                              SF_POINT_LOSS,
                              SF_POINT_MAX_ERROR,
                              SF_POINT_CLIPPED_FEATURES,
                              SF_POINT_CLIPPED_DENSITY,
                              SF_POINT_CLIPPED_STATES,
                              SF_POINT_ENERGY,
                              SF_POINT_BYTES,
                              SF_POINT_TRAFFIC,
                              SF_POINT_SPEED};
enum { COLUMNS = sizeof columns / sizeof *columns };

static void print_head(FILE *out, const char *first)
{
  fprintf(out, "| %s |", first);
  for (int c = 0; c < COLUMNS; c++) fprintf(out, " %s |", sf_point_figures[columns[c]].head);
  fprintf(out, "\n|---|");
  for (int c = 0; c < COLUMNS; c++) fprintf(out, "---:|");
  fputc('\n', out);
}

static void print_row(FILE *out, const char *first, const sf_point *point)
{
  fprintf(out, "| %s |", first);
  for (int c = 0; c < COLUMNS; c++) {
    const double value = point->figure[columns[c]];
    fputc(' ', out);
    if (isnan(value)) /* a PSNR of equal images, and what is lost against one */
      fputs(columns[c] == SF_POINT_LOSS ? "-" : "equal", out);
    else
      fprintf(out, sf_point_figures[columns[c]].format, value);
    fprintf(out, " |");
  }
  fputc('\n', out);
}

static int by_axis(const void *a, const void *b)
{
  const sf_point *x = *(const sf_point *const *)a, *y = *(const sf_point *const *)b;
  for (int i = 0; i < SF_AXES; i++)
    if (x->axis[i] != y->axis[i]) return y->axis[i] - x->axis[i];
  return strcmp(x->model, y->model);
}

static int by_quality(const void *a, const void *b)
{
  const sf_point *x = *(const sf_point *const *)a, *y = *(const sf_point *const *)b;
  const double p = as_printed(x, SF_POINT_PSNR_TRUTH), q = as_printed(y, SF_POINT_PSNR_TRUTH);
  return p != q ? (p < q) - (p > q) : by_axis(a, b);
}

/* Differs from the centre in `axis`, and perhaps in the number of steps; or is the centre. */
static bool in_table(const sf_sweep *sweep, const sf_point *point, int axis)
{
  sf_point same_steps = *point;
  if (sf_point_on_axis(sweep, point, axis)) return true;
  same_steps.axis[SF_AXIS_STEPS] = sweep->centre->axis[SF_AXIS_STEPS];
  return point->axis[axis] != sweep->centre->axis[axis] && sf_point_on_axis(sweep, &same_steps, axis);
}

static void print_axis(FILE *out, const sf_sweep *sweep, int axis, const sf_point **list)
{
  int n = 0;
  for (int i = 0; i < sweep->count; i++)
    if (in_table(sweep, &sweep->point[i], axis)) list[n++] = &sweep->point[i];
  if (n < 2) return;
  qsort(list, (size_t)n, sizeof *list, by_axis);
  fprintf(out, "\n## %s\n\n", sf_axes[axis].title[sweep->centre->backbone]);
  print_head(out, "point");
  for (int i = 0; i < n; i++) {
    char name[128];
    sf_point_short_name(sweep, list[i], name, sizeof name);
    print_row(out, name, list[i]);
  }
}

static void print_front(FILE *out, const sf_sweep *sweep, const sf_point **list)
{
  int n = 0;
  for (int i = 0; i < sweep->count; i++)
    if (sweep->point[i].front) list[n++] = &sweep->point[i];
  qsort(list, (size_t)n, sizeof *list, by_quality);
  fprintf(
      out,
      "\n## Pareto front\n\n%d of %d points; no other is as good in PSNR against the picture, energy, bytes and bits "
      "moved, all at once (as printed).\n\n",
      n, sweep->count);
  print_head(out, "point");
  for (int i = 0; i < n; i++) {
    char name[128];
    sf_point_short_name(sweep, list[i], name, sizeof name);
    print_row(out, name, list[i]);
  }
}

void sf_sweep_print(FILE *out, const sf_sweep *sweep)
{
  const sf_point **list = calloc((size_t)sweep->count + 1, sizeof *list);
  if (!list) return;
  fprintf(out, "# Widths: one parameter at a time, then the front\n\nModel %s, centre %s.\n", sweep->centre->model,
          sweep->centre->name);
  fprintf(out, "Points are named by what tells them from the centre:\n\n");
  const int backbone = sweep->centre->backbone;
  for (int i = 0; i < SF_AXES; i++)
    if (sf_axes[i].title[backbone])
      fprintf(out, "- %s: %s, %d\n", sf_axes[i].letter, sf_axes[i].title[backbone], sweep->centre->axis[i]);
  fprintf(out, "\npicture, float: PSNR against the picture and against the float field at the same steps.\n");
  fprintf(out, "lost: what float has more against the picture; error: the largest in a channel.\n");
  const char *entries = sf_axes[SF_AXIS_GRID].title[backbone]; /* "grid entries, bits" */
  fprintf(out, "Energy (paper ledger) and bits moved (weights, %.*s, states) are per frame.\n",
          (int)strcspn(entries, ","), entries);
  fprintf(out, "RTL cells and cycles per width: not available.\n");
  for (int axis = 0; axis < SF_AXES; axis++) print_axis(out, sweep, axis, list);
  print_front(out, sweep, list);
  free(list);
}

void sf_sweep_csv(FILE *out, const sf_sweep *sweep)
{
  fprintf(out, "name,model,front");
  for (int i = 0; i < SF_AXES; i++) fprintf(out, ",%s", sf_axes[i].name);
  for (int i = 0; i < SF_POINT_FIGURES; i++) fprintf(out, ",%s", sf_point_figures[i].name);
  fprintf(out, ",rtl_cells,rtl_cycles\n");
  for (int p = 0; p < sweep->count; p++) {
    const sf_point *point = &sweep->point[p];
    sf_csv_text(out, point->name);
    fputc(',', out);
    sf_csv_text(out, point->model);
    fprintf(out, ",%d", point->front);
    for (int i = 0; i < SF_AXES; i++)
      if (sf_axes[i].title[point->backbone])
        fprintf(out, ",%d", point->axis[i]);
      else
        fputc(',', out);
    for (int i = 0; i < SF_POINT_FIGURES; i++) fprintf(out, ",%.9g", point->figure[i]);
    fprintf(out, ",not available,not available\n");
  }
}
