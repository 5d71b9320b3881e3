/* The hash-grid backbone as the trainer sees it. */
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { OCCUPANCY_EVERY = 16 };

static sf_status create(sf_trainer *t)
{
  t->rays = 1024;
  t->stride = sf_tuning(t) ? 1 : 4;
  t->density = sf_aligned_alloc(sf_config_cells(&t->model.config) * sizeof(float));
  if (!t->density) return sf_fail(SF_E_MEMORY, "train: no memory for the occupancy grid");
  t->net = sf_aligned_alloc(sizeof *t->net);
  if (!t->net) return sf_fail(SF_E_MEMORY, "train: no memory for the nets");
  return sf_batch_create(&t->batch, t->options.samples, 2 * t->model.config.levels);
}

static void destroy(sf_trainer *t)
{
  free(t->net);
  free(t->density);
}

static void init(sf_trainer *t)
{
  sf_init_uniform(t, SF_P_GRID, 1e-4f, RNG_INIT, 0);
}

static sf_status begin(sf_trainer *t, int steps)
{
  return t->iteration % OCCUPANCY_EVERY || sf_tuning(t) ? sf_ok() : sf_occupancy_update(t, steps);
}

/* ---- the samples through both nets, forward and backward ---- */

static void ray_in(const sf_loss_plan *p, const sf_ray *ray, sf_worker *w)
{
  for (int t = 0; t < p->steps; t++) {
    if (!sf_loss_needs(p, t + 1)) continue;
    for (int s = 0; s < ray->count; s++) {
      const sf_block *b = (const sf_block *)w->block + (ray->first + s) / SF_BLOCK;
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

static void load_block(const sf_trainer *t, const sf_bundle *bundle, int index, sf_block *b)
{
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  memcpy(b->f, t->batch.f + (size_t)(bundle->block + index) * plane, plane * sizeof(float));
}

/* Spherical harmonics of every lane, zeros in those after the last sample. */
static void load_directions(const sf_trainer *t, const sf_bundle *bundle, int lanes, sf_worker *w)
{
  const sf_batch *batch = &t->batch;
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    const sf_ray *ray = &batch->ray[r];
    float sh[SF_DIR_FEATURES];
    sf_sh4(ray->direction, sh);
    sf_scales_round_direction(&t->model.scales, sh, SF_DIR_FEATURES);
    for (int lane = ray->first; lane < ray->first + ray->count; lane++)
      for (int i = 0; i < SF_DIR_FEATURES; i++)
        ((sf_block *)w->block)[lane / SF_BLOCK].sh[i * SF_BLOCK + lane % SF_BLOCK] = sh[i];
  }
  for (int l = lanes; l < bundle->blocks * SF_BLOCK; l++)
    for (int i = 0; i < SF_DIR_FEATURES; i++) ((sf_block *)w->block)[l / SF_BLOCK].sh[i * SF_BLOCK + l % SF_BLOCK] = 0;
}

static void bundle_gradient(sf_trainer *t, const sf_loss_plan *p, const sf_bundle *bundle, sf_worker *w, sf_group *g)
{
  sf_block *block = w->block;
  const sf_net_words *net = t->net;
  const sf_batch *batch = &t->batch;
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  const bool along = t->model.config.along;
  const int lanes = sf_mark_lanes(t, p, bundle, w);
  load_directions(t, bundle, lanes, w);
  for (int b = 0; b < bundle->blocks; b++) {
    load_block(t, bundle, b, &block[b]);
    if (along)
      t->kernels->along_forward(net, &block[b], w->scratch);
    else
      t->kernels->forward(net, &block[b], p->steps, p->steps, w->scratch);
  }
  memset(w->dsigma, 0, (size_t)bundle->blocks * SF_T_MAX * SF_BLOCK * sizeof(float));
  memset(w->dcolour, 0, (size_t)bundle->blocks * SF_T_MAX * 3 * SF_BLOCK * sizeof(float));
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    ray_in(p, &batch->ray[r], w);
    if (p->distortion > 0)
      sf_distortion_place(t, &batch->ray[r], batch->x, batch->ray[r].lane, SF_BLOCK, batch->delta + batch->ray[r].lane,
                          &w->ray);
    sf_loss_ray(p, &batch->ray[r], batch->delta + batch->ray[r].lane, &w->ray, &g->sums);
    sf_near_slow(t, p, &batch->ray[r], batch->x, batch->ray[r].lane, SF_BLOCK, &w->ray);
    ray_out(p, &batch->ray[r], w);
  }
  sf_count_spikes(t, 0, p->steps, block, lanes < SF_BLOCK ? lanes : SF_BLOCK, g);
  for (int i = 0; i < bundle->blocks; i++) {
    const int b = along ? bundle->blocks - 1 - i : i;
    const float *dsigma = w->dsigma + (size_t)b * SF_T_MAX * SF_BLOCK;
    const float *dcolour = w->dcolour + (size_t)b * SF_T_MAX * 3 * SF_BLOCK;
    float *df = batch->df + (size_t)(bundle->block + b) * plane;
    if (along)
      t->kernels->along_backward(net, &block[b], dsigma, dcolour, df, g->grad, w->scratch);
    else
      t->kernels->backward(net, &block[b], p->steps, dsigma, dcolour, df, g->grad, w->scratch);
  }
}

/* One thread per level, samples in order: no atomics, and the sum does not depend on the threads. Adam follows while
 * the level's gradient is in the cache. */
static void grid_gradient(sf_trainer *t, const sf_adam *adam)
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

/* The groups' sum into the flat gradient. */
static void collect(sf_trainer *t, const void *sum)
{
  const sf_net_grad *grad = sum;
  const sf_model *m = &t->model;
  const int hidden = m->config.hidden, features = 2 * m->config.levels;
  float *at[SF_P_COUNT];
  for (int i = 0; i < SF_P_COUNT; i++) at[i] = t->grad + m->param[i].offset;
  sf_matrix_add(at[SF_P_D1], grad->w1, hidden, features, (features + 15) / 16 * 16);
  sf_matrix_add(at[SF_P_D2], grad->w2, SF_DENSITY_OUT, hidden, hidden);
  sf_matrix_add_transposed(at[SF_P_D2], grad->w2t, SF_DENSITY_OUT, hidden);
  for (int r = 0; r < hidden; r++) {
    float *row = at[SF_P_C1] + (size_t)r * (SF_DIR_FEATURES + SF_GEO_FEATURES);
    sf_matrix_add(row, grad->w3 + 32 * r, 1, SF_DIR_FEATURES, 32);
    sf_matrix_add(row + SF_DIR_FEATURES, grad->w3 + 32 * r + SF_DIR_FEATURES + 1, 1, SF_GEO_FEATURES, 32);
  }
  sf_matrix_add(at[SF_P_C2], grad->w4, hidden, hidden, hidden);
  sf_matrix_add_transposed(at[SF_P_C2], grad->w4t, hidden, hidden);
  sf_matrix_add(at[SF_P_C3], grad->w5, 3, hidden, hidden);
  sf_matrix_add(at[SF_P_LEAK], grad->leak, 1, SF_LAYERS, SF_LAYERS);
}

static sf_status prepare(sf_trainer *t, const sf_loss_plan *plan)
{
  sf_train_prepare(t);
  SF_TRY(sf_batch_compact(t, plan));
  sf_batch_adapt(t);
  return sf_ok();
}

static sf_status share(sf_trainer *t)
{
  sf_share_blocks(t);
  return sf_share(t, t->batch.df, (size_t)2 * t->model.config.levels * SF_BLOCK * sizeof(float));
}

static sf_status check(const sf_trainer *t)
{
  const size_t n = (size_t)t->batch.blocks * 2 * t->model.config.levels * SF_BLOCK;
  int bad = 0, far = 0;
#pragma omp parallel for simd reduction(| : bad, far)
  for (size_t i = 0; i < n; i++) {
    bad |= !(fabsf(t->batch.df[i]) < 1e12f);
    far |= !(fabsf(t->batch.f[i]) < 1e6f);
  }
  if (bad || far)
    return sf_fail(SF_E_RANGE, "train: iteration %lld: %s '%s' not finite or far too large", (long long)t->iteration,
                   far ? "values of" : "gradient of", t->model.param[SF_P_GRID].name);
  return sf_ok();
}

static void update(sf_trainer *t)
{
  const double fade = (sf_tuning(t) ? sf_tuning_rate : 1) * pow(0.3, t->progress);
  sf_adam adam = {t->options.lr_grid * fade, 0.9, 0.99, 1e-15, t->iteration + 1, 0};
  grid_gradient(t, &adam);
  adam.lr = t->options.lr_net * fade;
  const size_t nets = t->model.param[SF_P_NETS].offset;
  t->kernels->adam(&adam, t->model.size - nets, t->model.value + nets, t->grad + nets, t->moment1 + nets,
                   t->moment2 + nets);
}

static void probe(const sf_trainer *t, uint64_t stream, uint64_t base, const float x[3], int i, sf_probes *p)
{
  const uint64_t view = sf_random_below(t->options.seed, stream, base + 1, (uint64_t)t->data->count);
  const float *pose = t->data->view[view].camera.to_world;
  float d[3], length = 0;
  for (int a = 0; a < 3; a++) {
    d[a] = (float)t->model.config.bound * (2 * x[a] - 1) - pose[4 * a + 3];
    length += d[a] * d[a];
  }
  for (int a = 0; a < 3; a++) d[a] /= sqrtf(length) + 1e-9f;
  sf_grid_features(&t->model, x, p->f + i * p->features);
  sf_sh4(d, p->sh + i * SF_DIR_FEATURES);
}

const sf_backbone sf_backbone_ingp = {.growth = 3e3f,
                                      .settles = true,
                                      .create = create,
                                      .destroy = destroy,
                                      .init = init,
                                      .begin = begin,
                                      .draw = sf_batch_draw,
                                      .prepare = prepare,
                                      .bundle = bundle_gradient,
                                      .share = share,
                                      .collect = collect,
                                      .block_bytes = sizeof(sf_block),
                                      .grad_bytes = sizeof(sf_net_grad),
                                      .ray_samples = BUNDLE_BLOCKS * SF_BLOCK,
                                      .check = check,
                                      .update = update,
                                      .probe = probe};
