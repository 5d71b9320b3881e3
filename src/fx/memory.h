/* What a list of rays asks of memory beyond fx_counts: the field's cache, and the rows of weights that groups of
 * samples share. Both depend on the list alone: rays of one tile follow one another, and where the tile changes the
 * cache is emptied and a new group begins. */
#ifndef SF_FX_MEMORY_H
#define SF_FX_MEMORY_H
#include "src/fx/cache.h"
#include "src/fx/kernels.h"

enum { FX_TILE = 16 /* pixels on a side */, FX_SHARED = 16 /* samples of a group */ };

typedef struct fx_memory_counts {
  uint64_t lookups, misses;  /* of the field's cache; a miss fills a line */
  uint64_t groups;           /* of FX_SHARED samples of a run of rays, in order; the last one may have fewer */
  uint64_t rows[FX_SPIKING]; /* of D2, C2, C3 that groups read: neurons that fired at any step of any of its samples */
} fx_memory_counts;
void fx_memory_counts_add(fx_memory_counts *sum, const fx_memory_counts *more);

/* Samples of many rays, as a wave takes them: those of a ray are in order. */
typedef struct fx_logged {
  uint32_t ray, pos[3];
  fx_fired fired;
} fx_logged;
typedef struct fx_log {
  fx_logged *sample;
  uint32_t *order; /* places in sample, ray by ray */
  size_t count, room;
} fx_log;

/* Of one thread. Zero counts as you like. */
typedef struct fx_memory {
  fx_memory_counts counts;
  fx_cache cache;
  fx_places places; /* of a hash grid */
  const fx_scene *scene;
  const fx_kernels *kernels; /* NULL: the portable ones */
  uint64_t tile;
  uint64_t run; /* runs of rays of one tile so far; 0: no ray yet */
  uint64_t sharing_run, in_group;
  fx_fired seen;
  fx_log log;                                           /* of a hash grid */
  void (*see)(void *user, const uint32_t *line, int n); /* NULL, or told of every look-up, position by position */
  void *user;
} fx_memory;

/* The scene must outlive it. shape: fx_cache_check. */
sf_status fx_memory_open(fx_memory *memory, const fx_scene *scene, const fx_cache_shape *shape);
void fx_memory_close(fx_memory *memory);

/* A list begins: its first ray empties the cache. */
void fx_memory_begin(fx_memory *memory);
/* The next ray of the list, with or without samples; rays of a tile of a view have the same number. Returns its run. */
uint64_t fx_memory_ray(fx_memory *memory, uint64_t tile);
/* The field is read at a position. */
void fx_memory_read(fx_memory *memory, fx_read what, const uint32_t pos[3]);
/* The next sample of the nets, of a ray of this run. */
void fx_memory_sample(fx_memory *memory, uint64_t run, const fx_fired *fired);

/* Room for one more block; SF_E_MEMORY. */
sf_status fx_log_reserve(fx_log *log);
/* Sample i of the block, of this ray, before its slot moves on. */
void fx_log_sample(fx_log *log, const fx_block *b, int i, int steps, uint32_t ray);
/* Reads and samples of rays[n] in order, from the log, which is empty afterwards; samples of ray i: pixels[i]. */
sf_status fx_memory_replay(fx_memory *memory, const uint64_t *tile, const fx_pixel *pixels, size_t n);

/* fx_render_rays with memory: what rays[n] of tile[n] ask for is added to memory->counts. They go on with the list that
 * fx_memory_begin began. */
sf_status fx_render_list(const fx_core *core, fx_memory *memory, const uint64_t *tile, const fx_ray *rays, size_t n,
                         fx_pixel *pixels, fx_cost *costs, fx_counts *counts);
/* The same, of a TensoRF scene alone: rays_tensorf.c. Without memory: fx_render_rays. */
sf_status fx_render_tensorf(const fx_core *core, fx_memory *memory, const uint64_t *tile, const fx_ray *rays, size_t n,
                            fx_pixel *pixels, fx_cost *costs, fx_counts *counts);
#endif
