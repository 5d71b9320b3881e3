/* Scenes and samples of the C library against the core behind it; every refusal is a value that names what is wrong. */
#include "ck_run.h"
#include "energy/energy.h"
#include "base/io.h"
#include "tests/fx_tensorf_fixture.h"
#include "tests/lib_fixture.h"
#include <locale.h>

/* ---- scenes ---- */

TEST(info_says_what_the_scene_is)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    ck_assert_int_eq(info.inputs[l], core.net.layer[l].n_in);
    ck_assert_int_eq(info.outputs[l], core.net.layer[l].n_out);
    ck_assert_int_eq(info.theta[l], fx_net_theta(&core.net, l));
    ck_assert_int_eq(info.leak_q12[l], core.net.layer[l].k);
  }
  ck_assert_int_eq(info.mode, SPIKEFIELD_HYBRID);
  ck_assert_int_eq(info.steps, 4);
  ck_assert_int_eq(info.features, 32);
  ck_assert_int_eq(info.directions, 16);
  ck_assert_int_eq(info.grid_levels, 16);
  ck_assert_int_eq(info.grid_entries, core.grid.entries);
  ck_assert_int_eq(info.grid_bytes, 2 * core.grid.entries);
  ck_assert_int_eq(info.weight_bytes, 32 * 128 + 128 * 16 + 31 * 128 + 128 * 128 + 128 * 3);
  ck_assert_int_eq(info.occupancy_bytes, 64);
  ck_assert_int_eq(info.background_q16[1], 30000);
  ck_assert(info.to_box_scale == 0.5 && info.to_box_offset[2] == 0.5 && info.direction_lsb == 0x1p-10);
  ck_assert(info.step == 2 * 300000 / 16777216.0);
  ck_assert_str_eq(spikefield_version(), SPIKEFIELD_VERSION);
  char parts[32];
  snprintf(parts, sizeof parts, "%d.%d.%d", SPIKEFIELD_VERSION_MAJOR, SPIKEFIELD_VERSION_MINOR,
           SPIKEFIELD_VERSION_PATCH);
  ck_assert_str_eq(parts, SPIKEFIELD_VERSION);
}

TEST(memory_and_file_give_the_same_scene)
{
  size_t size;
  char *data = read_whole(in("s.snn"), &size);
  spikefield_scene *copy;
  spikefield_scene_info other;
  lib_good(spikefield_scene_open_memory(&copy, data, size, "copy"));
  memset(data, 0, size); /* nothing of the caller is kept */
  lib_good(spikefield_scene_describe(copy, &other));
  ck_assert_int_eq(other.grid_entries, info.grid_entries);
  spikefield_pixel a, b;
  const float origin[3] = {0.3f, -3, 0.2f}, direction[3] = {0, 1, 0};
  lib_good(spikefield_rays(scene, NULL, origin, direction, 1, &a, NULL));
  lib_good(spikefield_rays(copy, NULL, origin, direction, 1, &b, NULL));
  ck_assert_uint_gt(a.samples, 0);
  ck_assert_mem_eq(a.colour, b.colour, sizeof a.colour);
  spikefield_scene_close(copy);
  free(data);
}

TEST(damaged_scenes_are_refused)
{
  size_t size;
  char *data = read_whole(in("s.snn"), &size);
  spikefield_scene *none = scene;
  lib_bad(spikefield_scene_open(&none, in("absent")), SPIKEFIELD_E_IO, "absent");
  ck_assert_ptr_null(none);
  static const double part[] = {0, 0.01, 0.5, 0.9999};
  for (int i = 0; i < 4; i++) {
    none = scene;
    lib_bad(spikefield_scene_open_memory(&none, data, (size_t)((double)size * part[i]), "cut"), SPIKEFIELD_E_FORMAT,
            "cut: ");
    ck_assert_ptr_null(none);
  }
  data[size - 1] ^= 1;
  lib_bad(spikefield_scene_open_memory(&none, data, size, NULL), SPIKEFIELD_E_FORMAT, "memory: ");
  free(data);
}

