/* One iteration of PATA: draw, forward, losses, backward, Adam, time budget, occupancy. */
#include "train/internal.h"
#include "snn/plif.h"
#include "spikefield/cli.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { OCCUPANCY_EVERY = 16, EPOCH_RAYS_PER_VIEW = 4096 };

static const double budget_rate = 1e5; /* of t*, per stage II */

sf_train_options sf_train_defaults(void)
{
  return (sf_train_options){.config = sf_config_default(),
                            .beta = 5e-7,
                            .alpha = 1e-6,
                            .stage1 = 2500,
                            .stage2 = 7500,
                            .seed = 1,
                            .samples = 1 << 14,
                            .lr_grid = 1e-2,
                            .lr_net = 5e-3};
}

const sf_model *sf_trainer_model(const sf_trainer *t)
{
  return &t->model;
}

void sf_trainer_free(sf_trainer *t)
{
  if (!t) return;
  for (int i = 0; i < t->workers; i++) {
    free(t->worker[i].block);
    free(t->worker[i].scratch);
    free(t->worker[i].ray.memory);
    free(t->worker[i].dsigma);
    free(t->worker[i].dcolour);
  }
  for (int g = 0; g < GROUPS; g++) free(t->group[g].grad);
  free(t->worker);
  free(t->grad);
  free(t->moment1);
  free(t->moment2);
  free(t->density);
  sf_batch_free(&t->batch);
  sf_model_free(&t->model);
  free(t);
}

