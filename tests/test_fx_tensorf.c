/* TensoRF in integers: units against their definitions over every input, the field against real numbers within a
 * derived bound, hard cases, files, and whole rays: portable = vector, thresholds, and pictures against the float
 * model. */
#include "ck_run.h"
#include "base/io.h"
#include "quant/quant.h"
#include "spikefield/spikefield.h"
#include "src/fx/core.h"
#include "src/fx/round.h"
#include "tests/fx_fixture.h"
#include "tests/scene_file_fixture.h"
#include "tests/tensorf_fixture.h"
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

/* ---- a scene of random integers ---- */

static const int32_t few[3] = {7, 1, 5}; /* one axis of a single point */

static fx_scene make_scene(const int32_t res[3], int components, int freqs, uint64_t seed)
{
  fx_scene scene = {.backbone = FX_TENSORF, .occ_res = 8, .net = {.steps = 3, .sigmoid_in = {50000, 13, 0}}};
  fx_tensorf *f = &scene.tensorf;
  fx_layer *l = scene.net.layer;
  for (int i = 0; i < 3; i++) {
    f->res[i] = res[i], scene.units.stretch[i] = 1, scene.background[i] = 65536;
    f->density.components[i] = components + i, f->appearance.components[i] = 2 * components + i;
  }
  f->features = 9, f->feature_freqs = freqs, f->view_freqs = freqs, f->encoding_frac = 9;
  scene.units.far = 6;
  f->density_in = (fx_scale){30000, 28, 0}, f->sigma_out = (fx_scale){40000, 15, 0};
  f->feature_in = (fx_scale){40000, 33, 0}, f->phase_in = (fx_scale){50000, 30, 0};
  f->weight_stop = 104;
  l[FX_C1].n_in = fx_tensorf_inputs(f), l[FX_C1].bias = 300, l[FX_C2].bias = l[FX_C3].bias = 1;
  l[FX_C1].n_out = l[FX_C2].n_in = 48, l[FX_C2].n_out = l[FX_C3].n_in = 32, l[FX_C3].n_out = 3;
  ck_ok(fx_scene_allocate(&scene, "fixture"));
  int8_t *all[13];
  for (int i = 0; i < 3; i++) {
    all[i] = f->density.plane[i], all[3 + i] = f->density.line[i];
    all[6 + i] = f->appearance.plane[i], all[9 + i] = f->appearance.line[i];
  }
  all[12] = f->basis;
  for (int k = 0; k < 13; k++) {
    const int8_t *end = k < 12 ? all[k + 1] : (int8_t *)scene.occupancy;
    for (int8_t *at = all[k]; at < end; at++)
      *at = (int8_t)fixture_pick(seed, 50 + (uint64_t)k, (uint64_t)(at - all[k]), -127, 127);
  }
  memset(scene.occupancy, 0xff, 64);
  for (int id = FX_C1; id <= FX_C3; id++) {
    l[id].k = 2500, l[id].theta = id == FX_C1 ? 200000 : id == FX_C2 ? 60000 : 0;
    for (int i = 0; i < fx_layer_rows(&l[id]); i++)
      for (int o = 0; o < l[id].n_out; o++)
        l[id].w[i * SF_LANES + o] = (int8_t)fixture_pick(seed, 70 + (uint64_t)id, (uint64_t)(i * 128 + o), -127, 127);
  }
  scene.step_q24 = 1 << 17, scene.max_samples = 1024, scene.trans_stop = 104;
  scene.units.to_box_scale = 1, scene.units.dir_scale = 0x1p-9;
  return scene;
}

static void ck_checked(const fx_scene *scene)
{
  ck_ok(fx_scene_check(scene, "fixture"));
}

