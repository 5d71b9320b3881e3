/* Quantiser: steps, leaks, narrow widths that never clip, models at the edge of sense. */
#include "ck_run.h"
#include "src/quant/internal.h"
#include "tests/quant_fixture.h"
#include "tests/tensorf_fixture.h"
#include <math.h>

TEST(steps_and_leaks)
{
  OWNED(sf_model) m = make_model(32, 4, SF_DECAY);
  fx_scene scene;
  float *leak = sf_model_param(&m, SF_P_LEAK);
  leak[0] = 0, leak[1] = 100, leak[2] = -100, leak[3] = 1, leak[4] = -1;
  for (int steps = 0; steps <= 4; steps++) {
    ck_ok(sf_quantise(&scene, &m, "model", &(sf_quant_options){.steps = steps}));
    ck_assert_int_eq(scene.net.steps, steps ? steps : 3);
    ck_assert_int_eq(scene.net.mode, FX_DECAY);
    static const int32_t k[SF_LAYERS] = {2048, 4096, 0, 2994, 1102};
    for (int l = 0; l < SF_LAYERS; l++) ck_assert_int_eq(scene.net.layer[l].k, k[l]);
    ck_assert_int_eq(scene.step_q24, lround(sqrt(3.0) / 256 * 16777216));
    fx_scene_free(&scene);
  }
}

static int largest(const int8_t *value, size_t n)
{
  int most = 0;
  for (size_t i = 0; i < n; i++) most = abs(value[i]) > most ? abs(value[i]) : most;
  return most;
}

/* |h| when exactly the neurons fire that push one way: no spikes can give more. */
static int worst_h(const fx_layer *d2)
{
  int worst = 0;
  for (int sign = -1; sign <= 1; sign += 2)
    for (int o = 1; o < d2->n_out; o++) {
      int current = 0;
      for (int i = 0; i < d2->n_in; i++) current += sign * d2->w[i * SF_LANES + o] > 0 ? d2->w[i * SF_LANES + o] : 0;
      const int h = abs(current >> SF_H_SHIFT);
      worst = h > worst ? h : worst;
    }
  return worst;
}

/* Nothing that hardware of these widths would have to clip: weights, entries, leaks; features by the largest entry of
 * their level (interpolation is convex) and measured; harmonics; h. At the core's own width features may saturate. */
static void assert_widths_hold(const fx_scene *scene, const sf_quant_widths *w)
{
  const int input_max = (1 << (w->feature_bits - 1)) - 1;
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *layer = &scene->net.layer[l];
    ck_assert_int_lt(largest(layer->w, (size_t)layer->n_in * SF_LANES), 1 << (w->weight_bits - 1));
    ck_assert_int_eq(layer->k & ((1 << (SF_LEAK_FRAC - w->leak_bits)) - 1), 0);
  }
  const int entry = largest(scene->grid.table, (size_t)scene->grid.entries * 2);
  ck_assert_int_lt(entry, 1 << (w->grid_bits - 1));
  ck_assert_int_le(worst_h(&scene->net.layer[FX_D2]), input_max);
  for (int l = 0; l < scene->grid.levels && w->feature_bits < SF_INPUT_BITS; l++)
    ck_assert_int_le((int)lround(ldexp(entry, 16 - scene->grid.shift[l])), input_max);
  for (uint64_t sample = 0; sample < CK_AMOUNT(500, 50); sample++) {
    uint32_t pos[3];
    int16_t f[32];
    fx_counts counts = {0};
    fx_ray ray;
    const float o[3] = {0, 0, 3};
    float d[3] = {normal(1, sample), normal(2, sample), normal(3, sample)};
    for (int a = 0; a < 3; a++) pos[a] = (uint32_t)sf_random_below(77, (uint64_t)a, sample, 1 << 24);
    if (sample < 3) d[0] = d[1] = 0, d[2] = sample == 0 ? 1 : -1; /* where harmonic 12 is largest */
    fx_grid_features(&scene->grid, pos, f, &counts);
    for (int i = 0; i < 2 * scene->grid.levels; i++) ck_assert_int_le(abs(f[i]), input_max);
    if (w->feature_bits < SF_INPUT_BITS) ck_assert_uint_eq(counts.saturated_features, 0);
    ck_ok(sf_fx_ray_make(scene, o, d, &ray));
    for (int i = 0; i < FX_SH; i++) ck_assert_int_le(abs(ray.dir[i]), input_max);
  }
}

