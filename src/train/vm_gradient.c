/* Forward, losses and backward of one iteration's samples through the decoder, and the field's gradient. */
#include "train/vm.h"
#include <math.h>
#include <string.h>

/* Directions of every lane, zeros in those after the last sample. */
static void load_directions(const sf_trainer *t, const sf_bundle *bundle, int lanes, sf_worker *w)
{
  const sf_tensorf *f = &t->model.config.tensorf;
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    const sf_ray *ray = &t->batch.ray[r];
    const sf_vm_direction d = sf_vm_encode_direction(&t->model, ray->direction);
    for (int lane = ray->first; lane < ray->first + ray->count; lane++)
      sf_vm_put_direction(f, &d, ((sf_decoder_block *)w->block)[lane / SF_BLOCK].in, lane % SF_BLOCK);
  }
  const sf_vm_direction none = {0};
  for (int l = lanes; l < bundle->blocks * SF_BLOCK; l++)
    sf_vm_put_direction(f, &none, ((sf_decoder_block *)w->block)[l / SF_BLOCK].in, l % SF_BLOCK);
}

/* Densities of all samples of the ray, which every prefix shares; colours where the decoder ran, elsewhere black. */
static void ray_in(const sf_trainer *t, const sf_loss_plan *p, int r, sf_worker *w)
{
  const sf_vm_ray_samples *s = &t->vm->ray[r];
  memcpy(w->ray.sigma[0], t->vm->part[s->part].sigma + s->first, (size_t)s->count * sizeof(float));
  for (int step = 0; step < p->steps; step++) {
    if (!sf_loss_needs(p, step + 1)) continue;
    float *colour = w->ray.colour[step];
    int lane = t->batch.ray[r].first;
    memset(colour, 0, (size_t)s->count * 3 * sizeof *colour);
    for (int word = 0; word < SF_STEPS_MAX / 64; word++)
      for (uint64_t bits = t->batch.hit[r][word]; bits; bits &= bits - 1, lane++) {
        const float *from = ((const sf_decoder_block *)w->block)[lane / SF_BLOCK].net.colour[step] + lane % SF_BLOCK;
        for (int c = 0; c < 3; c++) colour[3 * (64 * word + __builtin_ctzll(bits)) + c] = from[c * SF_BLOCK];
      }
  }
}

static void ray_out(sf_trainer *t, const sf_loss_plan *p, int r, sf_worker *w)
{
  const sf_vm_ray_samples *s = &t->vm->ray[r];
  float *g = t->vm->part[s->part].slope + s->first;
  for (int i = 0; i < s->count; i++) g[i] *= w->ray.dsigma[0][i];
  for (int step = 0; step < p->steps; step++) {
    if (!sf_loss_needs(p, step + 1)) continue;
    int lane = t->batch.ray[r].first;
    for (int word = 0; word < SF_STEPS_MAX / 64; word++)
      for (uint64_t bits = t->batch.hit[r][word]; bits; bits &= bits - 1, lane++)
        for (int c = 0; c < 3; c++)
          w->dcolour[((lane / SF_BLOCK * SF_T_MAX + step) * 3 + c) * SF_BLOCK + lane % SF_BLOCK] =
              w->ray.dcolour[step][3 * (64 * word + __builtin_ctzll(bits)) + c];
  }
}

static bool wild(const float *x, int n)
{
  int bad = 0;
  for (int i = 0; i < n; i++) bad |= !(fabsf(x[i]) < 1e12f);
  return bad;
}

