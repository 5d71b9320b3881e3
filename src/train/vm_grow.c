/* How a TensoRF field grows: alpha masks, the box shrunk to what the first one holds, finer planes and lines. */
#include "train/vm.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of the 30 000 and 25 000 iterations of TensoRF's Blender and forward-facing runs, as shares of the run. */
typedef struct event {
  double at;
  bool mask, grow;
} event;

enum { EVENTS = 5 };

static const event schedule[2][EVENTS] = {{{2000 / 30e3, true, true},
                                           {3000 / 30e3, false, true},
                                           {4000 / 30e3, true, true},
                                           {5500 / 30e3, false, true},
                                           {7000 / 30e3, false, true}},
                                          {{2000 / 25e3, false, true},
                                           {2500 / 25e3, true, false},
                                           {3000 / 25e3, false, true},
                                           {4000 / 25e3, false, true},
                                           {5500 / 25e3, false, true}}};

static const double first_voxels = 2097156; /* TensoRF's N_voxel_init */
static const double alpha_threshold = 1e-4, alpha_scale = 25;
/* Share of the threshold for the first mask, of a field that has just begun; iterations after which it is whole. */
static const double youngest = 0.1, grown_up = 1000;

/* Interpolated plane or line of `n` components at (row, column) of the old one. */
static void sample(const float *from, const int64_t size[2], double row, double column, int64_t n, float *to)
{
  const int64_t r = (int64_t)fmin(floor(row), (double)(size[0] - 1)),
                c = (int64_t)fmin(floor(column), (double)(size[1] - 1));
  const int64_t down = r + 1 < size[0] ? size[1] * n : 0, right = c + 1 < size[1] ? n : 0;
  const float v = (float)(row - (double)r), u = (float)(column - (double)c);
  const float *a = from + (r * size[1] + c) * n;
  for (int64_t i = 0; i < n; i++)
    to[i] = (1 - v) * ((1 - u) * a[i] + u * a[right + i]) + v * ((1 - u) * a[down + i] + u * a[down + right + i]);
}

static void resample_param(const sf_model *from, sf_model *to, int id, const double start[3], const double stride[3])
{
  const sf_param *p = &from->param[id], *q = &to->param[id];
  const int *axis = sf_tensorf_axis[(id - SF_P_DENSITY_PLANE) % 3];
  const bool line = p->dims == 2;
  const int row = line ? axis[2] : axis[1], column = axis[0];
  const int64_t n = q->shape[line ? 1 : 2], columns = line ? 1 : q->shape[1];
  const int64_t size[2] = {p->shape[0], line ? 1 : p->shape[1]};
#pragma omp parallel for schedule(static)
  for (int64_t r = 0; r < q->shape[0]; r++)
    for (int64_t c = 0; c < columns; c++)
      sample(from->value + p->offset, size, start[row] + (double)r * stride[row],
             line ? 0 : start[column] + (double)c * stride[column], n,
             to->value + q->offset + (size_t)((r * columns + c) * n));
}

static sf_status clear_optimiser(sf_trainer *t)
{
  float **const array[] = {&t->grad, &t->moment1, &t->moment2};
  for (int i = 0; i < 3; i++) {
    free(*array[i]);
    *array[i] = sf_aligned_alloc(t->model.size * sizeof(float));
    if (!*array[i]) return sf_fail(SF_E_MEMORY, "train: no memory for %zu parameters", t->model.size);
  }
  free(t->average);
  t->average = NULL;
  t->averaged = 0;
  t->vm->fresh = t->iteration;
  t->vm->fresh_at = t->progress;
  return sf_ok();
}

sf_status sf_vm_resample(sf_trainer *t, const sf_tensorf *field, const double start[3], const double stride[3])
{
  sf_model *old = &t->model, new;
  sf_config config = old->config;
  config.tensorf = *field;
  SF_TRY(sf_model_create(&new, &config));
  for (int id = SF_P_DENSITY_PLANE; id < SF_P_BASIS; id++) resample_param(old, &new, id, start, stride);
  for (int id = SF_P_BASIS; id < SF_P_COUNT; id++)
    memcpy(new.value + new.param[id].offset, old->value + old->param[id].offset, old->param[id].size * sizeof(float));
  const size_t res = (size_t)config.occ_res;
  memcpy(new.occupancy, old->occupancy, res * res * res / 8);
  new.t_star = old->t_star;
  new.t_r = old->t_r;
  sf_model_free(old);
  *old = new;
  return clear_optimiser(t);
}

/* Alpha above a share of the threshold at the corners of the cells, [res+1]^3; TensoRF's alpha leaves the distance
 * scale out. */
static void find_visible(const sf_trainer *t, double share, uint8_t *visible)
{
  const sf_tensorf *f = &t->model.config.tensorf;
  const int n = t->model.config.occ_res + 1;
  const sf_vm_field field = sf_vm_field_of(&t->model, false);
  const float limit = (float)(-log1p(-alpha_threshold * share) * alpha_scale / sf_tensorf_step(f));
#pragma omp parallel for schedule(dynamic, 1)
  for (int z = 0; z < n; z++) {
    float x[3 * 257], sigma[257], slope[257]; /* 256 cells at most */
    for (int y = 0; y < n; y++) {
      for (int i = 0; i < n; i++) {
        const int at[3] = {i, y, z};
        for (int a = 0; a < 3; a++) x[3 * i + a] = fminf((float)at[a] / (float)(n - 1), 0x1.fffffep-1f);
      }
      t->kernels->vm_density(&field, x, n, sigma, slope);
      for (int i = 0; i < n; i++) visible[((size_t)z * n + y) * n + i] = sigma[i] > limit;
    }
  }
}

