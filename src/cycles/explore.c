#include "cycles/explore.h"
#include "cycles/places.h"
#include <stdlib.h>
#include <string.h>

const char *const sf_bound_names[SF_BOUNDS] = {"engine", "look-ups", "lines"};

enum { RAYS = 160000, MODELLED = 20000, PIXELS = FX_TILE * FX_TILE };
enum { CACHE_SIZES = 7, CACHE_WAYS = 4, SETS_MIN = 8, SETS = 10 /* 8 to 4096 */ };
_Static_assert(FX_CACHE_BYTES_MIN << (CACHE_SIZES - 1) == FX_CACHE_BYTES_MAX, "all sizes of a cache");
_Static_assert(FX_CACHE_BYTES_MIN == FX_WAYS_MAX * FX_LINE * SETS_MIN, "fewest sets");
_Static_assert(SETS_MIN << (SETS - 1) == FX_CACHE_BYTES_MAX / FX_LINE, "most sets");

static const int engine_macs[] = {SF_LANES / 4, SF_LANES / 2, SF_LANES}, engine_neurons[] = {4, 8, 16, 32},
                 engine_steps[] = {1, 2, 4};
static const sf_engine board = {SF_LANES / 2, SF_LANES / 16, 2}; /* docs/synthesis.md */
#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))
enum { ENGINES_MAX = 3 * 4 * 3 + 2 /* this build's, the board's */ };
_Static_assert(SF_EXPLORED_MAX >= CACHE_SIZES * CACHE_WAYS * ENGINES_MAX, "room for all points");

typedef struct run {
  const sf_explore_job *job;
  sf_explore *to;
  fx_core *core;
  int across, tiles, stride; /* tiles of the view: side by side, in all; each stride-th is recorded */
  int recorded;              /* tiles */
  fx_counts counts;
  fx_memory_counts memory;
  sf_places places[SETS];
  int engines;
  sf_engine engine[ENGINES_MAX];
  double engine_cycles[ENGINES_MAX]; /* per sample */
  sf_status failed;
  int done;
} run;

static void note(run *r, sf_status status)
{
#pragma omp critical(sf_explore_failure)
  if (status.code != SF_OK && r->failed.code == SF_OK) r->failed = status;
}

static void progress(run *r, const char *what, int total)
{
#pragma omp critical(sf_explore_failure)
  if (r->job->tick && r->failed.code == SF_OK && !r->job->tick(r->job->user, what, ++r->done, total))
    r->failed = sf_fail(SF_E_STOPPED, "stopped: %s %d of %d", what, r->done, total);
}

static bool goes_on(run *r)
{
  bool on;
#pragma omp critical(sf_explore_failure)
  on = r->failed.code == SF_OK;
  return on;
}

/* ---- one tile ---- */

/* The rays of recorded tile i; returns how many, or 0 after a failure. */
static int tile_rays(run *r, int i, fx_ray ray[PIXELS])
{
  const sf_view *view = r->job->view;
  const int tile = i * r->stride, left = tile % r->across * FX_TILE, top = tile / r->across * FX_TILE;
  int n = 0;
  for (int y = top; y < top + FX_TILE && y < view->camera.height; y++)
    for (int x = left; x < left + FX_TILE && x < view->camera.width; x++) {
      const sf_status status = sf_pixel_ray(r->job->scene, r->job->data, view, x, y, &ray[n++]);
      if (status.code == SF_OK) continue;
      note(r, status);
      return 0;
    }
  return n;
}

/* ---- counts, and look-ups of all caches ---- */

typedef struct worker {
  fx_memory memory;
  fx_counts counts;
  sf_places places[SETS];
  fx_ray ray[PIXELS];
  uint64_t tile[PIXELS]; /* all 0 */
  fx_pixel pixel[PIXELS];
  uint64_t rays;
} worker;

static void see_lines(void *user, const uint32_t *line, int n)
{
  worker *w = user;
  for (int i = 0; i < SETS; i++) sf_places_look_up(&w->places[i], line, n);
}

