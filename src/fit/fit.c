/* The search: everything that can go is a cut. Each cut is measured alone. Of the many small ones, how much they change
 * the pictures of a few rays: near the optimum that training reached, the squared change is what the error grows by,
 * and unlike the error itself it is not drowned by the error that was there before. Of the few large ones (levels,
 * tables, steps), the error against the photographs on the checking rays. The cuts that lose least for what they save
 * are then taken together on the checking rays, halving the group where it exceeds the bound. What the cuts did to each
 * other shows in the next round, which measures again. */
#include "cycles/cycles.h"
#include "fit/fit.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RANK_SHARE = 256, RANK_MIN = 128, CHECK_SHARE = 4, CHECK_MIN = 2048, STOP_MAX = 1 << (SF_TRANS_FRAC - 5) };
enum { CHECKS_MAX = 32 /* per round */, CHUNK = 8192 };
enum { CUTS_MAX = SF_LAYERS * SF_LANES + 2 * FX_LEVELS_MAX + SF_CELL_CLASSES + 3 };
/* Parts of the bound that may be spent by the end of each round: tables and stops shrink by one octave a round. */
static const double allowance[] = {0.5, 0.8, 1};
static const double HOPELESS = 4; /* a cut that alone changes more than this many times the whole bound is given up */
enum { ROUNDS = sizeof allowance / sizeof allowance[0] };

typedef enum { CUT_NEURON, CUT_LEVEL, CUT_TABLE, CUT_CELLS, CUT_DIRECTION, CUT_STEP, CUT_STOP } cut_kind;
typedef struct cut {
  cut_kind kind;
  int layer, index;
  double loss, saving; /* relative: of the squared error; of energy plus of bytes */
} cut;

typedef struct measured {
  uint64_t error, energy, bytes;
} measured;

/* What a sample reads of the field, on the tiles. */
typedef struct field {
  double lookups, misses;
} field;

typedef struct search {
  const sf_fit_job *job;
  const fx_scene *scene; /* the chosen candidate */
  const sf_quant_widths *widths;
  sf_trim_use use;
  sf_trim trim;                 /* what stays, so far */
  sf_fit_sum reference;         /* on the checking rays */
  measured check, rank_now;     /* the trim so far on the checking and on the ranking rays */
  field field_now;              /* of the trim so far */
  sf_fit_rays rank;             /* rays with the pictures of the trim so far as targets */
  uint32_t *picture;            /* [rank_end][3] */
  uint64_t rank_end, check_end; /* rays 0..rank_end-1 rank, then come those that check */
  cut cuts[CUTS_MAX];
  int count, checks;
} search;

static double ratio(uint64_t a, uint64_t b)
{
  return b ? (double)a / (double)b : a ? INFINITY : 1;
}

/* ---- cuts ---- */

static int kept(const bool *flag, int n)
{
  int sum = 0;
  for (int i = 0; i < n; i++) sum += flag[i];
  return sum;
}

/* False where the cut is not possible, or not any more. */
static bool apply_cut(const search *s, sf_trim *trim, const cut *c)
{
  const fx_scene *scene = s->scene;
  switch (c->kind) {
  case CUT_NEURON:
    if (!trim->neuron[c->layer][c->index]) return false;
    if (kept(trim->neuron[c->layer], SF_LANES) <= sf_trim_least(trim, c->layer)) return false;
    trim->neuron[c->layer][c->index] = false;
    return true;
  case CUT_LEVEL:
    if (!trim->level[c->index] || kept(trim->level, FX_LEVELS_MAX) == 1) return false;
    trim->level[c->index] = false;
    return true;
  case CUT_TABLE:
    if (!trim->level[c->index] || sf_trim_smaller(scene, trim, c->index) < 0) return false;
    trim->log2_size[c->index] = sf_trim_smaller(scene, trim, c->index);
    return true;
  case CUT_CELLS:
    if (!trim->cells[c->index]) return false;
    trim->cells[c->index] = false;
    return true;
  case CUT_DIRECTION:
    if (trim->directions < 2) return false;
    trim->directions--;
    return true;
  case CUT_STEP:
    if (trim->steps < 2) return false;
    trim->steps--;
    return true;
  default:
    if (trim->trans_stop > STOP_MAX) return false;
    trim->trans_stop = 4 * trim->trans_stop + 3;
    return true;
  }
}

