/* Many rays: in each round the next sample of up to FX_BLOCK rays goes through grid and nets together, and a ray that
 * has ended makes room for the next. So no ray ever takes a sample that fx_render_ray would not. */
#include "src/fx/core.h"
#include "src/fx/march.h"
#include "src/fx/memory.h"
#include "src/fx/scene.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

typedef struct slot {
  size_t ray;
  int32_t at;    /* lattice point of its sample */
  int32_t *base; /* one of wave.base */
} slot;

typedef struct wave {
  fx_block block;
  fx_scratch scratch;
  int32_t base[FX_BLOCK][SF_LANES];
  slot slot[FX_BLOCK]; /* 0..block.n-1 in use; the others own the free bases */
  const fx_core *core;
  const fx_ray *rays;
  fx_pixel *pixels;
  fx_cost *costs;
  fx_firing firing;
  fx_counts counts; /* but for the nets' events, which follow from firing and rays */
  fx_log *log;      /* NULL: nobody asks */
} wave;

/* Moves slot i to the next occupied point from n on; false at the end of the ray. */
static bool advance(wave *w, int i, int32_t n)
{
  uint32_t pos[3];
  slot *s = &w->slot[i];
  s->at = fx_core_march(w->core, &w->rays[s->ray], n, pos, &w->counts);
  if (s->at < 0) return false;
  for (int axis = 0; axis < 3; axis++) w->block.pos[axis][i] = pos[axis];
  return true;
}

static void begin_ray(wave *w, size_t index)
{
  const int i = w->block.n;
  slot *s = &w->slot[i];
  fx_composite_begin(&w->pixels[index]);
  s->ray = index;
  if (!advance(w, i, 0)) {
    fx_composite_end(&w->pixels[index], w->core->scene->background);
    return;
  }
  fx_net_direction(&w->core->scene->net, w->rays[index].dir, s->base, NULL);
  w->counts.rays++;
  if (w->costs) w->costs[index].macs = fx_macs_of_ray(&w->core->scene->net);
  w->block.n++;
}

/* The last slot takes the place of slot i. */
static void end_ray(wave *w, int i)
{
  const int last = --w->block.n;
  const slot ended = w->slot[i];
  fx_composite_end(&w->pixels[ended.ray], w->core->scene->background);
  w->slot[i] = w->slot[last];
  w->slot[last] = ended;
  for (int axis = 0; axis < 3; axis++) w->block.pos[axis][i] = w->block.pos[axis][last];
}

/* Adds the sample to its ray; true when the ray goes on. */
static bool composite(wave *w, int i)
{
  const fx_scene *scene = w->core->scene;
  const slot *s = &w->slot[i];
  const fx_ray *ray = &w->rays[s->ray];
  fx_pixel *pixel = &w->pixels[s->ray];
  fx_composite_add(pixel, &w->block.out[i], fx_delta(scene, s->at), fx_distance(scene, ray, s->at));
  return pixel->transmittance > (uint32_t)scene->trans_stop && pixel->samples < (uint32_t)scene->max_samples;
}

static void round_of_samples(wave *w)
{
  const fx_core *core = w->core;
  fx_block *b = &w->block;
  bool ended[FX_BLOCK];
  for (int i = 0; i < b->n; i++) b->base[i] = w->slot[i].base;
  w->counts.saturated_features += core->kernels->features(&core->scene->grid, b);
  core->kernels->nets(core, b, &w->scratch);
  fx_firing_sum(&w->firing, &b->firing);
  for (int i = 0; i < b->n; i++) {
    if (w->log) fx_log_sample(w->log, b, i, core->scene->net.steps, (uint32_t)w->slot[i].ray);
    fx_block_account(core, b, i, &w->counts, w->costs ? &w->costs[w->slot[i].ray] : NULL);
    ended[i] = !composite(w, i) || !advance(w, i, w->slot[i].at + 1);
  }
  for (int i = b->n - 1; i >= 0; i--)
    if (ended[i]) end_ray(w, i);
}

static void add_counts(const wave *w, fx_counts *counts)
{
  const fx_scene *scene = w->core->scene;
  fx_counts sum = w->counts;
  sum.rays = 0;
  fx_count_rays(&sum, &scene->net, w->counts.rays);
  fx_count_firing(&sum, &scene->net, &w->firing);
  sum.grid_bytes = w->firing.samples * fx_grid_bytes(&scene->grid);
  fx_counts_add(counts, &sum);
}

/* log: NULL, or gets every sample. */
static sf_status render(const fx_core *core, fx_log *log, const fx_ray *rays, size_t n, fx_pixel *pixels,
                        fx_cost *costs, fx_counts *counts)
{
  sf_status status = sf_ok();
  wave *w = sf_aligned_alloc(sizeof *w);
  if (!w) return sf_fail(SF_E_MEMORY, "no memory for a block of %d samples", FX_BLOCK);
  w->core = core, w->rays = rays, w->pixels = pixels, w->costs = costs, w->log = log;
  for (int i = 0; i < FX_BLOCK; i++) w->slot[i].base = w->base[i];
  if (costs) memset(costs, 0, n * sizeof *costs);
  for (size_t next = 0; (next < n || w->block.n > 0) && status.code == SF_OK;) {
    while (next < n && w->block.n < FX_BLOCK) begin_ray(w, next++);
    if (log) status = fx_log_reserve(log);
    if (w->block.n > 0 && status.code == SF_OK) round_of_samples(w);
  }
  if (counts && status.code == SF_OK) add_counts(w, counts);
  free(w);
  return status;
}

sf_status fx_render_rays(const fx_core *core, const fx_ray *rays, size_t n, fx_pixel *pixels, fx_cost *costs,
                         fx_counts *counts)
{
  if (core->scene->backbone == FX_TENSORF) return fx_render_tensorf(core, NULL, NULL, rays, n, pixels, costs, counts);
  return render(core, NULL, rays, n, pixels, costs, counts);
}

enum { PIECE = 2048 }; /* rays whose samples are logged at a time */

sf_status fx_render_list(const fx_core *core, fx_memory *memory, const uint64_t *tile, const fx_ray *rays, size_t n,
                         fx_pixel *pixels, fx_cost *costs, fx_counts *counts)
{
  memory->kernels = core->kernels;
  if (core->scene->backbone == FX_TENSORF) return fx_render_tensorf(core, memory, tile, rays, n, pixels, costs, counts);
  for (size_t first = 0; first < n; first += PIECE) {
    const size_t rest = n - first < PIECE ? n - first : PIECE;
    memory->log.count = 0;
    SF_TRY(render(core, &memory->log, rays + first, rest, pixels + first, costs ? costs + first : NULL, counts));
    SF_TRY(fx_memory_replay(memory, tile + first, pixels + first, rest));
  }
  return sf_ok();
}
