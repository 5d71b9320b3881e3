/* Scenes larger than one box: growing steps, cascades of occupancy grids, and the hard rays of both. */
#include "float_fixture.h"
#include "render/march.h"
#include <check.h>
#include <math.h>
#include <string.h>

static sf_config large_config(int bound, int res)
{
  sf_config c = sf_config_default();
  sf_config_bound(&c, bound);
  c.levels = 2, c.log2_hash = 8, c.finest_res = 32, c.hidden = 16, c.steps = 2, c.occ_res = res;
  return c;
}

/* ---- steps ---- */

/* The recurrence in double precision; float adds up to 1024 roundings of 2^-24 of the distance. */
START_TEST(steps_grow_as_the_formula_says)
{
  for (int bound = 1; bound <= 64; bound *= 2) {
    const sf_config c = large_config(bound, 128);
    sf_steps s;
    ck_assert_int_eq(sf_steps_make(&s, &c, 1).code, SF_OK);
    double start = 0;
    const double least = 2 * sqrt(3) / 1024, most = 2 * sqrt(3) * bound / 128;
    for (int n = 0; n < s.count; n++) {
      const double length = fmin(fmax((0.2 + start) * c.dt_gamma, least), most);
      ck_assert_double_eq_tol(s.start[n], start, 1e-4 * (start + 1e-3));
      ck_assert_double_eq_tol(s.length[n], length, 1e-4 * length);
      int cascade = 0; /* cells of 2 * 2^c / 128 */
      while (cascade < log2(bound) && s.length[n] >= ldexp(2.0 / 128, cascade)) cascade++;
      ck_assert_int_eq(s.cascade[n], cascade);
      start += length;
    }
    ck_assert_double_ge(start, 2 * sqrt(3) * bound * (1 - 1e-4)); /* they reach across the box */
    ck_assert_int_le(s.count, bound > 1 ? 900 : 1024);
  }
}
END_TEST

START_TEST(boxes_that_steps_do_not_cross_are_refused)
{
  sf_config c = large_config(8, 128);
  c.dt_gamma = 0;
  const sf_status status = sf_config_check(&c);
  ck_assert_int_eq(status.code, SF_E_RANGE);
  ck_assert_ptr_nonnull(strstr(status.message, "dt_gamma"));
  c.lattice = 128; /* 8 * 128 equal steps */
  ck_assert_int_eq(sf_config_check(&c).code, SF_OK);
  c.bound = 12;
  ck_assert_ptr_nonnull(strstr(sf_config_check(&c).message, "bound"));
}
END_TEST

/* ---- rays ---- */

enum { KINDS = 6 };

/* From inside, from far outside, along an axis, in the face between two cascades, along its edge, and any ray. */
static void draw_ray(int kind, uint64_t i, float bound, float o[3], float d[3])
{
  float length = 0;
  for (int a = 0; a < 3; a++) {
    const float to = (i & 1 ? bound : 1) * (2 * sf_random_float(31, (uint64_t)a, i) - 1);
    const float far = kind == 1 ? 30 : kind == 0 ? (i & 2 ? 0.9f : 1 / bound) : 2;
    o[a] = far * bound * (2 * sf_random_float(32, (uint64_t)a, i) - 1);
    d[a] = to - o[a];
  }
  const int axis = (int)(i / 24 % 3);
  const float face = (i / 216 & 1 ? -1 : 1) * ldexpf(1, (int)(i / 72 % 3));
  for (int a = 0; a < 3; a++) {
    if (kind == 2 && a != axis) d[a] = 0, o[a] *= 0.4f;
    if (kind == 3 && a == axis) d[a] = 0, o[a] = face;
    if (kind == 4 && a != axis) d[a] = 0, o[a] = a == (axis + 1) % 3 ? face : -face;
    length += d[a] * d[a];
  }
  for (int a = 0; a < 3; a++) d[a] /= sqrtf(length);
}

/* The bit of a position in [0,1)^3: the finest cascade [-2^c, 2^c) that holds it, at least `least`. */
static size_t direct_bit(const sf_config *c, int least, const float x[3])
{
  for (int cascade = least;; cascade++) {
    const double half = ldexp(1, cascade);
    size_t place[3];
    bool in = true;
    for (int a = 0; a < 3; a++) {
      const double p = ((double)x[a] - 0.5) * 2 * c->bound;
      in = in && p >= -half && p < half;
      place[a] = in ? (size_t)floor((p / half + 1) / 2 * c->occ_res) : 0;
    }
    const size_t res = (size_t)c->occ_res;
    if (in) return (((size_t)cascade * res + place[2]) * res + place[1]) * res + place[0];
  }
}

