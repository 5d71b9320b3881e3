/* For the tests of src/fx: random scenes, and the core's samples against the naive ones. */
#ifndef SF_TESTS_FX_FIXTURE_H
#define SF_TESTS_FX_FIXTURE_H
#include "ck_run.h"
#include "base/rng.h"
#include "fx_naive.h"
#include "src/fx/unit.h"

typedef struct fixture_sizes {
  int levels, d_hidden, d_out, n_dir, c1, c2, steps, mode; /* levels, d_hidden, d_out = 0: a decoder */
  int bias[SF_LAYERS];
} fixture_sizes;

static const fixture_sizes fixture_ingp = {16, SF_LANES, 16, 16, SF_LANES, SF_LANES, 4, FX_HYBRID, {0}};
static const fixture_sizes fixture_decoder = {
    0, 0, 0, 150, SF_LANES, SF_LANES, 3, FX_HYBRID, {[FX_C1] = 900, [FX_C2] = 1, [FX_C3] = 1}};

static inline int64_t fixture_pick(uint64_t seed, uint64_t stream, uint64_t index, int64_t low, int64_t high)
{
  return low + (int64_t)sf_random_below(seed, stream, index, (uint64_t)(high - low + 1));
}

static inline fixture_sizes fixture_random_sizes(uint64_t seed)
{
  fixture_sizes s;
  s.levels = (int)fixture_pick(seed, 1, 0, 1, 16);
  s.d_hidden = (int)fixture_pick(seed, 1, 1, 1, SF_LANES);
  s.d_out = (int)fixture_pick(seed, 1, 2, 1, 16);
  s.n_dir = (int)fixture_pick(seed, 1, 3, s.d_out == 1, 16);
  s.c1 = (int)fixture_pick(seed, 1, 4, 1, SF_LANES);
  s.c2 = (int)fixture_pick(seed, 1, 5, 1, SF_LANES);
  s.steps = (int)fixture_pick(seed, 1, 6, 1, SF_T_MAX);
  s.mode = (int)fixture_pick(seed, 1, 7, FX_HYBRID, FX_RADIX);
  memset(s.bias, 0, sizeof s.bias);
  if (fixture_pick(seed, 1, 8, 0, 2) == 0) s.bias[FX_C1] = (int)fixture_pick(seed, 1, 9, 1, 2047);
  s.bias[FX_C2] = fixture_pick(seed, 1, 10, 0, 2) == 0;
  s.bias[FX_C3] = fixture_pick(seed, 1, 11, 0, 2) == 0;
  return s;
}

/* A decoder of 1..160 inputs. */
static inline fixture_sizes fixture_random_decoder(uint64_t seed)
{
  fixture_sizes s = fixture_random_sizes(seed);
  s.levels = s.d_hidden = s.d_out = 0;
  s.n_dir = (int)fixture_pick(seed, 2, 0, 0, 3) ? (int)fixture_pick(seed, 2, 1, 1, SF_DIR_MAX) : SF_DIR_MAX;
  return s;
}

static inline void fixture_grid(fx_grid *grid, int levels)
{
  grid->levels = levels;
  grid->entries = 0;
  for (int l = 0; l < levels; l++) {
    const int res = 3 + 2 * l;
    grid->scale_q16[l] = ((res - 1) << 16) + l * 4321;
    grid->stride[l] = l < 4 ? res + 2 : 0;
    grid->log2_size[l] = l < 4 ? 0 : 9;
    grid->offset[l] = grid->entries;
    grid->shift[l] = 12 + l % 5;
    grid->entries += l < 4 ? (res + 2) * (res + 2) * (res + 2) : 512;
  }
}

static inline void fixture_set_sizes(fx_scene *scene, const fixture_sizes *s)
{
  fx_layer *l = scene->net.layer;
  l[FX_D1].n_in = 2 * s->levels, l[FX_D1].n_out = l[FX_D2].n_in = s->d_hidden, l[FX_D2].n_out = s->d_out;
  l[FX_C1].n_in = s->n_dir + (s->d_out ? s->d_out - 1 : 0), l[FX_C1].n_out = l[FX_C2].n_in = s->c1;
  l[FX_C2].n_out = l[FX_C3].n_in = s->c2, l[FX_C3].n_out = 3;
  for (int i = 0; i < SF_LAYERS; i++) l[i].bias = s->bias[i];
  fixture_grid(&scene->grid, s->levels);
  scene->occ_res = 8;
}

/* The largest weight of an output: with a smaller H_SHIFT than the default, h must fit its 12 bits all the same. */
static inline int8_t fixture_rail(int layer, int output)
{
  const int less = 2 + (SF_LANES >> 7) - SF_H_SHIFT;
  return (int8_t)(layer == FX_D2 && output > 0 && less > 0 ? 127 >> less : 127);
}