/* A locale whose numbers have a comma: the machine's, else one made for the occasion where localedef can. */
static bool comma_locale(void)
{
  static const char *const names[] = {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "fr_FR"};
  char command[400];
  for (int i = 0; i < 4; i++)
    if (setlocale(LC_ALL, names[i])) return true;
  snprintf(command, sizeof command, "localedef -i de_DE -f UTF-8 '%s' >/dev/null 2>&1", in("de_DE.UTF-8"));
  const int status = system(command);
  setenv("LOCPATH", folder, 1);
  return status == 0 && setlocale(LC_ALL, "de_DE.UTF-8");
}

TEST(the_locale_of_the_host_does_not_matter)
{
  spikefield_scene *again;
  spikefield_scene_info other;
  char number[8];
  if (!comma_locale()) return;
  snprintf(number, sizeof number, "%.1f", 0.5);
  ck_assert_str_eq(number, "0,5");
  lib_good(spikefield_scene_open(&again, in("s.snn")));
  lib_good(spikefield_scene_describe(again, &other));
  ck_assert(other.to_box_scale == info.to_box_scale && other.step == info.step);
  snprintf(number, sizeof number, "%.1f", 0.5);
  ck_assert_str_eq(number, "0,5"); /* the host's locale is as it was */
  spikefield_scene_close(again);
  setlocale(LC_ALL, "C");
}

/* ---- samples ---- */

enum { SAMPLES = 20 };

static void random_positions(uint32_t *position, uint64_t seed)
{
  for (uint64_t i = 0; i < 3 * SAMPLES; i++) position[i] = (uint32_t)sf_random_below(seed, 7, i, 1 << 24);
}

TEST(samples_are_those_of_the_core)
{
  static spikefield_trace traces[SAMPLES];
  static fx_trace trace;
  uint32_t position[3 * SAMPLES];
  int16_t feature[SAMPLES * 32], expected[32], harmonics[SPIKEFIELD_DIRECTIONS];
  int32_t base[SF_LANES];
  spikefield_sample a[SAMPLES], b[SAMPLES];
  spikefield_counts counts = {0}, at = {0};
  fx_counts wanted = {0};
  const float direction[3] = {0.3f, -2, 1};
  random_positions(position, 1);
  for (int steps = 0; steps <= SF_T_MAX; steps += 4) {
    const spikefield_options options = {.steps = steps};
    fx_net net = core.net;
    if (steps) net.steps = steps;
    lib_good(spikefield_direction(scene, direction, harmonics));
    lib_good(spikefield_features(scene, position, SAMPLES, feature, &counts));
    lib_good(spikefield_samples(scene, &options, harmonics, feature, SAMPLES, a, traces, &counts));
    lib_good(spikefield_samples_at(scene, &options, harmonics, position, SAMPLES, b, NULL, &at));
    fx_net_direction(&net, harmonics, base, &wanted);
    for (int i = 0; i < SAMPLES; i++) {
      fx_out out;
      fx_grid_features(&core.grid, position + 3 * i, expected, &wanted);
      ck_assert_mem_eq(feature + 32 * i, expected, sizeof expected);
      fx_net_sample(&net, expected, base, &out, &trace, &wanted);
      ck_assert(a[i].density == out.sigma && b[i].density == out.sigma);
      ck_assert_mem_eq(a[i].colour, out.colour, sizeof out.colour);
      ck_assert_mem_eq(b[i].colour, out.colour, sizeof out.colour);
      ck_assert_mem_eq(&traces[i], &trace, sizeof trace);
    }
    ck_assert_mem_eq(&counts, &wanted, sizeof wanted);
    ck_assert_mem_eq(&at, &wanted, sizeof wanted);
  }
  ck_assert_uint_gt(wanted.layer[FX_C2].sop[7], 0);
  ck_assert_uint_eq(spikefield_energy_fj(&counts), sf_energy_fj(&wanted));
  ck_assert_uint_gt(spikefield_energy_fj(&counts), 0);
  ck_assert_uint_eq(spikefield_relu_energy_fj(scene, 7), 7 * UINT64_C(4600) * (uint64_t)info.weight_bytes);
}