static sf_status open_worker(worker **worker_, const run *r)
{
  worker *w = *worker_ = calloc(1, sizeof *w);
  if (!w) return sf_fail(SF_E_MEMORY, "no memory for a tile");
  for (int i = 0; i < SETS; i++) SF_TRY(sf_places_open(&w->places[i], (uint32_t)SETS_MIN << i));
  SF_TRY(fx_memory_open(&w->memory, r->job->scene, &sf_cache_built));
  w->memory.see = see_lines, w->memory.user = w;
  return sf_ok();
}

static void close_worker(worker *w, run *r)
{
  if (!w) return;
#pragma omp critical(sf_explore_merge)
  {
    fx_counts_add(&r->counts, &w->counts);
    fx_memory_counts_add(&r->memory, &w->memory.counts);
    r->to->rays += w->rays;
    for (int i = 0; i < SETS; i++) {
      r->places[i].asked += w->places[i].asked;
      for (int at = 0; at < FX_WAYS_MAX; at++) r->places[i].hits[at] += w->places[i].hits[at];
    }
  }
  fx_memory_close(&w->memory);
  for (int i = 0; i < SETS; i++) sf_places_close(&w->places[i]);
  free(w);
}

static void count_tile(run *r, worker *w, int i)
{
  const int n = tile_rays(r, i, w->ray);
  if (n == 0) return;
  for (int s = 0; s < SETS; s++) sf_places_empty(&w->places[s]);
  fx_memory_begin(&w->memory);
  note(r, fx_render_list(r->core, &w->memory, w->tile, w->ray, (size_t)n, w->pixel, NULL, &w->counts));
  w->rays += (uint64_t)n;
}

static sf_status count_tiles(run *r)
{
  r->done = 0;
#pragma omp parallel
  {
    worker *w;
    const sf_status opened = open_worker(&w, r);
    note(r, opened);
#pragma omp for schedule(dynamic)
    for (int i = 0; i < r->recorded; i++)
      if (opened.code == SF_OK && goes_on(r)) count_tile(r, w, i), progress(r, "tiles", r->recorded);
    close_worker(w, r);
  }
  for (int i = 0; i < SETS; i++) r->places[i].sets = (uint32_t)SETS_MIN << i;
  return r->failed;
}

static uint64_t misses_of(const run *r, const fx_cache_shape *cache)
{
  const uint32_t sets = (uint32_t)(cache->bytes / (FX_LINE * cache->ways));
  int i = 0;
  while (r->places[i].sets != sets) i++;
  return sf_places_misses(&r->places[i], cache->ways);
}

/* ---- the cycle model ---- */

/* Each `apart`-th ray of a tile; the first one shifts from tile to tile, so that they form no columns. */
static void record_tile(run *r, int i, int apart, sf_cycle_record *record)
{
  fx_ray *ray = malloc(PIXELS * sizeof *ray);
  if (!ray) note(r, sf_fail(SF_E_MEMORY, "no memory for a tile"));
  const int n = ray ? tile_rays(r, i, ray) : 0;
  for (int k = i * 7 % apart; k < n && goes_on(r); k += apart)
    note(r, sf_cycle_record_ray(record, r->job->scene, &ray[k]));
  free(ray);
}

static void model_engine(run *r, int e, const sf_cycle_record *record, int records)
{
  sf_cycle_model *model = sf_cycle_model_create(&r->job->scene->net, &r->engine[e]);
  if (!model) {
    note(r, sf_fail(SF_E_MEMORY, "no memory for the cycle model"));
    return;
  }
  for (int i = 0; i < records; i++)
    for (size_t s = 0; s < record[i].count; s++) sf_cycle_model_add(model, &record[i].at[s]);
  sf_cycle_model_drain(model);
  const sf_cycle_totals *t = sf_cycle_model_totals(model);
  r->engine_cycles[e] = t->samples ? (double)t->cycles / (double)t->samples : 0;
  sf_cycle_model_free(model);
}

