/* Many rays of a TensoRF scene. Densities alone decide where a ray ends and which of its samples are decoded, so a ray
 * is marched to its end at once; its samples wait for the decoder until a block is full, whosever they are. Colours are
 * sums of integers: their order does not matter. */
#include "src/fx/core.h"
#include "src/fx/memory.h"
#include "src/fx/tensorf.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>
#include "src/fx/nofloat.h"

typedef struct waiting {
  size_t ray;
  uint64_t run; /* of the ray; without memory 0 */
  uint32_t weight;
} waiting;

typedef struct wave {
  fx_block block;
  fx_scratch scratch;
  waiting sample[FX_BLOCK]; /* 0..block.n-1 */
  const fx_core *core;
  const fx_ray *rays;
  fx_pixel *pixels;
  fx_cost *costs;
  fx_firing firing;
  fx_counts counts;  /* but for the nets' events, which follow from firing */
  fx_memory *memory; /* NULL: nobody asks */
  uint64_t run;      /* of the ray that is marched */
} wave;

static void share_rows(wave *w, int i)
{
  if (!w->memory) return;
  const fx_fired fired = fx_block_fired(&w->block, i, w->core->scene->net.steps);
  fx_memory_sample(w->memory, w->sample[i].run, &fired);
}

static void ask(wave *w, fx_read what, const uint32_t pos[3])
{
  if (w->memory) fx_memory_read(w->memory, what, pos);
}

static void decode(wave *w)
{
  fx_block *b = &w->block;
  w->core->kernels->nets(w->core, b, &w->scratch);
  fx_firing_sum(&w->firing, &b->firing);
  for (int i = 0; i < b->n; i++) {
    const waiting *s = &w->sample[i];
    fx_block_account(w->core, b, i, &w->counts, w->costs ? &w->costs[s->ray] : NULL);
    fx_composite_colour(&w->pixels[s->ray], s->weight, b->out[i].colour);
    share_rows(w, i);
  }
  b->n = 0;
}

static void enqueue(wave *w, size_t ray, const uint32_t pos[3], uint32_t weight)
{
  const fx_scene *scene = w->core->scene;
  fx_block *b = &w->block;
  fx_vm_encode(&scene->tensorf, w->core->kernels->vm, pos, w->rays[ray].unit, b->constant[b->n], &w->counts);
  w->sample[b->n++] = (waiting){ray, w->run, weight};
  if (b->n == FX_BLOCK) decode(w);
}

/* Positions whose densities were read, and whose appearances were not: see cache.h. */
typedef struct window {
  uint32_t pos[FX_AHEAD + 1][3];
  bool decoded[FX_AHEAD + 1];
  unsigned first, last; /* those between wait */
} window;

static void read_oldest(wave *w, window *late)
{
  const unsigned i = late->first++ % (FX_AHEAD + 1);
  if (late->decoded[i]) ask(w, FX_READ_APPEARANCE, late->pos[i]);
}

static void read_density(wave *w, window *late, const uint32_t pos[3])
{
  if (late->last - late->first > FX_AHEAD) read_oldest(w, late);
  const unsigned i = late->last++ % (FX_AHEAD + 1);
  ask(w, FX_READ_DENSITY, pos);
  memcpy(late->pos[i], pos, sizeof late->pos[i]);
  late->decoded[i] = false;
}

/* Densities that are read before it is known that the ray ends at n. */
static void read_behind(wave *w, window *late, const fx_ray *ray, int32_t n)
{
  uint32_t pos[3];
  for (int i = 0; i < FX_AHEAD && (n = fx_core_march(w->core, ray, n + 1, pos, NULL)) >= 0; i++) {
    fx_tensorf_count_density(&w->core->scene->tensorf, &w->counts);
    read_density(w, late, pos);
  }
}

static void march(wave *w, size_t index)
{
  const fx_scene *scene = w->core->scene;
  const fx_ray *ray = &w->rays[index];
  fx_pixel *pixel = &w->pixels[index];
  window late = {.first = 0};
  int32_t decoded = 0;
  uint32_t pos[3];
  fx_composite_begin(pixel);
  for (int32_t n = fx_core_march(w->core, ray, 0, pos, &w->counts); n >= 0;
       n = fx_core_march(w->core, ray, n + 1, pos, &w->counts)) {
    read_density(w, &late, pos);
    const uint32_t weight = fx_tensorf_weight(scene, w->core->kernels->vm, ray, n, pos, pixel, &w->counts);
    late.decoded[(late.last - 1) % (FX_AHEAD + 1)] = weight > 0;
    if (weight) enqueue(w, index, pos, weight), decoded++;
    if (pixel->transmittance <= (uint32_t)scene->trans_stop || decoded >= scene->max_samples) {
      read_behind(w, &late, ray, n);
      break;
    }
  }
  while (late.first != late.last) read_oldest(w, &late);
  fx_composite_end(pixel, scene->background);
  w->counts.rays += decoded > 0;
}

sf_status fx_render_tensorf(const fx_core *core, fx_memory *memory, const uint64_t *tile, const fx_ray *rays, size_t n,
                            fx_pixel *pixels, fx_cost *costs, fx_counts *counts)
{
  wave *w = sf_aligned_alloc(sizeof *w);
  if (!w) return sf_fail(SF_E_MEMORY, "no memory for a block of %d samples", FX_BLOCK);
  w->core = core, w->rays = rays, w->pixels = pixels, w->costs = costs, w->memory = memory;
  if (costs) memset(costs, 0, n * sizeof *costs);
  for (size_t i = 0; i < n; i++) {
    if (memory) w->run = fx_memory_ray(memory, tile[i]);
    march(w, i);
  }
  if (w->block.n > 0) decode(w);
  if (counts) {
    fx_count_firing(&w->counts, &core->scene->net, &w->firing);
    fx_counts_add(counts, &w->counts);
  }
  free(w);
  return sf_ok();
}
