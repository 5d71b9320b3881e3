/* sf_ray_top against the fixed-point core, bit for bit: sample positions in, pixels and counters out. Random scenes and
 * streams, the hard cases of rays, rays that go on after their end, resets, wrong sizes. */
#include "ck_run.h"
#include "firmware/sf_ray_driver.h"
#include "energy/energy.h"
#include "quant/quant.h"
#include "tests/dut_fixture.h"
#include "tests/fx_hard_cases.h"

enum { RAYS = 12, SAMPLES_MAX = 1024 };

typedef struct batch {
  fx_ray ray[RAYS];
  sf_ray_sample sample[RAYS][SAMPLES_MAX];
  sf_ray_request request[RAYS];
  fx_pixel expected[RAYS], actual[RAYS];
  fx_counts counts;
} batch;
static batch shared; /* each test runs in a process of its own */

static sf_ray_dut *open_rays(const fx_scene *scene, uint64_t seed, int stalls)
{
  sf_ray_dut *rays;
  ck_ok(sf_ray_dut_open(&rays, scene, &(sf_dut_options){.seed = seed, .stall_percent = stalls}));
  return rays;
}

static void draw_rays(const fx_scene *scene, uint64_t seed)
{
  for (uint64_t i = 0; i < RAYS; i++) shared.ray[i] = random_ray(scene, seed, i);
}

static int whole_march(const fx_scene *scene, const fx_ray *ray)
{
  int n = 0;
  uint32_t pos[3];
  for (int32_t at = -1; n < SAMPLES_MAX && (at = fx_march_next(scene, ray, at + 1, pos, NULL)) >= 0;) n++;
  return n;
}

/* What the core makes of each ray. whole: the hardware gets every sample of the march and has to find the end. */
static void expect_core(const fx_scene *scene, int n, bool whole)
{
  memset(&shared.counts, 0, sizeof shared.counts);
  for (int i = 0; i < n; i++) {
    const fx_ray *ray = &shared.ray[i];
    ck_ok(fx_render_ray(scene, ray, NULL, NULL, &shared.expected[i], &shared.counts));
    const int samples = whole ? whole_march(scene, ray) : (int)shared.expected[i].samples;
    sf_ray_samples(scene, ray, shared.sample[i], samples);
    shared.request[i] = (sf_ray_request){ray, shared.sample[i], samples, false, i == 0};
  }
}

static void same_pixels(int n)
{
  for (int i = 0; i < n; i++) {
    const fx_pixel *e = &shared.expected[i], *a = &shared.actual[i];
    ck_assert_uint_eq(a->weight_sum + a->transmittance, FX_TRANS_ONE);
    ck_assert_uint_eq(a->samples, e->samples);
    ck_assert_uint_eq(a->transmittance, e->transmittance);
    for (int o = 0; o < 3; o++) ck_assert_uint_eq(a->colour[o], e->colour[o]);
    ck_assert_uint_eq(a->depth, e->depth);
  }
}

static void run(sf_ray_dut *rays, int n)
{
  ck_ok(sf_ray_dut_run(rays, shared.request, n, shared.actual));
  same_pixels(n);
}

/* The accelerator has to end by itself the rays that the core broke off. */
static void expect_stops(const fx_scene *scene)
{
  for (int i = 0; i < RAYS; i++)
    shared.request[i] = sf_ray_request_as(scene, &shared.ray[i], &shared.expected[i], shared.sample[i]);
}

static void same_counts(sf_ray_dut *rays)
{
  fx_counts actual;
  ck_ok(sf_dut_counts(rays->dut, &actual, NULL, NULL, NULL));
  ck_ok(sf_counts_compare(&shared.counts, "core", &actual, "accelerator"));
}

