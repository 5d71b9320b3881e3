/* Samples that no light reaches leave the batch before the nets see them. Most of what is marched lies behind surfaces,
 * so rays are followed in rounds: a round looks at the next samples of the rays that have light left. */
#include "train/internal.h"
#include <omp.h>
#include <string.h>

/* The first look at a ray. Each later one sees as many samples again as all before it: light ends behind a few. */
enum { FIRST_LOOK = 4 };

/* Samples of the ray that the next round looks at. Those of a net along rays hang on one another. */
static int next_look(const sf_trainer *t, const sf_ray *ray)
{
  const int wanted = t->model.config.along ? ray->left : ray->count > FIRST_LOOK ? ray->count : FIRST_LOOK;
  return wanted < ray->left ? wanted : ray->left;
}

/* Rays of part `part` of GROUPS. */
static int part_start(const sf_batch *b, int part)
{
  return (int)((int64_t)b->rays * part / GROUPS);
}

/* Where the round's samples go, and the blocks of each part, block[part] .. block[part + 1] - 1. How blocks are
 * composed does not depend on threads and ranks, because a block's rounding hangs on how many of its neurons fire. */
static int plan_round(sf_trainer *t, int first, int end, int block[GROUPS + 1])
{
  sf_batch *b = &t->batch;
  block[first] = 0;
  for (int part = first; part < end; part++) {
    int lane = block[part] * SF_BLOCK;
    for (int r = part_start(b, part); r < part_start(b, part + 1); r++) {
      b->ray[r].lane = lane;
      lane += b->ray[r].looked = next_look(t, &b->ray[r]);
    }
    block[part + 1] = (lane + SF_BLOCK - 1) / SF_BLOCK;
  }
  return block[end];
}

/* Where a lane's column begins in an array [block][rows][SF_BLOCK]. */
static size_t column(int lane, int rows)
{
  return (size_t)(lane / SF_BLOCK) * rows * SF_BLOCK + lane % SF_BLOCK;
}

/* to[block][rows][SF_BLOCK] at lane `at`.. = from at lane `start`.. */
static void move(const float *from, int start, float *to, int at, int count, int rows)
{
  for (int s = 0; s < count; s++) {
    const float *x = from + column(start + s, rows);
    float *y = to + column(at + s, rows);
    for (int i = 0; i < rows; i++) y[i * SF_BLOCK] = x[i * SF_BLOCK];
  }
}

/* Zeros in the lanes from `lane` to the end of the blocks. */
static void clear_tail(int lane, int end, float *to, int rows)
{
  for (; lane < end; lane++)
    for (int i = 0; i < rows; i++) to[column(lane, rows) + (size_t)i * SF_BLOCK] = 0;
}

/* The lanes of a block where rays begin. */
static uint64_t beginnings(const sf_batch *b, int part, int block)
{
  uint64_t first = 0;
  for (int r = part_start(b, part); r < part_start(b, part + 1); r++)
    if (b->ray[r].looked && b->ray[r].lane / SF_BLOCK == block) first |= (uint64_t)1 << b->ray[r].lane % SF_BLOCK;
  return first;
}

/* Features at x[blocks][3][SF_BLOCK], to batch->f. Level by level: a level's table is in the cache for all samples. */
static void encode(sf_trainer *t, const float *x, int blocks)
{
  const int levels = t->model.config.levels, parts = 8;
  const sf_model seen = sf_tuning_field(t);
  const float *table = sf_model_param(&seen, SF_P_GRID);
#pragma omp parallel for schedule(dynamic, 1) collapse(2)
  for (int level = 0; level < levels; level++)
    for (int part = 0; part < parts; part++)
      for (int b = blocks * part / parts; b < blocks * (part + 1) / parts; b++)
        t->kernels->grid_forward(&t->model.level[level], table, x + (size_t)b * 3 * SF_BLOCK,
                                 t->batch.f + ((size_t)b * levels + level) * 2 * SF_BLOCK);
}

/* Densities of a part's samples to batch->sigma, [block][T][SF_BLOCK]. */
static void find_densities(sf_trainer *t, const sf_loss_plan *p, int part, const int block[], int lanes, sf_worker *w)
{
  sf_batch *batch = &t->batch;
  sf_block *to = w->block;
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  for (int b = block[part]; b < block[part + 1]; b++) {
    memcpy(to->f, batch->f + (size_t)b * plane, plane * sizeof(float));
    to->from = sf_loss_from(p);
    to->lanes = sf_block_lanes(lanes, b - block[part]);
    if (t->model.config.along) {
      to->first = beginnings(batch, part, b);
      for (int l = 0; l < SF_BLOCK; l++) to->state[l] = &w->state;
      t->kernels->along_density(t->net, to, w->scratch);
    } else
      t->kernels->density(t->net, to, p->steps, w->scratch);
    memcpy(batch->sigma + (size_t)b * SF_T_MAX * SF_BLOCK, to->sigma, (size_t)p->steps * sizeof *to->sigma);
  }
}

static bool is_lit(const sf_loss_plan *p, const float depth[SF_T_MAX])
{
  bool lit = false;
  for (int t = 0; t < p->steps; t++) lit |= sf_loss_needs(p, t + 1) && depth[t] > p->stop;
  return lit;
}

/* The features of a round's lit samples are kept until it is known where the samples go. They wait in batch->df, which
 * nobody needs before the backward pass, one row for each sample that was marched. */
static void keep_features(sf_batch *b, const sf_ray *ray, int first, int features)
{
  for (int s = first; s < ray->count; s++) {
    const float *f = b->f + column(ray->lane + s - first, features);
    float *row = b->df + (size_t)(ray->from + s) * features;
    for (int i = 0; i < features; i++) row[i] = f[i * SF_BLOCK];
  }
}

