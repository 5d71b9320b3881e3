/* Occupancy grid: density of random points of some cells, running maximum with decay, threshold (torch-ngp). */
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>

/* An update visits 1/SHARE of the cells of one cascade (but anywhere), and as many of the occupied ones. */
enum { SHARE = 32 };

static const float decay = 0.95f, density_threshold = 10.0f;

/* Cascades halve towards the middle of the box: x = place / 2^k + (1 - 1 / 2^k) / 2. */
void sf_occupancy_point(const sf_config *c, size_t cell, const float place[3], float x[3])
{
  const size_t res = (size_t)c->occ_res, cascade = cell / (res * res * res);
  const size_t at[3] = {cell % res, cell / res % res, cell / res / res % res};
  const float shrink = (float)(1 << cascade) / (float)c->bound;
  for (int a = 0; a < 3; a++)
    x[a] = fminf(((float)at[a] + place[a]) / (float)res * shrink + (1 - shrink) / 2, 0x1.fffffep-1f);
}

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
  const sf_config *c = &t->model.config;
  const size_t cells = (size_t)c->occ_res * (size_t)c->occ_res * (size_t)c->occ_res; /* of a cascade */
  float x[3 * SF_BLOCK];
  size_t cell[SF_BLOCK];
  const size_t n = v->count - first < SF_BLOCK ? v->count - first : SF_BLOCK;
  for (size_t l = 0; l < SF_BLOCK; l++) {
    const size_t i = first + (l < n ? l : 0);
    cell[l] = visited_cell(t, v, i);
    float place[3], point[3];
    for (int a = 0; a < 3; a++)
      place[a] = sf_random_float(t->options.seed, RNG_OCCUPANCY_JITTER, ((uint64_t)t->iteration << 24 | i) * 3 + a);
    sf_occupancy_point(c, cell[l], place, point);
    for (int a = 0; a < 3; a++) x[a * SF_BLOCK + l] = point[a];
  }
  const float *table = sf_model_param(&t->model, SF_P_GRID);
  for (int level = 0; level < t->model.config.levels; level++)
    t->kernels->grid_forward(&t->model.level[level], table, x, w->block->f + 2 * level * SF_BLOCK);
  t->kernels->density(t->net, w->block, steps, w->scratch);
  const float *sigma = w->block->sigma[steps - 1];
  for (size_t l = 0; l < n; l++) {
    const float width = (float)(1 << cell[l] / cells); /* what counts is how much light a cell takes (instant-ngp) */
    t->density[cell[l]] = fmaxf(t->density[cell[l]] * decay, sigma[l] * width);
  }
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
    for (int b = 0; b < 8; b++)
      bits |= (unsigned)(t->density[8 * byte + b] >= limit) << b; /* all alike: none is empty */
    t->model.occupancy[byte] = (uint8_t)bits;
    occupied += (size_t)__builtin_popcount(bits);
  }
  t->occupied = (double)occupied / (double)cells;
}

sf_status sf_occupancy_update(sf_trainer *t, int steps)
{
  const size_t cells = sf_config_cells(&t->model.config), share = SHARE * (size_t)sf_config_cascades(&t->model.config);
  const visit all = {NULL, t->iteration ? cells / share : cells, t->iteration ? share : 1, RNG_OCCUPANCY};
  uint32_t *list = malloc(cells * sizeof *list);
  if (!list) return sf_fail(SF_E_MEMORY, "train: no memory for the occupancy update");
  size_t occupied = 0;
  for (size_t i = 0; i < cells; i++)
    if (t->model.occupancy[i / 8] >> (i % 8) & 1) list[occupied++] = (uint32_t)i;
  visit_cells(t, &all, steps);
  const size_t stride = (occupied + cells / share - 1) / (cells / share);
  const visit some = {list, stride ? occupied / stride : 0, stride ? stride : 1, RNG_OCCUPANCY + 16};
  if (t->iteration && some.count) visit_cells(t, &some, steps);
  threshold(t, cells);
  free(list);
  return sf_ok();
}
