/* Every gradient of the trainer: what Adam is handed, against the slope of the whole loss in double precision
 * (gradient_oracle.h, gradient_loss.h). Every parameter tensor, every leak, every term of the loss alone and all of
 * them, every prefix and input mode, both fields, the ReLU twin, and rounded weights. SF_GRADIENT_SEED: another seed of
 * run and directions; SF_GRADIENT_DIRECTIONS: so many in a tensor (1). */
#include "ck_run.h"
#include "gradient_loss.h"
#include "quant/quant.h"
#include "train_fixture.h"
#include <stdio.h>

enum { STEPS = 4, RAYS = 8 };

/* The kernels round to 24 bits, and their surrogate's slope is within 7e-5 of its maximum: relative to the root mean
 * square that errors of random sign would have. A leak is a sum over all samples and steps, which mostly cancel: there
 * it is that of DRAWS sums of the same with random signs. */
static const double bound = 1e-3;
enum { DRAWS = 4 };

static uint64_t seed;
static int directions = 1;
static struct worst {
  double share; /* of the bound */
  int checks;
} worst[SF_P_COUNT];
static const char *names[SF_P_COUNT];

static int number_of(const char *variable, int otherwise)
{
  const char *text = getenv(variable);
  return text ? atoi(text) : otherwise;
}

static void set_up(void)
{
  seed = (uint64_t)number_of("SF_GRADIENT_SEED", 0);
  directions = number_of("SF_GRADIENT_DIRECTIONS", directions);
  open_scene(6);
}

static void tear_down(void)
{
  close_scene();
  if (!getenv("SF_GRADIENT_DIRECTIONS")) return;
  printf("\n%-28s %10s  %s\n", "parameter", "directions", "largest difference, share of the bound");
  for (int id = 0; id < SF_P_COUNT; id++)
    if (worst[id].checks) printf("%-28s %10d  %.3f\n", names[id], worst[id].checks, worst[id].share);
}

/* ---- what Adam is handed ---- */

static const sf_trainer *watched;
static double *captured; /* [model.size] */

static void capture(const sf_adam *adam, size_t n, float *value, float *grad, float *m, float *v)
{
  (void)adam, (void)m, (void)v;
  double *to = captured + (value - watched->model.value);
  for (size_t i = 0; i < n; i++) to[i] = grad[i];
  memset(grad, 0, n * sizeof *grad);
}

typedef struct rig {
  sf_trainer *t;
  sf_kernels kernels;
  oracle o;
  double variation; /* weight of the planes' total variation */
  double firing;    /* of C1, last plan */
  int moved;        /* directions whose slope is no rounding */
} rig;

/* A trainer that has learned for a moment, so that every layer fires; from now on its parameters stay. */
/* gain: of C1, C2 and their biases: a young net fires little there. */
static void rig_start(rig *r, sf_train_options *options, int iterations, float gain)
{
  options->seed += seed;
  *r = (rig){.t = start(&data, options, NULL)};
  r->t->kernels = sf_kernels_select("portable");
  steps(r->t, iterations);
  for (int id = SF_P_C1; id <= SF_P_C2; id++)
    for (size_t i = 0; i < r->t->model.param[id].size; i++) sf_model_param(&r->t->model, id)[i] *= gain;
  /* Some samples are nearer, others are not: planes in fog end their rays early. */
  r->t->near_camera = (float)(sf_model_decodes(&r->t->model) ? 0.7 : 1) * (float)sf_dataset_distance(&data);
  r->kernels = *r->t->kernels;
  r->kernels.adam = capture;
  r->t->kernels = &r->kernels;
  r->t->rays = RAYS;
  r->o = (oracle){.t = r->t, .value = calloc(r->t->model.size, sizeof *r->o.value)};
  watched = r->t;
  captured = calloc(r->t->model.size, sizeof *captured);
  ck_assert(r->o.value && captured);
}

static void rig_end(rig *r)
{
  sf_trainer_free(r->t);
  free(r->o.value);
  free(r->o.rounded);
  free(captured);
}

/* ---- one direction ---- */

/* Mean square of the slope along r->o.value where each use of a leak has a sign of its own. */
static double squares_of_uses(rig *r)
{
  double squares = 0;
  uint64_t signs = seed;
  r->o.signs = &signs;
  for (int n = 0; n < DRAWS; n++) {
    const double slope = cimag(oracle_loss(&r->o, 0)) / TINY;
    squares += slope * slope / DRAWS;
  }
  r->o.signs = NULL;
  return squares;
}

static double share_of(double found, double expected, double squares)
{
  return fabs(found - expected) / (bound * (fabs(expected) + sqrt(squares)) + 1e-9);
}

