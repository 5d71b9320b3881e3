#include "ranks/internal.h"
#include "base/clock.h"
#include "base/sha256.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sched.h>
#include <time.h>
#include <unistd.h>

static const double PATIENCE = 3;

int sf_ranks_launched(void)
{
  return sf_mpi_link_launched().size;
}

bool sf_ranks_talks(const sf_ranks *r)
{
  return (r && r->deserted) || sf_mpi_link_launched().rank <= 0;
}

int sf_ranks_rank(const sf_ranks *r)
{
  return r ? r->rank : 0;
}

int sf_ranks_size(const sf_ranks *r)
{
  return r ? r->size : 1;
}

bool sf_ranks_lost(const sf_ranks *r)
{
  return r && r->broken;
}

bool sf_ranks_stop(const sf_ranks *r)
{
  return r && (atomic_load(&r->enough) || r->options.interrupted());
}

void sf_ranks_name(const sf_ranks *r, int rank, char *text, size_t size)
{
  snprintf(text, size, "rank %d%s%s", rank, r->host && r->host[rank][0] ? " on " : "", r->host ? r->host[rank] : "");
}

sf_status sf_ranks_named(const sf_ranks *r, sf_status status)
{
  char host[64] = "";
  if (!sf_ranks_rank(r) || (status.code != SF_E_IO && status.code != SF_E_MEMORY)) return status;
  gethostname(host, sizeof host - 1);
  return sf_fail(status.code, "rank %d on %s: %.300s", r->rank, host, status.message);
}

/* MPI's own waiting takes a whole processor. */
void sf_ranks_nap(void)
{
  const struct timespec t = {.tv_nsec = 1000000};
  nanosleep(&t, NULL);
}

/* ---- messages ---- */

static sf_status silent(sf_ranks *r, int rank, double *since)
{
  char name[128];
  if (r->broken || !r->options.interrupted()) return sf_ok();
  if (*since == 0) *since = sf_seconds();
  if (sf_seconds() - *since < (r->options.patience > 0 ? r->options.patience : PATIENCE)) return sf_ok();
  r->broken = true, r->deserted = r->rank > 0;
  sf_ranks_name(r, rank, name, sizeof name);
  return sf_fail(SF_E_STOPPED, "stopped; %s does not answer", name);
}

/* Yields, then sleeps ever longer up to a millisecond. */
sf_status sf_ranks_pause(sf_ranks *r, int rank, sf_pause *pause)
{
  enum { YIELDS = 100, STEP = 20000, LONGEST = 50 };
  SF_TRY(silent(r, rank, &pause->since));
  const int turn = pause->times++ - YIELDS;
  if (turn > LONGEST) pause->times--;
  const struct timespec t = {.tv_nsec = STEP * (long)(turn < LONGEST ? turn : LONGEST)};
  if (turn <= 0)
    sched_yield();
  else
    nanosleep(&t, NULL);
  return sf_ok();
}

sf_status sf_ranks_wait(sf_ranks *r, int from, int *tag, size_t *size)
{
  int rank;
  for (sf_pause pause = {0}; !r->broken;) {
    if (sf_mpi_link_probe(r->link, from, &rank, tag, size)) return sf_ok();
    SF_TRY(sf_ranks_pause(r, from, &pause));
  }
  return sf_fail(SF_E_STOPPED, "stopped");
}

sf_status sf_ranks_receive(sf_ranks *r, int from, int tag, void *data, size_t size)
{
  int there;
  size_t bytes;
  SF_TRY(sf_ranks_wait(r, from, &there, &bytes));
  if (there != tag || bytes != size)
    return sf_fail(SF_E_FORMAT, "rank %d sent message %d of %zu bytes, expected %d of %zu", from, there, bytes, tag,
                   size);
  sf_mpi_link_receive(r->link, from, tag, data, size);
  return sf_ok();
}

sf_status sf_ranks_send(sf_ranks *r, int to, int tag, const void *data, size_t size)
{
  sf_pause pause = {0};
  if (r->broken) return sf_fail(SF_E_STOPPED, "stopped");
  sf_mpi_link_send(r->link, to, tag, data, size);
  while (!sf_mpi_link_sent(r->link)) SF_TRY(sf_ranks_pause(r, to, &pause));
  return sf_ok();
}

/* ---- together ---- */

enum { PIECE = 1 << 30 }; /* MPI counts in int */

sf_status sf_ranks_broadcast(sf_ranks *r, void *data, size_t size)
{
  for (size_t at = 0; sf_ranks_size(r) > 1 && at < size; at += PIECE) {
    const size_t n = size - at < PIECE ? size - at : PIECE;
    if (r->rank) SF_TRY(sf_ranks_receive(r, 0, SF_TAG_DATA, (char *)data + at, n));
    for (int to = 1; !r->rank && to < r->size; to++) SF_TRY(sf_ranks_send(r, to, SF_TAG_DATA, (char *)data + at, n));
  }
  return sf_ok();
}