static sf_status create_workers(sf_trainer *t)
{
  t->workers = omp_get_max_threads() < GROUPS ? omp_get_max_threads() : GROUPS;
  t->worker = calloc((size_t)t->workers, sizeof *t->worker);
  if (!t->worker) return sf_fail(SF_E_MEMORY, "train: no memory for %d threads", t->workers);
  const size_t plane = (size_t)BUNDLE_BLOCKS * SF_T_MAX * SF_BLOCK * sizeof(float);
  bool ok = true;
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

static sf_status create(sf_trainer *t, const char *resume)
{
  if (resume)
    SF_TRY(sf_model_load(&t->model, resume));
  else
    SF_TRY(sf_model_create(&t->model, &t->options.config));
  const sf_config *c = &t->model.config;
  const size_t bytes = t->model.size * sizeof(float);
  t->grad = sf_aligned_alloc(bytes);
  t->moment1 = sf_aligned_alloc(bytes);
  t->moment2 = sf_aligned_alloc(bytes);
  t->density = sf_aligned_alloc((size_t)c->occ_res * c->occ_res * c->occ_res * sizeof(float));
  if (!t->grad || !t->moment1 || !t->moment2 || !t->density)
    return sf_fail(SF_E_MEMORY, "train: no memory for %zu parameters", t->model.size);
  SF_TRY(create_workers(t));
  SF_TRY(sf_batch_create(&t->batch, t->options.samples, 2 * c->levels));
  t->stage = t->options.minutes > 0 || t->options.stage1 > 0 ? 1 : 2;
  t->rays = 1024;
  t->stride = 4;
  t->occupied = 1;
  if (resume) return sf_checkpoint_load(t, resume);
  t->model.t_star = (float)(c->steps > 1 ? c->steps - 1 : 1);
  if (t->stage == 1) t->model.t_star = (float)c->steps;
  t->model.t_r = (int)lroundf(t->model.t_star);
  return sf_init_parameters(t);
}

sf_status sf_trainer_create(sf_trainer **trainer, const sf_dataset *data, const sf_train_options *options,
                            const char *resume)
{
  *trainer = NULL;
  for (int v = 0; v < data->count; v++)
    if (!data->view[v].image.rgba)
      return sf_fail(SF_E_FORMAT, "%s: view '%s' has no picture to learn from", data->path, data->view[v].name);
  sf_trainer *t = calloc(1, sizeof *t);
  if (!t) return sf_fail(SF_E_MEMORY, "train: no memory");
  t->options = *options;
  t->data = data;
  t->kernels = sf_kernels_select(NULL);
  sf_status status = create(t, resume);
  if (status.code)
    sf_trainer_free(t);
  else
    *trainer = t;
  return status;
}

/* Steps to unroll now: T = 2 in the first epoch of a stage (max time-step scaling). */
static bool scaled(const sf_trainer *t)
{
  return !t->options.no_scaling && t->model.config.steps > 2 && t->stage_progress < 0.1 &&
         t->epoch < (double)t->data->count * EPOCH_RAYS_PER_VIEW;
}

static sf_loss_plan make_plan(const sf_trainer *t)
{
  const sf_config *c = &t->model.config;
  const float *leak = sf_model_param(&t->model, SF_P_LEAK);
  sf_loss_plan p = {.stage = t->stage,
                    .steps = scaled(t) ? 2 : c->steps,
                    .inverse_rays = 1.0f / (float)t->batch.rays,
                    .extra = t->options.no_extra ? 0 : (float)t->options.alpha,
                    .distill = !t->options.no_distill,
                    .k_sigma = sf_sigmoid(leak[1]),
                    .k_colour = sf_sigmoid(leak[4])};
  const double t_hat = fmin(fmax(t->model.t_star, 1), p.steps);
  p.t_f = t->stage == 1 ? p.steps : (int)fmin(floor(t_hat), p.steps > 1 ? p.steps - 1 : 1);
  p.t_c = t->stage == 1 || p.steps == 1 ? p.t_f : p.t_f + 1;
  p.d = t->stage == 1 || p.steps == 1 ? 0 : t_hat - p.t_f;
  p.t_r = p.d >= 0.5 ? p.t_c : p.t_f;
  return p;
}

static bool needed(const sf_loss_plan *p, int prefix)
{
  return prefix == p->steps || prefix == p->t_f || prefix == p->t_c;
}

static void ray_in(const sf_loss_plan *p, const sf_ray *ray, sf_worker *w)
{
  for (int t = 0; t < p->steps; t++) {
    if (!needed(p, t + 1)) continue;
    for (int s = 0; s < ray->count; s++) {
      const sf_block *b = &w->block[(ray->first + s) / SF_BLOCK];
      const int lane = (ray->first + s) % SF_BLOCK;
      w->ray.sigma[t][s] = b->sigma[t][lane];
      for (int c = 0; c < 3; c++) w->ray.colour[t][3 * s + c] = b->colour[t][c * SF_BLOCK + lane];
    }
  }
}

static void ray_out(const sf_loss_plan *p, const sf_ray *ray, sf_worker *w)
{
  for (int t = 0; t < p->steps; t++) {
    if (!needed(p, t + 1)) continue;
    for (int s = 0; s < ray->count; s++) {
      const int block = (ray->first + s) / SF_BLOCK, lane = (ray->first + s) % SF_BLOCK;
      w->dsigma[(block * SF_T_MAX + t) * SF_BLOCK + lane] = w->ray.dsigma[t][s];
      for (int c = 0; c < 3; c++)
        w->dcolour[((block * SF_T_MAX + t) * 3 + c) * SF_BLOCK + lane] = w->ray.dcolour[t][3 * s + c];
    }
  }
}

static void count_spikes(const sf_trainer *t, const sf_loss_plan *p, const sf_block *b, sf_group *g)
{
  const sf_config *c = &t->model.config;
  for (int s = 0; s < p->steps; s++)
    for (int i = 0; i < c->hidden * SF_BLOCK; i++) {
      g->spikes[0] += b->m1[s][i] >= c->theta[0];
      g->spikes[1] += b->m3[s][i] >= c->theta[1];
      g->spikes[2] += b->m4[s][i] >= c->theta[2];
    }
  g->neurons += (double)p->steps * c->hidden * SF_BLOCK;
}

static void load_block(const sf_trainer *t, const sf_bundle *bundle, int index, sf_block *b)
{
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  memcpy(b->f, t->batch.f + (size_t)(bundle->block + index) * plane, plane * sizeof(float));
}

static void load_directions(const sf_batch *batch, const sf_bundle *bundle, sf_worker *w)
{
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    const sf_ray *ray = &batch->ray[r];
    float sh[SF_DIR_FEATURES];
    sf_sh4(ray->direction, sh);
    for (int s = ray->first; s < ray->first + ray->count; s++)
      for (int i = 0; i < SF_DIR_FEATURES; i++) w->block[s / SF_BLOCK].sh[i * SF_BLOCK + s % SF_BLOCK] = sh[i];
  }
}

