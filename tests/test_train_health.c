/* What goes wrong in training: layers that die, numbers that are not finite, scenes with nothing to see. */
#include "ck_run.h"
#include "train_fixture.h"

static void set_up(void)
{
  open_scene(6);
}

/* At the start each layer's currents over the probes have its own threshold as root mean square, integrators a half; of
 * the twin, too, whose biases are zero as well. */
LOOP_TEST(weights_start_at_the_thresholds, 4)
{
  const bool planes = _i % 2;
  sf_train_options o = planes ? sf_train_defaults_tensorf(&data) : small_run();
  const float theta[] = {0.2f, 0.4f, 0.7f};
  memcpy(o.config.theta, theta, sizeof theta);
  o.config.hidden = 32, o.config.occ_res = 16, o.voxels = 16, o.rays = 64, o.samples = 1024, o.seed = 4;
  for (int a = 0; a < 3 && planes; a++) o.config.tensorf.resolution[a] = 12;
  if (_i / 2) o.config.net = SF_NET_ANN, o.config.steps = 1;
  OWNED(trainer) t = start(&data, &o, NULL);
  const sf_model *m = &t->model;
  for (int id = SF_P_C1_BIAS; id <= SF_P_C3_BIAS; id += 2) /* weights lie between them */
    for (size_t i = 0; i < m->param[id].size; i++) ck_assert(m->value[m->param[id].offset + i] == 0);
  sf_probes p;
  double sum[SF_LAYERS] = {0};
  ck_ok(sf_probes_create(&p, t));
  sf_probes_draw(t, RNG_PROBE, PROBES, &p);
  for (int i = 0; i < PROBES * p.features; i++) p.f[i] *= t->backbone->growth;
  for (int i = 0; i < PROBES; i++) {
    sf_probe(m, &p, i, 1);
    for (int l = 0; l < SF_LAYERS; l++)
      for (int k = 0; sf_model_has(m, sf_layer_weights[l]) && k < (int)m->param[sf_layer_weights[l]].shape[0]; k++)
        sum[l] += pow((double)p.trace->current[l][0][k], 2);
  }
  const double target[SF_LAYERS] = {0.2, 0.5, 0.4, 0.7, 0.5};
  for (int l = 0; l < SF_LAYERS; l++) {
    if (!sf_model_has(m, sf_layer_weights[l])) continue;
    const double rms = sqrt(sum[l] / PROBES / (double)m->param[sf_layer_weights[l]].shape[0]);
    ck_assert_msg(fabs(rms / target[l] - 1) < 1e-3, "layer %d: %g, expected %g", l, rms, target[l]);
  }
  sf_probes_free(&p);
}

typedef struct outcome {
  int event; /* of the layer that was asked for */
  double mse;
  sf_train_stats stats;
} outcome;

/* Trains until an event of this layer, `most` iterations at most. mse: of the last 20. */
static outcome watch(sf_trainer *t, int layer, int most)
{
  outcome o = {0};
  double mse[20] = {0};
  for (int i = 0; i < most && !o.event; i++) {
    ck_ok(sf_trainer_step(t, &o.stats));
    o.event = o.stats.event[layer];
    mse[i % 20] = o.stats.mse / 20;
  }
  for (int i = 0; i < 20; i++) o.mse += mse[i];
  return o;
}

/* Faults of one layer: every weight times `factor`; where factor is 0, weights from `value` to twice that. A neuron of
 * radix spikes doubles its membrane in every step, so a small current soon fires again, and is no such fault. */
static const struct fault {
  sf_param_id id;
  int layer;
  float factor, value;
  int event;
  sf_input_mode mode;
} faults[] = {{SF_P_D1, 0, 1e-20f, 0, -1, SF_HYBRID}, {SF_P_C2, 2, 0, -1, -1, SF_HYBRID},
              {SF_P_C2, 2, 0, 0, -1, SF_HYBRID},      {SF_P_C2, 2, 0, 50, 1, SF_HYBRID},
              {SF_P_C1, 1, 1e-20f, 0, -1, SF_HYBRID}, {SF_P_C2, 2, 0, -1, -1, SF_RADIX},
              {SF_P_C2, 2, 0, 50, 1, SF_RADIX}};

static void plant(sf_trainer *t, const struct fault *f)
{
  float *w = sf_model_param(&t->model, f->id);
  for (size_t i = 0; i < t->model.param[f->id].size; i++)
    w[i] = f->factor > 0 ? f->factor * w[i] : f->value * (1 + (float)(i % 8) / 7);
}

