/* Procedural scenes: shapes, the tracer, the files they are written to. */
#include "ck_run.h"
#include "base/io.h"
#include "folder_fixture.h"
#include "base/rng.h"
#include "scene/scene.h"
#include "src/scene/stage.h"
#include <math.h>
#include <omp.h>
#include <sys/stat.h>

/* ---- shapes ---- */

/* Signed value: negative inside, zero on the surface, in the shape's own axes. */
static double inside(const sf_shape *s, const double p[3])
{
  double r = hypot(p[0], p[1]);
  switch (s->kind) {
  case SF_SPHERE:
    return sqrt(r * r + p[2] * p[2]) - s->size[0];
  case SF_BOX:
    return fmax(fmax(fabs(p[0]) - s->size[0], fabs(p[1]) - s->size[1]), fabs(p[2]) - s->size[2]);
  case SF_CYLINDER:
    return fmax(r - s->size[0], fabs(p[2]) - s->size[1]);
  case SF_TORUS:
    return hypot(r - s->size[0], p[2]) - s->size[1];
  }
  return NAN;
}

static double inside_world(const sf_shape *s, const sf_stage_ray *ray, double t)
{
  double p[3] = {0}, q[3];
  for (int i = 0; i < 3; i++) q[i] = ray->origin[i] + t * ray->direction[i] - s->centre[i];
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++) p[i] += s->axes[3 * i + k] * q[k];
  return inside(s, p);
}

static sf_stage_ray random_ray(uint64_t i)
{
  sf_stage_ray ray;
  double length = 0;
  for (unsigned k = 0; k < 3; k++) {
    ray.origin[k] = 6 * sf_random_float(11, k, i) - 3;
    ray.direction[k] = 1.4 * sf_random_float(11, 3 + k, i) - 0.7 - ray.origin[k];
    length += ray.direction[k] * ray.direction[k];
  }
  for (int k = 0; k < 3; k++) ray.direction[k] /= sqrt(length);
  return ray;
}

/* Against marching in steps of 1/1000: the same first crossing; a graze that marching can step over is not counted. */
LOOP_TEST(hits_equal_marching, 4)
{
  static const double sizes[4][3] = {{0.6, 0, 0}, {0.5, 0.3, 0.7}, {0.4, 0.6, 0}, {0.6, 0.2, 0}};
  const double centre[3] = {0.1, -0.2, 0.15}, step = 1e-3;
  sf_shape shape;
  int hits = 0;
  sf_shape_place(&shape, (sf_shape_kind)_i, centre, sizes[_i], 0.7, 0.4);
  for (uint64_t i = 0; i < 1500; i++) {
    sf_stage_ray ray = random_ray(i);
    sf_hit hit = {.t = INFINITY};
    bool found = sf_shape_hit(&shape, &ray, 0, &hit);
    double t = 0, start = inside_world(&shape, &ray, 0);
    while (t < 8 && (inside_world(&shape, &ray, t) < 0) == (start < 0)) t += step;
    if (t < 8) {
      ck_assert_msg(found, "ray %d: missed at %g", (int)i, t);
      ck_assert_msg(hit.t <= t + 1e-9, "ray %d: hit at %g, crossed before %g", (int)i, hit.t, t);
      hits++;
    }
    if (!found) continue;
    ck_assert(sf_shape_near(&shape, &ray, 0));
    /* roots are solved to 1e-13 and scaled by slopes below 10 */
    ck_assert_double_eq_tol(inside_world(&shape, &ray, hit.t), 0, 1e-9);
    double length = 0, outward = 0;
    for (int k = 0; k < 3; k++) length += hit.normal[k] * hit.normal[k], outward += hit.normal[k] * ray.direction[k];
    ck_assert_double_eq_tol(length, 1, 1e-9);
    if (fabs(outward) > 1e-3) ck_assert((outward < 0) == (start > 0));
  }
  ck_assert_int_gt(hits, 500);
}

