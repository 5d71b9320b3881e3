/* The third count of what the field asks of memory and of what samples share: from positions and spike bitmaps, with
 * plain loops. It mirrors the definitions of fx/cache.h, not the code of src/fx. */
#include "energy/energy.h"
#include <stdlib.h>
#include <string.h>

sf_status sf_memory_recount_open(sf_memory_recount *m, const fx_scene *scene, const fx_cache_shape *shape)
{
  *m = (sf_memory_recount){.scene = scene, .shape = *shape};
  m->slots = (uint64_t)shape->bytes / FX_LINE;
  m->slot = calloc(m->slots, sizeof *m->slot);
  return m->slot ? sf_ok() : sf_fail(SF_E_MEMORY, "audit: no memory for a cache of %d bytes", shape->bytes);
}

void sf_memory_recount_close(sf_memory_recount *m)
{
  free(m->slot);
  m->slot = NULL;
}

void sf_memory_recount_begin(sf_memory_recount *m)
{
  m->begun = false;
}

void sf_memory_recount_ray(sf_memory_recount *m, uint64_t tile)
{
  if (m->begun && tile == m->tile) return;
  m->begun = true, m->tile = tile, m->samples = 0;
  memset(m->slot, 0, m->slots * sizeof *m->slot);
}

/* The slots of a set stand one behind the other; one that was never used has time 0, so it is the oldest. */
static void look_up(sf_memory_recount *m, uint64_t line)
{
  const uint64_t ways = (uint64_t)m->shape.ways, sets = m->slots / ways;
  sf_cache_slot *set = m->slot + line % sets * ways, *oldest = set;
  m->counts.lookups++;
  m->clock++;
  for (uint64_t i = 0; i < ways; i++) {
    if (set[i].time && set[i].line == line) {
      set[i].time = m->clock;
      return;
    }
    if (set[i].time < oldest->time) oldest = &set[i];
  }
  m->counts.misses++;
  *oldest = (sf_cache_slot){line, m->clock};
}

/* ---- hash grid ---- */

static uint64_t entry_of(const fx_grid *grid, int level, uint64_t x, uint64_t y, uint64_t z)
{
  const uint64_t first = (uint64_t)grid->offset[level], stride = (uint64_t)grid->stride[level];
  if (stride) return first + x + y * stride + z * stride * stride;
  const uint64_t hash = x ^ y * 2654435761u ^ z * 805459861u;
  return first + hash % ((uint64_t)1 << grid->log2_size[level]);
}

static void read_grid(sf_memory_recount *m, const uint32_t pos[3])
{
  const fx_grid *grid = &m->scene->grid;
  const uint64_t bytes = FX_GRID_FEATURES * sizeof *grid->table;
  for (int level = 0; level < grid->levels; level++) {
    uint64_t cell[3]; /* scale has 16 fraction bits, a position 24, a place in the cell 8; cells begin at 1/2 */
    for (int axis = 0; axis < 3; axis++) {
      const uint64_t product = (uint64_t)pos[axis] * (uint64_t)grid->scale_q16[level];
      cell[axis] = ((product + ((uint64_t)1 << 31)) / ((uint64_t)1 << 32) + 128) / 256;
    }
    for (uint64_t z = 0; z < 2; z++)
      for (uint64_t y = 0; y < 2; y++) {
        const uint64_t near = entry_of(grid, level, cell[0], cell[1] + y, cell[2] + z) * bytes / FX_LINE;
        const uint64_t far = entry_of(grid, level, cell[0] + 1, cell[1] + y, cell[2] + z) * bytes / FX_LINE;
        look_up(m, near);
        if (far != near) look_up(m, far);
      }
  }
}

/* ---- TensoRF ---- */

/* Points of an axis that have a weight: one, or two neighbours. */
static int points_of(uint32_t pos, int32_t res, uint64_t point[2])
{
  const uint64_t place = ((uint64_t)pos * (uint64_t)(res - 1) + (1 << 15)) / (1 << 16);
  point[0] = place / 256, point[1] = point[0] + 1;
  return place % 256 ? 2 : 1;
}

static void read_point(sf_memory_recount *m, uint64_t first, uint64_t point, uint64_t lines)
{
  for (uint64_t i = 0; i < lines; i++) look_up(m, first + point * lines + i);
}

/* Reads the points of all pairs from line `first` on, or none without m; returns the lines that they have. */
static uint64_t read_factors(sf_memory_recount *m, const fx_factors *factors, const int32_t res[3],
                             const uint32_t pos[3], uint64_t first)
{
  static const int axes[FX_PAIRS][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  const uint64_t begin = first;
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int u = axes[pair][0], v = axes[pair][1], w = axes[pair][2];
    const uint64_t lines = ((uint64_t)factors->components[pair] + FX_LINE - 1) / FX_LINE;
    uint64_t x[2], y[2], z[2];
    const int nx = points_of(pos[u], res[u], x), ny = points_of(pos[v], res[v], y), nz = points_of(pos[w], res[w], z);
    for (int i = 0; m && i < nx * ny; i++) read_point(m, first, y[i / nx] * (uint64_t)res[u] + x[i % nx], lines);
    first += (uint64_t)res[u] * (uint64_t)res[v] * lines;
    for (int i = 0; m && i < nz; i++) read_point(m, first, z[i], lines);
    first += (uint64_t)res[w] * lines;
  }
  return first - begin;
}

void sf_memory_recount_read(sf_memory_recount *m, fx_read what, const uint32_t pos[3])
{
  const fx_tensorf *field = &m->scene->tensorf;
  if (what == FX_READ_GRID) {
    read_grid(m, pos);
  } else if (what == FX_READ_DENSITY) {
    read_factors(m, &field->density, field->res, pos, 0);
  } else {
    const uint64_t first = read_factors(NULL, &field->density, field->res, pos, 0);
    read_factors(m, &field->appearance, field->res, pos, first);
  }
}

/* ---- samples that share ---- */

void sf_memory_recount_sample(sf_memory_recount *m, const uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS])
{
  if (m->samples % FX_SHARED == 0) {
    m->counts.groups++;
    memset(m->fired, 0, sizeof m->fired);
  }
  m->samples++;
  for (int s = 0; s < FX_SPIKING; s++)
    for (int n = 0; n < 64 * SF_SPIKE_WORDS; n++)
      for (int t = 0; t < m->scene->net.steps && !m->fired[s][n]; t++)
        if (spikes[fx_spiking_layers[s]][t][n / 64] >> n % 64 & 1) m->fired[s][n] = true, m->counts.rows[s]++;
}

sf_status sf_memory_compare(const fx_memory_counts *a, const char *a_name, const fx_memory_counts *b,
                            const char *b_name)
{
  static const char *const name[] = {"field look-ups",
                                     "field lines missed",
                                     "groups of samples",
                                     "rows of D2 that samples share",
                                     "rows of C2 that samples share",
                                     "rows of C3 that samples share"};
  const uint64_t x[] = {a->lookups, a->misses, a->groups, a->rows[0], a->rows[1], a->rows[2]};
  const uint64_t y[] = {b->lookups, b->misses, b->groups, b->rows[0], b->rows[1], b->rows[2]};
  for (size_t i = 0; i < sizeof x / sizeof *x; i++)
    if (x[i] != y[i])
      return sf_fail(SF_E_DIFFERENCE, "%s: %s %llu, %s %llu", name[i], a_name, (unsigned long long)x[i], b_name,
                     (unsigned long long)y[i]);
  return sf_ok();
}