LOOP_TEST(random_scenes, 12)
{
  const uint64_t seed = 700 + (uint64_t)_i;
  fixture_sizes sizes = _i ? fixture_random_sizes(seed) : fixture_ingp;
  OWNED(fx_scene) scene = fixture_scene(&sizes, seed);
  scene.step_q24 = 1 << 20;
  scene.net.exp_in.bias = _i % 3 * 8192 - 4096;
  scene.trans_stop = _i % 2 ? 1048 : 400000;
  scene.max_samples = _i % 4 == 3 ? 3 : 1024;
  for (int o = 0; o < 3; o++) scene.background[o] = 20000 * o;
  OWNED(sf_ray_dut) *rays = open_rays(&scene, seed, _i % 4 * 25);
  draw_rays(&scene, seed);
  expect_core(&scene, RAYS, false);
  ck_assert_uint_gt(shared.counts.samples, 0);
  run(rays, RAYS);
  same_counts(rays);
  ck_ok(sf_dut_clear_counts(rays->dut));
  expect_stops(&scene);
  run(rays, RAYS);
  same_counts(rays);
  expect_core(&scene, RAYS, true);
  run(rays, RAYS);
}

/* Rays that stop at once, each followed by all that lies behind: whole rays of matter are dropped or swallowed. */
TEST(rays_go_on_after_their_end)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 5);
  fx_counts counts;
  int sent = 0, needed = 0;
  scene.step_q24 = 1 << 19;
  scene.trans_stop = (1 << 20) - 1; /* any density at all ends a ray */
  scene.net.exp_in.bias = 40000;
  memset(scene.occupancy, 0xff, 64);
  OWNED(sf_ray_dut) *rays = open_rays(&scene, 6, 30);
  draw_rays(&scene, 7);
  expect_core(&scene, RAYS, true);
  run(rays, RAYS);
  for (int i = 0; i < RAYS; i++) sent += shared.request[i].n, needed += (int)shared.expected[i].samples;
  ck_ok(sf_dut_counts(rays->dut, &counts, NULL, NULL, NULL));
  ck_assert_int_gt(sent, 10 * needed);
  ck_assert_uint_ge(counts.samples, (uint64_t)needed);
  ck_assert_uint_lt(counts.samples, (uint64_t)sent / 2); /* most of the rest never reached the nets */
}

/* Ends and beginnings meet in every way: rays of up to 14 samples, each ended by its second. */
TEST(short_rays_in_a_row)
{
  static const fixture_sizes sizes = {2, 8, 4, 4, 8, 8, 1, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 8);
  scene.step_q24 = 1 << 19, scene.max_samples = 2;
  memset(scene.occupancy, 0xff, 64);
  OWNED(sf_ray_dut) *rays = open_rays(&scene, 9, 40);
  for (uint64_t round = 0; round < 150; round++) {
    draw_rays(&scene, round);
    expect_core(&scene, RAYS, true);
    for (uint64_t i = 0; i < RAYS; i++) {
      const int most = (int)sf_random_below(round, 3, i, 13) + 2;
      if (shared.request[i].n > most) shared.request[i].n = most;
    }
    run(rays, RAYS);
  }
}

HARD_TEST(hard_rays)
{
  const hard_case *c = &hard_cases[_i];
  for (int variant = 0; c->kind == HARD_RAY && variant < c->variants; variant++) {
    hard h;
    hard_begin(&h, c, variant);
    fx_sh(h.ray.unit, sf_fx_dir_frac(&h.scene), h.ray.dir); /* the hardware makes them of the direction */
    sf_ray_dut *rays = open_rays(&h.scene, (uint64_t)variant, variant * 7 % 50);
    shared.ray[0] = h.ray;
    expect_core(&h.scene, 1, false);
    run(rays, 1);
    same_counts(rays);
    const hard_seen seen = {.pixel = shared.actual[0], .counts = shared.counts};
    c->expect(&h, &seen, variant);
    sf_ray_dut_close(rays);
    hard_end(&h);
  }
}

/* ---- registers and resets ---- */

static fx_scene small_scene(void)
{
  static const fixture_sizes sizes = {4, 32, 8, 9, 32, 32, 2, FX_HYBRID, {0}};
  fx_scene scene = fixture_scene(&sizes, 21);
  scene.step_q24 = 1 << 20;
  return scene;
}

static void works(sf_ray_dut *rays, uint64_t seed)
{
  rays->dut->in.ray_valid = rays->dut->in.pixel_ready = false;
  ck_ok(sf_ray_dut_load(rays));
  draw_rays(rays->scene, seed);
  expect_core(rays->scene, RAYS, false);
  run(rays, RAYS);
  same_counts(rays);
  ck_assert_uint_eq(get(rays->dut, SF_CSR_RAY_STATUS), SF_CSR_RAY_STATUS_RUNNING);
}

