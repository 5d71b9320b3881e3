/* A scene without the parts that it does not need: narrower layers, less of a field, fewer cells. Every part keeps its
 * own numbers, so that on samples which use none of what went, the result is the same bit for bit. */
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ROWS_MAX = SF_DIR_MAX > SF_LANES ? SF_DIR_MAX : SF_LANES };

static const sf_field_trimmer *trimmer_of(const fx_scene *scene)
{
  return scene->backbone == FX_TENSORF ? &sf_planes_trimmer : &sf_grid_trimmer;
}

/* ---- use ---- */

sf_status sf_trim_use_create(sf_trim_use *use, const fx_scene *scene)
{
  const size_t cells = (size_t)sf_cells_of(scene);
  memset(use, 0, sizeof *use);
  use->cells = (int64_t)cells;
  use->visits = calloc(cells, sizeof *use->visits);
  use->weight2 = calloc(cells, sizeof *use->weight2);
  const sf_status status = use->visits && use->weight2
                               ? trimmer_of(scene)->use_create(use, scene)
                               : sf_fail(SF_E_MEMORY, "fit: no memory for the use of %zu cells", cells);
  if (status.code != SF_OK) sf_trim_use_free(use);
  return status;
}

void sf_trim_use_free(sf_trim_use *use)
{
  if (use->shaped) fx_scene_free(use->shaped);
  free(use->entry), free(use->visits), free(use->weight2), free(use->shaped);
  memset(use, 0, sizeof *use);
}

static void add(uint64_t *to, uint64_t value)
{
#pragma omp atomic
  *to += value;
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
  add(&use->samples, 1), add(&use->steps, (uint64_t)net->steps);
  use_neurons(use, net, trace);
  for (int i = 0; i < net->layer[FX_D1].n_in; i++)
    if (f[i]) add(&use->feature[i], 1);
  for (int i = 0; fx_net_constants_per_sample(net) && i < net->layer[FX_C1].n_in; i++) {
#pragma omp atomic
    use->input[i] += f[i];
  }
}

void sf_trim_use_place(sf_trim_use *use, const fx_scene *scene, const uint32_t pos[3], int64_t cell, uint32_t weight)
{
  if (use->entry) sf_grid_use_entries(use, &scene->grid, pos, weight);
  add(&use->visits[cell], 1);
  add(&use->weight2[cell], (uint64_t)weight * weight);
}

/* ---- what stays ---- */

void sf_trim_all(const fx_scene *scene, sf_trim *trim)
{
  memset(trim, 0, sizeof *trim);
  for (int l = 0; l < SF_LAYERS; l++)
    for (int o = 0; o < scene->net.layer[l].n_out; o++) trim->neuron[l][o] = true;
  for (int c = 0; c < SF_CELL_CLASSES; c++) trim->cells[c] = true;
  trim->steps = scene->net.steps;
  trim->trans_stop = scene->trans_stop;
  trimmer_of(scene)->all(scene, trim);
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
    if (!trim->neuron[from][o] || sf_count_kept(trim->neuron[from], n) == least) continue;
    if (use->fired[from][o] && sf_row_matters(&scene->net.layer[to], row + o, trim->neuron[to])) continue;
    trim->neuron[from][o] = false;
    changed = true;
  }
  return changed;
}

void sf_trim_exact(const fx_scene *scene, const sf_trim_use *use, sf_trim *trim)
{
  const int h_row = fx_net_constants(&scene->net) - 1; /* output 1 of D2 is the first row after the directions */
  const bool density = !fx_net_decodes(&scene->net);
  bool changed = true;
  while (changed) {
    changed = drop_useless(scene, use, trim, FX_C2, FX_C3, 0);
    changed |= drop_useless(scene, use, trim, FX_C1, FX_C2, 0);
    changed |= density && drop_useless(scene, use, trim, FX_D2, FX_C1, h_row);
    changed |= density && drop_useless(scene, use, trim, FX_D1, FX_D2, 0);
  }
  trimmer_of(scene)->exact(scene, use, trim);
}

/* ---- the result ---- */

/* The rows of a layer that stay. */
static void keep_rows(const fx_scene *scene, const sf_trim *trim, int layer, bool *row)
{
  const int n_in = scene->net.layer[layer].n_in, constants = fx_net_constants(&scene->net);
  if (layer == fx_net_first_layer(&scene->net)) {
    trimmer_of(scene)->inputs(scene, trim, row);
    return;
  }
  for (int i = 0; i < n_in; i++)
    row[i] = layer != FX_C1  ? trim->neuron[fx_layer_table[layer].spikes_of][i]
             : i < constants ? i < trim->directions
                             : trim->neuron[FX_D2][i - constants + 1];
}

