/* The occupancy grid of the hash grid's trainer: which cells an update looks at. */
#include "ck_run.h"
#include "train_fixture.h"

static void set_up(void)
{
  open_scene(4);
}

static bool occupied(const sf_trainer *t, size_t cell)
{
  return t->model.occupancy[cell / 8] >> cell % 8 & 1;
}

static size_t count_occupied(const sf_trainer *t)
{
  size_t n = 0;
  for (size_t i = 0; i < sf_config_cells(&t->model.config); i++) n += occupied(t, i);
  return n;
}

/* Before the first visit of all cells none is empty; that visit leaves no cell as it was. */
TEST(nothing_is_empty_before_it_was_looked_at)
{
  sf_train_options o = small_run();
  o.stage1 = 300;
  OWNED(trainer) t = start(&data, &o, NULL);
  const size_t cells = sf_config_cells(&t->model.config);
  for (int i = 0; i < 16; i++) {
    steps(t, 1);
    ck_assert_uint_eq(count_occupied(t), cells);
  }
  for (int sweep = 16; sweep <= 256; sweep *= 4) {
    while (t->iteration < sweep) steps(t, 1);
    for (size_t i = 0; i < cells; i++) t->density[i] = 1e9f; /* what nobody looks at stays large */
    steps(t, 1);
    for (size_t i = 0; i < cells; i++) ck_assert_float_lt(t->density[i], 1e8f);
  }
}

/* Some cells of a row are occupied, all others are taken for empty: an update finds all that touch them, and nothing of
 * another cascade. At the start the density is 1 everywhere, so what was looked at becomes occupied. row: a bit a cell.
 */
static void check_neighbours(int bound, unsigned row, int y, int z)
{
  sf_train_options o = small_run();
  sf_config_bound(&o.config, bound);
  o.config.finest_res = 64;
  OWNED(trainer) t = start(&data, &o, NULL);
  const int res = o.config.occ_res;
  const size_t cells = sf_config_cells(&o.config), first = ((size_t)z * (size_t)res + (size_t)y) * (size_t)res;
  const unsigned reached = row | row << 1 | row >> 1;
  size_t touching = 0, behind = 0; /* behind: where the next layer would be, were the cascades one grid */
  t->iteration = 32;
  memset(t->model.occupancy, 0, cells / 8);
  for (size_t b = 0; b < 2; b++) t->model.occupancy[first / 8 + b] = (uint8_t)(row >> 8 * b);
  ck_ok(sf_occupancy_update(t, 2));
  for (int k = z - 1; k <= z + 1; k++)
    for (int j = y - 1; j <= y + 1; j++)
      for (int i = 0; i < res; i++) {
        if (!(reached >> i & 1) || j < 0 || k < 0 || j == res) continue;
        const size_t cell = ((size_t)k * (size_t)res + (size_t)j) * (size_t)res + (size_t)i;
        if (k < res) ck_assert_msg(occupied(t, cell), "row %x: nobody looked at %d %d %d", row, i, j, k);
        if (k < res)
          touching++;
        else if (bound > 1)
          behind += occupied(t, cell);
      }
  /* Beside them an update looks at 1/32 of one cascade's cells, anywhere. */
  ck_assert_uint_le(count_occupied(t), touching + (size_t)(res * res * res) / 32);
  ck_assert_uint_ge(count_occupied(t), (size_t)(res * res * res) / 32);
  ck_assert_uint_lt(behind, 5);
}

TEST(neighbours_of_what_is_occupied_are_looked_at)
{
  check_neighbours(1, 1u << 7, 8, 9);
  check_neighbours(1, 1u << 0, 0, 0);
  check_neighbours(1, 1u << 15, 15, 15);
  check_neighbours(4, 1u << 5, 6, 15);
  check_neighbours(1, 0x00c0, 8, 9); /* two side by side */
  check_neighbours(1, 0x0183, 8, 9); /* four, of two bytes */
  check_neighbours(1, 0x8180, 15, 0);
}

enum { FINE = 256, YOUNG = 128 };

static size_t cell_at(int x, int y, int z)
{
  return ((size_t)z * FINE + (size_t)y) * FINE + (size_t)x;
}

/* An update of FINE cells per axis of which only the cube of `side` at (x, y, z) is occupied. All others have density
 * 0, and what is looked at has 1. */
