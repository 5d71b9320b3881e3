/* Multiresolution hash grid (Mueller et al. 2022) with torch-ngp's cell rule, in integers.
 * Mirror: rtl/sf_grid.sv (find_cell, entry_index: rtl/sf_grid_cell.sv, fx_grid_weights: rtl/sf_grid_weight.sv,
 * sums and feature: rtl/sf_trilinear.sv)
 *
 *   pos  = (x * scale rounded to Q.8, half up) + 1/2 per axis; cell = its integer part, g = its 8 fraction bits
 *   w    = product over the axes of (256 - g or g) / 256. The x-y products are exact in Q0.16; along z each splits
 *          into upper = rshift_round(wxy * gz, 8) and lower = wxy - upper. So every corner weight is the exact
 *          product within half an LSB of Q0.16 and the eight always sum to exactly 65536: a constant field is
 *          reproduced exactly.
 *   f    = sat12(rshift_round(sum of entry * w, shift)), |sum| <= 128 * 2^16 */
#include "src/fx/unit.h"
#include "src/fx/cache.h"
#include "src/fx/scene.h"
#include "src/fx/round.h"
#include "src/fx/nofloat.h"

enum { CELL_FRAC = 8, SCALE_FRAC = 16, CORNERS = FX_GRID_CORNERS };
#define HASH_Y 2654435761u
#define HASH_Z 805459861u

typedef struct cell {
  uint32_t base[3];
  int32_t weight[CORNERS]; /* Q0.16; bit 0 of the index = x + 1, bit 1 = y + 1, bit 2 = z + 1 */
} cell;

void fx_grid_weights(const int32_t g[3], int32_t weight[CORNERS])
{
  const int32_t one = 1 << CELL_FRAC;
  for (int corner = 0; corner < 4; corner++) {
    const int32_t xy = (corner & 1 ? g[0] : one - g[0]) * (corner & 2 ? g[1] : one - g[1]);
    const int32_t upper = (int32_t)fx_rshift_round((int64_t)xy * g[2], CELL_FRAC);
    weight[corner] = xy - upper;
    weight[corner + 4] = upper;
  }
}

static cell find_cell(const uint32_t *pos, int32_t scale_q16)
{
  cell c;
  int32_t g[3];
  for (int axis = 0; axis < 3; axis++) {
    const int64_t product = (int64_t)pos[axis] * scale_q16; /* Q.40, below 2^55 */
    const int64_t p = fx_rshift_round(product, SF_POS_FRAC + SCALE_FRAC - CELL_FRAC) + (1 << (CELL_FRAC - 1));
    c.base[axis] = (uint32_t)(p >> CELL_FRAC);
    g[axis] = (int32_t)(p & ((1 << CELL_FRAC) - 1));
  }
  fx_grid_weights(g, c.weight);
  return c;
}

static uint32_t entry_index(const fx_grid *grid, int level, const uint32_t *base, int corner)
{
  const uint32_t x = base[0] + (corner & 1), y = base[1] + (corner >> 1 & 1), z = base[2] + (corner >> 2);
  const uint32_t stride = (uint32_t)grid->stride[level];
  if (stride) return x + stride * (y + stride * z);
  return (x ^ y * HASH_Y ^ z * HASH_Z) & ((1u << grid->log2_size[level]) - 1);
}

static int16_t feature(int32_t sum, int shift, uint64_t *saturated)
{
  const int64_t exact = fx_rshift_round(sum, shift);
  const int64_t kept = exact > FX_INPUT_MAX ? FX_INPUT_MAX : exact < -FX_INPUT_MAX ? -FX_INPUT_MAX : exact;
  *saturated += kept != exact;
  return (int16_t)kept;
}

void fx_grid_features(const fx_grid *grid, const uint32_t *pos, int16_t *f, fx_counts *counts)
{
  uint64_t saturated = 0;
  for (int level = 0; level < grid->levels; level++) {
    const cell c = find_cell(pos, grid->scale_q16[level]);
    const int8_t *table = grid->table + grid->offset[level] * FX_GRID_FEATURES;
    int32_t sum[FX_GRID_FEATURES] = {0};
    for (int corner = 0; corner < CORNERS; corner++) {
      const int8_t *entry = table + (size_t)entry_index(grid, level, c.base, corner) * FX_GRID_FEATURES;
      for (int i = 0; i < FX_GRID_FEATURES; i++) sum[i] += c.weight[corner] * entry[i];
    }
    for (int i = 0; i < FX_GRID_FEATURES; i++)
      f[level * FX_GRID_FEATURES + i] = feature(sum[i], grid->shift[level], &saturated);
  }
  if (!counts) return;
  counts->saturated_features += saturated;
  counts->grid_bytes += fx_grid_bytes(grid);
}

uint64_t fx_grid_bytes(const fx_grid *grid)
{
  return (uint64_t)grid->levels * CORNERS * FX_GRID_FEATURES;
}

int fx_grid_lines(const fx_grid *grid, const uint32_t pos[3], uint32_t line[FX_LOOKUPS_ROOM])
{
  int n = 0;
  for (int level = 0; level < grid->levels; level++) {
    const cell c = find_cell(pos, grid->scale_q16[level]);
    for (int corner = 0; corner < CORNERS; corner++) {
      const int64_t entry = grid->offset[level] + entry_index(grid, level, c.base, corner);
      const uint32_t asked = (uint32_t)(entry / FX_LINE_ENTRIES);
      if (corner % 2 == 0 || asked != line[n - 1]) line[n++] = asked;
    }
  }
  return n;
}

void fx_places_fill(fx_places *places, const fx_grid *grid)
{
  *places = (fx_places){.grid = grid};
  for (int l = 0; l < grid->levels; l++) {
    const int32_t stride = grid->stride[l];
    places->scale[l] = grid->scale_q16[l];
    places->my[l] = stride ? stride : (int32_t)HASH_Y;
    places->mz[l] = stride ? stride * stride : (int32_t)HASH_Z;
    for (int pair = 0; pair < FX_LEVEL_PAIRS; pair++) {
      const int at = l * FX_LEVEL_PAIRS + pair;
      places->add_y[at] = pair & 1 ? places->my[l] : 0;
      places->add_z[at] = pair & 2 ? places->mz[l] : 0;
      places->mask[at] = stride ? -1 : (int32_t)((1u << grid->log2_size[l]) - 1);
      places->hashed[at] = stride ? 0 : -1;
      places->offset[at] = (int32_t)grid->offset[l];
    }
  }
}
