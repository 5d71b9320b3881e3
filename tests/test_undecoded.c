/* TensoRF's samples that are not decoded: the weight up to which they are not follows the light that they take. */
#include "ck_run.h"
#include "src/quant/internal.h"
#include "tensorf_fixture.h"
#include "tests/quant_fixture.h"
#include "vm_fixture.h"
#include <math.h>

static void set_up(void)
{
  open_scene(4);
}

static double stop_of(const sf_trainer *t)
{
  return sf_trainer_model(t)->config.tensorf.weight_stop;
}

static void begin(sf_trainer **t, double undecoded)
{
  sf_train_options o = small_vm(SF_NET_SNN);
  o.undecoded = undecoded;
  ck_ok(sf_trainer_create(t, &data, &o, NULL));
}

typedef struct light {
  double all, undecoded;
  int decoded, wrong;
} light;

/* Draws the rays of an iteration; the field stays. wrong: samples for which `hit` is not as the weight says. */
static light drawn(sf_trainer *t, int iteration)
{
  const float stop = (float)stop_of(t);
  light sum = {0};
  t->iteration = iteration;
  ck_ok(sf_vm_draw(t));
  for (int r = 0; r < t->batch.rays; r++) {
    const sf_vm_ray_samples *ray = &t->vm->ray[r];
    const float *weight = t->vm->part[ray->part].weight + ray->first;
    for (int s = 0; s < ray->count; s++) {
      const bool hit = t->batch.hit[r][s / 64] >> s % 64 & 1;
      sum.wrong += hit != (weight[s] > stop);
      sum.decoded += hit;
      sum.all += weight[s];
      if (!hit) sum.undecoded += weight[s];
    }
  }
  ck_assert_int_eq(sum.decoded, t->batch.samples);
  return sum;
}

/* A soft ball: many faint samples in front of each surface. The share comes out as asked for, whatever it is. */
TEST(as_much_light_as_was_asked_for)
{
  static const double asked[] = {0.003, 0.01, 0.03};
  int more = 1 << 30;
  for (int i = 0; i < COUNT(asked); i++) {
    OWNED(trainer) t = NULL;
    light sum = {0};
    begin(&t, asked[i]);
    put_ball(&t->model);
    for (int k = 0; k < 400; k++) {
      const light now = drawn(t, k);
      ck_assert_int_eq(now.wrong, 0);
      if (k < 200) continue;
      sum.all += now.all, sum.undecoded += now.undecoded, sum.decoded += now.decoded;
    }
    const double share = sum.undecoded / sum.all;
    ck_assert_msg(share > 0.85 * asked[i] && share < 1.15 * asked[i], "%g asked for, %g undecoded", asked[i], share);
    ck_assert_int_lt(sum.decoded, more);
    more = sum.decoded;
  }
}

/* Where the error of rays with light is below 1/300, the share falls with its root. */
TEST(less_light_where_the_error_is_small)
{
  static const double error[] = {1.0 / 300, 1.0 / 1200, 1.0 / 3000, 1e-2};
  for (int i = 0; i < COUNT(error); i++) {
    const double expected = 0.02 * sqrt(fmin(300 * error[i], 1));
    OWNED(trainer) t = NULL;
    light sum = {0};
    begin(&t, 0.02);
    put_ball(&t->model);
    for (int k = 0; k < 400; k++) {
      const light now = drawn(t, k);
      t->tail = (sf_tail){.error = error[i] * now.all / t->batch.rays, .samples = 1};
      if (k >= 200) sum.all += now.all, sum.undecoded += now.undecoded;
    }
    const double share = sum.undecoded / sum.all;
    ck_assert_msg(share > 0.85 * expected && share < 1.15 * expected, "%g of light undecoded at an error of %g", share,
                  error[i]);
  }
}

/* Also where --opaque, which needs it too, is off. */
TEST(the_error_is_resumed)
{
  sf_train_options o = small_vm(SF_NET_SNN);
  OWNED(trainer) t = NULL, resumed = NULL;
  o.opaque = 0;
  ck_ok(sf_trainer_create(&t, &data, &o, NULL));
  t->tail = (sf_tail){.error = 0.0021, .samples = 7};
  ck_ok(sf_trainer_save(t, in("part.safetensors"), true));
  ck_ok(sf_trainer_create(&resumed, &data, &o, in("part.safetensors")));
  ck_assert_double_eq(resumed->tail.error, 0.0021);
  ck_assert_double_eq(resumed->tail.samples, 7);
}