/* Of the recorded rays so many that about `limit` samples are on them. */
static sf_status model_engines(run *r)
{
  const uint64_t limit = r->job->model_limit ? r->job->model_limit : MODELLED;
  const int apart = (int)(r->counts.samples / limit) + 1, records = r->recorded;
  sf_cycle_record *record = calloc((size_t)records + 1, sizeof *record);
  if (!record) return sf_fail(SF_E_MEMORY, "no memory for the samples of %d tiles", records);
#pragma omp parallel for schedule(dynamic)
  for (int i = 0; i < records; i++)
    if (goes_on(r)) record_tile(r, i, apart, &record[i]);
  for (int i = 0; i < records; i++) r->to->modelled += record[i].count;
  r->done = 0;
#pragma omp parallel for schedule(dynamic)
  for (int e = 0; e < r->engines; e++)
    if (goes_on(r)) model_engine(r, e, record, records), progress(r, "engines", r->engines);
  for (int i = 0; i < records; i++) sf_cycle_record_free(&record[i]);
  free(record);
  return r->failed;
}

/* ---- points ---- */

static sf_status price_cache(const run *r, const fx_cache_shape *cache, double *energy_mj)
{
  fx_memory_counts memory = r->memory;
  memory.misses = misses_of(r, cache);
  const sf_traffic traffic = sf_traffic_of(r->job->scene, &r->counts, &memory, r->to->rays);
  const sf_counted counted = {r->job->scene, &r->counts, &memory, &traffic, *cache};
  sf_ledgers *ledgers = malloc(sizeof *ledgers);
  if (!ledgers) return sf_fail(SF_E_MEMORY, "no memory for the ledgers");
  const sf_status status = sf_ledgers_make(r->job->technology, &counted, ledgers);
  *energy_mj = (double)ledgers->total[SF_LEDGER_NEURON] * 1e-12 / r->to->share;
  free(ledgers);
  return status;
}

static void add_point(run *r, int e, const fx_cache_shape *cache, double energy_mj)
{
  const fx_scene *scene = r->job->scene;
  const double samples = (double)r->counts.samples / r->to->share, misses = (double)misses_of(r, cache);
  sf_explored *p = &r->to->point[r->to->count++];
  *p = (sf_explored){.build = {r->engine[e], *cache}, .energy_mj = energy_mj};
  p->misses = r->memory.lookups ? misses / (double)r->memory.lookups : 0;
  p->bound[SF_BOUND_ENGINE] = samples * r->engine_cycles[e];
  p->bound[SF_BOUND_LOOKUPS] = scene->backbone == FX_INGP ? samples * scene->grid.levels * FX_LEVEL_PAIRS
                                                          : (double)r->memory.lookups / r->to->share;
  p->bound[SF_BOUND_LINES] = misses / r->to->share * FX_LINE / 8;
  for (int b = 0; b < SF_BOUNDS; b++) p->cycles = p->bound[b] > p->cycles ? p->bound[b] : p->cycles;
}

/* By time, then energy, then hardware. */
static int better(const void *a, const void *b)
{
  const sf_explored *x = a, *y = b;
  if (x->cycles != y->cycles) return x->cycles < y->cycles ? -1 : 1;
  if (x->energy_mj != y->energy_mj) return x->energy_mj < y->energy_mj ? -1 : 1;
  const int size[][2] = {{x->build.engine.macs, y->build.engine.macs},
                         {x->build.engine.neurons, y->build.engine.neurons},
                         {x->build.engine.steps_at_once, y->build.engine.steps_at_once},
                         {x->build.cache.bytes, y->build.cache.bytes},
                         {x->build.cache.ways, y->build.cache.ways}};
  for (int i = 0; i < COUNT(size); i++)
    if (size[i][0] != size[i][1]) return size[i][0] - size[i][1];
  return 0;
}

