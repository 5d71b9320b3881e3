/* For the tests of planes that are trimmed: a small TensoRF scene of random numbers, and parts of it without effect. */
#ifndef SF_TESTS_FIT_PLANES_FIXTURE_H
#define SF_TESTS_FIT_PLANES_FIXTURE_H
#include "src/fx/tensorf.h"
#include "src/quant/internal.h"
#include "tests/fit_fixture.h"

enum { FEATURES = 5, FEATURE_FREQS = 2, VIEW_FREQS = 1, C1 = 40, C2 = 30, RES = 8 };

static inline int8_t pick(uint64_t seed, uint64_t stream, uint64_t i, int limit)
{
  return (int8_t)fixture_pick(seed, stream, i, -limit, limit);
}

static inline void fill_factors(fx_factors *f, const int32_t res[3], uint64_t seed, uint64_t stream)
{
  for (int pair = 0; pair < FX_PAIRS; pair++) {
    const int *axes = fx_pair_axes[pair];
    const uint64_t n = (uint64_t)f->components[pair];
    for (uint64_t i = 0; i < n * (uint64_t)(res[axes[0]] * res[axes[1]]); i++)
      f->plane[pair][i] = pick(seed, stream, (uint64_t)pair << 32 | i, 127);
    for (uint64_t i = 0; i < n * (uint64_t)res[axes[2]]; i++)
      f->line[pair][i] = pick(seed, stream + 1, (uint64_t)pair << 32 | i, 127);
  }
}

static inline void fill_net(fx_scene *scene, uint64_t seed)
{
  for (int id = FX_C1; id <= FX_C3; id++) {
    fx_layer *l = &scene->net.layer[id];
    l->k = 1500, l->theta = id == FX_C3 ? 0 : 20000;
    for (int i = 0; i < fx_layer_rows(l); i++)
      for (int o = 0; o < l->n_out; o++)
        l->w[i * SF_LANES + o] = pick(seed, 60 + (uint64_t)id, (uint64_t)(i * 200 + o), 100);
  }
}

/* The box is [-1, 1]^3 of the model; cells at its faces are empty, half of the others too. */
static inline void fill_cells(fx_scene *scene, uint64_t seed)
{
  for (int cell = 0; cell < RES * RES * RES; cell++) {
    const int x = cell % RES, y = cell / RES % RES, z = cell / RES / RES;
    const bool inside = x > 0 && y > 0 && z > 1 && x < RES - 1 && y < RES - 1 && z < RES - 1;
    if (inside && fixture_pick(seed, 70, (uint64_t)cell, 0, 1))
      scene->occupancy[cell >> 3] |= (uint8_t)(1u << (cell & 7));
  }
  for (int axis = 0; axis < 3; axis++) scene->units.stretch[axis] = 1, scene->units.to_box_offset[axis] = 0.5;
  scene->units.to_box_scale = 0.5, scene->units.dir_scale = 0x1p-10, scene->units.far = 100;
  for (int l = 0; l < FX_LEVELS_MAX; l++) scene->units.feature_scale[l] = 0x1p-10;
  for (int l = 0; l < SF_LAYERS; l++) scene->units.current_scale[l] = 0x1p-12;
}

static inline fx_scene planes_of(uint64_t seed, const int32_t res[3])
{
  fx_scene scene = {.backbone = FX_TENSORF, .occ_res = RES, .step_q24 = 700000, .max_samples = 1024, .trans_stop = 104};
  fx_tensorf *field = &scene.tensorf;
  *field = (fx_tensorf){.res = {res[0], res[1], res[2]}, .features = FEATURES};
  const int32_t density[] = {18, 3, 4}, appearance[] = {20, 2, 5};
  memcpy(field->density.components, density, sizeof density);
  memcpy(field->appearance.components, appearance, sizeof appearance);
  field->feature_freqs = FEATURE_FREQS, field->view_freqs = VIEW_FREQS, field->weight_stop = 104;
  field->density_in = (fx_scale){1000, 26, -2000}, field->sigma_out = (fx_scale){50000, 20, 0};
  field->feature_in = field->phase_in = (fx_scale){1000, 23, 0};
  field->encoding_frac = 10;
  fx_layer *l = scene.net.layer;
  l[FX_C1].n_in = fx_tensorf_inputs(field), l[FX_C1].n_out = l[FX_C2].n_in = C1;
  l[FX_C2].n_out = l[FX_C3].n_in = C2, l[FX_C3].n_out = 3;
  l[FX_C1].bias = 700, l[FX_C2].bias = l[FX_C3].bias = 1;
  scene.net.steps = 3, scene.net.sigmoid_in = (fx_scale){50000, 13, 0};
  ck_ok(fx_scene_allocate(&scene, "planes"));
  fill_factors(&field->density, field->res, seed, 50), fill_factors(&field->appearance, field->res, seed, 52);
  for (int c = 0; c < fx_factors_components(&field->appearance); c++)
    for (int f = 0; f < FEATURES; f++)
      field->basis[c * FX_APPEARANCE_MAX + f] = pick(seed, 54, (uint64_t)(c * 32 + f), 127);
  fill_net(&scene, seed), fill_cells(&scene, seed);
  ck_ok(fx_scene_check(&scene, "planes"));
  return scene;
}

