/* Scenes larger than one box: growing steps, cascades of occupancy grids, and the hard rays of both. */
#include "tests/march_fixture.h"
#include "tests/unbounded_fixture.h"

/* The recurrence in double precision; float adds up to 1024 roundings of 2^-24 of the distance. */
TEST(steps_grow_as_the_formula_says)
{
  for (int bound = 1; bound <= 64; bound *= 2) {
    const sf_config c = large_config(bound, 128);
    sf_steps s;
    ck_ok(sf_steps_make(&s, &c, 1));
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

TEST(boxes_that_steps_do_not_cross_are_refused)
{
  sf_config c = large_config(8, 128);
  c.dt_gamma = 0;
  ck_bad(sf_config_check(&c), SF_E_RANGE, "dt_gamma", "");
  c.lattice = 128; /* 8 * 128 equal steps */
  ck_ok(sf_config_check(&c));
  c.bound = 12;
  ck_assert_ptr_nonnull(strstr(sf_config_check(&c).message, "bound"));
  c = sf_tensorf_default(0.8f, 0); /* one occupancy grid, equal steps */
  ck_ok(sf_config_check(&c));
  c.bound = 2;
  ck_assert_ptr_nonnull(strstr(sf_config_check(&c).message, "bound = 2"));
}

/* Skipping finds the points that testing every point by the direct formula finds, in every cascade. */
static void check_march(int bound, int res)
{
  sf_config c = large_config(bound, res);
  if (bound == 8) c.dt_gamma = 0.125f; /* steps pass to coarser cells inside of fine ones */
  sf_model m;
  sf_steps steps;
  int found = 0, in_cascade[7] = {0};
  const size_t layer = (size_t)res * (size_t)res * (size_t)res;
  ck_ok(sf_model_create(&m, &c));
  for (uint64_t i = 0; i < 600; i++) {
    float o[3], d[3], x[3], y[3];
    if (i % 20 == 0) {
      scatter(&m, i);
      if (res > 16) empty_blocks(&m, i);
      ck_ok(sf_march_steps(&steps, &m, 1));
      ck_assert_int_eq(steps.blocks, res > 16); /* smaller ones reach into the next cascade */
    }
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
      next++, found++, in_cascade[bit / layer]++;
    }
    ck_assert_int_eq(sf_march_next(&march, next, y), -1);
    check_points(&march);
  }
  ck_assert_int_gt(found, 300);
  for (int k = 0; k < sf_config_cascades(&c); k++) ck_assert_int_gt(in_cascade[k], 2);
  sf_model_free(&m);
}
TEST(march_equals_testing_every_point)
{
  for (int bound = 2; bound <= 32; bound *= 4)
    for (int res = 16; res <= 64; res *= 2) check_march(bound, res);
}

/* Intervals neither overlap nor leave gaps, and stay in the box. */
TEST(rays_are_cut_without_gaps)
{
  const sf_config c = large_config(16, 128);
  sf_steps steps;
  ck_ok(sf_steps_make(&steps, &c, 1));
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
