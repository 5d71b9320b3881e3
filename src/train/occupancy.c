/* Occupancy grid: density of random points of some cells, running maximum with decay, threshold (torch-ngp).
 *
 * A cell that is taken for empty gets no rays, so nothing but a visit brings it back. Three rules keep thin parts:
 * nothing is called empty before it was looked at, the neighbours of what is occupied are looked at each time, and
 * little is called empty while the field is young. */
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* An update visits 1/SHARE of the cells of one cascade (but anywhere), as many of the occupied ones, and as many of
 * their neighbours. Updates at iterations FIRST, 4 FIRST and 16 FIRST visit every cell: by then the field has changed
 * so much that what was seen before says nothing. */
enum { SHARE = 32, FIRST = 16, LAST_SWEEP = 256 };

/* Until the lattice of samples is settled, there are at most YOUNG cells per axis. Then cells are split. Many of the
 * small ones are empty where the large one was not, so until this share of the run what was seen before says little. */
enum { YOUNG = 128, OCCUPANCY_MOST = 256 };
static const double split_until = 0.7;
static const float split_decay = 0.5f;

/* Before the last sweep the threshold is a part of what it is later: thin parts are learned last. */
static const float decay = 0.95f, density_threshold = 10.0f, young = 0.25f;

/* Cascades halve towards the middle of the box: x = place / 2^k + (1 - 1 / 2^k) / 2. */
void sf_occupancy_point(const sf_config *c, size_t cell, const float place[3], float x[3])
{
  const size_t res = (size_t)c->occ_res, cascade = cell / (res * res * res);
  const size_t at[3] = {cell % res, cell / res % res, cell / res / res % res};
  const float shrink = (float)(1 << cascade) / (float)c->bound;
  for (int a = 0; a < 3; a++)
    x[a] = fminf(((float)at[a] + place[a]) / (float)res * shrink + (1 - shrink) / 2, 0x1.fffffep-1f);
}

/* What an update visits: the model's cells, or cubes of them. */
typedef struct cell_grid {
  sf_config config;   /* the model's, but with as many cells */
  size_t side;        /* of a cube */
  size_t cells, most; /* in all; that one pass of an update visits */
} cell_grid;

/* Of a cube that is one cell while the field is young, in the model's cells. */
static size_t young_side(const sf_config *c)
{
  return c->occ_res > YOUNG ? (size_t)c->occ_res / YOUNG : 1;
}

static cell_grid grid_of_now(const sf_trainer *t)
{
  const sf_config *c = &t->model.config;
  const size_t side = young_side(c), cubes = sf_config_cells(c) / (side * side * side);
  cell_grid g = {.config = *c, .side = t->progress < sf_lattice_settles ? side : 1};
  g.config.occ_res /= (int)g.side;
  g.cells = sf_config_cells(&g.config);
  g.most = cubes / (SHARE * (size_t)sf_config_cascades(c));
  return g;
}

/* The first of the model's cells in a cube. */
static size_t first_of(const cell_grid *g, size_t cell)
{
  const size_t res = (size_t)g->config.occ_res, fine = res * g->side;
  return ((cell / (res * res) * fine + cell / res % res) * fine + cell % res) * g->side;
}

typedef struct visit {
  const cell_grid *grid;
  const uint32_t *cell; /* NULL: cell i*stride + random */
  size_t count, stride;
  uint64_t stream;
  float *sigma; /* [count] densities of what was visited */
} visit;

static size_t visited_cell(const sf_trainer *t, const visit *v, size_t i)
{
  size_t pick =
      i * v->stride + sf_random_below(t->options.seed, v->stream, (uint64_t)t->iteration << 24 | i, v->stride);
  return v->cell ? v->cell[pick] : pick;
}

static void visit_block(sf_trainer *t, const visit *v, int steps, size_t first, sf_worker *w)
{
  const sf_config *c = &v->grid->config;
  float x[3 * SF_BLOCK];
  const size_t n = v->count - first < SF_BLOCK ? v->count - first : SF_BLOCK;
  for (size_t l = 0; l < SF_BLOCK; l++) {
    const size_t i = first + (l < n ? l : 0);
    float place[3], point[3];
    for (int a = 0; a < 3; a++)
      place[a] = sf_random_float(t->options.seed, RNG_OCCUPANCY_JITTER, ((uint64_t)t->iteration << 24 | i) * 3 + a);
    sf_occupancy_point(c, visited_cell(t, v, i), place, point);
    for (int a = 0; a < 3; a++) x[a * SF_BLOCK + l] = point[a];
  }
  const float *table = sf_model_param(&t->model, SF_P_GRID);
  sf_block *block = w->block;
  block->from = steps - 1;
  for (int level = 0; level < t->model.config.levels; level++)
    t->kernels->grid_forward(&t->model.level[level], table, x, block->f + 2 * level * SF_BLOCK);
  t->kernels->density(t->net, block, steps, w->scratch);
  memcpy(v->sigma + first, block->sigma[steps - 1], n * sizeof *v->sigma);
}