/* Random weights; thresholds of the size of one standard deviation of the currents, so that a part fires. */
static inline void fixture_fill(fx_scene *scene, const fixture_sizes *s, uint64_t seed)
{
  static const int theta[SF_LAYERS] = {60000, 0, 60000, 60000, 0};
  for (int l = 0; l < SF_LAYERS; l++) {
    fx_layer *layer = &scene->net.layer[l];
    layer->k = (int32_t)fixture_pick(seed, 10, (uint64_t)l, 0, 4096);
    layer->theta = layer->n_out ? theta[l] : 0;
    for (int i = 0; i < fx_layer_rows(layer); i++)
      for (int o = 0; o < layer->n_out; o++)
        layer->w[i * SF_LANES + o] = (int8_t)fixture_pick(seed, 20 + (uint64_t)l, (uint64_t)(i * SF_LANES + o),
                                                          -fixture_rail(l, o), fixture_rail(l, o));
  }
  for (int64_t i = 0; i < scene->grid.entries * 2; i++)
    scene->grid.table[i] = (int8_t)fixture_pick(seed, 30, (uint64_t)i, -127, 127);
  for (int i = 0; i < 64; i++) scene->occupancy[i] = (uint8_t)fixture_pick(seed, 31, (uint64_t)i, 0, 255);
  scene->net.mode = s->mode, scene->net.steps = s->steps;
  scene->net.exp_in = (fx_scale){50000, 15, 4096};
  scene->net.sigmoid_in = (fx_scale){50000, 13, 0};
  scene->step_q24 = 30000, scene->max_samples = 1024, scene->trans_stop = 104;
  for (int o = 0; o < 3; o++) scene->background[o] = 65536, scene->units.to_box_offset[o] = 0.5;
  scene->units.to_box_scale = 0.5, scene->units.dir_scale = 0x1p-10;
  for (int l = 0; l < FX_LEVELS_MAX; l++) scene->units.feature_scale[l] = 0x1p-10;
  for (int l = 0; l < SF_LAYERS; l++) scene->units.current_scale[l] = 0x1p-12;
}

static inline fx_scene fixture_scene(const fixture_sizes *sizes, uint64_t seed)
{
  fx_scene scene = {0};
  fixture_set_sizes(&scene, sizes);
  sf_status status = fx_scene_allocate(&scene, "fixture");
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
  fixture_fill(&scene, sizes, seed);
  status = fx_scene_check(&scene, "fixture");
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
  return scene;
}

/* In a box of cascades 0..log2_bound with growing steps; the shortest is `step_q24`. */
static inline fx_scene fixture_box(const fixture_sizes *sizes, uint64_t seed, int log2_bound, int32_t step_q24)
{
  fx_scene scene = {.log2_bound = log2_bound, .gamma_q24 = 1 << 20, .near_q16 = 20 << 16, .longest_q16 = 16 << 16};
  fixture_set_sizes(&scene, sizes);
  scene.step_q24 = step_q24;
  ck_ok(fx_scene_allocate(&scene, "box"));
  fixture_fill(&scene, sizes, seed);
  scene.step_q24 = step_q24;
  for (int i = 0; i < 64 * (log2_bound + 1); i++)
    scene.occupancy[i] = (uint8_t)fixture_pick(seed, 32, (uint64_t)i, 0, 255);
  ck_ok(fx_scene_check(&scene, "box"));
  return scene;
}

static inline void fixture_inputs(uint64_t seed, uint64_t index, int16_t *f, int n, int limit)
{
  for (int i = 0; i < n; i++) f[i] = (int16_t)fixture_pick(seed, 40, index * 256 + (uint64_t)i, -limit, limit);
}

/* ---- comparison ---- */

static inline void assert_same_lanes(const fx_trace *a, const fx_trace *b, const fx_net *net, int l, int t)
{
  for (int o = 0; o < net->layer[l].n_out; o++) {
    ck_assert_msg(a->current[l][t][o] == b->current[l][t][o], "layer %d step %d neuron %d: current %d, naive %d", l, t,
                  o, a->current[l][t][o], b->current[l][t][o]);
    ck_assert_msg(a->membrane[l][t][o] == b->membrane[l][t][o], "layer %d step %d neuron %d: membrane %d, naive %d", l,
                  t, o, a->membrane[l][t][o], b->membrane[l][t][o]);
  }
}

static inline void assert_same_counts(const fx_counts *a, const fx_counts *b)
{
  const uint64_t *x = (const uint64_t *)a, *y = (const uint64_t *)b;
  for (size_t i = 0; i < sizeof *a / sizeof *x; i++)
    ck_assert_msg(x[i] == y[i], "counter %zu: %llu, naive %llu", i, (unsigned long long)x[i], (unsigned long long)y[i]);
}

/* One sample through both, everything compared; returns the core's result. */
static inline fx_out assert_sample(const fx_net *net, const int16_t *f, const int16_t *dir, fx_trace *trace)
{
  fx_out fast, slow, quiet;
  fx_trace *naive = malloc(sizeof *naive);
  fx_counts a = {0}, b = {0};
  int32_t base[SF_LANES];
  fx_net_direction(net, dir, base, &a);
  fx_net_sample(net, f, base, &fast, trace, &a);
  fx_net_sample(net, f, base, &quiet, NULL, NULL);
  naive_sample(net, f, dir, true, &slow, naive, &b);
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < net->steps; t++) assert_same_lanes(trace, naive, net, l, t);
  ck_assert_mem_eq(trace->spikes, naive->spikes, sizeof naive->spikes);
  ck_assert_mem_eq(&fast, &slow, sizeof fast);
  ck_assert_mem_eq(&fast, &quiet, sizeof fast);
  assert_same_counts(&a, &b);
  free(naive);
  return fast;
}
#endif
