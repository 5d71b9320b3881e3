/* Deals out numbered units, and hands their results over in order. */
#include "ranks/internal.h"
#include "base/clock.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* AHEAD: units per worker that may be finished before their turn; then it waits. */
enum { TICK_MS = 100, AHEAD = 4 };

typedef struct worker {
  bool busy;
  uint64_t unit;
} worker;

typedef struct desk {
  sf_ranks *ranks;
  const sf_deal *deal;
  sf_crew *crew;
  worker *worker;
  uint64_t begun, taken; /* next unit to begin, to take */
  uint64_t window;
  char *result; /* [window][result_size], unit u at u % window */
  bool *ready;  /* [window] */
  bool enough, stopping;
  double since; /* stopping */
} desk;

static sf_status give(desk *d, int who)
{
  worker *w = &d->worker[who];
  if (w->busy || d->enough || d->stopping || d->begun >= d->deal->end || d->begun >= d->taken + d->window)
    return sf_ok();
  w->busy = true;
  w->unit = d->begun++;
  return d->crew->give(d->crew, who, w->unit);
}

static bool take(desk *d, uint64_t unit)
{
  return d->deal->take(d->deal->user, unit, d->result + unit % d->window * d->deal->result_size);
}

static sf_status receive(desk *d, int who)
{
  worker *w = &d->worker[who];
  const uint64_t slot = w->unit % d->window;
  SF_TRY(d->crew->read(d->crew, who, d->result + slot * d->deal->result_size));
  w->busy = false;
  d->ready[slot] = true;
  if (d->deal->any_order && !d->enough) d->enough = !take(d, w->unit);
  return sf_ok();
}

static void take_in_order(desk *d)
{
  for (; !d->enough && d->taken < d->begun && d->ready[d->taken % d->window]; d->taken++) {
    d->ready[d->taken % d->window] = false;
    if (!d->deal->any_order) d->enough = !take(d, d->taken);
  }
}

static void ask_to_stop(desk *d)
{
  if (d->stopping || !d->ranks->options.interrupted()) return;
  d->stopping = true;
  d->since = sf_seconds();
  d->crew->stop(d->crew);
}

/* A worker that was told to end and is not heard of is lost, whatever has become of it. */
static sf_status lose_patience(desk *d)
{
  char name[128];
  if (!d->stopping || !d->crew->patience || sf_seconds() - d->since < d->crew->patience) return sf_ok();
  for (int i = 0; i < d->crew->count; i++) {
    if (!d->worker[i].busy || d->worker[i].unit != d->taken) continue;
    d->ranks->broken = true;
    d->crew->name(d->crew, i, name, sizeof name);
    return sf_fail(SF_E_STOPPED, "stopped; nothing came from %s in time", name);
  }
  return sf_ok();
}

static sf_status turn(desk *d)
{
  ask_to_stop(d);
  for (int i = 0; i < d->crew->count; i++) SF_TRY(give(d, i));
  for (int who, ms = TICK_MS; (who = d->crew->wait(d->crew, ms)) >= 0; ms = 0) SF_TRY(receive(d, who));
  take_in_order(d);
  if (d->deal->tick) d->deal->tick(d->deal->user);
  return lose_patience(d);
}

static bool finished(const desk *d)
{
  return d->enough || (d->taken == d->begun && (d->stopping || d->begun >= d->deal->end));
}

static sf_status run(desk *d)
{
  while (!finished(d)) SF_TRY(turn(d));
  return d->stopping && !d->enough ? sf_fail(SF_E_STOPPED, "stopped") : sf_ok();
}

static sf_status run_crew(sf_ranks *r, const sf_deal *deal, sf_crew *crew)
{
  desk d = {.ranks = r,
            .deal = deal,
            .crew = crew,
            .begun = deal->first,
            .taken = deal->first,
            .window = (uint64_t)crew->count * AHEAD};
  d.worker = calloc((size_t)crew->count, sizeof *d.worker);
  d.result = calloc(d.window, deal->result_size);
  d.ready = calloc(d.window, sizeof *d.ready);
  sf_status status = d.worker && d.result && d.ready
                         ? run(&d)
                         : sf_fail(SF_E_MEMORY, "no memory for the results of %d workers", crew->count);
  status = crew->end(crew, &status);
  free(d.worker), free(d.result), free(d.ready);
  return status;
}

static sf_status run_here(sf_ranks *r, const sf_deal *deal)
{
  void *result = malloc(deal->result_size);
  if (!result) return sf_fail(SF_E_MEMORY, "no memory for a result");
  bool more = true;
  for (uint64_t unit = deal->first; unit < deal->end && more && !sf_ranks_stop(r); unit++) {
    memset(result, 0, deal->result_size);
    deal->work(deal->user, unit, result);
    more = deal->take(deal->user, unit, result);
  }
  free(result);
  return more && sf_ranks_stop(r) ? sf_fail(SF_E_STOPPED, "stopped") : sf_ok();
}

sf_status sf_ranks_deal(sf_ranks *r, const sf_deal *deal)
{
  sf_crew *crew;
  const bool alone = sf_ranks_size(r) == 1;
  if (sf_ranks_rank(r)) return sf_ranks_serve(r, deal);
  if (alone && (!r || !r->options.processes || deal->first >= deal->end)) return run_here(r, deal);
  SF_TRY(r->size > 1 ? sf_crew_ranks(&crew, deal, r) : sf_crew_fork(&crew, deal, r->options.processes));
  return run_crew(r, deal, crew);
}