/* No cell is visited twice at a time. */
static void take_density(sf_trainer *t, const visit *v)
{
  const cell_grid *g = v->grid;
  const size_t res = (size_t)g->config.occ_res, cells = res * res * res; /* of a cascade */
  const size_t fine = res * g->side;
  const bool split = g->config.occ_res > YOUNG && t->progress < split_until;
#pragma omp parallel for schedule(static) num_threads(t->workers)
  for (size_t i = 0; i < v->count; i++) {
    const size_t cell = visited_cell(t, v, i);
    const float width = (float)(1 << cell / cells); /* what counts is how much light a cell takes (instant-ngp) */
    const size_t first = first_of(g, cell);
    const float density = fmaxf(t->density[first] * (split ? split_decay : decay), v->sigma[i] * width);
    for (size_t z = 0; z < g->side; z++)
      for (size_t y = 0; y < g->side; y++)
        for (size_t x = 0; x < g->side; x++) t->density[first + (z * fine + y) * fine + x] = density;
  }
}

/* Each rank visits as many blocks. */
static sf_status visit_cells(sf_trainer *t, const visit *v, int steps)
{
  const size_t blocks = (v->count + SF_BLOCK - 1) / SF_BLOCK;
  const int ranks = sf_ranks_size(t->options.ranks), rank = sf_ranks_rank(t->options.ranks);
  for (int i = 0; i <= ranks; i++) t->edge[i] = blocks * (size_t)i / (size_t)ranks;
  const size_t begin = t->edge[rank], own = t->edge[rank + 1] - begin;
  sf_train_prepare(t);
#pragma omp parallel for schedule(static) num_threads(t->workers)
  for (int part = 0; part < t->workers; part++)
    for (size_t b = own * part / t->workers; b < own * (part + 1) / t->workers; b++)
      visit_block(t, v, steps, (begin + b) * SF_BLOCK, &t->worker[part]);
  for (int i = 0; i <= ranks; i++) t->edge[i] = t->edge[i] * SF_BLOCK < v->count ? t->edge[i] * SF_BLOCK : v->count;
  SF_TRY(sf_share(t, v->sigma, sizeof *v->sigma));
  take_density(t, v);
  return sf_ok();
}

/* Of as many cells as there are while the field is young: the largest density of those that were one. Small cells have
 * a smaller mean. */
static double mean_density(const sf_trainer *t)
{
  const size_t res = (size_t)t->model.config.occ_res, side = young_side(&t->model.config);
  const size_t layers = (size_t)sf_config_cascades(&t->model.config) * res;
  double sum = 0;
  for (size_t z = 0; z < layers; z += side)
    for (size_t y = 0; y < res; y += side) {
      float most[OCCUPANCY_MOST] = {0}; /* densities are not negative */
      for (size_t i = 0; i < side * side; i++) {
        const float *row = t->density + ((z + i / side) * res + y + i % side) * res;
        for (size_t x = 0; x < res; x++) most[x] = row[x] > most[x] ? row[x] : most[x];
      }
      for (size_t x = 0; x < res; x += side) {
        float one = most[x];
        for (size_t i = 1; i < side; i++) one = fmaxf(one, most[x + i]);
        sum += one;
      }
    }
  return sum * (double)(side * side * side) / (double)sf_config_cells(&t->model.config);
}

static void threshold(sf_trainer *t)
{
  const size_t cells = sf_config_cells(&t->model.config);
  const float limit = fminf((float)mean_density(t), density_threshold) * (t->iteration < LAST_SWEEP ? young : 1);
  size_t occupied = 0;
  for (size_t byte = 0; byte < cells / 8; byte++) {
    unsigned bits = 0;
    uint8_t is[8];
    for (int b = 0; b < 8; b++) is[b] = t->density[8 * byte + b] >= limit; /* all alike: none is empty */
    for (int b = 0; b < 8; b++) bits |= (unsigned)is[b] << b;
    t->model.occupancy[byte] = (uint8_t)bits;
    occupied += (size_t)__builtin_popcount(bits);
  }
  t->occupied = (double)occupied / (double)cells;
}

