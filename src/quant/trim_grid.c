/* A hash grid with fewer levels and smaller tables. */
#include "src/quant/internal.h"
#include <stdlib.h>
#include <string.h>

static sf_status use_create(sf_trim_use *use, const fx_scene *scene)
{
  const size_t entries = (size_t)scene->grid.entries;
  use->entry = calloc(entries, sizeof *use->entry);
  return use->entry ? sf_ok() : sf_fail(SF_E_MEMORY, "fit: no memory for the use of %zu entries", entries);
}

void sf_grid_use_entries(sf_trim_use *use, const fx_grid *grid, const uint32_t pos[3], uint32_t weight)
{
  for (int level = 0; level < grid->levels; level++) {
    const sf_corners c = sf_grid_corners(grid, level, pos, pos);
    for (int corner = 0; corner < 8; corner++) {
      uint64_t *entry = &use->entry[sf_grid_entry(grid, level, c.base[0] + (corner & 1), c.base[1] + (corner >> 1 & 1),
                                                  c.base[2] + (corner >> 2))];
#pragma omp atomic
      *entry += weight + 1;
    }
  }
}

/* ---- what stays ---- */

static void all(const fx_scene *scene, sf_trim *trim)
{
  for (int l = 0; l < scene->grid.levels; l++) trim->level[l] = true, trim->log2_size[l] = -1;
  trim->directions = fx_net_constants(&scene->net);
}

static void drop_directions(const fx_scene *scene, sf_trim *trim)
{
  while (trim->directions > 1 && !sf_row_matters(&scene->net.layer[FX_C1], trim->directions - 1, trim->neuron[FX_C1]))
    trim->directions--;
}

static void exact(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim)
{
  drop_directions(scene, trim);
  for (int l = 0; l < scene->grid.levels; l++) {
    bool matters = false;
    for (int row = FX_GRID_FEATURES * l; row < FX_GRID_FEATURES * (l + 1); row++)
      matters |= use->feature[row] && sf_row_matters(&scene->net.layer[FX_D1], row, trim->neuron[FX_D1]);
    if (!matters && sf_count_kept(trim->level, scene->grid.levels) > 1) trim->level[l] = false;
  }
}

int sf_trim_smaller(const fx_scene *scene, const sf_trim *trim, int level)
{
  const int64_t entries =
      trim->log2_size[level] < 0 ? sf_grid_level_entries(&scene->grid, level) : (int64_t)1 << trim->log2_size[level];
  return entries > 1 ? 63 - __builtin_clzll((uint64_t)(entries - 1)) : -1;
}

/* ---- the result ---- */

static void inputs(const fx_scene *scene, const sf_trim *trim, bool *row)
{
  for (int i = 0; i < scene->net.layer[FX_D1].n_in; i++) row[i] = trim->level[i / FX_GRID_FEATURES];
}

static void set_sizes(const fx_scene *scene, const sf_trim *trim, fx_scene *result)
{
  const fx_grid *from = &scene->grid;
  fx_grid *to = &result->grid;
  to->levels = 0, to->entries = 0;
  for (int l = 0; l < from->levels; l++) {
    if (!trim->level[l]) continue;
    const int at = to->levels++, size = trim->log2_size[l];
    to->scale_q16[at] = from->scale_q16[l], to->shift[at] = from->shift[l];
    to->stride[at] = size < 0 ? from->stride[l] : 0;
    to->log2_size[at] = size < 0 ? from->log2_size[l] : size;
    to->offset[at] = to->entries;
    to->entries += size < 0 ? sf_grid_level_entries(from, l) : (int64_t)1 << size;
    result->units.feature_scale[at] = scene->units.feature_scale[l];
  }
}

static sf_status fill(const fx_scene *scene, const sf_trim *trim, sf_trim_use *use, const char *name, fx_scene *result)
{
  double *sum = malloc((size_t)scene->grid.entries * 3 * sizeof *sum); /* pages are touched by smaller tables alone */
  if (!sum) return sf_fail(SF_E_MEMORY, "%s: no memory to trim", name);
  for (int l = 0, at = 0; l < scene->grid.levels; l++) {
    if (!trim->level[l]) continue;
    int8_t *to = result->grid.table + result->grid.offset[at++] * FX_GRID_FEATURES;
    sf_grid_copy_level(&scene->grid, l, trim->log2_size[l], use->entry, to, sum);
  }
  free(sum);
  return sf_ok();
}

const sf_field_trimmer sf_grid_trimmer = {.use_create = use_create,
                                          .all = all,
                                          .exact = exact,
                                          .inputs = inputs,
                                          .set_sizes = set_sizes,
                                          .fill = fill,
                                          .zero_unread = sf_grid_zero_unread};
