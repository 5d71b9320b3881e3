/* sf_ray_top, ray by ray: rays of one sample at any position, or of none, against the core's parts; pixels that wait.
 */
#include "ck_run.h"
#include "quant/quant.h"
#include "tests/dut_fixture.h"
#include "tests/fx_fixture.h"
#include "tests/random_net.h"

enum { LONE = 12 };

/* A ray of one sample at a position, or of none; what the core makes of it. */
static void lone_ray(const fx_scene *scene, const fx_ray *ray, const sf_ray_sample *sample, fx_pixel *pixel)
{
  int16_t f[SF_FEATURE_MAX] = {0};
  int32_t base[SF_LANES] = {0};
  fx_out out;
  fx_composite_begin(pixel);
  if (sample) {
    fx_grid_features(&scene->grid, sample->pos, f, NULL);
    fx_net_next(&scene->net, ray->dir, true, f, base, &out, NULL, NULL);
    fx_composite_add(pixel, &out, sample->delta_q24, sample->distance_q16);
  }
  fx_composite_end(pixel, scene->background);
}

static void same_pixel(const fx_pixel *actual, const fx_pixel *expected)
{
  ck_assert_mem_eq(actual->colour, expected->colour, sizeof expected->colour);
  ck_assert_uint_eq(actual->depth, expected->depth);
  ck_assert_uint_eq(actual->transmittance, expected->transmittance);
  ck_assert_uint_eq(actual->samples, expected->samples);
}

static fx_ray some_ray(const fx_scene *scene)
{
  fx_ray ray;
  ck_ok(sf_fx_ray_make(scene, (float[]){0, 0, 3}, (float[]){.2f, .1f, -1}, &ray));
  return ray;
}

static sf_ray_sample draw_sample(random_source *s)
{
  return (sf_ray_sample){
      {(uint32_t)draw(s, 0, 0xffffff), (uint32_t)draw(s, 0, 0xffffff), (uint32_t)draw(s, 0, 0xffffff)},
      (int32_t)draw(s, 1 << 18, 1 << 20),
      (uint64_t)draw(s, 0, 1 << 28)};
}

/* Nobody takes a pixel for a long time: empty rays and results pile up before the compositor, and none is lost. */
TEST(pixels_that_wait)
{
  static const fixture_sizes sizes = {4, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  random_source s = {270, 0};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 23);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 270}));
  sf_dut *dut = rays->dut;
  const fx_ray ray = some_ray(&scene);
  for (int round = 0; round < 40; round++) {
    sf_ray_sample sample[LONE];
    sf_ray_request request[LONE];
    fx_pixel expected[LONE], actual[LONE];
    for (int i = 0; i < LONE; i++) {
      const bool empty = draw(&s, 0, 1);
      sample[i] = draw_sample(&s);
      request[i] = (sf_ray_request){&ray, &sample[i], !empty, false, i % 3 == 0};
      lone_ray(&scene, &ray, empty ? NULL : &sample[i], &expected[i]);
    }
    dut->stall_percent = round % 2 ? 0 : 99; /* of the sink as of the source: a pixel waits for hundreds of cycles */
    ck_ok(sf_ray_dut_run(rays, request, LONE, actual));
    for (int i = 0; i < LONE; i++) same_pixel(&actual[i], &expected[i]);
  }
}

/* Positions beside which one LSB of an axis makes another pixel. */
TEST(every_bit_of_a_position)
{
  static const fixture_sizes sizes = {16, 64, 16, 9, 64, 64, 4, FX_HYBRID, {0}};
  random_source s = {280, 0};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 24);
  OWNED(sf_ray_dut) *rays = NULL;
  ck_ok(sf_ray_dut_open(&rays, &scene, &(sf_dut_options){.seed = 280}));
  const fx_ray ray = some_ray(&scene);
  int found[3] = {0};
  for (int i = 0; i < 300000 && (found[0] < 3 || found[1] < 3 || found[2] < 3); i++) {
    const int axis = i % 3;
    const sf_ray_sample sample = draw_sample(&s);
    sf_ray_sample beside = sample;
    beside.pos[axis] ^= 1;
    fx_pixel expected, other, actual;
    int16_t f[SF_FEATURE_MAX] = {0}, g[SF_FEATURE_MAX] = {0};
    fx_grid_features(&scene.grid, sample.pos, f, NULL);
    fx_grid_features(&scene.grid, beside.pos, g, NULL);
    if (found[axis] == 3 || memcmp(f, g, sizeof f) == 0) continue;
    lone_ray(&scene, &ray, &sample, &expected);
    lone_ray(&scene, &ray, &beside, &other);
    if (memcmp(expected.colour, other.colour, sizeof other.colour) == 0) continue;
    ck_ok(sf_ray_dut_run(rays, &(sf_ray_request){&ray, &sample, 1, false, true}, 1, &actual));
    same_pixel(&actual, &expected);
    found[axis]++;
  }
  for (int axis = 0; axis < 3; axis++) ck_assert_int_eq(found[axis], 3);
}
