/* The field's gradient, its regularisers and Adam. */
#include "train/vm.h"
#include <math.h>

static const double l1_first = 8e-5, l1_rest = 4e-5; /* of the density, before and after the first mask */
static const double tuning_nets = 0.5;               /* of the nets' rate: as much as of the hash grid's nets */
static const double tv_weight = 1e-2;                /* of both fields, forward-facing scenes; decays with the rate */

/* At most 16 components of one mode of one field. */
typedef struct slice {
  bool appearance;
  int mode, first, count, column; /* column: among all products */
} slice;

enum { SLICES_MAX = 6 * SF_COMPONENTS_MAX / 16 };

/* The density's first: they have the most samples. */
static int list_slices(const sf_vm *vm, slice *list)
{
  int n = 0;
  for (int appearance = 0; appearance < 2; appearance++) {
    const int *channels = appearance ? vm->appearance.channels : vm->density.channels;
    for (int m = 0, column = 0; m < 3; column += channels[m++])
      for (int c = 0; c < channels[m]; c += 16)
        list[n++] = (slice){appearance, m, c, channels[m] - c < 16 ? channels[m] - c : 16, column + c};
  }
  return n;
}

/* One thread per slice, samples in order: no atomics, and the sums do not depend on the threads. */
static void scatter(sf_trainer *t)
{
  sf_vm *vm = t->vm;
  slice list[SLICES_MAX];
  const int n = list_slices(vm, list), products = vm->decoder->view.products;
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i < n; i++) {
    const slice s = list[i];
    const int plane = (s.appearance ? SF_P_APP_PLANE : SF_P_DENSITY_PLANE) + s.mode;
    float *dplane = t->grad + t->model.param[plane].offset, *dline = t->grad + t->model.param[plane + 3].offset;
    if (s.appearance)
      t->kernels->vm_backward(&vm->appearance, s.mode, s.first, s.count, vm->x, t->batch.blocks * SF_BLOCK,
                              vm->dproduct + s.column, products, dplane, dline);
    else
      for (int part = 0; part < GROUPS; part++)
        t->kernels->vm_backward(&vm->density, s.mode, s.first, s.count, vm->part[part].x, vm->part[part].used,
                                vm->part[part].slope, 0, dplane, dline);
  }
}

/* Total variation of a plane: 2 (sum of squared differences along an axis / their number), both axes. */
static void add_variation(const sf_param *p, double weight, const float *value, float *grad)
{
  const int64_t rows = p->shape[0], columns = p->shape[1], n = p->shape[2], ld = columns * n;
  const float down = (float)(weight * 4 / ((double)n * (double)(rows - 1) * (double)columns)),
              right = (float)(weight * 4 / ((double)n * (double)rows * (double)(columns - 1)));
#pragma omp parallel for schedule(static)
  for (int64_t r = 0; r < rows; r++) {
    const float *x = value + r * ld, *above = r ? x - ld : x, *below = r + 1 < rows ? x + ld : x;
    float *g = grad + r * ld;
    for (int64_t i = 0; i < ld; i++) g[i] += down * (2 * x[i] - above[i] - below[i]);
    for (int64_t i = n; i < ld; i++) g[i] += right * (x[i] - x[i - n]);
    for (int64_t i = 0; i < ld - n; i++) g[i] += right * (x[i] - x[i + n]);
  }
}

static void update_part(sf_trainer *t, const sf_adam *adam, const sf_param *p)
{
  const size_t chunk = 1 << 14, end = p->offset + p->size;
#pragma omp parallel for schedule(static)
  for (size_t i = p->offset; i < end; i += chunk)
    t->kernels->adam(adam, end - i < chunk ? end - i : chunk, t->model.value + i, t->grad + i, t->moment1 + i,
                     t->moment2 + i);
}

void sf_vm_update(sf_trainer *t)
{
  const bool ndc = t->model.config.tensorf.ndc;
  const double from = t->vm->fresh_at, fade = pow(0.1, (t->progress - from) / fmax(1 - from, 1e-3));
  sf_adam adam = {t->options.lr_grid * fade * (sf_tuning(t) ? sf_tuning_rate : 1),
                  0.9,
                  0.99,
                  1e-8,
                  t->iteration - t->vm->fresh + 1,
                  0};
  scatter(t);
  for (int id = SF_P_DENSITY_PLANE; id < SF_P_BASIS; id++) {
    const sf_param *p = &t->model.param[id];
    const bool plane = p->dims == 3, density = id < SF_P_APP_PLANE;
    if (ndc && plane) add_variation(p, tv_weight * fade, t->model.value + p->offset, t->grad + p->offset);
    adam.l1 = !ndc && density ? (float)((t->vm->event || sf_tuning(t) ? l1_rest : l1_first) / (double)p->size) : 0;
    update_part(t, &adam, p);
  }
  adam.lr = t->options.lr_net * fade * (sf_tuning(t) ? tuning_nets : 1);
  adam.l1 = 0;
  const size_t nets = t->model.param[SF_P_BASIS].offset;
  t->kernels->adam(&adam, t->model.size - nets, t->model.value + nets, t->grad + nets, t->moment1 + nets,
                   t->moment2 + nets);
}