/* Along one axis: the cell between corners i and i+1 sees the corners i-1 .. i+2, which is a 3^3 maximum of corners
 * and then any of a cell's own. stride: distance of two corners of the axis. */
static void spread(const uint8_t *corner, uint8_t *cell, int n, size_t stride, size_t lines, const size_t *origin)
{
#pragma omp parallel for schedule(static)
  for (size_t line = 0; line < lines; line++) {
    const size_t first = line / (size_t)n * origin[0] + line % (size_t)n * origin[1];
    for (int i = 0; i + 1 < n; i++) {
      uint8_t any = 0;
      for (int k = i ? i - 1 : 0; k <= i + 2 && k < n; k++) any |= corner[first + (size_t)k * stride];
      cell[first + (size_t)i * stride] = any;
    }
  }
}

sf_status sf_vm_mask(sf_trainer *t, double share, bool within_old)
{
  const size_t res = (size_t)t->model.config.occ_res, n = res + 1, corners = n * n * n;
  uint8_t *a = malloc(corners), *b = malloc(corners);
  if (!a || !b) {
    free(a);
    free(b);
    return sf_fail(SF_E_MEMORY, "train: no memory for the alpha mask");
  }
  find_visible(t, share, a);
  spread(a, b, (int)n, 1, n * n, (size_t[2]){n * n, n});
  spread(b, a, (int)n, n, n * n, (size_t[2]){n * n, 1});
  spread(a, b, (int)n, n * n, n * n, (size_t[2]){n, 1});
  size_t occupied = 0;
  for (size_t i = 0; i < res * res * res; i++) occupied += b[(i / res / res * n + i / res % res) * n + i % res];
  for (size_t byte = 0; occupied && byte < res * res * res / 8; byte++) { /* nothing visible: too early to know */
    unsigned bits = 0;
    for (size_t k = 0; k < 8; k++) {
      const size_t i = 8 * byte + k;
      bits |= (unsigned)b[(i / res / res * n + i / res % res) * n + i % res] << k;
    }
    t->model.occupancy[byte] = (uint8_t)(within_old ? t->model.occupancy[byte] & bits : bits);
  }
  occupied = 0;
  for (size_t byte = 0; byte < res * res * res / 8; byte++)
    occupied += (size_t)__builtin_popcount(t->model.occupancy[byte]);
  t->occupied = (double)occupied / (double)(res * res * res);
  free(a);
  free(b);
  return sf_ok();
}

/* Cells [low, high) of each axis that the mask holds. */
static void bounds(const sf_model *m, int low[3], int high[3])
{
  const int res = m->config.occ_res;
  for (int a = 0; a < 3; a++) low[a] = res, high[a] = 0;
  for (size_t i = 0; i < (size_t)res * res * res; i++) {
    if (!(m->occupancy[i / 8] >> (i % 8) & 1)) continue;
    const int at[3] = {(int)(i % res), (int)(i / res % res), (int)(i / res / res)};
    for (int a = 0; a < 3; a++) {
      low[a] = at[a] < low[a] ? at[a] : low[a];
      high[a] = at[a] + 1 > high[a] ? at[a] + 1 : high[a];
    }
  }
}

sf_status sf_vm_shrink(sf_trainer *t)
{
  const sf_tensorf *old = &t->model.config.tensorf;
  sf_tensorf new = *old;
  int low[3], high[3];
  double start[3];
  bounds(&t->model, low, high);
  bool smaller = false;
  for (int a = 0; a < 3; a++) {
    const double last = old->resolution[a] - 1, cell = last / t->model.config.occ_res;
    const double first = floor(low[a] * cell), end = fmax(ceil(high[a] * cell - 1e-9), first + 1);
    const double size = (double)old->box[1][a] - (double)old->box[0][a];
    start[a] = first;
    new.resolution[a] = (int32_t)(end - first) + 1;
    new.box[0][a] = (float)((double)old->box[0][a] + size * first / last);
    new.box[1][a] = (float)((double)old->box[0][a] + size * end / last);
    smaller |= new.resolution[a] < old->resolution[a];
  }
  return smaller ? sf_vm_resample(t, &new, start, (double[3]){1, 1, 1}) : sf_ok();
}

static sf_status upsample(sf_trainer *t, double voxels)
{
  const sf_tensorf *old = &t->model.config.tensorf;
  sf_tensorf new = *old;
  double stride[3];
  sf_tensorf_resolution(new.box, voxels, new.resolution);
  for (int a = 0; a < 3; a++) stride[a] = (old->resolution[a] - 1.0) / (new.resolution[a] - 1);
  return sf_vm_resample(t, &new, (double[3]){0, 0, 0}, stride);
}

sf_status sf_vm_grow(sf_trainer *t)
{
  sf_vm *vm = t->vm;
  const event *e = schedule[t->model.config.tensorf.ndc];
  int steps = 0, done = 0, masks = 0;
  for (int i = 0; i < EVENTS; i++) steps += e[i].grow;
  for (int i = 0; i < vm->event; i++) done += e[i].grow, masks += e[i].mask;
  for (; vm->event < EVENTS && t->progress >= e[vm->event].at - 1e-9; vm->event++) {
    const event *now = &e[vm->event];
    if (now->mask && !masks) {
      SF_TRY(sf_vm_mask(t, 1, false));
      SF_TRY(sf_vm_shrink(t));
    }
    if (now->mask)
      SF_TRY(sf_vm_mask(t, masks ? 1 : fmin(1, fmax(youngest, (double)t->iteration / grown_up)), masks > 0));
    masks += now->mask;
    const double grown = (double)++done / steps, last = pow(t->options.voxels, 3);
    if (now->grow)
      SF_TRY(upsample(t, exp((1 - grown) * log(fmin(first_voxels, last)) + grown * log(last))));
    else
      done--;
  }
  return sf_ok();
}
