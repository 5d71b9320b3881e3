/* L_distortion: light that a ray gathers comes from one place. Gradients through both fields are in test_gradient.c. */
#include "ck_run.h"
#include "render/composite.h"
#include "train_fixture.h"

enum { N = 4, WIDE = 10 };

static void set_up(void)
{
  open_scene(6);
}

/* By the formula of the paper, pair by pair. */
static double by_pairs(const float *weight, const float *place, const float *span)
{
  double sum = 0;
  for (int i = 0; i < N; i++) {
    sum += (double)weight[i] * weight[i] * span[i] / 3;
    for (int j = 0; j < N; j++) sum += (double)weight[i] * weight[j] * fabs((double)place[i] - place[j]);
  }
  return sum;
}

/* Half of the light at 0.2, a quarter at 0.6: 2 0.5 0.25 0.4 between them, and the two intervals' own. */
TEST(two_places_by_hand)
{
  static const float delta[N] = {1, 1, 1, 1}, weight[N] = {0.5f, 0, 0.25f, 0};
  float place[N] = {0.2f, 0.3f, 0.6f, 0.7f}, span[N] = {0.03f, 0.03f, 0.06f, 0.06f}, slope[N] = {0}, spare[N];
  sf_ray_work w = {.place = place, .span = span, .spare[5] = spare};
  ck_assert_double_eq_tol(sf_distortion_add(N, weight, 0.25f, delta, 1, &w, slope),
                          0.1 + 0.25 * 0.03 / 3 + 0.0625 * 0.06 / 3, 1e-7);
}

/* Against differences, in fog and behind a surface; what was in the gradient stays. */
TEST(slopes_by_differences)
{
  static const float delta[N] = {0.5f, 1, 0.25f, 2};
  float place[N] = {0.1f, 0.25f, 0.5f, 0.875f}, span[N] = {0.05f, 0.125f, 0.0625f, 0.25f};
  sf_ray_work w;
  ck_ok(sf_ray_work_create(&w, N));
  memcpy(w.place, place, sizeof place);
  memcpy(w.span, span, sizeof span);
  for (int fog = 0; fog < 2; fog++) {
    const float sigma[N] = {0.5f, fog ? 0.25f : 6, 1, 0.75f};
    float weight[N], slope[N] = {7, 7, 7, 7};
    const float behind = sf_composite_weights(N, sigma, delta, weight);
    ck_assert_double_eq_tol(sf_distortion_add(N, weight, behind, delta, 3, &w, slope), by_pairs(weight, place, span),
                            1e-6);
    for (int i = 0; i < N; i++) {
      const float step = 1.0f / 64;
      double value[2];
      for (int side = 0; side < 2; side++) {
        float moved[N];
        memcpy(moved, sigma, sizeof moved);
        moved[i] += side ? step : -step;
        sf_composite_weights(N, moved, delta, weight);
        value[side] = by_pairs(weight, place, span);
      }
      const double expected = 3 * (value[1] - value[0]) / (2 * (double)step); /* and its third derivative / 6 / 64^2 */
      ck_assert_double_eq_tol(slope[i] - 7, expected, 1e-4 + 1e-3 * fabs(expected));
    }
  }
  free(w.memory);
}

/* A box of [-1, 1]^3 and a camera at (0, 0, 2) that looks down: samples at distances 1, 1.5 and 3. */
TEST(places_by_hand)
{
  sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  ck_ok(sf_march_steps(&t->intervals, &t->model, 1));
  const sf_ray ray = {.origin = {0, 0, 2}, .direction = {0, 0, -1}, .count = 3};
  const float z[3] = {1, 0.75f, 0}, delta[3] = {0.125f, 0.25f, 0.5f};
  float x[3 * WIDE * 2] = {0}; /* the last lane of one block, and the first two of the next */
  for (int s = 0; s < 3; s++) {
    const int lane = WIDE - 1 + s;
    for (int a = 0; a < 3; a++) x[(lane / WIDE * 3 + a) * WIDE + lane % WIDE] = a == 2 ? z[s] : 0.5f;
  }
  sf_ray_work w;
  ck_ok(sf_ray_work_create(&w, 3));
  t->distortion_unit = 2;
  sf_distortion_place(t, &ray, x, WIDE - 1, WIDE, delta, &w);
  static const float away[3] = {1, 1.5f, 3};
  for (int s = 0; s < 3; s++) {
    ck_assert_float_eq_tol(w.place[s], away[s] / 2, 1e-6f);
    ck_assert_float_eq(w.span[s], delta[s] / 2);
  }
  free(w.memory);
}

TEST(unit_follows_the_cameras)
{
  sf_view view[WIDE];
  const double distance = sf_dataset_distance(&data);
  ck_assert_double_gt(distance, 1);
  ck_assert_double_eq_tol(sf_distortion_unit(&data), distance, 1e-6 * distance);
  const sf_dataset inside = {.count = 1, .view = view};
  view[0] = data.view[0];
  view[0].camera.to_world[3] = view[0].camera.to_world[7] = view[0].camera.to_world[11] = 0.01f;
  ck_assert_float_eq(sf_distortion_unit(&inside), 1);
  const sf_dataset forward = facing_forward(&data, view);
  ck_assert_float_eq(sf_distortion_unit(&forward), 2 * 0.9f); /* the box of NDC, -1..1, at its scale */
  sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  ck_assert_float_eq(t->distortion_unit, sf_distortion_unit(&data));
}

/* Does a training hear of the option? */
static bool is_heard(sf_train_options o)
{
  o.distortion = 10;
  OWNED(trainer) on = start(&data, &o, NULL);
  o.distortion = 0;
  OWNED(trainer) off = start(&data, &o, NULL);
  steps(on, 30), steps(off, 30);
  return memcmp(on->model.value, off->model.value, on->model.size * sizeof(float)) != 0;
}

/* For both fields and both nets. The paper's objective has the paper's losses. */
TEST(the_paper_has_none)
{
  sf_train_options o = small_run();
  ck_assert(is_heard(o));
  o.objective = SF_OBJECTIVE_PAPER;
  ck_assert(!is_heard(o));
  o = small_run();
  o.config.net = SF_NET_ANN, o.config.steps = 1;
  ck_assert(is_heard(o));
  o = sf_train_defaults_tensorf(&data);
  o.voxels = 16, o.rays = 128, o.samples = 4096, o.stage1 = 12, o.stage2 = 28;
  ck_assert(is_heard(o));
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