/* Element `only` of a parameter, or all of them at random (-1). */
static void check_direction(rig *r, const char *what, int id, int only, uint64_t direction)
{
  const sf_model *m = &r->t->model;
  const sf_param *p = &m->param[id];
  double expected = 0, squares = 0;
  for (size_t i = 0; i < m->size; i++) r->o.value[i] = m->value[i];
  for (size_t i = 0; i < p->size; i++) {
    const double along = only < 0 ? 2 * (double)sf_random_float(seed, direction, i) - 1 : (int)i == only;
    const double part = along * captured[p->offset + i];
    r->o.value[p->offset + i] += I * (along * TINY);
    expected += part;
    squares += part * part;
  }
  const double found = cimag(oracle_loss(&r->o, r->variation)) / TINY;
  double share = share_of(found, expected, squares);
  if (id == SF_P_LEAK && share > 1) share = share_of(found, expected, squares = squares_of_uses(r));
  ck_assert_msg(share <= 1, "%s, '%s' %d: slope %.8g, gradient %.8g (root of squares %.3g)", what, p->name, only, found,
                expected, sqrt(squares));
  names[id] = p->name;
  worst[id].share = fmax(worst[id].share, share);
  worst[id].checks++;
  r->moved += fabs(found) > 1e-7;
}

static void check_parameters(rig *r, const char *what)
{
  r->moved = 0;
  for (int id = 0; id < SF_P_COUNT; id++) {
    if (!sf_model_has(&r->t->model, id)) continue;
    for (int n = 0; id != SF_P_LEAK && n < directions; n++)
      check_direction(r, what, id, -1, (uint64_t)(n * SF_P_COUNT + id));
    for (int i = 0; id == SF_P_LEAK && i < SF_LAYERS; i++) check_direction(r, what, id, i, 0);
  }
}

/* Of a neuron of D1, C1, C2 that fires at any step: `charge` times the error per read, times the reads of its row. */
static void set_charge(rig *r, const sf_loss_plan *p)
{
  const sf_trainer *t = r->t;
  const double price = p->charge > 0 ? p->charge * t->charge.error / (t->charge.reads * t->batch.samples) : 0;
  const double reads[3] = {sf_model_decodes(&t->model) ? 0 : SF_DENSITY_OUT / 8.0, t->model.config.hidden / 8.0, 1};
  for (int l = 0; l < 3; l++) r->o.charge[l] = t->model.config.net == SF_NET_ANN ? 0 : price * reads[l];
}

/* Longer intervals, so that rays of a hash grid end. */
static void lengthen(sf_batch *b)
{
  for (int i = 0; i < b->blocks * SF_BLOCK && b->delta; i++) b->delta[i] *= 100;
}

/* A membrane that meets its threshold within the rounding of floats may fire in one of the two alone. Such batches are
 * passed over: a few in a hundred. */
static void draw_apart(rig *r, const char *what, const sf_loss_plan *p)
{
  enum { DRAWN = 20 };
  sf_trainer *t = r->t;
  double nearest = 0;
  r->o.plan = p;
  for (size_t i = 0; i < t->model.size; i++) r->o.value[i] = t->model.value[i];
  for (int n = 0; nearest < 1e-6 && n < DRAWN; n++) {
    t->iteration += n > 0; /* it seeds the next batch */
    ck_ok(t->backbone->draw(t));
    if (p->opaque > 0) lengthen(&t->batch);
    nearest = 1;
    r->o.nearest = &nearest;
    oracle_loss(&r->o, 0);
    r->o.nearest = NULL;
  }
  ck_assert_msg(nearest >= 1e-6, "%s: a membrane is %.1g from its threshold in each of %d batches", what, nearest,
                DRAWN);
}

