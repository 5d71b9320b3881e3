/* For the tests of the audit: a small scene of planes, lines and a decoder. */
#ifndef SF_TESTS_FX_TENSORF_FIXTURE_H
#define SF_TESTS_FX_TENSORF_FIXTURE_H
#include "src/fx/scene.h"
#include "tests/fx_fixture.h"

/* A decoder behind planes and lines of different sizes; part of its samples weigh too little to be decoded. */
static inline fx_scene tensorf_scene(void)
{
  fx_scene scene = {.backbone = FX_TENSORF, .occ_res = 8, .step_q24 = 400000, .max_samples = 1024, .trans_stop = 104};
  fx_tensorf *field = &scene.tensorf;
  *field =
      (fx_tensorf){.res = {9, 8, 7}, .density = {.components = {2, 3, 4}}, .appearance = {.components = {3, 2, 4}}};
  field->features = 5, field->feature_freqs = field->view_freqs = 1, field->weight_stop = 1 << 14;
  field->density_in = (fx_scale){1000, 20, 0}, field->sigma_out = (fx_scale){30000, 20, 0};
  field->feature_in = field->phase_in = (fx_scale){1000, 24, 0};
  field->encoding_frac = 10;
  fx_layer *l = scene.net.layer;
  l[FX_C1].n_in = fx_tensorf_inputs(field), l[FX_C1].n_out = l[FX_C2].n_in = 40;
  l[FX_C2].n_out = l[FX_C3].n_in = 30, l[FX_C3].n_out = 3;
  l[FX_C1].bias = 700, l[FX_C2].bias = l[FX_C3].bias = 1;
  scene.net.steps = 3, scene.net.sigmoid_in = (fx_scale){50000, 13, 0};
  sf_status status = fx_scene_allocate(&scene, "tensorf");
  if (status.code != SF_OK) ck_abort_msg("%s", status.message); /* nothing else: seeds.c is no test */
  for (int pair = 0; pair < 3; pair++)
    for (int i = 0; i < 7 * 2; i++) {
      field->density.line[pair][i] = (int8_t)(20 + i % 90), field->appearance.line[pair][i] = (int8_t)(i * 9 % 100);
      field->density.plane[pair][i] = (int8_t)(i * 7), field->appearance.plane[pair][i] = (int8_t)(50 - i);
    }
  for (int i = 0; i < 9 * 5; i++) field->basis[i] = (int8_t)(i * 37 % 200 - 100);
  for (int id = FX_C1; id <= FX_C3; id++) {
    l[id].k = 1500, l[id].theta = id == FX_C3 ? 0 : 20000;
    for (int i = 0; i < l[id].n_in + 1; i++)
      for (int o = 0; o < l[id].n_out; o++)
        l[id].w[i * SF_LANES + o] = (int8_t)fixture_pick(5, 9, (uint64_t)(i * 200 + o), -100, 127);
  }
  memset(scene.occupancy, 0xff, 64);
  scene.units.to_box_scale = scene.units.dir_scale = 1, scene.units.far = 100;
  for (int axis = 0; axis < 3; axis++) scene.units.stretch[axis] = 1;
  status = fx_scene_check(&scene, "tensorf");
  if (status.code != SF_OK) ck_abort_msg("%s", status.message);
  return scene;
}
#endif