static void assert_same_scene(const fx_scene *a, const fx_scene *b)
{
  ck_assert_mem_eq(a->grid.table, b->grid.table, (size_t)a->grid.entries * 2);
  ck_assert_mem_eq(a->grid.shift, b->grid.shift, sizeof a->grid.shift);
  ck_assert(a->units.dir_scale == b->units.dir_scale);
  for (int l = 0; l < SF_LAYERS; l++) {
    const fx_layer *x = &a->net.layer[l], *y = &b->net.layer[l];
    ck_assert_mem_eq(x->w, y->w, (size_t)x->n_in * SF_LANES);
    ck_assert(x->k == y->k && x->theta == y->theta && a->units.current_scale[l] == b->units.current_scale[l]);
  }
}

TEST(widths)
{
  static const struct {
    size_t offset;
    int low, high;
  } field[] = {{offsetof(sf_quant_widths, weight_bits), 2, SF_WEIGHT_BITS},
               {offsetof(sf_quant_widths, feature_bits), 8, SF_INPUT_BITS},
               {offsetof(sf_quant_widths, leak_bits), 4, SF_LEAK_FRAC},
               {offsetof(sf_quant_widths, grid_bits), 2, SF_GRID_BITS}};
  OWNED(sf_model) m = make_model(32, 4, SF_HYBRID);
  fx_scene whole, scene;
  sf_quant_report report;
  quantise(&m, &whole, &report);
  const int64_t packed = report.packed_bytes;
  assert_widths_hold(&whole, &report.widths);
  for (int i = 0; i < 4; i++)
    for (int bits = field[i].low; bits <= field[i].high; bits += CK_AMOUNT(1, field[i].high - field[i].low)) {
      sf_quant_options options = plain;
      *(int *)((char *)&options.widths + field[i].offset) = bits;
      ck_ok(sf_quantise_report(&scene, &m, "model", &options, &report));
      ck_assert_int_eq(*(int *)((char *)&report.widths + field[i].offset), bits);
      assert_widths_hold(&scene, &report.widths);
      if (bits == field[i].high) assert_same_scene(&whole, &scene);
      ck_assert(i % 3 || bits == field[i].high ? report.packed_bytes <= packed : report.packed_bytes < packed);
      fx_scene_free(&scene);
      *(int *)((char *)&options.widths + field[i].offset) = bits == field[i].low ? bits - 1 : field[i].high + 1;
      assert_refused(&m, &options, SF_E_RANGE, "bits asked for");
    }
  const sf_quant_options narrow = {.background = {1, 1, 1}, .seed = 1, .widths = {4, 8, 4, 4}};
  ck_ok(sf_quantise_report(&scene, &m, "model", &narrow, &report));
  assert_widths_hold(&scene, &report.widths);
  fx_scene_free(&scene);
  fx_scene_free(&whole);
}

/* A model whose calibration does not show how wide its inputs get: 128 equal weights, so that h could be 128 * 127 / 8
 * = 2032; a field that is 20 times larger outside the only occupied cell; directions that matter to no neuron, so that
 * no search avoids a fine LSB. */
TEST(narrow_inputs_never_clip)
{
  OWNED(sf_model) m = make_model(128, 2, SF_HYBRID);
  fx_scene scene;
  sf_quant_report report;
  float *w3 = sf_model_param(&m, SF_P_C1), *grid = sf_model_param(&m, SF_P_GRID);
  memset(m.occupancy, 0, 512);
  m.occupancy[0] = 1; /* the first of 16^3 cells: the first 4 points of level 0 along every axis hold it */
  for (uint32_t i = 0; i < 2 * m.level[0].entries; i++) grid[i] *= 20;
  for (uint32_t i = 0; i < 64; i++) {
    const uint32_t entry = (i % 4 ^ i / 4 % 4 * 2654435761u ^ i / 16 * 805459861u) % m.level[0].entries;
    grid[2 * entry] = grid[2 * entry + 1] = 0.5f;
  }
  for (size_t i = 0; i < m.param[SF_P_D2].size; i++) sf_model_param(&m, SF_P_D2)[i] = 0.5f;
  for (size_t i = 0; i < m.param[SF_P_C1].size; i++)
    if (i % (SF_DIR_FEATURES + SF_GEO_FEATURES) < SF_DIR_FEATURES) w3[i] = 0;
  quantise(&m, &scene, &report);
  ck_assert_int_gt(worst_h(&scene.net.layer[FX_D2]), 1023);
  fx_scene_free(&scene);
  for (int bits = 8; bits < SF_INPUT_BITS; bits += CK_AMOUNT(1, 2)) {
    const sf_quant_options options = {.seed = 1, .widths.feature_bits = bits};
    ck_ok(sf_quantise_report(&scene, &m, "model", &options, &report));
    assert_widths_hold(&scene, &report.widths);
    fx_scene_free(&scene);
  }
}

