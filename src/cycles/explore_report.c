/* What was explored, as text and JSON. */
#include "cycles/explore.h"
#include <inttypes.h>
#include <limits.h>

static double milliseconds(const sf_explored *p, double clock_mhz)
{
  return p->cycles / clock_mhz / 1e3;
}

static sf_bound bound_of(const sf_explored *p)
{
  int most = 0;
  for (int b = 1; b < SF_BOUNDS; b++)
    if (p->bound[b] > p->bound[most]) most = b;
  return (sf_bound)most;
}

static void print_point(FILE *out, const sf_explored *p, double clock_mhz, const char *mark)
{
  const sf_build *b = &p->build;
  fprintf(out, "  %4d %7d %5d %7d %4d %12.3f  %-8s %12.5g %8.4f  %s\n", b->engine.macs, b->engine.neurons,
          b->engine.steps_at_once, b->cache.bytes, b->cache.ways, milliseconds(p, clock_mhz),
          sf_bound_names[bound_of(p)], p->energy_mj, p->misses, mark);
}

static bool has_cache(const sf_explored *p, const sf_explored *of)
{
  return p->build.cache.bytes == of->build.cache.bytes && p->build.cache.ways == of->build.cache.ways;
}

static bool has_engine(const sf_explored *p, const sf_explored *of)
{
  return p->build.engine.macs == of->build.engine.macs && p->build.engine.neurons == of->build.engine.neurons &&
         p->build.engine.steps_at_once == of->build.engine.steps_at_once;
}

/* Multipliers of D1, C1 and of the neurons. */
static int multipliers(const sf_explored *p)
{
  return p->build.engine.macs + 2 * p->build.engine.neurons;
}

/* In order of time: what came before is faster. */
static void print_engines(FILE *out, const sf_explore *e, double clock_mhz)
{
  int fewest = INT_MAX;
  fprintf(out, "engines with this build's cache that none of as few multipliers outruns:\n");
  for (int i = 0; i < e->count; i++) {
    const sf_explored *p = &e->point[i];
    if (!has_cache(p, &e->point[e->built]) || multipliers(p) >= fewest) continue;
    fewest = multipliers(p);
    print_point(out, p, clock_mhz, i == e->built ? "this build" : i == e->board ? "the board's" : "");
  }
}

static void print_caches(FILE *out, const sf_explore *e, double clock_mhz)
{
  fprintf(out, "caches with this build's engine, of each size the ways that need the least energy:\n");
  for (int bytes = FX_CACHE_BYTES_MIN; bytes <= FX_CACHE_BYTES_MAX; bytes *= 2) {
    int best = -1;
    for (int i = 0; i < e->count; i++) {
      const sf_explored *p = &e->point[i];
      if (!has_engine(p, &e->point[e->built]) || p->build.cache.bytes != bytes) continue;
      if (best < 0 || p->energy_mj < e->point[best].energy_mj) best = i;
    }
    if (best >= 0) print_point(out, &e->point[best], clock_mhz, best == e->built ? "this build" : "");
  }
}

void sf_explore_print(FILE *out, const sf_explore *e, double clock_mhz)
{
  fprintf(out,
          "%d builds from one run: %" PRIu64 " rays (%.1f %% of the frame), %" PRIu64 " samples, %" PRIu64
          " of them through the cycle model\n",
          e->count, e->rays, 100 * e->share, e->samples, e->modelled);
  fprintf(out, "  %4s %7s %5s %7s %4s %12s  %-8s %12s %8s\n", "MACs", "neurons", "steps", "cache", "ways",
          "ms per frame", "bound by", "mJ per frame", "misses");
  for (int i = 0; i < e->count; i++)
    if (e->point[i].front)
      print_point(out, &e->point[i], clock_mhz,
                  i == e->built   ? "Pareto front, this build"
                  : i == e->board ? "Pareto front, the board's"
                                  : "Pareto front");
  if (!e->point[e->built].front) print_point(out, &e->point[e->built], clock_mhz, "this build");
  if (!e->point[e->board].front && e->board != e->built)
    print_point(out, &e->point[e->board], clock_mhz, "the board's");
  print_engines(out, e, clock_mhz);
  print_caches(out, e, clock_mhz);
  fprintf(
      out,
      "at %.0f MHz; misses per look-up. Engine, look-ups (a pair a cycle) and lines (2 cycles each) overlap, memory "
      "has no\nlatency. Energy: everything that is counted. It depends on the cache, not on the engine, so the front "
      "has few builds.\n",
      clock_mhz);
}

cJSON *sf_explore_json(const sf_explore *e, double clock_mhz)
{
  cJSON *json = cJSON_CreateObject();
  sf_json_add_u64(json, "rays", e->rays);
  sf_json_add_u64(json, "samples", e->samples);
  sf_json_add_u64(json, "modelled_samples", e->modelled);
  cJSON_AddNumberToObject(json, "share", e->share);
  cJSON_AddNumberToObject(json, "clock_mhz", clock_mhz);
  cJSON *list = cJSON_AddArrayToObject(json, "builds");
  for (int i = 0; i < e->count; i++) {
    const sf_explored *p = &e->point[i];
    cJSON *point = cJSON_CreateObject();
    cJSON_AddNumberToObject(point, "macs", p->build.engine.macs);
    cJSON_AddNumberToObject(point, "neurons", p->build.engine.neurons);
    cJSON_AddNumberToObject(point, "steps_at_once", p->build.engine.steps_at_once);
    cJSON_AddNumberToObject(point, "multipliers", multipliers(p));
    cJSON_AddNumberToObject(point, "cache_bytes", p->build.cache.bytes);
    cJSON_AddNumberToObject(point, "cache_ways", p->build.cache.ways);
    cJSON_AddNumberToObject(point, "cycles", p->cycles);
    cJSON_AddStringToObject(point, "bound_by", sf_bound_names[bound_of(p)]);
    cJSON_AddNumberToObject(point, "ms_per_frame", milliseconds(p, clock_mhz));
    cJSON_AddNumberToObject(point, "mj_per_frame", p->energy_mj);
    cJSON_AddNumberToObject(point, "misses_per_lookup", p->misses);
    cJSON_AddBoolToObject(point, "front", p->front);
    cJSON_AddBoolToObject(point, "this_build", i == e->built);
    cJSON_AddBoolToObject(point, "board", i == e->board);
    cJSON_AddItemToArray(list, point);
  }
  return json;
}
