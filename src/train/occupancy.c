/* Occupancy grid: density of random points of some cells, running maximum with decay, threshold (torch-ngp). */
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>

enum { SHARE = 32 }; /* an update visits 1/SHARE of all cells and as many of the occupied ones */

static const float decay = 0.95f, density_threshold = 10.0f;

typedef struct visit {
  const uint32_t *cell; /* NULL: cell i*stride + random */
  size_t count, stride;
  uint64_t stream;
} visit;

static size_t visited_cell(const sf_trainer *t, const visit *v, size_t i)
{
  size_t pick =
      i * v->stride + sf_random_below(t->options.seed, v->stream, (uint64_t)t->iteration << 24 | i, v->stride);
  return v->cell ? v->cell[pick] : pick;
}

static void visit_block(sf_trainer *t, const visit *v, int steps, size_t first, sf_worker *w)
{
  const size_t res = (size_t)t->model.config.occ_res;
  float x[3 * SF_BLOCK];
  size_t cell[SF_BLOCK];
  const size_t n = v->count - first < SF_BLOCK ? v->count - first : SF_BLOCK;
  for (size_t l = 0; l < SF_BLOCK; l++) {
    const size_t i = first + (l < n ? l : 0);
    cell[l] = visited_cell(t, v, i);
    const size_t at[3] = {cell[l] % res, cell[l] / res % res, cell[l] / res / res};
    for (int a = 0; a < 3; a++) {
      float jitter = sf_random_float(t->options.seed, RNG_OCCUPANCY_JITTER, ((uint64_t)t->iteration << 24 | i) * 3 + a);
      x[a * SF_BLOCK + l] = fminf(((float)at[a] + jitter) / (float)res, 0x1.fffffep-1f);
    }
  }
  const float *table = sf_model_param(&t->model, SF_P_GRID);
  for (int level = 0; level < t->model.config.levels; level++)
    t->kernels->grid_forward(&t->model.level[level], table, x, w->block->f + 2 * level * SF_BLOCK);
  t->kernels->density(t->net, w->block, steps, w->scratch);
  const float *sigma = w->block->sigma[steps - 1];
  for (size_t l = 0; l < n; l++) t->density[cell[l]] = fmaxf(t->density[cell[l]] * decay, sigma[l]);
}

static void visit_cells(sf_trainer *t, const visit *v, int steps)
{
  sf_train_prepare(t);
#pragma omp parallel for schedule(static) num_threads(t->workers)
  for (int part = 0; part < t->workers; part++) {
    const size_t blocks = (v->count + SF_BLOCK - 1) / SF_BLOCK;
    for (size_t b = blocks * part / t->workers; b < blocks * (part + 1) / t->workers; b++)
      visit_block(t, v, steps, b * SF_BLOCK, &t->worker[part]);
  }
}

static void threshold(sf_trainer *t, size_t cells)
{
  double sum = 0;
  for (size_t i = 0; i < cells; i++) sum += t->density[i];
  const float limit = fminf((float)(sum / (double)cells), density_threshold);
  size_t occupied = 0;
  for (size_t byte = 0; byte < cells / 8; byte++) {
    unsigned bits = 0;
    for (int b = 0; b < 8; b++) bits |= (unsigned)(t->density[8 * byte + b] > limit) << b;
    t->model.occupancy[byte] = (uint8_t)bits;
    occupied += (size_t)__builtin_popcount(bits);
  }
  t->occupied = (double)occupied / (double)cells;
}

sf_status sf_occupancy_update(sf_trainer *t, int steps)
{
  const size_t res = (size_t)t->model.config.occ_res, cells = res * res * res;
  const visit all = {NULL, t->iteration ? cells / SHARE : cells, t->iteration ? SHARE : 1, RNG_OCCUPANCY};
  uint32_t *list = malloc(cells * sizeof *list);
  if (!list) return sf_fail(SF_E_MEMORY, "train: no memory for the occupancy update");
  size_t occupied = 0;
  for (size_t i = 0; i < cells; i++)
    if (t->model.occupancy[i / 8] >> (i % 8) & 1) list[occupied++] = (uint32_t)i;
  visit_cells(t, &all, steps);
  const size_t stride = (occupied + cells / SHARE - 1) / (cells / SHARE);
  const visit some = {list, stride ? occupied / stride : 0, stride ? stride : 1, RNG_OCCUPANCY + 16};
  if (t->iteration && some.count) visit_cells(t, &some, steps);
  threshold(t, cells);
  free(list);
  return sf_ok();
}
