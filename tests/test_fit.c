/* Fitting grids: no loss is no difference, else the bound is kept; the cache that a scene needs; a grid for so many
 * bytes. */
#include "ck_run.h"
#include "tests/fit_grid_fixture.h"

/* A net that never fires keeps one neuron a layer. */
TEST(something_is_left_of_a_silent_net)
{
  OWNED(fx_scene) scene = small_scene(12, FX_HYBRID), trimmed;
  for (int l = 0; l < SF_LAYERS; l++) memset(scene.net.layer[l].w, 0, (size_t)scene.net.layer[l].n_in * SF_LANES);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report report;
  ck_ok(fit(candidate, 1, &rays, 0, &trimmed, &report));
  for (int l = FX_D1; l <= FX_C2; l++) ck_assert_int_eq(trimmed.net.layer[l].n_out, 1);
  ck_assert_int_eq(trimmed.grid.levels, 1);
  assert_same_pixels(&scene, &trimmed, &rays);
}

/* ---- the search ---- */

static void watch_read(void *user, fx_read what, const uint32_t pos[3])
{
  fx_memory_read(user, what, pos);
}

/* The field's lines missed by the tiles' rays, one by one through the portable core. */
static uint64_t misses_of(const fx_scene *scene, const sf_fit_rays *tiles, const fx_cache_shape *shape,
                          uint64_t *samples)
{
  fx_memory memory;
  ck_ok(fx_memory_open(&memory, scene, shape));
  const fx_watch watch = {watch_read, &memory};
  fx_counts counts = {0};
  for (uint64_t i = 0; i < tiles->count; i++) {
    fx_ray ray;
    fx_pixel pixel;
    ck_ok(sf_fx_ray_make(scene, tiles->origin + 3 * i, tiles->direction + 3 * i, &ray));
    fx_memory_ray(&memory, i / (FX_TILE * FX_TILE));
    ck_ok(fx_render_watched(scene, &ray, NULL, NULL, &watch, &pixel, &counts));
  }
  const uint64_t misses = memory.counts.misses;
  *samples = counts.samples;
  fx_memory_close(&memory);
  return misses;
}

/* Misses and energy of every size are those of the audit's counts; the smallest that is nearly the best is chosen. */
TEST(the_cache_that_a_scene_needs)
{
  OWNED(fx_scene) scene = small_scene(31, FX_HYBRID), fitted;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const sf_fit_rays tiles = tiles_of(&rays);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report r;
  ck_ok(fit(candidate, 1, &rays, 0.1, &fitted, &r));
  uint64_t least = UINT64_MAX, samples;
  for (int i = 0; i < SF_FIT_CACHES; i++) {
    const double misses = (double)misses_of(&fitted, &tiles, &r.cache[i].shape, &samples);
    ck_assert_double_eq_tol(r.cache[i].misses * r.after.lookups * (double)samples, misses, 1e-6 * misses);
    if (i > 0) ck_assert_double_le(r.cache[i].misses, r.cache[i - 1].misses);
    least = r.cache[i].energy_fj < least ? r.cache[i].energy_fj : least;
    if (r.cache[i].shape.bytes != sf_cache_built.bytes) continue;
    ck_assert_uint_eq(r.cache[i].energy_fj, r.after.energy_fj);
    ck_assert_double_eq_tol(r.after.misses * (double)samples, misses, 1e-6 * misses);
  }
  for (int i = 0; i < r.cache_chosen; i++) ck_assert_double_gt((double)r.cache[i].energy_fj, 1.01 * (double)least);
  ck_assert_double_le((double)r.cache[r.cache_chosen].energy_fj, 1.01 * (double)least);
}

static fx_scene large_box(uint64_t seed)
{
  fx_scene scene = fixture_box(&small, seed, 2, 150000);
  scene.net.exp_in = (fx_scale){20000, 15, 8192};
  for (int l = 0; l < SF_LAYERS; l++) scene.net.layer[l].theta = scene.net.layer[l].theta ? 20000 : 0;
  return scene;
}

/* Every sample of the rays lies in an occupied cell, in two cascades at least. */
static void samples_in_cells(const fx_scene *scene, const sf_fit_rays *rays)
{
  const int64_t cells = (int64_t)scene->occ_res * scene->occ_res * scene->occ_res;
  int in[3] = {0};
  for (uint64_t i = 0; i < rays->count; i++) {
    fx_ray ray;
    uint32_t pos[3];
    ck_ok(sf_fx_ray_make(scene, rays->origin + 3 * i, rays->direction + 3 * i, &ray));
    for (int32_t n = fx_march_next(scene, &ray, 0, pos, NULL); n >= 0;
         n = fx_march_next(scene, &ray, n + 1, pos, NULL)) {
      const int64_t cell = fx_march_cell(scene, &ray, n);
      ck_assert(scene->occupancy[cell >> 3] >> (cell & 7) & 1);
      in[cell / cells]++;
    }
  }
  ck_assert((in[0] > 100) + (in[1] > 100) + (in[2] > 100) >= 2);
}

