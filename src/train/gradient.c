/* One iteration's samples: bundles of rays in groups, added in order. What a bundle computes is the backbone's. */
#include "field/field.h"
#include "snn/plif.h"
#include "train/internal.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

sf_status sf_workers_create(sf_trainer *t)
{
  const sf_backbone *b = t->backbone;
  const size_t plane = (size_t)BUNDLE_BLOCKS * SF_T_MAX * SF_BLOCK * sizeof(float);
  bool ok = (t->worker = calloc((size_t)t->workers, sizeof *t->worker)) != NULL;
  for (int i = 0; ok && i < t->workers; i++) {
    sf_worker *w = &t->worker[i];
    w->block = sf_aligned_alloc(BUNDLE_BLOCKS * b->block_bytes);
    w->scratch = sf_aligned_alloc(sizeof *w->scratch);
    w->dsigma = sf_aligned_alloc(plane);
    w->dcolour = sf_aligned_alloc(3 * plane);
    SF_TRY(sf_ray_work_create(&w->ray, b->ray_samples));
    ok = w->block && w->scratch && w->dsigma && w->dcolour;
  }
  const int ranks = sf_ranks_size(t->options.ranks);
  t->edge = calloc((size_t)ranks + 1, sizeof *t->edge);
  t->in_edge = calloc((size_t)ranks + 1, sizeof *t->in_edge);
  t->grads = sf_aligned_alloc((ranks > 1 ? 3 : 1) * GROUPS * sf_group_floats(b) * sizeof *t->grads);
  ok = ok && t->edge && t->in_edge && t->grads;
  for (int g = 0; ok && g < GROUPS; g++) t->group[g].grad = t->grads + (size_t)g * sf_group_floats(b);
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "train: no memory for %d threads", t->workers);
}

void sf_workers_free(sf_trainer *t)
{
  for (int i = 0; t->worker && i < t->workers; i++) {
    free(t->worker[i].block);
    free(t->worker[i].scratch);
    free(t->worker[i].ray.memory);
    free(t->worker[i].dsigma);
    free(t->worker[i].dcolour);
  }
  free(t->grads);
  free(t->edge);
  free(t->in_edge);
  free(t->worker);
}

/* Membranes [rows][SF_BLOCK] at or above theta in the first `lanes` lanes. */
static int at_threshold(const float *membrane, int rows, int lanes, float theta)
{
  int count = 0;
  for (int r = 0; r < rows; r++)
    for (int l = 0; l < lanes; l++) count += membrane[r * SF_BLOCK + l] >= theta;
  return count;
}

/* Neurons of spiking layer 0..2 that reached theta at any step. */
static int at_any_step(const sf_block *b, int layer, int steps, int rows, int lanes, float theta)
{
  int count = 0;
  for (int r = 0; r < rows; r++) {
    float most[SF_BLOCK];
    for (int l = 0; l < SF_BLOCK; l++) most[l] = -INFINITY;
    for (int s = 0; s < steps; s++) {
      const float *m = (layer == 0 ? b->m1[s] : layer == 1 ? b->m3[s] : b->m4[s]) + r * SF_BLOCK;
      for (int l = 0; l < SF_BLOCK; l++) most[l] = most[l] > m[l] ? most[l] : m[l];
    }
    for (int l = 0; l < lanes; l++) count += most[l] >= theta;
  }
  return count;
}

/* Membranes of one step along rays, [lanes][hidden]. */
static int at_threshold_along(const float *membrane, int count, float theta)
{
  int spikes = 0;
  for (int i = 0; i < count; i++) spikes += membrane[i] >= theta;
  return spikes;
}

static void count_along(const sf_config *c, int first, const sf_block *b, int lanes, sf_group *g)
{
  const float *const membrane[3] = {b->m1[0], b->m3[0], b->m4[0]};
  for (int l = first; l < 3; l++) {
    const int spikes = at_threshold_along(membrane[l], lanes * c->hidden, c->theta[l]);
    g->spikes[l] += spikes, g->fired[l] += spikes;
  }
}

