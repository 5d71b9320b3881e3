/* Scenes larger than one box in integers: steps, cells, rays and pictures against the float ones. */
#include "float_fixture.h"
#include "folder_fixture.h"
#include "fx_fixture.h"
#include "quant/quant.h"
#include "render/march.h"
#include "src/fx/march.h"
#include "tests/unbounded_fixture.h"

/* A random model with cells here and there, and its export. */
static void make_pair(int bound, int res, sf_model *m, fx_scene *scene)
{
  const sf_config c = large_config(bound, res);
  const sf_quant_options options = {.background = {1, 0.5f, 0}};
  ck_ok(sf_model_create(m, &c));
  for (size_t i = 0; i < m->size; i++) m->value[i] = test_random(i);
  scatter(m, (uint64_t)bound);
  ck_ok(sf_quantise(scene, m, "model", &options));
}

static void free_pair(sf_model *m, fx_scene *scene)
{
  sf_model_free(m);
  fx_scene_free(scene);
}

/* The integer steps against the recurrence in double precision. Lengths are rounded to 2^-16 of a lattice step, which
 * later ones grow with: 1e-4 in all. */
TEST(integer_steps_grow_as_the_formula_says)
{
  for (int bound = 2; bound <= 64; bound *= 2) {
    sf_model m;
    fx_scene scene;
    make_pair(bound, 64, &m, &scene);
    const double step = 2 * sqrt(3) / 1024, most = 2 * sqrt(3) * bound / 64;
    double start = 0, first = 0;
    for (int n = 0; start < 2 * sqrt(3) * bound; n++) {
      const double length = fmin(fmax((0.2 + start) / 128, step), most);
      if (n == 0) first = length;
      ck_assert_int_lt(n, scene.steps->count);
      ck_assert_double_eq_tol(ldexp((double)scene.steps->at_q16[n], -16) * step, start + (length - first) / 2,
                              1e-4 * start + 1e-6);
      ck_assert_double_eq_tol(fx_delta(&scene, n) / (double)scene.step_q24 * step, length,
                              1e-4 * length + step / scene.step_q24);
      start += length;
    }
    free_pair(&m, &scene);
  }
}

/* The cell that shifts find is that of the direct formula, for points on and beside every face, too. */
TEST(integer_cells_are_those_of_the_formula)
{
  for (int bound = 1; bound <= 64; bound *= 4) {
    const sf_config c = large_config(bound, 16);
    const fx_scene scene = {.occ_res = 16, .log2_bound = sf_config_cascades(&c) - 1};
    for (uint64_t i = 0; i < 20000; i++) {
      int64_t p[3];
      float x[3];
      for (uint64_t a = 0; a < 3; a++) {
        const int face = (int)sf_random_below(1, a, i, 2 * (uint64_t)scene.log2_bound + 2);
        const int64_t half = (int64_t)1 << (39 - face / 2);
        const int64_t beside = (int64_t)sf_random_below(2, a, i, 3) - 1;
        p[a] = i % 2 ? (int64_t)1 << 39 : (int64_t)(sf_random_below(3, a, i, 1 << 24) << 16);
        if (i % 2) p[a] += face % 2 ? half + beside * 65536 : -half + beside * 65536;
        p[a] = p[a] < 0 ? 0 : p[a] > (int64_t)0xffffff << 16 ? (int64_t)0xffffff << 16 : p[a];
        x[a] = ldexpf((float)(p[a] >> 16), -24);
      }
      const int least = (int)sf_random_below(4, 0, i, (uint64_t)scene.log2_bound + 1);
      ck_assert_uint_eq(fx_cell(&scene, p, least), direct_bit(&c, least, x));
    }
  }
}

/* The same points as the float marcher. The lattice step is rounded to Q0.24, so that distances differ by up to
 * 2^-25 / step_q24 of themselves; the table adds 1e-4 of a distance; float itself is good to 2^-22 of the distance to
 * the camera. */
TEST(integer_rays_follow_the_float_march)
{
  for (int bound = 2; bound <= 16; bound *= 2) {
    sf_model m;
    fx_scene scene;
    sf_steps steps;
    int hits = 0, differ = 0;
    double largest = 0;
    make_pair(bound, 64, &m, &scene);
    ck_ok(sf_steps_make(&steps, &m.config, 1));
    const double exact = ldexp(sqrt(3) / 1024 / bound, 24), drift = fabs(scene.step_q24 / exact - 1) + 1e-4;
    for (uint64_t i = 0; i < 1200; i++) {
      float o[3], d[3], x[3];
      fx_ray ray;
      draw_ray((int)(i / 4 % KINDS), i, (float)bound, o, d);
      const sf_march march = sf_march_begin(&m, &steps, o, d, 0.5f);
      ck_ok(sf_fx_ray_make(&scene, o, d, &ray));
      ck_assert_int_le(abs(ray.count - march.lattice.count), 2);
      differ += ray.count != march.lattice.count;
      hits += ray.count > 0;
      for (int n = 0; n < ray.count && n < march.lattice.count; n += 5) {
        const double along = sf_march_distance(&march, n) - march.lattice.first; /* in the box */
        const double bounded = (along * drift + sf_march_distance(&march, n) * 0x1p-22) / (2 * bound) + 0x1p-22;
        sf_march_at(&march, n, x);
        for (int a = 0; a < 3; a++) {
          const double error = fabs(ldexp((double)fx_ray_at(&scene, &ray, n, a), -40) - (double)x[a]);
          ck_assert_double_le(error, bounded);
          ck_assert(fx_ray_at(&scene, &ray, n, a) >= 0 && fx_ray_at(&scene, &ray, n, a) < (int64_t)1 << 40);
          largest = fmax(largest, error * 2 * bound);
        }
      }
    }
    ck_assert_int_gt(hits, 600);
    ck_assert_int_lt(differ, hits / 4); /* the last interval ends at the face, or beyond */
    printf("bound %d: points up to %.5f model units from those of the float march\n", bound, largest);
    ck_assert_double_lt(largest, 0.02);
    free_pair(&m, &scene);
  }
}

