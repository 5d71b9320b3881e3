/* Rays and frames on all threads. Pixels do not depend on one another and counts are integer sums, so neither depends
 * on the threads; of several failures the one of the first block is reported. */
#include "quant/quant.h"
#include "src/lib/internal.h"
#include <math.h>
#include <omp.h>

enum { BLOCK = 256, FEW = 32, THREADS_MAX = 1024, SIDE_MAX = 65536 };

typedef struct job {
  fx_scene view;
  fx_core *core;                     /* NULL for a few rays: arranging its tables would take longer */
  const float *origins, *directions; /* NULL: the camera's */
  sf_camera camera;
  uint64_t rays, blocks;
  int threads;
  bool (*progress)(void *user, uint64_t done, uint64_t total);
  void *user;
  spikefield_pixel *pixels;
  omp_lock_t lock; /* guards what follows */
  fx_counts events;
  uint64_t done, failed_block; /* UINT64_MAX: none */
  sf_status failed;
  bool stopped;
} job;

static sf_status make_ray(const job *j, uint64_t i, fx_ray *ray)
{
  float origin[3], direction[3];
  if (j->origins) return sf_fx_ray_make(&j->view, j->origins + 3 * i, j->directions + 3 * i, ray);
  const uint64_t width = (uint64_t)j->camera.width;
  sf_camera_ray(&j->camera, (float)(i % width) + 0.5f, (float)(i / width) + 0.5f, origin, direction);
  return sf_fx_ray_make(&j->view, origin, direction, ray);
}

/* The one place where rays become pixels. */
static sf_status render(const job *j, const fx_ray *ray, int n, fx_pixel *pixel, fx_counts *events)
{
  if (j->core) return fx_render_rays(j->core, ray, (size_t)n, pixel, NULL, events);
  for (int i = 0; i < n; i++) SF_TRY(fx_render_ray(&j->view, &ray[i], NULL, NULL, &pixel[i], events));
  return sf_ok();
}

static sf_status render_block(const job *j, uint64_t first, int n, fx_counts *events)
{
  fx_ray ray[BLOCK];
  fx_pixel pixel[BLOCK];
  for (int i = 0; i < n; i++) {
    const sf_status status = make_ray(j, first + (uint64_t)i, &ray[i]);
    if (status.code != SF_OK)
      return sf_fail(status.code, "ray %llu: %s", (unsigned long long)first + (unsigned)i, status.message);
  }
  SF_TRY(render(j, ray, n, pixel, events));
  for (int i = 0; i < n; i++) lib_pixel(&j->pixels[first + (uint64_t)i], &pixel[i]);
  return sf_ok();
}

static bool wanted(job *j, uint64_t block)
{
  omp_set_lock(&j->lock);
  const bool yes = !j->stopped && block < j->failed_block;
  omp_unset_lock(&j->lock);
  return yes;
}

static void finish_block(job *j, uint64_t block, int n, const sf_status *status, const fx_counts *events)
{
  omp_set_lock(&j->lock);
  if (status->code != SF_OK) {
    if (block < j->failed_block) j->failed_block = block, j->failed = *status;
  } else {
    fx_counts_add(&j->events, events);
    j->done += (uint64_t)n;
    if (!j->stopped && j->progress && !j->progress(j->user, j->done, j->rays)) j->stopped = true;
  }
  omp_unset_lock(&j->lock);
}

static void run_block(job *j, uint64_t block)
{
  const uint64_t first = block * BLOCK, left = j->rays - first;
  const int n = left < BLOCK ? (int)left : BLOCK;
  fx_counts events = {0};
  if (!wanted(j, block)) return;
  const sf_status status = render_block(j, first, n, &events);
  finish_block(j, block, n, &status, &events);
}

/* A thread that the system refuses would end the program, and more than these have nothing to do. */
static int threads_of_use(const job *j)
{
  int threads = j->threads;
  if (threads > omp_get_num_procs()) threads = omp_get_num_procs();
  return (uint64_t)threads > j->blocks ? (int)j->blocks : threads;
}