static void pick_position(uint64_t seed, uint64_t i, uint32_t pos[3])
{
  static const uint32_t ends[] = {0, (1 << 24) - 1, 1 << 23, (1 << 24) / 6, (1 << 24) / 6 + 1, (1 << 24) / 3 * 2};
  for (uint64_t a = 0; a < 3; a++)
    pos[a] = i % 3 == 0 ? ends[fixture_pick(seed, 80, 3 * i + a, 0, 5)]
                        : (uint32_t)fixture_pick(seed, 81, 3 * i + a, 0, (1 << 24) - 1);
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

/* ---- rays ---- */

static fx_ray make_ray(uint64_t seed, uint64_t index, int count)
{
  fx_ray ray = {.count = count, .first_q16 = 12345};
  for (uint64_t a = 0; a < 3; a++) {
    const int64_t from = fixture_pick(seed, 5 + a, index, 0, ((int64_t)1 << 31) - 1) << 9;
    const int64_t to = fixture_pick(seed, 8 + a, index, 0, ((int64_t)1 << 31) - 1) << 9;
    ray.origin[a] = from, ray.step[a] = (to - from) / count;
    ray.unit[a] = (int16_t)fixture_pick(seed, 11 + a, index, -16384, 16384);
  }
  return ray;
}

static void same_rays(const fx_scene *scene, const char *kernels)
{
  enum { RAYS = 150 };
  static fx_ray ray[RAYS];
  static fx_pixel many[RAYS], one;
  static fx_cost cost[RAYS];
  fx_core *core;
  fx_counts sum = {0}, all = {0};
  const sf_status status = fx_core_open(&core, scene, kernels);
  if (status.code == SF_E_UNSUPPORTED) {
    printf("%s: not on this machine\n", kernels);
    return;
  }
  ck_assert_int_eq(status.code, SF_OK);
  for (uint64_t i = 0; i < RAYS; i++) ray[i] = make_ray(3, i, 1 + (int)(i % 7) * 40);
  ck_ok(fx_render_rays(core, ray, RAYS, many, cost, &all));
  for (int i = 0; i < RAYS; i++) {
    fx_counts counts = {0};
    uint64_t macs = 0;
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &one, &counts));
    ck_assert_mem_eq(&one, &many[i], sizeof one);
    ck_assert_uint_eq(one.weight_sum + one.transmittance, 1 << 20);
    ck_assert_uint_eq(one.samples, counts.samples);
    ck_assert_uint_eq(counts.rays, one.samples > 0);
    for (int t = 0; t < SF_T_MAX; t++) macs += counts.layer[FX_C1].mac[t];
    ck_assert_uint_eq(cost[i].macs, macs);
    ck_assert_uint_eq(macs, counts.samples * (uint64_t)(scene->net.layer[FX_C1].n_in * scene->net.layer[FX_C1].n_out));
    fx_counts_add(&sum, &counts);
  }
  ck_assert_mem_eq(&sum, &all, sizeof sum);
  ck_assert_uint_gt(sum.field_samples, sum.samples);
  ck_assert_uint_gt(sum.samples, 500);
  fx_core_close(core);
}

/* Thin enough that rays go on, thick enough that samples of all weights occur. */
static fx_scene foggy(uint64_t seed)
{
  const int32_t res[3] = {17, 9, 33};
  fx_scene scene = make_scene(res, 5, 2, seed);
  scene.tensorf.density_in = (fx_scale){40000, 32, -8192}, scene.tensorf.sigma_out = (fx_scale){60000, 21, 0};
  for (int i = 0; i < 64; i++) scene.occupancy[i] = (uint8_t)fixture_pick(seed, 31, (uint64_t)i, 0, 255);
  ck_checked(&scene);
  return scene;
}

TEST(many_rays_are_rays)
{
  for (uint64_t seed = 0; seed < 3; seed++) {
    OWNED(fx_scene) scene = foggy(seed);
    scene.tensorf.activation = seed == 2 ? FX_RELU : FX_SOFTPLUS;
    if (seed == 1) scene.max_samples = 7;
    same_rays(&scene, "portable");
    same_rays(&scene, NULL);
  }
}

typedef struct seen {
  int calls;
  const fx_scene *scene;
} seen;

static sf_status see(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  seen *s = user;
  int32_t base[SF_LANES];
  (void)ray;
  ck_assert_int_eq(first, s->calls == 0);
  s->calls++;
  fx_net_direction(&s->scene->net, f, base, NULL);
  fx_net_sample(&s->scene->net, NULL, base, out, NULL, NULL);
  return sf_ok();
}

