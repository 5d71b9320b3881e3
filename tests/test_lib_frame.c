/* Rays, frames and taps of the C library against the core: same integers, same counts, whatever the threads. */
#include "ck_run.h"
#include "energy/energy.h"
#include "tests/lib_fixture.h"
#include <omp.h>

static bool same_pixel(const spikefield_pixel *a, const spikefield_pixel *b)
{
  return !memcmp(a->colour, b->colour, sizeof a->colour) && a->depth == b->depth &&
         !memcmp(a->rgba, b->rgba, sizeof a->rgba) && a->weight_sum == b->weight_sum &&
         a->transmittance == b->transmittance && a->samples == b->samples;
}

static void assert_core_pixel(const spikefield_pixel *pixel, const fx_pixel *expected)
{
  uint32_t rgba[4];
  fx_pixel_rgba(expected, rgba);
  ck_assert_mem_eq(pixel->colour, expected->colour, sizeof expected->colour);
  ck_assert_mem_eq(pixel->rgba, rgba, sizeof rgba);
  ck_assert_uint_eq(pixel->depth, expected->depth);
  ck_assert_uint_eq(pixel->weight_sum, expected->weight_sum);
  ck_assert_uint_eq(pixel->transmittance, expected->transmittance);
  ck_assert_uint_eq(pixel->samples, expected->samples);
  ck_assert_uint_eq(pixel->weight_sum + pixel->transmittance, 1u << 20);
}

TEST(frames_are_those_of_the_core)
{
  static spikefield_pixel frame[HEIGHT * WIDTH], ray[HEIGHT * WIDTH];
  static float origin[HEIGHT * WIDTH][3], direction[HEIGHT * WIDTH][3];
  const spikefield_camera camera = make_camera();
  const sf_dataset data = {.scale = 1};
  sf_view twin = {.camera = {.width = WIDTH, .height = HEIGHT, .fx = 30, .fy = 31, .cx = 18.25f, .cy = 9}};
  spikefield_counts counts = {0}, of_rays = {0};
  fx_counts wanted = {0};
  int hit = 0;
  memcpy(twin.camera.to_world, camera.to_model, sizeof twin.camera.to_world);
  lib_good(spikefield_frame(scene, NULL, &camera, frame, &counts));
  for (int i = 0; i < HEIGHT * WIDTH; i++) {
    fx_ray r;
    fx_pixel expected;
    ck_ok(sf_pixel_ray(&core, &data, &twin, i % WIDTH, i / WIDTH, &r));
    ck_ok(fx_render_ray(&core, &r, NULL, NULL, &expected, &wanted));
    assert_core_pixel(&frame[i], &expected);
    hit += expected.samples > 0;
    sf_camera_ray(&twin.camera, (float)(i % WIDTH) + 0.5f, (float)(i / WIDTH) + 0.5f, origin[i], direction[i]);
  }
  ck_assert_int_gt(hit, HEIGHT * WIDTH / 4);
  ck_assert_int_lt(hit, HEIGHT * WIDTH);
  ck_assert_mem_eq(&counts, &wanted, sizeof wanted);
  lib_good(spikefield_rays(scene, NULL, origin[0], direction[0], HEIGHT * WIDTH, ray, &of_rays));
  ck_assert_mem_eq(&of_rays, &wanted, sizeof wanted);
  for (int i = 0; i < HEIGHT * WIDTH; i++) ck_assert(same_pixel(&ray[i], &frame[i]));
}

TEST(threads_change_no_bit)
{
  static spikefield_pixel one[HEIGHT * WIDTH], more[HEIGHT * WIDTH];
  const spikefield_camera camera = make_camera();
  spikefield_counts first = {0}, counts, twice;
  lib_good(spikefield_frame(scene, &(spikefield_options){.threads = 1, .steps = 2}, &camera, one, &first));
  for (int threads = 2; threads <= 5; threads++) {
    memset(&counts, 0, sizeof counts);
    lib_good(spikefield_frame(scene, &(spikefield_options){.threads = threads, .steps = 2}, &camera, more, &counts));
    ck_assert_mem_eq(&counts, &first, sizeof first);
    for (int i = 0; i < HEIGHT * WIDTH; i++) ck_assert(same_pixel(&one[i], &more[i]));
  }
  ck_assert_uint_eq(counts.layer[SPIKEFIELD_D1].updates[2], 0); /* two time steps */
  twice = first;
  spikefield_counts_add(&twice, &counts);
  ck_assert_uint_eq(twice.samples, 2 * first.samples);
  ck_assert_uint_eq(twice.layer[SPIKEFIELD_C2].sop[1], 2 * first.layer[SPIKEFIELD_C2].sop[1]);
}

/* One scene, several callers at once, each with a team of its own. */
TEST(one_scene_serves_many_threads)
{
  static spikefield_pixel frame[4][HEIGHT * WIDTH];
  spikefield_counts counts[4] = {0};
  spikefield_status status[4];
  const spikefield_camera camera = make_camera();
  omp_set_max_active_levels(2);
#pragma omp parallel for num_threads(4)
  for (int i = 0; i < 4; i++)
    status[i] = spikefield_frame(scene, &(spikefield_options){.threads = 2}, &camera, frame[i], &counts[i]);
  for (int i = 0; i < 4; i++) {
    lib_good(status[i]);
    ck_assert_mem_eq(&counts[i], &counts[0], sizeof counts[0]);
    for (int p = 0; p < HEIGHT * WIDTH; p++) ck_assert(same_pixel(&frame[i][p], &frame[0][p]));
  }
}

static bool count_team(void *user, uint64_t done, uint64_t total)
{
  (void)done, (void)total;
  *(int *)user = omp_get_num_threads();
  return true;
}

