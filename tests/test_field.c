/* Hash grid and spherical harmonics. */
#include "ck_run.h"
#include "float_fixture.h"
#include "snn/kernels.h"
#include <math.h>

/* torch-ngp at bound 1: 16 levels, 2^19, 16..2048: 6 119 864 entries, dense up to 59, hashed from 81. */
TEST(layout_is_torch_ngp)
{
  sf_config c = sf_config_default();
  OWNED(sf_model) m;
  ck_ok(sf_model_create(&m, &c));
  size_t entries = 0;
  for (int l = 0; l < 16; l++) entries += m.level[l].entries;
  ck_assert_uint_eq(entries, 6119864);
  int dense = 0;
  for (int l = 0; l < 16; l++) dense += m.level[l].stride != 0;
  ck_assert_int_eq(dense, 5);
  ck_assert_uint_eq(m.level[4].stride, 60);
}

/* Trilinear weights sum to one: a constant table gives the constant, at faces and corners too. */
TEST(constant_table_gives_constant)
{
  OWNED(sf_model) m = test_model(SF_NET_SNN, SF_HYBRID, 16, 2, 1);
  for (size_t i = 0; i < m.param[SF_P_GRID].size; i++) m.value[i] = 0.75f;
  for (int i = 0; i < 500; i++) {
    float x[3], f[32];
    for (int a = 0; a < 3; a++) x[a] = i < 8 ? (float)(i >> a & 1) : sf_random_float(3, a, i);
    sf_grid_features(&m, x, f);
    for (int j = 0; j < 8; j++) ck_assert_float_eq_tol(f[j], 0.75f, 1e-6f);
  }
}

static void positions(float *x)
{
  for (int i = 0; i < 3 * SF_BLOCK; i++) x[i] = sf_random_float(5, 1, i);
  x[0] = x[SF_BLOCK] = x[2 * SF_BLOCK] = 0; /* corners of the box */
  x[1] = x[SF_BLOCK + 1] = x[2 * SF_BLOCK + 1] = 1;
}

TEST(kernels_equal_oracle)
{
  static const char *const isa[] = {"portable", "avx2", "avx512"};
  OWNED(sf_model) m = test_model(SF_NET_SNN, SF_HYBRID, 16, 2, 1);
  float x[3 * SF_BLOCK], out[2 * SF_BLOCK];
  positions(x);
  for (int i = 0; i < 3; i++) {
    const sf_kernels *k = sf_kernels_select(isa[i]);
    if (!k) continue;
    for (int level = 0; level < 4; level++) {
      k->grid_forward(&m.level[level], m.value, x, out);
      for (int l = 0; l < SF_BLOCK; l++) {
        const float at[3] = {x[l], x[SF_BLOCK + l], x[2 * SF_BLOCK + l]};
        float f[32];
        sf_grid_features(&m, at, f);
        /* pos may round differently when contracted: weights move by 32 * 2^-24 */
        ck_assert_float_eq_tol(out[l], f[2 * level], 2e-5f);
        ck_assert_float_eq_tol(out[SF_BLOCK + l], f[2 * level + 1], 2e-5f);
      }
    }
  }
}

/* The features are linear in the table, so <d, forward(table)> = <backward(d), table> for any d and table. */
TEST(backward_is_the_adjoint)
{
  const sf_kernels *k = sf_kernels_select(NULL);
  OWNED(sf_model) m = test_model(SF_NET_SNN, SF_HYBRID, 16, 2, 1);
  float x[3 * SF_BLOCK], out[2 * SF_BLOCK], d[2 * SF_BLOCK];
  positions(x);
  for (int i = 0; i < 2 * SF_BLOCK; i++) d[i] = test_random(1u << 26 | i);
  for (int level = 0; level < 4; level++) {
    float *grad = calloc(m.size, sizeof *grad);
    double left = 0, right = 0;
    k->grid_forward(&m.level[level], m.value, x, out);
    k->grid_backward(&m.level[level], x, d, grad);
    for (int i = 0; i < 2 * SF_BLOCK; i++) left += (double)d[i] * out[i];
    for (size_t i = 0; i < m.param[SF_P_GRID].size; i++) right += (double)grad[i] * m.value[i];
    ck_assert_double_eq_tol(left, right, 1e-4);
    free(grad);
  }
}

/* Orthonormal on the sphere: Monte Carlo over 200 000 directions, standard error below 4 pi / sqrt(n) / 3 = 0.01. */
TEST(harmonics_are_orthonormal)
{
  enum { N = 200000 };
  static double product[16][16];
  memset(product, 0, sizeof product);
  for (int i = 0; i < N; i++) {
    float z = 2 * sf_random_float(9, 1, i) - 1, phi = 6.2831853f * sf_random_float(9, 2, i), r = sqrtf(1 - z * z);
    float d[3] = {r * cosf(phi), r * sinf(phi), z}, y[16];
    sf_sh4(d, y);
    for (int a = 0; a < 16; a++)
      for (int b = 0; b < 16; b++) product[a][b] += (double)y[a] * y[b] * 4 * M_PI / N;
  }
  for (int a = 0; a < 16; a++)
    for (int b = 0; b < 16; b++) ck_assert_double_eq_tol(product[a][b], a == b, 0.03);
}
