/* Golden planes: what they hold of a pixel, their file, their quality. */
#include "ck_run.h"
#include "folder_fixture.h"
#include "golden/golden.h"
#include "tests/audit_fixture.h"
#include <math.h>

static fx_pixel some_pixel(uint32_t grey, uint32_t transmittance)
{
  fx_pixel p = {.transmittance = transmittance, .weight_sum = (1u << SF_TRANS_FRAC) - transmittance, .samples = 3};
  for (int c = 0; c < 3; c++) p.colour[c] = (uint64_t)grey << 20;
  p.depth = (uint64_t)p.weight_sum * (5 << 16);
  return p;
}

TEST(golden_planes_hold_the_pixel)
{
  OWNED(sf_golden) g;
  fx_net net = small_net();
  fx_counts c = {0};
  sf_recount_sample(&net, small_spikes, true, &c);
  const fx_cost cost = sf_cost_of(&c);
  fx_pixel pixel = some_pixel(32768, 1 << 18), empty = some_pixel(0, 1 << 20);
  ck_ok(sf_golden_create(&g, 2, 1, SF_PLANES));
  sf_golden_set(&g, 1, &pixel, &cost, 0.25);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_FX_R)[1], 32768);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_FX_A)[1], 49152);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_FX_T)[1], 1 << 18);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_FX_ZHI)[1], pixel.depth >> 32);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_FX_ZLO)[1], pixel.depth & UINT32_MAX);
  ck_assert_float_eq(sf_golden_real(&g, SF_PLANE_R)[1], 32768.0f / 65535);
  ck_assert_float_eq(sf_golden_real(&g, SF_PLANE_Z)[1], 1.25f); /* 5 steps of 0.25, whatever the alpha */
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_SAMPLES)[1], 3);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_SPIKES)[1], 12);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_SOPS)[1], 40);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_MACS)[1], 40);
  ck_assert_float_eq(sf_golden_real(&g, SF_PLANE_ENERGY)[1], 220000);
  ck_assert_uint_eq(sf_golden_int(&g, SF_PLANE_MACS)[0], 0); /* the neighbour is untouched */
  sf_golden_set(&g, 0, &empty, &cost, 0.25);
  ck_assert_float_eq(sf_golden_real(&g, SF_PLANE_Z)[0], 0);
}

TEST(golden_file_reads_back)
{
  const char *path = in("g.exr");
  OWNED(sf_golden) g;
  const fx_cost cost = {0};
  fx_pixel pixel = some_pixel(12345, 77);
  const char *const attributes[] = {"t_r", "2", NULL};
  ck_ok(sf_golden_create(&g, 3, 2, SF_PLANES));
  for (size_t i = 0; i < 6; i++) sf_golden_set(&g, i, &pixel, &cost, 1);
  ck_ok(sf_golden_save(&g, path, attributes));
  sf_exr_channel *channel;
  int width, height, n;
  ck_ok(sf_exr_load(path, &width, &height, &channel, &n));
  ck_assert_int_eq(width, 3);
  ck_assert_int_eq(height, 2);
  ck_assert_int_eq(n, SF_PLANES);
  int found = 0;
  for (int i = 0; i < n; i++) {
    if (strcmp(channel[i].name, "fx.T") && strcmp(channel[i].name, "fx.G")) continue;
    ck_assert_int_eq(channel[i].type, SF_EXR_UINT);
    ck_assert_uint_eq(((uint32_t *)channel[i].data)[5], channel[i].name[3] == 'T' ? 77 : 12345);
    found++;
  }
  ck_assert_int_eq(found, 2);
  sf_exr_free(channel, n);
}

TEST(quality_composites_the_window_over_the_background)
{
  enum { W = 20, H = 16 };
  static uint16_t rgba[W * H * 4];
  sf_image picture = {W, H, rgba};
  const float white[3] = {1, 1, 1}, black[3] = {0, 0, 0};
  double psnr, ssim;
  OWNED(sf_golden) g;
  for (int i = 0; i < W * H; i++) { /* a grey ramp, half transparent: 0.5 * grey + 0.5 over white */
    rgba[4 * i] = rgba[4 * i + 1] = rgba[4 * i + 2] = (uint16_t)(200 * i), rgba[4 * i + 3] = 32768;
  }
  ck_ok(sf_golden_create(&g, 12, 11, SF_FLOAT_PLANES));
  for (int y = 0; y < 11; y++)
    for (int x = 0; x < 12; x++)
      for (int c = 0; c < 3; c++) {
        float alpha = 32768.0f / 65535, grey = (float)(200 * ((y + 5) * W + x + 8)) / 65535;
        sf_golden_real(&g, SF_PLANE_R + c)[y * 12 + x] = grey * alpha + (1 - alpha) + 0.01f;
      }
  ck_ok(sf_golden_quality(&g, &picture, 8, 5, white, &psnr, &ssim));
  ck_assert_double_eq_tol(psnr, 40, 0.01); /* a constant error of 0.01: 20 log10 100 */
  ck_assert_double_gt(ssim, 0.95);
  ck_ok(sf_golden_quality(&g, &picture, 8, 5, black, &psnr, &ssim));
  ck_assert_double_lt(psnr, 10);
  ck_assert_int_eq(sf_golden_quality(&g, &picture, 9, 5, white, &psnr, &ssim).code, SF_E_RANGE);
  g.height = 10;
  ck_ok(sf_golden_quality(&g, &picture, 8, 5, white, &psnr, &ssim));
  ck_assert(isnan(ssim));
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
