/* The measuring loop of the audit: threads, tiles, the rays that are checked, failures. */
#include "ck_run.h"
#include "energy/measuring.h"
#include "tests/audit_fixture.h"
#include "tests/fx_tensorf_fixture.h"
#include <omp.h>
#include <unistd.h>

typedef struct rays {
  uint64_t fail_from, stop_after;
} rays;

static sf_status make_ray(void *user, uint64_t index, fx_ray *ray)
{
  const rays *r = user;
  /* The first failure waits for the other threads to start, the later ones come after it. */
  if (index >= r->fail_from) usleep(index == r->fail_from ? 3000 : 9000);
  if (index >= r->fail_from) return sf_fail(SF_E_RANGE, "no ray %llu", (unsigned long long)index);
  audit_ray(index, ray);
  return sf_ok();
}

static bool tick(void *user, uint64_t done)
{
  return done < ((rays *)user)->stop_after;
}

/* Tiles of 37 rays. */
static uint64_t ray_tile(void *user, uint64_t index)
{
  (void)user;
  return index / 37;
}

static uint64_t one_tile(void *user, uint64_t index)
{
  (void)user, (void)index;
  return 5;
}

static const fixture_sizes sizes = {4, 32, 16, 16, 32, 32, 3, FX_HYBRID, {0}};

static sf_measure_job job_of(const fx_scene *scene, uint64_t count, uint64_t check)
{
  static rays all = {UINT64_MAX, UINT64_MAX};
  return (sf_measure_job){
      .scene = scene, .rays = count, .ray = make_ray, .tick = tick, .user = &all, .seed = 7, .check = check};
}

/* The same of one thread and of four. */
static void by_threads(const sf_measure_job *job, sf_measure *one, sf_measure *four)
{
  omp_set_num_threads(1);
  ck_ok(sf_measure_rays(job, one));
  omp_set_num_threads(4);
  ck_ok(sf_measure_rays(job, four));
  assert_same_counts(&one->core, &four->core);
  ck_assert_mem_eq(one->hit, four->hit, job->rays / 8);
}

/* However many rays a tile has, threads share out whole ones. */
TEST(memory_does_not_depend_on_threads)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  uint64_t (*const tile[])(void *user, uint64_t index) = {ray_tile, one_tile, NULL};
  uint64_t misses = 0;
  for (int i = 0; i < COUNT(tile); i++) {
    sf_measure_job job = job_of(&scene, 5000, 700);
    job.cache = (fx_cache_shape){1024, 2}, job.tile = tile[i];
    OWNED(sf_measure) one, four;
    by_threads(&job, &one, &four);
    ck_assert_mem_eq(&one.memory, &four.memory, sizeof one.memory);
    ck_assert_mem_eq(&one.checked_memory, &four.checked_memory, sizeof one.checked_memory);
    ck_assert_uint_gt(one.memory.misses, one.memory.lookups / 100);
    ck_assert_uint_lt(one.memory.misses, one.memory.lookups);
    ck_assert_uint_ne(one.memory.misses, misses); /* tiles matter */
    misses = one.memory.misses;
  }
}

TEST(measure_does_not_depend_on_threads)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  sf_measure_job job = job_of(&scene, 1000, UINT64_MAX);
  OWNED(sf_measure) one, four;
  uint64_t hits = 0;
  by_threads(&job, &one, &four);
  assert_same_counts(&one.checked_core, &one.core); /* all rays are checked */
  assert_same_counts(&one.checked_core, &four.checked_core);
  ck_assert_uint_eq(one.checked, one.core.rays);
  ck_ok(sf_counts_compare(&one.core, "core", &one.recount, "recount"));
  ck_assert_mem_eq(&one.checked_memory, &one.memory, sizeof one.memory);
  for (uint64_t i = 0; i < 1000; i++) {
    bool hit = one.hit[i / 8] >> i % 8 & 1;
    ck_assert(!(hit && i % 7 == 3));
    hits += hit;
  }
  ck_assert_uint_eq(hits, one.core.rays);
  ck_assert_uint_gt(one.core.samples, 1000);
  ck_assert_uint_eq(one.core.samples, one.recount.samples);
}

