/* The search: everything that can go is a cut. Each cut is measured alone. Of the many small ones, how much they change
 * the pictures of a few rays: near the optimum that training reached, the squared change is what the error grows by,
 * and unlike the error itself it is not drowned by the error that was there before. Of the few large ones (levels,
 * tables, steps), the error against the photographs on the checking rays. The cuts that lose least for what they save
 * are then taken together on the checking rays, halving the group where it exceeds the bound. What the cuts did to each
 * other shows in the next round, which measures again. */
#include "src/fit/internal.h"
#include <stdlib.h>
#include <string.h>

enum { CHECKS_MAX = 32 /* per round */, CHUNK = 8192 };
/* Parts of the bound that may be spent by the end of each round: tables and stops shrink by one octave a round. */
static const double allowance[] = {0.5, 0.8, 1};
static const double HOPELESS = 4; /* a cut that alone changes more than this many times the whole bound is given up */
enum { ROUNDS = sizeof allowance / sizeof allowance[0] };

/* ---- cuts ---- */

static bool apply_cut(const sf_fit_search *s, sf_trim *trim, const sf_cut *c)
{
  return sf_cut_kinds[c->kind].apply(s->scene, &s->use, trim, c->place);
}

static sf_status list_cuts(sf_fit_search *s)
{
  for (int kind = 0; kind < sf_cut_kind_count; kind++) s->room += sf_cut_kinds[kind].places(s->scene);
  s->cuts = calloc((size_t)s->room, sizeof *s->cuts);
  if (!s->cuts) return sf_fail(SF_E_MEMORY, "%s: no memory for %d cuts", s->job->name, s->room);
  for (int kind = 0; kind < sf_cut_kind_count; kind++)
    for (int place = 0; place < sf_cut_kinds[kind].places(s->scene); place++)
      s->cuts[s->count++] = (sf_cut){.kind = kind, .place = place};
  return sf_ok();
}

/* ---- measuring ---- */

sf_status sf_fit_search_tick(const sf_fit_search *s, const char *what, int done, int total)
{
  if (!s->job->tick || s->job->tick(s->job->user, what, done, total)) return sf_ok();
  return sf_fail(SF_E_STOPPED, "%s: stopped while fitting", s->job->name);
}

sf_status sf_fit_search_measure(const sf_fit_search *s, const fx_scene *scene, const sf_fit_rays *rays, uint64_t begin,
                                uint64_t end, uint32_t *picture, sf_fit_sum *sum)
{
  memset(sum, 0, sizeof *sum);
  for (uint64_t at = begin, next; at < end; at = next) {
    sf_fit_sum part;
    next = at + CHUNK < end ? at + CHUNK : end;
    SF_TRY(sf_fit_search_tick(s, NULL, 0, 0));
    SF_TRY(sf_fit_measure(scene, rays, at, next, picture ? picture + 3 * (at - begin) : NULL, &part));
    sum->error += part.error;
    fx_counts_add(&sum->counts, &part.counts);
  }
  return sf_ok();
}

sf_field_cost sf_field_cost_of(const sf_fit_field *field, uint64_t misses)
{
  const double bytes = (double)field->counts.grid_bytes;
  return bytes > 0 ? (sf_field_cost){(double)field->lookups / bytes, (double)misses / bytes} : (sf_field_cost){0, 0};
}

sf_status sf_fit_search_field(const sf_fit_search *s, const fx_scene *scene, sf_field_cost *cost, sf_fit_field *whole)
{
  uint64_t misses;
  SF_TRY(sf_fit_search_tick(s, NULL, 0, 0));
  SF_TRY(sf_fit_measure_field(scene, s->job->tiles, &sf_cache_built, 1, whole, &misses));
  *cost = sf_field_cost_of(whole, misses);
  return sf_ok();
}

uint64_t sf_fit_search_energy(const sf_fit_search *s, const fx_scene *scene, const fx_counts *counts, uint64_t rays,
                              const sf_field_cost *field, const fx_cache_shape *cache)
{
  const double bytes = (double)counts->grid_bytes;
  const fx_memory_counts memory = {.lookups = (uint64_t)(field->lookups * bytes),
                                   .misses = (uint64_t)(field->misses * bytes)};
  const sf_traffic traffic = sf_traffic_of(scene, counts, &memory, rays);
  const sf_counted counted = {scene, counts, &memory, &traffic, *cache};
  return sf_ledger_fj(s->job->technology, &counted, SF_LEDGER_NEURON);
}

/* new_field: measured with the trim, and left there; NULL: the one of the trim so far holds. */
static sf_status measure_trim(sf_fit_search *s, const sf_trim *trim, const sf_fit_rays *rays, uint64_t begin,
                              uint64_t end, uint32_t *picture, sf_field_cost *new_field, sf_measured *m)
{
  fx_scene trial;
  sf_fit_sum sum;
  sf_fit_field whole;
  SF_TRY(sf_trim_apply(s->scene, trim, &s->use, s->job->name, &trial));
  sf_status status = sf_fit_search_measure(s, &trial, rays, begin, end, picture, &sum);
  if (status.code == SF_OK && new_field) status = sf_fit_search_field(s, &trial, new_field, &whole);
  if (status.code == SF_OK) {
    const sf_field_cost *field = new_field ? new_field : &s->field_now;
    *m = (sf_measured){sum.error, sf_fit_search_energy(s, &trial, &sum.counts, end - begin, field, &sf_cache_built),
                       (uint64_t)sf_packed_bytes(&trial, s->widths)};
  }
  fx_scene_free(&trial);
  return status;
}

