/* Trimming grids: what is left out without effect changes no bit, entries that nothing reads are found, smaller tables
 * keep what is used. */
#include "ck_run.h"
#include "src/quant/internal.h"
#include "tests/fit_grid_fixture.h"

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

static void features_of(fx_scene *scene, const int8_t *table, const uint32_t pos[3], int16_t *features)
{
  memcpy(scene->grid.table, table, 2 * (size_t)scene->grid.entries);
  fx_grid_features(&scene->grid, pos, features, NULL);
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
    features_of(&scene, all, pos, f);
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
    features_of(&scene, cleared, pos, f);
    features_of(&scene, all, pos, g);
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

/* ---- which parts are of use ---- */

/* The mean of the squared weights, in octaves, with one sample more of weight one; cells that no ray meets are of the
 * first class. */
TEST(classes_of_cells)
{
  const uint64_t one = (uint64_t)1 << 2 * SF_TRANS_FRAC;
  uint64_t visits[1], weight2[1];
  const sf_trim_use use = {.visits = visits, .weight2 = weight2, .cells = 1};
  const struct {
    uint64_t visits, weight2;
    int octave;
  } rows[] = {{0, 0, 0},
              {1, one, 0},
              {1, one - 1, 1},
              {1, 0, 1},
              {3, 3 * one, 0},
              {3, one, 1},
              {3, one - 1, 2},
              {7, 0, 3},
              {1023, 0, 10},
              {1023, one, 9},
              {(1 << 20) - 1, 0, 15},
              {(1 << 15) - 1, 0, 15},
              {(1 << 14) - 1, 0, 14}};
  for (int i = 0; i < COUNT(rows); i++) {
    *visits = rows[i].visits, *weight2 = rows[i].weight2;
    ck_assert_msg(sf_cell_class(&use, 0) == rows[i].octave, "row %d: %d", i, sf_cell_class(&use, 0));
  }
}

TEST(cells_go_by_class)
{
  OWNED(fx_scene) scene = small_scene(17, FX_HYBRID);
  const int64_t cells = sf_cells_of(&scene);
  uint8_t *left = malloc((size_t)cells / 8);
  OWNED(sf_trim_use) use;
  sf_trim trim;
  ck_ok(sf_trim_use_create(&use, &scene));
  for (int64_t cell = 0; cell < cells; cell++) use.visits[cell] = ((uint64_t)1 << cell % 6) - 1;
  sf_trim_all(&scene, &trim);
  sf_trim_cells(&scene, &trim, &use, left);
  ck_assert_mem_eq(left, scene.occupancy, (size_t)cells / 8);
  trim.cells[3] = trim.cells[0] = false;
  sf_trim_cells(&scene, &trim, &use, left);
  for (int64_t cell = 0; cell < cells; cell++) {
    const bool occupied = scene.occupancy[cell >> 3] >> (cell & 7) & 1, gone = cell % 6 == 0 || cell % 6 == 3;
    ck_assert((left[cell >> 3] >> (cell & 7) & 1) == (occupied && !gone));
  }
  free(left);
}

/* Neurons that fired, outputs of D2 whose h is not zero, inputs that are not. The first output of D2 is the density. */
TEST(use_of_a_net)
{
  OWNED(fx_scene) scene = small_scene(18, FX_HYBRID);
  OWNED(sf_trim_use) use;
  fx_trace *trace = calloc(1, sizeof *trace);
  int16_t f[64] = {0};
  ck_ok(sf_trim_use_create(&use, &scene));
  trace->spikes[FX_D1][0][0] = 2, trace->spikes[FX_D1][scene.net.steps - 1][0] = 6;
  trace->spikes[FX_C2][0][0] = 1;
  trace->current[FX_D2][0][0] = 1 << 20; /* density */
  trace->current[FX_D2][0][1] = 1 << SF_H_SHIFT, trace->current[FX_D2][0][2] = (1 << SF_H_SHIFT) - 1;
  trace->current[FX_D2][0][3] = -1;
  f[0] = 5, f[3] = -1;
  sf_trim_use_net(&use, &scene.net, f, trace);
  sf_trim_use_net(&use, &scene.net, f, trace);
  ck_assert_uint_eq(use.samples, 2);
  ck_assert_uint_eq(use.steps, 2 * (uint64_t)scene.net.steps);
  static const uint64_t d1[] = {0, 4, 2, 0}, d2[] = {0, 2, 0, 2, 0}, input[] = {2, 0, 0, 2, 0};
  ck_assert_mem_eq(use.fired[FX_D1], d1, sizeof d1);
  ck_assert_mem_eq(use.fired[FX_D2], d2, sizeof d2);
  ck_assert_mem_eq(use.feature, input, sizeof input);
  ck_assert_uint_eq(use.fired[FX_C2][0], 2);
  ck_assert_uint_eq(use.fired[FX_C2][1] + use.fired[FX_C1][0], 0);
  free(trace);
}

/* A neuron a layer stays; of D2, whose first output is the density, an h besides where C1 has no other input. */
TEST(what_stays_at_least)
{
  sf_trim trim = {.directions = 0};
  for (int layer = FX_D1; layer <= FX_C3; layer++)
    ck_assert_int_eq(sf_trim_least(&trim, layer), layer == FX_D2 ? 2 : 1);
  trim.directions = 3;
  for (int layer = FX_D1; layer <= FX_C3; layer++) ck_assert_int_eq(sf_trim_least(&trim, layer), 1);
}

/* A table of half the entries, down to one; a level that is dense has the next power of two below. */
TEST(the_next_smaller_table)
{
  OWNED(fx_scene) scene = small_scene(19, FX_HYBRID);
  sf_trim trim;
  sf_trim_all(&scene, &trim);
  for (int l = 0; l < scene.grid.levels; l++) {
    const int64_t entries = sf_grid_level_entries(&scene.grid, l);
    int size = sf_trim_smaller(&scene, &trim, l);
    ck_assert_int_lt((int64_t)1 << size, entries);
    ck_assert_int_ge((int64_t)2 << size, entries);
    for (; size >= 0; size--) {
      trim.log2_size[l] = size;
      ck_assert_int_eq(sf_trim_smaller(&scene, &trim, l), size - 1);
    }
  }
}

/* A table of one entry is hashed: it has no stride. */
TEST(a_table_of_one_entry)
{
  OWNED(fx_scene) scene = small_scene(20, FX_HYBRID), small_one;
  OWNED(sf_trim_use) use;
  sf_trim trim;
  ck_ok(sf_trim_use_create(&use, &scene));
  sf_trim_all(&scene, &trim);
  trim.log2_size[0] = 0;
  ck_ok(sf_trim_apply(&scene, &trim, &use, "one", &small_one));
  ck_assert_int_eq(small_one.grid.stride[0], 0);
  ck_assert_int_eq(small_one.grid.log2_size[0], 0);
  ck_assert_int_eq(small_one.grid.offset[1], 1);
  ck_assert_int_eq(sf_grid_level_entries(&small_one.grid, 0), 1);
}

/* What a position reads is of use: each of its corners by its weight and one more, its cell by the weight's square. */
TEST(use_of_a_place)
{
  OWNED(fx_scene) scene = small_scene(21, FX_HYBRID);
  OWNED(sf_trim_use) use;
  ck_ok(sf_trim_use_create(&use, &scene));
  uint64_t *wanted = calloc((size_t)scene.grid.entries, sizeof *wanted);
  for (uint64_t i = 0; i < 30; i++) {
    const uint32_t weight = (uint32_t)sf_random_below(22, 0, i, 1 << SF_TRANS_FRAC);
    uint32_t pos[3];
    random_position(&scene, i % 10, pos);
    sf_trim_use_place(&use, &scene, pos, 7, weight);
    for (int l = 0; l < scene.grid.levels; l++) {
      const sf_corners c = sf_grid_corners(&scene.grid, l, pos, pos);
      for (int n = 0; n < 8; n++)
        wanted[sf_grid_entry(&scene.grid, l, c.base[0] + (n & 1), c.base[1] + (n >> 1 & 1), c.base[2] + (n >> 2))] +=
            weight + 1;
    }
    ck_assert_uint_eq(use.visits[7], i + 1);
  }
  uint64_t squares = 0;
  for (uint64_t i = 0; i < 30; i++) {
    const uint64_t weight = sf_random_below(22, 0, i, 1 << SF_TRANS_FRAC);
    squares += weight * weight;
  }
  ck_assert_uint_eq(use.weight2[7], squares);
  ck_assert_uint_eq(use.visits[6] + use.weight2[6], 0);
  ck_assert_mem_eq(use.entry, wanted, (size_t)scene.grid.entries * sizeof *wanted);
  free(wanted);
}
