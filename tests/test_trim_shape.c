/* TensoRF's planes on fewer points and in a smaller box. */
#include "ck_run.h"
#include "tests/fit_planes_fixture.h"
#include <omp.h>

/* What is linear between the points that stay is kept to the last bit; constants are. */
TEST(fewer_points)
{
  OWNED(fx_scene) scene = planes_scene(5), small;
  fx_factors *f = &scene.tensorf.density;
  const int32_t *res = scene.tensorf.res, width = res[0], n = f->components[0];
  ck_assert_int_eq(width, 17);
  for (int v = 0; v < res[1]; v++)
    for (int u = 0; u < width; u++)
      for (int c = 0; c < n; c++) {
        const int near = 2 * pick(9, 0, (uint64_t)((v * 20 + u / 2) * 20 + c), 60);
        const int far = 2 * pick(9, 0, (uint64_t)((v * 20 + u / 2 + 1) * 20 + c), 60);
        f->plane[0][(v * width + u) * n + c] = (int8_t)(c == 0 ? 55 : u & 1 ? (near + far) / 2 : near);
      }
  sf_trim_use use;
  sf_trim trim;
  ck_ok(sf_trim_use_create(&use, &scene));
  sf_trim_all(&scene, &trim);
  trim.planes.points[0] = 9;
  small = trimmed(&scene, &trim, &use);
  ck_assert_int_eq(small.tensorf.res[0], 9);
  for (int v = 0; v < res[1]; v++)
    for (int u = 0; u < 9; u++)
      for (int c = 0; c < n; c++)
        ck_assert_int_eq(small.tensorf.density.plane[0][(v * 9 + u) * n + c], f->plane[0][(v * width + 2 * u) * n + c]);
  ck_assert_int_lt(fx_tensorf_bytes(&small.tensorf), fx_tensorf_bytes(&scene.tensorf) * 3 / 4);
  sf_trim_use_free(&use);
}

static double square_error(const int8_t *old, int n_from, const float *new, int n_to)
{
  double sum = 0;
  for (int i = 0; i <= 1000; i++) {
    const double x = i / 1000.0 * (n_from - 1), y = i / 1000.0 * (n_to - 1);
    const int a = (int)fmin(floor(x), n_from - 2), b = (int)fmin(floor(y), n_to - 2);
    const double d =
        old[a] + (x - a) * (old[a + 1] - old[a]) - (double)new[b] - (y - b) * ((double)new[b + 1] - (double)new[b]);
    sum += d * d;
  }
  return sum;
}

/* No other numbers on the new points are nearer to the old function. */
TEST(the_nearest_of_fewer_points)
{
  enum { FROM = 40, TO = 27 };
  int8_t old[FROM];
  float from[FROM], to[TO];
  sf_taps taps;
  for (int i = 0; i < FROM; i++) old[i] = pick(10, 0, (uint64_t)i, 127), from[i] = old[i];
  ck_ok(sf_taps_make(&taps, 0, FROM - 1, TO));
  sf_taps_apply(&taps, from, 1, FROM, 1, to);
  const double best = square_error(old, FROM, to, TO);
  for (int i = 0; i < TO; i++)
    for (int sign = -1; sign <= 1; sign += 2) {
      to[i] += 3 * (float)sign;
      ck_assert_double_gt(square_error(old, FROM, to, TO), best);
      to[i] -= 3 * (float)sign;
    }
  sf_taps_free(&taps);
}

/* ---- the box ---- */

