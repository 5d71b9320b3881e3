/* The box and the points of TensoRF's planes and lines: a smaller box begins and ends at points of the scene; fewer
 * points are those of the nearest field (resample.c). Points that no occupied cell reads. */
#include "src/fx/tensorf_place.h"
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SHIFT_MAX = 40 };

/* ---- the box ---- */

static bool whole_box(const fx_scene *scene, const sf_trim_planes *p)
{
  for (int axis = 0; axis < 3; axis++)
    if (p->low[axis] != 0 || p->high[axis] != scene->tensorf.res[axis] - 1) return false;
  return true;
}

/* First and last cell that stays, per axis; false: none. */
static bool bounds_of_cells(const fx_scene *scene, const sf_trim_use *use, const sf_trim *trim, int first[3],
                            int last[3])
{
  const int64_t res = scene->occ_res;
  for (int axis = 0; axis < 3; axis++) first[axis] = scene->occ_res, last[axis] = -1;
  for (int64_t cell = 0; cell < res * res * res; cell++) {
    if (!(scene->occupancy[cell >> 3] >> (cell & 7) & 1) || !trim->cells[sf_cell_class(use, cell)]) continue;
    const int at[3] = {(int)(cell % res), (int)(cell / res % res), (int)(cell / res / res)};
    for (int axis = 0; axis < 3; axis++) {
      first[axis] = at[axis] < first[axis] ? at[axis] : first[axis];
      last[axis] = at[axis] > last[axis] ? at[axis] : last[axis];
    }
  }
  return last[0] >= 0;
}

bool sf_trim_box(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim)
{
  int first[3], last[3];
  bool changed = false;
  if (!bounds_of_cells(scene, use, trim, first, last)) return false;
  for (int axis = 0; axis < 3; axis++) {
    sf_trim_planes *p = &trim->planes;
    const double intervals = (double)(scene->tensorf.res[axis] - 1) / scene->occ_res;
    const int low = (int)floor(first[axis] * intervals), high = (int)ceil((last[axis] + 1) * intervals);
    if (scene->tensorf.res[axis] < 2 || (low <= p->low[axis] && high >= p->high[axis])) continue;
    const double density = (double)(p->points[axis] - 1) / (p->high[axis] - p->low[axis]);
    p->low[axis] = low > p->low[axis] ? low : p->low[axis], p->high[axis] = high < p->high[axis] ? high : p->high[axis];
    const int points = (int)nearbyint((p->high[axis] - p->low[axis]) * density) + 1;
    p->points[axis] = points < 2 ? 2 : points;
    changed = true;
  }
  return changed;
}

/* The box and what is measured in its longest edge. */
void sf_planes_set_box(const fx_scene *scene, const sf_trim_planes *p, fx_scene *result)
{
  const fx_units *from = &scene->units;
  fx_units *to = &result->units;
  double low[3], part[3], edge[3], longest = 0;
  if (whole_box(scene, p)) return;
  for (int axis = 0; axis < 3; axis++) {
    const int intervals = scene->tensorf.res[axis] > 1 ? scene->tensorf.res[axis] - 1 : 1;
    low[axis] = (double)p->low[axis] / intervals;
    part[axis] = scene->tensorf.res[axis] > 1 ? (double)(p->high[axis] - p->low[axis]) / intervals : 1;
    edge[axis] = part[axis] / from->stretch[axis]; /* in the longest of the old box */
    longest = fmax(longest, edge[axis]);
  }
  to->to_box_scale = from->to_box_scale / longest;
  for (int axis = 0; axis < 3; axis++) {
    to->stretch[axis] = longest / edge[axis];
    to->to_box_offset[axis] =
        (from->to_box_offset[axis] * from->stretch[axis] - low[axis]) / part[axis] / to->stretch[axis];
  }
  const fx_scale *sigma = &scene->tensorf.sigma_out;
  result->step_q24 = (int32_t)nearbyint(result->step_q24 / longest);
  sf_quant_scale(ldexp(sigma->mul * longest, -sigma->shift), SHIFT_MAX, 0, &result->tensorf.sigma_out);
}

/* A cell of the smaller box is as occupied as the old cell around its middle. */
sf_status sf_planes_crop(const fx_scene *scene, const sf_trim_planes *p, const char *name, fx_scene *result)
{
  if (whole_box(scene, p)) return sf_ok();
  const int res = scene->occ_res;
  const size_t bytes = (size_t)res * (size_t)res * (size_t)res / 8;
  uint8_t *old = malloc(bytes);
  int *at[3] = {NULL};
  bool room = old != NULL;
  for (int axis = 0; axis < 3; axis++) room = (at[axis] = calloc((size_t)res, sizeof *at[axis])) && room;
  for (int axis = 0; room && axis < 3; axis++) {
    const double cells = (double)res / (scene->tensorf.res[axis] > 1 ? scene->tensorf.res[axis] - 1 : 1);
    for (int i = 0; i < res; i++)
      at[axis][i] = (int)fmin((p->low[axis] + (i + 0.5) / res * (p->high[axis] - p->low[axis])) * cells, res - 1);
  }
  if (room) {
    memcpy(old, result->occupancy, bytes);
    memset(result->occupancy, 0, bytes);
  }
  for (int64_t cell = 0; room && cell < (int64_t)bytes * 8; cell++) {
    const int64_t from = ((int64_t)at[2][cell / res / res] * res + at[1][cell / res % res]) * res + at[0][cell % res];
    if (old[from >> 3] >> (from & 7) & 1) result->occupancy[cell >> 3] |= (uint8_t)(1u << (cell & 7));
  }
  free(old), free(at[0]), free(at[1]), free(at[2]);
  return room ? sf_ok() : sf_fail(SF_E_MEMORY, "%s: no memory to crop the box", name);
}

