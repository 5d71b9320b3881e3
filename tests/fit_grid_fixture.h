/* For the tests of grids that are trimmed: a small scene, and parts of it without effect. */
#ifndef SF_TESTS_FIT_GRID_FIXTURE_H
#define SF_TESTS_FIT_GRID_FIXTURE_H
#include "tests/fit_fixture.h"

static const fixture_sizes small = {6, 20, 6, 9, 24, 20, 3, FX_HYBRID, {0}};

static inline fx_scene small_scene(uint64_t seed, int mode)
{
  fixture_sizes sizes = small;
  sizes.mode = mode;
  fx_scene scene = fixture_scene(&sizes, seed);
  scene.step_q24 = 700000; /* about 40 samples along the diagonal */
  scene.net.exp_in = (fx_scale){20000, 15, 8192};
  for (int l = 0; l < SF_LAYERS; l++) scene.net.layer[l].theta = scene.net.layer[l].theta ? 20000 : 0;
  return scene;
}

static inline void clear_column(fx_layer *layer, int o)
{
  for (int i = 0; i < layer->n_in; i++) layer->w[i * SF_LANES + o] = 0;
}

static inline void clear_row(fx_layer *layer, int i)
{
  memset(layer->w + (size_t)i * SF_LANES, 0, SF_LANES);
}

/* Silent neurons, neurons without fan-out, a chain of two, an unused output h, harmonics and a level without effect. */
static inline void spoil(fx_scene *scene)
{
  fx_layer *l = scene->net.layer;
  const int n_dir = fx_net_constants(&scene->net);
  clear_column(&l[FX_D1], 0), clear_column(&l[FX_C1], 5), clear_column(&l[FX_C2], 19); /* silent */
  clear_row(&l[FX_D2], 7), clear_row(&l[FX_C3], 3);                                    /* without fan-out */
  clear_row(&l[FX_C2], 9);
  l[FX_C2].w[9 * SF_LANES + 3] = 100;                               /* feeds only C2's 3 */
  clear_row(&l[FX_C1], n_dir + 1), clear_row(&l[FX_C1], n_dir - 1); /* h 2, the last harmonic */
  memset(scene->grid.table + 2 * scene->grid.offset[4], 0, 2 * (size_t)sf_grid_level_entries(&scene->grid, 4));
}

static inline void expect_dropped(const fx_scene *scene, const fx_scene *trimmed)
{
  static const int gone[SF_LAYERS] = {[FX_D1] = 2, [FX_D2] = 1, [FX_C1] = 2, [FX_C2] = 2};
  for (int l = FX_D1; l <= FX_C2; l++)
    ck_assert_int_le(trimmed->net.layer[l].n_out, scene->net.layer[l].n_out - gone[l]);
  ck_assert_int_lt(trimmed->grid.levels, scene->grid.levels);
  ck_assert_int_lt(trimmed->net.layer[FX_C1].n_in, scene->net.layer[FX_C1].n_in - 1);
}

#endif
