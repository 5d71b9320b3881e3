/* The ranks of a job as workers: rank 0, which deals, and the others, which serve. */
#include "ranks/internal.h"
#include "base/clock.h"
#include <stdlib.h>
#include <string.h>

/* mpirun kills what is left a second after it asked all to end: rank 0 has to have written what there is by then. */
static const double DEALER_PATIENCE = 0.5, SERVANT_PATIENCE = 3;

typedef struct team {
  sf_crew crew; /* first: the crew is the team */
  sf_ranks *ranks;
  const sf_deal *deal;
  sf_hand *hand; /* of rank 0 */
} team;

/* What became of the deal, and whether rank 0 leaves without waiting for anybody. */
typedef struct farewell {
  sf_status status;
  bool broken;
} farewell;

/* On every rank: nobody deals or serves unless all can. */
static sf_status begin(sf_ranks *r, const sf_deal *deal, sf_hand **hand)
{
  atomic_store(&r->enough, false);
  const sf_status opened = sf_hand_open(hand, deal), status = sf_ranks_agree(r, opened);
  if (status.code != SF_OK) sf_hand_close(*hand);
  return status;
}

/* ---- rank 0 ---- */

static sf_status give(sf_crew *crew, int who, uint64_t unit)
{
  team *t = (team *)crew;
  if (who) return sf_ranks_send(t->ranks, who, SF_TAG_UNIT, &unit, sizeof unit);
  sf_hand_give(t->hand, unit);
  return sf_ok();
}

static int wait_for(sf_crew *crew, int ms)
{
  team *t = (team *)crew;
  for (const double end = sf_seconds() + ms / 1e3;; sf_ranks_nap()) {
    int rank, tag;
    size_t size;
    if (sf_hand_done(t->hand)) return 0;
    if (sf_mpi_link_probe(t->ranks->link, -1, &rank, &tag, &size)) return rank;
    if (sf_seconds() >= end) return -1;
  }
}

static sf_status read_result(sf_crew *crew, int who, void *result)
{
  team *t = (team *)crew;
  if (who) return sf_ranks_receive(t->ranks, who, SF_TAG_RESULT, result, t->deal->result_size);
  memcpy(result, sf_hand_take(t->hand), t->deal->result_size);
  return sf_ok();
}

static void stop(sf_crew *crew)
{
  team *t = (team *)crew;
  atomic_store(&t->ranks->enough, true);
  for (int i = 1; i < crew->count; i++) (void)sf_ranks_send(t->ranks, i, SF_TAG_STOP, "", 0);
}

static void name(sf_crew *crew, int who, char *text, size_t size)
{
  sf_ranks_name(((team *)crew)->ranks, who, text, size);
}

/* Results that nobody wants any more come before the farewell. */
static sf_status part(team *t, int rank)
{
  for (;;) {
    int tag;
    size_t size;
    SF_TRY(sf_ranks_wait(t->ranks, rank, &tag, &size));
    void *unwanted = malloc(size + 1);
    if (!unwanted) return sf_fail(SF_E_MEMORY, "no memory for a result");
    sf_mpi_link_receive(t->ranks->link, rank, tag, unwanted, size);
    free(unwanted);
    if (tag == SF_TAG_BYE) return sf_ok();
  }
}

/* Also to ranks that may be lost: whoever hears it ends without waiting for the others. */
static void dismiss(team *t, const farewell *last)
{
  for (int i = 1; i < t->crew.count; i++) {
    if (!t->ranks->broken) {
      (void)sf_ranks_send(t->ranks, i, SF_TAG_DISMISS, last, sizeof *last);
      continue;
    }
    sf_mpi_link_send(t->ranks->link, i, SF_TAG_DISMISS, last, sizeof *last);
    for (int naps = 0; naps < 20 && !sf_mpi_link_sent(t->ranks->link); naps++) sf_ranks_nap();
  }
}

static sf_status end(sf_crew *crew, const sf_status *status)
{
  sf_status kept = *status;
  team *t = (team *)crew;
  const farewell last = {kept, t->ranks->broken};
  atomic_store(&t->ranks->enough, true);
  dismiss(t, &last);
  sf_hand_close(t->hand);
  for (int i = 1; i < crew->count && !t->ranks->broken; i++) {
    const sf_status parted = part(t, i);
    if (kept.code == SF_OK) kept = parted;
  }
  atomic_store(&t->ranks->enough, false); /* of this deal alone */
  free(t);
  return kept;
}

sf_status sf_crew_ranks(sf_crew **crew, const sf_deal *deal, sf_ranks *ranks)
{
  team *t = calloc(1, sizeof *t);
  if (!t) return sf_fail(SF_E_MEMORY, "out of memory");
  t->crew = (sf_crew){ranks->size, DEALER_PATIENCE, give, wait_for, read_result, stop, name, end};
  t->ranks = ranks, t->deal = deal;
  const sf_status status = begin(ranks, deal, &t->hand);
  *crew = &t->crew;
  if (status.code != SF_OK) free(t);
  return status;
}

/* ---- the others ---- */

/* What rank 0 says; true: the deal is over, with its status. */
static bool obey(sf_ranks *r, sf_hand *hand, sf_status *status)
{
  int from, tag;
  size_t size;
  uint64_t unit;
  if (!sf_mpi_link_probe(r->link, 0, &from, &tag, &size)) return false;
  if (tag == SF_TAG_UNIT) {
    const sf_status given = sf_ranks_receive(r, 0, tag, &unit, sizeof unit);
    if (given.code == SF_OK) sf_hand_give(hand, unit);
    return false;
  }
  atomic_store(&r->enough, true);
  if (tag != SF_TAG_STOP) *status = sf_fail(SF_E_FORMAT, "message %d in the middle of a deal", tag);
  if (tag == SF_TAG_STOP) return (void)sf_ranks_receive(r, 0, tag, NULL, 0), false;
  if (tag != SF_TAG_DISMISS) return true;
  farewell last;
  const sf_status received = sf_ranks_receive(r, 0, tag, &last, sizeof last);
  *status = received.code == SF_OK ? last.status : received;
  r->broken |= received.code == SF_OK && last.broken;
  return true;
}

/* Rank 0 answers an interrupt soon, unless it is lost. */
static bool forsaken(sf_ranks *r, double *since)
{
  if (!r->options.interrupted()) return false;
  if (*since == 0) *since = sf_seconds();
  r->broken = r->deserted = sf_seconds() - *since > SERVANT_PATIENCE;
  return r->broken;
}

sf_status sf_ranks_serve(sf_ranks *r, const sf_deal *deal)
{
  sf_hand *hand;
  sf_status status = sf_ok();
  double since = 0;
  SF_TRY(begin(r, deal, &hand));
  while (!obey(r, hand, &status)) {
    if (forsaken(r, &since)) {
      status = sf_fail(SF_E_STOPPED, "stopped; rank 0 does not answer");
      break;
    }
    if (sf_hand_done(hand))
      (void)sf_ranks_send(r, 0, SF_TAG_RESULT, sf_hand_take(hand), deal->result_size);
    else
      sf_ranks_nap();
  }
  sf_hand_close(hand);             /* after its unit, whose result nobody waits for */
  atomic_store(&r->enough, false); /* of this deal alone */
  (void)sf_ranks_send(r, 0, SF_TAG_BYE, NULL, 0);
  return status;
}
