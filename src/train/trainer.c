/* One iteration of PATA: draw, forward, losses, backward, Adam, time budget, occupancy. */
#include "field/field.h"
#include "train/internal.h"
#include "snn/plif.h"
#include "base/clock.h"
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { EPOCH_RAYS_PER_VIEW = 4096 };

static const double longest = 10; /* that an iteration counts in a time budget: so many times their mean */
static const double search = 0.5; /* share of stage II in which t* moves, at most; the rest trains t_r alone */

/* Every so many iterations of the search are full ones; the others train one prefix, drawn at random. Stage I needs no
 * more than two steps: it learns the field. */
enum { FULL_EVERY = 4, STAGE1_STEPS = 2 };

const sf_model *sf_trainer_model(const sf_trainer *t)
{
  return &t->model;
}

void sf_trainer_free(sf_trainer *t)
{
  if (!t) return;
  if (t->backbone) t->backbone->destroy(t);
  sf_workers_free(t);
  free(t->grad);
  free(t->moment1);
  free(t->moment2);
  free(t->average);
  free(t->rounded);
  sf_batch_free(&t->batch);
  sf_model_free(&t->model);
  free(t);
}

/* Length of stage I in iterations, or as a share of the time budget. */
static double stage1_weight(const sf_trainer *t)
{
  return sf_tuning(t) || t->options.no_stage1 ? 0 : t->options.minutes > 0 ? 0.25 : t->options.stage1;
}

/* t* moves. */
static bool searching(const sf_trainer *t)
{
  return t->stage == 2 && t->search.state == SF_SEARCH_RUNNING;
}

/* What is trained now is what the run leaves. */
static bool final_part(const sf_trainer *t)
{
  const bool stage2 = t->options.minutes > 0 ? stage1_weight(t) < 1 : t->options.stage2 > 0;
  return t->stage == 1 ? !stage2 : !searching(t);
}

/* Steps of stage I. A run that ends with it learns all T there. */
static int stage1_steps(const sf_trainer *t)
{
  const int T = t->model.config.steps;
  return t->options.objective == SF_OBJECTIVE_PAPER || final_part(t) || T < STAGE1_STEPS ? T : STAGE1_STEPS;
}

/* t_r and t* at the start of the current stage. */
static void start_budget(sf_trainer *t)
{
  const int T = t->model.config.steps;
  t->model.t_r = t->stage == 1 ? stage1_steps(t) : t->options.fixed_steps ? t->options.fixed_steps : T > 1 ? T - 1 : 1;
  t->model.t_star = (float)t->model.t_r;
  if (t->stage == 2) sf_search_begin(t);
}

static sf_status copy_model(sf_model *to, const sf_model *from)
{
  SF_TRY(sf_model_create(to, &from->config));
  memcpy(to->value, from->value, from->size * sizeof *to->value);
  memcpy(to->occupancy, from->occupancy, sf_config_cells(&from->config) / 8);
  to->t_star = from->t_star;
  to->t_r = from->t_r;
  to->scales = from->scales;
  return sf_ok();
}

/* A checkpoint and what it is resumed with. */
static sf_status check_resumed(const sf_trainer *t, const char *path)
{
  const sf_config *c = &t->model.config, *o = &t->options.config;
  const float scale = t->data->scale;
  if (c->backbone != o->backbone)
    return sf_fail(SF_E_RANGE, "%s: the checkpoint is of the other backbone, %s", path, sf_field_of(c)->name);
  if (!(fabsf(c->scale - scale) <= 1e-6f * scale))
    return sf_fail(SF_E_RANGE, "%s: metadata 'scale' is %g, the data has %g (see --scale)", path, (double)c->scale,
                   (double)scale);
  if (c->bound != o->bound && !sf_tuning(t))
    return sf_fail(SF_E_RANGE, "%s: metadata 'bound' is %d, here it is %d (see --bound)", path, c->bound, o->bound);
  if (sf_model_decodes(&t->model) && c->tensorf.ndc != t->data->ndc)
    return sf_fail(SF_E_RANGE, "%s: the checkpoint is %s NDC, the data is %s it", path,
                   c->tensorf.ndc ? "in" : "without", t->data->ndc ? "in" : "without");
  return sf_ok();
}