/* ---- points ---- */

bool sf_trim_points(sf_trim *trim, int axis, int parts)
{
  int32_t *points = &trim->planes.points[axis];
  const int32_t gone = *points / parts > 0 ? *points / parts : 1;
  if (*points - gone < 2) return false;
  *points -= gone;
  return true;
}

static bool same_shape(const sf_trim_planes *a, const sf_trim_planes *b)
{
  return !memcmp(a->low, b->low, sizeof a->low) && !memcmp(a->high, b->high, sizeof a->high) &&
         !memcmp(a->points, b->points, sizeof a->points);
}

static int8_t to_entry(float value)
{
  const float kept = value > 127 ? 127 : value < -127 ? -127 : value;
  return (int8_t)lrintf(kept);
}

/* from[rows][columns][n] through the taps of both; NULL: a line, which has columns alone. room: for the numbers of both
 * axes. */
static void resample(const int8_t *from, size_t rows, size_t columns, size_t n, const sf_taps *row_taps,
                     const sf_taps *column_taps, float *room, int8_t *to)
{
  const size_t wide = (size_t)column_taps->n_to, high = row_taps ? (size_t)row_taps->n_to : rows;
  float *whole = room, *narrow = whole + rows * columns * n, *small = row_taps ? narrow + rows * wide * n : narrow;
  for (size_t i = 0; i < rows * columns * n; i++) whole[i] = from[i];
  sf_taps_apply(column_taps, whole, rows, columns, n, narrow);
  if (row_taps) sf_taps_apply(row_taps, narrow, 1, rows, wide * n, small);
  for (size_t i = 0; i < high * wide * n; i++) to[i] = to_entry(small[i]);
}

static void resample_factors(const fx_scene *scene, int which, const sf_taps taps[3], float *room, fx_scene *to)
{
  const fx_factors *old = sf_factors_of(&scene->tensorf, which), *new = sf_factors_of(&to->tensorf, which);
  const int32_t *res = scene->tensorf.res;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int *axes = fx_pair_axes[pair];
    const size_t n = (size_t)old->components[pair];
    resample(old->plane[pair], (size_t)res[axes[1]], (size_t)res[axes[0]], n, &taps[axes[1]], &taps[axes[0]], room,
             new->plane[pair]);
    resample(old->line[pair], 1, (size_t)res[axes[2]], n, NULL, &taps[axes[2]], room, new->line[pair]);
  }
}

static size_t largest_plane(const fx_tensorf *field)
{
  size_t largest = 0;
  for (int which = 0; which < SF_FACTORS; which++)
    for (int pair = 0; pair < FX_PAIRS; pair++) {
      const int *axes = fx_pair_axes[pair];
      const size_t size = (size_t)field->res[axes[0]] * (size_t)field->res[axes[1]] *
                          (size_t)sf_factors_of(field, which)->components[pair];
      const size_t line = (size_t)field->res[axes[2]] * (size_t)sf_factors_of(field, which)->components[pair];
      largest = size > largest ? size : largest, largest = line > largest ? line : largest;
    }
  return largest;
}

static sf_status make_shape(const fx_scene *scene, const sf_trim_planes *p, const char *name, fx_scene *shaped)
{
  sf_taps taps[3] = {{0}};
  *shaped = *scene;
  shaped->owner = NULL;
  memcpy(shaped->tensorf.res, p->points, sizeof p->points);
  sf_status status = fx_scene_allocate(shaped, name);
  if (status.code != SF_OK) return status; /* no owner: the next trim tries again */
  float *room = malloc(3 * largest_plane(&scene->tensorf) * sizeof *room);
  if (!room) status = sf_fail(SF_E_MEMORY, "%s: no memory for fewer points", name);
  for (int axis = 0; axis < 3 && status.code == SF_OK; axis++)
    status = sf_taps_make(&taps[axis], p->low[axis], p->high[axis], p->points[axis]);
  for (int which = 0; which < SF_FACTORS && status.code == SF_OK; which++)
    resample_factors(scene, which, taps, room, shaped);
  for (int axis = 0; axis < 3; axis++) sf_taps_free(&taps[axis]);
  free(room);
  if (status.code != SF_OK) fx_scene_free(shaped);
  return status;
}