TEST(the_tap_shows_rows_and_membranes_after_reset)
{
  static spikefield_trace trace[SAMPLES];
  uint32_t position[3 * SAMPLES];
  const int16_t harmonics[SPIKEFIELD_DIRECTIONS] = {100, -50};
  spikefield_sample sample[SAMPLES];
  spikefield_shown shown;
  int fired_at_all = 0;
  random_positions(position, 2);
  lib_good(spikefield_samples_at(scene, NULL, harmonics, position, SAMPLES, sample, trace, NULL));
  for (int i = 0; i < SAMPLES * info.steps; i++) {
    const spikefield_trace *of = &trace[i / info.steps];
    const int t = i % info.steps;
    for (int l = FX_D1; l <= FX_C2; l += l == FX_D1 ? 2 : 1) {
      lib_good(spikefield_trace_shown(scene, NULL, of, l, t, &shown));
      ck_assert_mem_eq(shown.spikes, of->spikes[l][t], sizeof shown.spikes);
      for (int n = 0; n < info.outputs[l]; n++) {
        const int fired = of->spikes[l][t][n / 64] >> (n % 64) & 1;
        ck_assert_int_eq(shown.membrane[n], of->membrane[l][t][n] - fired * info.theta[l]);
        fired_at_all += fired;
      }
    }
    ck_assert_mem_eq(shown.rows, of->spikes[FX_C1][t], sizeof shown.rows);
    lib_good(spikefield_trace_shown(scene, NULL, of, FX_D2, 0, &shown));
    for (int word = 0; word < SPIKEFIELD_LANES / 64; word++)
      ck_assert_uint_eq(of->spikes[FX_D1][t][word] & ~shown.rows[word], 0);
    ck_assert_int_eq(shown.membrane[0], 0);
  }
  ck_assert_int_gt(fired_at_all, 0);
  lib_bad(spikefield_trace_shown(scene, NULL, NULL, 0, 0, &shown), SPIKEFIELD_E_USAGE, "trace is NULL");
  lib_bad(spikefield_trace_shown(scene, NULL, trace, 5, 0, &shown), SPIKEFIELD_E_RANGE, "layer is 5, expected 0..4");
  lib_bad(spikefield_trace_shown(scene, NULL, trace, 0, -1, &shown), SPIKEFIELD_E_RANGE, "step is -1");
}

TEST(the_window_of_counters_has_every_event_at_its_place)
{
  spikefield_counts counts = {.samples = 7, .rays = 3};
  uint64_t window[SPIKEFIELD_COUNTERS], sum = 0;
  counts.layer[SPIKEFIELD_C2].sop[2] = 11;
  counts.layer[SPIKEFIELD_C3].special[7] = 13;
  spikefield_counter_window(scene, &counts, window);
  ck_assert_uint_eq(window[(1 * 8 + 3) * 8 + 2], 11);
  ck_assert_uint_eq(window[(7 * 8 + 4) * 8 + 7], 13);
  ck_assert_uint_eq(window[7 * 8], 7);
  ck_assert_uint_eq(window[7 * 8 + 1], 3);
  for (int at = 0; at < SPIKEFIELD_COUNTERS; at++) sum += window[at];
  ck_assert_uint_eq(sum, 7 + 3 + 11 + 13);
  spikefield_counter_window(scene, NULL, window);
  ck_assert_int_eq(spikefield_lanes(), SF_LANES);
}

