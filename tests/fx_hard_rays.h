/* The hard cases of rays: what lies on them, where they meet the box. See fx_hard_cases.h. */
#ifndef SF_TESTS_FX_HARD_RAYS_H
#define SF_TESTS_FX_HARD_RAYS_H
#include "tests/fx_hard_nets.h"

/* ---- rays: what lies on them ---- */

static inline fx_ray hard_straight(int count, int axis)
{
  fx_ray ray = {.count = count};
  for (int a = 0; a < 3; a++) ray.origin[a] = (int64_t)1 << 39;
  ray.origin[axis] = 0;
  ray.step[axis] = (((int64_t)1 << 40) - 1) / (count > 1 ? count - 1 : 1);
  return ray;
}

static inline void hard_conserved(const hard_seen *seen)
{
  ck_assert_uint_eq(seen->pixel.weight_sum + seen->pixel.transmittance, FX_TRANS_ONE);
}

static inline void make_depth(hard *h, int variant)
{
  static const int32_t bias[] = {-131072, 131071, 131071, -49152}, delta[] = {1 << 24, 1, 1 << 24, 1};
  h->scene.net.exp_in.bias = bias[variant]; /* density 0, largest, largest, one LSB */
  h->scene.step_q24 = delta[variant];
  h->scene.trans_stop = 0;
  h->ray = hard_straight(8, variant % 3);
}

/* sigma * delta of 0, of 2^16 / 2^24, at saturation, and far below half an LSB of transmittance. */
static inline void expect_depth(const hard *h, const hard_seen *seen, int variant)
{
  (void)h;
  const double after[] = {1, exp(-8.0 / 256), 0, 1};
  hard_conserved(seen);
  ck_assert_uint_eq(seen->pixel.samples, variant == 2 ? 1 : 8);
  ck_assert_double_le(fabs(seen->pixel.transmittance - ldexp(after[variant], 20)), variant == 1 ? 8 * 2.85 : 0);
}

static inline void make_underflow(hard *h, int variant)
{
  (void)variant;
  h->scene.net.exp_in.bias = 6492; /* 3 per edge */
  h->scene.step_q24 = 1 << 22;
  h->scene.trans_stop = 0;
  h->ray = hard_straight(1024, 0);
}

/* 0.75 per sample: half an LSB of 2^20 is left after 14.56 / 0.75 = 19.4 samples. */
static inline void expect_underflow(const hard *h, const hard_seen *seen, int variant)
{
  (void)h, (void)variant;
  hard_conserved(seen);
  ck_assert_uint_eq(seen->pixel.transmittance, 0);
  ck_assert(seen->pixel.samples >= 19 && seen->pixel.samples <= 21);
}

static inline void make_empty(hard *h, int variant)
{
  memset(h->scene.occupancy, 0, 64);
  h->ray = hard_straight(500, variant);
}

static inline void expect_empty(const hard *h, const hard_seen *seen, int variant)
{
  (void)h, (void)variant;
  uint32_t rgba[4];
  hard_conserved(seen);
  fx_pixel_rgba(&seen->pixel, rgba);
  ck_assert_uint_eq(seen->pixel.samples, 0);
  ck_assert(rgba[0] == 65535 && rgba[1] == 65535 && rgba[2] == 65535 && rgba[3] == 0);
  ck_assert_uint_eq(seen->counts.rays, 0);
  ck_assert_uint_eq(seen->counts.march_steps, 500);
}

static inline void make_opaque(hard *h, int variant)
{
  h->scene.net.exp_in.bias = 131071;
  h->ray = hard_straight(500, variant);
}

static inline void expect_opaque(const hard *h, const hard_seen *seen, int variant)
{
  (void)h, (void)variant;
  hard_conserved(seen);
  ck_assert_uint_eq(seen->pixel.samples, 1);
  ck_assert_uint_eq(seen->pixel.transmittance, 0);
}

/* Fog of 1 per edge along `chord` edges: the samples cover it but for one step, and leave exp(-samples * delta) within
 * the bound of the error budget. */
static inline void expect_chord(const hard *h, const hard_seen *seen, double chord)
{
  const double delta = ldexp(h->scene.step_q24, -SF_DELTA_FRAC), depth = seen->pixel.samples * delta;
  hard_conserved(seen);
  ck_assert_msg(fabs(depth - chord) < 1.001 * delta, "%u samples cover %g, chord %g", seen->pixel.samples, depth,
                chord);
  ck_assert_double_le(fabs(seen->pixel.transmittance - ldexp(exp(-depth), 20)), 2.85 * seen->pixel.samples);
}

static inline void make_fog(hard *h, int variant)
{
  h->ray = hard_straight(40, variant);
  h->scene.step_q24 = (1 << 24) / 40;
}

static inline void expect_fog(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  ck_assert_uint_eq(seen->pixel.samples, 40);
  expect_chord(h, seen, 1);
}

static inline void make_count(hard *h, int variant)
{
  static const int limit[] = {1024, 1024, 1, 1024}, count[] = {0, 1, 1500, 1500};
  h->scene.net.exp_in.bias = -131072;
  h->scene.max_samples = limit[variant];
  h->ray = hard_straight(count[variant], variant % 3);
}

static inline void expect_count(const hard *h, const hard_seen *seen, int variant)
{
  static const uint32_t samples[] = {0, 1, 1, 1024};
  (void)h;
  hard_conserved(seen);
  ck_assert_uint_eq(seen->pixel.samples, samples[variant]);
  ck_assert_uint_eq(seen->counts.rays, samples[variant] > 0);
  ck_assert_uint_eq(seen->pixel.transmittance, FX_TRANS_ONE);
}