/* Precision alone: points against the line that they should lie on. The step is off by half of 2^-40, as often as there
 * are steps, and the product is cut to 2^-40. */
TEST(positions_are_precise_in_the_largest_boxes)
{
  for (int bound = 16; bound <= 64; bound *= 2) {
    sf_model m;
    fx_scene scene;
    double largest = 0;
    make_pair(bound, 64, &m, &scene);
    const double step = ldexp(scene.step_q24, -24);
    for (uint64_t i = 0; i < 600; i++) {
      float o[3], d[3];
      fx_ray ray;
      draw_ray((int)(i / 4 % KINDS), i, (float)bound, o, d);
      const double length = sqrt((double)d[0] * d[0] + (double)d[1] * d[1] + (double)d[2] * d[2]);
      const sf_status status = sf_fx_ray_make(&scene, o, d, &ray);
      ck_assert_msg(status.code == SF_OK || bound > 32, "%s", status.message); /* some of 64 begin too far away */
      for (int n = 0; n < ray.count; n += 3)
        for (int a = 0; a < 3; a++) {
          const double at = ldexp((double)scene.steps->at_q16[n], -16), exact = at * step * d[a] / length;
          const double error = ldexp((double)(fx_ray_at(&scene, &ray, n, a) - ray.origin[a]), -40) - exact;
          ck_assert_double_le(fabs(error), ldexp(at / 2 + 1.5, -40));
          largest = fmax(largest, fabs(error));
        }
    }
    printf("bound %d: rays bend by up to %.3f of 2^-24\n", bound, ldexp(largest, 24));
    free_pair(&m, &scene);
  }
}

static const char *const instruction_sets[] = {"portable", "avx2", "avx512vnni", "amx"};

/* Vector kernels and single rays: same pixels and events; and no light is lost or made. */
LOOP_TEST(many_rays_equal_single_rays, 4)
{
  enum { RAYS = 96 };
  OWNED(sf_model) m;
  OWNED(fx_scene) scene;
  fx_core *core;
  fx_ray ray[RAYS];
  fx_pixel pixel[RAYS];
  fx_counts all = {0}, sum = {0};
  const int bound = 4 << _i;
  make_pair(bound, 16, &m, &scene);
  scene.net.exp_in.bias -= 3 << SF_LOG_FRAC; /* thin: rays see many cells */
  for (uint64_t i = 0; i < RAYS; i++) {
    float o[3], d[3];
    draw_ray((int)(i / 4 % KINDS), i, (float)bound, o, d);
    ck_ok(sf_fx_ray_make(&scene, o, d, &ray[i]));
  }
  const sf_status status = fx_core_open(&core, &scene, instruction_sets[_i]);
  if (status.code == SF_E_UNSUPPORTED) printf("%s: not on this machine\n", instruction_sets[_i]);
  if (status.code == SF_OK) {
    ck_ok(fx_render_rays(core, ray, RAYS, pixel, NULL, &all));
    for (int i = 0; i < RAYS; i++) {
      fx_pixel one;
      ck_ok(fx_render_ray(&scene, &ray[i], NULL, NULL, &one, &sum));
      ck_assert_mem_eq(&one, &pixel[i], sizeof one);
      ck_assert_uint_eq(one.weight_sum + one.transmittance, 1u << SF_TRANS_FRAC);
    }
    ck_assert_mem_eq(&all, &sum, sizeof all);
    ck_assert_uint_gt(all.samples, 1000);
    fx_core_close(core);
  }
}

