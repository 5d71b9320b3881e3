/* What every rank has a part of, to all of them. In a ring: each sends and receives what is not its own once. */
#include "ranks/internal.h"
#include <string.h>

enum { PIECE = 1 << 30 }; /* MPI counts in int */

static size_t piece(size_t left)
{
  return left < PIECE ? left : PIECE;
}

/* Sends to one rank while receiving from another: two that only sent large messages would wait for each other. */
static sf_status swap(sf_ranks *r, int to, const char *out, size_t sends, int from, char *in, size_t receives)
{
  size_t sent = 0, got = 0;
  bool sending = false;
  sf_pause pause = {0};
  if (r->broken) return sf_fail(SF_E_STOPPED, "stopped");
  while (sent < sends || got < receives) {
    int rank, tag;
    size_t size, begun = sent + got;
    if (sent < sends && !sending) {
      sf_mpi_link_send(r->link, to, SF_TAG_DATA, out + sent, piece(sends - sent));
      sending = true;
    }
    if (got < receives && sf_mpi_link_probe(r->link, from, &rank, &tag, &size)) {
      SF_TRY(sf_ranks_receive(r, from, SF_TAG_DATA, in + got, piece(receives - got)));
      got += piece(receives - got);
    }
    if (sending && sf_mpi_link_sent(r->link)) {
      sent += piece(sends - sent);
      sending = false;
    }
    if (sent + got == begun) SF_TRY(sf_ranks_pause(r, got < receives ? from : to, &pause));
  }
  r->sent += sends;
  return sf_ok();
}

sf_status sf_ranks_share(sf_ranks *r, void *data, size_t size, const size_t *edge)
{
  const int n = sf_ranks_size(r);
  for (int step = 0; step + 1 < n; step++) {
    const int give = (r->rank - step + n) % n, take = (give - 1 + n) % n;
    SF_TRY(swap(r, (r->rank + 1) % n, (char *)data + edge[give] * size, (edge[give + 1] - edge[give]) * size,
                (r->rank - 1 + n) % n, (char *)data + edge[take] * size, (edge[take + 1] - edge[take]) * size));
  }
  return sf_ok();
}

sf_status sf_ranks_exchange(sf_ranks *r, const void *out, const size_t *out_edge, void *in, const size_t *in_edge)
{
  const int n = sf_ranks_size(r), me = sf_ranks_rank(r);
  memcpy((char *)in + in_edge[me], (const char *)out + out_edge[me], out_edge[me + 1] - out_edge[me]);
  for (int step = 1; step < n; step++) {
    const int to = (me + step) % n, from = (me - step + n) % n;
    SF_TRY(swap(r, to, (const char *)out + out_edge[to], out_edge[to + 1] - out_edge[to], from,
                (char *)in + in_edge[from], in_edge[from + 1] - in_edge[from]));
  }
  return sf_ok();
}

uint64_t sf_ranks_sent(const sf_ranks *r)
{
  return r ? r->sent : 0;
}
