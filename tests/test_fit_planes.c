/* Fitting TensoRF's planes: without loss no bit differs, else the bound is kept, whatever the threads and wherever it
 * was stopped before. */
#include "ck_run.h"
#include "tests/fit_planes_fixture.h"

TEST(no_loss_is_no_difference)
{
  OWNED(fx_scene) scene = planes_scene(20), fitted;
  spoil(&scene);
  const sf_fit_report r = fit_without_loss(&scene, &fitted);
  expect_dropped(&fitted);
  ck_assert_int_eq(r.idle_components[SF_OF_DENSITY], 1);
  ck_assert_int_eq(r.idle_components[SF_OF_APPEARANCE], 2);
  ck_assert_int_eq(r.dropped_components[SF_OF_DENSITY] + r.dropped_components[SF_OF_APPEARANCE], 0);
}

TEST(the_bound_is_kept)
{
  OWNED(fx_scene) scene = planes_scene(21), loaded;
  const sf_fit_report r = fit_within_a_bound(&scene, &loaded);
  ck_assert_int_eq(r.after.components[SF_OF_APPEARANCE], fx_factors_components(&loaded.tensorf.appearance));
  ck_assert_int_eq(r.before.entries, fx_tensorf_bytes(&scene.tensorf) - 27 * FX_APPEARANCE_MAX);
}

LONG_TEST(threads_do_not_matter)
{
  OWNED(fx_scene) scene = planes_scene(22);
  fit_by_any_threads(&scene);
}

static sf_status to_bytes(const fx_scene *scene, const sf_fit_rays *rays, uint64_t bytes, double loss,
                          fx_scene *smaller, sf_fit_tables *report)
{
  const fx_scene *candidate[] = {scene};
  const sf_fit_job job = fit_job(candidate, 1, rays, NULL, loss);
  return sf_fit_to_bytes(smaller, &job, bytes, report);
}

/* What is reported is what the scene takes, the bound holds, and less room loses more but for a tenth of a decibel. */
TEST(planes_for_so_many_bytes)
{
  OWNED(fx_scene) scene = planes_scene(24);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const int64_t whole = fx_tensorf_bytes(&scene.tensorf);
  fx_scene smaller;
  sf_fit_tables report;
  double last = 0;
  ck_ok(to_bytes(&scene, &rays, (uint64_t)whole, 0, &smaller, &report)); /* it has room as it is */
  ck_same_scenes(&scene, &smaller);
  ck_assert_int_eq(report.bytes_before, whole);
  fx_scene_free(&smaller);
  for (int64_t bytes = whole - 1; bytes >= whole / 8; bytes = bytes / 2) {
    ck_ok(to_bytes(&scene, &rays, (uint64_t)bytes, INFINITY, &smaller, &report));
    ck_ok(fx_scene_check(&smaller, "smaller"));
    ck_assert_int_eq(fx_tensorf_bytes(&smaller.tensorf), report.bytes_after);
    ck_assert_int_le(report.bytes_after, bytes);
    ck_assert(report.planes && report.dropped + report.smaller > 0);
    ck_assert_msg(report.loss_db > last - 0.1, "%g dB for %d bytes, %g dB for more", report.loss_db, (int)bytes, last);
    last = report.loss_db;
    fx_scene_free(&smaller);
  }
  ck_assert(last > 0.1);
  ck_bad(to_bytes(&scene, &rays, (uint64_t)whole / 8, 0.01, &smaller, &report), SF_E_RANGE, "out.snn", "--fit-loss");
  ck_bad(to_bytes(&scene, &rays, 100, INFINITY, &smaller, &report), SF_E_RANGE, "out.snn", "cannot take fewer");
}

typedef struct shown {
  const fx_scene *scene;
  const sf_fit_rays *rays;
} shown;

static sf_status job_ray(void *user, uint64_t index, fx_ray *ray)
{
  const shown *s = user;
  return sf_fx_ray_make(s->scene, s->rays->origin + 3 * index, s->rays->direction + 3 * index, ray);
}

/* Points of more components than a line holds are several look-ups; a cache so small that it misses many of them
 * counts what the recount counts. */
TEST(planes_of_several_lines_are_counted)
{
  OWNED(fx_scene) scene = planes_scene(25);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  static const fx_cache_shape shapes[] = {{1024, 1}, {2048, 2}, {8192, 4}};
  ck_assert_int_gt(scene.tensorf.density.components[0], FX_LINE);
  shown user = {&scene, &rays};
  for (int i = 0; i < COUNT(shapes); i++) {
    const sf_measure_job job = {
        .scene = &scene, .rays = RAYS, .ray = job_ray, .user = &user, .check = UINT64_MAX, .cache = shapes[i]};
    sf_measure m;
    ck_ok(sf_measure_rays(&job, &m));
    ck_assert_uint_eq(m.checked, m.core.rays);
    ck_assert_uint_gt(m.memory.misses, m.memory.lookups / 100);
    sf_measure_free(&m);
  }
}

static bool stop_later(void *user, const char *what, int done, int total)
{
  int *left = user;
  (void)what, (void)done, (void)total;
  return --*left > 0;
}

/* Wherever it is stopped: nothing is left, and the candidate is untouched: the next fit gives what the first one gave.
 */
TEST(interruptions)
{
  OWNED(fx_scene) scene = planes_scene(23), first, second, fitted;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const fx_scene *candidate[] = {&scene};
  const sf_fit_rays tiles = tiles_of(&rays);
  sf_fit_report r;
  ck_ok(fit(candidate, 1, &rays, 0.1, &first, &r));
  for (int after = 1; after < 300; after += CK_AMOUNT(23, 61)) {
    int left = after;
    sf_fit_job job = fit_job(candidate, 1, &rays, &tiles, 0.1);
    job.tick = stop_later, job.user = &left;
    ck_bad(sf_fit(&fitted, &job, &r), SF_E_STOPPED, "out.snn", "stopped");
    ck_assert_ptr_null(fitted.owner);
  }
  ck_ok(fit(candidate, 1, &rays, 0.1, &second, &r));
  ck_same_scenes(&first, &second);
}

int ck_timeout = 240;
ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};

int main(void)
{
  omp_set_num_threads(1); /* many small parallel regions: threads would wait for each other on a busy machine */
  return ck_main();
}
