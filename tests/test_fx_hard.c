/* The hard cases of the fixed-point contract, each by name. Unless said otherwise a case runs through the core and the
 * naive nets and everything is compared: currents, membranes, spikes, outputs, counts. */
#include "tests/fx_fixture.h"

typedef struct hard {
  fx_scene scene;
  int16_t f[32], dir[SF_DIR_MAX];
  fx_trace *trace;
  fx_out out;
} hard;

static hard hard_begin(int steps)
{
  fixture_sizes sizes = fixture_ingp;
  sizes.steps = steps;
  hard h = {.scene = fixture_scene(&sizes, 11), .trace = malloc(sizeof(fx_trace))};
  fixture_inputs(12, 0, h.f, 32, 700);
  fixture_inputs(13, 0, h.dir, SF_DIR_MAX, 1024);
  return h;
}

static void hard_end(hard *h)
{
  fx_scene_free(&h->scene);
  free(h->trace);
}

/* All three input modes; the scene must still pass its own check. */
static void hard_run(hard *h)
{
  const sf_status status = fx_scene_check(&h->scene, "hard case");
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
  for (int mode = FX_NODECAY; mode >= FX_HYBRID; mode--) {
    h->scene.net.mode = mode;
    h->out = assert_sample(&h->scene.net, h->f, h->dir, h->trace);
  }
}

static void set_weights(fx_net *net, int8_t even, int8_t odd)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (int i = 0; i < net->layer[l].n_in; i++)
      for (int o = 0; o < net->layer[l].n_out; o++) net->layer[l].w[i * SF_LANES + o] = (i + o) % 2 ? odd : even;
}

static void set_theta(fx_net *net, int32_t theta)
{
  net->layer[FX_D1].theta = net->layer[FX_C1].theta = net->layer[FX_C2].theta = theta;
}

static int spikes_of(const hard *h, int l)
{
  int sum = 0;
  for (int t = 0; t < h->scene.net.steps; t++)
    sum += __builtin_popcountll(h->trace->spikes[l][t][0]) + __builtin_popcountll(h->trace->spikes[l][t][1]);
  return sum;
}

START_TEST(tau_at_one_and_very_large)
{
  static const int32_t leak[] = {4096, 4095, 1, 0};
  for (int i = 0; i < 4; i++) {
    hard h = hard_begin(8);
    for (int l = 0; l < SF_LAYERS; l++) h.scene.net.layer[l].k = leak[i];
    hard_run(&h);
    hard_end(&h);
  }
}
END_TEST

START_TEST(theta_one_lsb)
{
  hard h = hard_begin(8);
  set_theta(&h.scene.net, 1);
  hard_run(&h);
  ck_assert_int_gt(spikes_of(&h, FX_D1), 8 * 128 / 4);
  hard_end(&h);
}
END_TEST

/* Nothing fires: outputs are those of zero currents, and no synaptic operation is counted. */
START_TEST(silent_net)
{
  hard h = hard_begin(8);
  set_theta(&h.scene.net, FX_MEMBRANE_MAX);
  h.scene.net.exp_in.bias = 0;
  hard_run(&h);
  for (int l = 0; l < SF_LAYERS; l++) ck_assert_int_eq(spikes_of(&h, l), 0);
  ck_assert_uint_eq(h.out.sigma, 4096);
  ck_assert_uint_eq(h.out.colour[0], 32768);
  hard_end(&h);
}
END_TEST

START_TEST(every_neuron_fires)
{
  hard h = hard_begin(8);
  set_weights(&h.scene.net, 127, 127);
  set_theta(&h.scene.net, 1);
  for (int i = 0; i < 32; i++) h.f[i] = 2047;
  for (int i = 0; i < SF_DIR_MAX; i++) h.dir[i] = 2047;
  hard_run(&h);
  ck_assert_int_eq(spikes_of(&h, FX_D1), 8 * 128);
  ck_assert_int_eq(spikes_of(&h, FX_C1), 8 * 128);
  ck_assert_int_eq(spikes_of(&h, FX_C2), 8 * 128);
  ck_assert_int_eq(h.trace->current[FX_D2][7][15], 128 * 127);
  hard_end(&h);
}
END_TEST

