/* Marching and compositing. */
#include "ck_run.h"
#include "float_fixture.h"
#include "render/composite.h"
#include "tests/march_fixture.h"
#include <math.h>

enum { N = 24 };

/* Intervals that grow, from `first` to three times as long. */
static const float *growing(float first)
{
  static float delta[N];
  for (int s = 0; s < N; s++) delta[s] = first * (1 + 2 * (float)s / N);
  return delta;
}

TEST(weights_and_transmittance_sum_to_one)
{
  for (int trial = 0; trial < 200; trial++) {
    float sigma[N], weight[N], scale = powf(10, (float)(trial % 8) - 3);
    for (int s = 0; s < N; s++) sigma[s] = scale * sf_random_float(1, trial, s);
    double sum = sf_composite_weights(N, sigma, growing(0.01f), weight);
    for (int s = 0; s < N; s++) sum += weight[s];
    ck_assert_double_eq_tol(sum, 1, 1e-5); /* 2 N roundings of 2^-24 */
  }
}

/* Skipping empty cells must find the samples that testing every lattice point finds. */
TEST(march_equals_testing_every_point)
{
  OWNED(sf_model) m = test_model(SF_NET_SNN, SF_HYBRID, 16, 2, 1);
  int found = 0;
  sf_steps steps;
  for (int trial = 0; trial < 2000; trial++) {
    for (int i = 0; i < 64; i++) /* in one trial of ten nothing: the one block is empty */
      m.occupancy[i] = (uint8_t)(trial % 10 ? sf_random_u64(3, trial, i) & sf_random_u64(4, trial, i) : 0);
    ck_ok(trial % 3 ? sf_march_steps(&steps, &m, 1) : sf_steps_make(&steps, &m.config, 1));
    float o[3], d[3], length = 0;
    for (int a = 0; a < 3; a++) {
      o[a] = 3 * test_random(6 * trial + a);
      d[a] = trial % 5 == 0 && a != trial % 3 ? 0 : 0.8f * test_random(a * 7919 + trial) - o[a];
      length += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++) d[a] /= sqrtf(length) + 1e-12f;
    sf_march march = sf_march_begin(&m, &steps, o, d, 0.5f);
    sf_lattice lattice = sf_ray_lattice(&steps, o, d);
    ck_assert_int_eq(march.lattice.count, lattice.count);
    int next = 0;
    for (int n = 0; n < lattice.count; n++) {
      float x[3], y[3];
      size_t cell[3];
      for (int a = 0; a < 3; a++) {
        x[a] = fminf(fmaxf((o[a] + sf_march_distance(&march, n) * d[a]) * 0.5f + 0.5f, 0), 0x1.fffffep-1f);
        cell[a] = (size_t)(x[a] * 8);
      }
      const size_t bit = (cell[2] * 8 + cell[1]) * 8 + cell[0];
      if (!(m.occupancy[bit / 8] >> (bit % 8) & 1)) continue;
      next = sf_march_next(&march, next, y);
      ck_assert_int_eq(next, n);
      ck_assert_mem_eq(x, y, sizeof x);
      next++;
      found++;
    }
    float y[3];
    ck_assert_int_eq(sf_march_next(&march, next, y), -1);
    check_points(&march);
  }
  ck_assert_int_gt(found, 2000);
}

/* Of a million points some lie so near a face that another rounding puts them into the next cell. */
TEST(every_instruction_set_finds_the_same_points)
{
  sf_config config = sf_config_default();
  config.occ_res = 256;
  config.log2_hash = 10;
  OWNED(sf_model) m = {0};
  sf_steps steps;
  ck_ok(sf_model_create(&m, &config));
  for (size_t i = 0; i < sf_config_cells(&config) / 8; i++) m.occupancy[i] = (uint8_t)sf_random_u64(5, 0, i);
  ck_ok(sf_march_steps(&steps, &m, 1));
  int points = 0;
  for (uint64_t ray = 0; ray < 3000; ray++) {
    float o[3], d[3], length = 0;
    for (int a = 0; a < 3; a++) {
      o[a] = 3 * test_random((int)(6 * ray) + a);
      d[a] = 0.8f * test_random((int)(6 * ray) + 3 + a) - o[a];
      length += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++) d[a] /= sqrtf(length);
    const sf_march march = sf_march_begin(&m, &steps, o, d, sf_random_float(6, 0, ray));
    check_points(&march);
    points += march.lattice.count;
  }
  ck_assert_int_gt(points, 1000000);
}

/* Far away a distance has no precision left, and the box seems longer than its diagonal: bit maps of lattice points
 * have room for no more than the lattice. */
TEST(far_cameras_stay_in_the_lattice)
{
  static const float o[3][3] = {{-0x1.0f159p+22f, -0x1.4ef0eap+22f, 0x1.1755ccp+22f},
                                {0x1.2e2e1ap+22f, -0x1.47fb46p+22f, -0x1.fd98cap+21f},
                                {0, 0, 3}},
                     d[3][3] = {{0x1.0e487ap-1f, 0x1.4df384p-1f, -0x1.168278p-1f},
                                {-0x1.2d39e6p-1f, 0x1.46f238p-1f, 0x1.fbfcf8p-2f},
                                {0, 0, -1}};
  sf_config config = sf_config_default();
  config.lattice = 1024;
  sf_steps steps;
  ck_ok(sf_steps_make(&steps, &config, 1));
  for (int i = 0; i < 3; i++) {
    const sf_lattice lattice = sf_ray_lattice(&steps, o[i], d[i]);
    ck_assert_int_gt(lattice.count, 500);
    ck_assert_int_le(lattice.count, config.lattice);
  }
}