/* A higher threshold: fewer samples reach the decoder, weights and transmittance stay, colour only falls. */
TEST(the_weight_threshold_skips)
{
  OWNED(fx_scene) scene = foggy(3);
  int before = INT32_MAX, all = 0;
  for (int stop = 0; stop <= 1 << 20; stop = stop ? 16 * stop : 16) {
    seen s = {0, &scene};
    fx_pixel pixel, open;
    fx_counts counts = {0};
    scene.tensorf.weight_stop = stop < 1 << 20 ? stop : (1 << 20) - 1;
    const fx_ray ray = make_ray(3, 5, 200);
    ck_ok(fx_render_ray(&scene, &ray, see, &s, &pixel, &counts));
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &open, NULL));
    ck_assert_mem_eq(&open, &pixel, sizeof open);
    if (!stop) all = s.calls;
    ck_assert_int_ge((int)counts.field_samples, s.calls);
    ck_assert_int_eq((int)pixel.samples, s.calls);
    ck_assert_int_le(s.calls, before);
    ck_assert_uint_eq(pixel.weight_sum + pixel.transmittance, 1 << 20);
    before = s.calls;
  }
  ck_assert_int_gt(all, 20);
  ck_assert_int_eq(before, 0); /* no sample weighs 1 here */
}

TEST(empty_and_opaque)
{
  OWNED(fx_scene) scene = make_scene(few, 5, 2, 7);
  const fx_ray ray = make_ray(3, 1, 100);
  fx_pixel pixel;
  fx_counts counts = {0};
  scene.tensorf.density_in = (fx_scale){0, 0, (1 << 23) - 1}, scene.tensorf.sigma_out = (fx_scale){65535, 0, 0};
  ck_checked(&scene);
  ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, &counts));
  ck_assert(pixel.transmittance == 0 && pixel.samples == 1 && counts.rays == 1);
  ck_assert_uint_eq(counts.field_samples, 1 + FX_AHEAD); /* read before it is known that the first is enough */
  memset(scene.occupancy, 0, 64);
  memset(&counts, 0, sizeof counts);
  ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, &counts));
  ck_assert(pixel.transmittance == 1 << 20 && pixel.samples == 0);
  ck_assert(counts.march_steps == 100 && counts.field_samples == 0 && counts.rays == 0 && counts.grid_bytes == 0);
}

/* ---- files ---- */

TEST(files_are_checked)
{
  static const char *const wrong[][3] = {
      {"backbone", "plenoxels", "backbone"},
      {"backbone", NULL, "grid"},
      {"tensorf.res[1]", "0", "res[1]"},
      {"tensorf.res[1]", "2049", "res[1]"},
      {"tensorf.res[0]", "16", "density_plane.0"},
      {"tensorf.density.components[2]", "65", "density.components[2]"},
      {"tensorf.density.components[0]", "4", "density_plane.0"},
      {"tensorf.appearance.components[1]", "0", "appearance.components[1]"},
      {"tensorf.density_in.mul", "65536", "density_in.mul"},
      {"tensorf.density_in.shift", "41", "density_in.shift"},
      {"tensorf.density_in.bias", "8388608", "density_in.bias"},
      {"tensorf.sigma_out.bias", "1", "sigma_out.bias"},
      {"tensorf.feature_in.shift", "-1", "feature_in.shift"},
      {"tensorf.phase_in.mul", NULL, "phase_in.mul"},
      {"tensorf.activation", "2", "activation"},
      {"tensorf.weight_stop", "1048576", "weight_stop"},
      {"tensorf.features", "33", "features"},
      {"tensorf.feature_freqs", "5", "feature_freqs"},
      {"tensorf.view_freqs", "1", "C1.n_in"},
      {"tensorf.encoding_frac", "12", "encoding_frac"},
      {"tensorf.stretch[2]", "0", "stretch[2]"},
      {"tensorf.near", "nan", "near"},
      {"tensorf.near", "-0.1", "near"},
      {"tensorf.far", "0.1", "far"},
      {"tensorf.far", NULL, "far"},
      {"tensorf.weight_stop", "105", "checksum"},
      {"D1.n_out", "1", "D1"},
      {"C2.bias", "2", "C2.bias"},
  };
  fx_scene scene = foggy(8), again;
  scene.units.stretch[1] = 4 / 3.0, scene.units.near = 0.1;
  ck_ok(fx_scene_save(&scene, path));
  ck_ok(fx_scene_load(&again, path));
  ck_assert(again.units.stretch[1] == 4 / 3.0 && again.units.near == 0.1);
  for (uint64_t i = 0; i < 40; i++) {
    const fx_ray ray = make_ray(4, i, 90);
    fx_pixel a, b;
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &a, NULL));
    ck_ok(fx_render_ray(&again, &ray, NULL, NULL, &b, NULL));
    ck_assert_mem_eq(&a, &b, sizeof a);
  }
  fx_scene_free(&again);
  for (int i = 0; i < COUNT(wrong); i++) assert_edit_refused(&scene, wrong[i]);
  scene.tensorf.basis[70] = -128;
  ck_bad(fx_scene_save(&scene, path), SF_E_RANGE, "'basis_mat': element 70", "");
  fx_scene_free(&scene);
}

