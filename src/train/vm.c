/* The TensoRF backbone as the trainer sees it. */
#include "train/vm.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static sf_status create(sf_trainer *t)
{
  t->rays = 1024 < t->options.rays ? 1024 : t->options.rays;
  t->stride = sf_tuning(t) ? 1 : 4; /* as for the hash grid: while nothing is known to be empty */
  sf_vm *vm = t->vm = calloc(1, sizeof *vm);
  if (!vm) return sf_fail(SF_E_MEMORY, "train: no memory");
  vm->decoder = sf_aligned_alloc(sizeof *vm->decoder);
  vm->ray = calloc(RAYS_MAX, sizeof *vm->ray);
  if (!vm->decoder || !vm->ray) return sf_fail(SF_E_MEMORY, "train: no memory for rays");
  t->net = &vm->decoder->net;
  for (int i = 0; i < t->workers; i++) /* the density is the same at every prefix */
    for (int step = 1; step < SF_T_MAX; step++) {
      t->worker[i].ray.sigma[step] = t->worker[i].ray.sigma[0];
      t->worker[i].ray.dsigma[step] = t->worker[i].ray.dsigma[0];
    }
  return sf_batch_create(&t->batch, 0, 0);
}

static void destroy(sf_trainer *t)
{
  sf_vm *vm = t->vm;
  if (!vm) return;
  for (int g = 0; g < GROUPS; g++) {
    free(vm->part[g].x);
    free(vm->part[g].sigma);
    free(vm->part[g].slope);
    free(vm->part[g].weight);
  }
  free(vm->decoder);
  free(vm->ray);
  free(vm->x);
  free(vm->dproduct);
  free(vm->wire);
  free(vm);
}

/* Planes and lines 0.1 times a normal deviate (Box and Muller), the basis matrix uniform as torch's linear layers.
 * Biases are zero: the weights are scaled to the threshold afterwards. */
static void init(sf_trainer *t)
{
  const sf_model *m = &t->model;
  const uint64_t seed = t->options.seed;
  const size_t field = m->param[SF_P_BASIS].offset;
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < field; i++) {
    const double u = (sf_random_u64(seed, RNG_INIT, 2 * i) >> 11) * 0x1p-53;
    const double angle = 6.283185307179586 * (double)(sf_random_u64(seed, RNG_INIT, 2 * i + 1) >> 11) * 0x1p-53;
    m->value[i] = (float)(0.1 * sqrt(-2 * log1p(-u)) * cos(angle));
  }
  sf_init_uniform(t, SF_P_BASIS, 1 / sqrtf((float)m->param[SF_P_BASIS].shape[1]), RNG_INIT, field);
}

static sf_status begin(sf_trainer *t, int steps)
{
  (void)steps; /* the density has none */
  return sf_tuning(t) ? sf_ok() : sf_vm_grow(t);
}

static sf_status check(const sf_trainer *t)
{
  for (int g = 0; g < GROUPS; g++)
    if (t->group[g].wild)
      return sf_fail(SF_E_RANGE, "train: iteration %lld: gradient of '%s' or '%s' not finite or far too large",
                     (long long)t->iteration, t->model.param[SF_P_DENSITY_PLANE].name,
                     t->model.param[SF_P_APP_PLANE].name);
  return sf_ok();
}

static void probe(const sf_trainer *t, uint64_t stream, uint64_t base, const float x[3], int i, sf_probes *p)
{
  float features[SF_APPEARANCE_MAX];
  sf_ray ray;
  sf_batch_ray(t, sf_random_u64(t->options.seed, stream, base + 1) >> 8, &ray);
  sf_tensorf_appearance(&t->model, x, features);
  sf_tensorf_encode(&t->model.config.tensorf, features, ray.direction, p->f + i * p->features);
}

const sf_backbone sf_backbone_tensorf = {.growth = 1,
                                         .create = create,
                                         .destroy = destroy,
                                         .init = init,
                                         .begin = begin,
                                         .draw = sf_vm_draw,
                                         .prepare = sf_vm_prepare,
                                         .bundle = sf_vm_bundle,
                                         .share = sf_vm_share,
                                         .collect = sf_vm_collect,
                                         .block_bytes = sizeof(sf_decoder_block),
                                         .grad_bytes = sizeof(sf_decoder_grad),
                                         .ray_samples = SF_RAY_SAMPLES,
                                         .check = check,
                                         .update = sf_vm_update,
                                         .probe = probe};
