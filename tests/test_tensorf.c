/* TensoRF: layout, field and decoder by hand, files. */
#include "ck_run.h"
#include "tensorf_fixture.h"
#include "folder_fixture.h"
#include "snn/plif.h"
#include <math.h>

TEST(inputs_are_tensorf)
{
  ck_assert_int_eq(sf_tensorf_inputs(&(sf_tensorf){.features = 27, .feature_freqs = 2, .view_freqs = 2}), 150);
  ck_assert_int_eq(sf_tensorf_inputs(&(sf_tensorf){.features = 27}), 30);
  OWNED(sf_model) m = test_tensorf(SF_NET_SNN, 1, 16, 2);
  ck_assert_int_eq(sf_tensorf_products(&m.config.tensorf), 72);
  ck_assert_int_eq(m.param[SF_P_APP_PLANE + 1].shape[2], 12);
}

/* 2 097 156 voxels in the Blender box are 128^3, 27 000 000 are 300^3; in a box twice as wide along x the voxels stay
 * cubes. */
TEST(resolution_is_tensorf)
{
  static float cube[2][3] = {{-1, -1, -1}, {1, 1, 1}}, wide[2][3] = {{-2, -1, -1}, {2, 1, 1}};
  int32_t r[3];
  sf_tensorf_resolution(cube, 2097156, r);
  ck_assert(r[0] == 128 && r[1] == 128 && r[2] == 128);
  sf_tensorf_resolution(cube, 27e6, r);
  ck_assert(r[0] == 300 && r[1] == 300 && r[2] == 300);
  sf_tensorf_resolution(wide, 2e6, r);
  ck_assert(r[0] == 200 && r[1] == 100 && r[2] == 100);
}

/* Plane and line that are linear in their coordinates: interpolation gives the products exactly, corners included. */
TEST(interpolation_is_linear)
{
  OWNED(sf_model) m = test_tensorf(SF_NET_SNN, 0, 16, 2);
  const sf_tensorf *f = &m.config.tensorf;
  for (int mode = 0; mode < 3; mode++) {
    const sf_param *plane = &m.param[SF_P_DENSITY_PLANE + mode], *line = &m.param[SF_P_DENSITY_LINE + mode];
    for (size_t i = 0; i < plane->size; i++) {
      const size_t texel = i / 16, column = texel % (size_t)plane->shape[1], row = texel / (size_t)plane->shape[1];
      m.value[plane->offset + i] = i % 16 ? 0 : (float)column + 10 * (float)row;
    }
    for (size_t i = 0; i < line->size; i++) m.value[line->offset + i] = i % 16 ? 0 : 1 + (float)(i / 16);
  }
  for (int i = 0; i < 200; i++) {
    float x[3], at[3];
    for (int a = 0; a < 3; a++) {
      x[a] = i < 8 ? (float)(i >> a & 1) : sf_random_float(3, a, i);
      at[a] = x[a] * (float)(f->resolution[a] - 1);
    }
    const float expected =
        (at[0] + 10 * at[1]) * (1 + at[2]) + (at[0] + 10 * at[2]) * (1 + at[1]) + (at[1] + 10 * at[2]) * (1 + at[0]);
    ck_assert_float_eq_tol(sf_tensorf_density_feature(&m, x), expected, 1e-5f * (1 + expected));
  }
}

TEST(activations_by_hand)
{
  sf_tensorf f = {.activation = SF_SOFTPLUS, .shift = -10, .distance_scale = 25};
  ck_assert_float_eq_tol(sf_tensorf_sigma(&f, 10), 25 * 0.6931472f, 1e-5f);
  ck_assert_float_eq_tol(sf_tensorf_sigma(&f, 110), 2500, 1e-3f);
  ck_assert_float_eq_tol(sf_tensorf_sigma(&f, 0), 25 * 4.539889e-5f, 1e-8f);
  f.activation = SF_RELU, f.shift = 0;
  ck_assert_float_eq(sf_tensorf_sigma(&f, -1), 0);
  ck_assert_float_eq(sf_tensorf_sigma(&f, 2), 50);
}

/* TensoRF's order: features, direction, sines and cosines of the features, of the direction; frequencies fastest. */
TEST(encoding_order)
{
  const sf_tensorf f = {.features = 2, .feature_freqs = 2, .view_freqs = 1};
  const float features[2] = {0.3f, -0.7f}, direction[3] = {0.6f, 0, -0.8f};
  const double expected[] = {0.3,       -0.7,      0.6,      0,        -0.8,      sin(0.3),  sin(0.6),
                             sin(-0.7), sin(-1.4), cos(0.3), cos(0.6), cos(-0.7), cos(-1.4), sin(0.6),
                             sin(0),    sin(-0.8), cos(0.6), cos(0),   cos(-0.8)};
  float in[19];
  ck_assert_int_eq(sf_tensorf_inputs(&f), 19);
  sf_tensorf_encode(&f, features, direction, in);
  for (int i = 0; i < 19; i++) ck_assert_float_eq_tol(in[i], (float)expected[i], 1e-6f);
}

