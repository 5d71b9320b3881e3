/* A fit from its candidates to its report: search.c has the search, cuts.c what can go. */
#include "src/fit/internal.h"
#include <stdlib.h>
#include <string.h>

enum { RANK_SHARE = 256, RANK_MIN = 128, CHECK_SHARE = 4, CHECK_MIN = 2048, CHUNK = 8192 };

/* ---- report ---- */

static void count_dropped(const sf_fit_search *s, const sf_trim *exact, sf_fit_report *r)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    const int n = s->scene->net.layer[l].n_out, after = sf_count_kept(exact->neuron[l], n);
    r->silent[l] = n - after;
    r->dropped[l] = after - sf_count_kept(s->trim.neuron[l], n);
  }
  const int levels = s->scene->grid.levels, left = sf_count_kept(exact->level, levels);
  r->idle_levels = levels - left;
  r->dropped_levels = left - sf_count_kept(s->trim.level, levels);
  for (int l = 0; l < levels; l++) r->smaller_tables += s->trim.level[l] && s->trim.log2_size[l] >= 0;
  for (int which = 0; which < SF_FACTORS; which++)
    for (int pair = 0; pair < FX_PAIRS; pair++) {
      const sf_trim_planes *first = &exact->planes, *last = &s->trim.planes;
      const fx_tensorf *field = &s->scene->tensorf;
      const int all = (which == SF_OF_DENSITY ? &field->density : &field->appearance)->components[pair];
      const int useful = sf_count_kept(first->component[which][pair], all);
      r->idle_components[which] += all - useful;
      r->dropped_components[which] += useful - sf_count_kept(last->component[which][pair], all);
    }
}

/* ---- all of it ---- */

static sf_status choose_candidate(sf_fit_search *s, int *chosen)
{
  const sf_fit_job *job = s->job;
  *chosen = 0;
  s->scene = job->candidate[0], s->widths = &job->widths[0];
  SF_TRY(sf_fit_search_measure(s, s->scene, job->rays, s->rank_end, s->check_end, NULL, &s->reference));
  for (int i = 1; i < job->candidates && job->loss_db > 0; i++) {
    sf_fit_sum sum;
    SF_TRY(sf_fit_search_tick(s, "widths", i, job->candidates));
    SF_TRY(sf_fit_search_measure(s, job->candidate[i], job->rays, s->rank_end, s->check_end, NULL, &sum));
    if ((double)sum.error > sf_fit_search_allowed(s, 0.5)) break;
    s->scene = job->candidate[i], s->widths = &job->widths[i], *chosen = i;
  }
  return sf_ok();
}

static double per_sample(uint64_t n, const fx_counts *counts)
{
  return counts->samples ? (double)n / (double)counts->samples : 0;
}

static sf_status describe(const sf_fit_search *s, const fx_scene *scene, const sf_quant_widths *widths,
                          const sf_fit_sum *sum, sf_fit_state *state)
{
  const uint64_t checked = s->check_end - s->rank_end;
  sf_field_cost f;
  sf_fit_field whole;
  SF_TRY(sf_fit_search_field(s, scene, &f, &whole));
  sf_fit_describe(scene, widths, sum, checked, state);
  const double bytes = per_sample(whole.counts.grid_bytes, &whole.counts);
  state->lookups = f.lookups * bytes, state->misses = f.misses * bytes;
  state->energy_fj = sf_fit_search_energy(s, scene, &sum->counts, checked, &f, &sf_cache_built);
  return sf_ok();
}

/* A cache is as good as another that saves no more than this. */
static const double NEARLY = 1.01;

/* The cache that the fitted scene needs: the smallest that is nearly as good as the best. A small one misses more, a
 * large one costs more per look-up. */
static sf_status choose_cache(const sf_fit_search *s, const fx_scene *scene, const sf_fit_sum *sum, sf_fit_report *r)
{
  fx_cache_shape shape[SF_FIT_CACHES];
  sf_fit_field whole;
  uint64_t misses[SF_FIT_CACHES];
  for (int i = 0; i < SF_FIT_CACHES; i++) shape[i] = (fx_cache_shape){FX_CACHE_BYTES_MIN << i, sf_cache_built.ways};
  SF_TRY(sf_fit_search_tick(s, "cache", 0, SF_FIT_CACHES));
  SF_TRY(sf_fit_measure_field(scene, s->job->tiles, shape, SF_FIT_CACHES, &whole, misses));
  uint64_t least = UINT64_MAX;
  for (int i = 0; i < SF_FIT_CACHES; i++) {
    const sf_field_cost f = sf_field_cost_of(&whole, misses[i]);
    r->cache[i] =
        (sf_fit_cache){shape[i], whole.lookups ? (double)misses[i] / (double)whole.lookups : 0,
                       sf_fit_search_energy(s, scene, &sum->counts, s->check_end - s->rank_end, &f, &shape[i])};
    least = r->cache[i].energy_fj < least ? r->cache[i].energy_fj : least;
  }
  for (r->cache_chosen = 0; (double)r->cache[r->cache_chosen].energy_fj > NEARLY * (double)least;) r->cache_chosen++;
  return sf_ok();
}

