/* Trimming TensoRF's planes: each kind of cut leaves what stays as it was. */
#include "ck_run.h"
#include "tests/fit_planes_fixture.h"
#include <omp.h>

TEST(without_effect_changes_no_bit)
{
  OWNED(fx_scene) scene = planes_scene(1), small, all;
  spoil(&scene);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  OWNED(sf_trim_use) use = observed(&scene, &rays);
  sf_trim trim;
  sf_trim_all(&scene, &trim);
  all = trimmed(&scene, &trim, &use);
  assert_same_pixels(&scene, &all, &rays);
  ck_assert_int_eq(fx_tensorf_bytes(&all.tensorf), fx_tensorf_bytes(&scene.tensorf));
  sf_trim_exact(&scene, &use, &trim);
  small = trimmed(&scene, &trim, &use);
  expect_dropped(&small);
  assert_same_pixels(&scene, &small, &rays);
}

/* ---- what stays is what it was ---- */

static void random_unit(uint64_t i, int16_t unit[3])
{
  for (uint64_t a = 0; a < 3; a++) unit[a] = (int16_t)fixture_pick(81, a, i, -FX_UNIT_ONE, FX_UNIT_ONE);
}

/* Inputs of the small scene against those of the scene with the same components cleared. */
static void same_inputs(const fx_scene *scene, const fx_scene *small, const bool *feature, uint64_t i)
{
  meaning all[SF_DIR_MAX], left[SF_DIR_MAX];
  int16_t x[SF_DIR_MAX], y[SF_DIR_MAX], unit[3];
  uint32_t pos[3];
  int number[FEATURES], features = 0;
  for (int f = 0; f < FEATURES; f++)
    if (feature[f]) number[features++] = f;
  const int n = list_inputs(FEATURES, FEATURE_FREQS, VIEW_FREQS, all);
  const int m = list_inputs(features, small->tensorf.feature_freqs, small->tensorf.view_freqs, left);
  random_position(i, pos), random_unit(i, unit);
  fx_tensorf_encode(&scene->tensorf, pos, unit, x, NULL), fx_tensorf_encode(&small->tensorf, pos, unit, y, NULL);
  ck_assert_int_eq(m, small->net.layer[FX_C1].n_in);
  for (int j = 0; j < m; j++) {
    const int of = left[j].of < 100 ? number[left[j].of] : left[j].of;
    int at = 0;
    while (at < n && (all[at].of != of || all[at].order != left[j].order || all[at].cosine != left[j].cosine)) at++;
    ck_assert_int_lt(at, n);
    ck_assert_int_eq(y[j], x[at]);
    for (int o = 0; o < C1; o++)
      ck_assert_int_eq(small->net.layer[FX_C1].w[j * SF_LANES + o], scene->net.layer[FX_C1].w[at * SF_LANES + o]);
  }
  ck_assert_uint_eq(fx_tensorf_density(&scene->tensorf, pos, NULL), fx_tensorf_density(&small->tensorf, pos, NULL));
}

TEST(components_features_and_sines)
{
  OWNED(fx_scene) scene = planes_scene(2), small;
  sf_trim_use use;
  sf_trim trim;
  ck_ok(sf_trim_use_create(&use, &scene));
  sf_trim_all(&scene, &trim);
  trim.planes.component[SF_OF_DENSITY][0][3] = trim.planes.component[SF_OF_DENSITY][2][0] = false;
  trim.planes.component[SF_OF_APPEARANCE][0][19] = trim.planes.component[SF_OF_APPEARANCE][1][1] = false;
  trim.planes.feature[0] = trim.planes.feature[3] = false;
  trim.planes.feature_freqs = 1, trim.planes.view_freqs = 0;
  small = trimmed(&scene, &trim, &use);
  ck_assert_int_eq(small.net.layer[FX_C1].n_in, 3 * 3 + 3);
  clear_component(&scene.tensorf.density, scene.tensorf.res, 0, 3);
  clear_component(&scene.tensorf.density, scene.tensorf.res, 2, 0);
  clear_component(&scene.tensorf.appearance, scene.tensorf.res, 0, 19);
  clear_component(&scene.tensorf.appearance, scene.tensorf.res, 1, 1);
  for (uint64_t i = 0; i < 200; i++) same_inputs(&scene, &small, trim.planes.feature, i);
  sf_trim_use_free(&use);
}