/* A box of three cascades with growing steps. */
TEST(a_large_box_is_fitted)
{
  OWNED(fx_scene) scene = large_box(33), fitted;
  spoil(&scene);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  samples_in_cells(&scene, &rays);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report r;
  ck_ok(fit(candidate, 1, &rays, 0, &fitted, &r));
  assert_same_pixels(&scene, &fitted, &rays);
  ck_assert_uint_lt(r.after.bytes, r.before.bytes);
  OWNED(fx_scene) smaller = {0};
  ck_ok(fit(candidate, 1, &rays, 0.5, &smaller, &r));
  ck_assert_double_le(r.loss_db, 0.5);
  ck_assert_int_eq(smaller.log2_bound, 2);
  ck_assert_int_lt(r.after.cells, r.before.cells);
}

LOOP_TEST(no_loss_is_no_difference, 3)
{
  OWNED(fx_scene) scene = small_scene(16, _i), fitted;
  spoil(&scene);
  const sf_fit_report r = fit_without_loss(&scene, &fitted);
  expect_dropped(&scene, &fitted);
  for (int l = 0; l < SF_LAYERS; l++) ck_assert_int_eq(r.dropped[l], 0);
  ck_assert_int_eq(r.dropped_levels + r.smaller_tables, 0);
  ck_assert_int_eq(r.idle_levels, 1);
}

TEST(the_bound_is_kept)
{
  OWNED(fx_scene) scene = small_scene(17, FX_HYBRID), loaded;
  fit_within_a_bound(&scene, &loaded);
}

LONG_TEST(threads_do_not_matter)
{
  OWNED(fx_scene) scene = small_scene(18, FX_HYBRID);
  fit_by_any_threads(&scene);
}

TEST(candidates)
{
  fx_scene scene = small_scene(19, FX_HYBRID), same = small_scene(19, FX_HYBRID), worse = small_scene(20, FX_HYBRID);
  fx_scene fitted;
  sf_fit_rays rays = make_rays(&scene, RAYS, 3000);
  const fx_scene *candidate[] = {&scene, &same, &worse};
  sf_fit_report r;
  ck_ok(fit(candidate, 3, &rays, 0.1, &fitted, &r));
  ck_assert_int_eq(r.chosen, 1);
  ck_assert_double_le(r.loss_db, 0.1);
  fx_scene_free(&fitted);
  ck_ok(fit(candidate, 3, &rays, 0, &fitted, &r));
  ck_assert_int_eq(r.chosen, 0);
  sf_fit_rays_free(&rays), fx_scene_free(&scene), fx_scene_free(&same), fx_scene_free(&worse), fx_scene_free(&fitted);
}

static bool stop_at_once(void *user, const char *what, int done, int total)
{
  (void)user, (void)what, (void)done, (void)total;
  return false;
}

TEST(refusals)
{
  fx_scene scene = small_scene(21, FX_HYBRID), fitted;
  sf_fit_rays rays = make_rays(&scene, RAYS, 0);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report r;
  ck_bad(fit(candidate, 1, &rays, -1, &fitted, &r), SF_E_RANGE, "out.snn", "-1 dB");
  ck_bad(fit(candidate, 1, &rays, NAN, &fitted, &r), SF_E_RANGE, "out.snn", "nan dB");
  rays.count = 100;
  ck_bad(fit(candidate, 1, &rays, 0.1, &fitted, &r), SF_E_RANGE, "out.snn", "100 rays");
  ck_assert_ptr_null(fitted.owner);
  rays.count = RAYS;
  uint8_t *seen = scene.occupancy, empty[64 * 64] = {0};
  ck_assert_uint_le((size_t)scene.occ_res * scene.occ_res * scene.occ_res / 8, sizeof empty);
  scene.occupancy = empty;
  ck_bad(fit(candidate, 1, &rays, 0.1, &fitted, &r), SF_E_RANGE, "out.snn", "no ray of the data set meets");
  scene.occupancy = seen;
  ck_assert_ptr_null(fitted.owner);
  const sf_fit_rays tiles = tiles_of(&rays);
  sf_fit_job job = fit_job(candidate, 1, &rays, &tiles, 0);
  job.tick = stop_at_once;
  ck_bad(sf_fit(&fitted, &job, &r), SF_E_STOPPED, "out.snn", "stopped");
  ck_assert_ptr_null(fitted.owner);
  sf_view view = {.name = "r_7", .camera = {.width = 4, .height = 4}};
  const sf_dataset data = {.path = "dir", .view = &view, .count = 1};
  sf_fit_rays none;
  ck_bad(sf_fit_rays_draw(&none, &data, scene.background, 10, 0), SF_E_FORMAT, "dir", "r_7");
  sf_fit_rays_free(&rays), fx_scene_free(&scene);
}

