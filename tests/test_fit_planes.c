/* Fitting TensoRF's planes: without loss no bit differs, else the bound is kept, whatever the threads and wherever it
 * was stopped before. */
#include "ck_run.h"
#include "tests/folder_fixture.h"
#include "tests/fit_planes_fixture.h"
#include <omp.h>

TEST(no_loss_is_no_difference)
{
  OWNED(fx_scene) scene = planes_scene(20), fitted;
  spoil(&scene);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report r;
  ck_ok(fit(candidate, 1, &rays, 0, &fitted, &r));
  expect_dropped(&fitted);
  assert_same_pixels(&scene, &fitted, &rays);
  ck_assert_uint_eq(r.before.sum.error, r.after.sum.error);
  ck_assert_uint_lt(r.after.energy_fj, r.before.energy_fj);
  ck_assert_uint_lt(r.after.bytes, r.before.bytes);
  ck_assert_int_eq(r.idle_components[SF_OF_DENSITY], 1);
  ck_assert_int_eq(r.idle_components[SF_OF_APPEARANCE], 2);
  ck_assert_int_eq(r.dropped_components[SF_OF_DENSITY] + r.dropped_components[SF_OF_APPEARANCE], 0);
}

/* Measured here once more, through the file. */
TEST(the_bound_is_kept)
{
  OWNED(fx_scene) scene = planes_scene(21), fitted, loaded;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const fx_scene *candidate[] = {&scene};
  const double bound = 0.5;
  sf_fit_report r;
  sf_fit_sum before, after;
  ck_ok(fit(candidate, 1, &rays, bound, &fitted, &r));
  ck_ok(fx_scene_save(&fitted, in("planes.snn")));
  ck_ok(fx_scene_load(&loaded, in("planes.snn")));
  const uint64_t first = r.first_checked, end = first + r.checked;
  ck_ok(sf_fit_measure(&scene, &rays, first, end, NULL, &before));
  ck_ok(sf_fit_measure(&loaded, &rays, first, end, NULL, &after));
  ck_assert_uint_eq(before.error, r.before.sum.error);
  ck_assert_uint_eq(after.error, r.after.sum.error);
  ck_assert_mem_eq(&after.counts, &r.after.sum.counts, sizeof after.counts);
  ck_assert_double_le((double)after.error, (double)before.error * pow(10, bound / 10));
  ck_assert_uint_lt(r.after.energy_fj, r.before.energy_fj);
  ck_assert_uint_lt(r.after.bytes, r.before.bytes);
  ck_assert_int_eq(r.after.components[SF_OF_APPEARANCE], fx_factors_components(&loaded.tensorf.appearance));
  ck_assert_int_eq(r.before.entries, fx_tensorf_bytes(&scene.tensorf) - 27 * FX_APPEARANCE_MAX);
}

static void assert_same_scenes(const fx_scene *a, const fx_scene *b)
{
  ck_ok(fx_scene_save(a, in("a.snn")));
  ck_ok(fx_scene_save(b, in("b.snn")));
  size_t size[2];
  void *data[2];
  const char *name[] = {"a.snn", "b.snn"};
  for (int i = 0; i < 2; i++) {
    FILE *file = fopen(in(name[i]), "rb");
    ck_assert_ptr_nonnull(file);
    fseek(file, 0, SEEK_END);
    size[i] = (size_t)ftell(file), data[i] = malloc(size[i]);
    rewind(file);
    ck_assert_uint_eq(fread(data[i], 1, size[i], file), size[i]);
    fclose(file);
  }
  ck_assert_uint_eq(size[0], size[1]);
  ck_assert_mem_eq(data[0], data[1], size[0]);
  free(data[0]), free(data[1]);
}

TEST(threads_do_not_matter)
{
  OWNED(fx_scene) scene = planes_scene(22), a, b;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report r, q;
  omp_set_num_threads(1);
  ck_ok(fit(candidate, 1, &rays, 0.3, &a, &r));
  omp_set_num_threads(3);
  ck_ok(fit(candidate, 1, &rays, 0.3, &b, &q));
  ck_assert_mem_eq(&r.after.sum, &q.after.sum, sizeof r.after.sum);
  assert_same_scenes(&a, &b);
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
  for (int after = 1; after < 300; after += 23) {
    int left = after;
    const sf_fit_job job = {.candidate = candidate,
                            .widths = widest,
                            .candidates = 1,
                            .rays = &rays,
                            .tiles = &tiles,
                            .technology = prices(),
                            .loss_db = 0.1,
                            .name = "out.snn",
                            .tick = stop_later,
                            .user = &left};
    ck_bad(sf_fit(&fitted, &job, &r), SF_E_STOPPED, "out.snn", "stopped");
    ck_assert_ptr_null(fitted.owner);
  }
  ck_ok(fit(candidate, 1, &rays, 0.1, &second, &r));
  assert_same_scenes(&first, &second);
}

int ck_timeout = 240;
ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};

int main(void)
{
  omp_set_num_threads(1); /* many small parallel regions: threads would wait for each other on a busy machine */
  return ck_main();
}