/* A neuron that always fires is its bias: without it no bit changes. */
TEST(the_mean_of_what_goes_stays)
{
  OWNED(fx_scene) scene = planes_scene(3), small;
  fx_layer *c1 = &scene.net.layer[FX_C1], *c2 = &scene.net.layer[FX_C2];
  for (int i = 0; i < c1->n_in; i++) c1->w[i * SF_LANES + 11] = 0;
  c1->w[c1->n_in * SF_LANES + 11] = 127;
  for (int o = 0; o < C2; o++) c2->w[11 * SF_LANES + o] = (int8_t)(o - 15), c2->w[C1 * SF_LANES + o] /= 2;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  OWNED(sf_trim_use) use = observed(&scene, &rays);
  ck_assert_uint_eq(use.fired[FX_C1][11], use.steps);
  sf_trim trim;
  sf_trim_all(&scene, &trim);
  trim.neuron[FX_C1][11] = false;
  small = trimmed(&scene, &trim, &use);
  ck_assert_int_eq(small.net.layer[FX_C1].n_out, C1 - 1);
  assert_same_pixels(&scene, &small, &rays);
}

/* What is left out of a layer's inputs beside neurons of its own, and a bias that is as large as it may be: the largest
 * weight of the layer. */
TEST(a_bias_stays_within_the_weights)
{
  OWNED(fx_scene) scene = planes_scene(3), small;
  OWNED(sf_trim_use) use;
  sf_trim trim;
  fx_layer *c2 = &scene.net.layer[FX_C2];
  ck_ok(sf_trim_use_create(&use, &scene));
  use.samples = 10, use.steps = 10 * (uint64_t)scene.net.steps, use.fired[FX_C1][11] = use.steps / 2;
  c2->bias = 1;
  for (size_t i = 0; i < (size_t)fx_layer_rows(c2) * SF_LANES; i++)
    c2->w[i] = (int8_t)(c2->w[i] / 2 + (i % SF_LANES < C2));
  for (int o = 0; o < C2; o++)
    c2->w[11 * SF_LANES + o] = (int8_t)(o == 29 ? 100 : 4 * (o - 15)),
                          c2->w[C1 * SF_LANES + o] = (int8_t)(o == 29 ? 60 : o);
  sf_trim_all(&scene, &trim);
  trim.neuron[FX_C1][11] = trim.neuron[FX_C2][3] = trim.neuron[FX_C2][20] = false;
  small = trimmed(&scene, &trim, &use);
  const int8_t *bias = small.net.layer[FX_C2].w + (C1 - 1) * SF_LANES;
  ck_assert_int_eq(small.net.layer[FX_C2].n_out, C2 - 2);
  for (int o = 0, lane = 0; o < C2; o++) {
    if (o == 3 || o == 20) continue;
    ck_assert_int_eq(bias[lane++], o == 29 ? 100 : o + 2 * (o - 15)); /* half of the steps: half of the weight */
  }
}