static void put_features(sf_batch *b, const sf_ray *ray, int features)
{
  for (int s = 0; s < ray->count; s++) {
    const float *row = b->df + (size_t)(ray->from + s) * features;
    float *f = b->f + column(ray->lane + s, features);
    for (int i = 0; i < features; i++) f[i * SF_BLOCK] = row[i];
  }
}

/* Counts the samples that light reaches in a prefix that is composited. depth: the logarithm of its light. */
static void follow(const sf_loss_plan *p, const sf_batch *b, sf_ray *ray, float depth[SF_T_MAX])
{
  int s = 0;
  for (; s < ray->looked && is_lit(p, depth); s++) {
    const int lane = ray->lane + s;
    const float *sigma = b->sigma + (size_t)(lane / SF_BLOCK) * SF_T_MAX * SF_BLOCK + lane % SF_BLOCK;
    for (int t = 0; t < p->steps; t++) depth[t] -= b->delta[ray->from + ray->count + s] * sigma[t * SF_BLOCK];
  }
  ray->count += s;
  ray->left = is_lit(p, depth) ? ray->left - ray->looked : 0;
}

static void look(sf_trainer *t, const sf_loss_plan *p, int part, const int block[], sf_worker *w)
{
  sf_batch *b = &t->batch;
  int lanes = 0;
  for (int r = part_start(b, part); r < part_start(b, part + 1); r++) lanes += b->ray[r].looked;
  find_densities(t, p, part, block, lanes, w);
  for (int r = part_start(b, part); r < part_start(b, part + 1); r++) {
    const int seen = b->ray[r].count;
    follow(p, b, &b->ray[r], b->depth[r]);
    keep_features(b, &b->ray[r], seen, 2 * t->model.config.levels);
  }
}

static void exchange(float **a, float **b)
{
  float *old = *a;
  *a = *b;
  *b = old;
}

/* Each rank looks at its parts' rays, round by round; all count all rays. */
static sf_status look_at_all(sf_trainer *t, const sf_loss_plan *plan)
{
  sf_batch *b = &t->batch;
  int first, end, block[GROUPS + 1];
  sf_share_parts(t, &first, &end);
  for (int r = 0; r < b->rays; r++) {
    b->ray[r].from = b->ray[r].lane, b->ray[r].left = b->ray[r].count, b->ray[r].count = 0;
    memset(b->depth[r], 0, sizeof b->depth[r]);
  }
  for (int blocks; (blocks = plan_round(t, first, end, block)) > 0;) {
#pragma omp parallel for schedule(static) num_threads(t->workers)
    for (int part = first; part < end; part++) {
      int lane = block[part] * SF_BLOCK;
      for (int r = part_start(b, part); r < part_start(b, part + 1); r++) {
        const sf_ray *ray = &b->ray[r];
        move(b->x, ray->from + ray->count, b->spare_x, ray->lane, ray->looked, 3);
        lane += ray->looked;
      }
      clear_tail(lane, block[part + 1] * SF_BLOCK, b->spare_x, 3);
    }
    encode(t, b->spare_x, blocks);
#pragma omp parallel for schedule(dynamic, 1) num_threads(t->workers)
    for (int part = first; part < end; part++) look(t, plan, part, block, &t->worker[omp_get_thread_num()]);
  }
  for (int r = 0; r < b->rays; r++) b->count[r] = b->ray[r].count;
  for (int i = 0; i <= sf_ranks_size(t->options.ranks); i++) t->edge[i] = (size_t)sf_share_start(t, i, b->rays);
  SF_TRY(sf_share(t, b->count, sizeof *b->count));
  for (int r = 0; r < b->rays; r++) b->ray[r].count = b->count[r];
  return sf_ok();
}

/* What lies behind each bundle's last sample. */
static void clear_tails(const sf_batch *b, float *to, int rows)
{
  for (int i = 0; i < b->bundles; i++) {
    const sf_bundle *bundle = &b->bundle[i];
    const sf_ray *last = &b->ray[bundle->ray + bundle->rays - 1];
    const int end = (bundle->block + bundle->blocks) * SF_BLOCK;
    clear_tail(bundle->rays ? last->lane + last->count : end, end, to, rows);
  }
}

sf_status sf_batch_compact(sf_trainer *t, const sf_loss_plan *plan)
{
  sf_batch *b = &t->batch;
  const int features = 2 * t->model.config.levels;
  SF_TRY(look_at_all(t, plan));
  b->samples = 0;
  for (int r = 0; r < b->rays; r++) b->samples += b->ray[r].count;
  sf_batch_pack(b);
#pragma omp parallel for schedule(static) num_threads(t->workers)
  for (int r = 0; r < b->rays; r++) {
    const sf_ray *ray = &b->ray[r];
    move(b->x, ray->from, b->spare_x, ray->lane, ray->count, 3);
    move(b->delta, ray->from, b->spare_delta, ray->lane, ray->count, 1);
  }
  clear_tails(b, b->spare_x, 3);
  exchange(&b->x, &b->spare_x);
  exchange(&b->delta, &b->spare_delta);
  if (sf_ranks_size(t->options.ranks) == 1) {
#pragma omp parallel for schedule(static) num_threads(t->workers)
    for (int r = 0; r < b->rays; r++) put_features(b, &b->ray[r], features);
  } else
    encode(t, b->x, b->blocks); /* others looked at some of these samples */
  /* Not what the corner of the box has: spikes of these lanes count, too, when the kernels choose between events and
   * dense products. */
  clear_tails(b, b->f, features);
  return sf_ok();
}