static sf_status check_trim(sf_fit_search *s, const sf_trim *trim, sf_field_cost *f, sf_measured *m)
{
  return measure_trim(s, trim, s->job->rays, s->rank_end, s->check_end, NULL, f, m);
}

/* The error of the reference, scaled to the ranking rays: those are too few to say it themselves. */
static double rank_error(const sf_fit_search *s)
{
  return (double)s->reference.error * (double)s->rank_end / (double)(s->check_end - s->rank_end);
}

static sf_status rank_cut(sf_fit_search *s, const sf_trim *trim, sf_cut *c)
{
  const bool large = sf_cut_kinds[c->kind].large;
  const sf_measured *now = large ? &s->check : &s->rank_now;
  sf_measured m;
  sf_field_cost f;
  if (large)
    SF_TRY(check_trim(s, trim, &f, &m));
  else
    SF_TRY(measure_trim(s, trim, &s->rank, 0, s->rank_end, NULL, NULL, &m));
  c->loss = large ? sf_fit_ratio(m.error, now->error) - 1 : (double)m.error / rank_error(s);
  c->saving = 2 - sf_fit_ratio(m.energy, now->energy) - sf_fit_ratio(m.bytes, now->bytes);
  return sf_ok();
}

/* Those that were not ranked come last. */
static int by_price(const void *a, const void *b)
{
  const sf_cut *x = a, *y = b;
  if (!x->ranked || !y->ranked) return y->ranked - x->ranked;
  const double left = x->loss / x->saving, right = y->loss / y->saving;
  return (left > right) - (left < right);
}

double sf_fit_search_allowed(const sf_fit_search *s, double share)
{
  return (double)s->reference.error * pow(10, share * s->job->loss_db / 10);
}

/* Measures every cut that is possible, forgets the hopeless ones and those that save nothing, and puts the rest first,
 * by price. */
static sf_status rank_cuts(sf_fit_search *s, int round)
{
  const double whole = sf_fit_search_allowed(s, 1) / (double)s->reference.error - 1;
  int left = 0;
  char what[32];
  snprintf(what, sizeof what, "round %d of %d", round + 1, ROUNDS);
  s->ranked = 0;
  for (int i = 0; i < s->count; i++) {
    sf_trim trial = s->trim;
    sf_cut c = s->cuts[i];
    SF_TRY(sf_fit_search_tick(s, what, i, s->count));
    c.ranked = apply_cut(s, &trial, &c);
    if (c.ranked) SF_TRY(rank_cut(s, &trial, &c));
    if (c.ranked && (c.saving <= 0 || c.loss > HOPELESS * whole)) continue;
    s->ranked += c.ranked;
    s->cuts[left++] = c;
  }
  s->count = left;
  qsort(s->cuts, (size_t)left, sizeof *s->cuts, by_price);
  return sf_ok();
}

/* Cuts worth a try: those beyond the room by the sum of the single changes wait for the next round. */
static int cuts_in_reach(const sf_fit_search *s, double room)
{
  double sum = 0;
  int n = 0;
  while (n < s->ranked && (sum += fmax(s->cuts[n].loss, 0)) <= 2 * room) n++;
  return n < s->ranked ? n + 1 : n;
}

/* All of the cuts where they stay within the limit, else each half on its own. The trim is only ever one that was
 * measured. */
static sf_status take_cuts(sf_fit_search *s, double limit, int begin, int end)
{
  sf_trim trial = s->trim;
  sf_measured m;
  sf_field_cost f;
  if (begin == end || s->checks == CHECKS_MAX) return sf_ok();
  SF_TRY(sf_fit_search_tick(s, "checking", begin, end));
  for (int i = begin; i < end; i++) apply_cut(s, &trial, &s->cuts[i]);
  SF_TRY(check_trim(s, &trial, &f, &m));
  s->checks++;
  if ((double)m.error <= limit) {
    s->trim = trial, s->check = m, s->field_now = f;
    return sf_ok();
  }
  if (end - begin == 1) return sf_ok();
  SF_TRY(take_cuts(s, limit, begin, (begin + end) / 2));
  return take_cuts(s, limit, (begin + end) / 2, end);
}

sf_status sf_fit_search_rounds(sf_fit_search *s)
{
  sf_field_cost f;
  SF_TRY(check_trim(s, &s->trim, &f, &s->check));
  s->field_now = f;
  SF_TRY(list_cuts(s));
  for (int round = 0; round < ROUNDS; round++) {
    const double limit = sf_fit_search_allowed(s, allowance[round]), room = limit / (double)s->check.error - 1;
    if (!(room > 0)) continue;
    SF_TRY(measure_trim(s, &s->trim, s->job->rays, 0, s->rank_end, s->picture, NULL, &s->rank_now));
    SF_TRY(rank_cuts(s, round));
    s->checks = 0;
    SF_TRY(take_cuts(s, limit, 0, cuts_in_reach(s, room)));
  }
  return sf_ok();
}