/* Of each position the components that are not zero, by the square of what they give times the weight. */
TEST(use_of_components)
{
  OWNED(fx_scene) scene = planes_scene(6);
  OWNED(sf_trim_use) use;
  ck_ok(sf_trim_use_create(&use, &scene));
  for (int which = 0; which < SF_FACTORS; which++) {
    const fx_factors *factors = sf_factors_of(&scene.tensorf, which);
    uint64_t count[FX_PAIRS * FX_COMPONENTS_MAX] = {0}, power[FX_PAIRS * FX_COMPONENTS_MAX] = {0};
    for (uint64_t i = 0; i < 40; i++) {
      const uint32_t weight = (uint32_t)sf_random_below(82, 0, i, 1 << SF_TRANS_FRAC);
      int32_t exact[FX_PAIRS * FX_COMPONENTS_MAX];
      int16_t rounded[FX_PAIRS * FX_COMPONENTS_MAX];
      uint32_t pos[3];
      random_position(i, pos);
      fx_tensorf_density_products(&scene.tensorf, pos, exact);
      fx_tensorf_products(&scene.tensorf, pos, rounded);
      sf_trim_use_factors(&use, &scene.tensorf, (sf_factors_id)which, pos, weight);
      for (int n = 0; n < fx_factors_components(factors); n++) {
        int64_t size = which == SF_OF_DENSITY ? (int64_t)floor(exact[n] / 32768.0) : rounded[n];
        if (which == SF_OF_DENSITY && exact[n] && !size) size = 1; /* small, but there */
        count[n] += size != 0, power[n] += (uint64_t)(size * size) * (weight / 4096);
      }
    }
    for (int pair = 0, n = 0; pair < FX_PAIRS; pair++)
      for (int c = 0; c < factors->components[pair]; c++, n++) {
        ck_assert_uint_eq(use.component[which][pair][c], count[n]);
        ck_assert_uint_eq(use.power[which][pair][c], power[n]);
        ck_assert_uint_gt(power[n], 0);
      }
  }
}

/* The least used ones go, and never the last line. */
TEST(lines_of_components)
{
  OWNED(fx_scene) scene = planes_scene(4);
  sf_trim_use use;
  sf_trim trim;
  ck_ok(sf_trim_use_create(&use, &scene));
  for (int c = 0; c < 20; c++) use.power[SF_OF_APPEARANCE][0][c] = (uint64_t)(c * 7 % 20 + 1) << 40;
  sf_trim_all(&scene, &trim);
  for (int c = 0; c < 20; c++) /* equal rows of the basis */
    memset(scene.tensorf.basis + c * FX_APPEARANCE_MAX, 9, FEATURES);
  ck_assert(sf_trim_line(&scene, &use, &trim, SF_OF_APPEARANCE, 0));
  for (int c = 0; c < 20; c++) ck_assert_int_eq(trim.planes.component[SF_OF_APPEARANCE][0][c], c * 7 % 20 >= 4);
  ck_assert(!sf_trim_line(&scene, &use, &trim, SF_OF_APPEARANCE, 0));
  ck_assert(!sf_trim_line(&scene, &use, &trim, SF_OF_DENSITY, 1));
  sf_trim_use_free(&use);
}

/* A component of the appearance counts by its row of the basis, too. Those of a pair come behind the pairs before it.
 */
TEST(lines_by_the_basis)
{
  static int8_t basis[(3 + 20 + 18) * FX_APPEARANCE_MAX];
  static sf_trim_use use;
  fx_scene scene = {.tensorf = {.features = 2, .basis = basis, .appearance = {.components = {3, 20, 18}}}};
  sf_trim trim = {.planes.feature = {true, true}};
  for (int row = 0; row < 41; row++) basis[row * FX_APPEARANCE_MAX + row % 2] = (int8_t)(row * 13 % 41 + 1);
  for (int pair = 0; pair < FX_PAIRS; pair++)
    for (int c = 0; c < scene.tensorf.appearance.components[pair]; c++)
      trim.planes.component[SF_OF_APPEARANCE][pair][c] = true, use.power[SF_OF_APPEARANCE][pair][c] = 1000;
  ck_assert(sf_trim_line(&scene, &use, &trim, SF_OF_APPEARANCE, 1));
  ck_assert(sf_trim_line(&scene, &use, &trim, SF_OF_APPEARANCE, 2));
  for (int pair = 1; pair < FX_PAIRS; pair++) {
    const int first = pair == 1 ? 3 : 23, n = scene.tensorf.appearance.components[pair];
    for (int c = 0; c < n; c++) {
      int smaller = 0;
      for (int k = 0; k < n; k++) smaller += (first + k) * 13 % 41 < (first + c) * 13 % 41;
      ck_assert_int_eq(trim.planes.component[SF_OF_APPEARANCE][pair][c], smaller >= n - FX_LINE);
    }
  }
}

int ck_timeout = 240;

int main(void)
{
  omp_set_num_threads(1); /* many small parallel regions: threads would wait for each other on a busy machine */
  return ck_main();
}
