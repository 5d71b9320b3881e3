/* Core, accelerator and recount on whole rays: nets with a hash grid, and a decoder behind planes and lines. */
#include "ck_run.h"
#include "sim/compare.h"
#include "sim/ray/three_counts.h"
#include "quant/quant.h"
#include "tests/audit_fixture.h"
#include "tests/fx_tensorf_fixture.h"

enum { RAYS = 8 };

/* user: the scene. The hardware makes the inputs of the direction. */
static sf_status ray(void *user, uint64_t index, fx_ray *to)
{
  const fx_scene *scene = user;
  audit_ray(index, to);
  if (scene->backbone == FX_INGP) fx_sh(to->unit, sf_fx_dir_frac(scene), to->dir);
  return sf_ok();
}

static void name(void *user, uint64_t index, char *text, size_t size)
{
  (void)user;
  snprintf(text, size, "ray %llu", (unsigned long long)index);
}

static sf_three_counts *run(fx_scene *scene, int stall)
{
  static const uint64_t index[RAYS] = {0, 1, 2, 3, 4, 5, 6, 7};
  sf_three_counts *counts = calloc(1, sizeof *counts);
  const sf_three_job job = {.scene = scene,
                            .index = index,
                            .rays = RAYS,
                            .ray = ray,
                            .name = name,
                            .user = scene,
                            .dut = {.seed = 3, .stall_percent = stall}};
  counts->wanted = RAYS;
  ck_ok(sf_three_counts_run(&job, counts));
  ck_assert_msg(counts->agreement.code == SF_OK, "%s", counts->agreement.message);
  ck_assert_int_eq(counts->rays, RAYS);
  ck_assert_uint_gt(counts->core.samples, RAYS);
  ck_assert_uint_eq(counts->rtl.samples, counts->core.samples);
  ck_assert_mem_eq(counts->rtl.layer, counts->core.layer, sizeof counts->core.layer);
  ck_assert_mem_eq(counts->recount.layer, counts->core.layer, sizeof counts->core.layer);
  ck_assert_uint_gt(sf_event_total(&counts->rtl, SF_EVENT_SPIKES), 0);
  ck_assert_uint_gt(counts->cycles, counts->busy);
  return counts;
}

TEST(hash_grid)
{
  const fixture_sizes sizes = {4, 32, 16, 16, 32, 32, 3, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  scene.step_q24 = 1 << 19;
  sf_three_counts *still = run(&scene, 0), *stalled = run(&scene, 40);
  ck_assert_uint_eq(still->rtl_traffic.table_bytes, still->core.samples * 4 * 8 * 2);
  ck_assert_uint_eq(still->rtl_traffic.exp_neg, still->core.samples);
  ck_assert_uint_eq(still->rtl_traffic.frame_bytes, RAYS * SF_PIXEL_BYTES);
  ck_assert_mem_eq(&still->core_traffic, &still->recount_traffic, sizeof(sf_traffic));
  for (int e = 0; e < SF_TRAFFIC_AT_PORTS; e++)
    ck_assert_uint_eq(still->rtl_traffic.event[e], still->core_traffic.event[e]);
  ck_assert_int_eq(still->rtl_events, SF_TRAFFIC_AT_PORTS);
  ck_assert_uint_eq(still->core_traffic.lookups, still->core_memory.lookups);
  ck_assert_uint_gt(still->core_traffic.lookups, still->core.samples * 4 * 4); /* four pairs a level at least */
  ck_assert_uint_gt(still->core_traffic.misses, 0);
  ck_assert_uint_gt(still->core_memory.groups, 0);
  ck_assert_mem_eq(&still->core_memory, &still->recount_memory, sizeof(fx_memory_counts));
  ck_assert_mem_eq(&still->rtl_traffic, &stalled->rtl_traffic, sizeof(sf_traffic)); /* stalls change cycles alone */
  ck_assert_uint_gt(stalled->cycles, still->cycles);
  free(still), free(stalled);
}

TEST(decoder)
{
  OWNED(fx_scene) scene = tensorf_scene();
  sf_three_counts *counts = run(&scene, 20);
  for (int e = 0; e < SF_TRAFFIC_AT_PORTS; e++)
    ck_assert_uint_eq(counts->rtl_traffic.event[e], counts->core_traffic.event[e]);
  ck_assert_mem_eq(&counts->core_traffic, &counts->recount_traffic, sizeof(sf_traffic));
  ck_assert_uint_gt(counts->core_traffic.exp_neg, counts->core.samples);
  free(counts);
}

/* Two rays whose core changes meanwhile, in a way of `changing`. */
static void check_difference(sf_status (*changing)(void *user, uint64_t index, fx_ray *to), const char *message)
{
  const fixture_sizes sizes = {4, 32, 16, 16, 32, 32, 3, FX_HYBRID, {0}};
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  scene.step_q24 = 1 << 19;
  static const uint64_t index[] = {0, 1};
  const sf_three_job job = {
      .scene = &scene, .index = index, .rays = 2, .ray = changing, .name = name, .user = &scene, .dut = {.seed = 3}};
  sf_three_counts *counts = calloc(1, sizeof *counts);
  counts->wanted = 2;
  ck_ok(sf_three_counts_run(&job, counts));
  ck_assert_int_eq(counts->agreement.code, SF_E_DIFFERENCE);
  ck_assert_msg(strstr(counts->agreement.message, message), "%s", counts->agreement.message);
  ck_assert_int_eq(counts->rays, 1);
  free(counts);
}

/* The core's net changes behind the accelerator's back: every ray of it differs, already the first. */
static sf_status ray_of_another_net(void *user, uint64_t index, fx_ray *to)
{
  fx_scene *scene = user;
  scene->net.sigmoid_in.bias = 1 << 15;
  return ray(scene, index, to);
}

TEST(the_first_ray_differs)
{
  check_difference(ray_of_another_net, "ray 0: sample 0: red: core ");
}

/* The core's rays change behind the back of the accelerator that has encoder and compositor; the nets agree. */
static sf_status ray_on_another_background(void *user, uint64_t index, fx_ray *to)
{
  fx_scene *scene = user;
  scene->background[1] = 4321;
  return ray(scene, index, to);
}

static sf_status ray_that_stops_early(void *user, uint64_t index, fx_ray *to)
{
  fx_scene *scene = user;
  scene->max_samples = 2;
  return ray(scene, index, to);
}

LOOP_TEST(a_pixel_differs, 2)
{
  static const struct {
    sf_status (*ray)(void *user, uint64_t index, fx_ray *to);
    const char *message;
  } changed[] = {{ray_on_another_background, "ray 0: green is "},
                 {ray_that_stops_early, "ray 0: accelerator: hang at cycle "}};
  check_difference(changed[_i].ray, changed[_i].message);
}

/* The accelerator's samples and rays count, too; a decoder has no directions and counts no rays. */
TEST(samples_and_rays_are_compared)
{
  fx_counts core = {.samples = 5, .rays = 2}, rtl = core;
  fx_net net = {.layer[FX_D1].n_out = 1};
  ck_ok(sf_compare_ray_counts(&net, &core, &rtl));
  rtl.rays = 3;
  ck_assert_str_eq(sf_compare_ray_counts(&net, &core, &rtl).message, "rays: core 2, accelerator 3");
  net.layer[FX_D1].n_out = 0;
  ck_ok(sf_compare_ray_counts(&net, &core, &rtl));
  rtl.samples = 4;
  ck_assert_str_eq(sf_compare_ray_counts(&net, &core, &rtl).message, "samples: core 5, accelerator 4");
}