/* Radix mode: a layer's spikes of all steps, from its current. */
static void count_digits(const float *current, int rows, int lanes, int steps, float theta, double *spikes,
                         double *fired)
{
  long all = 0, any = 0;
  for (int r = 0; r < rows; r++) {
    float v[SF_BLOCK];
    int count[SF_BLOCK] = {0};
    memcpy(v, current + r * SF_BLOCK, sizeof v);
    for (int s = 0; s < steps; s++)
      for (int l = 0; l < SF_BLOCK; l++) { /* without branches, so that compilers make vectors of it */
        const int spike = v[l] >= theta;
        count[l] += spike;
        v[l] = sf_plif_charge(SF_RADIX, s + 1, 0, v[l] - (float)spike * theta, 0);
      }
    for (int l = 0; l < lanes; l++) all += count[l], any += count[l] > 0;
  }
  *spikes += (double)all;
  *fired += (double)any;
}

static void count_radix(const sf_config *c, int first, int steps, const sf_block *b, int lanes, sf_group *g)
{
  const float *const current[3] = {b->m1[0], b->m3[steps - 1], b->m4[steps - 1]};
  for (int l = first; l < 3; l++)
    count_digits(current[l], c->hidden, lanes, steps, c->theta[l], &g->spikes[l], &g->fired[l]);
}

int sf_mark_lanes(const sf_trainer *t, const sf_loss_plan *p, const sf_bundle *bundle, sf_worker *w)
{
  const sf_ray *ray = t->batch.ray + bundle->ray;
  const int lanes = bundle->rays ? ray[bundle->rays - 1].first + ray[bundle->rays - 1].count : 0;
  for (int b = 0; b < bundle->blocks; b++) {
    sf_block *block = (sf_block *)((char *)w->block + (size_t)b * t->backbone->block_bytes); /* of a decoder's: first */
    block->lanes = sf_block_lanes(lanes, b);
    block->first = 0;
    block->from = sf_loss_from(p);
    if (!t->model.config.along) continue;
    for (int l = 0; l < SF_BLOCK; l++) block->state[l] = &w->state;
    for (int r = 0; r < bundle->rays; r++)
      if (ray[r].count && ray[r].first / SF_BLOCK == b) block->first |= (uint64_t)1 << ray[r].first % SF_BLOCK;
  }
  return lanes;
}

void sf_count_spikes(const sf_trainer *t, int first, int steps, const sf_block *b, int lanes, sf_group *g)
{
  const sf_config *c = &t->model.config;
  const bool radix = c->mode == SF_RADIX && c->net == SF_NET_SNN;
  if (c->along) count_along(c, first, b, lanes, g);
  if (radix) count_radix(c, first, steps, b, lanes, g);
  for (int s = 0; s < steps && !c->along && !radix; s++) {
    const float *const membrane[3] = {b->m1[s], b->m3[s], b->m4[s]};
    for (int l = first; l < 3; l++) g->spikes[l] += at_threshold(membrane[l], c->hidden, lanes, c->theta[l]);
  }
  for (int l = first; l < 3 && !c->along && !radix; l++)
    g->fired[l] += at_any_step(b, l, steps, c->hidden, lanes, c->theta[l]);
  g->neurons += (double)steps * c->hidden * lanes;
  g->lanes += lanes;
}

static void run_bundles(sf_trainer *t, const sf_loss_plan *p)
{
  int first, end;
  sf_share_parts(t, &first, &end);
#pragma omp parallel for schedule(dynamic, 1) num_threads(t->workers)
  for (int part = first; part < end; part++) {
    sf_group *g = &t->group[part];
    *g = (sf_group){.grad = g->grad};
    memset(g->grad, 0, t->backbone->grad_bytes);
    for (int b = t->batch.bundles * part / GROUPS; b < t->batch.bundles * (part + 1) / GROUPS; b++)
      t->backbone->bundle(t, p, &t->batch.bundle[b], &t->worker[omp_get_thread_num()], g);
  }
}