/* It is never less than TensoRF's. */
TEST(not_below_where_it_begins)
{
  OWNED(trainer) t = NULL;
  begin(&t, 1e-6);
  put_ball(&t->model);
  for (int k = 0; k < 40; k++) drawn(t, k);
  ck_assert_double_eq(stop_of(t), 1e-4);
}

/* 0: TensoRF's weight. The paper's objective has no other. */
TEST(none_where_it_is_off)
{
  for (int paper = 0; paper < 2; paper++) {
    sf_train_options o = small_vm(SF_NET_SNN);
    OWNED(trainer) t = NULL;
    if (paper)
      o.objective = SF_OBJECTIVE_PAPER;
    else
      o.undecoded = 0;
    ck_ok(sf_trainer_create(&t, &data, &o, NULL));
    put_ball(&t->model);
    for (int k = 0; k < 40; k++) drawn(t, k);
    ck_assert_double_eq(stop_of(t), 1e-4);
  }
}

/* In fog every sample has nearly the same weight. Where that is the weight that decides, all light would go undecoded;
 * one iteration in ten at most may lose most of it. */
TEST(fog_is_decoded)
{
  OWNED(trainer) t = NULL;
  begin(&t, 0.01);
  int lost = 0;
  memset(t->model.value, 0, t->model.param[SF_P_APP_PLANE].offset * sizeof(float));
  t->model.config.tensorf.shift = -9;
  for (int k = 0; k < 400; k++) {
    const light now = drawn(t, k);
    ck_assert_double_gt(now.all, 0.5);
    lost += k >= 100 && now.undecoded > 0.5 * now.all;
  }
  ck_assert_double_gt(stop_of(t), 2 * SF_WEIGHT_STOP_FIRST);
  ck_assert_int_le(lost, 10);
}

/* A model that is fine-tuned has settled it. */
TEST(fine_tuning_keeps_it)
{
  sf_train_options o = small_vm(SF_NET_SNN);
  OWNED(trainer) t = NULL, tuned = NULL;
  sf_quant_report report;
  OWNED(fx_scene) scene = {0};
  OWNED(sf_model) m = {0};
  begin(&t, 0.01);
  put_ball(&t->model);
  t->model.config.tensorf.weight_stop = 0.0043;
  ck_ok(sf_model_save(&t->model, in("ball.safetensors")));
  ck_ok(sf_model_load(&m, in("ball.safetensors")));
  ck_ok(sf_quantise_report(&scene, &m, "model", &plain, &report));
  m.scales = report.scales;
  o.start = &m;
  ck_ok(sf_trainer_create(&tuned, &data, &o, NULL));
  for (int k = 0; k < 3; k++) drawn(tuned, k);
  ck_assert_double_eq(stop_of(tuned), 0.0043);
}

/* Files keep it, the scene has floor(w 2^20). A file that does not say means 1e-4. */
TEST(files_keep_it)
{
  static const struct {
    double stop;
    bool said;
    int expected;
  } cases[] = {
      {0.01, true, 10485}, {1e-4, false, 104}, {SF_WEIGHT_STOP_MIN, true, 1}, {SF_WEIGHT_STOP_MAX, true, 52428}};
  OWNED(sf_model) m = test_tensorf(SF_NET_SNN, 0, 32, 2);
  for (int i = 0; i < COUNT(cases); i++) {
    OWNED(sf_model) back = {0};
    OWNED(fx_scene) scene = {0};
    OWNED(sf_tensors) set = {0};
    m.config.tensorf.weight_stop = cases[i].stop;
    ck_ok(sf_model_save(&m, in("stop.safetensors")));
    ck_ok(sf_tensors_load(&set, in("stop.safetensors")));
    ck_assert_ptr_nonnull(sf_tensors_meta(&set, "weight_stop"));
    if (!cases[i].said) cJSON_DeleteItemFromObjectCaseSensitive(set.metadata, "weight_stop");
    ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, in("edited.safetensors")));
    ck_ok(sf_model_load(&back, in("edited.safetensors")));
    ck_assert_double_eq(back.config.tensorf.weight_stop, cases[i].stop);
    ck_ok(sf_quantise(&scene, &back, "model", &plain));
    ck_assert_int_eq(scene.tensorf.weight_stop, cases[i].expected);
  }
  m.config.tensorf.weight_stop = 2 * SF_WEIGHT_STOP_MAX;
  ck_bad(sf_config_check(&m.config), SF_E_RANGE, "weight_stop", "outside 1e-06..0.05");
}

int ck_timeout = 120;
ck_options ck_program = {.set_up = set_up, .tear_down = close_scene};
