/* For the tests of src/fit: rays of a scene, a fit to them, equality of pictures. */
#ifndef SF_TESTS_FIT_FIXTURE_H
#define SF_TESTS_FIT_FIXTURE_H
#include "ck_run.h"
#include "fit/fit.h"
#include "tests/folder_fixture.h"
#include "tests/fx_fixture.h"
#include <math.h>
#include <omp.h>

enum { RAYS = 600 };

static const sf_quant_widths widest[] = {{SF_WEIGHT_BITS, SF_INPUT_BITS, SF_LEAK_FRAC, 8},
                                         {SF_WEIGHT_BITS, SF_INPUT_BITS, SF_LEAK_FRAC, 8},
                                         {SF_WEIGHT_BITS, SF_INPUT_BITS, SF_LEAK_FRAC, 8}};

/* From a sphere around the box to points in it; the targets are what `scene` shows, and a little noise. */
static inline sf_fit_rays make_rays(const fx_scene *scene, uint64_t count, uint32_t noise)
{
  sf_fit_rays rays = {.count = count, .pixels = 100};
  rays.origin = calloc(count, 3 * sizeof(float));
  rays.direction = calloc(count, 3 * sizeof(float));
  rays.target = calloc(count, 3 * sizeof(uint32_t));
  for (uint64_t i = 0; i < count; i++) {
    float *o = rays.origin + 3 * i, *d = rays.direction + 3 * i, length = 0;
    for (uint64_t a = 0; a < 3; a++) o[a] = sf_random_float(1, a, i) - 0.5f, length += o[a] * o[a];
    for (uint64_t a = 0; a < 3; a++) o[a] *= 2.5f / sqrtf(length), d[a] = sf_random_float(2, a, i) - 0.5f - o[a];
    length = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int a = 0; a < 3; a++) d[a] /= length;
  }
  uint32_t *picture = calloc(count, 3 * sizeof *picture);
  sf_fit_sum sum;
  ck_ok(sf_fit_measure(scene, &rays, 0, count, picture, &sum));
  for (uint64_t i = 0; i < 3 * count; i++)
    rays.target[i] = (picture[i] + (uint32_t)sf_random_below(3, 0, i, noise + 1)) % 65536;
  free(picture);
  return rays;
}

/* Two of them, of whatever rays there are. */
static inline sf_fit_rays tiles_of(const sf_fit_rays *rays)
{
  sf_fit_rays tiles = *rays;
  tiles.count = 2 * FX_TILE * FX_TILE;
  return tiles;
}

static inline const sf_technology *prices(void)
{
  static sf_technology technology;
  if (!technology.count) ck_ok(sf_technology_load(&technology, "share/tech/45nm.tech"));
  return &technology;
}

static inline void assert_same_pixels(const fx_scene *a, const fx_scene *b, const sf_fit_rays *rays)
{
  uint64_t samples = 0;
  for (uint64_t i = 0; i < rays->count; i++) {
    fx_ray x, y;
    fx_pixel p, q;
    ck_ok(sf_fx_ray_make(a, rays->origin + 3 * i, rays->direction + 3 * i, &x));
    ck_ok(sf_fx_ray_make(b, rays->origin + 3 * i, rays->direction + 3 * i, &y));
    ck_ok(fx_render_ray(a, &x, NULL, NULL, &p, NULL));
    ck_ok(fx_render_ray(b, &y, NULL, NULL, &q, NULL));
    ck_assert_msg(!memcmp(&p, &q, sizeof p), "ray %llu differs", (unsigned long long)i);
    samples += p.samples;
  }
  ck_assert_uint_gt(samples, rays->count); /* the comparison is not of empty rays */
}

static inline sf_fit_job fit_job(const fx_scene *const *candidate, int candidates, const sf_fit_rays *rays,
                                 const sf_fit_rays *tiles, double loss)
{
  return (sf_fit_job){.candidate = candidate,
                      .widths = widest,
                      .candidates = candidates,
                      .rays = rays,
                      .tiles = tiles,
                      .technology = prices(),
                      .loss_db = loss,
                      .name = "out.snn"};
}

static inline sf_status fit(const fx_scene *const *candidate, int candidates, const sf_fit_rays *rays, double loss,
                            fx_scene *fitted, sf_fit_report *report)
{
  const sf_fit_rays tiles = tiles_of(rays);
  const sf_fit_job job = fit_job(candidate, candidates, rays, &tiles, loss);
  return sf_fit(fitted, &job, report);
}

/* Without loss no bit of a picture differs, and it costs less. */
static inline sf_fit_report fit_without_loss(const fx_scene *scene, fx_scene *fitted)
{
  OWNED(sf_fit_rays) rays = make_rays(scene, RAYS, 9000);
  sf_fit_report r;
  ck_ok(fit(&scene, 1, &rays, 0, fitted, &r));
  assert_same_pixels(scene, fitted, &rays);
  ck_assert_uint_eq(r.before.sum.error, r.after.sum.error);
  ck_assert_uint_lt(r.after.energy_fj, r.before.energy_fj);
  ck_assert_uint_lt(r.after.bytes, r.before.bytes);
  return r;
}

/* Within half a dB, measured here once more, through the file. */
static inline sf_fit_report fit_within_a_bound(const fx_scene *scene, fx_scene *loaded)
{
  const double bound = 0.5;
  OWNED(fx_scene) fitted;
  OWNED(sf_fit_rays) rays = make_rays(scene, RAYS, 9000);
  sf_fit_report r;
  sf_fit_sum before, after;
  ck_ok(fit(&scene, 1, &rays, bound, &fitted, &r));
  ck_ok(fx_scene_save(&fitted, in("fitted.snn")));
  ck_ok(fx_scene_load(loaded, in("fitted.snn")));
  const uint64_t first = r.first_checked, end = first + r.checked;
  ck_ok(sf_fit_measure(scene, &rays, first, end, NULL, &before));
  ck_ok(sf_fit_measure(loaded, &rays, first, end, NULL, &after));
  ck_assert_uint_eq(before.error, r.before.sum.error);
  ck_assert_uint_eq(after.error, r.after.sum.error);
  ck_assert_mem_eq(&after.counts, &r.after.sum.counts, sizeof after.counts);
  ck_assert_double_le((double)after.error, (double)before.error * pow(10, bound / 10));
  ck_assert_double_le(r.loss_db, bound);
  ck_assert_uint_lt(r.after.energy_fj, r.before.energy_fj); /* the bound was used for something */
  ck_assert_uint_lt(r.after.bytes, r.before.bytes);
  return r;
}

static inline void ck_same_scenes(const fx_scene *a, const fx_scene *b)
{
  ck_ok(fx_scene_save(a, in("a.snn")));
  ck_ok(fx_scene_save(b, in("b.snn")));
  ck_assert(same_files(in("a.snn"), in("b.snn")));
}

static inline void fit_by_any_threads(const fx_scene *scene)
{
  OWNED(fx_scene) a, b;
  OWNED(sf_fit_rays) rays = make_rays(scene, RAYS, 9000);
  sf_fit_report r, q;
  omp_set_num_threads(1);
  ck_ok(fit(&scene, 1, &rays, 0.3, &a, &r));
  omp_set_num_threads(3);
  ck_ok(fit(&scene, 1, &rays, 0.3, &b, &q));
  ck_assert_mem_eq(&r.after.sum, &q.after.sum, sizeof r.after.sum);
  ck_same_scenes(&a, &b);
}
#endif