/* The widest sums, at both signs of the inputs: exact in s24. */
START_TEST(weights_and_features_at_the_rails)
{
  static const int8_t even[] = {127, -127, 127, -127, 0}, odd[] = {127, -127, -127, 127, 0};
  for (int i = 0; i < 5; i++)
    for (int sign = -1; sign <= 1; sign += 2) {
      hard h = hard_begin(8);
      set_weights(&h.scene.net, even[i], odd[i]);
      for (int n = 0; n < 32; n++) h.f[n] = (int16_t)(sign * 2047);
      for (int n = 0; n < SF_DIR_MAX; n++) h.dir[n] = (int16_t)(-sign * 2047);
      hard_run(&h);
      if (i == 0) ck_assert_int_eq(h.trace->current[FX_D1][0][0], sign * 32 * 2047 * 127);
      if (i == 4) ck_assert_int_eq(spikes_of(&h, FX_C2), 0);
      hard_end(&h);
    }
}
END_TEST

START_TEST(alternating_features)
{
  hard h = hard_begin(3);
  for (int i = 0; i < 32; i++) h.f[i] = (int16_t)(i % 2 ? 2047 : -2047);
  set_weights(&h.scene.net, 127, -127);
  hard_run(&h);
  ck_assert_int_eq(abs(h.trace->current[FX_D1][0][5]), 32 * 2047 * 127);
  hard_end(&h);
}
END_TEST

/* One neuron of D1: current exactly theta fires and resets to zero; one LSB less does not fire. */
START_TEST(current_at_threshold_and_one_off)
{
  for (int off = -1; off <= 1; off++) {
    hard h = hard_begin(1);
    set_weights(&h.scene.net, 0, 0);
    memset(h.f, 0, sizeof h.f);
    h.scene.net.layer[FX_D1].w[0] = 1;
    h.scene.net.layer[FX_D1].theta = 1000;
    h.f[0] = (int16_t)(1000 + off);
    hard_run(&h);
    ck_assert_int_eq(h.trace->membrane[FX_D1][0][0], 1000 + off);
    ck_assert_uint_eq(h.trace->spikes[FX_D1][0][0], off >= 0);
    ck_assert_uint_eq(h.trace->spikes[FX_D1][0][1], 0);
    hard_end(&h);
  }
}
END_TEST

START_TEST(one_step_and_all_steps)
{
  for (int steps = 1; steps <= SF_T_MAX; steps += SF_T_MAX - 1) {
    hard h = hard_begin(steps);
    hard_run(&h);
    for (int l = 0; l < SF_LAYERS; l++)
      for (int t = steps; t < SF_T_MAX; t++) ck_assert_uint_eq(h.trace->spikes[l][t][0] | h.trace->spikes[l][t][1], 0);
    hard_end(&h);
  }
}
END_TEST

START_TEST(density_at_both_ends_of_exp)
{
  for (int sign = -1; sign <= 1; sign += 2) {
    hard h = hard_begin(8);
    set_theta(&h.scene.net, 1);
    h.scene.net.layer[FX_D1].k = 4096;
    set_weights(&h.scene.net, 127, 127);
    for (int i = 0; i < 32; i++) h.f[i] = 100;
    for (int i = 0; i < 128; i++) h.scene.net.layer[FX_D2].w[i * SF_LANES] = (int8_t)(127 * sign);
    h.scene.net.exp_in = (fx_scale){65535, 0, 0};
    hard_run(&h);
    ck_assert_uint_eq(h.out.sigma, sign > 0 ? (1u << 28) - 1 : 0);
    hard_end(&h);
  }
}
END_TEST

/* No-decay with k = 0 adds eight maxima: both accumulators and the membranes must clamp, and say so. */
START_TEST(nodecay_saturates_and_counts)
{
  hard h = hard_begin(8);
  fx_counts counts = {0};
  int32_t base[SF_LANES];
  set_weights(&h.scene.net, 127, 127);
  for (int l = 0; l < SF_LAYERS; l++) h.scene.net.layer[l].k = 0;
  for (int i = 0; i < 32; i++) h.f[i] = 2047;
  set_theta(&h.scene.net, 1);
  h.scene.net.exp_in = (fx_scale){65535, 0, 0};
  h.scene.net.mode = FX_NODECAY;
  assert_sample(&h.scene.net, h.f, h.dir, h.trace);
  fx_net_direction(&h.scene.net, h.dir, base, NULL);
  fx_net_sample(&h.scene.net, h.f, base, &h.out, NULL, &counts);
  ck_assert_uint_eq(h.out.sigma, (1u << 28) - 1);
  ck_assert_uint_eq(counts.saturated[FX_D2], 8 + 7); /* 2^y at every step, the sum at all but the first */
  ck_assert_uint_eq(counts.saturated[FX_D1], 7 * 128);
  hard_end(&h);
}
END_TEST