TEST(samples_of_a_decoder_are_of_one_ray_too)
{
  OWNED(fx_scene) with_decoder = tensorf_scene();
  spikefield_scene *decoder;
  spikefield_counts counts = {0};
  spikefield_sample sample[3];
  const int16_t harmonics[SPIKEFIELD_DIRECTIONS] = {0};
  int16_t feature[3 * SF_DIR_MAX] = {0};
  ck_ok(fx_scene_save(&with_decoder, in("decoder.snn")));
  lib_good(spikefield_scene_open(&decoder, in("decoder.snn")));
  lib_good(spikefield_samples(decoder, NULL, harmonics, feature, 3, sample, NULL, &counts));
  ck_assert_uint_eq(counts.samples, 3);
  ck_assert_uint_eq(counts.rays, 1);
  lib_good(spikefield_samples(decoder, NULL, harmonics, feature, 0, sample, NULL, &counts));
  ck_assert_uint_eq(counts.rays, 1);
  uint64_t window[SPIKEFIELD_COUNTERS];
  spikefield_counter_window(decoder, &counts, window);
  ck_assert_uint_eq(window[7 * 8], 3);
  ck_assert_uint_eq(window[7 * 8 + 1], 0);
  spikefield_scene_close(decoder);
}

/* The core's density and decoder at the same places; without a direction its inputs alone are missing. */
TEST(samples_by_position_of_a_decoder)
{
  OWNED(fx_scene) with_field = tensorf_scene();
  const fx_tensorf *field = &with_field.tensorf;
  const int inputs = fx_tensorf_inputs(field), waves = 6 * field->view_freqs;
  const float direction[3] = {3, -2, 1};
  spikefield_scene *decoder;
  spikefield_counts counts = {0};
  spikefield_sample sample[SAMPLES];
  fx_counts wanted = {.rays = 1};
  uint32_t position[3 * SAMPLES];
  int16_t harmonics[SPIKEFIELD_DIRECTIONS], x[SF_DIR_MAX];
  static int16_t feature[SAMPLES * SF_DIR_MAX];
  int32_t base[SF_LANES];
  uint64_t sum = 0;
  random_positions(position, 5);
  ck_ok(fx_scene_save(&with_field, in("positions.snn")));
  lib_good(spikefield_scene_open(&decoder, in("positions.snn")));
  lib_good(spikefield_direction(decoder, direction, harmonics));
  ck_assert(harmonics[0] == 13136 && harmonics[1] == -8758 && harmonics[2] == 4379 && harmonics[3] == 0);
  lib_good(spikefield_features(decoder, position, SAMPLES, feature, NULL));
  lib_good(spikefield_samples_at(decoder, NULL, harmonics, position, SAMPLES, sample, NULL, &counts));
  for (int i = 0; i < SAMPLES; i++) {
    fx_out out;
    const uint32_t sigma = fx_tensorf_density(field, position + 3 * i, &wanted);
    fx_tensorf_encode(field, position + 3 * i, harmonics, x, &wanted);
    fx_net_next(&with_field.net, NULL, i == 0, x, base, &out, NULL, &wanted);
    ck_assert_uint_eq(sample[i].density, sigma);
    ck_assert_mem_eq(sample[i].colour, out.colour, sizeof out.colour);
    memset(x + field->features, 0, 3 * sizeof *x), memset(x + inputs - waves, 0, (size_t)waves * sizeof *x);
    ck_assert_mem_eq(feature + i * inputs, x, (size_t)inputs * sizeof *x);
    sum += sigma;
  }
  ck_assert_uint_gt(sum, 0);
  ck_assert_mem_eq(&counts, &wanted, sizeof wanted);
  harmonics[1] = -16385;
  lib_bad(spikefield_samples_at(decoder, NULL, harmonics, position, 1, sample, NULL, NULL), SPIKEFIELD_E_RANGE,
          "harmonic 1 of sample 0 is -16385, expected -16384..16384");
  spikefield_scene_close(decoder);
}