/* variant = axis * 9 + face: at 0, on every face between two cells, at the last position; only that cell is occupied.
 */
static inline void make_face(hard *h, int variant)
{
  uint32_t pos[3] = {1 << 23, 1 << 23, 1 << 23};
  pos[variant / 9] = variant % 9 == 8 ? (1 << 24) - 1 : (uint32_t)(variant % 9) << 21;
  const uint32_t cell = ((pos[2] >> 21) * 8 + (pos[1] >> 21)) * 8 + (pos[0] >> 21);
  memset(h->scene.occupancy, 0, 64);
  h->scene.occupancy[cell / 8] = (uint8_t)(1 << cell % 8);
  h->ray = (fx_ray){.count = 1};
  for (int a = 0; a < 3; a++) h->ray.origin[a] = (int64_t)pos[a] << 16;
}

static inline void expect_face(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  uint32_t at[3];
  hard_conserved(seen);
  ck_assert_uint_eq(seen->pixel.samples, 1);
  ck_assert_int_eq(fx_march_next(&h->scene, &h->ray, 0, at, NULL), 0);
  for (int a = 0; a < 3; a++) ck_assert_uint_eq(at[a], (uint32_t)(h->ray.origin[a] >> 16));
}

/* ---- rays: how they meet the box, [-1,1]^3 in model units ---- */

static inline void hard_aim(hard *h, const float origin[3], const float direction[3])
{
  ck_ok(sf_fx_ray_make(&h->scene, origin, direction, &h->ray));
}

static inline void make_parallel(hard *h, int variant)
{
  float o[3] = {0.25f, -0.5f, 0.125f}, d[3] = {0};
  d[variant / 2] = variant % 2 ? 1 : -1;
  o[variant / 2] = -3 * d[variant / 2];
  hard_aim(h, o, d);
}

static inline void expect_parallel(const hard *h, const hard_seen *seen, int variant)
{
  expect_chord(h, seen, 1);
  for (int a = 0; a < 3; a++) ck_assert(a == variant / 2 || h->ray.step[a] == 0);
}

/* variant = axis * 4 + signs: through two opposite edges parallel to the axis. */
static inline void make_edges(hard *h, int variant)
{
  float o[3] = {0}, d[3] = {0};
  d[(variant / 4 + 1) % 3] = variant & 1 ? 1 : -1, d[(variant / 4 + 2) % 3] = variant & 2 ? 1 : -1;
  for (int a = 0; a < 3; a++) o[a] = -3 * d[a];
  hard_aim(h, o, d);
}

static inline void expect_edges(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  expect_chord(h, seen, sqrt(2));
}

static inline void make_corners(hard *h, int variant)
{
  float o[3], d[3];
  for (int a = 0; a < 3; a++) d[a] = variant >> a & 1 ? 1 : -1, o[a] = -3 * d[a];
  hard_aim(h, o, d);
}

static inline void expect_corners(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  expect_chord(h, seen, sqrt(3));
}

static inline void make_inside(hard *h, int variant)
{
  float o[3] = {0}, d[3] = {0};
  d[variant / 2] = variant % 2 ? 1 : -1;
  hard_aim(h, o, d);
}

/* From the near plane at 0.2 to the face at 1. */
static inline void expect_inside(const hard *h, const hard_seen *seen, int variant)
{
  (void)variant;
  expect_chord(h, seen, 0.4);
}

/* In the plane of a face; beside the box; looking away; touching one edge; from inside with the face nearer than the
 * near plane. */
static inline void make_missing(hard *h, int variant)
{
  static const float o[][3] = {{1, 0, 3}, {1.5f, 0, 3}, {0, 0, 3}, {2, 0, 0}, {0, 0, 0.9f}};
  static const float d[][3] = {{0, 0, -1}, {0, 0, -1}, {0, 0, 1}, {-1, 1, 0}, {0, 0, 1}};
  hard_aim(h, o[variant], d[variant]);
}

static inline void expect_missing(const hard *h, const hard_seen *seen, int variant)
{
  (void)h, (void)variant;
  hard_conserved(seen);
  ck_assert_uint_eq(seen->pixel.samples, 0);
  ck_assert_uint_eq(seen->counts.march_steps, 0);
  for (int o = 0; o < 3; o++) ck_assert_uint_eq(seen->pixel.colour[o], (uint64_t)1 << 36); /* the background */
}

/* A camera in world units, times the scene's scale in float as the loader does. */
static const float hard_scale[] = {1e-6f, 1e6f}, hard_model_origin[3] = {0.3f, -0.2f, 3};

static inline void make_scale(hard *h, int variant)
{
  const float d[3] = {0, 0, -1}, scale = hard_scale[variant];
  float o[3];
  for (int a = 0; a < 3; a++) {
    const float world = hard_model_origin[a] / scale;
    o[a] = world * scale;
  }
  hard_aim(h, o, d);
}

/* The ray of scale 1 but for the rounding of two float operations: 2 * 2^-24 of 3 units, half of it in box units. */
static inline void expect_scale(const hard *h, const hard_seen *seen, int variant)
{
  const float d[3] = {0, 0, -1};
  fx_ray plain;
  (void)variant;
  expect_chord(h, seen, 1);
  ck_ok(sf_fx_ray_make(&h->scene, hard_model_origin, d, &plain));
  ck_assert_int_eq(h->ray.count, plain.count);
  for (int a = 0; a < 3; a++) {
    ck_assert_int_le(llabs(h->ray.origin[a] - plain.origin[a]), 3 << 16);
    ck_assert_int_eq(h->ray.step[a], plain.step[a]);
  }
}
#endif