void sf_vm_bundle(sf_trainer *t, const sf_loss_plan *p, const sf_bundle *bundle, sf_worker *w, sf_group *g)
{
  sf_decoder_block *block = w->block;
  sf_vm *vm = t->vm;
  const int products = vm->decoder->view.products;
  const bool along = t->model.config.along;
  const int lanes = sf_mark_lanes(t, p, bundle, w);
  load_directions(t, bundle, lanes, w);
  for (int b = 0; b < bundle->blocks; b++) {
    t->kernels->vm_products(&vm->appearance, vm->x + (size_t)(bundle->block + b) * 3 * SF_BLOCK, SF_BLOCK,
                            block[b].product, products);
    if (along)
      t->kernels->decoder_along_forward(vm->decoder, &block[b], w->scratch);
    else
      t->kernels->decoder_forward(vm->decoder, &block[b], p->steps, p->steps, w->scratch);
  }
  memset(w->dcolour, 0, (size_t)bundle->blocks * SF_T_MAX * 3 * SF_BLOCK * sizeof(float));
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    sf_ray whole = t->batch.ray[r];
    const sf_vm_ray_samples *from = &vm->ray[r];
    whole.count = from->count;
    ray_in(t, p, r, w);
    if (p->distortion > 0)
      sf_distortion_place(t, &whole, vm->part[from->part].x, from->first, 1, t->intervals.length, &w->ray);
    sf_loss_ray(p, &whole, t->intervals.length, &w->ray, &g->sums); /* equal intervals */
    sf_near_slow(t, p, &whole, vm->part[from->part].x, from->first, 1, &w->ray);
    ray_out(t, p, r, w);
    g->wild |= wild(vm->part[from->part].slope + from->first, whole.count);
  }
  if (bundle->blocks) sf_count_spikes(t, 1, p->steps, &block->net, lanes < SF_BLOCK ? lanes : SF_BLOCK, g);
  for (int i = 0; i < bundle->blocks; i++) {
    const int b = along ? bundle->blocks - 1 - i : i;
    const float *dcolour = w->dcolour + (size_t)b * SF_T_MAX * 3 * SF_BLOCK;
    float *dproduct = vm->dproduct + (size_t)(bundle->block + b) * SF_BLOCK * products;
    if (along)
      t->kernels->decoder_along_backward(vm->decoder, &block[b], dcolour, dproduct, g->grad, w->scratch);
    else
      t->kernels->decoder_backward(vm->decoder, &block[b], p->steps, dcolour, dproduct, g->grad, w->scratch);
    g->wild |= wild(dproduct, SF_BLOCK * products);
  }
}

sf_status sf_vm_prepare(sf_trainer *t, const sf_loss_plan *plan)
{
  (void)plan;
  const sf_model seen = sf_tuning_nets(t);
  const sf_decoder_view view = sf_decoder_view_of(&seen);
  t->kernels->decoder_prepare(&view, t->vm->decoder);
  sf_batch_adapt(t);
  return sf_ok();
}

void sf_vm_collect(sf_trainer *t, const void *sum)
{
  const sf_decoder_grad *grad = sum;
  const sf_model *m = &t->model;
  const sf_decoder_view *v = &t->vm->decoder->view;
  const int hidden = m->config.hidden, rows = (v->inputs + 1 + 15) / 16 * 16;
  float *at[SF_P_COUNT];
  for (int i = 0; i < SF_P_COUNT; i++) at[i] = t->grad + m->param[i].offset;
  sf_matrix_add(at[SF_P_BASIS], grad->basis, v->features, v->columns, v->products);
  sf_matrix_add(at[SF_P_C1], grad->w1, hidden, v->inputs, rows);
  sf_matrix_add(at[SF_P_C1_BIAS], grad->w1 + v->inputs, hidden, 1, rows);
  sf_matrix_add(at[SF_P_C2], grad->net.w4, hidden, hidden, hidden);
  sf_matrix_add_transposed(at[SF_P_C2], grad->net.w4t, hidden, hidden);
  sf_matrix_add(at[SF_P_C2_BIAS], grad->b2, 1, hidden, hidden);
  sf_matrix_add(at[SF_P_C3], grad->net.w5, 3, hidden, hidden);
  sf_matrix_add(at[SF_P_C3_BIAS], grad->b3, 1, 3, 3);
  sf_matrix_add(at[SF_P_LEAK], grad->net.leak, 1, SF_LAYERS, SF_LAYERS);
}