static sf_train_options long_run(sf_input_mode mode)
{
  sf_train_options o = small_run();
  o.config.mode = mode;
  o.stage1 = 400;
  o.stage2 = 0;
  o.lr_net = 3e-4;                                   /* too slow for a dead layer to come back by itself, ... */
  for (int i = 0; i < 3; i++) o.config.theta[i] = 1; /* ... and its surrogate's slope too small */
  return o;
}

LOOP_TEST(dead_and_saturated_layers_are_reported_and_revived, CK_AMOUNT(COUNT(faults), 1))
{
  const struct fault *f = &faults[_i];
  const sf_train_options o = long_run(f->mode);
  OWNED(trainer) t = start(&data, &o, NULL);
  ck_assert_int_eq(watch(t, f->layer, 70).event, 0); /* a healthy run is left alone */
  plant(t, f);
  const outcome ill = watch(t, f->layer, 130);
  ck_assert_int_eq(ill.event, f->event);
  ck_assert_int_eq(ill.stats.revived[f->layer], 1);
  const float *w = sf_model_param(&t->model, f->id);
  if (f->event < 0)
    ck_assert_int_eq(ill.stats.quiet[f->layer], o.config.hidden);
  else /* too large, nothing else: only the scale is changed */
    ck_assert_float_eq_tol(w[7] / w[0], 2, 0.02f);
  t->options.lr_net = 3e-3;
  const outcome well = watch(t, f->layer, 120);
  ck_assert_int_eq(well.event, 0);
  ck_assert_double_gt(well.stats.firing[f->layer], 0.01);
  ck_assert_double_lt(well.stats.firing[f->layer], 0.9);
  ck_assert_int_lt(well.stats.quiet[f->layer], o.config.hidden);
  ck_assert_msg(well.mse < 0.9 * ill.mse, "error %g with the layer dead, %g with it back", ill.mse, well.mse);
}

/* The count of silence is part of a checkpoint. */
TEST(resume_while_a_layer_is_dead)
{
  const sf_train_options o = long_run(SF_RADIX);
  OWNED(trainer) whole = start(&data, &o, NULL);
  plant(whole, &faults[1]);
  steps(whole, 100);
  ck_ok(sf_trainer_save(whole, in("a.safetensors"), true));
  sf_trainer *part = start(&data, &o, in("a.safetensors"));
  ck_assert_int_eq(watch(whole, 2, 40).event, -1);
  ck_assert_int_eq(watch(part, 2, 40).event, -1);
  steps(whole, 10);
  steps(part, 10);
  same_model(whole, part);
  sf_trainer_free(part);
}

TEST(leaks_stay_in_range)
{
  sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  const float far[SF_LAYERS] = {-50, 50, 1e5f, -1e5f, 80};
  memcpy(sf_model_param(&t->model, SF_P_LEAK), far, sizeof far);
  const sf_train_stats s = steps(t, 1);
  for (int l = 0; l < SF_LAYERS; l++) {
    ck_assert_double_ge(s.tau[l], 1.0009);
    ck_assert_double_le(s.tau[l], 1000.1);
  }
  steps(t, 39);
  ck_ok(sf_trainer_save(t, in("leaks.safetensors"), true));
}

/* Every tensor: the run stops in the same iteration, and the checkpoint before it stays and goes on. A spiking net
 * could hide a NaN, which crosses no threshold. */
TEST(nan_stops_the_run_and_keeps_the_checkpoint)
{
  const sf_train_options o = small_run();
  sf_trainer *t = start(&data, &o, NULL);
  steps(t, 3);
  ck_ok(sf_trainer_save(t, in("good.safetensors"), true));
  sf_trainer_free(t);
  for (int i = 0; i < 2 * SF_P_COUNT; i++) {
    const int id = i / 2;
    if (id == SF_P_LEAK && i % 2) continue; /* k = sigmoid(Inf) = 1 is a number */
    t = start(&data, &o, in("good.safetensors"));
    if (!sf_model_has(&t->model, id)) {
      sf_trainer_free(t);
      continue;
    }
    float *value = sf_model_param(&t->model, id);
    for (size_t n = 0; n < t->model.param[id].size; n += id == SF_P_GRID ? 1 : 7) value[n] = i % 2 ? INFINITY : NAN;
    sf_train_stats stats;
    ck_bad(sf_trainer_step(t, &stats), SF_E_RANGE, "iteration 3", "");
    ck_bad(sf_trainer_save(t, in("good.safetensors"), true), SF_E_RANGE, "good.safetensors", t->model.param[id].name);
    sf_trainer_free(t);
  }
  t = start(&data, &o, in("good.safetensors"));
  ck_assert_int_eq(steps(t, 37).stage, 3);
  sf_trainer_free(t);
}

