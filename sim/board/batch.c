#include "sim/board/batch.h"
#include "sim/compare.h"
#include <stdlib.h>
#include <string.h>

sf_status sf_batch_open(sf_batch *b, sf_board *board)
{
  *b = (sf_batch){.board = board, .core = {.net = &board->scene->net}};
  const fx_cache_shape cache = sf_board_cache(board);
  SF_TRY(board->trouble);
  SF_TRY(fx_memory_open(&b->memory, board->scene, &cache));
  SF_TRY(sf_memory_recount_open(&b->lines, board->scene, &cache));
  b->core.memory = &b->memory, b->core.lines = &b->lines;
  b->ray = calloc(SF_BATCH_RAYS, sizeof *b->ray);
  return b->ray ? sf_ok() : sf_fail(SF_E_MEMORY, "rays for the board: out of memory");
}

void sf_batch_close(sf_batch *b)
{
  fx_memory_close(&b->memory), sf_memory_recount_close(&b->lines);
  free(b->ray), free(b->sample);
}

void sf_batch_begin(sf_batch *b)
{
  b->count = 0, b->samples = 0;
  b->before = b->memory.counts;
}

/* ---- the core's side ---- */

static sf_status reserve(sf_batch *b)
{
  if (b->room - b->samples >= SF_RAY_SAMPLES_MAX) return sf_ok();
  const size_t room = 2 * b->room + SF_RAY_SAMPLES_MAX;
  sf_ray_sample *more = realloc(b->sample, room * sizeof *more);
  if (!more) return sf_fail(SF_E_MEMORY, "samples for the board: out of memory");
  b->sample = more, b->room = room;
  return sf_ok();
}

sf_status sf_batch_add(sf_batch *b, const fx_ray *ray, uint64_t tile)
{
  sf_batch_ray *r = &b->ray[b->count];
  SF_TRY(reserve(b));
  *r = (sf_batch_ray){.ray = *ray, .first = b->samples, .new_tile = !b->in_tile || tile != b->tile};
  b->in_tile = true, b->tile = tile;
  SF_TRY(sf_observer_ray(&b->core, b->board->scene, ray, tile, sf_observer_net, &b->core, &r->core));
  const sf_ray_request request = sf_ray_request_as(b->board->scene, ray, &r->core, b->sample + r->first);
  r->n = request.n, r->stops = request.stops;
  r->counts = b->core.core, r->field = b->memory.counts;
  b->samples += (size_t)r->n;
  b->count++;
  return sf_ok();
}

static sf_ray_request request_of(const sf_batch *b, const sf_batch_ray *r)
{
  return (sf_ray_request){&r->ray, b->sample + r->first, r->n, r->stops, r->new_tile};
}

/* The field's counts between two readings of the core's. */
static sf_status compare_field(const fx_memory_counts *from, const fx_memory_counts *to, const sf_field_counters *board)
{
  const fx_memory_counts part = {.lookups = to->lookups - from->lookups, .misses = to->misses - from->misses};
  return sf_compare_field(&part, board);
}

/* ---- where a difference is ---- */

static sf_status compare_counts(sf_batch *b, const fx_counts *core, const sf_board_counters *board)
{
  fx_counts expected = *core;
  /* A decoder's rays have no directions, and the hardware counts none. */
  if (fx_net_constants_per_sample(b->core.net)) expected.rays = board->counts.rays;
  if (sf_compare_counts(&expected, &board->counts, board->cycles, &b->place.what)) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "counter %s differs from the fixed-point core", b->place.what.wire);
}

static sf_status alone(sf_batch *b, const sf_ray_request *request, const fx_pixel *core, const fx_counts *counts,
                       sf_board_counters *board)
{
  fx_pixel pixel;
  SF_TRY(sf_board_clear(b->board));
  SF_TRY(sf_board_run(b->board, request, 1, &pixel));
  SF_TRY(sf_board_read(b->board, board));
  SF_TRY(sf_compare_pixel(core, &pixel, board->cycles));
  return compare_counts(b, counts, board);
}

