/* Grid tables: which entries a place reads, smaller tables, entries that nothing reads. */
#include "src/fx/round.h"
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CELL_FRAC = 8, POS_TO_CELL = 32 }; /* Q0.24 * Q16.16 to Q.8 */

int64_t sf_grid_level_entries(const fx_grid *grid, int level)
{
  return (level + 1 < grid->levels ? grid->offset[level + 1] : grid->entries) - grid->offset[level];
}

static uint32_t corner_of(uint32_t pos, int32_t scale_q16)
{
  const int64_t p = fx_rshift_round((int64_t)pos * scale_q16, POS_TO_CELL) + (1 << (CELL_FRAC - 1));
  return (uint32_t)(p >> CELL_FRAC);
}

sf_corners sf_grid_corners(const fx_grid *grid, int level, const uint32_t low[3], const uint32_t high[3])
{
  sf_corners c;
  for (int axis = 0; axis < 3; axis++) {
    c.base[axis] = corner_of(low[axis], grid->scale_q16[level]);
    c.last[axis] = corner_of(high[axis], grid->scale_q16[level]) + 1;
  }
  return c;
}

static uint32_t hash(uint32_t x, uint32_t y, uint32_t z)
{
  return x ^ y * 2654435761u ^ z * 805459861u;
}

int64_t sf_grid_entry(const fx_grid *grid, int level, uint32_t x, uint32_t y, uint32_t z)
{
  const uint32_t stride = (uint32_t)grid->stride[level];
  if (stride) return grid->offset[level] + x + (int64_t)stride * (y + (int64_t)stride * z);
  return grid->offset[level] + (hash(x, y, z) & ((1u << grid->log2_size[level]) - 1));
}

/* Where an entry of a level goes in a smaller table: hashes keep their low bits. */
static int64_t place_of(const fx_grid *grid, int level, int64_t entry, int log2_size)
{
  const uint32_t mask = (1u << log2_size) - 1, stride = (uint32_t)grid->stride[level], at = (uint32_t)entry;
  return (stride ? hash(at % stride, at / stride % stride, at / stride / stride) : at) & mask;
}

/* Entries that meet are averaged by their use: one that no sample reads leaves the other as it was. Where none is
 * read, all count alike. */
void sf_grid_copy_level(const fx_grid *grid, int level, int log2_size, const uint64_t *use, int8_t *to, double *sum)
{
  const int64_t count = sf_grid_level_entries(grid, level), offset = grid->offset[level];
  const int8_t *from = grid->table + offset * FX_GRID_FEATURES;
  if (log2_size < 0) {
    memcpy(to, from, (size_t)count * FX_GRID_FEATURES);
    return;
  }
  const double unread = 0x1p-20; /* against at least 1 of an entry that is read: far below half an LSB */
  memset(sum, 0, ((size_t)1 << log2_size) * 3 * sizeof *sum);
  for (int64_t i = 0; i < count; i++) {
    const double weight = use[offset + i] ? (double)use[offset + i] : unread;
    double *s = sum + place_of(grid, level, i, log2_size) * 3;
    s[0] += weight * from[2 * i], s[1] += weight * from[2 * i + 1], s[2] += weight;
  }
  for (int64_t i = 0; i < (int64_t)1 << log2_size; i++)
    for (int f = 0; f < FX_GRID_FEATURES; f++)
      to[2 * i + f] = (int8_t)(sum[3 * i + 2] > 0 ? nearbyint(sum[3 * i + f] / sum[3 * i + 2]) : 0);
}

/* ---- entries that nothing reads ---- */

static void mark_cell(const fx_scene *scene, int level, uint32_t cell, uint8_t *read)
{
  const uint32_t res = (uint32_t)scene->occ_res, cascade = cell / (res * res * res);
  const uint32_t edge = (1u << SF_POS_FRAC) >> ((uint32_t)scene->log2_bound - cascade), side = edge / res;
  const uint32_t corner = (1u << (SF_POS_FRAC - 1)) - edge / 2;
  const uint32_t low[3] = {corner + cell % res * side, corner + cell / res % res * side,
                           corner + cell / res / res % res * side};
  const uint32_t high[3] = {low[0] + side - 1, low[1] + side - 1, low[2] + side - 1};
  const sf_corners c = sf_grid_corners(&scene->grid, level, low, high);
  for (uint32_t z = c.base[2]; z <= c.last[2]; z++)
    for (uint32_t y = c.base[1]; y <= c.last[1]; y++)
      for (uint32_t x = c.base[0]; x <= c.last[0]; x++) read[sf_grid_entry(&scene->grid, level, x, y, z)] = 1;
}

/* Levels have tables of their own, so threads never share an entry. */
static void mark_read(const fx_scene *scene, uint8_t *read)
{
  const uint32_t res = (uint32_t)scene->occ_res, cells = (uint32_t)(scene->log2_bound + 1) * res * res * res;
#pragma omp parallel for schedule(dynamic)
  for (int level = 0; level < scene->grid.levels; level++)
    for (uint32_t cell = 0; cell < cells; cell++)
      if (scene->occupancy[cell >> 3] >> (cell & 7) & 1) mark_cell(scene, level, cell, read);
}

int64_t sf_grid_zero_unread(fx_scene *scene)
{
  uint8_t *read = calloc((size_t)scene->grid.entries, 1);
  int64_t zero = 0;
  if (!read) return -1;
  mark_read(scene, read);
  for (int64_t i = 0; i < scene->grid.entries; i++) {
    int8_t *entry = scene->grid.table + i * FX_GRID_FEATURES;
    if (!read[i]) entry[0] = entry[1] = 0;
    zero += !entry[0] && !entry[1];
  }
  free(read);
  return zero;
}