static void check_plan(rig *r, const char *what, sf_loss_plan p)
{
  sf_trainer *t = r->t;
  sf_loss_sums mean = {0};
  double firing[3];
  t->charge = (sf_charge){.error = 0.02, .reads = 300};
  p.stop = (float)log(t->model.config.stop);
  draw_apart(r, what, &p);
  const float *leaks = sf_model_param(&t->model, SF_P_LEAK);
  p.inverse_rays = 1.0f / (float)t->batch.rays;
  p.k_sigma = sf_model_decodes(&t->model) ? 0 : sf_sigmoid(leaks[1]);
  p.k_colour = sf_sigmoid(leaks[4]);
  sf_gradient_run(t, &p, &mean, firing);
  r->firing = firing[1];
  ck_assert_int_eq(mean.tail > 0, p.opaque > 0);
  ck_assert_int_eq(mean.distortion > 0, p.distortion > 0);
  const double e_tau = sf_gradient_leaks(t, &p, &mean);
  t->backbone->update(t);
  r->o.plan = &p;
  set_charge(r, &p);
  for (size_t i = 0; i < t->model.size; i++) r->o.value[i] = t->model.value[i];
  if (p.charge == 0 && r->variation == 0) {
    int slowed = 0;
    r->o.slowed = &slowed;
    const double loss = sf_loss_total(&p, &mean, e_tau), found = creal(oracle_loss(&r->o, 0));
    r->o.slowed = NULL;
    ck_assert_msg(slowed > 0 && slowed < t->batch.marched, "%s: %d of %d samples learn slower", what, slowed,
                  t->batch.marched);
    ck_assert_msg(fabs(found - loss) <= 1e-4 * fabs(loss) + 1e-9, "%s: loss %.9g, oracle %.9g", what, loss, found);
  }
  check_parameters(r, what);
  ck_assert_msg(r->moved >= 3, "%s: nothing has a slope", what);
}

/* ---- plans ---- */

static sf_loss_plan plan_full(void)
{
  return (sf_loss_plan){.steps = STEPS, .full = true, .t_f = 2, .t_c = 3, .t_r = 2, .d = 0.4};
}

static void check_terms(rig *r)
{
  char what[32];
  for (int t = CK_AMOUNT(1, STEPS); t <= STEPS; t++) {
    sf_loss_plan one = {.steps = t}, of_all = plan_full();
    one.weight[t - 1] = 1;
    snprintf(what, sizeof what, "prefix %d alone", t);
    check_plan(r, what, one);
    of_all.weight[t - 1] = 1;
    snprintf(what, sizeof what, "prefix %d of all", t);
    check_plan(r, what, of_all);
  }
  sf_loss_plan p = plan_full();
  p.regular_at = STEPS;
  check_plan(r, "norm, cosine and sparsity", p);
  p.opaque = 1e-2f;
  check_plan(r, "L_opaque", p);
  p.opaque = 0;
  p.distortion = 1;
  check_plan(r, "L_distortion", p);
  p = plan_full();
  p.distill = 1;
  check_plan(r, "L_distill", p);
  p = plan_full();
  p.extra = 0.3f;
  check_plan(r, "L_extra", p);
  p.t_f = 1, p.t_c = 2, p.d = 0;
  check_plan(r, "L_extra of a whole prefix", p);
  p = (sf_loss_plan){.steps = STEPS, .charge = 0.5f, .weight = {[STEPS - 1] = 1e-6f}};
  check_plan(r, "charge", p);
  p = plan_full();
  for (int t = 0; t < STEPS; t++) p.weight[t] = 1.0f / STEPS;
  p.weight[STEPS - 1] = p.distill = 1;
  p.regular_at = STEPS;
  p.extra = 0.1f;
  p.opaque = 1e-3f;
  p.distortion = 0.1f;
  p.charge = 0.5f;
  check_plan(r, "all terms", p);
}

static sf_train_options grid_run(int mode)
{
  sf_train_options o = small_run();
  o.config.mode = mode;
  o.config.steps = STEPS;
  o.config.hidden = 16;
  o.config.log2_hash = 8;
  return o;
}

/* Rows of C2 are added up for spikes where C1 fires little, else multiplied. */
static const float gains[] = {0.8f, 4, 12, 4};
LOOP_TEST(terms_of_the_grid, SF_RADIX + 1)
{
  sf_train_options o = grid_run(_i);
  rig r;
  rig_start(&r, &o, 20, gains[_i]);
  for (int n = 0; n < o.config.hidden && _i == 2; n++) /* the first harmonic is a constant */
    sf_model_param(&r.t->model, SF_P_C1)[n * (SF_DIR_FEATURES + SF_GEO_FEATURES)] += 4;
  check_terms(&r);
  if (_i == 0) ck_assert_double_lt(r.firing, 0.25); /* rows, forward and backward */
  if (_i == 2) ck_assert_double_gt(r.firing, 0.45); /* products, forward and backward */
  rig_end(&r);
}

static sf_train_options planes_run(int mode)
{
  sf_train_options o = sf_train_defaults_tensorf(&data);
  o.config.stop = 1e-4; /* rays of three samples and more */
  o.config.mode = mode;
  o.config.steps = STEPS;
  o.config.hidden = 16;
  o.config.occ_res = 16;
  o.voxels = 16;
  o.rays = 128;
  o.samples = 4096;
  o.stage1 = 12;
  o.stage2 = 28;
  for (int a = 0; a < 3; a++) {
    o.config.tensorf.resolution[a] = 8 + a;
    o.config.tensorf.density[a] = 4;
    o.config.tensorf.appearance[a] = 4 + 4 * (a == 1);
  }
  o.config.tensorf.shift = 0.5f;
  o.config.tensorf.features = 5;
  o.config.tensorf.feature_freqs = 1;
  o.config.tensorf.view_freqs = 2;
  return o;
}