/* The twin is a plain network with biases. */
TEST(twin_is_a_network_with_biases)
{
  OWNED(sf_model) m = test_tensorf(SF_NET_ANN, 1, 16, 1);
  float in[30], colour[3];
  double h[2][16];
  for (int i = 0; i < 30; i++) in[i] = test_random(77 + i);
  sf_net_sample(&m, in, NULL, 1, NULL, colour, NULL);
  const float *w1 = sf_model_param(&m, SF_P_C1), *w2 = sf_model_param(&m, SF_P_C2), *w3 = sf_model_param(&m, SF_P_C3);
  for (int o = 0; o < 16; o++) {
    h[0][o] = sf_model_param(&m, SF_P_C1_BIAS)[o];
    for (int i = 0; i < 30; i++) h[0][o] += w1[o * 30 + i] * in[i];
    h[0][o] = fmax(h[0][o], 0);
  }
  for (int o = 0; o < 16; o++) {
    h[1][o] = sf_model_param(&m, SF_P_C2_BIAS)[o];
    for (int i = 0; i < 16; i++) h[1][o] += w2[o * 16 + i] * h[0][i];
    h[1][o] = fmax(h[1][o], 0);
  }
  for (int o = 0; o < 3; o++) {
    double j = sf_model_param(&m, SF_P_C3_BIAS)[o];
    for (int i = 0; i < 16; i++) j += w3[o * 16 + i] * h[1][i];
    ck_assert_float_eq_tol(colour[o], (float)(1 / (1 + exp(-j))), 1e-6f);
  }
}

TEST(save_and_load)
{
  for (int ndc = 0; ndc < 2; ndc++) {
    sf_model m = test_tensorf(SF_NET_SNN, ndc, 32, 4), back;
    m.t_star = 2.25f;
    m.t_r = 2;
    m.occupancy[3] = 0x5a;
    ck_ok(sf_model_save(&m, in("model.safetensors")));
    ck_ok(sf_model_load(&back, in("model.safetensors")));
    ck_assert_mem_eq(&m.config, &back.config, sizeof m.config);
    ck_assert_uint_eq(m.size, back.size);
    ck_assert_mem_eq(m.value, back.value, m.size * sizeof *m.value);
    ck_assert_mem_eq(m.occupancy, back.occupancy, 8 * 8 * 8 / 8);
    ck_assert(back.t_r == 2 && back.t_star == 2.25f);
    sf_model_free(&back);
    m.config.tensorf.density[1] = 3;
    ck_ok(sf_model_save(&m, in("model.safetensors")));
    sf_status status = sf_model_load(&back, in("model.safetensors"));
    ck_assert_int_ne(status.code, SF_OK);
    ck_assert_ptr_nonnull(strstr(status.message, "model.safetensors"));
    m.config.tensorf.density[1] = 8;
    ck_ok(sf_model_save(&m, in("model.safetensors")));
    status = sf_model_load(&back, in("model.safetensors"));
    ck_assert_ptr_nonnull(strstr(status.message, "density_plane.1"));
    sf_model_free(&m);
  }
}

/* Files of version 1 are read, but for those of weighted neurons, which had the number that radix neurons have now. */
LOOP_TEST(files_of_the_version_before, 3)
{
  const bool twin = _i == 2;
  OWNED(sf_model) m = test_tensorf(twin ? SF_NET_ANN : SF_NET_SNN, 0, 32, twin ? 1 : 4), back = {0};
  OWNED(sf_tensors) set = {0};
  m.config.mode = _i ? SF_RADIX : SF_HYBRID;
  ck_ok(sf_model_save(&m, in("model.safetensors")));
  ck_ok(sf_tensors_load(&set, in("model.safetensors")));
  ck_assert_str_eq(sf_tensors_meta(&set, "version"), "2");
  cJSON_ReplaceItemInObjectCaseSensitive(set.metadata, "version", cJSON_CreateString("1"));
  ck_ok(sf_tensors_save(set.tensor, set.count, set.metadata, in("before.safetensors")));
  const sf_status status = sf_model_load(&back, in("before.safetensors"));
  ck_assert_int_eq(status.code, _i == 1 ? SF_E_UNSUPPORTED : SF_OK);
  if (_i == 1) ck_assert_ptr_nonnull(strstr(status.message, "train the model anew"));
}

int ck_timeout = 120;
ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
