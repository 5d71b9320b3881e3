/* Draws the rays of one iteration, marches them and packs their samples into blocks. */
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static void free_blocks(sf_batch *b)
{
  free(b->x);
  free(b->spare_x);
  free(b->delta);
  free(b->spare_delta);
  free(b->sigma);
  free(b->f);
  free(b->df);
}

static sf_status reserve(sf_batch *b, int blocks, int features)
{
  if (blocks <= b->block_capacity) return sf_ok();
  const int capacity = blocks + blocks / 4;
  free_blocks(b);
  const size_t n = (size_t)capacity * SF_BLOCK * sizeof(float);
  b->x = sf_aligned_alloc(3 * n);
  b->spare_x = sf_aligned_alloc(3 * n);
  b->delta = sf_aligned_alloc(n);
  b->spare_delta = sf_aligned_alloc(n);
  b->sigma = sf_aligned_alloc(SF_T_MAX * n);
  b->f = sf_aligned_alloc((size_t)features * n);
  b->df = sf_aligned_alloc((size_t)features * n);
  const bool whole = b->x && b->spare_x && b->delta && b->spare_delta && b->sigma && b->f && b->df;
  b->block_capacity = whole ? capacity : 0;
  return b->block_capacity ? sf_ok() : sf_fail(SF_E_MEMORY, "train: no memory for %d blocks of samples", capacity);
}

sf_status sf_batch_create(sf_batch *b, int samples, int features)
{
  memset(b, 0, sizeof *b);
  b->ray = calloc(RAYS_MAX, sizeof *b->ray);
  b->bundle = calloc(RAYS_MAX, sizeof *b->bundle);
  b->hit = calloc(RAYS_MAX, sizeof *b->hit);
  b->count = calloc(RAYS_MAX, sizeof *b->count);
  b->depth = calloc(RAYS_MAX, sizeof *b->depth);
  if (!b->ray || !b->bundle || !b->hit || !b->count || !b->depth)
    return sf_fail(SF_E_MEMORY, "train: no memory for rays");
  return reserve(b, samples / SF_BLOCK, features);
}

void sf_batch_free(sf_batch *b)
{
  free(b->ray);
  free(b->bundle);
  free(b->hit);
  free(b->count);
  free(b->depth);
  free_blocks(b);
}

const uint16_t *sf_batch_ray(const sf_trainer *t, uint64_t index, sf_ray *ray)
{
  const uint64_t seed = t->options.seed;
  const sf_view *view = &t->data->view[sf_random_below(seed, RNG_PIXEL, 3 * index, (uint64_t)t->data->count)];
  const sf_image *image = &view->image;
  const int x = (int)sf_random_below(seed, RNG_PIXEL, 3 * index + 1, (uint64_t)image->width);
  const int y = (int)sf_random_below(seed, RNG_PIXEL, 3 * index + 2, (uint64_t)image->height);
  const uint16_t *rgba = image->rgba + 4 * ((size_t)y * image->width + x);
  __builtin_prefetch(rgba);
  sf_dataset_ray(t->data, view, (float)x + 0.5f, (float)y + 0.5f, ray->origin, ray->direction);
  return rgba;
}

void sf_batch_target(const sf_trainer *t, uint64_t index, const uint16_t *rgba, sf_ray *ray)
{
  const uint64_t seed = t->options.seed;
  const float alpha = rgba[3] / 65535.0f;
  for (int c = 0; c < 3; c++) {
    ray->background[c] = t->options.background == 0   ? sf_random_float(seed, RNG_BACKGROUND, 3 * index + c)
                         : t->options.background == 1 ? 1.0f
                                                      : 0.0f;
    ray->target[c] = rgba[c] / 65535.0f * alpha + ray->background[c] * (1 - alpha);
  }
}

/* The end of the bundle that starts at ray `first`: of the ray boundaries in its second half the one that leaves the
 * fewest lanes empty. */
static int bundle_end(const sf_batch *b, int first)
{
  int lanes = 0, end = 0, fewest = SF_BLOCK, r = first;
  for (; r < b->rays && (r == first || lanes + b->ray[r].count <= BUNDLE_FILL); r++) {
    lanes += b->ray[r].count;
    const int empty = (SF_BLOCK - lanes % SF_BLOCK) % SF_BLOCK;
    if (lanes > BUNDLE_FILL / 2 && empty <= fewest) end = r + 1, fewest = empty;
  }
  return r < b->rays && end ? end : r;
}

int sf_batch_blocks(int samples)
{
  return samples / SF_BLOCK + 2 * samples / BUNDLE_FILL + 2;
}

void sf_batch_pack(sf_batch *b)
{
  b->bundles = b->blocks = 0;
  for (int first = 0, end; first < b->rays; first = end) {
    int lanes = 0;
    end = bundle_end(b, first);
    for (int r = first; r < end; r++) {
      b->ray[r].first = lanes;
      b->ray[r].lane = b->blocks * SF_BLOCK + lanes;
      lanes += b->ray[r].count;
    }
    const int blocks = (lanes + SF_BLOCK - 1) / SF_BLOCK;
    b->bundle[b->bundles++] = (sf_bundle){.ray = first, .rays = end - first, .block = b->blocks, .blocks = blocks};
    b->blocks += blocks;
  }
}

