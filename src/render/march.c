#include "render/march.h"
#include <math.h>

/* Intervals that end within `depth`. */
static int32_t intervals_within(const sf_steps *s, float depth)
{
  if (!s->growing) /* beyond the box there are no more, but far from it the distances have no precision left */
    return (int32_t)fminf(floorf(depth / s->shortest), (float)s->lattice) / s->stride;
  int32_t low = 0, high = s->count;
  while (low < high) {
    const int32_t middle = (low + high) / 2;
    if (s->start[middle] + s->length[middle] <= depth)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

sf_lattice sf_ray_lattice(const sf_steps *steps, const float origin[3], const float direction[3])
{
  float enter = steps->near, leave = steps->far;
  for (int a = 0; a < 3; a++) {
    if (direction[a] == 0) {
      if (origin[a] <= steps->low[a] || origin[a] >= steps->high[a]) return (sf_lattice){0};
      continue;
    }
    float t0 = (steps->low[a] - origin[a]) / direction[a], t1 = (steps->high[a] - origin[a]) / direction[a];
    enter = fmaxf(enter, fminf(t0, t1));
    leave = fminf(leave, fmaxf(t0, t1));
  }
  if (!(leave > enter)) return (sf_lattice){0};
  return (sf_lattice){.first = enter + steps->shortest / 2, .count = intervals_within(steps, leave - enter)};
}

enum { BLOCK = SF_BLOCK_CELLS, BLOCKS_MOST = 32 };

sf_status sf_march_steps(sf_steps *steps, const sf_model *model, int stride)
{
  const int res = model->config.occ_res, blocks = res / BLOCK, layers = sf_config_cascades(&model->config) * res;
  SF_TRY(sf_steps_make(steps, &model->config, stride));
  if (layers > res && res < 4 * BLOCK) return sf_ok(); /* a block could reach into the finer cascade */
  for (int z = 0; z < layers / BLOCK; z++)
    for (int y = 0; y < blocks; y++) {
      uint8_t any[BLOCKS_MOST] = {0};
      for (int row = 0; row < BLOCK * BLOCK; row++) {
        const int cell_z = z * BLOCK + row / BLOCK, cell_y = y * BLOCK + row % BLOCK;
        const uint8_t *cells = model->occupancy + ((size_t)cell_z * res + cell_y) * blocks;
        for (int x = 0; x < blocks; x++) any[x] |= cells[x];
      }
      const int first = (z * blocks + y) * blocks;
      for (int x = 0; x < blocks; x++)
        if (any[x]) steps->block[(first + x) / 8] |= (uint8_t)(1u << (first + x) % 8);
    }
  steps->blocks = true;
  return sf_ok();
}

sf_march sf_march_begin(const sf_model *model, const sf_steps *steps, const float origin[3], const float direction[3],
                        float jitter)
{
  sf_march m = {.steps = steps,
                .occupancy = model->occupancy,
                .res = model->config.occ_res,
                .cascades = sf_config_cascades(&model->config),
                .jitter = jitter,
                .stop = (float)model->config.stop};
  for (int a = 0; a < 3; a++) {
    m.origin[a] = origin[a];
    m.direction[a] = direction[a];
    m.scale[a] = 1 / (steps->high[a] - steps->low[a]);
    m.offset[a] = -steps->low[a] * m.scale[a];
    m.way[a] = direction[a] == 0 ? 0 : (steps->high[a] - steps->low[a]) / direction[a];
  }
  m.lattice = sf_ray_lattice(steps, origin, direction);
  m.lattice.first -= steps->shortest / 2;
  return m;
}

void sf_march_at(const sf_march *m, int n, float x[3])
{
  const float t = sf_march_distance(m, n);
  for (int a = 0; a < 3; a++) {
    const float at = (m->origin[a] + t * m->direction[a]) * m->scale[a] + m->offset[a]; /* fminf would be a call */
    x[a] = !(at > 0) ? 0 : at > 0x1.fffffep-1f ? 0x1.fffffep-1f : at;
  }
}

/* The cell at x is ((cascade*res + place[2])*res + place[1])*res + place[0]. Places of all cascades follow from those
 * of the finest cells counted from the middle of the box: cascade c halves them c times. */
typedef struct cell {
  int cascade, place[3];
} cell;

static inline cell find_cell(const sf_march *m, int least, const float x[3])
{
  const int fine = m->res << (m->cascades - 1), middle = m->res / 2;
  int at[3], farthest = 0;
  for (int a = 0; a < 3; a++) {
    at[a] = (int)(x[a] * (float)fine) - fine / 2;
    farthest |= at[a] < 0 ? ~at[a] : at[a]; /* negative numbers reach one place farther */
  }
  cell c = {.cascade = least};
  while (farthest >> c.cascade >= middle) c.cascade++;
  for (int a = 0; a < 3; a++) c.place[a] = (at[a] >> c.cascade) + middle;
  return c;
}

/* Distance from x to where the ray leaves the cell, or with size = BLOCK its block. */
static inline float to_exit(const sf_march *m, const cell *c, int size, const float x[3])
{
  const int fine = m->res << (m->cascades - 1);
  const float share = 1.0f / (float)fine;
  float ahead = INFINITY;
  for (int a = 0; a < 3; a++) {
    const int place = (c->place[a] & -size) + (m->direction[a] > 0 ? size : 0) - m->res / 2;
    const float face = (float)(place * (1 << c->cascade) + fine / 2) * share;
    const float exit = m->way[a] == 0 ? INFINITY : (face - x[a]) * m->way[a];
    ahead = exit < ahead ? exit : ahead;
  }
  return ahead;
}

static inline bool is_occupied(const sf_march *m, const cell *c)
{
  const size_t bit = (((size_t)c->cascade * m->res + c->place[2]) * m->res + c->place[1]) * m->res + c->place[0];
  return m->occupancy[bit / 8] >> (bit % 8) & 1;
}

static inline bool is_block_empty(const sf_march *m, const cell *c)
{
  const int blocks = m->res / BLOCK;
  const int bit =
      ((c->cascade * blocks + c->place[2] / BLOCK) * blocks + c->place[1] / BLOCK) * blocks + c->place[0] / BLOCK;
  return !(m->steps->block[bit / 8] >> bit % 8 & 1);
}

/* The first point from n on that is not in the cell or block, whose exit is `ahead`. */
static inline int skip(const sf_march *m, int n, float ahead)
{
  const sf_steps *s = m->steps;
  const float farthest = 2 * (s->high[0] - s->low[0]) + 2 * (s->high[1] - s->low[1]);
  if (!s->growing) {
    const float points = (ahead < farthest ? ahead : farthest) / s->length[n] - 1e-3f;
    return n + 1 + (points > 0 ? (int)points : 0);
  }
  const float end = sf_march_distance(m, n) + ahead - 1e-3f * s->length[n];
  const int cascade = s->cascade[n]; /* where coarser cells begin, others may be occupied */
  do n++;
  while (n < m->lattice.count && s->cascade[n] == cascade && sf_march_distance(m, n) < end);
  return n;
}

int sf_march_next(const sf_march *m, int n, float x[3])
{
  while (n < m->lattice.count) {
    sf_march_at(m, n, x);
    const cell c = find_cell(m, m->steps->cascade[n], x);
    const bool block = m->steps->blocks && is_block_empty(m, &c); /* asked first: the blocks' bits are in the cache */
    if (!block && is_occupied(m, &c)) return n;
    n = skip(m, n, to_exit(m, &c, block ? BLOCK : 1, x));
  }
  return -1;
}
