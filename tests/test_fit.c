/* Trimming and fitting: what is left out without effect changes no bit, the rest stays within the bound. */
#include "ck_run.h"
#include "src/quant/internal.h"
#include "tests/folder_fixture.h"
#include "tests/fit_fixture.h"
#include <omp.h>

enum { RAYS = 600 };

static const fixture_sizes small = {6, 20, 6, 9, 24, 20, 3, FX_HYBRID, {0}};

static fx_scene small_scene(uint64_t seed, int mode)
{
  fixture_sizes sizes = small;
  sizes.mode = mode;
  fx_scene scene = fixture_scene(&sizes, seed);
  scene.step_q24 = 700000; /* about 40 samples along the diagonal */
  scene.net.exp_in = (fx_scale){20000, 15, 8192};
  for (int l = 0; l < SF_LAYERS; l++) scene.net.layer[l].theta = scene.net.layer[l].theta ? 20000 : 0;
  return scene;
}

static void clear_column(fx_layer *layer, int o)
{
  for (int i = 0; i < layer->n_in; i++) layer->w[i * SF_LANES + o] = 0;
}

static void clear_row(fx_layer *layer, int i)
{
  memset(layer->w + (size_t)i * SF_LANES, 0, SF_LANES);
}

/* Silent neurons, neurons without fan-out, a chain of two, an unused output h, harmonics and a level without effect. */
static void spoil(fx_scene *scene)
{
  fx_layer *l = scene->net.layer;
  const int n_dir = fx_net_constants(&scene->net);
  clear_column(&l[FX_D1], 0), clear_column(&l[FX_C1], 5), clear_column(&l[FX_C2], 19); /* silent */
  clear_row(&l[FX_D2], 7), clear_row(&l[FX_C3], 3);                                    /* without fan-out */
  clear_row(&l[FX_C2], 9);
  l[FX_C2].w[9 * SF_LANES + 3] = 100;                               /* feeds only C2's 3 */
  clear_row(&l[FX_C1], n_dir + 1), clear_row(&l[FX_C1], n_dir - 1); /* h 2, the last harmonic */
  memset(scene->grid.table + 2 * scene->grid.offset[4], 0, 2 * (size_t)sf_grid_level_entries(&scene->grid, 4));
}

static void expect_dropped(const fx_scene *scene, const fx_scene *trimmed)
{
  static const int gone[SF_LAYERS] = {[FX_D1] = 2, [FX_D2] = 1, [FX_C1] = 2, [FX_C2] = 2};
  for (int l = FX_D1; l <= FX_C2; l++)
    ck_assert_int_le(trimmed->net.layer[l].n_out, scene->net.layer[l].n_out - gone[l]);
  ck_assert_int_lt(trimmed->grid.levels, scene->grid.levels);
  ck_assert_int_lt(trimmed->net.layer[FX_C1].n_in, scene->net.layer[FX_C1].n_in - 1);
}

LOOP_TEST(without_effect_changes_no_bit, 3)
{
  fx_scene scene = small_scene(11, _i), trimmed;
  spoil(&scene);
  sf_fit_rays rays = make_rays(&scene, RAYS, 0);
  sf_trim_use use;
  sf_trim trim;
  ck_ok(sf_trim_use_create(&use, &scene));
  ck_ok(sf_fit_observe(&scene, &rays, 0, RAYS, true, &use));
  sf_trim_all(&scene, &trim);
  ck_ok(sf_trim_apply(&scene, &trim, &use, "all", &trimmed));
  ck_assert_int_eq(trimmed.grid.entries, scene.grid.entries);
  ck_assert_mem_eq(trimmed.grid.table, scene.grid.table, 2 * (size_t)scene.grid.entries);
  fx_scene_free(&trimmed);
  sf_trim_exact(&scene, &use, &trim);
  ck_ok(sf_trim_apply(&scene, &trim, &use, "exact", &trimmed));
  ck_ok(fx_scene_check(&trimmed, "exact"));
  expect_dropped(&scene, &trimmed);
  assert_same_pixels(&scene, &trimmed, &rays);
  sf_trim_use_free(&use), sf_fit_rays_free(&rays), fx_scene_free(&scene), fx_scene_free(&trimmed);
}

/* A net that never fires keeps one neuron a layer. */
TEST(something_is_left_of_a_silent_net)
{
  OWNED(fx_scene) scene = small_scene(12, FX_HYBRID), trimmed;
  for (int l = 0; l < SF_LAYERS; l++) memset(scene.net.layer[l].w, 0, (size_t)scene.net.layer[l].n_in * SF_LANES);
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 0);
  const fx_scene *candidate[] = {&scene};
  const sf_fit_rays tiles = tiles_of(&rays);
  const sf_fit_job job = {.candidate = candidate,
                          .widths = widest,
                          .candidates = 1,
                          .rays = &rays,
                          .tiles = &tiles,
                          .technology = prices(),
                          .name = "silent"};
  sf_fit_report report;
  ck_ok(sf_fit(&trimmed, &job, &report));
  for (int l = FX_D1; l <= FX_C2; l++) ck_assert_int_eq(trimmed.net.layer[l].n_out, 1);
  ck_assert_int_eq(trimmed.grid.levels, 1);
  assert_same_pixels(&scene, &trimmed, &rays);
}

