/* The field's cache: set-associative, lines of FX_LINE bytes of the field's memory, true LRU. Its counts depend on the
 * lines that are asked for and their order, never on time.
 *
 * Order of the look-ups: rays in the order of the list, samples in the order of the ray.
 *   hash grid  level by level; per level the pairs of corners x, x + 1 in the order (y, z), (y + 1, z), (y, z + 1),
 *              (y + 1, z + 1). A pair in one line is one look-up, else two: first x's line. The line of an entry is
 *              (its place in the table of all levels) / FX_LINE_ENTRIES.
 *   TensoRF    pair by pair: points (u, v), (u + 1, v), (u, v + 1), (u + 1, v + 1) of the plane, then both of the line.
 *              A line holds components of one point: a point of n has ceil(n / FX_LINE), one look-up each. Of two
 * points beside each other (along u or w) first line comes before second, of both. A point that has no weight (the
 *              position is on its neighbour) is not asked for. Before the appearance of a sample
 * come the densities of the FX_AHEAD samples of its ray behind it, or as many as there are: also of those behind the
 * sample where the ray ends. So a weight has time to follow from its density. */
#ifndef SF_FX_CACHE_H
#define SF_FX_CACHE_H
#include "fx/fx.h"

enum { FX_AHEAD = 5 };
enum { FX_LINE = 16, FX_LINE_ENTRIES = FX_LINE / FX_GRID_FEATURES, FX_WAYS_MAX = 8 };
enum { FX_CACHE_BYTES_MIN = 1024, FX_CACHE_BYTES_MAX = 65536 };
/* Look-ups of one position at most, and room for whole vectors behind them. */
enum { FX_LOOKUPS_MAX = FX_LEVELS_MAX * 8, FX_LOOKUPS_ROOM = FX_LOOKUPS_MAX + 16 };

/* bytes: a power of two, FX_CACHE_BYTES_MIN..MAX; ways: 1, 2, 4 or 8. */
typedef struct fx_cache_shape {
  int32_t bytes, ways;
} fx_cache_shape;
sf_status fx_cache_check(const fx_cache_shape *shape);

/* Each set is a list of FX_WAYS_MAX lines, or half of that, the last one used first. A line is a hit where it is found
 * among the first `ways`: LRU keeps those whatever lies behind them. */
typedef struct fx_cache {
  fx_cache_shape shape;
  uint32_t sets;  /* a power of two */
  int32_t depth;  /* of the lists: 4 or 8 */
  uint32_t *line; /* [sets][depth] */
} fx_cache;
sf_status fx_cache_open(fx_cache *cache, const fx_cache_shape *shape);
void fx_cache_close(fx_cache *cache);
void fx_cache_empty(fx_cache *cache);
/* Looks up line[0..n-1], one after the other; returns the misses. */
uint64_t fx_cache_look_up(fx_cache *cache, const uint32_t *line, int n);

/* The lines of one position, in order of their look-ups; returns how many. */
int fx_grid_lines(const fx_grid *grid, const uint32_t pos[3], uint32_t line[FX_LOOKUPS_ROOM]);
int fx_tensorf_lines(const fx_tensorf *field, bool appearance, const uint32_t pos[3], uint32_t line[FX_LOOKUPS_ROOM]);

/* TensoRF's planes and lines in the memory: the first line of each array, and how many a point has, 1..4. The pairs of
 * the density, then of the appearance. Returns the number of lines of all. */
typedef struct fx_factor_place {
  uint32_t plane, line, point_lines;
} fx_factor_place;
uint32_t fx_tensorf_places(const fx_tensorf *field, fx_factor_place place[2 * FX_PAIRS]);
void fx_tensorf_memory(const fx_tensorf *field, uint8_t *memory); /* FX_LINE bytes for each of these lines */

/* What the vector kernels make lines of: an entry is (x ^ y * my ^ z * mz) & mask of a hashed level, x + y * my + z *
 * mz of a dense one, + offset. By level, then by pair of a level, which adds my or 0, mz or 0. Beyond the levels 0. */
enum { FX_LEVEL_PAIRS = 4, FX_PAIRS_MAX = FX_LEVELS_MAX * FX_LEVEL_PAIRS };
typedef struct fx_places {
  const fx_grid *grid;
  int32_t scale[FX_LEVELS_MAX], my[FX_LEVELS_MAX], mz[FX_LEVELS_MAX];
  int32_t add_y[FX_PAIRS_MAX], add_z[FX_PAIRS_MAX], mask[FX_PAIRS_MAX], offset[FX_PAIRS_MAX];
  int32_t hashed[FX_PAIRS_MAX]; /* -1 or 0 */
} fx_places;
void fx_places_fill(fx_places *places, const fx_grid *grid);
#endif
