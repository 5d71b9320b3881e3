/* Samples that no light reaches leave the batch before the nets see them. */
#include "train/internal.h"
#include <omp.h>
#include <string.h>

/* Samples of a ray up to where every composited prefix is opaque. */
static int visible(const sf_loss_plan *p, const sf_ray *ray, const float *delta, const sf_block *block)
{
  int count = 0;
  for (int t = 1; t <= p->steps; t++) {
    if (!sf_loss_needs(p, t)) continue;
    float depth = 0;
    int s = 0;
    for (; s < ray->count && depth > p->stop; s++)
      depth -= delta[s] * block[(ray->first + s) / SF_BLOCK].sigma[t - 1][(ray->first + s) % SF_BLOCK];
    if (s > count) count = s;
  }
  return count;
}

static void look(sf_trainer *t, const sf_loss_plan *p, const sf_bundle *bundle, sf_worker *w)
{
  sf_batch *batch = &t->batch;
  sf_block *block = w->block;
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  sf_mark_lanes(t, bundle, w);
  for (int b = 0; b < bundle->blocks; b++) {
    memcpy(block[b].f, batch->f + (size_t)(bundle->block + b) * plane, plane * sizeof(float));
    if (t->model.config.along)
      t->kernels->along_density(t->net, &block[b], w->scratch);
    else
      t->kernels->density(t->net, &block[b], p->steps, w->scratch);
  }
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++)
    batch->ray[r].count = visible(p, &batch->ray[r], batch->delta + batch->ray[r].lane, block);
}

/* to[block][rows][SF_BLOCK] at lane `at`.. = from at lane `start`.. */
static void move(const float *from, int start, float *to, int at, int count, int rows)
{
  for (int s = 0; s < count; s++) {
    const float *x = from + (size_t)((start + s) / SF_BLOCK) * rows * SF_BLOCK + (start + s) % SF_BLOCK;
    float *y = to + (size_t)((at + s) / SF_BLOCK) * rows * SF_BLOCK + (at + s) % SF_BLOCK;
    for (int i = 0; i < rows; i++) y[i * SF_BLOCK] = x[i * SF_BLOCK];
  }
}

/* The lanes after a bundle's last sample hold zeros, not what was there before: their spikes count too when the kernels
 * choose between events and dense products. */
static void clear_tail(const sf_batch *b, const sf_bundle *bundle, float *to, int rows)
{
  const sf_ray *last = &b->ray[bundle->ray + bundle->rays - 1];
  const int end = (bundle->block + bundle->blocks) * SF_BLOCK;
  for (int lane = bundle->rays ? last->lane + last->count : end; lane < end; lane++)
    for (int i = 0; i < rows; i++) to[((size_t)(lane / SF_BLOCK) * rows + i) * SF_BLOCK + lane % SF_BLOCK] = 0;
}

static void exchange(float **a, float **b)
{
  float *old = *a;
  *a = *b;
  *b = old;
}

/* Each rank looks at its bundles; all count all rays. */
static sf_status look_at_all(sf_trainer *t, const sf_loss_plan *plan)
{
  sf_batch *b = &t->batch;
  const int rank = sf_ranks_rank(t->options.ranks);
  const int first = sf_share_start(t, rank, b->bundles), end = sf_share_start(t, rank + 1, b->bundles);
#pragma omp parallel for schedule(dynamic, 1) num_threads(t->workers)
  for (int i = first; i < end; i++) look(t, plan, &b->bundle[i], &t->worker[omp_get_thread_num()]);
  for (int r = 0; r < b->rays; r++) b->count[r] = b->ray[r].count;
  sf_share_rays(t);
  SF_TRY(sf_share(t, b->count, sizeof *b->count));
  for (int r = 0; r < b->rays; r++) b->ray[r].count = b->count[r];
  return sf_ok();
}

sf_status sf_batch_compact(sf_trainer *t, const sf_loss_plan *plan)
{
  sf_batch *b = &t->batch;
  const int features = 2 * t->model.config.levels;
  SF_TRY(look_at_all(t, plan));
  b->samples = 0;
  for (int r = 0; r < b->rays; r++) {
    b->ray[r].from = b->ray[r].lane;
    b->samples += b->ray[r].count;
  }
  sf_batch_pack(b);
#pragma omp parallel for schedule(static) num_threads(t->workers)
  for (int r = 0; r < b->rays; r++) {
    const sf_ray *ray = &b->ray[r];
    move(b->x, ray->from, b->spare_x, ray->lane, ray->count, 3);
    move(b->delta, ray->from, b->spare_delta, ray->lane, ray->count, 1);
    move(b->f, ray->from, b->df, ray->lane, ray->count, features);
  }
  for (int i = 0; i < b->bundles; i++) {
    clear_tail(b, &b->bundle[i], b->spare_x, 3);
    clear_tail(b, &b->bundle[i], b->df, features);
  }
  exchange(&b->x, &b->spare_x);
  exchange(&b->delta, &b->spare_delta);
  exchange(&b->f, &b->df);
  return sf_ok();
}