sf_status sf_ranks_gather(sf_ranks *r, const void *mine, size_t size, void *all)
{
  if (sf_ranks_rank(r)) return sf_ranks_send(r, 0, SF_TAG_DATA, mine, size);
  memcpy(all, mine, size);
  for (int from = 1; from < sf_ranks_size(r); from++)
    SF_TRY(sf_ranks_receive(r, from, SF_TAG_DATA, (char *)all + (size_t)from * size, size));
  return sf_ok();
}

static sf_status worst(const sf_ranks *r, const sf_status *all)
{
  for (int i = 0; i < r->size; i++) {
    char name[128];
    if (all[i].code == SF_OK) continue;
    if (i == 0 || all[i].code == SF_E_STOPPED) return all[i];
    sf_ranks_name(r, i, name, sizeof name);
    return sf_fail(all[i].code, "%s: %.270s", name, all[i].message);
  }
  return sf_ok();
}

sf_status sf_ranks_agree(sf_ranks *r, sf_status mine)
{
  if (sf_ranks_size(r) == 1) return mine;
  sf_status *all = calloc((size_t)r->size, sizeof *all), common;
  if (!all) return sf_fail(SF_E_MEMORY, "no memory for %d ranks", r->size);
  const sf_status gathered = sf_ranks_gather(r, &mine, sizeof mine, all);
  common = gathered.code == SF_OK ? worst(r, all) : gathered;
  free(all);
  SF_TRY(gathered);
  SF_TRY(sf_ranks_broadcast(r, &common, sizeof common));
  return common;
}

static sf_status compare(const sf_ranks *r, const char *what, const char (*all)[65])
{
  char name[128];
  for (int i = 1; i < r->size; i++) {
    if (!strcmp(all[i], all[0])) continue;
    sf_ranks_name(r, i, name, sizeof name);
    return sf_fail(SF_E_UNSUPPORTED, "%s has another %s than rank 0", name, what);
  }
  return sf_ok();
}

sf_status sf_ranks_same(sf_ranks *r, const char *what, const char *text)
{
  if (sf_ranks_size(r) == 1) return sf_ok();
  char mine[65] = "", (*all)[65] = calloc((size_t)r->size, sizeof *all);
  if (!all) return sf_fail(SF_E_MEMORY, "no memory for %d ranks", r->size);
  snprintf(mine, sizeof mine, "%s", text);
  sf_status status = sf_ranks_gather(r, mine, sizeof mine, all);
  if (status.code == SF_OK && r->rank == 0) status = compare(r, what, (const char(*)[65])all);
  free(all);
  return r->broken ? status : sf_ranks_agree(r, status);
}

/* ---- beginning and end ---- */

static sf_status hash_words(int argc, char **argv, char hex[65])
{
  size_t size = 1;
  for (int i = 1; i < argc; i++) size += strlen(argv[i]) + 1;
  char *text = malloc(size), *to = text;
  if (!text) return sf_fail(SF_E_MEMORY, "out of memory");
  for (int i = 1; i < argc; i++) to = stpcpy(to, argv[i]) + 1;
  sf_sha256(text, (size_t)(to - text), hex);
  free(text);
  return sf_ok();
}

static sf_status meet(sf_ranks *r)
{
  char host[64] = "", hex[65] = "";
  gethostname(host, sizeof host - 1);
  r->host = calloc((size_t)r->size, sizeof *r->host);
  if (!r->host) return sf_fail(SF_E_MEMORY, "no memory for %d ranks", r->size);
  SF_TRY(sf_ranks_gather(r, host, sizeof host, r->host));
  sf_status status = sf_sha256_file("/proc/self/exe", hex);
  SF_TRY(sf_ranks_agree(r, status));
  SF_TRY(sf_ranks_same(r, "program", hex));
  status = hash_words(r->options.argc, r->options.argv, hex);
  SF_TRY(sf_ranks_agree(r, status));
  return sf_ranks_same(r, "command line", hex);
}

sf_status sf_ranks_open(sf_ranks **ranks, const sf_ranks_options *options)
{
  const sf_launched launched = sf_mpi_link_launched();
  sf_ranks *r = *ranks = calloc(1, sizeof *r);
  if (!r) return sf_fail(SF_E_MEMORY, "out of memory");
  r->options = *options, r->size = 1;
  if (launched.size <= 1) return sf_ok();
  r->rank = launched.rank; /* so that one alone tells of a failure */
  if (!launched.messages)
    return sf_fail(SF_E_UNSUPPORTED, "srun started %d tasks that cannot talk to each other: srun --mpi=pmix",
                   launched.size);
  SF_TRY(sf_mpi_link_open(&r->link, &launched));
  r->size = launched.size;
  return meet(r);
}

void sf_ranks_close(sf_ranks *r)
{
  char done = 0;
  if (!r) return;
  /* Rank 0 may have much to write still: the others wait for it as for all messages. A link whose other end is lost
   * would wait for ever. */
  if (r->link && sf_ranks_broadcast(r, &done, 1).code == SF_OK) sf_mpi_link_close(r->link);
  free(r->host);
  free(r);
}
