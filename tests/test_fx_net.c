/* The nets and the rendering of a ray against naive forms; event counts against counting each event. */
#include "ck_run.h"
#include "tests/fx_fixture.h"

static void check_sizes(const fixture_sizes *sizes, uint64_t seed)
{
  OWNED(fx_scene) scene = fixture_scene(sizes, seed);
  fx_trace *trace = malloc(sizeof *trace);
  for (uint64_t n = 0; n < 4; n++) {
    int16_t f[32], dir[SF_DIR_MAX];
    fixture_inputs(seed, n, f, 32, n == 0 ? 2047 : 700);
    fixture_inputs(seed + 1, n, dir, SF_DIR_MAX, n == 0 ? 2047 : 1024);
    assert_sample(&scene.net, f, dir, trace);
  }
  free(trace);
}

TEST(net_equals_naive_at_full_size)
{
  for (int mode = FX_HYBRID; mode <= FX_RADIX; mode++)
    for (int steps = 1; steps <= SF_T_MAX; steps++) {
      fixture_sizes sizes = fixture_ingp;
      sizes.mode = mode, sizes.steps = steps;
      check_sizes(&sizes, (uint64_t)(mode * 10 + steps));
    }
}

TEST(net_equals_naive_at_random_sizes)
{
  for (uint64_t seed = 0; seed < 150; seed++) {
    const fixture_sizes sizes = fixture_random_sizes(seed);
    check_sizes(&sizes, seed);
  }
}

TEST(decoder_equals_naive)
{
  for (int mode = FX_HYBRID; mode <= FX_RADIX; mode++)
    for (int steps = 1; steps <= SF_T_MAX; steps++) {
      fixture_sizes sizes = fixture_decoder;
      sizes.mode = mode, sizes.steps = steps, sizes.n_dir = steps % 2 ? 150 : 30;
      check_sizes(&sizes, (uint64_t)(mode * 10 + steps));
    }
  for (uint64_t seed = 0; seed < 150; seed++) {
    const fixture_sizes sizes = fixture_random_decoder(seed);
    check_sizes(&sizes, seed);
  }
}

/* All weights and inputs at their rails: the exact sum of 160 products needs 27 bits, a membrane has 24. */
TEST(decoder_current_saturates)
{
  fixture_sizes sizes = fixture_decoder;
  sizes.n_dir = SF_DIR_MAX, sizes.bias[FX_C1] = 2047;
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  const fx_layer *c1 = &scene.net.layer[FX_C1];
  for (int i = 0; i < fx_layer_rows(c1); i++)
    for (int o = 0; o < SF_LANES; o++) c1->w[i * SF_LANES + o] = o % 2 ? 127 : -127;
  int16_t dir[SF_DIR_MAX];
  for (int i = 0; i < SF_DIR_MAX; i++) dir[i] = 2047;
  fx_trace *trace = malloc(sizeof *trace);
  assert_sample(&scene.net, NULL, dir, trace);
  ck_assert_int_eq(trace->current[FX_C1][0][0], -(1 << 23));
  ck_assert_int_eq(trace->current[FX_C1][1][1], (1 << 23) - 1);
  fx_counts counts = {0};
  int32_t base[SF_LANES];
  fx_out out;
  fx_net_direction(&scene.net, dir, base, &counts);
  ck_assert_int_eq(base[1], 161 * 2047 * 127);
  fx_net_sample(&scene.net, NULL, base, &out, NULL, &counts);
  ck_assert_uint_eq(counts.saturated[FX_C1], SF_LANES);
  ck_assert_uint_eq(counts.rays, 0);
  free(trace);
}

