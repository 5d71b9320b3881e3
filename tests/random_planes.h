/* Random TensoRF scenes for tests of the fixed-point core's mirror: fields of any sizes, entries and scales, their
 * extremes more often than chance would. */
#ifndef SF_TESTS_RANDOM_PLANES_H
#define SF_TESTS_RANDOM_PLANES_H
#include "ck_run.h"
#include "src/fx/tensorf.h"
#include "src/fx/unit.h"
#include "tests/random_net.h"

static inline void draw_sizes(random_source *r, fx_tensorf *f)
{
  static const int32_t corner[] = {1, 2, 15, 16, 17, 32, 33, 48, 63, 64};
  for (int i = 0; i < FX_PAIRS; i++) {
    f->res[i] = (int32_t)(draw(r, 0, 5) ? draw(r, 1, 40) : draw(r, 1, 2));
    f->density.components[i] = draw(r, 0, 1) ? corner[draw(r, 0, 9)] : (int32_t)draw(r, 1, 16);
    f->appearance.components[i] = draw(r, 0, 1) ? corner[draw(r, 0, 9)] : (int32_t)draw(r, 1, 64);
  }
  do {
    f->features = (int32_t)(draw(r, 0, 3) ? draw(r, 1, FX_APPEARANCE_MAX) : draw(r, 0, 1) ? 1 : 27);
    f->feature_freqs = (int32_t)draw(r, 0, FX_FREQS_MAX), f->view_freqs = (int32_t)draw(r, 0, FX_FREQS_MAX);
  } while (fx_tensorf_inputs(f) > SF_DIR_MAX);
  f->encoding_frac = (int32_t)draw(r, 0, 11);
  f->activation = draw(r, 0, 2) ? FX_SOFTPLUS : FX_RELU;
}

/* kind 0 uniform, 1 and 2 a rail, 3 small */
static inline void draw_entries(random_source *r, int8_t *entry, int64_t n)
{
  const int64_t kind = draw(r, 0, 5);
  for (int64_t i = 0; i < n; i++)
    entry[i] = (int8_t)(kind == 1 ? 127 : kind == 2 ? -127 : kind == 3 ? draw(r, -3, 3) : draw(r, -127, 127));
}

static inline void draw_factors(random_source *r, const fx_tensorf *f, fx_factors *factors)
{
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int *axes = fx_pair_axes[pair];
    draw_entries(r, factors->plane[pair], (int64_t)f->res[axes[0]] * f->res[axes[1]] * factors->components[pair]);
    draw_entries(r, factors->line[pair], (int64_t)f->res[axes[2]] * factors->components[pair]);
  }
}

/* The products' sum is about 2^22 times the root of the components. tame: densities as in a scene, so that rays are
 * long. */
static inline void draw_scales(random_source *r, fx_tensorf *f, bool tame)
{
  const int64_t bias = 1 << (FX_ACTIVATION_BITS - 1);
  f->density_in = (fx_scale){(int32_t)draw(r, 30000, 65535), (int32_t)draw(r, 30, 33), (int32_t)draw(r, -20000, 4000)};
  f->sigma_out = (fx_scale){(int32_t)draw(r, 1000, 65535), (int32_t)draw(r, 20, 22), 0};
  f->feature_in = (fx_scale){(int32_t)draw(r, 0, 65535), (int32_t)draw(r, 25, 36), 0};
  f->phase_in = (fx_scale){(int32_t)draw(r, 0, 65535), (int32_t)draw(r, 16, 34), 0};
  f->weight_stop = (int32_t)(draw(r, 0, 3) ? draw(r, 0, 3000) : draw(r, 0, FX_TRANS_ONE - 1));
  if (tame) return;
  f->density_in = (fx_scale){(int32_t)draw(r, 0, 65535), (int32_t)draw(r, 0, 40), (int32_t)draw(r, -bias, bias - 1)};
  f->sigma_out = (fx_scale){(int32_t)draw(r, 0, 65535), (int32_t)draw(r, 0, 40), 0};
  f->feature_in.shift = (int32_t)draw(r, 0, 40), f->phase_in.shift = (int32_t)draw(r, 0, 40);
}

/* components: of every pair, between two points per axis; 0: sizes at random. */
static inline fx_scene make_planes(uint64_t seed, bool tame, int components)
{
  random_source r = {seed, 0};
  fx_scene scene = {.backbone = FX_TENSORF, .occ_res = 8};
  fx_tensorf *f = &scene.tensorf;
  fx_layer *l = scene.net.layer;
  draw_sizes(&r, f);
  for (int i = 0; components && i < FX_PAIRS; i++)
    f->res[i] = 2, f->density.components[i] = f->appearance.components[i] = components;
  draw_scales(&r, f, tame);
  l[FX_C1].n_in = fx_tensorf_inputs(f), l[FX_C1].n_out = l[FX_C2].n_in = (int)draw(&r, 1, SF_LANES);
  l[FX_C2].n_out = l[FX_C3].n_in = (int)draw(&r, 1, SF_LANES), l[FX_C3].n_out = 3;
  draw_biases(&r, &scene.net);
  ck_ok(fx_scene_allocate(&scene, "planes"));
  draw_factors(&r, f, &f->density), draw_factors(&r, f, &f->appearance);
  draw_entries(&r, f->basis, (int64_t)fx_factors_components(&f->appearance) * FX_APPEARANCE_MAX);
  for (int id = FX_C1; id <= FX_C3; id++) {
    draw_weights(&r, &l[id], 0);
    l[id].k = draw_leak(&r), l[id].theta = id == FX_C3 ? 0 : draw_theta(&r, id == FX_C1 ? 300000 : 100000);
  }
  scene.net.mode = (int32_t)draw(&r, 0, 2), scene.net.steps = (int32_t)draw(&r, 1, SF_T_MAX);
  scene.net.sigmoid_in = (fx_scale){50000, 13, 0};
  scene.step_q24 = (int32_t)draw(&r, 1 << 18, 1 << 20);
  scene.max_samples = draw(&r, 0, 3) ? 1024 : (int32_t)draw(&r, 1, 3);
  scene.trans_stop = draw(&r, 0, 3) ? 1048 : 400000;
  for (int o = 0; o < 3; o++) scene.background[o] = (int32_t)draw(&r, 0, 65536), scene.units.stretch[o] = 1;
  for (int i = 0; i < 64; i++) scene.occupancy[i] = (uint8_t)draw(&r, 0, 255);
  scene.units.to_box_scale = 0.5, scene.units.dir_scale = 1, scene.units.far = 100;
  for (int o = 0; o < 3; o++) scene.units.to_box_offset[o] = 0.5;
  ck_ok(fx_scene_check(&scene, "planes"));
  return scene;
}

static inline fx_scene random_planes(uint64_t seed, bool tame)
{
  return make_planes(seed, tame, 0);
}
#endif