/* The library opens such a scene and renders its rays; what needs a hash grid it refuses. */
TEST(the_library_renders_it)
{
  enum { RAYS = 40 };
  float origin[RAYS][3], direction[RAYS][3];
  spikefield_scene *opened;
  spikefield_scene_info info;
  spikefield_pixel pixel[RAYS];
  spikefield_counts counts = {0};
  const uint32_t somewhere[3] = {1, 2, 3};
  int16_t inputs[SF_DIR_MAX] = {0}, harmonics[SPIKEFIELD_DIRECTIONS] = {0};
  spikefield_sample sample;
  uint64_t samples = 0;
  OWNED(fx_scene) scene = foggy(8);
  ck_ok(fx_scene_save(&scene, path));
  ck_assert_int_eq(spikefield_scene_open(&opened, path).code, SPIKEFIELD_OK);
  ck_assert_int_eq(spikefield_scene_describe(opened, &info).code, SPIKEFIELD_OK);
  ck_assert_int_eq(info.features, fx_tensorf_inputs(&scene.tensorf));
  ck_assert_int_eq(info.grid_bytes, fx_tensorf_bytes(&scene.tensorf));
  for (int i = 0; i < RAYS; i++)
    for (uint64_t a = 0; a < 3; a++) {
      origin[i][a] = (float)fixture_pick(5, a, (uint64_t)i, 1, 99) / 100;
      direction[i][a] = (float)fixture_pick(5, 3 + a, (uint64_t)i, -50, 50) / 100 + 0.001f;
    }
  ck_assert_int_eq(spikefield_rays(opened, NULL, origin[0], direction[0], RAYS, pixel, &counts).code, SPIKEFIELD_OK);
  for (int i = 0; i < RAYS; i++) {
    fx_ray ray;
    fx_pixel core;
    ck_ok(sf_fx_ray_make(&scene, origin[i], direction[i], &ray));
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &core, NULL));
    ck_assert_mem_eq(core.colour, pixel[i].colour, sizeof core.colour);
    ck_assert(core.transmittance == pixel[i].transmittance && core.samples == pixel[i].samples);
    samples += core.samples;
  }
  ck_assert_uint_gt(samples, RAYS);
  ck_assert_uint_eq(counts.samples, samples);
  ck_assert_uint_ge(counts.field_samples, samples);
  ck_assert_int_eq(spikefield_samples(opened, NULL, harmonics, inputs, 1, &sample, NULL, NULL).code, SPIKEFIELD_OK);
  const spikefield_status refused = spikefield_features(opened, somewhere, 1, inputs, NULL);
  ck_assert_msg(refused.code == SPIKEFIELD_E_UNSUPPORTED && strstr(refused.message, "TensoRF"), "%s", refused.message);
  spikefield_scene_close(opened);
}

/* ---- against the float model ---- */

enum { SIDE = 24, PIXELS = SIDE * SIDE };

static void pixel_ray(int pixel, int ndc, float origin[3], float direction[3])
{
  const float u = ((float)(pixel % SIDE) + 0.5f) / SIDE * 2 - 1, v = ((float)(pixel / SIDE) + 0.5f) / SIDE * 2 - 1;
  const float to[3] = {u * 0.9f, v * 0.9f, 0.1f * u};
  float length = 0;
  origin[0] = ndc ? 0.4f * u : 0.3f, origin[1] = ndc ? 0.4f * v : -0.5f, origin[2] = ndc ? -0.99f : 2.6f;
  for (int a = 0; a < 3; a++) {
    direction[a] = ndc && a == 2 ? 1 : ndc ? 0.2f * to[a] : to[a] - origin[a];
    length += direction[a] * direction[a];
  }
  for (int a = 0; a < 3; a++) direction[a] /= sqrtf(length);
}

