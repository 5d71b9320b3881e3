/* Samples near a camera (--near-camera): how near is near, and by how much they learn slower. The gradients of both
 * fields are in test_gradient.c. */
#include "ck_run.h"
#include "train_fixture.h"

enum { WIDE = 10 };

static void set_up(void)
{
  open_scene(6);
}

/* All cameras at (0, 0, 2): the mean distance is known. */
static sf_dataset two_away(sf_view *view)
{
  sf_dataset all = data;
  memcpy(view, data.view, (size_t)data.count * sizeof *view);
  for (int v = 0; v < data.count; v++) {
    const float pose[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2};
    memcpy(view[v].camera.to_world, pose, sizeof pose);
  }
  all.view = view;
  return all;
}

TEST(how_near_is_near)
{
  sf_view view[WIDE];
  const sf_dataset cameras = two_away(view);
  sf_train_options o = small_run();
  ck_assert_float_eq(sf_near_camera(&cameras, &o), 1);
  o.near_camera = 0.25;
  ck_assert_float_eq(sf_near_camera(&cameras, &o), 0.5f);
  o.objective = SF_OBJECTIVE_PAPER;
  ck_assert_float_eq(sf_near_camera(&cameras, &o), 0);
  o = small_run();
  sf_dataset forward = facing_forward(&data, view);
  ck_assert_float_eq(sf_near_camera(&forward, &o), 0);
}

/* A box of [-1, 1]^3 and a camera at (0, 0, 2) that looks down: samples at distances 1.25, 1.5 and 2. */
TEST(slower_with_the_square_of_the_distance)
{
  sf_train_options o = small_run();
  OWNED(trainer) t = start(&data, &o, NULL);
  ck_ok(sf_march_steps(&t->intervals, &t->model, 1));
  const sf_ray ray = {.origin = {0, 0, 2}, .direction = {0, 0, -1}, .count = 3};
  const float x[3 * WIDE] = {[WIDE - 1] = 0.5f, [2 * WIDE - 1] = 0.5f, [3 * WIDE - 1] = 0.875f};
  const float at[9] = {0.5f, 0.5f, 0.875f, 0.5f, 0.5f, 0.75f, 0.5f, 0.5f, 0.5f};
  t->near_camera = 2.5f;
  ck_assert_float_eq_tol(sf_near_weight(t, &ray, x + WIDE - 1, WIDE), 0.25f, 1e-6f);
  t->near_camera = 1.5f;
  sf_ray_work w;
  ck_ok(sf_ray_work_create(&w, 3));
  const sf_loss_plan plan = {.steps = 2, .weight = {0, 1}};
  for (int step = 0; step < 2; step++)
    for (int s = 0; s < 3; s++) {
      w.dsigma[step][s] = 36;
      for (int c = 0; c < 3; c++) w.dcolour[step][3 * s + c] = 72;
    }
  sf_near_slow(t, &plan, &ray, at, 0, 1, &w);
  static const float share[3] = {25.0f / 36, 1, 1};
  for (int s = 0; s < 3; s++) {
    ck_assert_float_eq(w.dsigma[0][s], 36); /* of no loss */
    ck_assert_float_eq_tol(w.dsigma[1][s], 36 * share[s], 1e-4f);
    for (int c = 0; c < 3; c++) ck_assert_float_eq_tol(w.dcolour[1][3 * s + c], 72 * share[s], 1e-4f);
  }
  const sf_ray shorter = {.origin = {0, 0, 1}, .direction = {0, 0, -1}, .count = 1};
  t->near_camera = 0.75f;
  sf_near_slow(t, &plan, &shorter, at, 0, 1, &w);
  ck_assert_float_eq_tol(w.dsigma[1][0], 25.0f / 9, 1e-4f);
  ck_assert_float_eq(w.dsigma[1][1], 36); /* at 0.5, but of the next ray */
  free(w.memory);
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
