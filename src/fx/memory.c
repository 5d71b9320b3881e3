#include "src/fx/memory.h"
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

void fx_memory_counts_add(fx_memory_counts *sum, const fx_memory_counts *more)
{
  sum->lookups += more->lookups, sum->misses += more->misses, sum->groups += more->groups;
  for (int s = 0; s < FX_SPIKING; s++) sum->rows[s] += more->rows[s];
}

sf_status fx_memory_open(fx_memory *memory, const fx_scene *scene, const fx_cache_shape *shape)
{
  *memory = (fx_memory){.scene = scene};
  if (scene->backbone == FX_INGP) fx_places_fill(&memory->places, &scene->grid);
  return fx_cache_open(&memory->cache, shape);
}

void fx_memory_close(fx_memory *memory)
{
  fx_cache_close(&memory->cache);
  free(memory->log.sample), free(memory->log.order);
  memory->log = (fx_log){.count = 0};
}

void fx_memory_begin(fx_memory *memory)
{
  memory->run = memory->sharing_run = 0;
}

uint64_t fx_memory_ray(fx_memory *memory, uint64_t tile)
{
  if (memory->run == 0 || tile != memory->tile) {
    memory->tile = tile, memory->run++;
    fx_cache_empty(&memory->cache);
  }
  return memory->run;
}

static int lines_of(const fx_memory *memory, fx_read what, const uint32_t pos[3], uint32_t *line)
{
  const fx_scene *scene = memory->scene;
  if (what != FX_READ_GRID) return fx_tensorf_lines(&scene->tensorf, what == FX_READ_APPEARANCE, pos, line);
  return memory->kernels ? memory->kernels->lines(&memory->places, pos, line) : fx_grid_lines(&scene->grid, pos, line);
}

void fx_memory_read(fx_memory *memory, fx_read what, const uint32_t pos[3])
{
  uint32_t line[FX_LOOKUPS_ROOM];
  const int n = lines_of(memory, what, pos, line);
  if (memory->see) memory->see(memory->user, line, n);
  memory->counts.lookups += (uint64_t)n;
  memory->counts.misses +=
      memory->kernels ? memory->kernels->look_up(&memory->cache, line, n) : fx_cache_look_up(&memory->cache, line, n);
}

/* A row is read when its neuron fires for the first time in the group. */
void fx_memory_sample(fx_memory *memory, uint64_t run, const fx_fired *fired)
{
  if (run != memory->sharing_run || memory->in_group == FX_SHARED) {
    memory->sharing_run = run, memory->in_group = 0;
    memory->counts.groups++;
    memory->seen = (fx_fired){0};
  }
  memory->in_group++;
  for (int s = 0; s < FX_SPIKING; s++)
    for (int w = 0; w < SF_SPIKE_WORDS; w++) {
      const uint64_t first = fired->neurons[s][w] & ~memory->seen.neurons[s][w];
      if (!first) continue;
      memory->counts.rows[s] += (uint64_t)__builtin_popcountll(first);
      memory->seen.neurons[s][w] |= first;
    }
}

/* ---- the log ---- */

enum { LOG_ROOM = 1 << 14 };

sf_status fx_log_reserve(fx_log *log)
{
  if (log->count + FX_BLOCK <= log->room) return sf_ok();
  const size_t room = log->room ? 2 * log->room : LOG_ROOM;
  fx_logged *sample = realloc(log->sample, room * sizeof *sample);
  if (sample) log->sample = sample;
  uint32_t *order = sample ? realloc(log->order, room * sizeof *order) : NULL;
  if (!order) return sf_fail(SF_E_MEMORY, "no memory for the places of %zu samples", room);
  log->order = order, log->room = room;
  return sf_ok();
}

void fx_log_sample(fx_log *log, const fx_block *b, int i, int steps, uint32_t ray)
{
  fx_logged *to = &log->sample[log->count++];
  *to =
      (fx_logged){.ray = ray, .fired = fx_block_fired(b, i, steps), .pos = {b->pos[0][i], b->pos[1][i], b->pos[2][i]}};
}

sf_status fx_memory_replay(fx_memory *memory, const uint64_t *tile, const fx_pixel *pixels, size_t n)
{
  fx_log *log = &memory->log;
  uint32_t *next = malloc((n + 1) * sizeof *next);
  size_t at = 0;
  if (!next) return sf_fail(SF_E_MEMORY, "no memory for the samples of %zu rays", n);
  for (size_t i = 0, first = 0; i < n; first += pixels[i++].samples) next[i] = (uint32_t)first;
  for (size_t i = 0; i < log->count; i++) log->order[next[log->sample[i].ray]++] = (uint32_t)i;
  for (size_t i = 0; i < n; i++) {
    const uint64_t run = fx_memory_ray(memory, tile[i]);
    for (; at < next[i]; at++) {
      const fx_logged *sample = &log->sample[log->order[at]];
      fx_memory_read(memory, FX_READ_GRID, sample->pos);
      fx_memory_sample(memory, run, &sample->fired);
    }
  }
  free(next);
  log->count = 0;
  return sf_ok();
}
