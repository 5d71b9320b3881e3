/* What the field costs a frame in cycles: the rays of a view, tile by tile, through sf_ray_top with a memory of given
 * latencies. Every pixel, every event and the field's counts are compared with the core's; of TensoRF also the cycles
 * with those of the cycle model. usage: bench_field SCENE DATA [VIEW [EVERY [LATENCY...]]] [seed=S] [stall=PERCENT]
 * EVERY: takes every so-many-th tile. LATENCY 0: at random for each line. With stalls the streams make the block wait,
 * so its cycles are not the model's. */
#include "cycles/planes.h"
#include "energy/energy.h"
#include "quant/quant.h"
#include "sim/compare.h"
#include "sim/ray/ray.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

typedef struct frame {
  fx_scene scene;
  sf_dataset data;
  fx_memory memory;
  fx_ray *ray;
  fx_pixel *core, *rtl;
  uint64_t *tile;
  sf_ray_request *request;
  sf_ray_sample *sample;
  int rays;
  size_t samples; /* in sample: read from the field by a hash grid, and TensoRF's densities */
  fx_counts counts;
  sf_dut_options dut;
} frame;

static void read_field(void *user, fx_read what, const uint32_t pos[3])
{
  fx_memory_read(user, what, pos);
}

/* Two passes: pixels of the core, then samples of rays that end where the core's did. */
static sf_status core_rays(frame *f)
{
  const fx_watch watch = {read_field, &f->memory};
  for (int i = 0; i < f->rays; i++) {
    fx_memory_ray(&f->memory, f->tile[i]);
    SF_TRY(fx_render_watched(&f->scene, &f->ray[i], NULL, NULL, &watch, &f->core[i], &f->counts));
  }
  f->samples = f->scene.backbone == FX_INGP ? f->counts.samples : f->counts.field_samples;
  f->sample = calloc(f->samples + SF_RAY_SAMPLES_MAX, sizeof *f->sample);
  if (!f->sample) return sf_fail(SF_E_MEMORY, "no memory for %zu samples", f->samples);
  for (size_t i = 0, at = 0; i < (size_t)f->rays; at += (size_t)f->request[i++].n) {
    f->request[i] = sf_ray_request_as(&f->scene, &f->ray[i], &f->core[i], f->sample + at);
    f->request[i].stops = false, f->request[i].new_tile = i == 0 || f->tile[i] != f->tile[i - 1];
  }
  return sf_ok();
}

static sf_status tile_rays(frame *f, int left, int top)
{
  const sf_view *view = &f->data.view[0];
  for (int y = top; y < top + FX_TILE && y < view->camera.height; y++)
    for (int x = left; x < left + FX_TILE && x < view->camera.width; x++, f->rays++) {
      f->tile[f->rays] = (uint64_t)top << 32 | (uint64_t)left;
      SF_TRY(sf_pixel_ray(&f->scene, &f->data, view, x, y, &f->ray[f->rays]));
    }
  return sf_ok();
}

static sf_status open_frame(frame *f, const char *scene, const char *data, int view, int every)
{
  const sf_dataset_options how = {.first = view, .limit = 1};
  SF_TRY(fx_scene_load(&f->scene, scene));
  SF_TRY(sf_fx_dataset_load(&f->data, &f->scene, scene, data, "test", &how));
  if (f->data.count == 0) return sf_fail(SF_E_RANGE, "%s: no view %d", data, view);
  const fx_cache_shape built = {SF_CACHE_BYTES, SF_CACHE_WAYS};
  SF_TRY(fx_memory_open(&f->memory, &f->scene, &built));
  const sf_camera *camera = &f->data.view[0].camera;
  const size_t pixels = (size_t)camera->width * (size_t)camera->height;
  f->ray = calloc(pixels, sizeof *f->ray), f->tile = calloc(pixels, sizeof *f->tile);
  f->core = calloc(pixels, sizeof *f->core), f->rtl = calloc(pixels, sizeof *f->rtl);
  f->request = calloc(pixels, sizeof *f->request);
  if (!f->ray || !f->tile || !f->core || !f->rtl || !f->request) return sf_fail(SF_E_MEMORY, "no memory for a frame");
  for (int top = 0, n = 0; top < camera->height; top += FX_TILE)
    for (int left = 0; left < camera->width; left += FX_TILE)
      if (n++ % every == 0) SF_TRY(tile_rays(f, left, top));
  return core_rays(f);
}

static void close_frame(frame *f)
{
  free(f->ray), free(f->tile), free(f->core), free(f->rtl), free(f->request), free(f->sample);
  fx_memory_close(&f->memory);
  sf_dataset_free(&f->data);
  fx_scene_free(&f->scene);
}