static void run_bundle(const sf_trainer *t, const sf_loss_plan *p, const sf_net_view *net, const sf_bundle *bundle,
                       sf_worker *w, sf_group *g)
{
  const sf_batch *batch = &t->batch;
  const size_t plane = (size_t)2 * t->model.config.levels * SF_BLOCK;
  load_directions(batch, bundle, w);
  for (int b = 0; b < bundle->blocks; b++) {
    load_block(t, bundle, b, &w->block[b]);
    t->kernels->forward(net, &w->block[b], p->steps, 1, w->scratch);
  }
  memset(w->dsigma, 0, (size_t)bundle->blocks * SF_T_MAX * SF_BLOCK * sizeof(float));
  memset(w->dcolour, 0, (size_t)bundle->blocks * SF_T_MAX * 3 * SF_BLOCK * sizeof(float));
  for (int r = bundle->ray; r < bundle->ray + bundle->rays; r++) {
    ray_in(p, &batch->ray[r], w);
    sf_loss_ray(p, &batch->ray[r], batch->delta, &w->ray, &g->sums);
    ray_out(p, &batch->ray[r], w);
  }
  if (bundle->blocks) count_spikes(t, p, &w->block[0], g);
  /* Beyond t_c only L_extra's 1e-6 of a gradient would flow: not worth half of the backward pass. */
  const int steps = p->stage == 1 ? p->steps : p->t_c;
  for (int b = 0; b < bundle->blocks; b++)
    t->kernels->backward(net, &w->block[b], steps, w->dsigma + (size_t)b * SF_T_MAX * SF_BLOCK,
                         w->dcolour + (size_t)b * SF_T_MAX * 3 * SF_BLOCK,
                         batch->df + (size_t)(bundle->block + b) * plane, g->grad, w->scratch);
}

static void run_bundles(sf_trainer *t, const sf_loss_plan *p)
{
  const sf_net_view net = sf_net_view_of(&t->model);
#pragma omp parallel for schedule(dynamic, 1) num_threads(t->workers)
  for (int part = 0; part < GROUPS; part++) {
    sf_group *g = &t->group[part];
    sf_net_grad *grad = g->grad;
    *g = (sf_group){.grad = grad};
    memset(grad, 0, sizeof *grad);
    for (int b = t->batch.bundles * part / GROUPS; b < t->batch.bundles * (part + 1) / GROUPS; b++)
      run_bundle(t, p, &net, &t->batch.bundle[b], &t->worker[omp_get_thread_num()], g);
  }
}

static void encode(sf_trainer *t)
{
  const int levels = t->model.config.levels, parts = 8;
  const float *table = sf_model_param(&t->model, SF_P_GRID);
#pragma omp parallel for schedule(dynamic, 1) collapse(2)
  for (int level = 0; level < levels; level++)
    for (int part = 0; part < parts; part++)
      for (int b = t->batch.blocks * part / parts; b < t->batch.blocks * (part + 1) / parts; b++)
        t->kernels->grid_forward(&t->model.level[level], table, t->batch.x + (size_t)b * 3 * SF_BLOCK,
                                 t->batch.f + ((size_t)b * levels + level) * 2 * SF_BLOCK);
}

