/* Forward, losses and backward of one iteration's samples: bundles of rays in cache, groups added in order. */
#include "train/internal.h"
#include <omp.h>
#include <string.h>

static void ray_in(const sf_loss_plan *p, const sf_ray *ray, sf_worker *w)
{
  for (int t = 0; t < p->steps; t++) {
    if (!sf_loss_needs(p, t + 1)) continue;
    for (int s = 0; s < ray->count; s++) {
      const sf_block *b = &w->block[(ray->first + s) / SF_BLOCK];
      const int lane = (ray->first + s) % SF_BLOCK;
      w->ray.sigma[t][s] = b->sigma[t][lane];
      for (int c = 0; c < 3; c++) w->ray.colour[t][3 * s + c] = b->colour[t][c * SF_BLOCK + lane];
    }
  }
}

static void ray_out(const sf_loss_plan *p, const sf_ray *ray, sf_worker *w)
{
  for (int t = 0; t < p->steps; t++) {
    if (!sf_loss_needs(p, t + 1)) continue;
    for (int s = 0; s < ray->count; s++) {
      const int block = (ray->first + s) / SF_BLOCK, lane = (ray->first + s) % SF_BLOCK;
      w->dsigma[(block * SF_T_MAX + t) * SF_BLOCK + lane] = w->ray.dsigma[t][s];
      for (int c = 0; c < 3; c++)
        w->dcolour[((block * SF_T_MAX + t) * 3 + c) * SF_BLOCK + lane] = w->ray.dcolour[t][3 * s + c];
    }
  }
}

int sf_count_spikes(const float *membrane, int rows, int lanes, float theta)
{
  int count = 0;
  for (int r = 0; r < rows; r++)
    for (int l = 0; l < lanes; l++) count += membrane[r * SF_BLOCK + l] >= theta;
  return count;
}

/* Of the first block of a bundle, whose first `lanes` lanes hold samples. */
static void count_spikes(const sf_trainer *t, int steps, const sf_block *b, int lanes, sf_group *g)
{
  const sf_config *c = &t->model.config;
  for (int s = 0; s < steps; s++) {
    g->spikes[0] += sf_count_spikes(b->m1[s], c->hidden, lanes, c->theta[0]);
    g->spikes[1] += sf_count_spikes(b->m3[s], c->hidden, lanes, c->theta[1]);
    g->spikes[2] += sf_count_spikes(b->m4[s], c->hidden, lanes, c->theta[2]);
  }
  g->neurons += (double)steps * c->hidden * lanes;
}

static void load_block(const sf_trainer *t, const sf_bundle *bundle, int index, sf_block *b)
{
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  memcpy(b->f, t->batch.f + (size_t)(bundle->block + index) * plane, plane * sizeof(float));
}

/* Spherical harmonics of every lane, zeros in those after the last sample; how many lanes hold samples. */
static int load_directions(const sf_trainer *t, const sf_bundle *bundle, sf_worker *w)
{
  const sf_batch *batch = &t->batch;
  int lane = 0;
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    const sf_ray *ray = &batch->ray[r];
    float sh[SF_DIR_FEATURES];
    sf_sh4(ray->direction, sh);
    sf_scales_round_direction(&t->model.scales, sh);
    for (lane = ray->first; lane < ray->first + ray->count; lane++)
      for (int i = 0; i < SF_DIR_FEATURES; i++) w->block[lane / SF_BLOCK].sh[i * SF_BLOCK + lane % SF_BLOCK] = sh[i];
  }
  for (int l = lane; l < bundle->blocks * SF_BLOCK; l++)
    for (int i = 0; i < SF_DIR_FEATURES; i++) w->block[l / SF_BLOCK].sh[i * SF_BLOCK + l % SF_BLOCK] = 0;
  return lane;
}

static void run_bundle(const sf_trainer *t, const sf_loss_plan *p, const sf_net_words *net, const sf_bundle *bundle,
                       sf_worker *w, sf_group *g)
{
  const sf_batch *batch = &t->batch;
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  const int lanes = load_directions(t, bundle, w);
  for (int b = 0; b < bundle->blocks; b++) {
    load_block(t, bundle, b, &w->block[b]);
    t->kernels->forward(net, &w->block[b], p->steps, p->steps, w->scratch);
  }
  memset(w->dsigma, 0, (size_t)bundle->blocks * SF_T_MAX * SF_BLOCK * sizeof(float));
  memset(w->dcolour, 0, (size_t)bundle->blocks * SF_T_MAX * 3 * SF_BLOCK * sizeof(float));
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    ray_in(p, &batch->ray[r], w);
    sf_loss_ray(p, &batch->ray[r], batch->delta + batch->ray[r].lane, &w->ray, &g->sums);
    ray_out(p, &batch->ray[r], w);
  }
  count_spikes(t, p->steps, &w->block[0], lanes < SF_BLOCK ? lanes : SF_BLOCK, g);
  for (int b = 0; b < bundle->blocks; b++)
    t->kernels->backward(net, &w->block[b], p->steps, w->dsigma + (size_t)b * SF_T_MAX * SF_BLOCK,
                         w->dcolour + (size_t)b * SF_T_MAX * 3 * SF_BLOCK,
                         batch->df + (size_t)(bundle->block + b) * plane, g->grad, w->scratch);
}

static void run_bundles(sf_trainer *t, const sf_loss_plan *p)
{
#pragma omp parallel for schedule(dynamic, 1) num_threads(t->workers)
  for (int part = 0; part < GROUPS; part++) {
    sf_group *g = &t->group[part];
    sf_net_grad *grad = g->grad;
    *g = (sf_group){.grad = grad};
    memset(grad, 0, sizeof *grad);
    for (int b = t->batch.bundles * part / GROUPS; b < t->batch.bundles * (part + 1) / GROUPS; b++)
      run_bundle(t, p, t->net, &t->batch.bundle[b], &t->worker[omp_get_thread_num()], g);
  }
}