/* What the cycle model says of the same rays; 0 of a hash grid, whose field is not in it. */
static sf_status model_cycles(const frame *f, int latency, uint64_t *cycles)
{
  const fx_cache_shape cache = {SF_CACHE_BYTES, SF_CACHE_WAYS};
  sf_planes_model *model = NULL;
  *cycles = 0;
  if (f->scene.backbone == FX_INGP) return sf_ok();
  sf_status status = sf_planes_model_open(&model, &f->scene, &sf_engine_default, &cache, latency);
  for (int i = 0; i < f->rays && status.code == SF_OK; i++) {
    sf_planes_record record = {.at = NULL};
    status = sf_planes_record_ray(&record, &f->scene, &f->ray[i]);
    if (status.code == SF_OK) sf_planes_model_add(model, &record, f->request[i].new_tile);
    sf_planes_record_free(&record);
  }
  if (status.code == SF_OK) sf_planes_model_drain(model);
  if (status.code == SF_OK) *cycles = sf_planes_model_totals(model)->cycles;
  sf_planes_model_close(model);
  return status;
}

static sf_status measure(frame *f, int latency)
{
  sf_ray_dut *rays = NULL;
  sf_field_counters field;
  fx_counts counts;
  uint64_t cycles, busy, starved, modelled;
  f->dut.memory_latency = latency;
  SF_TRY(sf_ray_dut_open(&rays, &f->scene, &f->dut));
  const uint64_t before = sf_dut_cycle(rays->dut);
  sf_status status = sf_ray_dut_run(rays, f->request, 0, f->rtl);
  const uint64_t begin =
      2 * sf_dut_cycle(rays->dut) - before; /* what the harness waits around a run is not the frame's */
  if (status.code == SF_OK) status = sf_ray_dut_run(rays, f->request, f->rays, f->rtl);
  const uint64_t end = sf_dut_cycle(rays->dut);
  if (status.code == SF_OK) status = model_cycles(f, latency, &modelled);
  for (int i = 0; i < f->rays && status.code == SF_OK; i++) status = sf_compare_pixel(&f->core[i], &f->rtl[i], end);
  if (status.code == SF_OK) status = sf_ray_dut_field(rays, &field);
  if (status.code == SF_OK) status = sf_compare_field(&f->memory.counts, &field);
  if (status.code == SF_OK) status = sf_dut_counts(rays->dut, &counts, &cycles, &busy, &starved);
  if (status.code == SF_OK) status = sf_compare_ray_counts(&f->scene.net, &f->counts, &counts);
  sf_ray_dut_close(rays);
  SF_TRY(status);
  const double frame = (double)(end - begin), samples = (double)f->samples;
  printf("%7d %12.0f %12" PRIu64 " %14.2f %14.2f %12.2f %% %15.2f %13.2f\n", latency, frame, modelled, frame / samples,
         frame / (double)counts.samples, 100 * (double)field.stalls / frame, (double)field.lookups / samples,
         (double)field.misses / samples);
  return fflush(stdout) ? sf_fail(SF_E_IO, "standard output") : sf_ok();
}

static sf_status run(frame *f, int argc, char **argv)
{
  static const int usual[] = {1, 16, 32, 64, 128};
  const int given = argc > 5 ? argc - 5 : 0, n = given ? given : (int)(sizeof usual / sizeof *usual);
  SF_TRY(
      open_frame(f, argv[1], argv[2], argc > 3 ? atoi(argv[3]) : 0, argc > 4 && atoi(argv[4]) > 0 ? atoi(argv[4]) : 1));
  printf("%d rays, %zu samples, %" PRIu64 " of them through the nets, cache of %d bytes, %d ways\n", f->rays,
         f->samples, f->counts.samples, SF_CACHE_BYTES, SF_CACHE_WAYS);
  printf("latency       cycles    the model  cycles/sample  of the nets    field stalls  look-ups/sample  "
         "misses/sample\n");
  for (int i = 0; i < n; i++) SF_TRY(measure(f, given ? atoi(argv[5 + i]) : usual[i]));
  return sf_ok();
}

/* Takes the words with a name out of the arguments. */
static int take_named(frame *f, int argc, char **argv)
{
  int n = 0;
  for (int i = 0; i < argc; i++)
    if (!strncmp(argv[i], "seed=", 5))
      f->dut.seed = strtoull(argv[i] + 5, NULL, 10);
    else if (!strncmp(argv[i], "stall=", 6))
      f->dut.stall_percent = atoi(argv[i] + 6);
    else
      argv[n++] = argv[i];
  return n;
}

int main(int argc, char **argv)
{
  frame f = {.dut = {.seed = 1}};
  argc = take_named(&f, argc, argv);
  if (argc < 3) {
    fprintf(stderr, "usage: bench_field SCENE DATA [VIEW [EVERY [LATENCY...]]] [seed=S] [stall=PERCENT]\n");
    return 2;
  }
  const sf_status status = run(&f, argc, argv);
  if (status.code != SF_OK) fprintf(stderr, "bench_field: %s\n", status.message);
  close_frame(&f);
  return status.code == SF_OK ? 0 : 1;
}