static void list_cut(search *s, cut_kind kind, int layer, int index)
{
  sf_trim trial = s->trim;
  const cut c = {.kind = kind, .layer = layer, .index = index};
  if (apply_cut(s, &trial, &c)) s->cuts[s->count++] = c;
}

static void list_cells(search *s)
{
  bool there[SF_CELL_CLASSES] = {false};
  for (int64_t cell = 0; cell < s->use.cells; cell++) there[sf_cell_class(&s->use, cell)] = true;
  for (int c = 1; c < SF_CELL_CLASSES; c++) /* class 0 is as good as opaque, or unseen */
    if (there[c]) list_cut(s, CUT_CELLS, 0, c);
}

static void list_cuts(search *s)
{
  s->count = 0;
  for (int l = FX_D1; l <= FX_C2; l++)
    for (int o = l == FX_D2; o < s->scene->net.layer[l].n_out; o++) list_cut(s, CUT_NEURON, l, o);
  for (int l = 0; l < s->scene->grid.levels; l++) list_cut(s, CUT_LEVEL, 0, l), list_cut(s, CUT_TABLE, 0, l);
  list_cells(s);
  list_cut(s, CUT_DIRECTION, 0, 0);
  list_cut(s, CUT_STEP, 0, 0);
  list_cut(s, CUT_STOP, 0, 0);
}

/* ---- measuring ---- */

static sf_status tick(const search *s, const char *what, int done, int total)
{
  if (!s->job->tick || s->job->tick(s->job->user, what, done, total)) return sf_ok();
  return sf_fail(SF_E_STOPPED, "%s: stopped while fitting", s->job->name);
}

/* sf_fit_measure in pieces, so that an interruption is heard. */
static sf_status measure(const search *s, const fx_scene *scene, const sf_fit_rays *rays, uint64_t begin, uint64_t end,
                         uint32_t *picture, sf_fit_sum *sum)
{
  memset(sum, 0, sizeof *sum);
  for (uint64_t at = begin, next; at < end; at = next) {
    sf_fit_sum part;
    next = at + CHUNK < end ? at + CHUNK : end;
    SF_TRY(tick(s, NULL, 0, 0));
    SF_TRY(sf_fit_measure(scene, rays, at, next, picture ? picture + 3 * (at - begin) : NULL, &part));
    sum->error += part.error;
    fx_counts_add(&sum->counts, &part.counts);
  }
  return sf_ok();
}

static double per_sample(uint64_t n, const fx_counts *counts)
{
  return counts->samples ? (double)n / (double)counts->samples : 0;
}

static sf_status measure_field(const search *s, const fx_scene *scene, field *f)
{
  sf_fit_field whole;
  uint64_t misses;
  SF_TRY(tick(s, NULL, 0, 0));
  SF_TRY(sf_fit_measure_field(scene, s->job->tiles, &sf_cache_built, 1, &whole, &misses));
  *f = (field){per_sample(whole.lookups, &whole.counts), per_sample(misses, &whole.counts)};
  return sf_ok();
}

/* Everything that the audit counts: rays one by one for the nets, tiles for the field. */
static uint64_t energy_of(const search *s, const fx_scene *scene, const fx_counts *counts, uint64_t rays,
                          const field *f, const fx_cache_shape *cache)
{
  const double samples = (double)counts->samples;
  const fx_memory_counts memory = {.lookups = (uint64_t)(f->lookups * samples),
                                   .misses = (uint64_t)(f->misses * samples)};
  const sf_traffic traffic = sf_traffic_of(scene, counts, &memory, rays);
  const sf_counted counted = {scene, counts, &memory, &traffic, *cache};
  return sf_ledger_everything_fj(s->job->technology, &counted);
}