static void encode(sf_trainer *t)
{
  const int levels = t->model.config.levels, parts = 8;
  const float *table = sf_model_param(&t->model, SF_P_GRID);
#pragma omp parallel for schedule(dynamic, 1) collapse(2)
  for (int level = 0; level < levels; level++)
    for (int part = 0; part < parts; part++)
      for (int b = t->batch.blocks * part / parts; b < t->batch.blocks * (part + 1) / parts; b++)
        t->kernels->grid_forward(&t->model.level[level], table, t->batch.x + (size_t)b * 3 * SF_BLOCK,
                                 t->batch.f + ((size_t)b * levels + level) * 2 * SF_BLOCK);
}

/* One thread per level, samples in order: no atomics, and the sum does not depend on the threads. Adam follows while
 * the level's gradient is in the cache. */
void sf_gradient_grid(sf_trainer *t, const sf_adam *adam)
{
  const int levels = t->model.config.levels;
  const size_t table = t->model.param[SF_P_GRID].offset;
#pragma omp parallel for schedule(dynamic, 1)
  for (int level = levels - 1; level >= 0; level--) {
    const sf_grid_level *l = &t->model.level[level];
    const size_t first = table + 2 * l->offset;
    for (int b = 0; b < t->batch.blocks; b++)
      t->kernels->grid_backward(l, t->batch.x + (size_t)b * 3 * SF_BLOCK,
                                t->batch.df + ((size_t)b * levels + level) * 2 * SF_BLOCK, t->grad + table);
    t->kernels->adam(adam, (size_t)2 * l->entries, t->model.value + first, t->grad + first, t->moment1 + first,
                     t->moment2 + first);
  }
}

void sf_matrix_add(float *to, const float *from, int rows, int columns, int ld)
{
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++) to[r * columns + c] += from[r * ld + c];
}

/* The losses as means over rays; the leaks' gradients carry that factor already. */
void sf_sums_add(sf_loss_sums *to, const sf_loss_sums *x, double mean)
{
  for (int t = 0; t < SF_T_MAX; t++) to->prefix[t] += mean * x->prefix[t];
  to->regular += mean * x->regular;
  to->extra_floor += mean * x->extra_floor;
  to->extra_ceil += mean * x->extra_ceil;
  to->distill += mean * x->distill;
  to->g_sigma_leak += x->g_sigma_leak;
  to->g_colour_leak += x->g_colour_leak;
}

void sf_groups_add(float *const part[GROUPS], size_t n)
{
  const size_t chunk = 4096;
#pragma omp parallel for schedule(static)
  for (size_t first = 0; first < n; first += chunk)
    for (int g = 1; g < GROUPS; g++)
      for (size_t i = first; i < n && i < first + chunk; i++) part[0][i] += part[g][i];
}

/* The groups' sum into the flat gradient. */
static void reduce(sf_trainer *t, double mean, sf_loss_sums *sums, double firing[3])
{
  const sf_model *m = &t->model;
  const int hidden = m->config.hidden, features = 2 * m->config.levels;
  double spikes[3] = {0}, neurons = 0;
  float *at[SF_P_COUNT], *part[GROUPS];
  for (int g = 0; g < GROUPS; g++) part[g] = (float *)t->group[g].grad;
  sf_groups_add(part, sizeof(sf_net_grad) / sizeof(float));
  const sf_net_grad *grad = t->group[0].grad;
  for (int i = 0; i < SF_P_COUNT; i++) at[i] = t->grad + m->param[i].offset;
  sf_matrix_add(at[SF_P_D1], grad->w1, hidden, features, (features + 15) / 16 * 16);
  sf_matrix_add(at[SF_P_D2], grad->w2, SF_DENSITY_OUT, hidden, hidden);
  for (int r = 0; r < hidden; r++) {
    float *row = at[SF_P_C1] + (size_t)r * (SF_DIR_FEATURES + SF_GEO_FEATURES);
    sf_matrix_add(row, grad->w3 + 32 * r, 1, SF_DIR_FEATURES, 32);
    sf_matrix_add(row + SF_DIR_FEATURES, grad->w3 + 32 * r + SF_DIR_FEATURES + 1, 1, SF_GEO_FEATURES, 32);
  }
  sf_matrix_add(at[SF_P_C2], grad->w4, hidden, hidden, hidden);
  for (int r = 0; r < hidden; r++)
    for (int c = 0; c < hidden; c++) at[SF_P_C2][r * hidden + c] += grad->w4t[c * hidden + r];
  sf_matrix_add(at[SF_P_C3], grad->w5, 3, hidden, hidden);
  sf_matrix_add(at[SF_P_LEAK], grad->leak, 1, SF_LAYERS, SF_LAYERS);
  for (int n = 0; n < GROUPS; n++) {
    const sf_group *g = &t->group[n];
    sf_sums_add(sums, &g->sums, mean);
    for (int l = 0; l < 3; l++) spikes[l] += g->spikes[l];
    neurons += g->neurons;
  }
  for (int l = 0; l < 3; l++) firing[l] = neurons > 0 ? spikes[l] / neurons : 0;
}

void sf_gradient_nets(sf_trainer *t, const sf_loss_plan *plan, sf_loss_sums *mean, double firing[3])
{
  encode(t);
  sf_train_prepare(t);
  sf_batch_compact(t, plan);
  sf_batch_adapt(t);
  run_bundles(t, plan);
  reduce(t, plan->inverse_rays, mean, firing);
}