/* One thread per level, samples in order: no atomics, and the sum does not depend on the threads. */
static void encode_backward(sf_trainer *t)
{
  const int levels = t->model.config.levels;
  float *grad = t->grad + t->model.param[SF_P_GRID].offset;
#pragma omp parallel for schedule(dynamic, 1)
  for (int level = levels - 1; level >= 0; level--)
    for (int b = 0; b < t->batch.blocks; b++)
      t->kernels->grid_backward(&t->model.level[level], t->batch.x + (size_t)b * 3 * SF_BLOCK,
                                t->batch.df + ((size_t)b * levels + level) * 2 * SF_BLOCK, grad);
}

static void add_matrix(float *to, const float *from, int rows, int columns, int ld)
{
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++) to[r * columns + c] += from[r * ld + c];
}

/* The losses as means over rays; the leaks' gradients carry that factor already. */
static void add_sums(sf_loss_sums *to, const sf_loss_sums *x, double mean)
{
  to->mse_full += mean * x->mse_full;
  to->mse_floor += mean * x->mse_floor;
  to->mse_ceil += mean * x->mse_ceil;
  to->regular += mean * x->regular;
  to->extra_floor += mean * x->extra_floor;
  to->extra_ceil += mean * x->extra_ceil;
  to->distill += mean * x->distill;
  to->g_sigma_leak += x->g_sigma_leak;
  to->g_colour_leak += x->g_colour_leak;
}

/* Sums the groups in order into the flat gradient. */
static void reduce(sf_trainer *t, double mean, sf_loss_sums *sums, double firing[3])
{
  const sf_model *m = &t->model;
  const int hidden = m->config.hidden, features = 2 * m->config.levels;
  double spikes[3] = {0}, neurons = 0;
  float *at[SF_P_COUNT];
  for (int i = 0; i < SF_P_COUNT; i++) at[i] = t->grad + m->param[i].offset;
  for (int n = 0; n < GROUPS; n++) {
    const sf_group *g = &t->group[n];
    add_matrix(at[SF_P_W1], g->grad->w1, hidden, features, (features + 15) / 16 * 16);
    add_matrix(at[SF_P_W2], g->grad->w2, SF_DENSITY_OUT, hidden, hidden);
    for (int r = 0; r < hidden; r++) {
      float *row = at[SF_P_W3] + (size_t)r * (SF_DIR_FEATURES + SF_GEO_FEATURES);
      add_matrix(row, g->grad->w3 + 32 * r, 1, SF_DIR_FEATURES, 32);
      add_matrix(row + SF_DIR_FEATURES, g->grad->w3 + 32 * r + SF_DIR_FEATURES + 1, 1, SF_GEO_FEATURES, 32);
    }
    add_matrix(at[SF_P_W4], g->grad->w4, hidden, hidden, hidden);
    add_matrix(at[SF_P_W5], g->grad->w5, 3, hidden, hidden);
    add_matrix(at[SF_P_LEAK], g->grad->leak, 1, SF_LAYERS, SF_LAYERS);
    add_sums(sums, &g->sums, mean);
    for (int l = 0; l < 3; l++) spikes[l] += g->spikes[l];
    neurons += g->neurons;
  }
  for (int l = 0; l < 3; l++) firing[l] = neurons > 0 ? spikes[l] / neurons : 0;
}