TEST(tensorf_is_counted_by_the_same_three)
{
  OWNED(fx_scene) scene = tensorf_scene();
  sf_measure_job job = job_of(&scene, 300, UINT64_MAX);
  OWNED(sf_measure) m;
  ck_ok(sf_measure_rays(&job, &m));
  assert_same_counts(&m.checked_core, &m.core);
  ck_assert_uint_gt(m.core.samples, 300);
  ck_assert_uint_gt(m.core.field_samples, m.core.samples); /* some weigh too little */
  ck_assert_uint_eq(m.recount.samples, m.core.samples);
  ck_assert_uint_gt(sf_event_total(&m.core, SF_EVENT_SPIKES), 0);
  ck_assert_uint_eq(sf_event_total(&m.core, SF_EVENT_MAC),
                    m.core.samples * (uint64_t)(scene.net.layer[FX_C1].n_in * 40));
  const sf_traffic core = sf_traffic_of(&scene, &m.core, &m.memory, 300);
  const sf_traffic recount = sf_traffic_recount(&scene, &m.recount, &m.checked_memory, m.core.field_samples, 300);
  ck_ok(sf_traffic_compare(&core, "core", &recount, "recount", SF_TRAFFIC_EVENTS));
  ck_assert_uint_eq(core.exp_neg, m.core.field_samples);
  ck_assert_uint_eq(core.table_bytes, 6 * 9 * (m.core.field_samples + m.core.samples)); /* 9 components in each */
  /* planes 9x8, 9x7, 8x7 with their lines 7, 8, 9: density 2, 3, 4 components, appearance 3, 2, 4 */
  ck_assert_uint_eq(sf_table_size(&scene), 5 * (72 + 7) + 5 * (63 + 8) + 8 * (56 + 9));
  sf_ledger l;
  ck_ok(sf_ledger_make(&scene.net, &m.core, &l));
  ck_assert_uint_eq(l.spiking_fj, sf_energy_fj(&m.core));
  ck_assert_uint_eq(l.ann_hoisted_fj, l.ann_fj); /* no direction of a ray to hoist */
  ck_assert_uint_eq(l.h_once_fj, l.spiking_fj);
}

TEST(checked_rays_are_a_seeded_choice)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  sf_measure_job job = job_of(&scene, 1000, 50);
  OWNED(sf_measure) measure;
  uint64_t index[50], again[60], other[50], all[1000], n, differs = 0;
  ck_ok(sf_measure_rays(&job, &measure));
  ck_assert_uint_eq(measure.checked, 50);
  ck_assert_uint_eq(measure.recount.rays, 50);
  ck_assert_uint_lt(measure.recount.samples, measure.core.samples);
  ck_ok(sf_counts_compare(&measure.checked_core, "a", &measure.recount, "b"));
  ck_ok(sf_measure_choose(&measure, 1, 2, 50, index, &n));
  ck_assert_uint_eq(n, 50);
  sf_measure_choose(&measure, 1, 2, 50, again, &n);
  sf_measure_choose(&measure, 2, 2, 50, other, &n);
  for (int i = 0; i < 50; i++) {
    ck_assert_uint_eq(index[i], again[i]);
    differs += index[i] != other[i];
    ck_assert(measure.hit[index[i] / 8] >> index[i] % 8 & 1);
    if (i > 0) ck_assert_uint_gt(index[i], index[i - 1]); /* none twice */
  }
  ck_assert_uint_gt(differs, 25);
  sf_measure_choose(&measure, 1, 2, 1000, all, &n);
  ck_assert_uint_eq(n, measure.core.rays);
  ck_assert_uint_eq(n, 1000 - 1000 / 7 - (1000 % 7 > 3)); /* rays that meet the box */
  /* However many: those with the smallest keys, in ascending order. */
  for (uint64_t limit = 0; limit <= 60; limit++) {
    ck_ok(sf_measure_choose(&measure, 1, 2, limit, again, &differs));
    ck_assert_uint_eq(differs, limit);
    uint64_t at = 0;
    for (uint64_t i = 0; i < n; i++) {
      uint64_t smaller = 0;
      for (uint64_t k = 0; k < n; k++) smaller += sf_random_u64(1, 2, all[k]) < sf_random_u64(1, 2, all[i]);
      if (smaller < limit) ck_assert_uint_eq(again[at++], all[i]);
    }
    ck_assert_uint_eq(at, limit);
  }
}

TEST(measure_reports_the_lowest_failing_ray)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  rays user = {10, UINT64_MAX};
  sf_measure_job job = job_of(&scene, 5000, 10);
  sf_measure measure;
  job.user = &user;
  omp_set_num_threads(4);
  for (int repeat = 0; repeat < 5; repeat++) {
    sf_status status = sf_measure_rays(&job, &measure);
    ck_assert_int_eq(status.code, SF_E_RANGE);
    ck_assert_str_eq(status.message, "no ray 10");
  }
  user = (rays){UINT64_MAX, 100};
  ck_assert_int_eq(sf_measure_rays(&job, &measure).code, SF_E_STOPPED);
}

/* The last chunk may have a single ray; none behind it is asked for. */
TEST(a_ray_alone_is_measured)
{
  OWNED(fx_scene) scene = fixture_scene(&sizes, 3);
  static const uint64_t counts[] = {1, 2, 1600, 1601};
  for (int i = 0; i < COUNT(counts); i++) {
    rays user = {counts[i], UINT64_MAX};
    sf_measure_job job = job_of(&scene, counts[i], 5);
    OWNED(sf_measure) m;
    job.user = &user;
    ck_ok(sf_measure_rays(&job, &m));
    ck_assert_uint_eq(m.rays, counts[i]);
  }
}

