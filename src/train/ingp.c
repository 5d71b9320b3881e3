/* The hash-grid backbone as the trainer sees it. */
#include "train/internal.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>

enum { OCCUPANCY_EVERY = 16 };

static const double tuning_rate = 0.1; /* of the learning rates */

static sf_status create_workers(sf_trainer *t)
{
  t->worker = calloc((size_t)t->workers, sizeof *t->worker);
  if (!t->worker) return sf_fail(SF_E_MEMORY, "train: no memory for %d threads", t->workers);
  const size_t plane = (size_t)BUNDLE_BLOCKS * SF_T_MAX * SF_BLOCK * sizeof(float);
  bool ok = (t->net = sf_aligned_alloc(sizeof *t->net)) != NULL;
  for (int i = 0; i < t->workers; i++) {
    sf_worker *w = &t->worker[i];
    w->block = sf_aligned_alloc(BUNDLE_BLOCKS * sizeof *w->block);
    w->scratch = sf_aligned_alloc(sizeof *w->scratch);
    w->dsigma = sf_aligned_alloc(plane);
    w->dcolour = sf_aligned_alloc(3 * plane);
    SF_TRY(sf_ray_work_create(&w->ray, BUNDLE_BLOCKS * SF_BLOCK));
    ok = ok && w->block && w->scratch && w->dsigma && w->dcolour;
  }
  for (int g = 0; g < GROUPS; g++) ok = (t->group[g].grad = sf_aligned_alloc(sizeof(sf_net_grad))) && ok;
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "train: no memory for %d threads", t->workers);
}

static sf_status create(sf_trainer *t)
{
  t->rays = 1024;
  t->stride = sf_tuning(t) ? 1 : 4;
  t->density = sf_aligned_alloc(sf_config_cells(&t->model.config) * sizeof(float));
  if (!t->density) return sf_fail(SF_E_MEMORY, "train: no memory for the occupancy grid");
  SF_TRY(create_workers(t));
  return sf_batch_create(&t->batch, t->options.samples, 2 * t->model.config.levels);
}

static void destroy(sf_trainer *t)
{
  for (int i = 0; t->worker && i < t->workers; i++) {
    free(t->worker[i].block);
    free(t->worker[i].scratch);
    free(t->worker[i].ray.memory);
    free(t->worker[i].dsigma);
    free(t->worker[i].dcolour);
  }
  for (int g = 0; g < GROUPS; g++) free(t->group[g].grad);
  free(t->worker);
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
  const double fade = (sf_tuning(t) ? tuning_rate : 1) * pow(0.3, t->progress);
  sf_adam adam = {t->options.lr_grid * fade, 0.9, 0.99, 1e-15, t->iteration + 1, 0};
  sf_gradient_grid(t, &adam);
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
                                      .gradient = sf_gradient_nets,
                                      .check = check,
                                      .update = update,
                                      .probe = probe};