static sf_status create(sf_trainer *t, const char *resume)
{
  if (resume)
    SF_TRY(sf_model_load(&t->model, resume));
  else
    SF_TRY(t->options.start ? copy_model(&t->model, t->options.start) : sf_model_create(&t->model, &t->options.config));
  if (resume) SF_TRY(check_resumed(t, resume));
  t->model.config.space = sf_dataset_space(t->data);
  if (sf_tuning(t)) SF_TRY(sf_tuning_start(t));
  const sf_config *c = &t->model.config;
  const size_t bytes = t->model.size * sizeof(float);
  static const sf_backbone *const backbone[SF_FIELDS] = {&sf_backbone_ingp, &sf_backbone_tensorf};
  t->backbone = backbone[c->backbone];
  t->workers = omp_get_max_threads() < GROUPS ? omp_get_max_threads() : GROUPS;
  t->grad = sf_aligned_alloc(bytes);
  t->moment1 = sf_aligned_alloc(bytes);
  t->moment2 = sf_aligned_alloc(bytes);
  if (!t->grad || !t->moment1 || !t->moment2)
    return sf_fail(SF_E_MEMORY, "train: no memory for %zu parameters", t->model.size);
  t->near_camera = sf_near_camera(t->data, &t->options);
  t->distortion_unit = sf_distortion_unit(t->data);
  SF_TRY(sf_workers_create(t));
  SF_TRY(t->backbone->create(t));
  t->stage = stage1_weight(t) > 0 ? 1 : 2;
  t->occupied = 1;
  if (t->options.fixed_steps < 0 || t->options.fixed_steps > c->steps)
    return sf_fail(SF_E_RANGE, "train: %d fixed steps, the model has %d", t->options.fixed_steps, c->steps);
  if (resume) {
    SF_TRY(sf_checkpoint_load(t, resume));
    if (t->options.fixed_steps && t->stage == 2) start_budget(t);
    return sf_ok();
  }
  start_budget(t);
  return t->options.start ? sf_ok() : sf_init_parameters(t);
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
  if (options->objective == SF_OBJECTIVE_PAPER) t->options.opaque = t->options.undecoded = 0;
  t->data = data;
  t->kernels = sf_kernels_training();
  sf_status status = sf_ranks_agree(t->options.ranks, create(t, resume));
  if (!status.code) status = sf_share_begin(t, resume);
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

/* One prefix is all that is unrolled. */
static void train_one(sf_loss_plan *p, int prefix)
{
  p->steps = p->regular_at = p->t_f = p->t_c = p->t_r = prefix;
  p->weight[prefix - 1] = 1;
}

int sf_prefix_draw(uint64_t seed, int64_t iteration, int T, float *weight)
{
  double sum = 0;
  for (int i = 1; i <= T; i++) sum += 1.0 / i;
  double left = sum * sf_random_float(seed, RNG_PREFIX, (uint64_t)iteration) - 1;
  int prefix = 1;
  while (prefix < T && left >= 0) left -= 1.0 / ++prefix;
  *weight = (float)(sum * prefix / T);
  return prefix;
}

static void train_drawn(const sf_trainer *t, sf_loss_plan *p)
{
  float weight;
  train_one(p, sf_prefix_draw(t->options.seed, t->iteration, t->model.config.steps, &weight));
  p->weight[p->steps - 1] = weight;
}

/* All T steps. The paper trains M_smooth there; here L_render(T) and the mean over all prefixes, which the iterations
 * between estimate with one prefix each: so what a step is worth does not depend on where t* stands. */
static void train_all(const sf_trainer *t, sf_loss_plan *p)
{
  const sf_train_options *o = &t->options;
  const int T = t->model.config.steps;
  const double t_hat = fmin(fmax(t->model.t_star, 1), T);
  p->full = true;
  p->steps = p->regular_at = T;
  p->t_f = (int)fmin(floor(t_hat), T - 1);
  p->t_c = p->t_f + 1;
  p->d = t_hat - p->t_f;
  p->t_r = t->model.t_r;
  p->extra = o->no_extra ? 0 : (float)o->alpha;
  p->distill = !o->no_distill;
  if (o->objective == SF_OBJECTIVE_PAPER) {
    p->weight[p->t_f - 1] = (float)(1 - p->d);
    p->weight[p->t_c - 1] = (float)p->d;
    return;
  }
  for (int i = 0; i < T; i++) p->weight[i] = 1.0f / (float)T;
  p->weight[T - 1] = 1;
}

static sf_loss_plan make_plan(const sf_trainer *t)
{
  const int T = t->model.config.steps;
  const float *leak = sf_model_param(&t->model, SF_P_LEAK);
  const bool sigma_integrates = !sf_model_decodes(&t->model);
  sf_loss_plan p = {.inverse_rays = 1.0f / (float)t->batch.rays,
                    .stop = (float)log(t->model.config.stop),
                    .k_sigma = sigma_integrates ? sf_sigmoid(leak[1]) : 0, /* 0: every prefix is the same, no tail */
                    .k_colour = sf_sigmoid(leak[4])};
  const bool learned = searching(t);
  p.opaque = sf_tail_price(t);
  if (t->options.objective != SF_OBJECTIVE_PAPER) p.distortion = (float)t->options.distortion;
  if (final_part(t) && t->model.config.net != SF_NET_ANN) p.charge = (float)t->options.charge;
  if (!learned || scaled(t)) {
    const int wanted = learned ? T : t->model.t_r;
    train_one(&p, scaled(t) && wanted > 2 ? 2 : wanted);
  } else if (t->options.objective == SF_OBJECTIVE_PAPER || !t->search.measured || t->iteration % FULL_EVERY == 0)
    train_all(t, &p);
  else
    train_drawn(t, &p);
  return p;
}

/* With bounded gradients Adam's squares stay finite, and with them every step: |update| is a few times the rate. */
static sf_status check_gradient(const sf_trainer *t, double loss)
{
  if (!isfinite(loss))
    return sf_fail(SF_E_RANGE, "train: iteration %lld: the loss is %g", (long long)t->iteration, loss);
  SF_TRY(t->backbone->check(t)); /* first: what is wild in the field is wild in the nets, too */
  for (int i = SF_P_NETS; i < SF_P_COUNT; i++)
    for (size_t j = 0; j < t->model.param[i].size; j++)
      if (!(fabsf(t->grad[t->model.param[i].offset + j]) < 1e18f))
        return sf_fail(SF_E_RANGE, "train: iteration %lld: gradient of '%s' is %g at index %zu",
                       (long long)t->iteration, t->model.param[i].name, t->grad[t->model.param[i].offset + j], j);
  return sf_ok();
}

/* The iteration's part of its stage: 1 / iterations, or the last iteration's share of the time budget. */
static double stage_share(const sf_trainer *t)
{
  if (t->options.minutes > 0)
    return t->last_step / (t->options.minutes * 60 * (t->stage == 1 ? stage1_weight(t) : 1 - stage1_weight(t)));
  const int n = t->stage == 1 ? t->options.stage1 : t->options.stage2;
  return 1.0 / (n > 0 ? n : 1);
}

/* M_smooth of the measured curve. */
static double smooth_error(const sf_loss_plan *p, const sf_loss_sums *mean)
{
  return (1 - p->d) * mean->prefix[p->t_f - 1] + p->d * mean->prefix[p->t_c - 1];
}

static void advance(sf_trainer *t, double share)
{
  t->stage_progress += share;
  t->epoch += t->batch.rays;
  t->iteration++;
  const double n1 = stage1_weight(t), n2 = t->options.minutes > 0 ? 1 - n1 : t->options.stage2;
  const double whole = n1 + n2 > 0 ? n1 + n2 : 1;
  t->progress = ((t->stage == 1 ? 0 : n1) + (t->stage == 1 ? n1 : n2) * fmin(t->stage_progress, 1)) / whole;
  if (searching(t) && t->stage_progress >= search - 1e-9) sf_search_end(t);
  if (t->stage_progress < 1 - 1e-9) return;
  if (t->stage == 1 && n2 > 0) {
    t->stage = 2;
    t->stage_progress = t->epoch = 0;
    start_budget(t);
  } else
    t->stage = 3;
}

sf_train_stats sf_trainer_stats(const sf_trainer *t)
{
  sf_train_stats s = {.stage = t->stage,
                      .iteration = t->iteration,
                      .progress = t->progress,
                      .seconds = t->seconds,
                      .t_star = t->model.t_star,
                      .t_r = t->model.t_r,
                      .search = sf_search_now(t),
                      .firing = {t->firing[0], t->firing[1], t->firing[2]},
                      .row_reads = t->row_reads,
                      .rays = t->batch.rays,
                      .samples = t->batch.samples,
                      .lattice = t->model.config.lattice / t->stride,
                      .occupied = t->occupied,
                      .samples_per_second = t->seconds > 0 ? (double)t->samples / t->seconds : 0};
  for (int l = 0; l < SF_LAYERS; l++) s.tau[l] = 1 / sf_sigmoid(sf_model_param(&t->model, SF_P_LEAK)[l]);
  memcpy(s.quiet, t->health.quiet, sizeof s.quiet);
  memcpy(s.revived, t->health.revived, sizeof s.revived);
  return s;
}

/* The prefix whose density decides what is empty: the one that is trained, which inference will use. Along rays a point
 * has no density of its own; there it is what a ray finds that stays in the point for so many samples. */
static int occupancy_steps(const sf_trainer *t)
{
  if (t->model.config.along) return SF_T_MAX;
  return scaled(t) && t->model.t_r > 2 ? 2 : t->model.t_r;
}

/* Few rays may all pass by the box or through empty space: sf_batch_adapt draws more. That so many do is no chance. */
static sf_status check_samples(const sf_trainer *t)
{
  if (t->batch.marched || t->batch.rays < sf_batch_most(t)) return sf_ok();
  return sf_fail(SF_E_RANGE, "train: iteration %lld: none of %d rays meets the box of the scene (see --scale)",
                 (long long)t->iteration, t->batch.rays);
}

sf_status sf_trainer_step(sf_trainer *t, sf_train_stats *stats)
{
  if (t->stage == 3) return sf_fail(SF_E_RANGE, "train: this run is finished");
  const double start = sf_seconds();
  const int stage = t->stage;
  sf_tuning_round(t);
  SF_TRY(sf_ranks_agree(t->options.ranks, t->backbone->begin(t, occupancy_steps(t))));
  SF_TRY(t->backbone->draw(t));
  SF_TRY(check_samples(t));
  const sf_loss_plan plan = make_plan(t);
  sf_loss_sums mean = {0};
  SF_TRY(sf_gradient_run(t, &plan, &mean, t->firing));
  const double e_tau = sf_gradient_leaks(t, &plan, &mean);
  const double loss = sf_loss_total(&plan, &mean, e_tau);
  const double mse = plan.full ? smooth_error(&plan, &mean) : mean.prefix[plan.steps - 1];
  SF_TRY(check_gradient(t, loss));
  t->backbone->update(t);
  sf_health_leaks(t);
  SF_TRY(sf_parameters_check(t));
  if (plan.charge > 0) sf_charge_update(t, mean.prefix[plan.steps - 1]);
  sf_tail_update(t, mean.prefix[plan.steps - 1]);
  if (plan.full)
    sf_search_update(t, &mean, mean.prefix[plan.steps - 1] / fmax(mse, 1e-12), fmin(t->stage_progress / search, 1));
  int event[3];
  SF_TRY(sf_health_check(t, event));
  /* A process that was stopped meanwhile has not trained: a pause is no share of a time budget. */
  t->last_step = fmin(sf_seconds() - start, t->iteration < 16 ? INFINITY : longest * t->seconds / (double)t->iteration);
  SF_TRY(sf_share_end(t));
  t->seconds += t->last_step;
  t->samples += t->batch.samples;
  const double before = t->progress;
  const bool last = final_part(t);
  advance(t, stage_share(t));
  if (before < sf_lattice_settles && t->progress >= sf_lattice_settles && !sf_tuning(t)) sf_batch_settle(t);
  if (last) SF_TRY(sf_average_update(t, before));
  if (t->stage == 3 && sf_tuning(t)) sf_scales_round(&t->model, t->model.value);
  *stats = sf_trainer_stats(t);
  if (t->stage != 3) stats->stage = stage;
  stats->loss = loss;
  stats->mse = mse;
  memcpy(stats->event, event, sizeof event);
  return sf_ok();
}