TEST(probe_names_the_sample_of_a_difference)
{
  OWNED(fx_scene) scene = fixture_scene(&fixture_ingp, 3);
  fx_trace *trace = malloc(sizeof *trace);
  sf_observer *observer = calloc(1, sizeof *observer);
  rays user = {UINT64_MAX, UINT64_MAX};
  fx_ray ray;
  int16_t f[32];
  fx_out out;
  observer->net = &scene.net, observer->trace = trace;
  sf_observer_begin(observer);
  ck_assert_ptr_eq(observer->trace, trace);
  make_ray(&user, 0, &ray);
  fixture_inputs(4, 0, f, 32, 900);
  ck_ok(sf_observer_net(observer, &ray, true, f, &out));
  ck_ok(sf_observer_net(observer, &ray, false, f, &out));
  observer->core.layer[FX_C1].spikes[2]++; /* the fault */
  sf_status status = sf_observer_net(observer, &ray, false, f, &out);
  ck_assert_int_eq(status.code, SF_E_DIFFERENCE);
  ck_assert_msg(strstr(status.message, "sample 2: spikes of layer C1 at step 2: core ") == status.message, "%s",
                status.message);
  free(trace), free(observer);
}

/* ---- rays in chunks ---- */

static uint64_t tile_of(void *user, uint64_t index)
{
  return ((const uint64_t *)user)[index];
}

/* Every ray belongs to one chunk, and every tile too, whatever the size of a chunk and wherever it begins. */
TEST(chunks_hold_whole_tiles)
{
  enum { RAYS = 40 };
  uint64_t tile[RAYS];
  for (int kind = 0; kind < 4; kind++)
    for (uint64_t size = 1; size < 12; size++)
      for (uint64_t count = RAYS - 3; count <= RAYS; count++) {
        for (int i = 0; i < RAYS; i++)
          tile[i] = (uint64_t[]){(uint64_t)i, (uint64_t)i / 3, (uint64_t)(i > 7) + (uint64_t)(i > 30), 5}[kind];
        const sf_measure_job job = {.tile = tile_of, .user = tile};
        const sf_measuring s = {.job = &job, .count = count};
        uint64_t next = 0;
        for (uint64_t first = 0; first < count; first += size) {
          const uint64_t limit = sf_measure_limit(&s, first, size);
          ck_assert_uint_eq(limit, first + size < count ? first + size : count);
          uint64_t at = sf_measure_begin(&s, first, limit);
          if (at == limit) continue;
          ck_assert_uint_eq(at, next); /* goes on where the chunk before ended */
          ck_assert(at == 0 || tile[at] != tile[at - 1]);
          while (sf_measure_has(&s, at, limit)) at++;
          ck_assert(at >= limit && (at == count || tile[at] != tile[at - 1]));
          next = at;
        }
        ck_assert_uint_eq(next, count);
      }
}

/* The lowest failure is kept, and only what is behind it is skipped; chosen rays are known by their index. */
TEST(failures_and_progress_of_measuring)
{
  uint64_t index[] = {3, 8, 20, 21};
  const sf_measure_job job = {.rays = 30};
  sf_measuring s = {.job = &job, .count = 4, .index = index, .failed = {UINT64_MAX, sf_ok()}};
  ck_assert_uint_eq(sf_measure_index(&s, 2), 20);
  ck_assert_uint_eq(sf_measure_tile(&s, 2), 20); /* each ray has its own */
  for (uint64_t i = 0; i < 4; i++) ck_assert(!sf_measure_skips(&s, i));
  sf_measure_fail(&s, 8, sf_fail(SF_E_RANGE, "eight"));
  sf_measure_fail(&s, 9, sf_fail(SF_E_RANGE, "nine"));
  sf_measure_fail(&s, 8, sf_fail(SF_E_RANGE, "eight again"));
  ck_assert_str_eq(s.failed.status.message, "eight");
  ck_assert(!sf_measure_skips(&s, 0) && !sf_measure_skips(&s, 1) && sf_measure_skips(&s, 2) && sf_measure_skips(&s, 3));
  sf_measure_progress(&s, 7);
  ck_assert_uint_eq(s.done, 0); /* they were counted before */
  s.index = NULL;
  sf_measure_progress(&s, 7), sf_measure_progress(&s, 2);
  ck_assert_uint_eq(s.done, 9);
  ck_assert(!s.stopped && !sf_measure_skips(&s, 0));
  sf_measure_outcome came = sf_measure_came(&s);
  ck_assert(came.done == 9 && came.failed.ray == 8 && !came.stopped);
  came.failed.status = sf_ok();
  ck_assert(sf_measure_took(&s, &came) && s.done == 18);
  came.stopped = true;
  ck_assert(!sf_measure_took(&s, &came) && s.stopped && sf_measure_skips(&s, 0));
  came.stopped = false;
  ck_assert(!sf_measure_took(&s, &came)); /* stays stopped */
  s.stopped = false, came.failed.status = sf_fail(SF_E_RANGE, "x");
  ck_assert(!sf_measure_took(&s, &came));
}
