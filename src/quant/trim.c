/* A scene without the parts that it does not need: narrower layers, fewer levels, smaller tables, fewer cells. Every
 * part keeps its own numbers, so that on samples which use none of what went, the result is the same bit for bit. */
#include "src/quant/internal.h"
#include <stdlib.h>
#include <string.h>

static int64_t cells_of(const fx_scene *scene)
{
  return (int64_t)(scene->log2_bound + 1) * scene->occ_res * scene->occ_res * scene->occ_res;
}

static int directions_of(const fx_net *net)
{
  return fx_net_constants(net);
}

/* ---- use ---- */

sf_status sf_trim_use_create(sf_trim_use *use, const fx_scene *scene)
{
  const size_t entries = (size_t)scene->grid.entries, cells = (size_t)cells_of(scene);
  memset(use, 0, sizeof *use);
  use->cells = (int64_t)cells;
  use->entry = calloc(entries, sizeof *use->entry);
  use->visits = calloc(cells, sizeof *use->visits);
  use->weight2 = calloc(cells, sizeof *use->weight2);
  if (use->entry && use->visits && use->weight2) return sf_ok();
  sf_trim_use_free(use);
  return sf_fail(SF_E_MEMORY, "fit: no memory for the use of %zu entries and %zu cells", entries, cells);
}

void sf_trim_use_free(sf_trim_use *use)
{
  free(use->entry), free(use->visits), free(use->weight2);
  memset(use, 0, sizeof *use);
}

static void add(uint64_t *to, uint64_t value)
{
#pragma omp atomic
  *to += value;
}

static void use_entries(sf_trim_use *use, const fx_grid *grid, const uint32_t pos[3], uint32_t weight)
{
  for (int level = 0; level < grid->levels; level++) {
    const sf_corners c = sf_grid_corners(grid, level, pos, pos);
    for (int corner = 0; corner < 8; corner++)
      add(&use->entry[sf_grid_entry(grid, level, c.base[0] + (corner & 1), c.base[1] + (corner >> 1 & 1),
                                    c.base[2] + (corner >> 2))],
          weight + 1);
  }
}

static void use_neurons(sf_trim_use *use, const fx_net *net, const fx_trace *trace)
{
  for (int l = FX_D1; l <= FX_C2; l++)
    for (int t = 0; t < net->steps; t++)
      for (int o = 0; o < net->layer[l].n_out; o++) {
        const bool used = l == FX_D2 ? o > 0 && trace->current[l][t][o] >> SF_H_SHIFT != 0
                                     : trace->spikes[l][t][o / 64] >> o % 64 & 1;
        if (used) add(&use->fired[l][o], 1);
      }
}

void sf_trim_use_net(sf_trim_use *use, const fx_net *net, const int16_t *f, const fx_trace *trace)
{
  use_neurons(use, net, trace);
  for (int i = 0; i < net->layer[FX_D1].n_in; i++)
    if (f[i]) add(&use->feature[i], 1);
}

void sf_trim_use_place(sf_trim_use *use, const fx_scene *scene, const uint32_t pos[3], int64_t cell, uint32_t weight)
{
  use_entries(use, &scene->grid, pos, weight);
  add(&use->visits[cell], 1);
  add(&use->weight2[cell], (uint64_t)weight * weight);
}

int sf_cell_class(const sf_trim_use *use, int64_t cell)
{
  const uint64_t one = (uint64_t)1 << 2 * SF_TRANS_FRAC;
  if (!use->visits[cell]) return 0;
  const uint64_t mean = (use->weight2[cell] + one) / (use->visits[cell] + 1);
  const int octave = 2 * SF_TRANS_FRAC - (63 - __builtin_clzll(mean));
  return octave < SF_CELL_CLASSES ? octave : SF_CELL_CLASSES - 1;
}

/* ---- what stays ---- */

void sf_trim_all(const fx_scene *scene, sf_trim *trim)
{
  memset(trim, 0, sizeof *trim);
  for (int l = 0; l < SF_LAYERS; l++)
    for (int o = 0; o < scene->net.layer[l].n_out; o++) trim->neuron[l][o] = true;
  for (int l = 0; l < scene->grid.levels; l++) trim->level[l] = true, trim->log2_size[l] = -1;
  for (int c = 0; c < SF_CELL_CLASSES; c++) trim->cells[c] = true;
  trim->directions = directions_of(&scene->net);
  trim->steps = scene->net.steps;
  trim->trans_stop = scene->trans_stop;
}

static bool row_matters(const fx_layer *layer, int row, const bool *column)
{
  for (int o = 0; o < layer->n_out; o++)
    if (column[o] && layer->w[(size_t)row * SF_LANES + (size_t)o]) return true;
  return false;
}

static int count(const bool *kept, int n)
{
  int sum = 0;
  for (int i = 0; i < n; i++) sum += kept[i];
  return sum;
}

int sf_trim_least(const sf_trim *trim, int layer)
{
  return layer == FX_D2 && trim->directions == 0 ? 2 : 1;
}

/* Neurons of `from` that stayed silent or have no weights to what stays of `to`, whose rows they own from `row` on. */
static bool drop_useless(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim, int from, int to, int row)
{
  const int n = scene->net.layer[from].n_out, least = sf_trim_least(trim, from);
  bool changed = false;
  for (int o = from == FX_D2; o < n; o++) {
    if (!trim->neuron[from][o] || count(trim->neuron[from], n) == least) continue;
    if (use->fired[from][o] && row_matters(&scene->net.layer[to], row + o, trim->neuron[to])) continue;
    trim->neuron[from][o] = false;
    changed = true;
  }
  return changed;
}