/* ---- tables ---- */

static void random_position(const fx_scene *scene, uint64_t i, uint32_t pos[3])
{
  const uint32_t side = (1u << SF_POS_FRAC) / (uint32_t)scene->occ_res, res = (uint32_t)scene->occ_res;
  uint32_t cell = (uint32_t)sf_random_below(8, 0, i, (uint64_t)res * res * res);
  while (!(scene->occupancy[cell >> 3] >> (cell & 7) & 1)) cell = (cell + 1) % (res * res * res);
  const uint32_t corner[3] = {cell % res, cell / res % res, cell / res / res};
  for (uint64_t a = 0; a < 3; a++) { /* the faces of the cell, too */
    const uint64_t inside = sf_random_below(9, a, i, side + side / 4);
    pos[a] = corner[a] * side + (uint32_t)(inside < side ? inside : i & 1 ? side - 1 : 0);
  }
}

TEST(corners_are_all_that_a_position_reads)
{
  OWNED(fx_scene) scene = small_scene(13, FX_HYBRID);
  int8_t *all = malloc(2 * (size_t)scene.grid.entries);
  memcpy(all, scene.grid.table, 2 * (size_t)scene.grid.entries);
  for (uint64_t i = 0; i < 200; i++) {
    int16_t f[32], g[32];
    uint32_t pos[3];
    random_position(&scene, i, pos);
    memcpy(scene.grid.table, all, 2 * (size_t)scene.grid.entries);
    fx_grid_features(&scene.grid, pos, f, NULL);
    memset(scene.grid.table, 0, 2 * (size_t)scene.grid.entries);
    for (int l = 0; l < scene.grid.levels; l++) {
      const sf_corners c = sf_grid_corners(&scene.grid, l, pos, pos);
      for (int n = 0; n < 8; n++) {
        ck_assert_uint_eq(c.last[n % 3], c.base[n % 3] + 1);
        const int64_t e =
            sf_grid_entry(&scene.grid, l, c.base[0] + (n & 1), c.base[1] + (n >> 1 & 1), c.base[2] + (n >> 2));
        memcpy(scene.grid.table + 2 * e, all + 2 * e, 2);
      }
    }
    fx_grid_features(&scene.grid, pos, g, NULL);
    ck_assert_mem_eq(f, g, 2 * (size_t)scene.grid.levels * sizeof *f);
  }
  free(all);
}

TEST(unread_entries_are_not_read)
{
  OWNED(fx_scene) scene = small_scene(14, FX_HYBRID);
  memset(scene.occupancy, 0, 64);
  scene.occupancy[9] = 0x21, scene.occupancy[40] = 0x80;
  int8_t *all = malloc(2 * (size_t)scene.grid.entries);
  memcpy(all, scene.grid.table, 2 * (size_t)scene.grid.entries);
  const int64_t zero = sf_grid_zero_unread(&scene);
  ck_assert_int_gt(zero, scene.grid.entries / 4);
  ck_assert_int_lt(zero, scene.grid.entries);
  int8_t *cleared = malloc(2 * (size_t)scene.grid.entries);
  memcpy(cleared, scene.grid.table, 2 * (size_t)scene.grid.entries);
  for (uint64_t i = 0; i < 2000; i++) {
    int16_t f[32], g[32];
    uint32_t pos[3];
    random_position(&scene, i, pos);
    memcpy(scene.grid.table, cleared, 2 * (size_t)scene.grid.entries);
    fx_grid_features(&scene.grid, pos, f, NULL);
    memcpy(scene.grid.table, all, 2 * (size_t)scene.grid.entries);
    fx_grid_features(&scene.grid, pos, g, NULL);
    ck_assert_mem_eq(f, g, 2 * (size_t)scene.grid.levels * sizeof *f);
  }
  free(all), free(cleared);
}

static bool corners_apart(const fx_grid *grid, int level, const uint32_t pos[3])
{
  const sf_corners c = sf_grid_corners(grid, level, pos, pos);
  int64_t entry[8];
  for (int n = 0; n < 8; n++) {
    entry[n] = sf_grid_entry(grid, level, c.base[0] + (n & 1), c.base[1] + (n >> 1 & 1), c.base[2] + (n >> 2));
    for (int m = 0; m < n; m++)
      if (entry[m] == entry[n]) return false;
  }
  return true;
}

