/* Points of a ray in occupied cells, 64 at a time: the build defines SF_ISA. A block of 8 x 8 x 8 empty cells is passed
 * without a look at its cells, because the grids do not fit the first caches. The build does not contract these
 * multiply-adds, so every instruction set finds the points of sf_march_next. */
#include "snn/kernels.h"

enum { POINTS = 64, BLOCK = SF_BLOCK_CELLS };

#define SF_JOIN_(a, b) a##b
#define SF_JOIN(a, b) SF_JOIN_(a, b)

/* In the finest cells of all cascades, from the low faces of the box (sf_march_at). */
static inline int32_t place(const sf_march *m, int axis, float distance, int fine)
{
  float x = (m->origin[axis] + distance * m->direction[axis]) * m->scale[axis] + m->offset[axis];
  x = x > 0 ? x : 0;
  return (int32_t)((x < 0x1.fffffep-1f ? x : 0x1.fffffep-1f) * (float)fine);
}

/* Places in the cells of each point's own cascade. The grids lie one upon another along the last axis. */
static void choose_cascades(const sf_march *m, const uint8_t *least, int32_t at[3][POINTS])
{
  const int res = m->res, middle = res / 2, fine = res << (m->cascades - 1);
  int32_t cascade[POINTS], farthest[POINTS] = {0};
  for (int a = 0; a < 3; a++)
    for (int p = 0; p < POINTS; p++) {
      at[a][p] -= fine / 2;
      farthest[p] |= at[a][p] < 0 ? ~at[a][p] : at[a][p]; /* negative numbers reach one place farther */
    }
  for (int p = 0; p < POINTS; p++) cascade[p] = least[p];
  for (int c = 1; c < m->cascades; c++)
    for (int p = 0; p < POINTS; p++) cascade[p] += farthest[p] >> cascade[p] >= middle;
  for (int a = 0; a < 3; a++)
    for (int p = 0; p < POINTS; p++) at[a][p] = (at[a][p] >> cascade[p]) + middle;
  for (int p = 0; p < POINTS; p++) at[2][p] += cascade[p] * res;
}

static uint64_t in_blocks(const uint8_t *block, int blocks, int32_t at[3][POINTS])
{
  int32_t index[POINTS];
  uint64_t found = 0;
  for (int p = 0; p < POINTS; p++)
    index[p] = (at[2][p] / BLOCK * blocks + at[1][p] / BLOCK) * blocks + at[0][p] / BLOCK;
#pragma GCC unroll 16
  for (int p = 0; p < POINTS; p++) found |= (uint64_t)(block[(uint32_t)index[p] / 8] >> index[p] % 8u & 1) << p;
  return found;
}

static uint64_t in_cells(const sf_march *m, int first, uint64_t points)
{
  const sf_steps *s = m->steps;
  const int res = m->res, fine = res << (m->cascades - 1);
  const float *start = s->start + first, *length = s->length + first;
  float distance[POINTS];
  int32_t at[3][POINTS];
  for (int p = 0; p < POINTS; p++) distance[p] = m->lattice.first + length[p] * m->jitter + start[p];
  for (int a = 0; a < 3; a++)
    for (int p = 0; p < POINTS; p++) at[a][p] = place(m, a, distance[p], fine);
  if (m->cascades > 1) choose_cascades(m, s->cascade + first, at);
  if (s->blocks) points &= in_blocks(s->block, res / BLOCK, at);
  uint64_t found = 0;
  for (; points; points &= points - 1) {
    const int p = __builtin_ctzll(points);
    const size_t cell = ((size_t)at[2][p] * (size_t)res + (size_t)at[1][p]) * (size_t)res + (size_t)at[0][p];
    found |= (uint64_t)(m->occupancy[cell / 8] >> cell % 8 & 1) << p;
  }
  return found;
}

uint64_t SF_JOIN(sf_march_points_, SF_ISA)(const sf_march *m, int word);
uint64_t SF_JOIN(sf_march_points_, SF_ISA)(const sf_march *m, int word)
{
  const int first = word * POINTS, left = m->lattice.count - first;
  if (left <= 0) return 0;
  return in_cells(m, first, left < POINTS ? ((uint64_t)1 << left) - 1 : ~(uint64_t)0);
}