LOOP_TEST(rays_along_axes_hit, 4)
{
  const double centre[3] = {0}, size[3] = {0.5, 0.25, 0.5};
  for (int axis = 0; axis < 3; axis++) {
    sf_shape s;
    sf_hit hit = {.t = INFINITY};
    sf_stage_ray ray = {{0}, {0}};
    ray.origin[axis] = 2, ray.direction[axis] = -1;
    sf_shape_place(&s, (sf_shape_kind)_i, centre, size, 0, 0);
    bool found = sf_shape_hit(&s, &ray, 0, &hit);
    static const double expected[4][3] = {{1.5, 1.5, 1.5}, {1.5, 1.75, 1.5}, {1.5, 1.5, 1.75}, {1.25, 1.25, -1}};
    ck_assert_int_eq(found, expected[_i][axis] > 0); /* down the hole of the torus there is nothing */
    if (found) ck_assert_double_eq_tol(hit.t, expected[_i][axis], 1e-12);
  }
}

/* ---- procedural scenes ---- */

static void trace(const char *name, float ox, float oy, float oz, float dx, float dy, float dz, float rgba[4])
{
  const float o[3] = {ox, oy, oz}, d[3] = {dx, dy, dz};
  ck_ok(sf_procedural_trace(name, o, d, rgba));
}

TEST(fog_follows_beer_lambert)
{
  float c[4];
  /* Through the sphere (radius 0.95, density 0.9) above core, ring and slab, at height 0.8. */
  double chord = 2 * sqrt(0.95 * 0.95 - 0.8 * 0.8);
  trace("fog", 0, -3, 0.8f, 0, 1, 0, c);
  ck_assert_float_eq_tol(c[3], 1 - exp(-0.9 * chord), 1e-6); /* floats in and out */
  ck_assert_float_eq_tol(c[0], 0.80, 1e-6);
  ck_assert_float_eq_tol(c[2], 0.93, 1e-6);
  /* Through sphere and slab: the slab (half sides 0.6, density 1.6) adds its 1.2. */
  chord = 2 * sqrt(0.95 * 0.95 - 0.6 * 0.6);
  trace("fog", 0, -3, -0.6f, 0, 1, 0, c);
  ck_assert_float_eq_tol(c[3], 1 - exp(-0.9 * chord - 1.6 * 1.2), 1e-6);
  /* Starting inside counts the rest only. */
  trace("fog", 0, 0, 0.8f, 0, 1, 0, c);
  ck_assert_float_eq_tol(c[3], 1 - exp(-0.9 * sqrt(0.95 * 0.95 - 0.8 * 0.8)), 1e-6);
  /* The core is opaque, and it is not the fog's colour. */
  trace("fog", 0, 0, 3, 0, 0, -1, c);
  ck_assert(c[3] == 1);
  trace("fog", 0, 3, 0.97f, 0, -1, 0, c);
  ck_assert(c[3] == 0);
}

TEST(scenes_stay_in_the_box)
{
  for (int n = 0; sf_procedural_names[n]; n++) {
    if (!strcmp(sf_procedural_names[n], "plaza")) continue; /* no_ray_ends_in_nothing */
    sf_stage stage;
    sf_stage_build(&stage, n);
    int opaque = 0;
    for (uint64_t i = 0; i < 20000; i++) {
      /* Rays along the six faces of a box of 1.1, just outside of it, see nothing. */
      float o[3], d[3] = {0}, c[4];
      int axis = (int)(i % 3), along = (axis + 1) % 3;
      for (unsigned k = 0; k < 3; k++) o[k] = 2.2f * sf_random_float(1, k, i) - 1.1f;
      o[axis] = i % 2 ? 1.101f : -1.101f, o[along] = 3, d[along] = -1;
      ck_ok(sf_procedural_trace(sf_procedural_names[n], o, d, c));
      ck_assert(c[3] == 0);
      o[axis] *= 0.2f;
      ck_ok(sf_procedural_trace(sf_procedural_names[n], o, d, c));
      opaque += c[3] > 0;
      for (int k = 0; k < 4; k++) ck_assert(c[k] >= 0 && c[k] <= 1);
    }
    ck_assert_int_eq(opaque > 1000, strcmp(sf_procedural_names[n], "empty") != 0);
  }
}

/* One point of a ball, its normal towards the light, from nine sides: shine makes the colours differ; in the simple
 * scene they are equal. */
