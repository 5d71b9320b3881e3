/* The audit's check of the vector core: another core in its place is found, and the first ray that differs is named. */
#include "ck_run.h"
#include "energy/measuring.h"
#include "tests/audit_fixture.h"
#include <omp.h>

static const fixture_sizes sizes = {4, 32, 16, 16, 32, 32, 3, FX_HYBRID, {0}};

enum { RAYS = 400 };

static sf_status make_ray(void *user, uint64_t index, fx_ray *ray)
{
  (void)user;
  audit_ray(index, ray);
  return sf_ok();
}

/* The checks of all rays that meet the box, with the other scene in the vector core. *measure as sf_measure_rays left
 * it, but for what the check adds. */
static sf_status check_with(const fx_scene *scene, const fx_scene *other, sf_measure *measure)
{
  const sf_measure_job job = {
      .scene = scene, .rays = RAYS, .ray = make_ray, .seed = 7, .check = UINT64_MAX, .cache = sf_cache_built};
  fx_core *core;
  ck_ok(fx_core_open(&core, other, NULL));
  sf_measuring s = {.job = &job, .cache = job.cache, .core = core, .sum = measure, .hit = measure->hit, .count = RAYS};
  const sf_status status = sf_measure_check(&s);
  fx_core_close(core);
  return status;
}

static sf_measure measured(const fx_scene *scene)
{
  const sf_measure_job job = {.scene = scene, .rays = RAYS, .ray = make_ray, .seed = 7};
  sf_measure measure;
  ck_ok(sf_measure_rays(&job, &measure));
  ck_assert_uint_eq(measure.checked, 0);
  return measure;
}

static void count(const fx_scene *scene, uint64_t index, fx_counts *counts)
{
  fx_ray ray;
  fx_pixel pixel;
  memset(counts, 0, sizeof *counts);
  audit_ray(index, &ray);
  ck_ok(fx_render_ray(scene, &ray, NULL, NULL, &pixel, counts));
}

/* The first ray that the portable core counts otherwise in the two scenes. */
static uint64_t first_difference(const fx_scene *a, const fx_scene *b)
{
  for (uint64_t i = 0; i < RAYS; i++) {
    fx_counts x, y;
    count(a, i, &x), count(b, i, &y);
    if (x.rays && memcmp(&x, &y, sizeof x)) return i;
  }
  return UINT64_MAX;
}

/* A fault, the first difference that it makes, and whether it is one of the layers' events. */
static void expect_named(const fx_scene *scene, const fx_scene *faulty, const char *word)
{
  OWNED(sf_measure) measure = measured(scene);
  const uint64_t first = first_difference(scene, faulty);
  char ray[40];
  ck_assert_uint_gt(first, 0);
  ck_assert_uint_lt(first, RAYS);
  snprintf(ray, sizeof ray, "ray %d, ", (int)first);
  for (int threads = 1; threads <= 4; threads += 3) {
    omp_set_num_threads(threads);
    sf_measure again = measure;
    const sf_status status = check_with(scene, faulty, &again);
    ck_bad(status, SF_E_DIFFERENCE, word, "vector core ");
    ck_assert_msg(!strncmp(status.message, ray, strlen(ray)), "'%s' does not begin with '%s'", status.message, ray);
  }
}

TEST(the_same_scene_differs_nowhere)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  OWNED(sf_measure) measure = measured(&scene);
  ck_ok(check_with(&scene, &scene, &measure));
  ck_assert_uint_eq(measure.checked, measure.core.rays);
  assert_same_counts(&measure.checked_core, &measure.core);
}

/* A threshold: a neuron of C1 fires less often. */
TEST(spikes_that_differ_are_named)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3), faulty = fixture_scene(&sizes, 3);
  faulty.net.layer[FX_C1].theta += 5;
  expect_named(&scene, &faulty, "of layer C1 at step ");
}

/* A single weight of a layer of no spikes changes no count; pixels are not what is checked here. */
TEST(only_counts_are_compared)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3), faulty = fixture_scene(&sizes, 3);
  faulty.net.layer[FX_C3].w[0] = (int8_t)(faulty.net.layer[FX_C3].w[0] ^ 1);
  OWNED(sf_measure) measure = measured(&scene);
  ck_ok(check_with(&scene, &faulty, &measure));
}

/* Cells that are empty in the faulty scene: fewer samples. */
TEST(samples_that_differ_are_named)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3), faulty = fixture_scene(&sizes, 3);
  const int cells = scene.occ_res * scene.occ_res * scene.occ_res;
  for (int cell = 0; cell < cells; cell += 3) faulty.occupancy[cell >> 3] &= (uint8_t) ~(1u << (cell & 7));
  expect_named(&scene, &faulty, "MAC of layer D1 at step 0");
}

/* Each ray agrees by itself, but the sums do not. */
TEST(sums_that_differ_without_a_ray)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  OWNED(sf_measure) measure = measured(&scene);
  sf_measure more = measure;
  more.checked_core.layer[FX_C2].sop[1] = 5;
  ck_bad(check_with(&scene, &scene, &more), SF_E_DIFFERENCE, "rays in blocks, ", "SOP of layer C2 at step 1: ");
  more = measure, more.checked_core.march_steps = 5;
  ck_bad(check_with(&scene, &scene, &more), SF_E_DIFFERENCE, "rays in blocks, ", "lattice points or saturations");
  more = measure, more.checked_core.grid_bytes = 5;
  ck_bad(check_with(&scene, &scene, &more), SF_E_DIFFERENCE, "rays in blocks, ", "grid bytes: vector core ");
  more = measure, more.checked_memory.misses = 5;
  ck_bad(check_with(&scene, &scene, &more), SF_E_DIFFERENCE, "rays in blocks, ", "field lines missed: vector core ");
}

TEST(too_many_rays)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  const sf_measure_job job = {.scene = &scene, .rays = ((uint64_t)1 << 36) + 1, .ray = make_ray};
  sf_measure measure;
  ck_bad(sf_measure_rays(&job, &measure), SF_E_RANGE, "68719476737 rays", "too many");
}

/* Every count of memory, and every one of the traffic, is compared and named. */
TEST(each_count_of_memory_is_compared)
{
  const fx_memory_counts none = {0};
  static const char *const name[] = {"field look-ups", "field lines missed", "groups of samples",
                                     "rows of D2",     "rows of C2",         "rows of C3"};
  for (int i = 0; i < COUNT(name); i++) {
    fx_memory_counts one = {0};
    uint64_t *const count[] = {&one.lookups, &one.misses, &one.groups, &one.rows[0], &one.rows[1], &one.rows[2]};
    *count[i] = 3;
    const sf_status status = sf_memory_compare(&one, "a", &none, "b");
    ck_bad(status, SF_E_DIFFERENCE, name[i], ": a 3, b 0");
    ck_ok(sf_memory_compare(&one, "a", &one, "b"));
  }
}

TEST(each_event_of_the_traffic_is_compared)
{
  const sf_traffic none = {0};
  for (int e = 0; e < SF_TRAFFIC_EVENTS; e++) {
    sf_traffic one = {0};
    one.event[e] = 4;
    ck_bad(sf_traffic_compare(&one, "a", &none, "b", e + 1), SF_E_DIFFERENCE, sf_traffic_events[e].title, ": a 4, b 0");
    ck_ok(sf_traffic_compare(&one, "a", &none, "b", e));
    ck_ok(sf_traffic_compare(&one, "a", &one, "b", SF_TRAFFIC_EVENTS));
  }
}

ck_options ck_program = {.one_process = true};
