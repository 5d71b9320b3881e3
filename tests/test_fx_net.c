/* The nets and the rendering of a ray against naive forms; event counts against counting each event. */
#include "tests/fx_fixture.h"

static void check_sizes(const fixture_sizes *sizes, uint64_t seed)
{
  fx_scene scene = fixture_scene(sizes, seed);
  fx_trace *trace = malloc(sizeof *trace);
  for (uint64_t n = 0; n < 4; n++) {
    int16_t f[32], dir[SF_DIR_MAX];
    fixture_inputs(seed, n, f, 32, n == 0 ? 2047 : 700);
    fixture_inputs(seed + 1, n, dir, SF_DIR_MAX, 1024);
    assert_sample(&scene.net, f, dir, trace);
  }
  free(trace);
  fx_scene_free(&scene);
}

START_TEST(net_equals_naive_at_full_size)
{
  for (int mode = FX_HYBRID; mode <= FX_NODECAY; mode++)
    for (int steps = 1; steps <= SF_T_MAX; steps++) {
      fixture_sizes sizes = fixture_ingp;
      sizes.mode = mode, sizes.steps = steps;
      check_sizes(&sizes, (uint64_t)(mode * 10 + steps));
    }
}
END_TEST

START_TEST(net_equals_naive_at_random_sizes)
{
  for (uint64_t seed = 0; seed < 150; seed++) {
    const fixture_sizes sizes = fixture_random_sizes(seed);
    check_sizes(&sizes, seed);
  }
}
END_TEST

/* The comparison means something only if a part of the neurons fires. */
START_TEST(fixture_fires_in_part)
{
  fx_scene scene = fixture_scene(&fixture_ingp, 77);
  fx_counts c = {0};
  int32_t base[SF_LANES];
  int16_t f[32], dir[SF_DIR_MAX];
  fixture_inputs(1, 0, dir, SF_DIR_MAX, 1024);
  fx_net_direction(&scene.net, dir, base, NULL);
  for (uint64_t n = 0; n < 50; n++) {
    fx_out out;
    fixture_inputs(2, n, f, 32, 700);
    fx_net_sample(&scene.net, f, base, &out, NULL, &c);
  }
  for (int l = 0; l < SF_LAYERS; l++) {
    if (l == FX_D2 || l == FX_C3) continue;
    for (int t = 0; t < scene.net.steps; t++) {
      ck_assert_uint_gt(c.layer[l].spikes[t], 50 * 128 / 50);
      ck_assert_uint_lt(c.layer[l].spikes[t], 50 * 128 * 3 / 4);
    }
  }
  fx_scene_free(&scene);
}
END_TEST

START_TEST(counts_add_up)
{
  fx_scene scene = fixture_scene(&fixture_ingp, 9);
  fx_counts all = {0}, parts = {0};
  int32_t base[SF_LANES] = {0};
  for (uint64_t n = 0; n < 20; n++) {
    int16_t f[32];
    fx_out out;
    fx_counts one = {0};
    fixture_inputs(3, n, f, 32, 700);
    fx_net_sample(&scene.net, f, base, &out, NULL, &all);
    fx_net_sample(&scene.net, f, base, &out, NULL, &one);
    fx_counts_add(&parts, &one);
  }
  ck_assert_mem_eq(&all, &parts, sizeof all);
  fx_scene_free(&scene);
}
END_TEST

/* ---- rays ---- */

typedef struct naive_user {
  const fx_net *net;
  fx_counts counts;
  int firsts;
} naive_user;

static sf_status eval_naive(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  naive_user *u = user;
  fx_trace *trace = malloc(sizeof *trace);
  naive_sample(u->net, f, ray->dir, first, out, trace, &u->counts);
  u->firsts += first;
  free(trace);
  return sf_ok();
}

static fx_ray diagonal_ray(uint64_t index)
{
  fx_ray ray = {.count = 60, .first_q16 = 12345};
  for (uint64_t a = 0; a < 3; a++) {
    const int64_t from = fixture_pick(5, a, index, 0, ((int64_t)1 << 31) - 1) << 9;
    const int64_t to = fixture_pick(6, a, index, 0, ((int64_t)1 << 31) - 1) << 9;
    ray.origin[a] = from, ray.step[a] = (to - from) / 60;
  }
  fixture_inputs(7, index, ray.dir, SF_DIR_MAX, 1024);
  return ray;
}

START_TEST(render_equals_naive_evaluation)
{
  fx_scene scene = fixture_scene(&fixture_ingp, 4);
  for (uint64_t i = 0; i < 12; i++) {
    const fx_ray ray = diagonal_ray(i);
    naive_user user = {.net = &scene.net};
    fx_pixel a, b;
    fx_counts counts = {0}, around = {0};
    ck_assert_int_eq(fx_render_ray(&scene, &ray, NULL, NULL, &a, &counts).code, SF_OK);
    ck_assert_int_eq(fx_render_ray(&scene, &ray, eval_naive, &user, &b, &around).code, SF_OK);
    fx_counts_add(&user.counts, &around);
    ck_assert_mem_eq(&a, &b, sizeof a);
    assert_same_counts(&counts, &user.counts);
    ck_assert_int_eq(user.firsts, a.samples > 0);
    ck_assert_uint_eq(counts.samples, a.samples);
    ck_assert_uint_eq(a.weight_sum + a.transmittance, 1 << 20);
  }
  fx_scene_free(&scene);
}
END_TEST

static sf_status eval_fails(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  (void)ray, (void)first, (void)f;
  *out = (fx_out){0};
  return ++*(int *)user == 3 ? sf_fail(SF_E_DIFFERENCE, "third sample") : sf_ok();
}

START_TEST(render_hands_on_a_failure)
{
  fx_scene scene = fixture_scene(&fixture_ingp, 4);
  memset(scene.occupancy, 0xff, 64);
  const fx_ray ray = diagonal_ray(1);
  fx_pixel pixel;
  int calls = 0;
  ck_assert_int_eq(fx_render_ray(&scene, &ray, eval_fails, &calls, &pixel, NULL).code, SF_E_DIFFERENCE);
  ck_assert_int_eq(calls, 3);
  fx_scene_free(&scene);
}
END_TEST

int main(void)
{
  Suite *suite = suite_create("fx_net");
  TCase *nets = tcase_create("nets");
  tcase_set_timeout(nets, 300);
  tcase_add_test(nets, net_equals_naive_at_full_size);
  tcase_add_test(nets, net_equals_naive_at_random_sizes);
  tcase_add_test(nets, fixture_fires_in_part);
  tcase_add_test(nets, counts_add_up);
  tcase_add_test(nets, render_equals_naive_evaluation);
  tcase_add_test(nets, render_hands_on_a_failure);
  suite_add_tcase(suite, nets);
  return fixture_run(suite);
}