TEST(empty_and_missing_rays_show_the_background)
{
  OWNED(sf_model) m = test_model(SF_NET_SNN, SF_HYBRID, 16, 2, 1);
  const float o[12] = {0, 0, 4, 0, 0, 4, 0, 0, 0, 1, 1, 4}, d[12] = {0, 0, -1, 0, 0, 1, 1, 0, 0, 0, 0, -1};
  const float background[3] = {0.25f, 0.5f, 1};
  float rgb[12], alpha[4], samples[4];
  memset(m.occupancy, 0, 64);
  ck_ok(sf_render_rays(&m, o, d, 4, 0, background, rgb, NULL, alpha, samples));
  for (int i = 0; i < 12; i++) ck_assert_float_eq(rgb[i], background[i % 3]);
  for (int i = 0; i < 4; i++) ck_assert_float_eq(samples[i], 0);
  memset(m.occupancy, 0xff, 64);
  ck_ok(sf_render_rays(&m, o, d, 4, 0, background, rgb, NULL, alpha, samples));
  ck_assert_float_gt(samples[0], 0);
  ck_assert_float_eq(samples[1], 0);
  ck_assert_int_eq(sf_render_rays(&m, o, d, 4, 9, background, rgb, NULL, NULL, NULL).code, SF_E_RANGE);
}

/* The packet renderer against a ray composited sample by sample with the oracle. Rays end where the model says. */
LOOP_TEST(packets_equal_the_oracle, 3)
{
  static const double stops[] = {SF_STOP_MIN, 0.01, SF_STOP_MAX};
  OWNED(sf_model) m = test_model(SF_NET_SNN, SF_HYBRID, 32, 4, 0.4f);
  m.config.stop = stops[_i];
  for (int l = 0; l < 3; l++) m.config.theta[l] = 0.05f; /* neurons fire, and most rays end */
  for (int i = 0; i < 32; i++) sf_model_param(&m, SF_P_D2)[i] = fabsf(sf_model_param(&m, SF_P_D2)[i]);
  enum { RAYS = 40 };
  float o[3 * RAYS], d[3 * RAYS], rgb[3 * RAYS], samples[RAYS];
  const float background[3] = {1, 1, 1};
  for (int i = 0; i < 512; i++) m.occupancy[i / 8] &= (uint8_t) ~(sf_random_below(5, 1, i, 2) << (i % 8));
  for (int r = 0; r < RAYS; r++) {
    float length = 0;
    for (int a = 0; a < 3; a++) {
      o[3 * r + a] = a == 2 ? 3 : test_random(r * 3 + a);
      d[3 * r + a] = (a == 2 ? -3 : test_random(900 + r * 3 + a)) - 0;
      length += d[3 * r + a] * d[3 * r + a];
    }
    for (int a = 0; a < 3; a++) d[3 * r + a] /= sqrtf(length);
  }
  ck_ok(sf_render_rays(&m, o, d, RAYS, 3, background, rgb, NULL, NULL, samples));
  int wrong = 0, ended = 0;
  sf_steps steps;
  ck_ok(sf_steps_make(&steps, &m.config, 1));
  for (int r = 0; r < RAYS; r++) {
    sf_march march = sf_march_begin(&m, &steps, o + 3 * r, d + 3 * r, 0.5f);
    float x[3], transmittance = 1, out[3] = {0};
    int n = 0, count = 0;
    for (; (n = sf_march_next(&march, n, x)) >= 0 && transmittance >= m.config.stop; n++, count++) {
      float f[32], sh[16], sigma[8], colour[24];
      sf_grid_features(&m, x, f);
      sf_sh4(d + 3 * r, sh);
      sf_net_sample(&m, f, sh, 3, sigma, colour, NULL);
      float behind = transmittance * expf(-sigma[2] * steps.length[n]);
      for (int c = 0; c < 3; c++) out[c] += (transmittance - behind) * colour[6 + c];
      transmittance = behind;
    }
    ended += n >= 0;
    int bad = count != (int)samples[r];
    for (int c = 0; c < 3; c++) bad |= fabsf(out[c] + transmittance - rgb[3 * r + c]) > 2e-3f;
    wrong += bad;
  }
  ck_assert(ended > 2 || _i == 0);
  ck_assert_msg(wrong <= 2, "%d of %d rays differ", wrong, RAYS); /* a spike at the threshold may flip */
  /* Each picture ends its rays by its own light. With hybrid inputs the last one has the longest rays, else the
   * first. */
  float every[SF_T_MAX][3 * RAYS];
  for (int hybrid = 0; hybrid < 2; hybrid++) {
    m.config.mode = hybrid ? SF_HYBRID : SF_DECAY;
    ck_ok(sf_render_prefixes(&m, o, d, RAYS, background, every[0]));
    for (int t = 1; t <= m.config.steps; t++) {
      ck_ok(sf_render_rays(&m, o, d, RAYS, t, background, rgb, NULL, NULL, NULL));
      for (int i = 0; i < 3 * RAYS; i++) ck_assert_float_eq(every[t - 1][i], rgb[i]);
    }
  }
}