/* A cube is occupied as a whole, or not. */
static size_t list_occupied(const sf_trainer *t, const cell_grid *g, uint32_t *list)
{
  size_t occupied = 0;
  const size_t res = (size_t)g->config.occ_res, rows = g->cells / res;
  for (size_t row = 0; row < rows; row++) {
    const uint8_t *bits = t->model.occupancy + first_of(g, row * res) / 8;
    for (size_t x = 0; x < res; x++) {
      const size_t at = x * g->side;
      if (bits[at / 8] == 0)
        x |= 7 / g->side; /* the last of this byte */
      else if (bits[at / 8] >> at % 8 & 1)
        list[occupied++] = (uint32_t)(row * res + x);
    }
  }
  return occupied;
}

/* Whether the cell and those before and behind it are all seen. */
static inline bool three_seen(const uint8_t *seen, size_t cell)
{
  const size_t byte = (cell - 1) / 8;
  return ((seen[byte] | seen[byte + 1] << 8) >> (cell - 1) % 8 & 7) == 7;
}

/* The empty cells that touch an occupied one, in the order in which the occupied ones find them. list: the occupied
 * cells; replaced. */
static size_t list_neighbours(const cell_grid *g, uint32_t *list, size_t occupied, uint8_t *seen)
{
  const size_t res = (size_t)g->config.occ_res, per = res * res * res;
  size_t found = occupied;
  memset(seen, 0, g->cells / 8 + 1);
  for (size_t i = 0; i < occupied; i++) seen[list[i] / 8] |= (uint8_t)(1u << list[i] % 8);
  for (size_t i = 0; i < occupied; i++) {
    const size_t in = list[i] % per, x = in % res, y = in / res % res, z = in / res / res;
    for (size_t k = z ? z - 1 : 0; k <= z + 1 && k < res; k++)
      for (size_t j = y ? y - 1 : 0; j <= y + 1 && j < res; j++) {
        const size_t row = list[i] - in + (k * res + j) * res;
        if (x > 0 && x + 1 < res && three_seen(seen, row + x)) continue; /* most of them */
        for (size_t h = x ? x - 1 : 0; h <= x + 1 && h < res; h++) {
          const size_t cell = row + h;
          if (seen[cell / 8] >> cell % 8 & 1) continue;
          seen[cell / 8] |= (uint8_t)(1u << cell % 8);
          list[found++] = (uint32_t)cell;
        }
      }
  }
  memmove(list, list + occupied, (found - occupied) * sizeof *list);
  return found - occupied;
}

/* As many of the listed cells as an update visits, spread over the list. */
static sf_status visit_list(sf_trainer *t, visit *v, size_t count, size_t most, uint64_t stream, int steps)
{
  const size_t stride = (count + most - 1) / most;
  v->count = stride ? count / stride : 0;
  v->stride = stride ? stride : 1;
  v->stream = stream;
  return v->count ? visit_cells(t, v, steps) : sf_ok();
}

static bool is_sweep(int64_t iteration)
{
  for (int64_t at = FIRST; at <= LAST_SWEEP; at *= 4)
    if (iteration == at) return true;
  return false;
}

static sf_status update(sf_trainer *t, int steps, uint32_t *list, uint8_t *seen, float *sigma)
{
  const cell_grid g = grid_of_now(t);
  if (is_sweep(t->iteration)) {
    memset(t->density, 0, sf_config_cells(&t->model.config) * sizeof *t->density);
    SF_TRY(visit_cells(t, &(visit){&g, NULL, g.cells, 1, RNG_OCCUPANCY, sigma}, steps));
  } else {
    const size_t occupied = list_occupied(t, &g, list);
    visit listed = {.grid = &g, .cell = list, .sigma = sigma};
    SF_TRY(visit_cells(t, &(visit){&g, NULL, g.most, g.cells / g.most, RNG_OCCUPANCY, sigma}, steps));
    SF_TRY(visit_list(t, &listed, occupied, g.most, RNG_OCCUPANCY + 16, steps));
    const size_t near = list_neighbours(&g, list, occupied, seen);
    SF_TRY(visit_list(t, &listed, near, g.most, RNG_OCCUPANCY + 32, steps));
  }
  threshold(t);
  return sf_ok();
}

sf_status sf_occupancy_update(sf_trainer *t, int steps)
{
  const size_t cells = sf_config_cells(&t->model.config);
  if (t->iteration < FIRST) return sf_ok();
  uint32_t *list = malloc(cells * sizeof *list);
  uint8_t *seen = malloc(cells / 8 + 1); /* three_seen looks at two bytes */
  float *sigma = malloc(cells * sizeof *sigma);
  sf_status status =
      list && seen && sigma ? sf_ok() : sf_fail(SF_E_MEMORY, "train: no memory for the occupancy update");
  status = sf_ranks_agree(t->options.ranks, status);
  if (!status.code) status = update(t, steps, list, seen, sigma);
  free(list);
  free(seen);
  free(sigma);
  return status;
}