/* Models at the edge of sense still give a scene that passes its check, and scales that a model's file may hold. */
TEST(extreme_models)
{
  static const float scales[] = {0, 1e-42f, 1e-20f, 1e-4f, 1};
  for (int i = 0; i < 5; i += CK_AMOUNT(1, 2))
    for (int part = 0; part < SF_P_LEAK; part++) {
      sf_model m = make_model(16, 3, SF_HYBRID);
      fx_scene scene;
      sf_quant_report report;
      float *value = sf_model_param(&m, part);
      if (!sf_model_has(&m, part)) {
        sf_model_free(&m);
        continue;
      }
      if (scales[i] != 1)
        for (size_t n = 0; n < m.param[part].size; n++) value[n] *= scales[i];
      if (scales[i] == 1) m.config.theta[part % 3] = 1e6f, memset(m.occupancy, 0, 512);
      if (scales[i] == 1e-4f && part == SF_P_GRID)
        memset(value, 0, m.param[part].size / 16 * sizeof *value); /* a level, too */
      m.config.scale = i % 2 ? 1e-6f : 1e6f;
      const sf_status status = sf_quantise_report(&scene, &m, "model", &plain, &report);
      ck_assert_msg(status.code == SF_OK, "part %d scale %g: %s", part, (double)scales[i], status.message);
      for (int n = 0; n < SF_SCALES; n++) {
        const float lsb = ((const float *)&report.scales.lsb)[n];
        ck_assert_msg(lsb > 1e-30f && lsb < 1e30f, "part %d scale %g: LSB %d is %g", part, (double)scales[i], n,
                      (double)lsb);
      }
      fx_scene_free(&scene);
      sf_model_free(&m);
    }
}

/* The opacity of a sample at a point, and whether its cell is occupied. */
static float seen_at(const sf_model *m, const uint32_t pos[3], bool *occupied)
{
  const int res = m->config.occ_res;
  float x[3];
  sf_calibration_position(pos, x);
  const int cell = ((int)(x[2] * (float)res) * res + (int)(x[1] * (float)res)) * res + (int)(x[0] * (float)res);
  *occupied = m->occupancy[cell / 8] >> (cell % 8) & 1;
  return 1 - expf(-sf_tensorf_sigma(&m->config.tensorf, sf_tensorf_density_feature(m, x)) *
                  sf_tensorf_step(&m->config.tensorf));
}

/* Planes and lines are calibrated where rays see something; where nothing can be seen, as after a few iterations of
 * training, in occupied cells; where all are empty, anywhere. */
LOOP_TEST(points_of_calibration, 3)
{
  OWNED(sf_model) m = test_smooth_tensorf(0);
  OWNED(sf_calibration) c;
  const size_t bytes = sf_config_cells(&m.config) / 8;
  memset(m.occupancy, _i < 2 ? 0x22 : 0, bytes);
  if (_i) m.config.tensorf.shift = -30;
  ck_ok(sf_calibrate(&c, &m, 2, 9));
  for (int i = 0; i < c.samples; i++) {
    bool occupied;
    const float seen = seen_at(&m, c.pos + 3 * i, &occupied);
    ck_assert_int_eq(occupied, _i < 2);
    if (_i == 0) ck_assert_msg(seen >= 0.01f, "sample %d: opacity %g", i, (double)seen);
    ck_assert_msg(i == 0 || memcmp(c.pos + 3 * i, c.pos + 3 * i - 3, 3 * sizeof *c.pos), "sample %d is the one before",
                  i);
  }
}

int ck_timeout = 300;
