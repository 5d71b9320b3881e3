/* The tail of a ray (--opaque): samples in and behind a surface, and what they cost in training. Its gradient is in
 * test_gradient.c. */
#include "ck_run.h"
#include "train_fixture.h"

static void set_up(void)
{
  open_scene(6);
}

enum { N = 5 };

/* sigma delta of samples 0.05 apart, and what L_opaque alone does to their densities. The pixel is of one colour, so
 * that every other term but that of sparsity is flat. */
static double slopes(const float depth[N], float slope[N])
{
  sf_ray_work w;
  ck_ok(sf_ray_work_create(&w, N));
  const sf_ray ray = {.target = {0.5f, 0.5f, 0.5f}, .background = {0.5f, 0.5f, 0.5f}, .count = N};
  const float delta[N] = {0.05f, 0.05f, 0.05f, 0.05f, 0.05f};
  sf_loss_plan plan = {
      .steps = T, .regular_at = T, .weight = {[T - 1] = 1}, .inverse_rays = 0.25f, .stop = (float)log(1e-4)};
  sf_loss_sums with = {0}, without = {0};
  for (int s = 0; s < N; s++) {
    w.sigma[T - 1][s] = depth[s] / delta[s];
    for (int c = 0; c < 3; c++) w.colour[T - 1][3 * s + c] = 0.5f;
  }
  sf_loss_ray(&plan, &ray, delta, &w, &without);
  for (int s = 0; s < N; s++) slope[s] = -w.dsigma[T - 1][s];
  plan.opaque = 2;
  sf_loss_ray(&plan, &ray, delta, &w, &with);
  for (int s = 0; s < N; s++) slope[s] += w.dsigma[T - 1][s];
  ck_assert_double_eq(without.tail, 0);
  ck_assert_double_eq_tol(sf_loss_total(&plan, &with, 0) - sf_loss_total(&plan, &without, 0), 2 * with.tail, 1e-5);
  free(w.memory);
  return with.tail;
}

/* The light in front of the samples is e^0, e^-3, e^-5, e^-8 and e^-10: the tail begins with the second, and the last
 * is past the end. Of the way from ln 0.9 to ln 1e-4, 9.105, the three have 6.210, 4.210 and 1.210 left. */
TEST(tail_by_hand)
{
  float slope[N];
  const double way = log(0.9 / 1e-4), end = log(1e-4);
  ck_assert_double_eq_tol(slopes((const float[N]){3, 2, 3, 2, 1}, slope), (-3 - 5 - 8 - 3 * end) / way, 1e-5);
  const double one = 2 * 0.25 * 0.05 / way; /* weight, rays, length; by alpha */
  ck_assert_float_eq(slope[0], 0);          /* the surface */
  ck_assert_double_eq_tol(slope[1], -2 * one * (1 - exp(-2)), 1e-3 * one);
  ck_assert_double_eq_tol(slope[2], -one * (1 - exp(-3)), 1e-3 * one);
  ck_assert_float_eq(slope[3], 0); /* nothing behind it */
  ck_assert_float_eq(slope[4], 0);
}

/* Fog, and a ray that goes on behind a thin surface. */
TEST(rays_that_light_passes_have_no_tail)
{
  static const float fog[N] = {0.5f, 0.5f, 0.5f, 0.5f, 0.5f}, thin[N] = {3, 2, 1, 1, 1}, wall[N] = {12, 1, 1, 1, 1};
  const float *const depth[3] = {fog, thin, wall};
  for (int i = 0; i < 3; i++) {
    float slope[N];
    ck_assert_double_eq(slopes(depth[i], slope), 0);
    for (int s = 0; s < N; s++) ck_assert_float_eq(slope[s], 0);
  }
}

/* The tail begins within a surface: the light in front of its samples is 1, 0.95, 0.86, 0.37 and e^-10. */
TEST(surfaces_belong_to_the_tail)
{
  float slope[N];
  const double way = log(0.9 / 1e-4), end = log(1e-4);
  ck_assert_double_eq_tol(slopes((const float[N]){0.05f, 0.1f, 0.85f, 9, 1}, slope), (-0.15 - 1 - 2 * end) / way, 1e-5);
  const double one = 2 * 0.25 * 0.05 / way;
  ck_assert_float_eq(slope[1], 0); /* nine tenths of the light are still there */
  ck_assert_double_eq_tol(slope[2], -one * (1 - exp(-0.85)), 1e-3 * one);
}

/* L = C M ln N: a sample more of a ray costs C M / N. C grows from nothing, a quarter through the run. */
TEST(price_by_hand)
{
  sf_train_options o = small_run();
  o.opaque = 0.4;
  OWNED(trainer) t = start(&data, &o, NULL);
  ck_assert_float_eq(sf_tail_price(t), 0);
  t->batch.samples = 600, t->batch.rays = 50;
  sf_tail_update(t, 0.03);
  t->progress = 0.25;
  ck_assert_float_eq(sf_tail_price(t), 0);
  t->progress = 0.5;
  ck_assert_double_eq_tol(sf_tail_price(t), 0.4 / 3 * 0.03 / 12, 1e-9);
  t->progress = 1;
  ck_assert_double_eq_tol(sf_tail_price(t), 0.4 * 0.03 / 12, 1e-9);
  t->batch.samples = 1100;
  sf_tail_update(t, 0.01);
  ck_assert_double_eq_tol(sf_tail_price(t), 0.4 * (0.98 * 0.03 + 0.02 * 0.01) / (0.98 * 12 + 0.02 * 22), 1e-9);
}

/* Long enough for surfaces, whose rays have a tail. */
static sf_train_options solid_run(void)
{
  sf_train_options o = small_run();
  o.stage1 = 400, o.stage2 = 400, o.fixed_steps = 2, o.samples = 2048;
  o.config.lattice = 256, o.config.log2_hash = 14;
  o.opaque = 4;
  o.config.stop = 1e-4; /* a long tail */
  return o;
}

/* Samples of a ray, mean of the last quarter of a run. */
static double ray_length(const sf_train_options *o)
{
  OWNED(trainer) t = start(&data, o, NULL);
  double samples = 0, rays = 0;
  const int whole = o->stage1 + o->stage2;
  for (int i = 0; i < whole; i++) {
    const sf_train_stats s = steps(t, 1);
    if (4 * i >= 3 * whole) samples += s.samples, rays += s.rays;
  }
  return samples / rays;
}

LOOP_TEST(rays_end_sooner, CK_AMOUNT(2, 0)) /* as a LONG_TEST */
{
  sf_train_options o = solid_run();
  if (_i) o.config.net = SF_NET_ANN, o.config.steps = 1, o.fixed_steps = 0;
  const double after = ray_length(&o);
  o.opaque = 0;
  const double before = ray_length(&o);
  ck_assert_msg(after < 0.6 * before, "%g samples a ray without, %g with", before, after);
}

TEST(averages_are_resumed)
{
  sf_train_options o = solid_run();
  o.stage1 = 40, o.stage2 = 80;
  ck_resume(&o, &o, 60, 20);
}

/* The paper's objective has the paper's losses. */
TEST(the_paper_has_no_tail)
{
  sf_train_options o = solid_run();
  o.objective = SF_OBJECTIVE_PAPER;
  o.stage1 = 40, o.stage2 = 80;
  OWNED(trainer) on = start(&data, &o, NULL);
  o.opaque = 0;
  OWNED(trainer) off = start(&data, &o, NULL);
  steps(on, 110), steps(off, 110);
  same_model(on, off);
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