/* new_field: measured with the trim, and left there; NULL: the one of the trim so far holds. */
static sf_status measure_trim(const search *s, const sf_trim *trim, const sf_fit_rays *rays, uint64_t begin,
                              uint64_t end, uint32_t *picture, field *new_field, measured *m)
{
  fx_scene trial;
  sf_fit_sum sum;
  SF_TRY(sf_trim_apply(s->scene, trim, &s->use, s->job->name, &trial));
  sf_status status = measure(s, &trial, rays, begin, end, picture, &sum);
  if (status.code == SF_OK && new_field) status = measure_field(s, &trial, new_field);
  *m = (measured){
      sum.error, energy_of(s, &trial, &sum.counts, end - begin, new_field ? new_field : &s->field_now, &sf_cache_built),
      (uint64_t)sf_packed_bytes(&trial, s->widths)};
  fx_scene_free(&trial);
  return status;
}

static sf_status check_trim(const search *s, const sf_trim *trim, field *f, measured *m)
{
  return measure_trim(s, trim, s->job->rays, s->rank_end, s->check_end, NULL, f, m);
}

/* The error of the reference, scaled to the ranking rays: those are too few to say it themselves. */
static double rank_error(const search *s)
{
  return (double)s->reference.error * (double)s->rank_end / (double)(s->check_end - s->rank_end);
}

static bool large(const cut *c)
{
  return c->kind == CUT_LEVEL || c->kind == CUT_TABLE || c->kind == CUT_STEP;
}

static sf_status rank_cut(const search *s, const sf_trim *trim, cut *c)
{
  const measured *now = large(c) ? &s->check : &s->rank_now;
  measured m;
  field f;
  if (large(c))
    SF_TRY(check_trim(s, trim, &f, &m));
  else
    SF_TRY(measure_trim(s, trim, &s->rank, 0, s->rank_end, NULL, NULL, &m));
  c->loss = large(c) ? ratio(m.error, now->error) - 1 : (double)m.error / rank_error(s);
  c->saving = 2 - ratio(m.energy, now->energy) - ratio(m.bytes, now->bytes);
  return sf_ok();
}

static int by_price(const void *a, const void *b)
{
  const cut *x = a, *y = b;
  const double left = x->loss / x->saving, right = y->loss / y->saving;
  return (left > right) - (left < right);
}

/* The error on the checking rays that a share of the bound allows. */
static double error_allowed(const search *s, double share)
{
  return (double)s->reference.error * pow(10, share * s->job->loss_db / 10);
}

/* Measures every cut, forgets the impossible and the hopeless ones and sorts the rest by price. */
static sf_status rank_cuts(search *s, int round)
{
  const double whole = error_allowed(s, 1) / (double)s->reference.error - 1;
  int good = 0;
  char what[32];
  snprintf(what, sizeof what, "round %d of %d", round + 1, ROUNDS);
  for (int i = 0; i < s->count; i++) {
    sf_trim trial = s->trim;
    cut c = s->cuts[i];
    SF_TRY(tick(s, what, i, s->count));
    if (!apply_cut(s, &trial, &c)) continue;
    SF_TRY(rank_cut(s, &trial, &c));
    if (c.saving > 0 && c.loss <= HOPELESS * whole) s->cuts[good++] = c;
  }
  s->count = good;
  qsort(s->cuts, (size_t)good, sizeof *s->cuts, by_price);
  return sf_ok();
}

/* Cuts worth a try: those beyond the room by the sum of the single changes wait for the next round. */
static int cuts_in_reach(const search *s, double room)
{
  double sum = 0;
  int n = 0;
  while (n < s->count && (sum += fmax(s->cuts[n].loss, 0)) <= 2 * room) n++;
  return n < s->count ? n + 1 : n;
}

/* All of the cuts where they stay within the limit, else each half on its own. The trim is only ever one that was
 * measured. */
