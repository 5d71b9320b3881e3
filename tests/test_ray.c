/* Rays to integers: every point inside the box, and the lattice that of the float renderer. */
#include "ck_run.h"
#include "quant/quant.h"
#include "base/rng.h"
#include <math.h>

static float normal(uint64_t stream, uint64_t i)
{
  float sum = 0;
  for (uint64_t n = 0; n < 12; n++) sum += sf_random_float(4, stream, i * 12 + n);
  return sum - 6;
}

static fx_scene box_scene(int lattice)
{
  fx_scene s = {.units.to_box_scale = 0.5, .units.to_box_offset = {0.5, 0.5, 0.5}, .units.dir_scale = 0x1p-10};
  s.step_q24 = (int32_t)lround(sqrt(3.0) / lattice * 16777216);
  return s;
}

static fx_ray make_ray(const fx_scene *scene, const float o[3], const float d[3])
{
  fx_ray ray;
  ck_ok(sf_fx_ray_make(scene, o, d, &ray));
  for (int32_t n = 0; n < ray.count; n++)
    for (int a = 0; a < 3; a++) {
      const int64_t p = (ray.origin[a] + n * ray.step[a]) >> 16;
      ck_assert_msg(p >= 0 && p < 1 << 24, "point %d of %d: axis %d at %lld", n, ray.count, a, (long long)p);
    }
  return ray;
}

/* Same count (but for a box face within float rounding) and the same points as the float lattice. The step's
 * rounding to Q0.24 drifts by up to 2^-25 per step; float itself is good to some 1e-6 here. */
TEST(rays_follow_the_float_lattice)
{
  int hits = 0, differ = 0;
  for (uint64_t i = 0; i < 6000; i++) {
    static const int lattices[] = {16, 100, 256, 1024};
    sf_config config = sf_config_default();
    config.lattice = lattices[i % 4];
    const fx_scene scene = box_scene(config.lattice);
    float o[3], d[3], length = 0;
    for (uint64_t a = 0; a < 3; a++)
      o[a] = normal(60 + a, i) * (i % 3 ? 1.5f : 0.4f), d[a] = normal(70 + a, i) - (i % 2 ? o[a] : 0);
    for (int a = 0; a < 3; a++) length += d[a] * d[a];
    for (int a = 0; a < 3; a++) d[a] /= sqrtf(length);
    const fx_ray ray = make_ray(&scene, o, d);
    sf_steps steps;
    ck_ok(sf_steps_make(&steps, &config, 1));
    const sf_lattice real = sf_ray_lattice(&steps, o, d);
    differ += ray.count != real.count;
    ck_assert_int_le(abs(ray.count - real.count), 1);
    hits += real.count > 0;
    if (ray.count == 0 || real.count == 0) continue;
    ck_assert_double_eq_tol(ray.first_q16 / 65536.0, real.first / steps.shortest,
                            2e-5 * (1 + real.first / steps.shortest));
    for (int32_t n = 0; n < ray.count; n += 7)
      for (int a = 0; a < 3; a++) {
        const double p = ldexp((double)(ray.origin[a] + n * ray.step[a]), -40);
        const double exact = (o[a] + (double)d[a] * (real.first + (double)n * steps.shortest)) / 2 + 0.5;
        ck_assert_double_eq_tol(p, exact, 0x1p-25 * n + 4e-6);
      }
  }
  ck_assert_int_gt(hits, 2000);
  ck_assert_int_le(differ, 6);
}

TEST(rays_parallel_to_an_axis)
{
  const fx_scene scene = box_scene(256);
  for (int axis = 0; axis < 3; axis++)
    for (int sign = -1; sign <= 1; sign += 2) {
      float o[3] = {0.25f, -0.5f, 0.125f}, d[3] = {0};
      o[axis] = (float)(-3 * sign), d[axis] = (float)sign;
      const fx_ray ray = make_ray(&scene, o, d);
      ck_assert_int_eq(ray.count, 147); /* floor(2 / (2 sqrt(3) / 256)) */
      for (int a = 0; a < 3; a++)
        if (a != axis) ck_assert(ray.step[a] == 0 && ray.origin[a] == llrint(ldexp(o[a] / 2 + 0.5, 40)));
      o[(axis + 1) % 3] = 1; /* in the plane of a face */
      ck_assert_int_eq(make_ray(&scene, o, d).count, 0);
      o[(axis + 1) % 3] = 1.5f;
      ck_assert_int_eq(make_ray(&scene, o, d).count, 0);
    }
}

TEST(rays_through_edges_and_corners)
{
  const fx_scene scene = box_scene(1024);
  for (int corner = 0; corner < 8; corner++) {
    const float c[3] = {corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1};
    const float out[3] = {3 * c[0], 3 * c[1], 3 * c[2]}, in[3] = {-c[0], -c[1], -c[2]};
    ck_assert_int_ge(make_ray(&scene, out, in).count, 1023); /* the whole diagonal */
    const float edge[3] = {3 * c[0], 3 * c[1], 0}, along[3] = {-c[0], -c[1], 0};
    ck_assert_int_gt(make_ray(&scene, edge, along).count, 800);
    const float beside[3] = {2 * c[0], 0, 0}, touch[3] = {-c[0], c[1], 0}; /* touches one edge only */
    ck_assert_int_le(make_ray(&scene, beside, touch).count, 1);
    ck_assert_int_eq(make_ray(&scene, out, c).count, 0); /* looks away */
  }
}