TEST(positions_and_directions_are_rounded_once)
{
  const float middle[3] = {0, 0, 0}, corner[3] = {-1, -1, -1}, inside[3] = {0.25f, -0.5f, 0.999999f};
  const float outside[][3] = {{1, 0, 0}, {0, -1.0001f, 0}, {0, 0, NAN}, {INFINITY, 0, 0}};
  uint32_t box[3];
  lib_good(spikefield_position(scene, middle, box));
  for (int a = 0; a < 3; a++) ck_assert_uint_eq(box[a], 1u << 23);
  lib_good(spikefield_position(scene, corner, box));
  for (int a = 0; a < 3; a++) ck_assert_uint_eq(box[a], 0);
  lib_good(spikefield_position(scene, inside, box));
  for (int a = 0; a < 3; a++) ck_assert_uint_eq(box[a], (uint32_t)floor(((double)inside[a] / 2 + 0.5) * 16777216));
  for (int i = 0; i < 4; i++) lib_bad(spikefield_position(scene, outside[i], box), SPIKEFIELD_E_RANGE, "position");
  int16_t one[SPIKEFIELD_DIRECTIONS], two[SPIKEFIELD_DIRECTIONS];
  const float d[3] = {0.5f, -0.25f, 0.125f}, longer[3] = {4, -2, 1}, zero[3] = {0};
  fx_ray ray;
  ck_ok(sf_fx_ray_make(&core, middle, d, &ray));
  lib_good(spikefield_direction(scene, d, one));
  lib_good(spikefield_direction(scene, longer, two));
  ck_assert_mem_eq(one, ray.dir, sizeof one);
  ck_assert_mem_eq(two, ray.dir, sizeof two);
  lib_bad(spikefield_direction(scene, zero, one), SPIKEFIELD_E_RANGE, "nonzero direction");
}

/* ---- refusals ---- */

TEST(null_is_refused_by_name)
{
  const spikefield_camera camera = make_camera();
  const float v[3] = {0, 0, 1};
  int16_t harmonics[SPIKEFIELD_DIRECTIONS] = {0}, feature[32] = {0};
  uint32_t position[3] = {0};
  spikefield_sample sample;
  spikefield_pixel pixel;
  spikefield_scene *none = scene;
  lib_bad(spikefield_scene_open(NULL, "x"), SPIKEFIELD_E_USAGE, "scene is NULL");
  lib_bad(spikefield_scene_open(&none, NULL), SPIKEFIELD_E_USAGE, "path is NULL");
  ck_assert_ptr_null(none);
  none = scene;
  lib_bad(spikefield_scene_open_memory(&none, NULL, 3, "x"), SPIKEFIELD_E_USAGE, "data is NULL");
  ck_assert_ptr_null(none);
  lib_bad(spikefield_scene_describe(NULL, &info), SPIKEFIELD_E_USAGE, "scene is NULL");
  lib_bad(spikefield_scene_describe(scene, NULL), SPIKEFIELD_E_USAGE, "info is NULL");
  lib_bad(spikefield_position(scene, NULL, position), SPIKEFIELD_E_USAGE, "model is NULL");
  lib_bad(spikefield_direction(NULL, v, harmonics), SPIKEFIELD_E_USAGE, "scene is NULL");
  lib_bad(spikefield_features(scene, NULL, 1, feature, NULL), SPIKEFIELD_E_USAGE, "positions is NULL");
  lib_bad(spikefield_features(scene, position, 1, NULL, NULL), SPIKEFIELD_E_USAGE, "features is NULL");
  lib_bad(spikefield_samples(scene, NULL, NULL, feature, 1, &sample, NULL, NULL), SPIKEFIELD_E_USAGE,
          "harmonics is NULL");
  lib_bad(spikefield_samples(scene, NULL, harmonics, NULL, 1, &sample, NULL, NULL), SPIKEFIELD_E_USAGE,
          "features is NULL");
  lib_bad(spikefield_samples(scene, NULL, harmonics, feature, 1, NULL, NULL, NULL), SPIKEFIELD_E_USAGE,
          "samples is NULL");
  lib_bad(spikefield_samples_at(scene, NULL, harmonics, NULL, 1, &sample, NULL, NULL), SPIKEFIELD_E_USAGE,
          "positions is NULL");
  lib_bad(spikefield_rays(NULL, NULL, v, v, 1, &pixel, NULL), SPIKEFIELD_E_USAGE, "scene is NULL");
  lib_bad(spikefield_rays(scene, NULL, NULL, v, 1, &pixel, NULL), SPIKEFIELD_E_USAGE, "origins is NULL");
  lib_bad(spikefield_rays(scene, NULL, v, NULL, 1, &pixel, NULL), SPIKEFIELD_E_USAGE, "directions is NULL");
  lib_bad(spikefield_rays(scene, NULL, v, v, 1, NULL, NULL), SPIKEFIELD_E_USAGE, "pixels is NULL");
  lib_bad(spikefield_frame(scene, NULL, NULL, &pixel, NULL), SPIKEFIELD_E_USAGE, "camera is NULL");
  lib_bad(spikefield_frame(scene, NULL, &camera, NULL, NULL), SPIKEFIELD_E_USAGE, "pixels is NULL");
  lib_bad(spikefield_ray_taps(scene, NULL, v, v, NULL, NULL, &pixel, NULL), SPIKEFIELD_E_USAGE, "tap is NULL");
  spikefield_scene_close(NULL);
  lib_good(spikefield_rays(scene, NULL, NULL, NULL, 0, NULL, NULL));
  lib_good(spikefield_samples(scene, NULL, NULL, NULL, 0, NULL, NULL, NULL));
}

