/* The error budget: no block's error is over its derived bound, and no bound is idle. */
#include "ck_run.h"
#include "bounds/bounds.h"
#include "quant/quant.h"
#include "tests/float_fixture.h"
#include <math.h>

enum { SHORT = 200000 };

/* A bound 16 times the largest error seen would say nothing. Sums of currents are exact: their bound is zero. */
LOOP_TEST(bound_holds_and_bites, SF_BUDGET_BLOCKS)
{
  const sf_budget_row row = sf_budget_measure((sf_budget_id)_i, SHORT);
  ck_assert_uint_gt(row.inputs, 0);
  if (_i == SF_BUDGET_H) ck_assert_int_eq(strtol(strrchr(row.block, '>') + 1, NULL, 10), SF_H_SHIFT);
  ck_assert_msg(row.ratio <= 1, "%s: error %g, bound %g %s", row.block, row.measured, row.bound, row.unit);
  if (_i == SF_BUDGET_CURRENT)
    ck_assert(row.measured == 0 && row.bound == 0);
  else
    ck_assert_msg(row.ratio >= 1.0 / 16, "%s: the bound %g is idle, error %g", row.block, row.bound, row.measured);
}

enum { SIZE = 40 };

/* A trained model's behaviour: thin enough to see through, neurons that fire in part. */
static sf_model make_model(sf_input_mode mode)
{
  sf_model m = test_model(SF_NET_SNN, mode, 64, 4, 1);
  m.t_r = 3;
  return m;
}

/* The float renderer's picture in place of a photograph. */
static sf_view make_view(const sf_model *m, uint16_t *rgba)
{
  static float origin[SIZE * SIZE][3], direction[SIZE * SIZE][3], rgb[SIZE * SIZE][3];
  const float white[3] = {1, 1, 1};
  const sf_view view = {.name = "view",
                        .camera = {.width = SIZE,
                                   .height = SIZE,
                                   .fx = 50,
                                   .fy = 50,
                                   .cx = SIZE / 2.0f,
                                   .cy = SIZE / 2.0f,
                                   .to_world = {1, 0, 0, 0.1f, 0, 1, 0, 0, 0, 0, 1, 3}},
                        .image = {SIZE, SIZE, rgba}};
  for (int i = 0; i < SIZE * SIZE; i++)
    sf_camera_ray(&view.camera, (float)(i % SIZE) + 0.5f, (float)(i / SIZE) + 0.5f, origin[i], direction[i]);
  ck_ok(sf_render_rays(m, origin[0], direction[0], SIZE * SIZE, 3, white, rgb[0], NULL, NULL, NULL));
  for (int i = 0; i < SIZE * SIZE; i++) {
    for (int o = 0; o < 3; o++) rgba[4 * i + o] = (uint16_t)lrintf(fminf(rgb[i][o], 1) * 65535);
    rgba[4 * i + 3] = 65535;
  }
  return view;
}

static sf_picture_budget make_picture(sf_model *m)
{
  static uint16_t rgba[SIZE * SIZE * 4];
  fx_scene scene;
  sf_picture_budget budget;
  const sf_dataset data = {.scale = 1};
  const sf_view view = make_view(m, rgba);
  const sf_quant_options options = {.background = {1, 1, 1}, .seed = 1};
  ck_ok(sf_quantise(&scene, m, "model", &options));
  const sf_picture_job job = {m, &scene, &data, &view, "scene", 60, 3, NULL, NULL};
  ck_ok(sf_picture_budget_make(&job, &budget));
  float *w4 = sf_model_param(m, SF_P_C2);
  const size_t last = m->param[SF_P_C2].size - 1;
  for (size_t i = 0; i <= last / 2; i++) { /* another model's */
    const float other = w4[i];
    w4[i] = w4[last - i], w4[last - i] = other;
  }
  const sf_status stranger = sf_picture_budget_make(&job, &(sf_picture_budget){0});
  ck_assert_int_eq(stranger.code, SF_E_UNSUPPORTED);
  ck_assert_ptr_nonnull(strstr(stranger.message, "layer C2"));
  scene.net.layer[FX_C2].n_out--;
  ck_assert_int_eq(sf_picture_budget_make(&job, &(sf_picture_budget){0}).code, SF_E_UNSUPPORTED);
  fx_scene_free(&scene);
  return budget;
}

/* With no block replaced: the core, bit for bit (checked inside) and without a flip. With all replaced: the float
 * renderer, but for its own rounding in 24 bits (a neuron at its threshold may flip) and that of the grid's scale.
 * What does not reach the spikes flips none. */
LOOP_TEST(picture_from_fixed_to_float, SF_NODECAY + 1)
{
  OWNED(sf_model) m = make_model((sf_input_mode)_i);
  const sf_picture_budget b = make_picture(&m);
  const sf_exact_row *none = &b.row[0], *all = &b.row[SF_EXACT_ROWS - 1];
  ck_assert_uint_gt(b.samples, 500);
  ck_assert(isinf(none->psnr));
  for (int l = FX_D1; l <= FX_C2; l++) {
    if (l == FX_D2) continue;
    ck_assert_uint_eq(none->flips[l], 0);
    ck_assert_uint_gt(all->flips[l], 0);
    for (int id = SF_EXACT_EXP2; id <= SF_EXACT_COMPOSITE; id++) ck_assert_uint_eq(b.row[1 + id].flips[l], 0);
    ck_assert_uint_eq(none->decisions[l], b.samples * 64 * 3);
  }
  printf("mode %d: fixed %.1f dB, all blocks in double %.1f dB to the float renderer\n", _i, none->psnr_truth,
         all->psnr_truth);
  ck_assert_double_gt(all->psnr_truth, 55);
  ck_assert_double_gt(all->psnr_truth, none->psnr_truth + 10);
}

TEST(currents_within_their_bounds)
{
  OWNED(sf_model) m = make_model(SF_HYBRID);
  const sf_picture_budget b = make_picture(&m);
  for (int l = 0; l < SF_LAYERS; l++) {
    ck_assert_uint_gt(b.current[l].currents, 1000);
    ck_assert_msg(b.current[l].ratio <= 1 && b.current[l].ratio > 1.0 / 16, "layer %d: %g of its bound", l,
                  b.current[l].ratio);
    ck_assert_double_lt(b.current[l].rms, b.current[l].bound);
  }
}

int ck_timeout = 120;