LOOP_TEST(terms_of_the_planes, SF_RADIX + 1)
{
  sf_train_options o = planes_run(_i);
  o.config.tensorf.activation = _i == SF_DECAY ? SF_RELU : SF_SOFTPLUS;
  rig r;
  rig_start(&r, &o, 6, 2);
  check_terms(&r);
  rig_end(&r);
}

/* Of forward-facing scenes, whose planes are smoothed with a weight that fades with the rate. */
TEST(variation_of_the_planes)
{
  sf_train_options o = planes_run(SF_HYBRID);
  rig r;
  rig_start(&r, &o, 6, 2);
  const double fresh = r.t->vm->fresh_at;
  r.variation = 1e-2 * pow(0.1, (r.t->progress - fresh) / (1 - fresh));
  r.t->model.config.tensorf.ndc = 1;
  check_plan(&r, "total variation", (sf_loss_plan){.steps = 2, .weight = {0, 1e-3f}});
  rig_end(&r);
}

LOOP_TEST(the_twins, 2)
{
  sf_train_options o = _i ? planes_run(SF_HYBRID) : grid_run(SF_HYBRID);
  o.config.net = SF_NET_ANN;
  o.config.steps = 1;
  rig r;
  rig_start(&r, &o, 6, 2);
  sf_loss_plan p = {.steps = 1, .weight = {1}};
  check_plan(&r, "squared error", p);
  p.regular_at = 1;
  p.opaque = _i ? 1e-2f : 0; /* no ray of this grid's twin has a tail */
  p.distortion = 0.1f;
  check_plan(&r, "all terms", p);
  rig_end(&r);
}

/* The samples of a ray as steps: what a weight does at one sample reaches all behind it. */
LOOP_TEST(steps_along_rays, 6)
{
  sf_train_options o = _i < 3 ? grid_run(_i) : planes_run(_i - 3);
  o.config.along = 1;
  o.config.steps = 1;
  rig r;
  rig_start(&r, &o, _i < 3 ? 20 : 6, 4);
  sf_loss_plan p = {.steps = 1, .weight = {1}};
  check_plan(&r, "squared error", p);
  int longest = 0;
  for (int i = 0; i < r.t->batch.rays; i++)
    longest = r.t->batch.ray[i].count > longest ? r.t->batch.ray[i].count : longest;
  ck_assert_int_gt(longest, 2);
  p.regular_at = 1;
  p.opaque = 1e-2f;
  p.distortion = 0.1f;
  check_plan(&r, "all terms", p);
  rig_end(&r);
}

/* Fine-tuning: the nets run with rounded weights and a rounded h, and slopes pass straight through both. */
TEST(rounded_weights)
{
  sf_train_options o = grid_run(SF_HYBRID);
  sf_trainer *t = start(&data, &o, NULL);
  steps(t, o.stage1 + o.stage2);
  ck_ok(sf_trainer_save(t, in("base.safetensors"), false));
  sf_trainer_free(t);
  sf_model base;
  ck_ok(sf_model_load(&base, in("base.safetensors")));
  OWNED(fx_scene) scene;
  sf_quant_report report;
  ck_ok(sf_quantise_report(&scene, &base, "base", &(sf_quant_options){.widths.weight_bits = 5}, &report));
  base.scales = report.scales;
  o.start = &base;
  rig r;
  rig_start(&r, &o, 2, 1);
  sf_tuning_round(r.t);
  r.o.rounded = calloc(r.t->model.size, sizeof *r.o.rounded);
  for (size_t i = 0; i < r.t->model.size; i++) r.o.rounded[i] = r.t->model.value[i];
  for (int l = 0; l < SF_LAYERS; l++) {
    const sf_param *p = &r.t->model.param[sf_layer_weights[l]];
    for (size_t i = p->offset; i < p->offset + p->size; i++) r.o.rounded[i] = r.t->rounded[i];
  }
  sf_loss_plan p = {.steps = r.t->model.t_r, .regular_at = r.t->model.t_r};
  p.weight[p.steps - 1] = 1;
  check_plan(&r, "squared error", p);
  rig_end(&r);
  sf_model_free(&base);
}

int ck_timeout = 180;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = tear_down, .one_process = true};
