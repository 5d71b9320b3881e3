/* Rays through TensoRF in integers: portable = vector, thresholds, files, and pictures against the float model. */
#include "ck_run.h"
#include "base/io.h"
#include "quant/quant.h"
#include "spikefield/spikefield.h"
#include "tests/fx_tensorf_scene.h"
#include "tests/scene_file_fixture.h"
#include <math.h>

static const int32_t few[3] = {7, 1, 5}; /* one axis of a single point */

/* ---- rays ---- */

static fx_ray make_ray(uint64_t seed, uint64_t index, int count)
{
  fx_ray ray = {.count = count, .first_q16 = 12345};
  for (uint64_t a = 0; a < 3; a++) {
    const int64_t from = fixture_pick(seed, 5 + a, index, 0, ((int64_t)1 << 31) - 1) << 9;
    const int64_t to = fixture_pick(seed, 8 + a, index, 0, ((int64_t)1 << 31) - 1) << 9;
    ray.origin[a] = from, ray.step[a] = (to - from) / count;
    ray.unit[a] = (int16_t)fixture_pick(seed, 11 + a, index, -16384, 16384);
  }
  return ray;
}

static void same_rays(const fx_scene *scene, const char *kernels)
{
  enum { RAYS = 150 };
  static fx_ray ray[RAYS];
  static fx_pixel many[RAYS], one;
  static fx_cost cost[RAYS];
  fx_core *core;
  fx_counts sum = {0}, all = {0};
  const sf_status status = fx_core_open(&core, scene, kernels);
  if (status.code == SF_E_UNSUPPORTED) {
    printf("%s: not on this machine\n", kernels);
    return;
  }
  ck_assert_int_eq(status.code, SF_OK);
  for (uint64_t i = 0; i < RAYS; i++) ray[i] = make_ray(3, i, 1 + (int)(i % 7) * 40);
  ck_ok(fx_render_rays(core, ray, RAYS, many, cost, &all));
  for (int i = 0; i < RAYS; i++) {
    fx_counts counts = {0};
    uint64_t macs = 0;
    ck_ok(fx_render_ray(scene, &ray[i], NULL, NULL, &one, &counts));
    ck_assert_mem_eq(&one, &many[i], sizeof one);
    ck_assert_uint_eq(one.weight_sum + one.transmittance, 1 << 20);
    ck_assert_uint_eq(one.samples, counts.samples);
    ck_assert_uint_eq(counts.rays, one.samples > 0);
    for (int t = 0; t < SF_T_MAX; t++) macs += counts.layer[FX_C1].mac[t];
    ck_assert_uint_eq(cost[i].macs, macs);
    ck_assert_uint_eq(macs, counts.samples * (uint64_t)(scene->net.layer[FX_C1].n_in * scene->net.layer[FX_C1].n_out));
    fx_counts_add(&sum, &counts);
  }
  ck_assert_mem_eq(&sum, &all, sizeof sum);
  ck_assert_uint_gt(sum.field_samples, sum.samples);
  ck_assert_uint_gt(sum.samples, 500);
  fx_core_close(core);
}

/* Thin enough that rays go on, thick enough that samples of all weights occur. */
static fx_scene foggy(uint64_t seed)
{
  const int32_t res[3] = {17, 9, 33};
  fx_scene scene = make_scene(res, 5, 2, seed);
  scene.tensorf.density_in = (fx_scale){40000, 32, -8192}, scene.tensorf.sigma_out = (fx_scale){60000, 21, 0};
  for (int i = 0; i < 64; i++) scene.occupancy[i] = (uint8_t)fixture_pick(seed, 31, (uint64_t)i, 0, 255);
  ck_checked(&scene);
  return scene;
}

TEST(many_rays_are_rays)
{
  for (uint64_t seed = 0; seed < 3; seed++) {
    OWNED(fx_scene) scene = foggy(seed);
    scene.tensorf.activation = seed == 2 ? FX_RELU : FX_SOFTPLUS;
    if (seed == 1) scene.max_samples = 7;
    same_rays(&scene, "portable");
    same_rays(&scene, NULL);
  }
}

typedef struct seen {
  int calls;
  const fx_scene *scene;
} seen;