/* Fog of one density everywhere: growing intervals take the light that their lengths say. */
TEST(fog_takes_the_light_of_its_depth)
{
  OWNED(sf_model) m;
  OWNED(fx_scene) scene;
  make_pair(8, 16, &m, &scene);
  memset(scene.occupancy, 0xff, sf_config_cells(&m.config) / 8);
  memset(scene.grid.table, 0, (size_t)scene.grid.entries * 2);
  for (int sigma = 1; sigma <= 4; sigma++) {
    scene.net.exp_in = (fx_scale){.bias = sigma << SF_LOG_FRAC};
    scene.net.layer[FX_D2].k = 1 << SF_LEAK_FRAC; /* the last step alone */
    scene.trans_stop = 0;
    for (uint64_t i = 0; i < 24; i++) {
      float o[3], d[3];
      fx_ray ray;
      fx_pixel pixel;
      double depth = 0;
      draw_ray((int)(i % 2), i, 8, o, d);
      ck_ok(sf_fx_ray_make(&scene, o, d, &ray));
      for (int n = 0; n < ray.count; n++) depth += ldexp(fx_delta(&scene, n), -24);
      ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, NULL));
      ck_assert_uint_eq(pixel.samples, (uint32_t)ray.count);
      /* each of up to 700 samples rounds the transmittance to 2^-20, 2^y has 2^-12 */
      ck_assert_double_eq_tol(ldexp(pixel.transmittance, -SF_TRANS_FRAC), exp(-depth * ldexp(1, sigma)), 1e-3);
    }
  }
}

TEST(files_keep_the_box)
{
  sf_model m;
  fx_scene scene, back;
  make_pair(16, 16, &m, &scene);
  ck_ok(fx_scene_save(&scene, in("x.snn")));
  ck_ok(fx_scene_load(&back, in("x.snn")));
  ck_assert_int_eq(back.log2_bound, 4);
  ck_assert(back.gamma_q24 == 1 << 17 && back.near_q16 == scene.near_q16 && back.longest_q16 == scene.longest_q16);
  ck_assert_mem_eq(back.occupancy, scene.occupancy, sf_config_cells(&m.config) / 8);
  ck_assert_mem_eq(back.steps, scene.steps, sizeof *back.steps);
  fx_scene_free(&back);
  scene.longest_q16 = 1;
  ck_assert_ptr_nonnull(strstr(fx_scene_check(&scene, "x").message, "longest_q16"));
  scene.longest_q16 = 1 << 20, scene.gamma_q24 = 1 << 22;
  ck_assert_ptr_nonnull(strstr(fx_scene_check(&scene, "x").message, "gamma_q24"));
  scene.gamma_q24 = 1 << 17, scene.log2_bound = 7;
  ck_assert_ptr_nonnull(strstr(fx_scene_check(&scene, "x").message, "log2_bound"));
  free_pair(&m, &scene);
}

/* Entries that are zeroed because no occupied cell reads them change no ray. */
TEST(unread_entries_change_no_ray)
{
  OWNED(sf_model) m;
  OWNED(fx_scene) scene;
  make_pair(8, 16, &m, &scene);
  for (size_t i = 0; i < sf_config_cells(&m.config) / 8; i++) /* few cells, each in its own byte */
    scene.occupancy[i] = (uint8_t)(sf_random_below(7, 0, i, 10) == 0);
  fx_pixel before[200], after;
  fx_ray ray[200];
  for (uint64_t i = 0; i < 200; i++) {
    float o[3], d[3];
    draw_ray((int)(i / 4 % KINDS), i, 8, o, d);
    ck_ok(sf_fx_ray_make(&scene, o, d, &ray[i]));
    ck_ok(fx_render_ray(&scene, &ray[i], NULL, NULL, &before[i], NULL));
  }
  ck_ok(sf_trim_zero_unread(&scene, "box"));
  uint32_t samples = 0;
  for (int i = 0; i < 200; i++) {
    ck_ok(fx_render_ray(&scene, &ray[i], NULL, NULL, &after, NULL));
    ck_assert_mem_eq(&after, &before[i], sizeof after);
    samples += after.samples;
  }
  ck_assert_uint_gt(samples, 100);
}

/* The export of a model shows what the model shows. */
TEST(fixed_pictures_equal_float_ones)
{
  enum { RAYS = 400 };
  static float o[3 * RAYS], d[3 * RAYS], rgb[3 * RAYS];
  OWNED(sf_model) m;
  OWNED(fx_scene) scene;
  const float background[3] = {1, 0.5f, 0};
  double squares = 0;
  make_pair(8, 16, &m, &scene);
  for (uint64_t i = 0; i < RAYS; i++) draw_ray((int)(i / 4 % KINDS), i, 8, o + 3 * i, d + 3 * i);
  ck_ok(sf_render_rays(&m, o, d, RAYS, 0, background, rgb, NULL, NULL, NULL));
  for (int i = 0; i < RAYS; i++) {
    fx_ray ray;
    fx_pixel pixel;
    uint32_t rgba[4];
    ck_ok(sf_fx_ray_make(&scene, o + 3 * i, d + 3 * i, &ray));
    ck_ok(fx_render_ray(&scene, &ray, NULL, NULL, &pixel, NULL));
    fx_pixel_rgba(&pixel, rgba);
    for (int c = 0; c < 3; c++) squares += pow(rgba[c] / 65535.0 - fmin((double)rgb[3 * i + c], 1), 2);
  }
  const double psnr = -10 * log10(squares / (3.0 * RAYS));
  printf("fixed against float, bound 8: %.1f dB\n", psnr);
  ck_assert_double_gt(psnr, 30); /* flips of spikes of an untrained net; a wrong delta or cell costs 15 dB */
}

ck_options ck_program = {.set_up = make_folder, .tear_down = remove_folder};