static void place(sf_batch *b, const sf_march *march, int r)
{
  const sf_ray *ray = &b->ray[r];
  int lane = ray->lane;
  for (int word = 0; word < SF_STEPS_MAX / 64; word++)
    for (uint64_t bits = b->hit[r][word]; bits; bits &= bits - 1, lane++) {
      float x[3], *at = b->x + (size_t)(lane / SF_BLOCK) * 3 * SF_BLOCK + lane % SF_BLOCK;
      const int n = 64 * word + __builtin_ctzll(bits);
      b->delta[lane] = march->steps->length[n];
      sf_march_at(march, n, x);
      for (int a = 0; a < 3; a++) at[a * SF_BLOCK] = x[a];
    }
}

int sf_batch_most(const sf_trainer *t)
{
  return t->options.rays ? t->options.rays : RAYS_MAX;
}

/* Below so many rays the lattice gets coarser. Of the hash grid some five samples a ray, within limits: with finer
 * intervals an iteration sees few pixels, and learns less. */
static int few_rays(const sf_trainer *t)
{
  enum { LEAST = 1536, MOST = 4096, OF_PLANES = 512 };
  const int wanted = 3 * t->options.samples / 16, most = sf_batch_most(t);
  const int few = t->options.rays ? OF_PLANES : wanted < LEAST ? LEAST : wanted > MOST ? MOST : wanted;
  return few < most ? few : most;
}

/* Rays of the next iteration for the wanted samples. Where that leaves few rays, as it does while nothing is known to
 * be empty, the lattice is made coarser, until it is settled. */
void sf_batch_adapt(sf_trainer *t)
{
  sf_batch *b = &t->batch;
  const int most = sf_batch_most(t), few = few_rays(t), many = 2 * most - 1 < 3 * few ? 2 * most - 1 : 3 * few;
  double ratio = t->options.samples / fmax(b->samples, 1);
  t->rays = (int)(t->rays * fmin(fmax(ratio, 0.5), 2.0));
  if (t->progress < sf_lattice_settles && !sf_tuning(t)) {
    if (t->rays < few && t->stride < 8) t->stride *= 2, t->rays *= 2;
    if (t->rays > many && t->stride > 1) t->stride /= 2, t->rays /= 2;
  }
  t->rays = t->rays < RAYS_MIN ? RAYS_MIN : t->rays > most ? most : t->rays;
}

int sf_batch_finer(const sf_trainer *t)
{
  const sf_config *c = &t->model.config;
  const bool as_it_is =
      t->stride == 1 || !t->backbone->settles || c->lattice < 2 * SF_LATTICE_MIN || 2 * c->dt_gamma > SF_GAMMA_MAX;
  return t->stride / (as_it_is ? 1 : 2);
}

void sf_batch_settle(sf_trainer *t)
{
  sf_config *c = &t->model.config;
  const int finer = sf_batch_finer(t), settled = t->stride / finer;
  t->rays /= finer;
  c->lattice /= settled;
  c->dt_gamma *= (float)settled;
  t->rays = t->rays < RAYS_MIN ? RAYS_MIN : t->rays;
  t->stride = 1;
}

sf_status sf_batch_draw(sf_trainer *t)
{
  sf_batch *b = &t->batch;
  const uint64_t base = (uint64_t)t->iteration * RAYS_MAX;
  sf_march *march = malloc((size_t)t->rays * sizeof *march);
  if (!march) return sf_ranks_agree(t->options.ranks, sf_fail(SF_E_MEMORY, "train: no memory for %d rays", t->rays));
  b->rays = t->rays;
  sf_status status = sf_march_steps(&t->intervals, &t->model, t->stride);
#pragma omp parallel for schedule(dynamic, 64)
  for (int r = 0; r < b->rays; r++) {
    sf_ray *ray = &b->ray[r];
    const uint16_t *pixel = sf_batch_ray(t, base + r, ray);
    march[r] = sf_march_begin(&t->model, &t->intervals, ray->origin, ray->direction,
                              sf_random_float(t->options.seed, RNG_JITTER, base + r));
    ray->count = 0;
    for (int word = 0; word < SF_STEPS_MAX / 64; word++) {
      b->hit[r][word] = t->kernels->march(&march[r], word);
      ray->count += __builtin_popcountll(b->hit[r][word]);
    }
    sf_batch_target(t, base + r, pixel, ray);
  }
  sf_batch_pack(b);
  b->marched = 0;
  for (int r = 0; r < b->rays; r++) b->marched += b->ray[r].count;
  b->samples = b->marched;
  if (!status.code) status = reserve(b, sf_batch_blocks(b->marched) + GROUPS, 2 * t->model.config.levels);
  if (!status.code) {
    memset(b->x, 0, (size_t)b->blocks * 3 * SF_BLOCK * sizeof(float));
#pragma omp parallel for schedule(dynamic, 64)
    for (int r = 0; r < b->rays; r++) place(b, &march[r], r);
  }
  free(march);
  return sf_ranks_agree(t->options.ranks, status);
}
