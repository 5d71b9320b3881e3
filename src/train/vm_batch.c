/* Rays of one iteration and their densities. Rays that meet no cell of the mask are drawn again: TensoRF filters its
 * rays once, which is the same choice without a list of pixels. */
#include "train/vm.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ATTEMPTS = 8 }; /* for a ray that meets the mask */

static sf_march draw(const sf_trainer *t, uint64_t index, sf_ray *ray)
{
  sf_march march;
  for (uint64_t attempt = 0; attempt < ATTEMPTS; attempt++) {
    const uint16_t *pixel = sf_batch_ray(t, index + (attempt << 48), ray);
    march = sf_march_begin(&t->model, &t->intervals, ray->origin, ray->direction,
                           sf_random_float(t->options.seed, RNG_JITTER, index));
    bool meets = false;
    for (int word = 0; 64 * word < march.lattice.count && !meets; word++) meets = t->kernels->march(&march, word);
    sf_batch_target(t, index + (attempt << 48), pixel, ray);
    if (meets) break;
  }
  return march;
}

/* Densities of a ray; marks the samples that the decoder will see, and counts them in ray->count. */
static void look(sf_trainer *t, int r, const sf_march *march, sf_vm_part *p)
{
  sf_vm *vm = t->vm;
  const int at = p->used;
  float behind;
  const int n = sf_vm_ray(t->kernels, &vm->density, march,
                          (sf_vm_samples){p->x + 3 * at, p->sigma + at, p->slope + at, p->weight + at, NULL}, &behind);
  uint64_t *hit = t->batch.hit[r];
  const float least = (float)t->model.config.tensorf.weight_stop;
  float light = 0, undecoded = 0;
  int kept = 0;
  memset(hit, 0, sizeof t->batch.hit[r]);
  for (int s = 0; s < n; s++) {
    const float weight = p->weight[at + s];
    light += weight;
    if (weight > least) {
      hit[s / 64] |= (uint64_t)1 << s % 64;
      kept++;
    } else
      undecoded += weight;
  }
  vm->ray[r] = (sf_vm_ray_samples){vm->ray[r].part, at, n, light, undecoded};
  t->batch.ray[r].count = kept;
  p->used += n;
}

static sf_status reserve_lanes(sf_vm *vm, int lanes, int products)
{
  if (lanes <= vm->lanes_capacity) return sf_ok();
  vm->lanes_capacity = 0;
  free(vm->x);
  free(vm->dproduct);
  const int capacity = lanes + lanes / 4;
  vm->x = sf_aligned_alloc((size_t)capacity * 3 * sizeof *vm->x);
  vm->dproduct = sf_aligned_alloc((size_t)capacity * products * sizeof *vm->dproduct);
  if (!vm->x || !vm->dproduct) return sf_fail(SF_E_MEMORY, "train: no memory for %d samples", capacity);
  vm->lanes_capacity = capacity;
  return sf_ok();
}

/* Positions of the samples that were kept, in the lanes of the ray. */
static void place(sf_trainer *t, int r)
{
  const sf_vm_ray_samples *from = &t->vm->ray[r];
  const float *x = t->vm->part[from->part].x + 3 * (size_t)from->first;
  float *to = t->vm->x + 3 * (size_t)t->batch.ray[r].lane;
  for (int word = 0; word < SF_STEPS_MAX / 64; word++)
    for (uint64_t bits = t->batch.hit[r][word]; bits; bits &= bits - 1, to += 3)
      memcpy(to, x + 3 * (64 * word + __builtin_ctzll(bits)), 3 * sizeof *to);
}

/* The share of the light that may go undecoded. The share X of a ray's light can add X^2 to its squared error, so where
 * the error of the rays with light is small, X falls with its root. light: of all rays. */
static double undecoded_share(const sf_trainer *t, double light)
{
  static const double whole_from = 1.0 / 300; /* squared error; X = 0.01 can add 3 % to smaller ones */
  if (t->tail.samples <= 0 || light <= 0) return t->options.undecoded;
  return t->options.undecoded * sqrt(fmin(t->tail.error * t->batch.rays / light / whole_from, 1));
}

/* --undecoded: the weight up to which samples are not decoded follows the light that they take, in the mean over recent
 * iterations. In fog, where every weight is small, it stays small. */
static void adapt_weight_stop(sf_trainer *t)
{
  static const double renewed = 1.0 / 16, moved = 1.0 / 32, most = 2;
  sf_vm *vm = t->vm;
  double *stop = &t->model.config.tensorf.weight_stop, light = 0, undecoded = 0;
  for (int r = 0; r < t->batch.rays; r++) light += vm->ray[r].light, undecoded += vm->ray[r].undecoded;
  if (sf_tuning(t) || t->options.undecoded <= 0) return;
  vm->light += renewed * (light - vm->light), vm->undecoded += renewed * (undecoded - vm->undecoded);
  const double room = fmin(undecoded_share(t, light) * vm->light / fmax(vm->undecoded, 1e-9), most);
  *stop = fmin(fmax(*stop * pow(room, moved), SF_WEIGHT_STOP_FIRST), SF_WEIGHT_STOP_MAX);
}

sf_status sf_vm_draw(sf_trainer *t)
{
  sf_batch *b = &t->batch;
  sf_vm *vm = t->vm;
  const uint64_t base = (uint64_t)t->iteration * RAYS_MAX;
  sf_status status[GROUPS] = {{0}};
  const sf_model seen = sf_tuning_field(t);
  vm->density = sf_vm_field_of(&seen, false);
  vm->appearance = sf_vm_field_of(&seen, true);
  b->rays = t->rays;
  SF_TRY(sf_march_steps(&t->intervals, &t->model, t->stride));
  int first, end;
  sf_share_parts(t, &first, &end);
#pragma omp parallel for schedule(dynamic, 1) num_threads(t->workers)
  for (int part = first; part < end; part++) {
    sf_vm_part *p = &vm->part[part];
    p->used = 0;
    for (int r = b->rays * part / GROUPS; r < b->rays * (part + 1) / GROUPS && !status[part].code; r++) {
      const sf_march march = draw(t, base + (uint64_t)r, &b->ray[r]);
      status[part] = sf_vm_part_reserve(p, p->used + SF_RAY_SAMPLES);
      vm->ray[r].part = part;
      if (!status[part].code) look(t, r, &march, p);
    }
  }
  for (int part = 1; part < GROUPS && !status[0].code; part++) status[0] = status[part];
  SF_TRY(sf_ranks_agree(t->options.ranks, status[0]));
  SF_TRY(sf_vm_share_draw(t));
  adapt_weight_stop(t);
  b->marched = b->samples = 0;
  for (int r = 0; r < b->rays; r++) {
    b->marched += vm->ray[r].count;
    b->samples += b->ray[r].count;
  }
  sf_batch_pack(b);
  const int lanes = b->blocks * SF_BLOCK, products = (sf_tensorf_products(&t->model.config.tensorf) + 15) / 16 * 16;
  SF_TRY(sf_ranks_agree(t->options.ranks, reserve_lanes(vm, lanes, products)));
  if (lanes > 0) memset(vm->x, 0, (size_t)lanes * 3 * sizeof *vm->x);
  for (int r = 0; r < b->rays; r++) place(t, r);
  return sf_ok();
}