static bool same_engine(const sf_engine *a, const sf_engine *b)
{
  return a->macs == b->macs && a->neurons == b->neurons && a->steps_at_once == b->steps_at_once;
}

static bool is_built(const sf_build *a, const sf_engine *engine)
{
  return same_engine(&a->engine, engine) && a->cache.bytes == sf_cache_built.bytes &&
         a->cache.ways == sf_cache_built.ways;
}

static void mark(const run *r)
{
  sf_explore *to = r->to;
  double least = 0;
  qsort(to->point, (size_t)to->count, sizeof *to->point, better);
  for (int i = 0; i < to->count; i++) {
    sf_explored *p = &to->point[i];
    p->front = i == 0 || p->energy_mj < least;
    if (p->front) least = p->energy_mj;
    if (is_built(&p->build, &sf_engine_default)) to->built = i;
    if (is_built(&p->build, &board)) to->board = i;
  }
}

static sf_status make_points(run *r)
{
  for (int size = 0; size < CACHE_SIZES; size++)
    for (int ways = 0; ways < CACHE_WAYS; ways++) {
      const fx_cache_shape cache = {FX_CACHE_BYTES_MIN << size, 1 << ways};
      double energy_mj = 0;
      SF_TRY(price_cache(r, &cache, &energy_mj));
      for (int e = 0; e < r->engines; e++) add_point(r, e, &cache, energy_mj);
    }
  mark(r);
  return sf_ok();
}

/* ---- all of it ---- */

static void add_engine(run *r, const sf_engine *engine)
{
  for (int e = 0; e < r->engines; e++)
    if (same_engine(&r->engine[e], engine)) return;
  r->engine[r->engines++] = *engine;
}

static void list_engines(run *r)
{
  for (int m = 0; m < COUNT(engine_macs); m++)
    for (int n = 0; n < COUNT(engine_neurons); n++)
      for (int s = 0; s < COUNT(engine_steps); s++)
        add_engine(r, &(sf_engine){engine_macs[m], engine_neurons[n], engine_steps[s]});
  add_engine(r, &sf_engine_default);
  add_engine(r, &board);
}

static sf_status explore(run *r)
{
  const sf_camera *camera = &r->job->view->camera;
  const uint64_t pixels = (uint64_t)camera->width * (uint64_t)camera->height;
  const uint64_t limit = r->job->ray_limit ? r->job->ray_limit : RAYS;
  r->across = (camera->width + FX_TILE - 1) / FX_TILE;
  r->tiles = r->across * ((camera->height + FX_TILE - 1) / FX_TILE);
  r->stride = (int)((pixels + limit - 1) / limit);
  if (r->stride > 1 && r->across % r->stride == 0) r->stride++; /* no columns */
  r->recorded = (r->tiles + r->stride - 1) / r->stride;
  list_engines(r);
  SF_TRY(count_tiles(r));
  r->to->share = (double)r->to->rays / (double)pixels, r->to->samples = r->counts.samples;
  if (misses_of(r, &sf_cache_built) != r->memory.misses)
    return sf_fail(SF_E_DIFFERENCE, "explore: %llu misses, the core counts %llu",
                   (unsigned long long)misses_of(r, &sf_cache_built), (unsigned long long)r->memory.misses);
  SF_TRY(model_engines(r));
  return make_points(r);
}

sf_status sf_explore_run(const sf_explore_job *job, sf_explore **explore_)
{
  run *r = calloc(1, sizeof *r);
  *explore_ = calloc(1, sizeof **explore_);
  if (!r || !*explore_) {
    free(r);
    return sf_fail(SF_E_MEMORY, "no memory for the builds");
  }
  r->job = job, r->to = *explore_, r->failed = sf_ok();
  sf_status status = fx_core_open(&r->core, job->scene, NULL);
  if (status.code == SF_OK) status = explore(r);
  fx_core_close(r->core);
  free(r);
  return status;
}
