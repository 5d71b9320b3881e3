/* TensoRF in integers: units against their definitions over every input, the field against real numbers within a
 * derived bound, hard cases. */
#include "ck_run.h"
#include "src/fx/round.h"
#include "tests/fx_tensorf_scene.h"
#include <math.h>

/* ---- units ---- */

TEST(softplus_every_input)
{
  uint32_t before = 0;
  double worst = 0, relative = 0;
  for (int32_t y = -(1 << 23); y < 1 << 23; y += abs(y) < 17 << 12 ? 1 : 1021) {
    const uint32_t s = fx_softplus(y);
    const double x = y / 4096.0, exact = x > 40 ? x : log1p(exp(x)), error = fabs(s * 0x1p-20 - exact);
    ck_assert_msg(s >= before, "softplus(%d / 4096) falls", y);
    /* Interpolation (1/16)^2 / 8 of the second derivative s (1 - s); table, product and result 1/32, 1/32, 1/2 LSB of
     * Q.20; from 16 on the tail, 1.2e-7, is left out. */
    const double sigmoid = 1 / (1 + exp(-x)), slope = exp(1.0 / 16); /* the derivative within the interval */
    ck_assert_msg(error <= sigmoid * (1 - sigmoid) * slope / 2048 + 0x1.2p-21 + 1.2e-7, "softplus(%g) = %g, not %g", x,
                  s * 0x1p-20, exact);
    worst = fmax(worst, error);
    if (x > -8) relative = fmax(relative, error / exact);
    before = s;
    ck_assert_uint_eq(fx_relu(y), y > 0 ? (uint32_t)y << 8 : 0);
  }
  printf("softplus: largest error %.3g, relative above -8 %.3g\n", worst, relative);
  ck_assert_double_gt(worst, 1e-4); /* the bound is no looser than needed: 1.22e-4 at 0 */
  ck_assert_uint_eq(fx_softplus(INT32_MIN / 256), 0);
}

TEST(softplus_is_as_defined)
{
  for (int32_t y = -(17 << 12); y < 17 << 12; y++) {
    const int32_t m = abs(y), i = m / 256, low = m % 256;
    int64_t tail = 0;
    if (i < 256) {
      const int64_t here = llroundl(log1pl(expl(-i / 16.0L)) * 0x1p24L),
                    next = llroundl(log1pl(expl(-(i + 1) / 16.0L)) * 0x1p24L);
      tail = naive_round(here + naive_round((next - here) * low, 8), 4);
    }
    ck_assert_uint_eq(fx_softplus(y), (uint32_t)((y > 0 ? (int64_t)y * 256 : 0) + tail));
  }
}

TEST(sine_every_phase)
{
  double worst = 0;
  for (uint32_t phase = 0; phase < 1 << 16; phase++) {
    const double exact = sin(2 * acos(-1) * phase / 65536) * 16384;
    const int32_t s = fx_sine(phase);
    /* Interpolation (pi/512)^2 / 8 * 2^14 = 0.077, table and product 1/8 each, the result 1/2. */
    ck_assert_msg(fabs(s - exact) <= 0.83, "sin of phase %u: %d, not %g", phase, s, exact);
    worst = fmax(worst, fabs(s - exact));
    ck_assert_int_eq(fx_sine(phase + 65536u * 12345u), s);
    ck_assert_int_eq(fx_sine(phase + 32768), -s);
    ck_assert_int_eq(fx_sine(32768 - phase), s);
  }
  printf("sine: largest error %.3g LSB of Q1.14\n", worst);
  ck_assert_int_eq(fx_sine(16384), 16384);
}

/* ---- the field against real numbers ---- */

static double at(const int8_t *entry, int64_t index, int n, int c)
{
  return entry[index * n + c];
}

/* Product of plane and line in double precision, and how far the integers may be from it. A position is off by at most
 * 1/512 of a cell per axis, which moves a value by at most that times the largest difference in the array, 254; P is
 * rounded by 1/512 more. */