/* Between driver and bus: writes of one register go to another, a read of it finds nobody. */
typedef struct spy {
  sf_dut *dut;
  sf_bus real;
  uint32_t offset, to; /* to = 0: deaf */
} spy;

static uint32_t spy_read(void *context, uint32_t offset)
{
  spy *s = context;
  if (offset != s->offset || s->to) return s->real.read(s->real.context, offset);
  s->dut->bus_hung = true;
  return ~0u;
}

static void spy_write(void *context, uint32_t offset, uint32_t value)
{
  spy *s = context;
  s->real.write(s->real.context, offset == s->offset && s->to ? s->to : offset, value);
}

TEST(what_goes_wrong_at_load_is_told)
{
  static const struct {
    uint32_t offset, to;
    const char *text;
  } bad[] = {{SF_CSR_RAY_IRQ_ENABLE, SF_CSR_RAY_STATUS,
              "load rays: access to register 404 refused (SLVERR or DECERR) at cycle"},
             {SF_CSR_RAY_TRANS_STOP, 0x7fc, "load rays: programming refused: ADDRESS: "},
             {SF_CSR_RAY_BACKGROUND_B, SF_CSR_RAY_MAX_SAMPLES, "load rays: programming refused: VALUE: "},
             {SF_CSR_RAY_ERROR, 0, "load rays: register access not answered at cycle"}};
  OWNED(fx_scene) scene = small_scene();
  OWNED(sf_ray_dut) *rays = open_rays(&scene, 5, 20);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    const sf_bus real = rays->dut->bus;
    spy s = {rays->dut, real, bad[i].offset, bad[i].to};
    rays->dut->bus = (sf_bus){spy_read, spy_write, &s};
    const sf_status status = sf_ray_dut_load(rays);
    rays->dut->bus = real, rays->dut->bus_hung = false;
    ck_assert_int_eq(status.code, SF_E_UNSUPPORTED);
    ck_assert_msg(strstr(status.message, bad[i].text), "'%s' is not in '%s'", bad[i].text, status.message);
  }
  works(rays, 7);
}

/* Of a net with four levels and nine direction features. */
TEST(sizes_that_are_not_the_nets_are_refused)
{
  static const struct {
    uint32_t levels, n_dir;
  } bad[] = {{0, 9},          {3, 9}, {5, 9}, {16, 9}, {17, 9}, {20, 9},
             {0x80000004, 9}, {4, 0}, {4, 8}, {4, 16}, {4, 25}, {4, 41}};
  OWNED(fx_scene) scene = small_scene();
  OWNED(sf_ray_dut) *rays = open_rays(&scene, 6, 0);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    const sf_ray_blob blob = {.levels = bad[i].levels, .n_dir = bad[i].n_dir, .max_samples = 1024};
    put(rays->dut, SF_CSR_CTRL, SF_CSR_CTRL_SOFT_RESET);
    ck_assert_str_eq(sf_driver_text(sf_ray_driver_load(&rays->dut->bus, &blob, NULL)),
                     "the field's levels, directions or features are not the net's inputs");
    ck_assert_uint_eq(get(rays->dut, SF_CSR_RAY_STATUS), 0);
  }
  works(rays, 8);
}

/* At any moment, with the memory owing answers: the next rays are whole. */
TEST(soft_reset_in_mid_ray)
{
  OWNED(fx_scene) scene = small_scene();
  OWNED(sf_ray_dut) *rays = open_rays(&scene, 3, 10);
  uint64_t owing = 0;
  for (int cycles = 1; cycles < 1200; cycles = cycles * 5 / 4 + 1) {
    works(rays, 3);
    cut_off(rays->dut, &shared.request[0], cycles);
    owing += rays->memory.asked != rays->memory.answered;
  }
  works(rays, 4);
  ck_assert_uint_gt(owing, 3);
}

TEST(beats_out_of_order_are_refused)
{
  OWNED(fx_scene) scene = small_scene();
  OWNED(sf_ray_dut) *rays = open_rays(&scene, 4, 0);
  for (int user = 0; user < 2; user++) {
    works(rays, 5);
    ck_assert_int_eq(beats_out_of_order(rays->dut, user, 50), 25); /* every second cycle: nothing waits for it */
  }
  works(rays, 6);
}