static sf_status see(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  seen *s = user;
  int32_t base[SF_LANES];
  (void)ray;
  ck_assert_int_eq(first, s->calls == 0);
  s->calls++;
  fx_net_direction(&s->scene->net, f, base, NULL);
  fx_net_sample(&s->scene->net, NULL, base, out, NULL, NULL);
  return sf_ok();
}

/* A higher threshold: fewer samples reach the decoder, weights and transmittance stay, colour only falls. */
TEST(the_weight_threshold_skips)
{
  OWNED(fx_scene) scene = foggy(3);
  int before = INT32_MAX, all = 0;
  for (int stop = 0; stop <= 1 << 20; stop = stop ? 16 * stop : 16) {
    seen s = {0, &scene};
    fx_pixel pixel, open;
    fx_counts counts = {0};
    scene.tensorf.weight_stop = stop < 1 << 20 ? stop : (1 << 20) - 1;
    const fx_ray ray = make_ray(3, 5, 200);
    ck_ok(fx_render_ray(&scene, &ray, see, &s, &pixel, &counts));
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &open, NULL));
    ck_assert_mem_eq(&open, &pixel, sizeof open);
    if (!stop) all = s.calls;
    ck_assert_int_ge((int)counts.field_samples, s.calls);
    ck_assert_int_eq((int)pixel.samples, s.calls);
    ck_assert_int_le(s.calls, before);
    ck_assert_uint_eq(pixel.weight_sum + pixel.transmittance, 1 << 20);
    before = s.calls;
  }
  ck_assert_int_gt(all, 20);
  ck_assert_int_eq(before, 0); /* no sample weighs 1 here */
}

TEST(empty_and_opaque)
{
  OWNED(fx_scene) scene = make_scene(few, 5, 2, 7);
  const fx_ray ray = make_ray(3, 1, 100);
  fx_pixel pixel;
  fx_counts counts = {0};
  scene.tensorf.density_in = (fx_scale){0, 0, (1 << 23) - 1}, scene.tensorf.sigma_out = (fx_scale){65535, 0, 0};
  ck_checked(&scene);
  ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, &counts));
  ck_assert(pixel.transmittance == 0 && pixel.samples == 1 && counts.rays == 1);
  ck_assert_uint_eq(counts.field_samples, 1 + FX_AHEAD); /* read before it is known that the first is enough */
  memset(scene.occupancy, 0, 64);
  memset(&counts, 0, sizeof counts);
  ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, &counts));
  ck_assert(pixel.transmittance == 1 << 20 && pixel.samples == 0);
  ck_assert(counts.march_steps == 100 && counts.field_samples == 0 && counts.rays == 0 && counts.grid_bytes == 0);
}

/* ---- files ---- */

TEST(files_are_checked)
{
  static const char *const wrong[][3] = {
      {"backbone", "plenoxels", "backbone"},
      {"backbone", NULL, "grid"},
      {"tensorf.res[1]", "0", "res[1]"},
      {"tensorf.res[1]", "2049", "res[1]"},
      {"tensorf.res[0]", "16", "density_plane.0"},
      {"tensorf.density.components[2]", "65", "density.components[2]"},
      {"tensorf.density.components[0]", "4", "density_plane.0"},
      {"tensorf.appearance.components[1]", "0", "appearance.components[1]"},
      {"tensorf.density_in.mul", "65536", "density_in.mul"},
      {"tensorf.density_in.shift", "41", "density_in.shift"},
      {"tensorf.density_in.bias", "8388608", "density_in.bias"},
      {"tensorf.sigma_out.bias", "1", "sigma_out.bias"},
      {"tensorf.feature_in.shift", "-1", "feature_in.shift"},
      {"tensorf.phase_in.mul", NULL, "phase_in.mul"},
      {"tensorf.activation", "2", "activation"},
      {"tensorf.weight_stop", "1048576", "weight_stop"},
      {"tensorf.features", "33", "features"},
      {"tensorf.feature_freqs", "5", "feature_freqs"},
      {"tensorf.view_freqs", "1", "C1.n_in"},
      {"tensorf.encoding_frac", "12", "encoding_frac"},
      {"tensorf.stretch[2]", "0", "stretch[2]"},
      {"tensorf.near", "nan", "near"},
      {"tensorf.near", "-0.1", "near"},
      {"tensorf.far", "0.1", "far"},
      {"tensorf.far", NULL, "far"},
      {"tensorf.weight_stop", "105", "checksum"},
      {"D1.n_out", "1", "D1"},
      {"C2.bias", "2", "C2.bias"},
  };
  fx_scene scene = foggy(8), again;
  scene.units.stretch[1] = 4 / 3.0, scene.units.near = 0.1;
  ck_ok(fx_scene_save(&scene, path));
  ck_ok(fx_scene_load(&again, path));
  ck_assert(again.units.stretch[1] == 4 / 3.0 && again.units.near == 0.1);
  for (uint64_t i = 0; i < 40; i++) {
    const fx_ray ray = make_ray(4, i, 90);
    fx_pixel a, b;
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &a, NULL));
    ck_ok(fx_render_ray(&again, &ray, NULL, NULL, &b, NULL));
    ck_assert_mem_eq(&a, &b, sizeof a);
  }
  fx_scene_free(&again);
  for (int i = 0; i < COUNT(wrong); i++) assert_edit_refused(&scene, wrong[i]);
  scene.tensorf.basis[70] = -128;
  ck_bad(fx_scene_save(&scene, path), SF_E_RANGE, "'basis_mat': element 70", "");
  fx_scene_free(&scene);
}