static sf_status run(job *j, spikefield_counts *counts)
{
  j->blocks = j->rays / BLOCK + (j->rays % BLOCK > 0);
  j->failed_block = UINT64_MAX, j->failed = sf_ok();
  if (j->rays >= FEW) SF_TRY(fx_core_open(&j->core, &j->view, NULL));
  omp_init_lock(&j->lock);
#pragma omp parallel for schedule(dynamic) num_threads(threads_of_use(j))
  for (uint64_t block = 0; block < j->blocks; block++) run_block(j, block);
  omp_destroy_lock(&j->lock);
  fx_core_close(j->core);
  if (j->failed.code != SF_OK) return j->failed;
  if (j->stopped)
    return sf_fail(SF_E_STOPPED, "stopped after %llu of %llu rays", (unsigned long long)j->done,
                   (unsigned long long)j->rays);
  lib_add_counts(counts, &j->events);
  return sf_ok();
}

static sf_status set_options(job *j, const spikefield_scene *scene, const spikefield_options *options)
{
  SF_TRY(lib_view(scene, options, &j->view));
  j->threads = omp_get_max_threads();
  if (!options) return sf_ok();
  if (options->threads < 0 || options->threads > THREADS_MAX)
    return sf_fail(SF_E_RANGE, "options: threads is %d, expected 0..%d", options->threads, THREADS_MAX);
  if (options->threads) j->threads = options->threads;
  j->progress = options->progress, j->user = options->user;
  return sf_ok();
}

static sf_status run_rays(const spikefield_scene *scene, const spikefield_options *options, const float *origins,
                          const float *directions, size_t n, spikefield_pixel *pixels, spikefield_counts *counts)
{
  job j = {.origins = origins, .directions = directions, .rays = n, .pixels = pixels};
  SF_TRY(set_options(&j, scene, options));
  if (!n) return sf_ok();
  LIB_REQUIRE(origins);
  LIB_REQUIRE(directions);
  LIB_REQUIRE(pixels);
  return run(&j, counts);
}

spikefield_status spikefield_rays(const spikefield_scene *scene, const spikefield_options *options,
                                  const float *origins, const float *directions, size_t n, spikefield_pixel *pixels,
                                  spikefield_counts *counts)
{
  return lib_status(run_rays(scene, options, origins, directions, n, pixels, counts));
}

static sf_status check_camera(const spikefield_camera *camera)
{
  const int32_t side[2] = {camera->width, camera->height};
  const float focal[2] = {camera->fx, camera->fy}, centre[2] = {camera->cx, camera->cy};
  for (int i = 0; i < 2; i++) {
    if (side[i] < 1 || side[i] > SIDE_MAX)
      return sf_fail(SF_E_RANGE, "camera: %s is %d, expected 1..%d", i ? "height" : "width", side[i], SIDE_MAX);
    if (!(focal[i] > 0) || !isfinite(focal[i]))
      return sf_fail(SF_E_RANGE, "camera: %s is %g, expected a positive number", i ? "fy" : "fx", (double)focal[i]);
    if (!isfinite(centre[i]))
      return sf_fail(SF_E_RANGE, "camera: %s is %g, expected a finite number", i ? "cy" : "cx", (double)centre[i]);
  }
  for (int i = 0; i < 12; i++)
    if (!isfinite(camera->to_model[i]))
      return sf_fail(SF_E_RANGE, "camera: to_model[%d] is %g, expected a finite number", i,
                     (double)camera->to_model[i]);
  return sf_ok();
}

static sf_status run_frame(const spikefield_scene *scene, const spikefield_options *options,
                           const spikefield_camera *camera, spikefield_pixel *pixels, spikefield_counts *counts)
{
  job j = {.pixels = pixels};
  SF_TRY(set_options(&j, scene, options));
  LIB_REQUIRE(camera);
  LIB_REQUIRE(pixels);
  SF_TRY(check_camera(camera));
  j.camera = (sf_camera){.width = camera->width,
                         .height = camera->height,
                         .fx = camera->fx,
                         .fy = camera->fy,
                         .cx = camera->cx,
                         .cy = camera->cy};
  for (int i = 0; i < 12; i++) j.camera.to_world[i] = camera->to_model[i];
  j.rays = (uint64_t)camera->width * (uint64_t)camera->height;
  return run(&j, counts);
}

spikefield_status spikefield_frame(const spikefield_scene *scene, const spikefield_options *options,
                                   const spikefield_camera *camera, spikefield_pixel *pixels, spikefield_counts *counts)
{
  return lib_status(run_frame(scene, options, camera, pixels, counts));
}