/* ---- compositing ---- */

static fx_pixel composite(uint32_t sigma, int32_t delta, int samples)
{
  fx_pixel pixel;
  const fx_out out = {sigma, {65535, 1, 0}};
  fx_composite_begin(&pixel);
  for (int i = 0; i < samples; i++) {
    fx_composite_add(&pixel, &out, delta, (uint64_t)i << 16);
    ck_assert_uint_eq(pixel.weight_sum + pixel.transmittance, 1 << 20);
  }
  return pixel;
}

START_TEST(optical_depth_zero_and_saturated)
{
  ck_assert_uint_eq(composite(0, 1 << 24, 1024).transmittance, 1 << 20);
  ck_assert_uint_eq(composite((1u << 28) - 1, 1, 1).transmittance, fx_exp_neg(4096));
  ck_assert_uint_eq(composite((1u << 28) - 1, 1 << 24, 1).transmittance, 0);
  ck_assert_uint_eq(composite(1, 1, 1).transmittance, 1 << 20); /* tau far below half an LSB */
}
END_TEST

START_TEST(transmittance_underflow)
{
  const fx_pixel pixel = composite(4096 * 3, 1 << 22, 1024);
  ck_assert_uint_eq(pixel.transmittance, 0);
  ck_assert_uint_eq(pixel.weight_sum, 1 << 20);
  ck_assert_uint_eq(pixel.colour[0], (uint64_t)65535 << 20);
}
END_TEST

START_TEST(fog_is_the_product_of_its_parts)
{
  const fx_pixel pixel = composite(4096 / 10, 1 << 22, 40); /* tau 0.025 per sample, 1.0 in all */
  ck_assert_int_ge(pixel.transmittance, 386100);            /* exp(-409 / 4096 * 10) * 2^20 = 386314 */
  ck_assert_int_le(pixel.transmittance, 386500);
}
END_TEST

/* ---- whole rays ---- */

static fx_ray straight_ray(int count, int axis)
{
  fx_ray ray = {.count = count};
  for (int a = 0; a < 3; a++) ray.origin[a] = (int64_t)1 << 39;
  ray.origin[axis] = 0;
  ray.step[axis] = (((int64_t)1 << 40) - 1) / (count > 1 ? count - 1 : 1);
  return ray;
}

static fx_pixel render(const fx_scene *scene, const fx_ray *ray, fx_counts *counts)
{
  fx_pixel pixel;
  const sf_status status = fx_render_ray(scene, ray, NULL, NULL, &pixel, counts);
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
  ck_assert_uint_eq(pixel.weight_sum + pixel.transmittance, 1 << 20);
  return pixel;
}

START_TEST(empty_scene)
{
  hard h = hard_begin(2);
  const fx_ray ray = straight_ray(500, 0);
  fx_counts counts = {0};
  uint32_t rgba[4];
  memset(h.scene.occupancy, 0, 64);
  const fx_pixel pixel = render(&h.scene, &ray, &counts);
  fx_pixel_rgba(&pixel, rgba);
  ck_assert_uint_eq(pixel.samples, 0);
  ck_assert(rgba[0] == 65535 && rgba[1] == 65535 && rgba[2] == 65535 && rgba[3] == 0);
  ck_assert_uint_eq(counts.rays, 0);
  ck_assert_uint_eq(counts.march_steps, 500);
  hard_end(&h);
}
END_TEST

START_TEST(opaque_scene)
{
  hard h = hard_begin(2);
  const fx_ray ray = straight_ray(500, 1);
  memset(h.scene.occupancy, 0xff, 64);
  h.scene.net.exp_in = (fx_scale){0, 0, 131071};
  const fx_pixel pixel = render(&h.scene, &ray, NULL);
  ck_assert_uint_eq(pixel.samples, 1);
  ck_assert_uint_eq(pixel.transmittance, 0);
  hard_end(&h);
}
END_TEST