/* The library opens such a scene and renders its rays; what needs a hash grid it refuses. */
TEST(the_library_renders_it)
{
  enum { RAYS = 40 };
  float origin[RAYS][3], direction[RAYS][3];
  spikefield_scene *opened;
  spikefield_scene_info info;
  spikefield_pixel pixel[RAYS];
  spikefield_counts counts = {0};
  int16_t inputs[SF_DIR_MAX] = {0}, harmonics[SPIKEFIELD_DIRECTIONS] = {0};
  spikefield_sample sample;
  uint64_t samples = 0;
  OWNED(fx_scene) scene = foggy(8);
  ck_ok(fx_scene_save(&scene, path));
  ck_assert_int_eq(spikefield_scene_open(&opened, path).code, SPIKEFIELD_OK);
  ck_assert_int_eq(spikefield_scene_describe(opened, &info).code, SPIKEFIELD_OK);
  ck_assert_int_eq(info.features, fx_tensorf_inputs(&scene.tensorf));
  ck_assert_int_eq(info.grid_bytes, fx_tensorf_bytes(&scene.tensorf));
  for (int i = 0; i < RAYS; i++)
    for (uint64_t a = 0; a < 3; a++) {
      origin[i][a] = (float)fixture_pick(5, a, (uint64_t)i, 1, 99) / 100;
      direction[i][a] = (float)fixture_pick(5, 3 + a, (uint64_t)i, -50, 50) / 100 + 0.001f;
    }
  ck_assert_int_eq(spikefield_rays(opened, NULL, origin[0], direction[0], RAYS, pixel, &counts).code, SPIKEFIELD_OK);
  for (int i = 0; i < RAYS; i++) {
    fx_ray ray;
    fx_pixel core;
    ck_ok(sf_fx_ray_make(&scene, origin[i], direction[i], &ray));
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &core, NULL));
    ck_assert_mem_eq(core.colour, pixel[i].colour, sizeof core.colour);
    ck_assert(core.transmittance == pixel[i].transmittance && core.samples == pixel[i].samples);
    samples += core.samples;
  }
  ck_assert_uint_gt(samples, RAYS);
  ck_assert_uint_eq(counts.samples, samples);
  ck_assert_uint_ge(counts.field_samples, samples);
  ck_assert_int_eq(spikefield_samples(opened, NULL, harmonics, inputs, 1, &sample, NULL, NULL).code, SPIKEFIELD_OK);
  spikefield_scene_close(opened);
}

/* ---- against the float model ---- */

enum { SIDE = 24, PIXELS = SIDE * SIDE };

static void pixel_ray(int pixel, int ndc, float origin[3], float direction[3])
{
  const float u = ((float)(pixel % SIDE) + 0.5f) / SIDE * 2 - 1, v = ((float)(pixel / SIDE) + 0.5f) / SIDE * 2 - 1;
  const float to[3] = {u * 0.9f, v * 0.9f, 0.1f * u};
  float length = 0;
  origin[0] = ndc ? 0.4f * u : 0.3f, origin[1] = ndc ? 0.4f * v : -0.5f, origin[2] = ndc ? -0.99f : 2.6f;
  for (int a = 0; a < 3; a++) {
    direction[a] = ndc && a == 2 ? 1 : ndc ? 0.2f * to[a] : to[a] - origin[a];
    length += direction[a] * direction[a];
  }
  for (int a = 0; a < 3; a++) direction[a] /= sqrtf(length);
}