static void scatter(sf_model *m, uint64_t trial)
{
  const size_t bytes = sf_config_cells(&m->config) / 8;
  for (size_t i = 0; i < bytes; i++)
    m->occupancy[i] = (uint8_t)(sf_random_u64(3, trial, i) & sf_random_u64(4, trial, i) & sf_random_u64(5, trial, i));
}

/* Skipping finds the points that testing every point by the direct formula finds, in every cascade. */
START_TEST(march_equals_testing_every_point)
{
  for (int bound = 2; bound <= 32; bound *= 4) {
    const sf_config c = large_config(bound, 16);
    sf_model m;
    sf_steps steps;
    int found = 0, in_cascade[7] = {0};
    ck_assert_int_eq(sf_model_create(&m, &c).code, SF_OK);
    ck_assert_int_eq(sf_steps_make(&steps, &c, 1).code, SF_OK);
    for (uint64_t i = 0; i < 600; i++) {
      float o[3], d[3], x[3], y[3];
      if (i % 20 == 0) scatter(&m, i);
      draw_ray((int)(i / 4 % KINDS), i, (float)bound, o, d);
      const sf_march march = sf_march_begin(&m, &steps, o, d, 0.5f);
      int next = 0;
      for (int n = 0; n < march.lattice.count; n++) {
        sf_march_at(&march, n, x);
        const size_t bit = direct_bit(&c, steps.cascade[n], x);
        ck_assert_uint_lt(bit, sf_config_cells(&c));
        if (!(m.occupancy[bit / 8] >> (bit % 8) & 1)) continue;
        next = sf_march_next(&march, next, y);
        ck_assert_int_eq(next, n);
        ck_assert_mem_eq(x, y, sizeof x);
        next++, found++, in_cascade[bit / (16 * 16 * 16)]++;
      }
      ck_assert_int_eq(sf_march_next(&march, next, y), -1);
    }
    ck_assert_int_gt(found, 300);
    for (int k = 0; k < sf_config_cascades(&c); k++) ck_assert_int_gt(in_cascade[k], 5);
    sf_model_free(&m);
  }
}
END_TEST

/* Intervals neither overlap nor leave gaps, and stay in the box. */
START_TEST(rays_are_cut_without_gaps)
{
  const sf_config c = large_config(16, 128);
  sf_steps steps;
  ck_assert_int_eq(sf_steps_make(&steps, &c, 1).code, SF_OK);
  int hits = 0;
  for (uint64_t i = 0; i < 2000; i++) {
    float o[3], d[3];
    draw_ray((int)(i / 4 % KINDS), i, 16, o, d);
    const sf_lattice lattice = sf_ray_lattice(&steps, o, d);
    ck_assert_int_le(lattice.count, steps.count);
    if (!lattice.count) continue;
    hits++;
    for (int n = 1; n < lattice.count; n++)
      ck_assert_float_eq_tol(steps.start[n], steps.start[n - 1] + steps.length[n - 1], 1e-6f * steps.start[n]);
    const int last = lattice.count - 1;
    const float end = lattice.first - steps.shortest / 2 + steps.start[last] + steps.length[last];
    for (int a = 0; a < 3; a++) /* distances of up to 900 have a precision of 2^-14 */
      ck_assert_float_le(fabsf(o[a] + end * d[a]), 16 + 2e-3f);
  }
  ck_assert_int_gt(hits, 1000);
}
END_TEST

int main(void)
{
  Suite *suite = suite_create("unbounded");
  TCase *tc = tcase_create("unbounded");
  tcase_set_timeout(tc, 60);
  tcase_add_test(tc, steps_grow_as_the_formula_says);
  tcase_add_test(tc, boxes_that_steps_do_not_cross_are_refused);
  tcase_add_test(tc, march_equals_testing_every_point);
  tcase_add_test(tc, rays_are_cut_without_gaps);
  suite_add_tcase(suite, tc);
  SRunner *runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