/* What is used keeps its value in a smaller table, dense levels and hashed ones, unless it meets something used. */
TEST(smaller_tables_keep_what_is_used)
{
  fx_scene scene = small_scene(15, FX_HYBRID), small_one;
  int compared = 0;
  for (uint64_t i = 0; i < 60; i++) {
    int16_t f[32], g[32];
    uint32_t pos[3];
    sf_trim_use use;
    sf_trim trim;
    random_position(&scene, i, pos);
    ck_ok(sf_trim_use_create(&use, &scene));
    sf_trim_use_place(&use, &scene, pos, 0, 1000);
    sf_trim_all(&scene, &trim);
    for (int l = 0; l < scene.grid.levels; l++) trim.log2_size[l] = sf_trim_smaller(&scene, &trim, l);
    ck_ok(sf_trim_apply(&scene, &trim, &use, "smaller", &small_one));
    ck_ok(fx_scene_check(&small_one, "smaller"));
    ck_assert_int_lt(small_one.grid.entries, scene.grid.entries);
    fx_grid_features(&scene.grid, pos, f, NULL);
    fx_grid_features(&small_one.grid, pos, g, NULL);
    for (int l = 0; l < scene.grid.levels; l++) {
      if (!corners_apart(&small_one.grid, l, pos)) continue;
      compared++;
      ck_assert_mem_eq(f + 2 * l, g + 2 * l, 2 * sizeof *f);
    }
    sf_trim_use_free(&use), fx_scene_free(&small_one);
  }
  ck_assert_int_gt(compared, 200);
  fx_scene_free(&scene);
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
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report r;
  ck_ok(fit(candidate, 1, &rays, 0, &fitted, &r));
  expect_dropped(&scene, &fitted);
  assert_same_pixels(&scene, &fitted, &rays);
  ck_assert_uint_eq(r.before.sum.error, r.after.sum.error);
  ck_assert_uint_lt(r.after.energy_fj, r.before.energy_fj);
  ck_assert_uint_lt(r.after.bytes, r.before.bytes);
  for (int l = 0; l < SF_LAYERS; l++) ck_assert_int_eq(r.dropped[l], 0);
  ck_assert_int_eq(r.dropped_levels + r.smaller_tables, 0);
  ck_assert_int_eq(r.idle_levels, 1);
}

/* Measured here once more, through the file. */
TEST(the_bound_is_kept)
{
  OWNED(fx_scene) scene = small_scene(17, FX_HYBRID), fitted, loaded;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const fx_scene *candidate[] = {&scene};
  const double bound = 0.5;
  sf_fit_report r;
  sf_fit_sum before, after;
  ck_ok(fit(candidate, 1, &rays, bound, &fitted, &r));
  ck_ok(fx_scene_save(&fitted, in("fitted.snn")));
  ck_ok(fx_scene_load(&loaded, in("fitted.snn")));
  const uint64_t first = r.first_checked, end = first + r.checked;
  ck_ok(sf_fit_measure(&scene, &rays, first, end, NULL, &before));
  ck_ok(sf_fit_measure(&loaded, &rays, first, end, NULL, &after));
  ck_assert_uint_eq(before.error, r.before.sum.error);
  ck_assert_uint_eq(after.error, r.after.sum.error);
  ck_assert_mem_eq(&after.counts, &r.after.sum.counts, sizeof after.counts);
  ck_assert_double_le((double)after.error, (double)before.error * pow(10, bound / 10));
  ck_assert_double_le(r.loss_db, bound);
  ck_assert_uint_lt(r.after.energy_fj, r.before.energy_fj); /* the bound was used for something */
  ck_assert_uint_lt(r.after.bytes, r.before.bytes);
}

TEST(threads_do_not_matter)
{
  OWNED(fx_scene) scene = small_scene(18, FX_HYBRID), a, b;
  OWNED(sf_fit_rays) rays = make_rays(&scene, RAYS, 9000);
  const fx_scene *candidate[] = {&scene};
  sf_fit_report r, q;
  omp_set_num_threads(1);
  ck_ok(fit(candidate, 1, &rays, 0.3, &a, &r));
  omp_set_num_threads(3);
  ck_ok(fit(candidate, 1, &rays, 0.3, &b, &q));
  ck_assert_mem_eq(&r.after.sum, &q.after.sum, sizeof r.after.sum);
  ck_assert_int_eq(a.grid.entries, b.grid.entries);
  ck_assert_mem_eq(a.grid.table, b.grid.table, 2 * (size_t)a.grid.entries);
  for (int l = 0; l < SF_LAYERS; l++) {
    ck_assert_int_eq(a.net.layer[l].n_in, b.net.layer[l].n_in);
    ck_assert_mem_eq(a.net.layer[l].w, b.net.layer[l].w, (size_t)a.net.layer[l].n_in * SF_LANES);
  }
}

/* Of the candidates the last one that is good enough; all is measured against the first. */
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
  sf_fit_job job = {.candidate = candidate,
                    .widths = widest,
                    .candidates = 1,
                    .rays = &rays,
                    .tiles = &tiles,
                    .technology = prices(),
                    .name = "out.snn",
                    .tick = stop_at_once};
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
  sf_fit_rays rays = make_rays(&scene, RAYS, 500);
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
  sf_fit_rays_free(&rays);
}

TEST(bytes_and_loss_are_kept)
{
  fx_scene scene = small_scene(71, FX_HYBRID), smaller;
  sf_fit_rays rays = make_rays(&scene, RAYS, 500);
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
         "the grid cannot take fewer than 2 bytes");
  fx_scene_free(&scene);
  sf_fit_rays_free(&rays);
}

int ck_timeout = 120;
ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};

int main(void)
{
  omp_set_num_threads(1); /* many small parallel regions: threads would wait for each other on a busy machine */
  return ck_main();
}