/* Straight alpha over the background: half of red over white. */
TEST(targets)
{
  uint16_t rgba[4] = {65535, 0, 0, 32768};
  sf_view view = {.name = "r_0", .camera = {.width = 1, .height = 1, .fx = 1, .fy = 1}, .image = {1, 1, rgba}};
  const sf_dataset data = {.path = "dir", .view = &view, .count = 1};
  const int32_t white[3] = {65536, 65536, 65536}, black[3] = {0};
  sf_fit_rays rays;
  ck_ok(sf_fit_rays_draw(&rays, &data, white, 5, 0));
  ck_assert_uint_eq(rays.target[12], 65535);
  ck_assert_uint_eq(rays.target[13], 32767);
  ck_assert_double_eq(rays.pixels, 1);
  sf_fit_rays_free(&rays);
  ck_ok(sf_fit_rays_draw(&rays, &data, black, 5, 0));
  ck_assert_uint_eq(rays.target[12], 32768);
  ck_assert_uint_eq(rays.target[13], 0);
  sf_fit_rays_free(&rays);
}

/* ---- a grid for so many bytes ---- */

static sf_status to_bytes(const fx_scene *scene, const sf_fit_rays *rays, uint64_t bytes, double loss,
                          fx_scene *smaller, sf_fit_tables *report)
{
  const fx_scene *candidate[] = {scene};
  const sf_fit_job job = {
      .candidate = candidate, .widths = widest, .candidates = 1, .rays = rays, .loss_db = loss, .name = "scene.snn"};
  return sf_fit_to_bytes(smaller, &job, bytes, report);
}

static uint64_t grid_bytes(const fx_scene *scene)
{
  return 2 * (uint64_t)scene->grid.entries;
}

/* A level that says nothing is the cheapest to leave out, whatever its size. */
LOOP_TEST(what_loses_nothing_goes_first, 3)
{
  fx_scene scene = small_scene(70, FX_HYBRID), smaller;
  const int64_t first = scene.grid.offset[_i], entries = sf_grid_level_entries(&scene.grid, _i);
  memset(scene.grid.table + 2 * first, 0, 2 * (size_t)entries);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 500);
  sf_fit_tables report;
  ck_ok(to_bytes(&scene, &rays, grid_bytes(&scene), 0, &smaller, &report));
  ck_assert_uint_eq(grid_bytes(&smaller), grid_bytes(&scene)); /* it has room as it is */
  fx_scene_free(&smaller);
  ck_ok(to_bytes(&scene, &rays, grid_bytes(&scene) - 2 * (uint64_t)entries, 0, &smaller, &report));
  ck_assert_uint_eq(grid_bytes(&smaller), report.bytes_after);
  ck_assert_uint_le(report.bytes_after, report.bound);
  assert_same_pixels(&scene, &smaller, &rays);
  ck_assert(report.loss_db == 0);
  fx_scene_free(&smaller), fx_scene_free(&scene);
}

TEST(bytes_and_loss_are_kept)
{
  fx_scene scene = small_scene(71, FX_HYBRID), smaller;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 500);
  sf_fit_tables report;
  double last = 0;
  for (uint64_t bytes = grid_bytes(&scene) / 2; bytes >= 64; bytes /= 4) {
    ck_ok(to_bytes(&scene, &rays, bytes, INFINITY, &smaller, &report));
    ck_assert_uint_eq(grid_bytes(&smaller), report.bytes_after);
    ck_assert_uint_le(grid_bytes(&smaller), bytes);
    ck_assert_msg(report.loss_db >= last, "%g dB for %d bytes, %g dB for more", report.loss_db, (int)bytes, last);
    last = report.loss_db;
    fx_scene_free(&smaller);
  }
  ck_assert(last > 0.1);
  ck_bad(to_bytes(&scene, &rays, 64, last / 100, &smaller, &report), SF_E_RANGE, "more than --fit-loss",
         "the smallest within it that was found has");
  ck_bad(to_bytes(&scene, &rays, 1, INFINITY, &smaller, &report), SF_E_RANGE, "scene.snn",
         "the field cannot take fewer than 2 bytes");
  fx_scene_free(&scene);
}

int ck_timeout = 120;
ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};

int main(void)
{
  omp_set_num_threads(1); /* many small parallel regions: threads would wait for each other on a busy machine */
  return ck_main();
}