/* The field on the points and in the box of the trim, with everything else. The last one is kept: of the many cuts that
 * are tried few change it. */
sf_status sf_planes_shape(const fx_scene *scene, const sf_trim_planes *p, sf_trim_use *use, const char *name,
                          const fx_tensorf **field)
{
  *field = &scene->tensorf;
  if (whole_box(scene, p) && !memcmp(p->points, scene->tensorf.res, sizeof p->points)) return sf_ok();
  if (!use->shaped) use->shaped = calloc(1, sizeof *use->shaped);
  if (!use->shaped) return sf_fail(SF_E_MEMORY, "%s: no memory to trim", name);
  *field = &use->shaped->tensorf;
  if (use->shaped->owner && same_shape(p, &use->shape)) return sf_ok();
  if (use->shaped->owner) fx_scene_free(use->shaped);
  use->shape = *p;
  return make_shape(scene, p, name, use->shaped);
}

/* ---- points that nothing reads ---- */

/* Points of an axis that positions in a cell read: first..last. */
typedef struct reach {
  int32_t first[256], last[256];
} reach;

static void find_reach(const fx_scene *scene, reach axis[3])
{
  const uint32_t side = (1u << SF_POS_FRAC) / (uint32_t)scene->occ_res;
  for (int i = 0; i < scene->occ_res; i++) {
    const uint32_t at = (uint32_t)i * side, low[3] = {at, at, at}, end = at + side - 1, high[3] = {end, end, end};
    const vm_place first = vm_find(scene->tensorf.res, low), last = vm_find(scene->tensorf.res, high);
    for (int a = 0; a < 3; a++) axis[a].first[i] = first.at[a], axis[a].last[i] = last.next[a];
  }
}

/* plane[pair], line[pair]: 1 for each point that is read. */
static void mark_cell(const int32_t res[3], const reach axis[3], const int at[3], uint8_t *const *plane,
                      uint8_t *const *line)
{
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int u = fx_pair_axes[pair][0], v = fx_pair_axes[pair][1], w = fx_pair_axes[pair][2];
    const size_t from = (size_t)axis[u].first[at[u]], n = (size_t)axis[u].last[at[u]] - from + 1;
    for (int y = axis[v].first[at[v]]; y <= axis[v].last[at[v]]; y++)
      memset(plane[pair] + (size_t)y * (size_t)res[u] + from, 1, n);
    for (int z = axis[w].first[at[w]]; z <= axis[w].last[at[w]]; z++) line[pair][z] = 1;
  }
}

static int64_t zero_points(int8_t *entry, size_t points, size_t n, const uint8_t *read)
{
  int64_t zero = 0;
  for (size_t i = 0; i < points; i++, entry += n) {
    if (!read[i]) memset(entry, 0, n);
    for (size_t c = 0; c < n; c++) zero += !entry[c];
  }
  return zero;
}

static int64_t zero_unmarked(fx_tensorf *field, uint8_t *const *plane, uint8_t *const *line)
{
  int64_t zero = 0;
  for (int which = 0; which < SF_FACTORS; which++)
    for (int pair = 0; pair < FX_PAIRS; pair++) {
      const fx_factors *f = sf_factors_of(field, which);
      const int *axes = fx_pair_axes[pair];
      const size_t n = (size_t)f->components[pair];
      zero += zero_points(f->plane[pair], (size_t)field->res[axes[0]] * (size_t)field->res[axes[1]], n, plane[pair]);
      zero += zero_points(f->line[pair], (size_t)field->res[axes[2]], n, line[pair]);
    }
  return zero;
}

int64_t sf_planes_zero_unread(fx_scene *scene)
{
  const int32_t *res = scene->tensorf.res;
  const int cells = scene->occ_res;
  uint8_t *plane[FX_PAIRS] = {NULL}, *line[FX_PAIRS] = {NULL};
  reach *axis = calloc(3, sizeof *axis);
  bool room = axis != NULL;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int *axes = fx_pair_axes[pair];
    room = (plane[pair] = calloc((size_t)res[axes[0]], (size_t)res[axes[1]])) && room;
    room = (line[pair] = calloc((size_t)res[axes[2]], 1)) && room;
  }
  if (room) find_reach(scene, axis);
  for (int64_t cell = 0; room && cell < (int64_t)cells * cells * cells; cell++) {
    const int at[3] = {(int)(cell % cells), (int)(cell / cells % cells), (int)(cell / cells / cells)};
    if (scene->occupancy[cell >> 3] >> (cell & 7) & 1) mark_cell(res, axis, at, plane, line);
  }
  const int64_t zero = room ? zero_unmarked(&scene->tensorf, plane, line) : -1;
  for (int pair = 0; pair < FX_PAIRS; pair++) free(plane[pair]), free(line[pair]);
  free(axis);
  return zero;
}