static sf_status describe_both(const sf_fit_search *s, const fx_scene *fitted, const sf_fit_sum *sum,
                               sf_fit_report *report)
{
  SF_TRY(describe(s, s->job->candidate[0], &s->job->widths[0], &s->reference, &report->before));
  SF_TRY(describe(s, fitted, s->widths, sum, &report->after));
  return choose_cache(s, fitted, sum, report);
}

static sf_status finish(sf_fit_search *s, const sf_trim *exact, fx_scene *fitted, sf_fit_report *report)
{
  const uint64_t checked = s->check_end - s->rank_end;
  sf_fit_sum sum;
  SF_TRY(sf_trim_apply(s->scene, &s->trim, &s->use, s->job->name, fitted));
  sf_status status = sf_trim_zero_unread(fitted, s->job->name);
  if (status.code == SF_OK) status = fx_scene_check(fitted, s->job->name);
  if (status.code == SF_OK)
    status = sf_fit_search_measure(s, fitted, s->job->rays, s->rank_end, s->check_end, NULL, &sum);
  if (status.code == SF_OK) status = describe_both(s, fitted, &sum, report);
  if (status.code != SF_OK) {
    fx_scene_free(fitted);
    return status;
  }
  report->observed = s->job->rays->count, report->pixels = s->job->rays->pixels;
  report->first_checked = s->rank_end, report->checked = checked;
  report->bound_db = s->job->loss_db;
  report->loss_db = 10 * log10(sf_fit_ratio(sum.error, s->reference.error));
  count_dropped(s, exact, report);
  return sf_ok();
}

static uint64_t larger(uint64_t a, uint64_t b)
{
  return a > b ? a : b;
}

/* Rays that rank and check tell nothing about places, so that what leaving places out loses is measured on them. */
static sf_status observe(sf_fit_search *s)
{
  const uint64_t count = s->job->rays->count;
  SF_TRY(sf_trim_use_create(&s->use, s->scene));
  for (uint64_t begin = 0; begin < count;) {
    const uint64_t stop = begin < s->check_end ? s->check_end : count;
    const uint64_t end = begin + CHUNK < stop ? begin + CHUNK : stop;
    SF_TRY(sf_fit_search_tick(s, "observing ray", (int)begin, (int)count));
    SF_TRY(sf_fit_observe(s->scene, s->job->rays, begin, end, begin >= s->check_end, &s->use));
    begin = end;
  }
  return sf_ok();
}

static sf_status run(sf_fit_search *s, fx_scene *fitted, sf_fit_report *report)
{
  SF_TRY(choose_candidate(s, &report->chosen));
  if (!s->reference.counts.samples)
    return sf_fail(SF_E_RANGE, "%s: no ray of the data set meets an occupied cell: is it another scene's?",
                   s->job->name);
  SF_TRY(observe(s));
  sf_trim_all(s->scene, &s->trim);
  sf_trim_exact(s->scene, &s->use, &s->trim);
  const sf_trim exact = s->trim;
  if (s->job->loss_db > 0) SF_TRY(sf_fit_search_rounds(s));
  return finish(s, &exact, fitted, report);
}

sf_status sf_fit(fx_scene *fitted, const sf_fit_job *job, sf_fit_report *report)
{
  const uint64_t count = job->rays->count;
  memset(fitted, 0, sizeof *fitted);
  memset(report, 0, sizeof *report);
  if (!(job->loss_db >= 0 && job->loss_db <= 100))
    return sf_fail(SF_E_RANGE, "%s: a loss of %g dB was asked for, expected 0..100", job->name, job->loss_db);
  if (count < 2 * RANK_MIN)
    return sf_fail(SF_E_RANGE, "%s: %llu rays to fit on, expected at least %d", job->name, (unsigned long long)count,
                   2 * RANK_MIN);
  sf_fit_search *s = calloc(1, sizeof *s);
  if (!s) return sf_fail(SF_E_MEMORY, "%s: no memory to fit", job->name);
  s->job = job;
  s->rank = *job->rays;
  s->rank_end = larger(count / RANK_SHARE, RANK_MIN);
  s->check_end = s->rank_end + larger(count / CHECK_SHARE, count / 4 < CHECK_MIN ? count / 4 : CHECK_MIN);
  s->rank.target = s->picture = calloc(s->rank_end, 3 * sizeof *s->picture);
  const sf_status status =
      s->picture ? run(s, fitted, report) : sf_fail(SF_E_MEMORY, "%s: no memory to fit", job->name);
  sf_trim_use_free(&s->use);
  free(s->cuts), free(s->picture), free(s);
  return status;
}