static void drop_directions(const fx_scene *scene, sf_trim *trim)
{
  while (trim->directions > 1 && !row_matters(&scene->net.layer[FX_C1], trim->directions - 1, trim->neuron[FX_C1]))
    trim->directions--;
}

static void drop_levels(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim)
{
  for (int l = 0; l < scene->grid.levels; l++) {
    bool matters = false;
    for (int row = FX_GRID_FEATURES * l; row < FX_GRID_FEATURES * (l + 1); row++)
      matters |= use->feature[row] && row_matters(&scene->net.layer[FX_D1], row, trim->neuron[FX_D1]);
    if (!matters && count(trim->level, scene->grid.levels) > 1) trim->level[l] = false;
  }
}

void sf_trim_exact(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim)
{
  const int h_row = directions_of(&scene->net) - 1; /* output 1 of D2 is the first row after the directions */
  bool changed = true;
  while (changed) {
    changed = drop_useless(scene, use, trim, FX_C2, FX_C3, 0);
    changed |= drop_useless(scene, use, trim, FX_C1, FX_C2, 0);
    changed |= drop_useless(scene, use, trim, FX_D2, FX_C1, h_row);
    changed |= drop_useless(scene, use, trim, FX_D1, FX_D2, 0);
  }
  drop_directions(scene, trim);
  drop_levels(scene, use, trim);
}

int sf_trim_smaller(const fx_scene *scene, const sf_trim *trim, int level)
{
  const int64_t entries =
      trim->log2_size[level] < 0 ? sf_grid_level_entries(&scene->grid, level) : (int64_t)1 << trim->log2_size[level];
  return entries > 1 ? 63 - __builtin_clzll((uint64_t)(entries - 1)) : -1;
}

/* ---- the result ---- */

/* The rows of a layer that stay. */
static void keep_rows(const fx_scene *scene, const sf_trim *trim, int layer, bool *row)
{
  const int n_in = scene->net.layer[layer].n_in, n_dir = directions_of(&scene->net);
  static const int feeder[SF_LAYERS] = {[FX_D2] = FX_D1, [FX_C2] = FX_C1, [FX_C3] = FX_C2};
  for (int i = 0; i < n_in; i++)
    row[i] = layer == FX_D1   ? trim->level[i / FX_GRID_FEATURES]
             : layer != FX_C1 ? trim->neuron[feeder[layer]][i]
             : i < n_dir      ? i < trim->directions
                              : trim->neuron[FX_D2][i - n_dir + 1];
}

static void pack_weights(const fx_layer *from, fx_layer *to, const bool *row, const bool *column)
{
  int8_t *w = to->w;
  for (int i = 0; i < from->n_in; i++) {
    if (!row[i]) continue;
    for (int o = 0, lane = 0; o < from->n_out; o++)
      if (column[o]) w[lane++] = from->w[(size_t)i * SF_LANES + (size_t)o];
    w += SF_LANES;
  }
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
  for (int l = 0; l < SF_LAYERS; l++) {
    bool row[SF_LANES];
    keep_rows(scene, trim, l, row);
    result->net.layer[l].n_in = count(row, scene->net.layer[l].n_in);
    result->net.layer[l].n_out = count(trim->neuron[l], scene->net.layer[l].n_out);
  }
  result->net.steps = trim->steps;
  result->trans_stop = trim->trans_stop;
}

static void fill_tables(const fx_scene *scene, const sf_trim *trim, const uint64_t *use, fx_scene *result, double *sum)
{
  for (int l = 0, at = 0; l < scene->grid.levels; l++) {
    if (!trim->level[l]) continue;
    int8_t *to = result->grid.table + result->grid.offset[at++] * FX_GRID_FEATURES;
    sf_grid_copy_level(&scene->grid, l, trim->log2_size[l], use, to, sum);
  }
}

static void fill_occupancy(const fx_scene *scene, const sf_trim *trim, const sf_trim_use *use, fx_scene *result)
{
  memcpy(result->occupancy, scene->occupancy, (size_t)cells_of(scene) / 8);
  for (int64_t cell = 0; cell < cells_of(scene); cell++)
    if (scene->occupancy[cell >> 3] >> (cell & 7) & 1 && !trim->cells[sf_cell_class(use, cell)])
      result->occupancy[cell >> 3] &= (uint8_t) ~(1u << (cell & 7));
}

sf_status sf_trim_apply(const fx_scene *scene, const sf_trim *trim, const sf_trim_use *use, const char *name,
                        fx_scene *result)
{
  *result = *scene;
  result->owner = NULL;
  set_sizes(scene, trim, result);
  double *sum = malloc((size_t)scene->grid.entries * 3 * sizeof *sum); /* pages are touched by smaller tables alone */
  const sf_status status = sum ? fx_scene_allocate(result, name) : sf_fail(SF_E_MEMORY, "%s: no memory to trim", name);
  if (status.code == SF_OK) {
    for (int l = 0; l < SF_LAYERS; l++) {
      bool row[SF_LANES];
      keep_rows(scene, trim, l, row);
      pack_weights(&scene->net.layer[l], &result->net.layer[l], row, trim->neuron[l]);
    }
    fill_tables(scene, trim, use->entry, result, sum);
    fill_occupancy(scene, trim, use, result);
  }
  free(sum);
  if (status.code != SF_OK) memset(result, 0, sizeof *result);
  return status;
}