TEST(shine_depends_on_the_view)
{
  static const double centres[2][3] = {{0.38, 0.32, 0.26}, {-0.42, 0.46, 0.88}}, radius[2] = {0.22, 0.06};
  const double n[3] = {0.48, -0.36, 0.80};
  for (int shiny = 0; shiny < 2; shiny++) {
    float least = 2, most = -1;
    for (int v = 0; v < 9; v++) {
      double a = M_PI / 4 * v, tilt = v < 8 ? 0.8 : 0;
      float o[3], d[3], c[4], away[3] = {(float)(tilt * cos(a)), (float)(tilt * sin(a)), 0};
      for (int k = 0; k < 3; k++) {
        float p = (float)(centres[shiny][k] + radius[shiny] * n[k]), to = (float)n[k] + away[k];
        o[k] = p + 2 * to, d[k] = -to;
      }
      ck_ok(sf_procedural_trace(shiny ? "textured" : "simple", o, d, c));
      ck_assert(c[3] == 1);
      least = fminf(least, c[2]), most = fmaxf(most, c[2]);
    }
    if (shiny)
      ck_assert_float_gt(most - least, 0.2f);
    else
      ck_assert_float_lt(most - least, 1e-3f); /* the point itself moves by float rounding */
  }
}

/* From inside its sky the plaza is opaque in every direction; the sky is seen from the far side of it only. */
TEST(no_ray_ends_in_nothing)
{
  for (uint64_t i = 0; i < 20000; i++) {
    float o[3], d[3], c[4];
    for (unsigned k = 0; k < 3; k++) {
      o[k] = 4 * (2 * sf_random_float(1, k, i) - 1);
      d[k] = 2 * sf_random_float(2, k, i) - 1;
    }
    ck_ok(sf_procedural_trace("plaza", o, d, c));
    ck_assert_float_eq(c[3], 1);
    for (int k = 0; k < 3; k++) ck_assert(c[k] > 0 && c[k] <= 1);
  }
  float c[4];
  trace("plaza", 0, 0, 3, 0, 0, 1, c); /* straight up: paler by 0.6 */
  for (int k = 0; k < 3; k++) ck_assert_float_ge(c[k], 0.4f * 0.36f + 0.6f - 1e-3f);
  trace("plaza", 20, 0, 0.5f, -1, 0, 0, c); /* from outside, too */
  ck_assert_float_eq(c[3], 1);
}

/* A chip of terrazzo looks the same from everywhere, but at its edges, and hardly two look alike. */
TEST(chips_are_of_places)
{
  int same = 0, alike = 0;
  float before[4] = {0};
  for (uint64_t i = 0; i < 1000; i++) {
    const float x = 0.5f + 0.3f * sf_random_float(3, 0, i), y = -0.5f + 0.3f * sf_random_float(3, 1, i);
    float above[4], slanted[4];
    trace("terrazzo", x, y, -0.42f, 0, 0, -1, above); /* the top of the slab is at -0.52 */
    trace("terrazzo", x - 0.05f, y + 0.05f, -0.47f, 1, -1, -1, slanted);
    ck_assert_float_eq(above[3], 1);
    same += fabsf(above[0] - slanted[0]) < 1e-6f && fabsf(above[2] - slanted[2]) < 1e-6f;
    alike += fabsf(above[0] - before[0]) < 1e-6f;
    memcpy(before, above, sizeof before);
  }
  ck_assert_int_gt(same, 990);
  ck_assert_int_lt(alike, 20);
}

TEST(trace_faults)
{
  const float o[3] = {0, 0, 3}, d[3] = {0, 0, -1}, none[3] = {0};
  float c[4];
  ck_bad(sf_procedural_trace("mars", o, d, c), SF_E_USAGE, "mars",
         "textured, simple, fog, empty, plaza, wires, terrazzo");
  ck_bad(sf_procedural_trace("fog", o, none, c), SF_E_RANGE, "fog", "direction");
}

static sf_procedural_options small = {24, 20, 3, 2, 5};

static bool count_progress(void *user, int done, int total)
{
  int *last = user;
  ck_assert_int_eq(done, *last + 1);
  ck_assert_int_eq(total, 5);
  *last = done;
  return true;
}

static bool stop_at_two(void *user, int done, int total)
{
  (void)user, (void)total;
  return done < 2;
}