static inline fx_scene planes_scene(uint64_t seed)
{
  static const int32_t res[] = {17, 16, 15};
  return planes_of(seed, res);
}

/* ---- without effect ---- */

static inline void clear_component(fx_factors *f, const int32_t res[3], int pair, int c)
{
  const int *axes = fx_pair_axes[pair], n = f->components[pair];
  for (int i = 0; i < res[axes[0]] * res[axes[1]]; i++) f->plane[pair][i * n + c] = 0;
}

static inline void clear_input(fx_scene *scene, int input)
{
  memset(scene->net.layer[FX_C1].w + (size_t)input * SF_LANES, 0, SF_LANES);
}

/* What each input of the decoder is, by plain loops in TensoRF's order: feature (or 100 + axis), order, cosine. */
typedef struct meaning {
  int of, order, cosine;
} meaning;

static inline int list_inputs(int features, int feature_freqs, int view_freqs, meaning *list)
{
  int n = 0;
  for (int f = 0; f < features; f++) list[n++] = (meaning){f, -1, 0};
  for (int a = 0; a < 3; a++) list[n++] = (meaning){100 + a, -1, 0};
  for (int cosine = 0; cosine < 2; cosine++)
    for (int f = 0; f < features; f++)
      for (int k = 0; k < feature_freqs; k++) list[n++] = (meaning){f, k, cosine};
  for (int cosine = 0; cosine < 2; cosine++)
    for (int a = 0; a < 3; a++)
      for (int k = 0; k < view_freqs; k++) list[n++] = (meaning){100 + a, k, cosine};
  return n;
}

/* A component of each kind, feature 3, the feature's last order and the direction's only one, two silent neurons. */
static inline void spoil(fx_scene *scene)
{
  meaning list[SF_DIR_MAX];
  const int n = list_inputs(FEATURES, FEATURE_FREQS, VIEW_FREQS, list);
  fx_tensorf *field = &scene->tensorf;
  for (int i = 0; i < n; i++)
    if (list[i].of == 3 || (list[i].of < 100 && list[i].order == 1) || (list[i].of >= 100 && list[i].order == 0))
      clear_input(scene, i);
  clear_component(&field->density, field->res, 0, 7);
  clear_component(&field->appearance, field->res, 2, 4);
  memset(field->basis + 5 * FX_APPEARANCE_MAX, 0, FX_APPEARANCE_MAX); /* of component 5 of the first pair */
  for (int i = 0; i < fx_layer_rows(&scene->net.layer[FX_C1]); i++) scene->net.layer[FX_C1].w[i * SF_LANES + 6] = 0;
  memset(scene->net.layer[FX_C3].w + 9 * SF_LANES, 0, SF_LANES); /* C2's 9 has no fan-out */
}

static inline void expect_dropped(const fx_scene *scene)
{
  const fx_tensorf *f = &scene->tensorf;
  ck_assert_int_eq(f->density.components[0], 17);
  ck_assert_int_eq(f->density.components[1], 3);
  ck_assert_int_eq(f->appearance.components[0], 19);
  ck_assert_int_eq(f->appearance.components[2], 4);
  ck_assert_int_eq(f->features, FEATURES - 1);
  ck_assert_int_eq(f->feature_freqs, FEATURE_FREQS - 1);
  ck_assert_int_eq(f->view_freqs, 0);
  ck_assert_int_lt(scene->net.layer[FX_C1].n_out, C1);
  ck_assert_int_lt(scene->net.layer[FX_C2].n_out, C2);
}

/* ---- trims ---- */

static inline sf_trim_use observed(const fx_scene *scene, const sf_fit_rays *rays)
{
  sf_trim_use use;
  ck_ok(sf_trim_use_create(&use, scene));
  ck_ok(sf_fit_observe(scene, rays, 0, rays->count, true, &use));
  return use;
}

static inline fx_scene trimmed(const fx_scene *scene, const sf_trim *trim, sf_trim_use *use)
{
  fx_scene result;
  ck_ok(sf_trim_apply(scene, trim, use, "trimmed", &result));
  ck_ok(fx_scene_check(&result, "trimmed"));
  return result;
}

static inline void random_position(uint64_t i, uint32_t pos[3])
{
  for (uint64_t a = 0; a < 3; a++) pos[a] = (uint32_t)sf_random_below(80, a, i, 1 << SF_POS_FRAC);
}
#endif