static double real_product(const fx_factors *f, const int32_t res[3], int pair, int c, const uint32_t pos[3],
                           double *bound)
{
  static const int axes[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};
  int64_t i[3], j[3];
  double part[3];
  for (int k = 0; k < 3; k++) {
    const int axis = axes[pair][k];
    const double x = pos[axis] * 0x1p-24 * (res[axis] - 1);
    i[k] = (int64_t)floor(x), part[k] = x - floor(x), j[k] = i[k] + 1 < res[axis] ? i[k] + 1 : i[k];
  }
  const int n = f->components[pair], width = res[axes[pair][0]];
  const int8_t *p = f->plane[pair], *l = f->line[pair];
  const double near = (1 - part[0]) * at(p, i[1] * width + i[0], n, c) + part[0] * at(p, i[1] * width + j[0], n, c),
               far = (1 - part[0]) * at(p, j[1] * width + i[0], n, c) + part[0] * at(p, j[1] * width + j[0], n, c);
  const double plane = (1 - part[1]) * near + part[1] * far,
               line = (1 - part[2]) * at(l, i[2], n, c) + part[2] * at(l, j[2], n, c);
  const double e_plane = (2 * 254 + 1) / 512.0, e_line = 254 / 512.0;
  *bound = fabs(plane) * e_line + fabs(line) * e_plane + e_plane * e_line;
  return plane * line;
}

TEST(products_within_their_bound)
{
  static const int32_t sizes[3][3] = {{17, 9, 33}, {7, 1, 5}, {2, 300, 2}};
  double worst = 0;
  for (int s = 0; s < 3; s++) {
    fx_scene scene = make_scene(sizes[s], 5, 2, (uint64_t)s);
    const fx_tensorf *f = &scene.tensorf;
    for (uint64_t i = 0; i < 3000; i++) {
      uint32_t pos[3];
      int16_t x[FX_PAIRS * FX_COMPONENTS_MAX];
      pick_position(9, i, pos);
      const int n = fx_tensorf_products(f, pos, x);
      for (int k = 0, pair = 0, c = 0; k < n; k++, c++) {
        double bound;
        if (c == f->appearance.components[pair]) pair++, c = 0;
        const double exact = real_product(&f->appearance, f->res, pair, c, pos, &bound),
                     error = fabs(x[k] / 2.0 - exact);
        ck_assert_msg(error <= bound + 0.25, "product %d is off by %g, bound %g", k, error, bound);
        worst = fmax(worst, error / (bound + 0.25));
      }
    }
    fx_scene_free(&scene);
  }
  printf("products: at most %.0f %% of the bound\n", 100 * worst);
  ck_assert_double_gt(worst, 0.5); /* entries alternate between the rails somewhere */
}

/* At grid points the products are exact, and so are density and inputs up to their tables. */
TEST(grid_points_are_exact)
{
  const int32_t res[3] = {17, 9, 33};
  OWNED(fx_scene) scene = make_scene(res, 5, 2, 4);
  const fx_tensorf *f = &scene.tensorf;
  for (uint64_t i = 0; i < 500; i++) {
    uint32_t pos[3];
    double sum = 0, bound;
    for (uint64_t a = 0; a < 3; a++)
      pos[a] = (uint32_t)(((uint64_t)fixture_pick(1, 90, 3 * i + a, 0, res[a] - 1) << 24) / (uint64_t)(res[a] - 1));
    for (int a = 0; a < 3; a++) pos[a] -= pos[a] >> 24; /* the last point is at 1 - 2^-24 */
    for (int pair = 0; pair < 3; pair++)
      for (int c = 0; c < f->density.components[pair]; c++) {
        uint32_t point[3];
        for (int a = 0; a < 3; a++) point[a] = pos[a];
        sum += nearbyint(real_product(&f->density, f->res, pair, c, point, &bound) * 4) / 4;
      }
    const double y =
        naive_clamp((int64_t)floor(nearbyint(sum) * 65536 * 30000 * 0x1p-28 + 0.5), -(1 << 23), (1 << 23) - 1);
    const int64_t sigma = naive_round((int64_t)fx_softplus((int32_t)y) * 40000, 15);
    ck_assert_int_eq(fx_tensorf_density(f, pos, NULL), naive_clamp(sigma, 0, (1 << 28) - 1));
  }
}