/* Fixed against float pictures of the same rays. */
static double picture_psnr(int ndc)
{
  static float origin[PIXELS][3], direction[PIXELS][3], rgb[PIXELS][3], decoded[PIXELS];
  const float white[3] = {1, 1, 1};
  sf_model m = test_smooth_tensorf(ndc);
  fx_scene scene;
  sf_quant_report report;
  const sf_quant_options options = {.background = {1, 1, 1}, .seed = 1};
  const sf_status status = sf_quantise_report(&scene, &m, "fixture", &options, &report);
  double error = 0, variance = 0, mean = 0, float_samples = 0;
  uint64_t samples = 0;
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
  printf("ndc %d: errors: features %.4f, C1 %.4f, C2 %.4f, C3 %.4f; LSB %g, %g; bias %d\n", ndc, report.feature_error,
         report.layer[2].error, report.layer[3].error, report.layer[4].error, scene.units.feature_scale[0],
         scene.units.dir_scale, scene.net.layer[FX_C1].bias);
  for (int i = 0; i < PIXELS; i++) pixel_ray(i, ndc, origin[i], direction[i]);
  ck_assert_int_eq(sf_render_rays(&m, origin[0], direction[0], PIXELS, 0, white, rgb[0], NULL, NULL, decoded).code,
                   SF_OK);
  for (int i = 0; i < PIXELS; i++) {
    fx_ray ray;
    fx_pixel pixel;
    uint32_t rgba[4];
    ck_ok(sf_fx_ray_make(&scene, origin[i], direction[i], &ray));
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, NULL));
    fx_pixel_rgba(&pixel, rgba);
    samples += pixel.samples;
    float_samples += (double)decoded[i];
    for (int o = 0; o < 3; o++) {
      const double d = rgba[o] / 65535.0 - (double)rgb[i][o];
      error += d * d, mean += (double)rgb[i][o], variance += (double)rgb[i][o] * (double)rgb[i][o];
    }
  }
  ck_assert_uint_gt(samples, PIXELS);
  /* Both count what the decoder sees; a weight near the threshold may be on either side of it. */
  ck_assert_double_eq_tol(float_samples, (double)samples, 0.01 * (double)samples);
  variance = variance / (3 * PIXELS) - pow(mean / (3 * PIXELS), 2);
  ck_assert_double_gt(variance, 1e-4); /* there is something to see */
  fx_scene_free(&scene);
  sf_model_free(&m);
  return -10 * log10(error / (3 * PIXELS));
}

/* 36 dB: what int8 weights and planes leave of a random net, whose membranes lie anywhere about their thresholds. */
LOOP_TEST(pictures_are_those_of_the_float_model, 2)
{
  const double psnr = picture_psnr(_i);
  printf("ndc %d: fixed against float %.2f dB\n", _i, psnr);
  ck_assert_double_gt(psnr, 36);
}

TEST(what_cannot_be_represented_is_refused)
{
  OWNED(sf_model) m = test_smooth_tensorf(0);
  fx_scene scene;
  sf_quant_options options = {.seed = 1};
  sf_model_param(&m, SF_P_APP_LINE + 1)[5] = NAN;
  sf_status status = sf_quantise(&scene, &m, "m.safetensors", &options);
  ck_assert_msg(status.code == SF_E_RANGE && strstr(status.message, "'app_line.1'"), "%s", status.message);
  sf_model_param(&m, SF_P_APP_LINE + 1)[5] = 0;
  options.widths.feature_bits = 9;
  status = sf_quantise(&scene, &m, "m.safetensors", &options);
  ck_assert_msg(status.code == SF_E_UNSUPPORTED && strstr(status.message, "features"), "%s", status.message);
  options.widths.feature_bits = 0;
  m.config.theta[1] = 1e-30f;
  status = sf_quantise(&scene, &m, "m.safetensors", &options);
  ck_assert_msg(status.code == SF_E_UNSUPPORTED && strstr(status.message, "renderModule.mlp.0.weight"), "%s",
                status.message);
}

int ck_timeout = 120;
ck_options ck_program = {.set_up = set_up, .tear_down = remove_folder};