/* L_extra's part in the integrators' leaks: the decay factors and e^tau. */
static double leak_terms(sf_trainer *t, const sf_loss_plan *p, const sf_loss_sums *sums)
{
  if (p->stage == 1 || p->extra == 0) return 0;
  static const int integrator[2] = {1, 4};
  const double from_tail[2] = {sums->g_sigma_leak, sums->g_colour_leak};
  double value = 0;
  for (int i = 0; i < 2; i++) {
    const float w = sf_model_param(&t->model, SF_P_LEAK)[integrator[i]], k = sf_sigmoid(w);
    const double tau = fmin(1 + exp(-(double)w), 30.0); /* e^tau stays finite */
    value += exp(tau);
    t->grad[t->model.param[SF_P_LEAK].offset + integrator[i]] +=
        (float)(from_tail[i] * k * (1 - k) - p->extra * exp(tau) * exp(-(double)w));
  }
  return value;
}

static sf_status check_finite(const sf_trainer *t, double loss)
{
  if (!isfinite(loss))
    return sf_fail(SF_E_RANGE, "train: iteration %lld: the loss is %g", (long long)t->iteration, loss);
  for (int i = SF_P_W1; i < SF_P_COUNT; i++)
    for (size_t j = 0; j < t->model.param[i].size; j++)
      if (!isfinite(t->grad[t->model.param[i].offset + j]))
        return sf_fail(SF_E_RANGE, "train: iteration %lld: gradient of '%s' is not finite at index %zu",
                       (long long)t->iteration, t->model.param[i].name, j);
  const size_t n = (size_t)t->batch.blocks * 2 * t->model.config.levels * SF_BLOCK;
  int bad = 0;
#pragma omp parallel for simd reduction(| : bad)
  for (size_t i = 0; i < n; i++) bad |= !(fabsf(t->batch.df[i]) < 1e30f);
  if (bad)
    return sf_fail(SF_E_RANGE, "train: iteration %lld: gradient of '%s' is not finite", (long long)t->iteration,
                   t->model.param[SF_P_GRID].name);
  return sf_ok();
}

/* The iteration's part of its stage: 1 / iterations, or the last iteration's share of the time budget. */
static double stage_share(const sf_trainer *t)
{
  if (t->options.minutes > 0) return t->last_step / (t->options.minutes * 60 * (t->stage == 1 ? 0.25 : 0.75));
  const int n = t->stage == 1 ? t->options.stage1 : t->options.stage2;
  return 1.0 / (n > 0 ? n : 1);
}

static void update_parameters(sf_trainer *t)
{
  const double fade = pow(0.1, t->progress);
  sf_adam adam = {t->options.lr_grid * fade, 0.9, 0.99, 1e-15, t->iteration + 1};
  const size_t nets = t->model.param[SF_P_W1].offset;
  sf_adam_update(&adam, nets, t->model.value, t->grad, t->moment1, t->moment2);
  adam.lr = t->options.lr_net * fade;
  sf_adam_update(&adam, t->model.size - nets, t->model.value + nets, t->grad + nets, t->moment1 + nets,
                 t->moment2 + nets);
}

/* Gradient descent on the one scalar t*, not Adam: Adam's normalisation would discard the very magnitudes that beta
 * weighs, the error that one more step saves against b e^t. Without the error's signal t* follows
 * e^-t = e^-t0 + budget_rate * beta * progress, at most T per stage. */
static void update_budget(sf_trainer *t, const sf_loss_plan *p, const sf_loss_sums *mean, double penalty_ratio)
{
  if (p->stage == 1 || p->steps < t->model.config.steps || t->model.config.steps == 1) return;
  const double t_hat = t->model.t_star, share = stage_share(t), limit = t->model.config.steps * share;
  double g = mean->mse_ceil - mean->mse_floor + p->extra * (mean->extra_ceil - mean->extra_floor);
  if (!t->options.no_penalty) g += t->options.beta * penalty_ratio * exp(t_hat);
  t->t_momentum = 0.9 * t->t_momentum + 0.1 * g;
  const double move = fmin(fmax(budget_rate * share * t->t_momentum, -limit), limit);
  t->model.t_star = (float)fmin(fmax(t_hat - move, 1), t->model.config.steps);
  t->model.t_r = (int)lroundf(t->model.t_star);
}

