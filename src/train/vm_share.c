/* TensoRF's rays and gradients between ranks. Each draws the rays of its parts and asks the field for their densities;
 * the bundles that are packed from all of them then begin and end at other rays. */
#include "train/vm.h"
#include <stdlib.h>
#include <string.h>

enum { WORDS = 5 }; /* of a sample that was drawn: x, sigma, slope */

sf_status sf_vm_part_reserve(sf_vm_part *p, int samples)
{
  if (samples <= p->capacity) return sf_ok();
  const int capacity = samples + p->capacity + 16 * SF_RAY_SAMPLES;
  float **const array[] = {&p->x, &p->sigma, &p->slope, &p->weight};
  for (int i = 0; i < 4; i++) {
    float *bigger = realloc(*array[i], (size_t)capacity * (i ? 1 : 3) * sizeof **array[i]);
    if (!bigger) return sf_fail(SF_E_MEMORY, "train: no memory for %d samples", capacity);
    *array[i] = bigger;
  }
  p->capacity = capacity;
  return sf_ok();
}

/* Samples of the parts before `part`. */
static size_t before(const sf_vm *vm, int part)
{
  size_t n = 0;
  for (int p = 0; p < part; p++) n += (size_t)vm->part[p].used;
  return n;
}

static sf_status reserve(sf_vm *vm)
{
  const size_t n = before(vm, GROUPS) * WORDS;
  if (n > vm->wire_capacity) {
    free(vm->wire);
    vm->wire = sf_aligned_alloc((n + n / 4) * sizeof *vm->wire);
    vm->wire_capacity = vm->wire ? n + n / 4 : 0;
  }
  for (int p = 0; p < GROUPS; p++) SF_TRY(sf_vm_part_reserve(&vm->part[p], vm->part[p].used));
  return n <= vm->wire_capacity ? sf_ok() : sf_fail(SF_E_MEMORY, "train: no memory for %zu samples", n / WORDS);
}

static void pack(const sf_vm_part *p, float *to)
{
  const size_t n = (size_t)p->used;
  if (!n) return;
  memcpy(to, p->x, 3 * n * sizeof *to);
  memcpy(to + 3 * n, p->sigma, n * sizeof *to);
  memcpy(to + 4 * n, p->slope, n * sizeof *to);
}

static void unpack(sf_vm_part *p, const float *from)
{
  const size_t n = (size_t)p->used;
  if (!n) return;
  memcpy(p->x, from, 3 * n * sizeof *from);
  memcpy(p->sigma, from + 3 * n, n * sizeof *from);
  memcpy(p->slope, from + 4 * n, n * sizeof *from);
}

static sf_status share_samples(sf_trainer *t)
{
  sf_vm *vm = t->vm;
  int first, end;
  sf_share_parts(t, &first, &end);
  for (int i = 0; i <= sf_ranks_size(t->options.ranks); i++) t->edge[i] = before(vm, sf_share_start(t, i, GROUPS));
  for (int p = first; p < end; p++) pack(&vm->part[p], vm->wire + WORDS * before(vm, p));
  SF_TRY(sf_share(t, vm->wire, WORDS * sizeof *vm->wire));
  for (int p = 0; p < GROUPS; p++)
    if (p < first || p >= end) unpack(&vm->part[p], vm->wire + WORDS * before(vm, p));
  return sf_ok();
}

sf_status sf_vm_share_draw(sf_trainer *t)
{
  sf_vm *vm = t->vm;
  int used[GROUPS];
  const int ranks = sf_ranks_size(t->options.ranks);
  if (ranks == 1) return sf_ok();
  for (int i = 0; i <= ranks; i++) t->edge[i] = (size_t)sf_share_start(t, i, GROUPS);
  for (int p = 0; p < GROUPS; p++) used[p] = vm->part[p].used;
  SF_TRY(sf_share(t, used, sizeof *used));
  for (int p = 0; p < GROUPS; p++) vm->part[p].used = used[p];
  SF_TRY(sf_ranks_agree(t->options.ranks, reserve(vm)));
  for (int i = 0; i <= ranks; i++) t->edge[i] = (size_t)sf_share_start(t, i, t->batch.rays);
  SF_TRY(sf_share(t, t->batch.ray, sizeof *t->batch.ray));
  SF_TRY(sf_share(t, t->batch.hit, sizeof *t->batch.hit));
  SF_TRY(sf_share(t, vm->ray, sizeof *vm->ray));
  return share_samples(t);
}

/* Gradients of the densities, ray after ray, to all ranks. */
static sf_status share_slopes(sf_trainer *t)
{
  sf_vm *vm = t->vm;
  const int ranks = sf_ranks_size(t->options.ranks), rank = sf_ranks_rank(t->options.ranks);
  sf_share_rays(t);
  const size_t first = t->edge[rank], end = t->edge[rank + 1];
  for (int i = 0; i <= ranks; i++) {
    const sf_vm_ray_samples *s = &vm->ray[t->edge[i]];
    t->edge[i] = (int)t->edge[i] < t->batch.rays ? before(vm, s->part) + (size_t)s->first : before(vm, GROUPS);
  }
  float *to = vm->wire + t->edge[rank];
  for (size_t r = first; r < end; to += vm->ray[r++].count)
    memcpy(to, vm->part[vm->ray[r].part].slope + vm->ray[r].first, (size_t)vm->ray[r].count * sizeof *to);
  SF_TRY(sf_share(t, vm->wire, sizeof *vm->wire));
  for (int p = 0; p < GROUPS; p++)
    if (vm->part[p].used)
      memcpy(vm->part[p].slope, vm->wire + before(vm, p), (size_t)vm->part[p].used * sizeof *vm->wire);
  return sf_ok();
}

sf_status sf_vm_share(sf_trainer *t)
{
  if (sf_ranks_size(t->options.ranks) == 1) return sf_ok();
  SF_TRY(share_slopes(t));
  sf_share_blocks(t);
  return sf_share(t, t->vm->dproduct, (size_t)SF_BLOCK * t->vm->decoder->view.products * sizeof *t->vm->dproduct);
}