static sf_status take_cuts(search *s, double limit, int begin, int end)
{
  sf_trim trial = s->trim;
  measured m;
  field f;
  if (begin == end || s->checks == CHECKS_MAX) return sf_ok();
  SF_TRY(tick(s, "checking", begin, end));
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

static sf_status search_rounds(search *s)
{
  field f;
  SF_TRY(check_trim(s, &s->trim, &f, &s->check));
  s->field_now = f;
  list_cuts(s);
  for (int round = 0; round < ROUNDS; round++) {
    const double limit = error_allowed(s, allowance[round]), room = limit / (double)s->check.error - 1;
    if (!(room > 0)) continue;
    SF_TRY(measure_trim(s, &s->trim, s->job->rays, 0, s->rank_end, s->picture, NULL, &s->rank_now));
    SF_TRY(rank_cuts(s, round));
    s->checks = 0;
    SF_TRY(take_cuts(s, limit, 0, cuts_in_reach(s, room)));
  }
  return sf_ok();
}

/* ---- report ---- */

static void count_dropped(const search *s, const sf_trim *exact, sf_fit_report *r)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    const int n = s->scene->net.layer[l].n_out, after = kept(exact->neuron[l], n);
    r->silent[l] = n - after;
    r->dropped[l] = after - kept(s->trim.neuron[l], n);
  }
  const int levels = s->scene->grid.levels, left = kept(exact->level, levels);
  r->idle_levels = levels - left;
  r->dropped_levels = left - kept(s->trim.level, levels);
  for (int l = 0; l < levels; l++) r->smaller_tables += s->trim.level[l] && s->trim.log2_size[l] >= 0;
}

/* ---- all of it ---- */

static sf_status choose_candidate(search *s, int *chosen)
{
  const sf_fit_job *job = s->job;
  *chosen = 0;
  s->scene = job->candidate[0], s->widths = &job->widths[0];
  SF_TRY(measure(s, s->scene, job->rays, s->rank_end, s->check_end, NULL, &s->reference));
  for (int i = 1; i < job->candidates && job->loss_db > 0; i++) {
    sf_fit_sum sum;
    SF_TRY(tick(s, "widths", i, job->candidates));
    SF_TRY(measure(s, job->candidate[i], job->rays, s->rank_end, s->check_end, NULL, &sum));
    if ((double)sum.error > error_allowed(s, 0.5)) break;
    s->scene = job->candidate[i], s->widths = &job->widths[i], *chosen = i;
  }
  return sf_ok();
}

static sf_status describe(const search *s, const fx_scene *scene, const sf_quant_widths *widths, const sf_fit_sum *sum,
                          sf_fit_state *state)
{
  const uint64_t checked = s->check_end - s->rank_end;
  field f;
  SF_TRY(measure_field(s, scene, &f));
  sf_fit_describe(scene, widths, sum, checked, state);
  state->lookups = f.lookups, state->misses = f.misses;
  state->energy_fj = energy_of(s, scene, &sum->counts, checked, &f, &sf_cache_built);
  return sf_ok();
}

/* A cache is as good as another that saves no more than this. */
static const double NEARLY = 1.01;

/* The cache that the fitted scene needs: the smallest that is nearly as good as the best. A small one misses more, a
 * large one costs more per look-up. */
static sf_status choose_cache(const search *s, const fx_scene *scene, const sf_fit_sum *sum, sf_fit_report *r)
{
  fx_cache_shape shape[SF_FIT_CACHES];
  sf_fit_field whole;
  uint64_t misses[SF_FIT_CACHES];
  for (int i = 0; i < SF_FIT_CACHES; i++) shape[i] = (fx_cache_shape){FX_CACHE_BYTES_MIN << i, sf_cache_built.ways};
  SF_TRY(tick(s, "cache", 0, SF_FIT_CACHES));
  SF_TRY(sf_fit_measure_field(scene, s->job->tiles, shape, SF_FIT_CACHES, &whole, misses));
  uint64_t least = UINT64_MAX;
  for (int i = 0; i < SF_FIT_CACHES; i++) {
    const field f = {per_sample(whole.lookups, &whole.counts), per_sample(misses[i], &whole.counts)};
    r->cache[i] = (sf_fit_cache){shape[i], whole.lookups ? (double)misses[i] / (double)whole.lookups : 0,
                                 energy_of(s, scene, &sum->counts, s->check_end - s->rank_end, &f, &shape[i])};
    least = r->cache[i].energy_fj < least ? r->cache[i].energy_fj : least;
  }
  for (r->cache_chosen = 0; (double)r->cache[r->cache_chosen].energy_fj > NEARLY * (double)least;) r->cache_chosen++;
  return sf_ok();
}

static sf_status describe_both(const search *s, const fx_scene *fitted, const sf_fit_sum *sum, sf_fit_report *report)
{
  SF_TRY(describe(s, s->job->candidate[0], &s->job->widths[0], &s->reference, &report->before));
  SF_TRY(describe(s, fitted, s->widths, sum, &report->after));
  return choose_cache(s, fitted, sum, report);
}