/* Fixed against float pictures of the same rays. */
static double picture_psnr(int ndc)
{
  static float origin[PIXELS][3], direction[PIXELS][3], rgb[PIXELS][3], decoded[PIXELS];
  const float white[3] = {1, 1, 1};
  sf_model m = test_smooth_tensorf(ndc);
  fx_scene scene;
  sf_quant_report report;
  const sf_quant_options options = {.background = {1, 1, 1}, .seed = 1};
  const sf_status status = sf_quantise_report(&scene, &m, "fixture", &options, &report);
  double error = 0, variance = 0, mean = 0, float_samples = 0;
  uint64_t samples = 0;
  ck_assert_msg(status.code == SF_OK, "%s", status.message);
  printf("ndc %d: errors: features %.4f, C1 %.4f, C2 %.4f, C3 %.4f; LSB %g, %g; bias %d\n", ndc, report.feature_error,
         report.layer[2].error, report.layer[3].error, report.layer[4].error, scene.units.feature_scale[0],
         scene.units.dir_scale, scene.net.layer[FX_C1].bias);
  for (int i = 0; i < PIXELS; i++) pixel_ray(i, ndc, origin[i], direction[i]);
  ck_assert_int_eq(sf_render_rays(&m, origin[0], direction[0], PIXELS, 0, white, rgb[0], NULL, NULL, decoded).code,
                   SF_OK);
  for (int i = 0; i < PIXELS; i++) {
    fx_ray ray;
    fx_pixel pixel;
    uint32_t rgba[4];
    ck_ok(sf_fx_ray_make(&scene, origin[i], direction[i], &ray));
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, NULL));
    fx_pixel_rgba(&pixel, rgba);
    samples += pixel.samples;
    float_samples += (double)decoded[i];
    for (int o = 0; o < 3; o++) {
      const double d = rgba[o] / 65535.0 - (double)rgb[i][o];
      error += d * d, mean += (double)rgb[i][o], variance += (double)rgb[i][o] * (double)rgb[i][o];
    }
  }
  ck_assert_uint_gt(samples, PIXELS);
  /* Both count what the decoder sees; a weight near the threshold may be on either side of it. */
  ck_assert_double_eq_tol(float_samples, (double)samples, 0.01 * (double)samples);
  variance = variance / (3 * PIXELS) - pow(mean / (3 * PIXELS), 2);
  ck_assert_double_gt(variance, 1e-4); /* there is something to see */
  fx_scene_free(&scene);
  sf_model_free(&m);
  return -10 * log10(error / (3 * PIXELS));
}

/* 36 dB: what int8 weights and planes leave of a random net, whose membranes lie anywhere about their thresholds. */
LOOP_TEST(pictures_are_those_of_the_float_model, 2)
{
  const double psnr = picture_psnr(_i);
  printf("ndc %d: fixed against float %.2f dB\n", _i, psnr);
  ck_assert_double_gt(psnr, 36);
}

TEST(what_cannot_be_represented_is_refused)
{
  OWNED(sf_model) m = test_smooth_tensorf(0);
  fx_scene scene;
  sf_quant_options options = {.seed = 1};
  sf_model_param(&m, SF_P_APP_LINE + 1)[5] = NAN;
  ck_bad(sf_quantise(&scene, &m, "m.safetensors", &options), SF_E_RANGE, "'app_line.1'", "");
  sf_model_param(&m, SF_P_APP_LINE + 1)[5] = 0;
  options.widths.feature_bits = 9;
  ck_bad(sf_quantise(&scene, &m, "m.safetensors", &options), SF_E_UNSUPPORTED, "features", "");
  options.widths.feature_bits = 0;
  m.config.theta[1] = 1e-30f;
  ck_bad(sf_quantise(&scene, &m, "m.safetensors", &options), SF_E_UNSUPPORTED, "renderModule.mlp.0.weight", "");
}

int ck_timeout = 120;
ck_options ck_program = {.set_up = set_up, .tear_down = remove_folder};
