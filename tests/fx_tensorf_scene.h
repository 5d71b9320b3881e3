/* For the tests of TensoRF in integers: a scene of random integers, positions in it. */
#ifndef SF_TESTS_FX_TENSORF_SCENE_H
#define SF_TESTS_FX_TENSORF_SCENE_H
#include "src/fx/core.h"
#include "tests/fx_fixture.h"
#include "tests/tensorf_fixture.h"

static inline fx_scene make_scene(const int32_t res[3], int components, int freqs, uint64_t seed)
{
  fx_scene scene = {.backbone = FX_TENSORF, .occ_res = 8, .net = {.steps = 3, .sigmoid_in = {50000, 13, 0}}};
  fx_tensorf *f = &scene.tensorf;
  fx_layer *l = scene.net.layer;
  for (int i = 0; i < 3; i++) {
    f->res[i] = res[i], scene.units.stretch[i] = 1, scene.background[i] = 65536;
    f->density.components[i] = components + i, f->appearance.components[i] = 2 * components + i;
  }
  f->features = 9, f->feature_freqs = freqs, f->view_freqs = freqs, f->encoding_frac = 9;
  scene.units.far = 6;
  f->density_in = (fx_scale){30000, 28, 0}, f->sigma_out = (fx_scale){40000, 15, 0};
  f->feature_in = (fx_scale){40000, 33, 0}, f->phase_in = (fx_scale){50000, 30, 0};
  f->weight_stop = 104;
  l[FX_C1].n_in = fx_tensorf_inputs(f), l[FX_C1].bias = 300, l[FX_C2].bias = l[FX_C3].bias = 1;
  l[FX_C1].n_out = l[FX_C2].n_in = 48, l[FX_C2].n_out = l[FX_C3].n_in = 32, l[FX_C3].n_out = 3;
  ck_ok(fx_scene_allocate(&scene, "fixture"));
  int8_t *all[13];
  for (int i = 0; i < 3; i++) {
    all[i] = f->density.plane[i], all[3 + i] = f->density.line[i];
    all[6 + i] = f->appearance.plane[i], all[9 + i] = f->appearance.line[i];
  }
  all[12] = f->basis;
  for (int k = 0; k < 13; k++) {
    const int8_t *end = k < 12 ? all[k + 1] : (int8_t *)scene.occupancy;
    for (int8_t *at = all[k]; at < end; at++)
      *at = (int8_t)fixture_pick(seed, 50 + (uint64_t)k, (uint64_t)(at - all[k]), -127, 127);
  }
  memset(scene.occupancy, 0xff, 64);
  for (int id = FX_C1; id <= FX_C3; id++) {
    l[id].k = 2500, l[id].theta = id == FX_C1 ? 200000 : id == FX_C2 ? 60000 : 0;
    for (int i = 0; i < fx_layer_rows(&l[id]); i++)
      for (int o = 0; o < l[id].n_out; o++)
        l[id].w[i * SF_LANES + o] = (int8_t)fixture_pick(seed, 70 + (uint64_t)id, (uint64_t)(i * 128 + o), -127, 127);
  }
  scene.step_q24 = 1 << 17, scene.max_samples = 1024, scene.trans_stop = 104;
  scene.units.to_box_scale = 1, scene.units.dir_scale = 0x1p-9;
  return scene;
}

static inline void ck_checked(const fx_scene *scene)
{
  ck_ok(fx_scene_check(scene, "fixture"));
}

static inline void pick_position(uint64_t seed, uint64_t i, uint32_t pos[3])
{
  static const uint32_t ends[] = {0, (1 << 24) - 1, 1 << 23, (1 << 24) / 6, (1 << 24) / 6 + 1, (1 << 24) / 3 * 2};
  for (uint64_t a = 0; a < 3; a++)
    pos[a] = i % 3 == 0 ? ends[fixture_pick(seed, 80, 3 * i + a, 0, 5)]
                        : (uint32_t)fixture_pick(seed, 81, 3 * i + a, 0, (1 << 24) - 1);
}

#endif