TEST(rays_from_inside_start_at_the_near_plane)
{
  const fx_scene scene = box_scene(1024);
  const float o[3] = {0}, d[3] = {0, 0, 1};
  const fx_ray ray = make_ray(&scene, o, d);
  const double step = 2 * sqrt(3.0) / 1024;
  ck_assert_int_eq(ray.count, (int)(0.8 / step));
  ck_assert_double_eq_tol(ldexp((double)ray.origin[2], -40), 0.5 + (0.2 + step / 2) / 2, 1e-6);
  const float near_face[3] = {0, 0, 0.9f};
  ck_assert_int_eq(make_ray(&scene, near_face, d).count, 0);
}

TEST(rays_far_away_and_refused)
{
  const fx_scene scene = box_scene(1024);
  fx_ray ray;
  const double step = ldexp(scene.step_q24, -24) / scene.units.to_box_scale; /* 32768 of them are 110.85 */
  for (int e = 0; e < 120; e++) {
    const float o[3] = {1 + powf(2, (float)e), 0, 0}, d[3] = {-1, 0, 0}, aside[3] = {0, 1, 0};
    ck_assert_int_eq(make_ray(&scene, o, aside).count, 0);
    const sf_status status = sf_fx_ray_make(&scene, o, d, &ray);
    ck_assert_msg(status.code == (e < 7 ? SF_OK : e < 50 ? SF_E_RANGE : status.code), "2^%d: %s", e, status.message);
    if (e == 7)
      ck_assert_msg(strstr(status.message, "128.002 model units away, 37837.6") != NULL, "%s", status.message);
    if (status.code != SF_OK || e >= 50) continue;
    ck_assert_int_ge(ray.count, 500);
    ck_assert_double_eq_tol(ray.first_q16 / 65536.0, (o[0] - 1) / step + 0.5, 1e-4);
  }
  const float bad[] = {NAN, INFINITY, -INFINITY};
  for (int i = 0; i < 3; i++)
    for (int a = 0; a < 3; a++) {
      float o[3] = {0, 0, 3}, d[3] = {0, 0, -1};
      o[a] = bad[i];
      ck_assert_int_eq(sf_fx_ray_make(&scene, o, d, &ray).code, SF_E_RANGE);
      o[a] = 0, d[a] = bad[i];
      ck_assert_int_eq(sf_fx_ray_make(&scene, o, d, &ray).code, SF_E_RANGE);
    }
  const float o[3] = {0}, zero[3] = {0};
  ck_assert_int_eq(sf_fx_ray_make(&scene, o, zero, &ray).code, SF_E_RANGE);
}

/* Integer harmonics against the float ones, at every LSB. */
TEST(direction_features_within_one_lsb)
{
  const float o[3] = {0, 0, 3};
  double worst = 0;
  for (uint64_t i = 0; i < 20000; i++) {
    fx_scene scene = box_scene(256);
    const int frac = (int)(i % (FX_DIR_FRAC_MAX + 1));
    scene.units.dir_scale = ldexp(1, -frac);
    ck_assert_int_eq(sf_fx_dir_frac(&scene), frac);
    float d[3], sh[SF_DIR_FEATURES], length = 0;
    for (uint64_t a = 0; a < 3; a++) d[a] = normal(80 + a, i) * (i % 3 == a ? 1 : i % 5 ? 1 : 0.001f);
    if (i < 162) d[0] = (float)(i % 3) - 1, d[1] = (float)(i / 3 % 3) - 1, d[2] = (float)(i / 9 % 3) - 1;
    for (int a = 0; a < 3; a++) length += d[a] * d[a];
    if (length == 0) continue;
    const fx_ray ray = make_ray(&scene, o, d);
    for (int a = 0; a < 3; a++) {
      d[a] /= sqrtf(length);
      ck_assert_double_eq_tol(ray.unit[a], d[a] * 16384.0, 0.5 + 0.01);
    }
    sf_sh4(d, sh);
    for (int n = 0; n < SF_DIR_FEATURES; n++) {
      const double error = fabs(ray.dir[n] - ldexp((double)sh[n], frac));
      ck_assert_msg(error <= 1, "frac %d, (%g, %g, %g): harmonic %d is off by %g LSB", frac, (double)d[0], (double)d[1],
                    (double)d[2], n, error);
      worst = fmax(worst, error);
    }
  }
  ck_assert_double_gt(worst, 0.5);
}

/* No input leaves the rails: not even three axes at full scale. */
TEST(directions_that_are_none)
{
  static const int16_t full[3] = {INT16_MIN, INT16_MAX, INT16_MAX}, one[3] = {-FX_UNIT_ONE, FX_UNIT_ONE, FX_UNIT_ONE};
  int16_t a[FX_SH], b[FX_SH];
  fx_sh(full, FX_DIR_FRAC_MAX, a);
  fx_sh(one, FX_DIR_FRAC_MAX, b);
  ck_assert_mem_eq(a, b, sizeof a); /* clamped to one */
  ck_assert_int_eq(a[10], -2047);
  ck_assert_int_eq(a[13], 2047);
  ck_assert_int_eq(a[0], 578);
  const int16_t zero[3] = {0};
  fx_sh(zero, 0, a);
  for (int n = 0; n < FX_SH; n++) ck_assert_int_eq(a[n], 0); /* 0.28 and -0.32 round to none */
}

int ck_timeout = 300;