void sf_matrix_add(float *to, const float *from, int rows, int columns, int ld)
{
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++) to[r * columns + c] += from[r * ld + c];
}

void sf_matrix_add_transposed(float *to, const float *from, int rows, int columns)
{
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++) to[r * columns + c] += from[c * rows + r];
}

/* The losses as means over rays; the leaks' gradients carry that factor already. */
static void add_sums(sf_loss_sums *to, const sf_loss_sums *x, double mean)
{
  for (int t = 0; t < SF_T_MAX; t++) to->prefix[t] += mean * x->prefix[t];
  to->regular += mean * x->regular;
  to->distortion += mean * x->distortion;
  to->tail += mean * x->tail;
  to->extra_floor += mean * x->extra_floor;
  to->extra_ceil += mean * x->extra_ceil;
  to->distill += mean * x->distill;
  to->g_sigma_leak += x->g_sigma_leak;
  to->g_colour_leak += x->g_colour_leak;
}

/* part[GROUPS][n]: adds the others to the first, in order. */
static void add_groups(float *const part[GROUPS], size_t n)
{
  const size_t chunk = 4096;
#pragma omp parallel for schedule(static)
  for (size_t first = 0; first < n; first += chunk)
    for (int g = 1; g < GROUPS; g++)
      for (size_t i = first; i < n && i < first + chunk; i++) part[0][i] += part[g][i];
}

sf_status sf_gradient_run(sf_trainer *t, const sf_loss_plan *plan, sf_loss_sums *mean, double firing[3])
{
  double spikes[3] = {0}, fired[3] = {0}, neurons = 0, lanes = 0;
  float *part[GROUPS];
  SF_TRY(t->backbone->prepare(t, plan));
  sf_charge_begin(t, plan);
  run_bundles(t, plan);
  SF_TRY(sf_share_groups(t));
  SF_TRY(t->backbone->share(t));
  for (int g = 0; g < GROUPS; g++) part[g] = t->group[g].grad;
  if (sf_ranks_size(t->options.ranks) == 1) add_groups(part, t->backbone->grad_bytes / sizeof(float));
  t->backbone->collect(t, part[0]);
  for (int n = 0; n < GROUPS; n++) {
    const sf_group *g = &t->group[n];
    add_sums(mean, &g->sums, plan->inverse_rays);
    for (int l = 0; l < 3; l++) spikes[l] += g->spikes[l], fired[l] += g->fired[l];
    neurons += g->neurons, lanes += g->lanes;
  }
  const double counted = lanes * t->model.config.hidden;
  for (int l = 0; l < 3; l++) {
    firing[l] = neurons > 0 ? spikes[l] / neurons : 0;
    fired[l] = counted > 0 ? fired[l] / counted : 0;
  }
  sf_charge_measured(t, fired);
  return sf_ok();
}

double sf_gradient_leaks(sf_trainer *t, const sf_loss_plan *p, const sf_loss_sums *sums)
{
  if (p->extra == 0) return 0;
  static const int integrator[2] = {1, 4}, spiking[3] = {0, 2, 3};
  const double from_tail[2] = {sums->g_sigma_leak, sums->g_colour_leak};
  float *leak = sf_model_param(&t->model, SF_P_LEAK), *grad = t->grad + (leak - t->model.value);
  double value = 0;
  for (int i = 0; i < 2; i++) {
    const float k = sf_sigmoid(leak[integrator[i]]);
    grad[integrator[i]] += (float)(from_tail[i] * k * (1 - k));
  }
  for (int i = 0; i < 3; i++) {
    if (!sf_model_has(&t->model, sf_layer_weights[spiking[i]])) continue;
    const double inverse = exp(-(double)leak[spiking[i]]), tau = fmin(1 + inverse, 30.0); /* e^tau stays finite */
    value += exp(tau);
    grad[spiking[i]] -= (float)(p->extra * exp(tau) * inverse);
  }
  return value;
}