static sf_status finish(search *s, const sf_trim *exact, fx_scene *fitted, sf_fit_report *report)
{
  const uint64_t checked = s->check_end - s->rank_end;
  sf_fit_sum sum;
  SF_TRY(sf_trim_apply(s->scene, &s->trim, &s->use, s->job->name, fitted));
  sf_status status = sf_grid_zero_unread(fitted) < 0
                         ? sf_fail(SF_E_MEMORY, "%s: no memory to look for unread entries", s->job->name)
                         : fx_scene_check(fitted, s->job->name);
  if (status.code == SF_OK) status = measure(s, fitted, s->job->rays, s->rank_end, s->check_end, NULL, &sum);
  if (status.code == SF_OK) status = describe_both(s, fitted, &sum, report);
  if (status.code != SF_OK) {
    fx_scene_free(fitted);
    return status;
  }
  report->observed = s->job->rays->count, report->pixels = s->job->rays->pixels;
  report->first_checked = s->rank_end, report->checked = checked;
  report->bound_db = s->job->loss_db;
  report->loss_db = 10 * log10(ratio(sum.error, s->reference.error));
  count_dropped(s, exact, report);
  return sf_ok();
}

static uint64_t larger(uint64_t a, uint64_t b)
{
  return a > b ? a : b;
}

/* Rays that rank and check tell nothing about places, so that what leaving places out loses is measured on them. */
static sf_status observe(search *s)
{
  const uint64_t count = s->job->rays->count;
  SF_TRY(sf_trim_use_create(&s->use, s->scene));
  for (uint64_t begin = 0; begin < count;) {
    const uint64_t stop = begin < s->check_end ? s->check_end : count;
    const uint64_t end = begin + CHUNK < stop ? begin + CHUNK : stop;
    SF_TRY(tick(s, "observing ray", (int)begin, (int)count));
    SF_TRY(sf_fit_observe(s->scene, s->job->rays, begin, end, begin >= s->check_end, &s->use));
    begin = end;
  }
  return sf_ok();
}

static sf_status run(search *s, fx_scene *fitted, sf_fit_report *report)
{
  SF_TRY(choose_candidate(s, &report->chosen));
  if (!s->reference.counts.samples)
    return sf_fail(SF_E_RANGE, "%s: no ray of the data set meets an occupied cell: is it another scene's?",
                   s->job->name);
  SF_TRY(observe(s));
  sf_trim_all(s->scene, &s->trim);
  sf_trim_exact(s->scene, &s->use, &s->trim);
  const sf_trim exact = s->trim;
  if (s->job->loss_db > 0) SF_TRY(search_rounds(s));
  return finish(s, &exact, fitted, report);
}

sf_status sf_fit(fx_scene *fitted, const sf_fit_job *job, sf_fit_report *report)
{
  const uint64_t count = job->rays->count;
  memset(fitted, 0, sizeof *fitted);
  memset(report, 0, sizeof *report);
  SF_TRY(fx_scene_need_grid(job->candidate[0], job->name, "fit"));
  if (!(job->loss_db >= 0 && job->loss_db <= 100))
    return sf_fail(SF_E_RANGE, "%s: a loss of %g dB was asked for, expected 0..100", job->name, job->loss_db);
  if (count < 2 * RANK_MIN)
    return sf_fail(SF_E_RANGE, "%s: %llu rays to fit on, expected at least %d", job->name, (unsigned long long)count,
                   2 * RANK_MIN);
  search *s = calloc(1, sizeof *s);
  if (!s) return sf_fail(SF_E_MEMORY, "%s: no memory to fit", job->name);
  s->job = job;
  s->rank = *job->rays;
  s->rank_end = larger(count / RANK_SHARE, RANK_MIN);
  s->check_end = s->rank_end + larger(count / CHECK_SHARE, count / 4 < CHECK_MIN ? count / 4 : CHECK_MIN);
  s->rank.target = s->picture = calloc(s->rank_end, 3 * sizeof *s->picture);
  const sf_status status =
      s->picture ? run(s, fitted, report) : sf_fail(SF_E_MEMORY, "%s: no memory to fit", job->name);
  sf_trim_use_free(&s->use);
  free(s->picture), free(s);
  return status;
}