START_TEST(missing_and_one_sample_rays)
{
  hard h = hard_begin(2);
  memset(h.scene.occupancy, 0xff, 64);
  h.scene.net.exp_in = (fx_scale){0, 0, -131072};
  for (int count = 0; count <= 1; count++) {
    const fx_ray ray = straight_ray(count, 2);
    fx_counts counts = {0};
    const fx_pixel pixel = render(&h.scene, &ray, &counts);
    ck_assert_uint_eq(pixel.samples, (uint32_t)count);
    ck_assert_uint_eq(counts.rays, (uint64_t)count);
    ck_assert_uint_eq(pixel.transmittance, 1 << 20);
  }
  hard_end(&h);
}
END_TEST

START_TEST(ray_at_the_sample_limit)
{
  hard h = hard_begin(1);
  memset(h.scene.occupancy, 0xff, 64);
  h.scene.net.exp_in = (fx_scale){0, 0, -131072};
  for (int limit = 1; limit <= 1024; limit += 1023) {
    const fx_ray ray = straight_ray(1500, 0);
    h.scene.max_samples = limit;
    ck_assert_uint_eq(render(&h.scene, &ray, NULL).samples, (uint32_t)limit);
  }
  hard_end(&h);
}
END_TEST

/* At 0, at the last representable position and on every face between occupancy cells; the ends of a straight ray. */
START_TEST(positions_on_faces_and_ends)
{
  hard h = hard_begin(1);
  for (int axis = 0; axis < 3; axis++)
    for (int face = 0; face <= 8; face++) {
      uint32_t pos[3] = {1 << 23, 1 << 23, 1 << 23}, at[3];
      pos[axis] = face == 8 ? (1 << 24) - 1 : (uint32_t)face << 21;
      const uint32_t cell = ((pos[2] >> 21) * 8 + (pos[1] >> 21)) * 8 + (pos[0] >> 21);
      fx_ray ray = {.count = 1, .origin = {(int64_t)pos[0] << 16, (int64_t)pos[1] << 16, (int64_t)pos[2] << 16}};
      memset(h.scene.occupancy, 0, 64);
      ck_assert_int_eq(fx_march_next(&h.scene, &ray, 0, at, NULL), -1);
      h.scene.occupancy[cell / 8] = (uint8_t)(1 << cell % 8);
      ck_assert_int_eq(fx_march_next(&h.scene, &ray, 0, at, NULL), 0);
      ck_assert_mem_eq(at, pos, sizeof at);
      int16_t f[32];
      fx_grid_features(&h.scene.grid, pos, f, NULL);
      for (int i = 0; i < 32; i++) ck_assert_int_le(abs(f[i]), 2047);
    }
  hard_end(&h);
}
END_TEST

int main(void)
{
  Suite *suite = suite_create("fx_hard");
  TCase *cases = tcase_create("hard cases");
  tcase_set_timeout(cases, 300);
  tcase_add_test(cases, tau_at_one_and_very_large);
  tcase_add_test(cases, theta_one_lsb);
  tcase_add_test(cases, silent_net);
  tcase_add_test(cases, every_neuron_fires);
  tcase_add_test(cases, weights_and_features_at_the_rails);
  tcase_add_test(cases, alternating_features);
  tcase_add_test(cases, current_at_threshold_and_one_off);
  tcase_add_test(cases, one_step_and_all_steps);
  tcase_add_test(cases, density_at_both_ends_of_exp);
  tcase_add_test(cases, nodecay_saturates_and_counts);
  tcase_add_test(cases, optical_depth_zero_and_saturated);
  tcase_add_test(cases, transmittance_underflow);
  tcase_add_test(cases, fog_is_the_product_of_its_parts);
  tcase_add_test(cases, empty_scene);
  tcase_add_test(cases, opaque_scene);
  tcase_add_test(cases, missing_and_one_sample_rays);
  tcase_add_test(cases, ray_at_the_sample_limit);
  tcase_add_test(cases, positions_on_faces_and_ends);
  suite_add_tcase(suite, cases);
  return fixture_run(suite);
}