TEST(numbers_out_of_range_are_refused_by_name)
{
  int16_t harmonics[SPIKEFIELD_DIRECTIONS] = {0}, feature[64] = {0};
  uint32_t position[6] = {0};
  spikefield_sample sample[2];
  spikefield_pixel pixel[1];
  const float far[3] = {1, 0, 0};
  feature[35] = 2048;
  lib_bad(spikefield_samples(scene, NULL, harmonics, feature, 2, sample, NULL, NULL), SPIKEFIELD_E_RANGE,
          "feature 3 of sample 1 is 2048");
  feature[35] = 0, harmonics[15] = -2048;
  lib_bad(spikefield_samples(scene, NULL, harmonics, feature, 2, sample, NULL, NULL), SPIKEFIELD_E_RANGE,
          "harmonic 15");
  position[5] = 1 << 24, harmonics[15] = 0;
  lib_bad(spikefield_samples_at(scene, NULL, harmonics, position, 2, sample, NULL, NULL), SPIKEFIELD_E_RANGE,
          "position 1, axis 2");
  lib_bad(spikefield_features(scene, position, 2, feature, NULL), SPIKEFIELD_E_RANGE, "position 1, axis 2");
  lib_bad(spikefield_rays(scene, &(spikefield_options){.steps = 9}, far, far, 1, pixel, NULL), SPIKEFIELD_E_RANGE,
          "steps is 9");
  lib_bad(spikefield_rays(scene, &(spikefield_options){.threads = -1}, far, far, 1, pixel, NULL), SPIKEFIELD_E_RANGE,
          "threads is -1");
}

TEST(cameras_out_of_range_are_refused_by_name)
{
  spikefield_pixel pixel;
  static const char *const word[] = {"width is 0", "height is 65537", "fx is 0", "fy is", "cx is", "to_model[7]"};
  for (int i = 0; i < 6; i++) {
    spikefield_camera camera = make_camera();
    if (i == 0) camera.width = 0;
    if (i == 1) camera.height = 65537;
    if (i == 2) camera.fx = 0;
    if (i == 3) camera.fy = INFINITY;
    if (i == 4) camera.cx = NAN;
    if (i == 5) camera.to_model[7] = NAN;
    lib_bad(spikefield_frame(scene, NULL, &camera, &pixel, NULL), SPIKEFIELD_E_RANGE, word[i]);
  }
}

int ck_timeout = 300;
ck_options ck_program = {.set_up = open_fixture, .tear_down = close_fixture};
