/* TensoRF's field in lines of FX_LINE bytes of a memory: where its arrays lie, which lines a position reads, and the
 * memory itself. Density before appearance, pair by pair, a plane before its line; points as in their arrays; a point's
 * components in as many lines as they need, 0 behind the last.
 * Mirror: rtl/sf_planes_reads.sv */
#include "src/fx/cache.h"
#include "src/fx/tensorf_place.h"
#include <string.h>
#include "src/fx/nofloat.h"

uint32_t fx_tensorf_places(const fx_tensorf *field, fx_factor_place place[2 * FX_PAIRS])
{
  uint32_t line = 0;
  for (int i = 0; i < 2 * FX_PAIRS; i++) {
    const fx_factors *factors = i < FX_PAIRS ? &field->density : &field->appearance;
    const int pair = i % FX_PAIRS, *axes = fx_pair_axes[pair];
    const uint32_t lines = (uint32_t)((factors->components[pair] + FX_LINE - 1) / FX_LINE);
    place[i] = (fx_factor_place){.plane = line, .point_lines = lines};
    line += (uint32_t)field->res[axes[0]] * (uint32_t)field->res[axes[1]] * lines;
    place[i].line = line;
    line += (uint32_t)field->res[axes[2]] * lines;
  }
  return line;
}

/* Of one point, or of two beside each other, line by line. */
static int ask(uint32_t *line, uint32_t first, uint32_t point, int points, uint32_t lines)
{
  int n = 0;
  for (uint32_t i = 0; i < lines; i++)
    for (uint32_t k = 0; k < (uint32_t)points; k++) line[n++] = first + (point + k) * lines + i;
  return n;
}

static int pair_lines(const fx_factor_place *place, int pair, const int32_t res[3], const vm_place *p, uint32_t *line)
{
  const int u = fx_pair_axes[pair][0], v = fx_pair_axes[pair][1], w = fx_pair_axes[pair][2];
  const uint32_t width = (uint32_t)res[u], x = (uint32_t)p->at[u], z = (uint32_t)p->at[w];
  const int32_t y[2] = {p->at[v], p->next[v]};
  int n = 0;
  for (int j = 0; j < 1 + (p->g[v] != 0); j++)
    n += ask(line + n, place->plane, (uint32_t)y[j] * width + x, 1 + (p->g[u] != 0), place->point_lines);
  return n + ask(line + n, place->line, z, 1 + (p->g[w] != 0), place->point_lines);
}

int fx_tensorf_lines(const fx_tensorf *field, bool appearance, const uint32_t pos[3], uint32_t line[FX_LOOKUPS_ROOM])
{
  const vm_place p = vm_find(field->res, pos);
  fx_factor_place place[2 * FX_PAIRS];
  int n = 0;
  fx_tensorf_places(field, place);
  for (int pair = 0; pair < FX_PAIRS; pair++)
    n += pair_lines(&place[(appearance ? FX_PAIRS : 0) + pair], pair, field->res, &p, line + n);
  return n;
}

static void put_points(uint8_t *memory, const int8_t *entries, size_t points, size_t components, size_t lines)
{
  memset(memory, 0, points * lines * FX_LINE);
  for (size_t i = 0; i < points; i++) memcpy(memory + i * lines * FX_LINE, entries + i * components, components);
}

void fx_tensorf_memory(const fx_tensorf *field, uint8_t *memory)
{
  fx_factor_place place[2 * FX_PAIRS];
  fx_tensorf_places(field, place);
  for (int i = 0; i < 2 * FX_PAIRS; i++) {
    const fx_factors *factors = i < FX_PAIRS ? &field->density : &field->appearance;
    const int pair = i % FX_PAIRS, *axes = fx_pair_axes[pair];
    const size_t n = (size_t)factors->components[pair], lines = place[i].point_lines;
    put_points(memory + (size_t)place[i].plane * FX_LINE, factors->plane[pair],
               (size_t)field->res[axes[0]] * (size_t)field->res[axes[1]], n, lines);
    put_points(memory + (size_t)place[i].line * FX_LINE, factors->line[pair], (size_t)field->res[axes[2]], n, lines);
  }
}