/* The first k samples as a ray of their own. The core ends there by its limit, the board by the mark of the last
 * sample. */
static sf_status first_samples(sf_batch *b, const sf_batch_ray *r, int k)
{
  fx_scene limited = *b->board->scene;
  fx_pixel pixel;
  sf_board_counters board;
  sf_observer core = {.net = b->core.net};
  limited.max_samples = k;
  SF_TRY(sf_observer_ray(&core, &limited, &r->ray, 0, sf_observer_net, &core, &pixel));
  const sf_ray_request request = {&r->ray, b->sample + r->first, k, false, true};
  return alone(b, &request, &pixel, &core.core, &board);
}

static sf_status locate_sample(sf_batch *b, const sf_batch_ray *r)
{
  const bool counts_all = b->board->scene->backbone == FX_INGP; /* else samples that are not decoded lie between */
  for (int k = 1; k <= r->n && counts_all; k++) {
    const sf_status status = first_samples(b, r, k);
    if (status.code == SF_OK) continue;
    b->place.sample = (uint64_t)k - 1, b->place.exact = true;
    return status;
  }
  return sf_ok();
}

static sf_status locate(sf_batch *b, sf_status found)
{
  static const sf_difference none = {-1, -1, -1, NULL, 0, 0, 0};
  const sf_difference first = b->place.what;
  fx_memory_counts before = b->before;
  SF_TRY(sf_board_load(b->board));
  for (int i = 0; i < b->count; i++) {
    const sf_batch_ray *r = &b->ray[i];
    const sf_ray_request request = request_of(b, r);
    sf_board_counters board;
    b->place.what = none;
    sf_status status = alone(b, &request, &r->core, &r->counts, &board);
    if (status.code == SF_OK) status = compare_field(&before, &r->field, &board.field);
    before = r->field;
    if (status.code == SF_OK) continue;
    b->place.ray = (uint64_t)i;
    if (status.code != SF_E_DIFFERENCE) return status;
    const sf_difference of_ray = b->place.what;
    const sf_status closer = sf_board_load(b->board).code == SF_OK ? locate_sample(b, r) : sf_ok();
    if (closer.code == SF_E_DIFFERENCE) return closer;
    b->place.what = of_ray;
    return status;
  }
  b->place.what = first; /* it does not come back ray by ray: somewhere in the batch */
  return found;
}

static sf_status differs(sf_batch *b, sf_status found)
{
  if (found.code != SF_E_DIFFERENCE) return found;
  b->place.found = true;
  return locate(b, found);
}

/* ---- all of them ---- */

static sf_status compare_batch(sf_batch *b)
{
  fx_counts core = {0};
  for (int i = 0; i < b->count; i++) {
    b->place.ray = (uint64_t)i;
    SF_TRY(sf_compare_pixel(&b->ray[i].core, &b->ray[i].board, b->sum.cycles));
    fx_counts_add(&core, &b->ray[i].counts);
  }
  b->place.ray = 0;
  SF_TRY(compare_counts(b, &core, &b->sum));
  return compare_field(&b->before, &b->memory.counts, &b->sum.field);
}

static sf_status run_batch(sf_batch *b)
{
  sf_ray_request request[SF_BATCH_RAYS];
  fx_pixel pixel[SF_BATCH_RAYS];
  for (int i = 0; i < b->count; i++) request[i] = request_of(b, &b->ray[i]);
  SF_TRY(sf_board_clear(b->board));
  SF_TRY(sf_board_run(b->board, request, b->count, pixel));
  SF_TRY(sf_board_read(b->board, &b->sum));
  for (int i = 0; i < b->count; i++) b->ray[i].board = pixel[i];
  return compare_batch(b);
}

sf_status sf_batch_run(sf_batch *b)
{
  b->place = (sf_cosim_place){.what = {-1, -1, -1, NULL, 0, 0, 0}};
  const sf_status status = b->count ? run_batch(b) : sf_ok();
  return status.code == SF_OK ? status : differs(b, status);
}