/* The paper's TensoRF decoder: 150 -> 128 -> 128 -> 3 has 35968 synapses, biases not among them. */
TEST(decoder_macs_are_the_papers)
{
  const fixture_sizes sizes = {0, 0, 0, 150, 128, 128, 3, FX_HYBRID, {[FX_C1] = 900, [FX_C2] = 1, [FX_C3] = 1}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 4);
  const fx_layer *l = scene.net.layer;
  ck_assert_int_eq(l[FX_C1].n_in * l[FX_C1].n_out + l[FX_C2].n_in * l[FX_C2].n_out + l[FX_C3].n_in * l[FX_C3].n_out,
                   35968);
  fx_counts c = {0};
  fx_out out;
  const int32_t silent[SF_LANES] = {0};
  scene.net.steps = 2;
  fx_net_sample(&scene.net, NULL, silent, &out, NULL, &c);
  ck_assert_uint_eq(c.layer[FX_C1].mac[0], 150 * 128);
  ck_assert_uint_eq(c.layer[FX_C1].weight[0], 151 * 128);
  ck_assert_uint_eq(c.layer[FX_C2].sop[0], 0);
  ck_assert_uint_eq(c.layer[FX_C2].weight[0], 128);
  ck_assert_uint_eq(c.layer[FX_C2].weight[1], 0);
  ck_assert_uint_eq(c.layer[FX_C3].weight[0], 3);
  ck_assert_uint_eq(c.layer[FX_C3].weight[1], 0);
}

/* The comparison means something only if a part of the neurons fires. */
TEST(fixture_fires_in_part)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 77);
  fx_counts c = {0};
  int32_t base[SF_LANES];
  int16_t f[32], dir[FX_SH];
  fixture_inputs(1, 0, dir, FX_SH, 1024);
  fx_net_direction(&scene.net, dir, base, NULL);
  for (uint64_t n = 0; n < 50; n++) {
    fx_out out;
    fixture_inputs(2, n, f, 32, 700);
    fx_net_sample(&scene.net, f, base, &out, NULL, &c);
  }
  for (int l = 0; l < SF_LAYERS; l++) {
    if (l == FX_D2 || l == FX_C3) continue;
    for (int t = 0; t < scene.net.steps; t++) {
      ck_assert_uint_gt(c.layer[l].spikes[t], 50 * SF_LANES / 50);
      ck_assert_uint_lt(c.layer[l].spikes[t], 50 * SF_LANES * 4 / 5);
    }
  }
}

TEST(counts_add_up)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 9);
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
}

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
  fixture_inputs(7, index, ray.dir, FX_SH, 1024);
  return ray;
}

TEST(render_equals_naive_evaluation)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 4);
  for (uint64_t i = 0; i < 12; i++) {
    const fx_ray ray = diagonal_ray(i);
    naive_user user = {.net = &scene.net};
    fx_pixel a, b;
    fx_counts counts = {0}, around = {0};
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &a, &counts));
    ck_ok(fx_render_ray(&scene, &ray, eval_naive, &user, &b, &around));
    fx_counts_add(&user.counts, &around);
    ck_assert_mem_eq(&a, &b, sizeof a);
    assert_same_counts(&counts, &user.counts);
    ck_assert_int_eq(user.firsts, a.samples > 0);
    ck_assert_uint_eq(counts.samples, a.samples);
    ck_assert_uint_eq(a.weight_sum + a.transmittance, 1 << 20);
  }
}

static sf_status eval_fails(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  (void)ray, (void)first, (void)f;
  *out = (fx_out){0};
  return ++*(int *)user == 3 ? sf_fail(SF_E_DIFFERENCE, "third sample") : sf_ok();
}

TEST(render_hands_on_a_failure)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 4);
  memset(scene.occupancy, 0xff, 64);
  const fx_ray ray = diagonal_ray(1);
  fx_pixel pixel;
  int calls = 0;
  ck_assert_int_eq(fx_render_ray(&scene, &ray, eval_fails, &calls, &pixel, NULL).code, SF_E_DIFFERENCE);
  ck_assert_int_eq(calls, 3);
}

int ck_timeout = 300;