/* The same densities and features at the same place of the model, but for the rounding of positions. */
TEST(a_smaller_box)
{
  OWNED(fx_scene) scene = planes_scene(6), small;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  OWNED(sf_trim_use) use = observed(&scene, &rays);
  sf_trim trim;
  sf_trim_all(&scene, &trim);
  ck_assert(sf_trim_box(&scene, &use, &trim));
  ck_assert(!sf_trim_box(&scene, &use, &trim));
  const int32_t low[3] = {2, 1, 3}, high[3] = {14, 14, 13}; /* cells 1..6, 1..6, 2..6 of 8: outwards to points */
  ck_assert_mem_eq(trim.planes.low, low, sizeof low);
  ck_assert_mem_eq(trim.planes.high, high, sizeof high);
  small = trimmed(&scene, &trim, &use);
  for (int axis = 0; axis < 3; axis++) ck_assert_int_eq(small.tensorf.res[axis], high[axis] - low[axis] + 1);
  int seen = 0;
  for (uint64_t i = 0; i < 500; i++) {
    uint32_t a[3], b[3];
    float x[3];
    for (uint64_t axis = 0; axis < 3; axis++) x[axis] = 1.1f * (sf_random_float(11, axis, i) - 0.5f);
    ck_ok(sf_fx_position_make(&scene, x, a));
    ck_ok(sf_fx_position_make(&small, x, b));
    const double p = sf_fx_sigma_value(&scene, fx_tensorf_density(&scene.tensorf, a, NULL));
    const double q = sf_fx_sigma_value(&small, fx_tensorf_density(&small.tensorf, b, NULL));
    ck_assert_double_eq_tol(p, q, 0.05 * p + 0.02);
    seen += p > 1;
  }
  ck_assert_int_gt(seen, 20);
  ck_assert_double_eq_tol(ldexp(small.step_q24, -24) / small.units.to_box_scale,
                          ldexp(scene.step_q24, -24) / scene.units.to_box_scale, 1e-5);
}

static double difference(const fx_scene *a, const fx_scene *b, const sf_fit_rays *rays)
{
  uint32_t *p = calloc(rays->count, 3 * sizeof *p), *q = calloc(rays->count, 3 * sizeof *q);
  sf_fit_sum sum;
  double error = 0;
  ck_ok(sf_fit_measure(a, rays, 0, rays->count, p, &sum));
  ck_ok(sf_fit_measure(b, rays, 0, rays->count, q, &sum));
  for (uint64_t i = 0; i < 3 * rays->count; i++) error += fabs((double)p[i] - q[i]) / 65535;
  free(p), free(q);
  return error / 3 / (double)rays->count;
}

/* Rays sample it elsewhere, so pictures are not the same to the bit; in a box that is shifted they are others. */
TEST(pictures_of_a_smaller_box)
{
  static const int32_t res[] = {17, 17, 17}; /* every second is a corner of cells: the box is theirs */
  OWNED(fx_scene) scene = planes_of(7, res), small;
  scene.step_q24 = 60000; /* fine: where samples lie matters little */
  memset(scene.occupancy, 0, RES * RES * RES / 8);
  for (int z = 2; z < 6; z++)
    for (int y = 2; y < 6; y++) scene.occupancy[z * RES + y] = 0x3c; /* x 2..5: no corner of a cell is cut off */
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  OWNED(sf_trim_use) use = observed(&scene, &rays);
  sf_trim trim;
  sf_trim_all(&scene, &trim);
  ck_assert(sf_trim_box(&scene, &use, &trim));
  small = trimmed(&scene, &trim, &use);
  const double near = difference(&scene, &small, &rays);
  small.units.to_box_offset[1] += 0.02;
  ck_assert_double_gt(difference(&scene, &small, &rays), 4 * near);
  ck_assert_double_lt(near, 0.01);
}

TEST(fewer_samples)
{
  OWNED(fx_scene) scene = planes_scene(8), small;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  OWNED(sf_trim_use) use = observed(&scene, &rays);
  sf_fit_sum before, after;
  sf_trim trim;
  sf_trim_all(&scene, &trim);
  trim.planes.stride_q16 = 2 << 16;
  small = trimmed(&scene, &trim, &use);
  ck_assert_int_eq(small.step_q24, 2 * scene.step_q24);
  ck_ok(sf_fit_measure(&scene, &rays, 0, RAYS, NULL, &before));
  ck_ok(sf_fit_measure(&small, &rays, 0, RAYS, NULL, &after));
  ck_assert_uint_lt(after.counts.field_samples, before.counts.field_samples * 6 / 10);
}

