#include "sim/board/lockstep.h"
#include "sim/board/batch.h"
#include "cli/cli.h"
#include "energy/energy.h"
#include <inttypes.h>
#include <stdlib.h>

enum { RAYS = 64 /* compared at once */ };

/* Counts of one batch. The sums have what was compared and equal. */
static void add_batch(sf_lockstep *l, const sf_batch *b)
{
  for (int i = 0; i < b->count; i++) fx_counts_add(&l->sum.core, &b->ray[i].counts);
  fx_counts_add(&l->sum.rtl, &b->sum.counts);
  l->sum.samples += b->sum.counts.samples;
  for (int layer = 0; layer < SF_LAYERS; layer++) {
    for (int t = 0; t < SF_T_MAX; t++) l->sum.spikes += b->sum.counts.layer[layer].spikes[t];
    l->sum.layer_busy[layer] += b->sum.layer_busy[layer];
  }
  l->sum.cycles += b->sum.cycles, l->sum.busy += b->sum.busy, l->sum.stalls += b->sum.stalls;
  l->rays += (uint64_t)b->count;
}

static sf_status next_batch(sf_lockstep *l, sf_batch *b)
{
  const uint64_t all = (uint64_t)l->options.rays, from = l->rays;
  sf_batch_begin(b);
  for (uint64_t ray = from; ray < all && b->count < RAYS; ray++) {
    const sf_lockstep_pixel p = sf_lockstep_pick(l, ray);
    fx_ray at;
    SF_TRY(sf_pixel_ray(&l->fx, &l->data, &l->data.view[p.view], p.x, p.y, &at));
    SF_TRY(sf_batch_add(b, &at, ray)); /* every ray a tile of its own */
  }
  sf_status status = sf_batch_run(b);
  if (status.code != SF_OK) {
    l->place = b->place;
    l->place.ray += from;
    return status;
  }
  add_batch(l, b);
  return status;
}

static sf_status run(sf_lockstep *l, sf_batch *b)
{
  while (l->rays < (uint64_t)l->options.rays && (!l->options.limit || l->sum.samples < l->options.limit)) {
    if (sf_cli_interrupted())
      return sf_fail(SF_E_STOPPED, "stopped after %" PRIu64 " of %d rays, %" PRIu64 " samples equal", l->rays,
                     l->options.rays, l->sum.samples);
    SF_TRY(next_batch(l, b));
    if (l->tick) l->tick(l->user, l);
  }
  l->complete = true;
  return sf_ok();
}

static sf_status compare(sf_lockstep *l, sf_board *board)
{
  sf_batch *b = calloc(1, sizeof *b);
  if (!b) return sf_fail(SF_E_MEMORY, "lockstep with the board: out of memory");
  sf_status status = sf_batch_open(b, board);
  if (status.code == SF_OK) status = run(l, b);
  sf_batch_close(b);
  free(b);
  if (status.code == SF_E_DIFFERENCE && l->place.found) return sf_lockstep_difference(l, &status);
  return status;
}

sf_status sf_board_lockstep_run(sf_lockstep *l, double patience, char faults[400])
{
  sf_board *board;
  faults[0] = 0;
  SF_TRY(sf_board_open(&board, l->options.port, patience, &l->fx, l->options.scene));
  const sf_status status = compare(l, board);
  sf_link_faults_text(&board->link, faults);
  sf_board_close(board);
  const sf_status energy = sf_lockstep_energy(l);
  l->unwritten = sf_fail(SF_E_UNSUPPORTED, "a board has neither waveform nor replay: sf_cosim without --backend board "
                                           "has both of the Verilated accelerator");
  return status.code == SF_OK ? energy : status;
}