TEST(inputs_are_encoded)
{
  const int32_t res[3] = {17, 9, 33};
  for (int freqs = 0; freqs <= 4; freqs += 2) {
    OWNED(fx_scene) scene = make_scene(res, 5, freqs, 5);
    fx_tensorf *f = &scene.tensorf;
    const double lsb = 0x1p-9, feature = 40000 * 0x1p-33; /* feature LSB per sum */
    int n = 0;
    for (uint64_t i = 0; i < 1500; i++) {
      uint32_t pos[3];
      int16_t x[SF_DIR_MAX], product[FX_PAIRS * FX_COMPONENTS_MAX];
      const int16_t unit[3] = {(int16_t)fixture_pick(2, 0, i, -16384, 16384), i % 2 ? 16384 : -16384, 0};
      pick_position(10, i, pos);
      fx_tensorf_encode(f, pos, unit, x, NULL);
      n = fx_tensorf_products(f, pos, product);
      for (int v = 0; v < 9; v++) {
        int64_t sum = 0;
        for (int c = 0; c < n; c++) sum += (int64_t)product[c] * f->basis[c * FX_APPEARANCE_MAX + v];
        const double exact = fmin(fmax(floor((double)sum * feature + 0.5), -2047), 2047);
        ck_assert_int_eq(x[v], (int)exact);
        const double turns = (double)sum * 50000 * 0x1p-30 * 0x1p-16;
        for (int k = 0; k < freqs; k++) {
          const double angle = 2 * acos(-1) * ldexp(turns, k);
          /* The angle is rounded to 2^-16 turns before it is doubled; sine and encoding round once each. */
          const double bound = 0.5 * lsb + 0.83 * 0x1p-14 + acos(-1) * ldexp(1, k - 16) + 1e-9;
          ck_assert_double_le(fabs(x[12 + v * freqs + k] * lsb - sin(angle)), bound);
          ck_assert_double_le(fabs(x[12 + 9 * freqs + v * freqs + k] * lsb - cos(angle)), bound);
        }
      }
      for (int a = 0; a < 3; a++) {
        ck_assert_int_eq(x[9 + a], naive_round(unit[a], 5));
        for (int k = 0; k < freqs; k++) {
          const double angle = ldexp(unit[a] * 0x1p-14, k);
          const double bound = 0.5 * lsb + 0.83 * 0x1p-14 + 1.24 * acos(-1) * ldexp(1, k - 16) + 1e-9;
          ck_assert_double_le(fabs(x[12 + 18 * freqs + a * freqs + k] * lsb - sin(angle)), bound);
          ck_assert_double_le(fabs(x[12 + 18 * freqs + 3 * freqs + a * freqs + k] * lsb - cos(angle)), bound);
        }
      }
    }
    ck_assert_int_eq(fx_tensorf_inputs(f), 12 + 24 * freqs);
  }
}

/* Everything at the rails, both ways: sums and scales saturate, none wraps. */
TEST(rails)
{
  const int32_t res[3] = {4, 4, 4};
  const uint32_t pos[3] = {5000000, 123, (1 << 24) - 1};
  const int16_t unit[3] = {16384, -16384, 0};
  for (int sign = -1; sign <= 1; sign += 2) {
    OWNED(fx_scene) scene = make_scene(res, 30, 2, 6);
    fx_tensorf *f = &scene.tensorf;
    int16_t x[SF_DIR_MAX];
    fx_counts counts = {0};
    for (int p = 0; p < 3; p++) {
      memset(f->density.plane[p], 127 * sign, (size_t)(16 * f->density.components[p]));
      memset(f->density.line[p], 127, (size_t)(4 * f->density.components[p]));
      memset(f->appearance.plane[p], 127 * sign, (size_t)(16 * f->appearance.components[p]));
      memset(f->appearance.line[p], 127, (size_t)(4 * f->appearance.components[p]));
    }
    memset(f->basis, 127, (size_t)(3 * 61 * FX_APPEARANCE_MAX));
    f->density_in = (fx_scale){65535, 0, 0}, f->sigma_out = (fx_scale){65535, 0, 0};
    f->feature_in = f->phase_in = (fx_scale){65535, 0, 0};
    f->encoding_frac = 11;
    ck_checked(&scene);
    ck_assert_uint_eq(fx_tensorf_density(f, pos, &counts), sign > 0 ? (1u << 28) - 1 : 0);
    fx_tensorf_encode(f, pos, unit, x, &counts);
    for (int v = 0; v < 9; v++) ck_assert_int_eq(x[v], 2047 * sign);
    ck_assert(x[9] == 2047 && x[10] == -2047 && x[11] == 0);
    ck_assert_uint_eq(counts.saturated_features, 9);
    ck_assert_uint_eq(counts.field_samples, 1);
    ck_assert_uint_eq(counts.field_mac, 93 * 7 + 183 * (7 + 9));
    ck_assert_uint_eq(counts.grid_bytes, (93 + 183) * 6);
  }
}

int ck_timeout = 120;