static void advance(sf_trainer *t, double share)
{
  t->stage_progress += share;
  t->epoch += t->batch.rays;
  t->iteration++;
  const double n1 = t->options.minutes > 0 ? 0.25 : t->options.stage1,
               n2 = t->options.minutes > 0 ? 0.75 : t->options.stage2;
  const double whole = n1 + n2 > 0 ? n1 + n2 : 1;
  t->progress = ((t->stage == 1 ? 0 : n1) + (t->stage == 1 ? n1 : n2) * fmin(t->stage_progress, 1)) / whole;
  if (t->stage_progress < 1 - 1e-9) return;
  if (t->stage == 1 && n2 > 0) {
    t->stage = 2;
    t->stage_progress = t->epoch = 0;
    if (t->model.config.steps > 1) t->model.t_star = (float)(t->model.config.steps - 1);
    t->model.t_r = (int)lroundf(t->model.t_star);
  } else
    t->stage = 3;
}

static void report(const sf_trainer *t, const sf_loss_plan *p, const sf_loss_sums *mean, double firing[3], double loss,
                   double mse, sf_train_stats *s)
{
  *s = (sf_train_stats){.stage = p->stage,
                        .iteration = t->iteration,
                        .progress = t->progress,
                        .seconds = t->seconds,
                        .loss = loss,
                        .mse = mse,
                        .mse_full = mean->mse_full,
                        .mse_floor = mean->mse_floor,
                        .mse_ceil = mean->mse_ceil,
                        .t_star = t->model.t_star,
                        .t_r = t->model.t_r,
                        .firing = {firing[0], firing[1], firing[2]},
                        .rays = t->batch.rays,
                        .samples = t->batch.samples,
                        .occupied = t->occupied};
  for (int l = 0; l < SF_LAYERS; l++) s->tau[l] = 1 / sf_sigmoid(sf_model_param(&t->model, SF_P_LEAK)[l]);
  if (t->stage == 3) s->stage = 3;
}

/* The prefix whose density decides what is empty: the one that is trained, which inference will use. */
static int occupancy_steps(const sf_trainer *t)
{
  const int trained = t->stage == 1 ? t->model.config.steps : t->model.t_r;
  return scaled(t) && trained > 2 ? 2 : trained;
}

sf_status sf_trainer_step(sf_trainer *t, sf_train_stats *stats)
{
  if (t->stage == 3) return sf_fail(SF_E_RANGE, "train: this run is finished");
  const double start = sf_seconds();
  if (t->iteration % OCCUPANCY_EVERY == 0) SF_TRY(sf_occupancy_update(t, occupancy_steps(t)));
  SF_TRY(sf_batch_draw(t));
  const sf_loss_plan plan = make_plan(t);
  sf_loss_sums mean = {0};
  double firing[3];
  encode(t);
  run_bundles(t, &plan);
  reduce(t, plan.inverse_rays, &mean, firing);
  const double e_tau = leak_terms(t, &plan, &mean);
  const double mse = plan.stage == 1 ? mean.mse_full : (1 - plan.d) * mean.mse_floor + plan.d * mean.mse_ceil;
  const double ratio = mean.mse_full / fmax(mse, 1e-12);
  double loss = mse + mean.regular;
  if (plan.stage == 2)
    loss += plan.distill * mean.distill +
            plan.extra * ((1 - plan.d) * mean.extra_floor + plan.d * mean.extra_ceil + e_tau) +
            (t->options.no_penalty ? 0 : t->options.beta * ratio * exp(t->model.t_star));
  SF_TRY(check_finite(t, loss));
  encode_backward(t);
  update_parameters(t);
  update_budget(t, &plan, &mean, ratio);
  t->last_step = sf_seconds() - start;
  t->seconds += t->last_step;
  advance(t, stage_share(t));
  report(t, &plan, &mean, firing, loss, mse, stats);
  return sf_ok();
}
