/* Speed of the TensoRF trainer's parts: the density field (its cost is loads: 18 vectors of 16 components a sample
 * forward; backward reads them again and adds to as many), the decoder, and whole iterations. */
#include "bench.h"
#include "base/memory.h"
#include "render/view.h"
#include "base/clock.h"
#include "base/rng.h"
#include "train/vm.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>

enum { RAYS = 4096, PER_RAY = 32, SAMPLES = RAYS * PER_RAY };

typedef struct field_rig {
  sf_model model;
  float *x, *sigma, *slope, *grad;
} field_rig;

/* Stretches of PER_RAY samples half a voxel apart, as the surfaces that rays meet. */
static void put_rays(const sf_model *m, float *x)
{
  for (int r = 0; r < RAYS; r++) {
    float at[3], step[3];
    for (int a = 0; a < 3; a++) {
      at[a] = 0.1f + 0.8f * sf_random_float(1, 1, 6 * (uint64_t)r + a);
      step[a] = (sf_random_float(1, 1, 6 * (uint64_t)r + 3 + a) - 0.5f) / (float)m->config.tensorf.resolution[a];
    }
    for (int s = 0; s < PER_RAY; s++)
      for (int a = 0; a < 3; a++) x[3 * (r * PER_RAY + s) + a] = at[a] + (float)s * step[a];
  }
}

/* Forward and backward of the density, samples per second of all threads. */
static double field(const field_rig *r, const sf_kernels *k)
{
  const sf_vm_field f = sf_vm_field_of(&r->model, false);
  double best = 1e9;
  for (int trial = 0; trial < 4; trial++) {
    const double start = sf_seconds();
#pragma omp parallel for schedule(static)
    for (int i = 0; i < RAYS; i++)
      k->vm_density(&f, r->x + 3 * PER_RAY * i, PER_RAY, r->sigma + PER_RAY * i, r->slope + PER_RAY * i);
#pragma omp parallel for schedule(dynamic, 1)
    for (int mode = 0; mode < 3; mode++)
      k->vm_backward(&f, mode, 0, 16, r->x, SAMPLES, r->slope, 0,
                     r->grad + r->model.param[SF_P_DENSITY_PLANE + mode].offset,
                     r->grad + r->model.param[SF_P_DENSITY_LINE + mode].offset);
    best = fmin(best, sf_seconds() - start);
  }
  return SAMPLES / best;
}

static sf_status bench_field(cJSON *json, const ceilings *c)
{
  field_rig r = {0};
  sf_config config = sf_tensorf_default(0.8f, 0);
  for (int a = 0; a < 3; a++) config.tensorf.resolution[a] = 200;
  SF_TRY(sf_model_create(&r.model, &config));
  r.x = sf_aligned_alloc(3 * SAMPLES * sizeof(float));
  r.sigma = sf_aligned_alloc(SAMPLES * sizeof(float));
  r.slope = sf_aligned_alloc(SAMPLES * sizeof(float));
  r.grad = sf_aligned_alloc(r.model.size * sizeof(float));
  if (r.x && r.sigma && r.slope && r.grad) {
    for (size_t i = 0; i < r.model.param[SF_P_APP_PLANE].offset; i++)
      r.model.value[i] = sf_random_float(2, 2, i) - 0.5f;
    put_rays(&r.model, r.x);
    put(json, "train.tensorf.field", field(&r, sf_kernels_training()), "samples/s", c->fma / (4 * 18 * 16),
        field(&r, sf_kernels_select("portable")));
  }
  free(r.x), free(r.sigma), free(r.slope), free(r.grad);
  sf_model_free(&r.model);
  return sf_ok();
}

/* Samples per second through the decoder in the iterations after the first `warm`. */
static sf_status iterations(const sf_dataset *data, const sf_kernels *kernels, sf_net_kind net, int warm, int count,
                            double *rate)
{
  sf_train_options options = sf_train_defaults_tensorf(data);
  options.config.net = net;
  options.config.steps = net == SF_NET_ANN ? 1 : SF_T_MAX;
  options.stage1 = 1000;
  options.stage2 = 0;
  options.no_scaling = true;
  options.undecoded = 0; /* the decoder is fed as in TensoRF */
  sf_trainer *t = NULL;
  sf_status status = sf_trainer_create(&t, data, &options, NULL);
  double samples = 0, seconds = 0;
  sf_train_stats s = {0};
  for (int i = 0; i < warm + count && !status.code; i++) {
    const double before = s.seconds;
    t->kernels = i < warm ? sf_kernels_training() : kernels;
    status = sf_trainer_step(t, &s);
    if (i >= warm) samples += s.samples, seconds += s.seconds - before;
  }
  sf_trainer_free(t);
  *rate = samples / seconds;
  return status;
}

/* Multiply-adds of a sample, every product dense and once, as with radix spikes: 144 products to 27 features, 150
 * inputs, 128, 128, 3. */
static const double operations = 144 * 27 + 150 * 128 + 128 * 128 + 128 * 3;

sf_status bench_tensorf(cJSON *json, const ceilings *c, const sf_dataset *data)
{
  double rate = 0, naive = 0;
  SF_TRY(bench_field(json, c));
  SF_TRY(iterations(data, sf_kernels_training(), SF_NET_SNN, 40, 24, &rate));
  SF_TRY(iterations(data, sf_kernels_select("portable"), SF_NET_SNN, 40, 6, &naive));
  put(json, "train.tensorf.iteration.t8", rate, "samples/s", c->fma / (3 * operations), naive);
  SF_TRY(iterations(data, sf_kernels_training(), SF_NET_ANN, 40, 40, &rate));
  SF_TRY(iterations(data, sf_kernels_select("portable"), SF_NET_ANN, 40, 10, &naive));
  put(json, "train.tensorf.iteration.ann", rate, "samples/s", c->fma / (3 * operations), naive);
  return sf_ok();
}