TEST(unread_points_are_not_read)
{
  OWNED(fx_scene) scene = planes_scene(9), cleared = planes_scene(9);
  memset(scene.occupancy, 0, RES * RES * RES / 8);
  scene.occupancy[9] = 0x21, scene.occupancy[40] = 0x80;
  memcpy(cleared.occupancy, scene.occupancy, RES * RES * RES / 8);
  ck_ok(sf_trim_zero_unread(&cleared, "cleared"));
  int zero = 0, kept = 0;
  for (int i = 0; i < 17 * 16; i++) *(cleared.tensorf.density.plane[0][i * 18] ? &kept : &zero) += 1;
  ck_assert_int_gt(zero, 100);
  ck_assert_int_gt(kept, 10);
  for (uint64_t i = 0; i < 20000; i++) {
    int16_t x[SF_DIR_MAX], y[SF_DIR_MAX], unit[3] = {0};
    uint32_t pos[3];
    random_position(i, pos);
    if (i & 1) pos[2] = (pos[2] & ~(uint32_t)0x1fffff) | (i & 2 ? 0 : 0x1fffff); /* faces of cells */
    const uint32_t cell = ((pos[2] >> 21) * RES + (pos[1] >> 21)) * RES + (pos[0] >> 21);
    if (!(scene.occupancy[cell >> 3] >> (cell & 7) & 1)) continue;
    fx_tensorf_encode(&scene.tensorf, pos, unit, x, NULL), fx_tensorf_encode(&cleared.tensorf, pos, unit, y, NULL);
    ck_assert_mem_eq(x, y, (size_t)scene.net.layer[FX_C1].n_in * sizeof *x);
    ck_assert_uint_eq(fx_tensorf_density(&scene.tensorf, pos, NULL), fx_tensorf_density(&cleared.tensorf, pos, NULL));
  }
}

/* A part of the points goes, one at least, and two stay. */
TEST(a_part_of_the_points_goes)
{
  static const struct {
    int points, parts, left; /* 0: refused */
  } rows[] = {{16, 4, 12}, {17, 4, 13}, {100, 8, 88}, {7, 8, 6}, {3, 8, 2}, {2, 8, 0}, {3, 2, 2}, {4, 2, 2}, {4, 1, 0}};
  for (int i = 0; i < COUNT(rows); i++)
    for (int axis = 0; axis < 3; axis++) {
      sf_trim trim = {0};
      for (int a = 0; a < 3; a++) trim.planes.points[a] = 50 + a;
      trim.planes.points[axis] = rows[i].points;
      ck_assert(sf_trim_points(&trim, axis, rows[i].parts) == (rows[i].left > 0));
      for (int a = 0; a < 3; a++) {
        const int other = a == axis ? rows[i].left > 0 ? rows[i].left : rows[i].points : 50 + a;
        ck_assert_int_eq(trim.planes.points[a], other);
      }
    }
}

/* The field that was made last is kept: the same trim gives it again, and any other one a field of its own. */
TEST(shapes_in_a_row)
{
  OWNED(fx_scene) scene = planes_scene(12);
  OWNED(sf_trim_use) use = {0}, fresh = {0};
  ck_ok(sf_trim_use_create(&use, &scene));
  for (int step = 0; step < 8; step++) {
    const fx_tensorf *kept, *made;
    sf_trim trim;
    sf_trim_all(&scene, &trim);
    if (step > 0) trim.planes.points[(step - 1) / 2 % 3] -= 2;
    if (step == 7) trim.planes.low[1]++, trim.planes.points[1]--;
    ck_ok(sf_trim_use_create(&fresh, &scene));
    ck_ok(sf_planes_shape(&scene, &trim.planes, &use, "kept", &kept));
    ck_ok(sf_planes_shape(&scene, &trim.planes, &fresh, "made", &made));
    ck_assert((made == &scene.tensorf) == (step == 0));
    ck_assert_mem_eq(kept->res, made->res, sizeof made->res);
    for (int pair = 0; pair < FX_PAIRS; pair++) {
      const int *axes = fx_pair_axes[pair];
      const size_t n = (size_t)made->density.components[pair];
      ck_assert_mem_eq(kept->density.plane[pair], made->density.plane[pair],
                       n * (size_t)(made->res[axes[0]] * made->res[axes[1]]));
      ck_assert_mem_eq(kept->density.line[pair], made->density.line[pair], n * (size_t)made->res[axes[2]]);
    }
    sf_trim_use_free(&fresh);
  }
}

int ck_timeout = 240;

int main(void)
{
  omp_set_num_threads(1); /* many small parallel regions: threads would wait for each other on a busy machine */
  return ck_main();
}