/* The bias is one more row, which stays. */
static void pack_weights(const fx_layer *from, fx_layer *to, const bool *row, const bool *column)
{
  int8_t *w = to->w;
  for (int i = 0; i < fx_layer_rows(from); i++) {
    if (i < from->n_in && !row[i]) continue;
    for (int o = 0, lane = 0; o < from->n_out; o++)
      if (column[o]) w[lane++] = from->w[(size_t)i * SF_LANES + (size_t)o];
    w += SF_LANES;
  }
}

/* Mean of an input, of spikes per time step. */
static double mean_input(const sf_trim_use *use, int layer, int i)
{
  return layer == FX_C1 ? (double)use->input[i] / (double)use->samples
                        : (double)use->fired[fx_layer_table[layer].spikes_of][i] / (double)use->steps;
}

static int largest_weight(const fx_layer *layer)
{
  int largest = 0;
  for (size_t i = 0; i < (size_t)fx_layer_rows(layer) * SF_LANES; i++)
    if (largest < abs(layer->w[i])) largest = abs(layer->w[i]);
  return largest;
}

/* What goes of the inputs leaves its mean in the bias, within the weights that the layer has: their width stays. */
static void keep_means(const fx_layer *from, fx_layer *to, const sf_trim_use *use, int layer, const bool *row,
                       const bool *column)
{
  if (!from->bias || !use->samples || to->n_in == from->n_in) return;
  const int limit = largest_weight(from);
  int8_t *bias = to->w + (size_t)to->n_in * SF_LANES;
  double gone[SF_LANES] = {0};
  for (int i = 0; i < from->n_in; i++) {
    const double mean = row[i] ? 0 : mean_input(use, layer, i) / from->bias;
    for (int o = 0; mean != 0 && o < from->n_out; o++) gone[o] += mean * from->w[(size_t)i * SF_LANES + (size_t)o];
  }
  for (int o = 0, lane = 0; o < from->n_out; o++) {
    if (!column[o]) continue;
    const double sum = nearbyint(bias[lane] + gone[o]);
    bias[lane++] = (int8_t)(sum > limit ? limit : sum < -limit ? -limit : sum);
  }
}

static void set_sizes(const fx_scene *scene, const sf_trim *trim, fx_scene *result)
{
  trimmer_of(scene)->set_sizes(scene, trim, result);
  for (int l = 0; l < SF_LAYERS; l++) {
    bool row[ROWS_MAX];
    keep_rows(scene, trim, l, row);
    result->net.layer[l].n_in = sf_count_kept(row, scene->net.layer[l].n_in);
    result->net.layer[l].n_out = sf_count_kept(trim->neuron[l], scene->net.layer[l].n_out);
  }
  result->net.steps = trim->steps;
  result->trans_stop = trim->trans_stop;
}

static void fill_nets(const fx_scene *scene, const sf_trim *trim, const sf_trim_use *use, fx_scene *result)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    bool row[ROWS_MAX];
    keep_rows(scene, trim, l, row);
    pack_weights(&scene->net.layer[l], &result->net.layer[l], row, trim->neuron[l]);
    keep_means(&scene->net.layer[l], &result->net.layer[l], use, l, row, trim->neuron[l]);
  }
}

sf_status sf_trim_apply(const fx_scene *scene, const sf_trim *trim, sf_trim_use *use, const char *name,
                        fx_scene *result)
{
  *result = *scene;
  result->owner = NULL;
  set_sizes(scene, trim, result);
  sf_status status = fx_scene_allocate(result, name);
  if (status.code == SF_OK) {
    fill_nets(scene, trim, use, result);
    sf_trim_cells(scene, trim, use, result->occupancy);
    status = trimmer_of(scene)->fill(scene, trim, use, name, result);
    if (status.code != SF_OK) fx_scene_free(result);
  }
  if (status.code != SF_OK) memset(result, 0, sizeof *result);
  return status;
}

sf_status sf_trim_zero_unread(fx_scene *scene, const char *name)
{
  if (trimmer_of(scene)->zero_unread(scene) >= 0) return sf_ok();
  return sf_fail(SF_E_MEMORY, "%s: no memory to look for unread entries", name);
}