static void update_around(sf_trainer *t, int side, int x, int y, int z)
{
  const size_t cells = sf_config_cells(&t->model.config);
  t->iteration = 32;
  memset(t->density, 0, cells * sizeof *t->density);
  memset(t->model.occupancy, 0, cells / 8);
  for (int i = 0; i < side * side * side; i++) {
    const size_t cell = cell_at(x + i % side, y + i / side % side, z + i / side / side);
    t->model.occupancy[cell / 8] |= (uint8_t)(1u << cell % 8);
  }
  ck_ok(sf_occupancy_update(t, 2));
}

static void check_cube(const sf_trainer *t, int side, int x, int y, int z)
{
  for (int k = -side; k < 2 * side; k++)
    for (int j = -side; j < 2 * side; j++)
      for (int i = -side; i < 2 * side; i++)
        ck_assert_msg(occupied(t, cell_at(x + i, y + j, z + k)), "cell %d %d %d", x + i, y + j, z + k);
}

/* Until the lattice is settled, cubes of eight cells are one. Then each is a cell, and updates look at as many. */
TEST(cells_are_split_halfway)
{
  sf_train_options o = small_run();
  o.config.occ_res = FINE;
  OWNED(trainer) t = start(&data, &o, NULL);
  const size_t cells = sf_config_cells(&o.config), looked_at = (size_t)YOUNG * YOUNG * YOUNG / 32;
  t->progress = 0.49;
  update_around(t, 2, 14, 100, 202);
  check_cube(t, 2, 14, 100, 202);
  size_t alike = 0;
  for (int z = 0; z < FINE; z += 2)
    for (int y = 0; y < FINE; y += 2)
      for (int x = 0; x < FINE; x += 2) {
        int n = 0;
        for (int i = 0; i < 8; i++) n += occupied(t, cell_at(x + i % 2, y + i / 2 % 2, z + i / 4));
        ck_assert(n == 0 || n == 8);
        alike += n == 8;
      }
  ck_assert_uint_ge(alike, looked_at);
  ck_assert_uint_le(alike, looked_at + 27);
  t->progress = 0.5;
  update_around(t, 1, 15, 101, 202);
  check_cube(t, 1, 15, 101, 202);
  ck_assert_uint_ge(count_occupied(t), looked_at);
  ck_assert_uint_le(count_occupied(t), looked_at + 27);
  /* The mean is that of the cubes' largest: 4 less what was looked at, not a quarter of 7. */
  for (size_t i = 0; i < cells; i++) t->density[i] = i / FINE % 2 || i / FINE / FINE % 2 ? 0 : i % 2 ? 3 : 4;
  t->iteration = 272;
  ck_ok(sf_occupancy_update(t, 2));
  size_t threes = 0;
  for (size_t i = 1; i < cells; i += 2) threes += occupied(t, i);
  ck_assert_uint_ge(count_occupied(t), cells / 10);
  ck_assert_uint_eq(threes, 0);
  for (int old = 0; old < 2; old++) { /* what was seen before the split is soon forgotten */
    t->progress = old ? 0.7 : 0.69;
    for (size_t i = 0; i < cells; i++) t->density[i] = 100;
    ck_ok(sf_occupancy_update(t, 2));
    float least = 100;
    for (size_t i = 0; i < cells; i++) least = fminf(least, t->density[i]);
    ck_assert_float_eq_tol(least, (old ? 90.25f : 25), 1e-3f); /* some are looked at twice */
  }
}

/* Shares of the mean density that two thirds of the cells have: before the last sweep a quarter of it is enough. An
 * update looks at few cells, and finds 1 there. */
TEST(little_is_called_empty_while_the_field_is_young)
{
  const sf_train_options o = small_run();
  const size_t cells = sf_config_cells(&o.config);
  for (int old = 0; old < 2; old++) {
    OWNED(trainer) t = start(&data, &o, NULL);
    size_t kept[3] = {0};
    t->iteration = old ? 272 : 240;
    for (size_t i = 0; i < cells; i++) t->density[i] = (const float[]){0.4f, 0.1f, 2.5f}[i % 3];
    ck_ok(sf_occupancy_update(t, 2));
    for (size_t i = 0; i < cells; i++) kept[i % 3] += occupied(t, i);
    const double most = 0.9 * (double)cells / 3, few = 0.2 * (double)cells / 3;
    ck_assert_msg(old ? (double)kept[0] < few : (double)kept[0] > most, "0.4 of the mean: %zu of %zu", kept[0],
                  cells / 3);
    ck_assert_msg((double)kept[1] < few, "0.1 of the mean: %zu of %zu", kept[1], cells / 3);
    ck_assert_msg((double)kept[2] > most, "2.5 of the mean: %zu of %zu", kept[2], cells / 3);
  }
}

ck_options ck_program = {.set_up_all = set_up, .tear_down_all = close_scene, .one_process = true};