TEST(no_thread_without_work_is_started)
{
  static spikefield_pixel frame[HEIGHT * WIDTH];
  const spikefield_camera camera = make_camera();
  const float up[3] = {0, 0, 1};
  int team = 0;
  const spikefield_options options = {.threads = 1024, .progress = count_team, .user = &team};
  lib_good(spikefield_frame(scene, &options, &camera, frame, NULL));
  ck_assert_int_ge(team, 1);
  ck_assert_int_le(team, omp_get_num_procs());
  ck_assert_int_le(team, 3); /* blocks of 256 rays */
  lib_good(spikefield_rays(scene, &options, up, up, 1, frame, NULL));
  ck_assert_int_eq(team, 1);
}

typedef struct watcher {
  uint64_t calls, last, stop_at;
} watcher;

static bool watch(void *user, uint64_t done, uint64_t total)
{
  watcher *w = user;
  ck_assert_uint_eq(total, HEIGHT * WIDTH);
  ck_assert_uint_gt(done, w->last);
  w->last = done, w->calls++;
  return done < w->stop_at;
}

TEST(progress_is_told_and_can_stop)
{
  static spikefield_pixel frame[HEIGHT * WIDTH];
  const spikefield_camera camera = make_camera();
  spikefield_counts counts = {0};
  watcher w = {.stop_at = UINT64_MAX};
  spikefield_options options = {.threads = 3, .progress = watch, .user = &w};
  lib_good(spikefield_frame(scene, &options, &camera, frame, &counts));
  ck_assert_uint_eq(w.last, HEIGHT * WIDTH);
  ck_assert_uint_gt(w.calls, 1);
  const spikefield_counts before = counts;
  options.threads = 1;
  w = (watcher){.stop_at = 1};
  lib_bad(spikefield_frame(scene, &options, &camera, frame, &counts), SPIKEFIELD_E_STOPPED, "of 703 rays");
  ck_assert_uint_eq(w.calls, 1);
  ck_assert_mem_eq(&counts, &before, sizeof counts);
}

/* Rays are bad at the end of every block of 256: whoever is first, the first one is reported. */
TEST(the_first_bad_ray_is_named)
{
  enum { RAYS = 1024 };
  static spikefield_pixel pixel[RAYS];
  static float vector[RAYS][3];
  for (int i = 0; i < RAYS; i++) vector[i][0] = i % 256 == 255 ? NAN : 1;
  for (int i = 0; i < 200; i++) {
    const spikefield_options options = {.threads = 1 + i % 4};
    lib_bad(spikefield_rays(scene, &options, vector[0], vector[0], RAYS, pixel, NULL), SPIKEFIELD_E_RANGE, "ray 255: ");
  }
}

TEST(distance_is_that_of_the_golden_image)
{
  spikefield_pixel pixel;
  const float origin[3] = {0.3f, -3, 0.2f}, ahead[3] = {0, 1, 0}, away[3] = {0, -1, 0};
  lib_good(spikefield_rays(scene, NULL, origin, ahead, 1, &pixel, NULL));
  const double distance = spikefield_pixel_distance(scene, &pixel);
  ck_assert(distance > 2 && distance < 4); /* the box is 2 to 4 units ahead */
  lib_good(spikefield_rays(scene, NULL, origin, away, 1, &pixel, NULL));
  ck_assert_uint_eq(pixel.samples, 0);
  ck_assert(spikefield_pixel_distance(scene, &pixel) == 0);
  ck_assert_uint_eq(pixel.rgba[1], 30000);
}

/* ---- taps ---- */

typedef struct tapper {
  uint32_t next, stop_at;
  spikefield_counts counts;
  int16_t harmonics[SPIKEFIELD_DIRECTIONS];
} tapper;

/* Every tap is what its features give when they are run again. */
static bool tap_sample(void *user, const spikefield_tap *tap)
{
  static spikefield_trace trace;
  tapper *t = user;
  spikefield_sample again;
  ck_assert_uint_eq(tap->index, t->next++);
  lib_good(spikefield_samples(scene, NULL, t->harmonics, tap->features, 1, &again, &trace, &t->counts));
  ck_assert_mem_eq(&again, tap->sample, sizeof again);
  ck_assert_mem_eq(&trace, tap->trace, sizeof trace);
  return tap->index < t->stop_at;
}

TEST(taps_show_every_sample_of_a_ray)
{
  const float origin[3] = {0.3f, -3, 0.2f}, direction[3] = {0, 1, 0.1f};
  spikefield_pixel pixel, plain;
  spikefield_counts counts = {0}, expected = {0};
  tapper t = {.stop_at = UINT32_MAX};
  lib_good(spikefield_direction(scene, direction, t.harmonics));
  lib_good(spikefield_rays(scene, NULL, origin, direction, 1, &plain, &expected));
  lib_good(spikefield_ray_taps(scene, NULL, origin, direction, tap_sample, &t, &pixel, &counts));
  ck_assert(same_pixel(&pixel, &plain));
  ck_assert_uint_eq(t.next, pixel.samples);
  ck_assert_uint_gt(pixel.samples, 2);
  ck_assert_mem_eq(&counts, &expected, sizeof counts);
  ck_assert_uint_eq(t.counts.layer[SPIKEFIELD_C2].sop[3], counts.layer[SPIKEFIELD_C2].sop[3]);
  t.next = 0, t.stop_at = 1;
  lib_bad(spikefield_ray_taps(scene, NULL, origin, direction, tap_sample, &t, &pixel, &counts), SPIKEFIELD_E_STOPPED,
          "sample 1");
  ck_assert_uint_eq(t.next, 2);
  ck_assert_mem_eq(&counts, &expected, sizeof counts);
}

int ck_timeout = 300;
ck_options ck_program = {.set_up = open_fixture, .tear_down = close_fixture};