TEST(diverging_rate_stops_the_run)
{
  for (int grid = 0; grid < 2; grid++) {
    const sf_train_options o = small_run();
    OWNED(trainer) t = start(&data, &o, NULL);
    steps(t, 3);
    *(grid ? &t->options.lr_grid : &t->options.lr_net) = 1e30;
    sf_train_stats stats;
    sf_status status = sf_ok();
    for (int i = 0; i < 2 && !status.code; i++) status = sf_trainer_step(t, &stats);
    ck_bad(status, SF_E_RANGE, grid ? "iteration 4" : "iteration 3", grid ? "grid.table" : "density.w1");
    if (!grid) ck_bad(sf_trainer_save(t, in("bad.safetensors"), true), SF_E_RANGE, "density.w1", "diverged");
  }
}

static void paint(sf_dataset *data, uint16_t rgb, uint16_t alpha)
{
  for (int v = 0; v < data->count; v++)
    for (int i = 0; i < data->view[v].image.width * data->view[v].image.height; i++)
      for (int c = 0; c < 4; c++) data->view[v].image.rgba[4 * i + c] = c < 3 ? rgb : alpha;
}

enum {
  WHITE,
  TRANSPARENT,
  ONE_VIEW,
  SCENES,
  BETA = SCENES,
  ONE_STEP,
  ALL_STEPS,
  SMALL,
  COARSE,
  NO_DECAY,
  DECAY,
  RADIX,
  CASES
};

static void harden(int which, sf_dataset *data, sf_train_options *o)
{
  if (which == WHITE) paint(data, 65535, 65535);
  if (which == TRANSPARENT) paint(data, 0, 0);
  if (which == ONE_VIEW) data->count = 1;
  if (which == BETA) o->beta = 1;
  if (which == ONE_STEP) o->config.steps = 1;
  if (which == ALL_STEPS) o->config.steps = SF_T_MAX;
  if (which == SMALL) o->config.hidden = 16;
  if (which == COARSE) o->config.lattice = 16;
  if (which == DECAY) o->config.mode = SF_DECAY;
  if (which == NO_DECAY) o->config.mode = SF_NODECAY;
  if (which == RADIX) o->config.mode = SF_RADIX;
}

static void hard_case(int which, int net)
{
  OWNED(sf_dataset) data = load("train");
  const int views = data.count;
  sf_train_options o = small_run();
  o.stage1 = CK_AMOUNT(30, 12);
  o.stage2 = CK_AMOUNT(70, 28);
  o.config.net = net;
  harden(which, &data, &o);
  if (net == SF_NET_ANN) o.config.steps = 1;
  sf_trainer *t = start(&data, &o, NULL);
  double first = 0, last = 0;
  const int all = o.stage1 + o.stage2;
  for (int i = 0; i < all; i++) {
    const sf_train_stats s = steps(t, 1);
    if (i < 10) first += s.mse;
    if (i >= all - 10) last += s.mse;
    ck_assert(isfinite(s.loss) && isfinite(s.mse));
    ck_assert(s.t_star >= 1 && s.t_star <= o.config.steps && s.t_r >= 1 && s.t_r <= o.config.steps);
    for (int l = 0; l < SF_LAYERS; l++) ck_assert(s.tau[l] > 1.0009 && s.tau[l] < 1000.1);
    for (int l = 0; l < 3; l++) ck_assert(s.firing[l] >= 0 && s.firing[l] <= 1);
  }
  ck_assert_msg(last < first, "error %g at first, %g at last", first / 10, last / 10);
  if (which == BETA) ck_assert_int_eq(t->model.t_r, 1);
  ck_ok(sf_trainer_save(t, in("hard.safetensors"), false));
  sf_trainer_free(t);
  data.count = views;
}

LOOP_TEST(hard_cases_stay_finite_and_in_range, CASES)
{
  hard_case(_i, SF_NET_SNN);
}

LOOP_TEST(hard_scenes_with_the_twin, SCENES)
{
  hard_case(_i, SF_NET_ANN);
}

int ck_timeout = 180;
ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