/* Written, loaded, and each pixel equal to the mean of 4 x 4 exact rays. */
LOOP_TEST(written_scene_is_what_the_rays_see, 5)
{
  const char *name = sf_procedural_names[_i];
  int last = 0;
  sf_dataset d;
  ck_ok(sf_procedural_write(name, in("scene"), &small, count_progress, &last));
  ck_assert_int_eq(last, 5);
  ck_ok(sf_dataset_load(&d, in("scene"), "train", &(sf_dataset_options){.downscale = 1, .scale = 1}));
  ck_assert_int_eq(d.count, 3);
  for (int v = 0; v < d.count; v++) {
    const sf_camera *camera = &d.view[v].camera;
    const float *m = camera->to_world;
    ck_assert_float_eq_tol(sqrtf(m[3] * m[3] + m[7] * m[7] + m[11] * m[11]), 4.0311f, 1e-3f);
    ck_assert_float_gt(m[11], 0);
    ck_assert_float_eq_tol(camera->fx, 12 / tanf(0.5f * 0.69111121f), 1e-3f);
    for (int y = 0; y < 20; y++) {
      for (int x = 0; x < 24; x++) {
        double sum[4] = {0};
        for (int k = 0; k < 16; k++) {
          float o[3], r[3], c[4];
          sf_camera_ray(camera, x + (k % 4 + 0.5f) / 4, y + (k / 4 + 0.5f) / 4, o, r);
          ck_ok(sf_procedural_trace(name, o, r, c));
          for (int i = 0; i < 3; i++) sum[i] += c[i] * c[3] / 16;
          sum[3] += c[3] / 16;
        }
        const uint16_t *p = d.view[v].image.rgba + (y * 24 + x) * 4;
        /* Rounding to 8 bits is 0.5/255; re-read poses differ in the last float bit, which may carry one of the 16
         * samples over an edge where the scene is not continuous: allow 1/16 there, on few pixels. */
        ck_assert_double_eq_tol(p[3] / 65535.0, sum[3], 0.5 / 255 + 1.0 / 16 + 1e-6);
        for (int i = 0; i < 3; i++)
          ck_assert_double_eq_tol(p[i] / 65535.0 * p[3] / 65535.0, sum[i], 1.0 / 255 + 1.0 / 16 + 1e-6);
        if (!p[3]) ck_assert(sum[3] < 1.0 / 16);
      }
    }
  }
  sf_dataset_free(&d);
  ck_ok(sf_dataset_load(&d, in("scene"), "test", NULL));
  ck_assert_int_eq(d.count, 2);
  sf_dataset_free(&d);
}

TEST(seed_decides_and_threads_do_not)
{
  sf_procedural_options other = small;
  other.seed = 6;
  omp_set_num_threads(1);
  ck_ok(sf_procedural_write("textured", in("one"), &small, NULL, NULL));
  omp_set_num_threads(3);
  ck_ok(sf_procedural_write("textured", in("three"), &small, NULL, NULL));
  ck_ok(sf_procedural_write("textured", in("other"), &other, NULL, NULL));
  static const char *const files[] = {"transforms_train.json", "transforms_test.json", "train/r_0.png", "train/r_2.png",
                                      "test/r_1.png"};
  for (int i = 0; i < 5; i++) {
    char a[64], b[64], c[64];
    snprintf(a, sizeof a, "one/%s", files[i]);
    snprintf(b, sizeof b, "three/%s", files[i]);
    snprintf(c, sizeof c, "other/%s", files[i]);
    ck_assert(same_files(in(a), in(b)));
    ck_assert(!same_files(in(a), in(c)));
  }
  ck_assert(!same_files(in("one/train/r_0.png"), in("one/test/r_0.png")));
}

TEST(write_faults)
{
  sf_procedural_options none = small;
  none.test_views = 0;
  ck_bad(sf_procedural_write("fog", in("x"), &none, NULL, NULL), SF_E_RANGE, "fog", "views");
  none = small, none.width = 0;
  ck_bad(sf_procedural_write("fog", in("x"), &none, NULL, NULL), SF_E_RANGE, "fog", "0 x 20");
  fclose(fopen(in("file"), "wb"));
  ck_bad(sf_procedural_write("fog", in("file"), &small, NULL, NULL), SF_E_IO, "/file", "Not a directory");
  ck_bad(sf_procedural_write("fog", in("stopped"), &small, stop_at_two, NULL), SF_E_STOPPED, "interrupted",
         "after 2 pictures");
  ck_bad(sf_procedural_write("mars", in("x"), &small, NULL, NULL), SF_E_USAGE, "mars", "empty");
  struct stat info;
  ck_assert_int_ne(stat(in("x"), &info), 0);
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
