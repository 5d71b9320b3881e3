/* The emulated system with TensoRF scenes: the accelerator makes pixels of positions, and reads planes and lines from
 * the system's memory. The firmware against the core, and with an accelerator, a bus or an image that is not as it
 * should be.
 */
#include "tests/soc_fixture.h"
#include "tests/fx_tensorf_fixture.h"

static void replace(scenario *other)
{
  if (s) free_scenario(s);
  s = other;
}

/* Features large enough everywhere to be seen in the pixels. */
static fx_scene scene_with_features(void)
{
  fx_scene scene = tensorf_scene();
  scene.tensorf.feature_in.shift = 20;
  fx_factors *appearance = &scene.tensorf.appearance;
  for (int pair = 0; pair < FX_PAIRS; pair++)
    for (int i = 0; i < 7 * 8 * 2; i++) appearance->plane[pair][i] = (int8_t)(i * 37 % 100);
  return scene;
}

static void set_up(void)
{
  s = make_scenario_of(scene_with_features());
}

static void tear_down(void)
{
  free_scenario(s);
}

/* Long rays that end far from their last point: by their light, or by the number of their samples. */
static scenario *that_ends_early(int max_samples)
{
  scenario *dense = calloc(1, sizeof *dense);
  uint64_t points = 0;
  dense->scene = tensorf_scene();
  dense->scene.tensorf.sigma_out = (fx_scale){60000, 18, 0};
  dense->scene.max_samples = max_samples;
  make_rays(dense);
  for (int i = 0; i < PIXELS - 1; i++) {
    for (int axis = 0; axis < 3; axis++) dense->ray[i].step[axis] /= 20;
    points += (uint64_t)(dense->ray[i].count = 300);
  }
  finish_scenario(dense);
  ck_assert_uint_lt(4 * dense->counts.field_samples, points);
  return dense;
}

LOOP_TEST(the_firmware_renders_planes, 6)
{
  same_as_core(_i / 2 == 0   ? make_scenario_of(scene_with_features())
               : _i / 2 == 1 ? that_ends_early(1024)
                             : that_ends_early(3),
               30 * (_i % 2));
}

/* Under a right checksum. */
TEST(wrong_entries_of_a_plane_are_seen)
{
  const uint32_t lines = ((const sf_tile_header *)s->image)->lines;
  for (uint32_t i = 0; i < 9 * 8; i++) s->image[lines + SF_LINE_BYTES * i] ^= 0x40; /* of the first density plane */
  seal(s);
  expect_difference(HONEST, 0, 0);
}

TEST(a_wrong_row_of_the_basis_is_seen)
{
  const uint32_t planes = ((const sf_tile_header *)s->image)->planes;
  for (uint32_t i = 0; i < SF_PLANES_FEATURES; i++) s->image[planes + 4 * SF_PLANES_WORDS + i] ^= 0x40;
  seal(s);
  expect_difference(HONEST, 0, 0);
}

TEST(planes_need_their_accelerator)
{
  s->rays = false;
  expect_line(HONEST, 0, 0, "error: load planes: ");
}

TEST(samples_need_their_accelerator)
{
  fx_scene grid = fixture_scene(&fixture_ingp, 5);
  memset(grid.occupancy, 0xf7, 64);
  replace(make_scenario_of(grid));
  s->rays = true;
  ck_bad(run_firmware(), SF_E_UNSUPPORTED, "of 4 bytes at 0x4001000c, where there is nothing", "");
}

static const struct {
  bus_fault fault;
  uint32_t offset, to;
  const char *line;
} wrong_device[] = {
    {READ_AS, SF_CSR_FIELD_KINDS, SF_CSR_FIELD_KINDS_GRID, "error: load planes: "},
    {READ_AS, SF_CSR_C1_N_IN, 7, "error: load planes: "},
    {REPLACE, SF_CSR_RAY_MAX_SAMPLES, 0, "error: load planes: programming refused: VALUE: "},
    {REDIRECT, SF_CSR_RAY_BACKGROUND_R, SF_CSR_RAY_STATUS, "error: load planes: programming refused: ADDRESS: "},
    {LOSE, SF_CSR_RAY_CTRL, 0, "error: render: no answer\n"},
};

LOOP_TEST(a_wrong_device_is_reported, COUNT(wrong_device))
{
  replace(that_ends_early(1024)); /* of more points than the FIFO takes */
  expect_line(wrong_device[_i].fault, wrong_device[_i].offset, wrong_device[_i].to, wrong_device[_i].line);
}

static const struct {
  bus_fault fault;
  uint32_t offset, to;
} wrong_write[] = {{LOSE_ONE, SF_CSR_ENCODER_DATA, 40}, /* of the basis */

                   {REPLACE, SF_CSR_RAY_TRANS_STOP, (1 << 20) - 1},
                   {REPLACE, SF_CSR_RAY_MAX_SAMPLES, 1},
                   {REPLACE, SF_CSR_RAY_BACKGROUND_R, 77},
                   {REPLACE, SF_CSR_FIELD_BASE, SF_SOC_IMAGE}};

LOOP_TEST(a_driver_that_writes_wrongly_is_seen, COUNT(wrong_write))
{
  expect_difference(wrong_write[_i].fault, wrong_write[_i].offset, wrong_write[_i].to);
}

TEST(a_field_beyond_the_memory_is_seen)
{
  fault = REPLACE, s->offset = SF_CSR_FIELD_BASE, s->to = 0x1000;
  ck_bad(run_firmware(), SF_E_UNSUPPORTED, "accelerator: a line beyond the memory at cycle", "");
}

/* ---- images ---- */

/* As test_soc.c, which has the words that both kinds of field have. */
TEST(planes_stay_inside_their_image)
{
  static const uint32_t extreme[] = {0x7ffffff, 0xfffffff, 0x7fffffff, 0x80000000, 0xfffffff8, 0xffffffff};
  enum { ARRAYS = 18, HEADER_TABLE = 8, HEADER_LEVELS = 11, HEADER_ENTRIES = 12, HEADER_PLANES = 16, HEADER_LINES };
  static const int of_field[] = {HEADER_TABLE, HEADER_LEVELS, HEADER_ENTRIES, HEADER_PLANES, HEADER_LINES};
  const size_t space = sf_tile_pixels_at((uint32_t)s->image_size) + sizeof s->core;
  const int planes = (int)((const sf_tile_header *)s->image)->planes / 4;
  uint8_t *block = malloc(space);
  ck_assert_ptr_null(open_edited(s, block, space, -1, 0));
  for (size_t i = 0; i < COUNT(extreme); i++) {
    for (int word = 0; word < SF_PLANES_WORDS; word++)
      if (word < 3 || word >= ARRAYS)
        ck_assert_str_eq(open_edited(s, block, space, planes + word, extreme[i]), "field or occupancy do not fit");
    for (size_t w = 0; w < COUNT(of_field); w++)
      ck_assert_str_eq(open_edited(s, block, space, of_field[w], extreme[i]), "field or occupancy do not fit");
  }
  ck_assert_str_eq(open_edited(s, block, space, planes, 0), "field or occupancy do not fit");
  ck_assert_str_eq(open_edited(s, block, space, HEADER_PLANES, 0), "field or occupancy do not fit");
  free(block);
}

ck_options ck_program = {.set_up = set_up, .tear_down = tear_down};
