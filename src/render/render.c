/* Rendering of the float model: rays in packets, each round packs the next samples of the rays that are still
 * alive into blocks, so that empty space, dead rays and saturated rays cost nothing. */
#include "render/composite.h"
#include "render/march.h"
#include "render/render.h"
#include "base/memory.h"
#include "render/view.h"
#include <math.h>
#include <stdlib.h>

enum { PACKET = 256, BURST = 8 }; /* rays of a packet; samples of one ray per round */

/* What a ray has brought to one picture. */
typedef struct ray_light {
  float transmittance, rgb[3];
} ray_light;

typedef struct ray_state {
  sf_march march;
  float sh[SF_DIR_FEATURES];
  int next;
  bool fresh; /* no sample yet */
  ray_light light[SF_T_MAX];
  float depth, samples; /* of the last picture */
} ray_state;

typedef struct worker {
  const sf_model *model;
  const sf_kernels *kernels;
  const sf_net_words *net; /* of all workers */
  int steps, pictures;     /* a picture after each of the last steps */
  sf_block *block;
  sf_net_scratch *scratch;
  sf_steps intervals;
  float x[3 * SF_BLOCK];
  ray_state ray[PACKET];
  int owner[SF_BLOCK], lattice[SF_BLOCK], fill;
  sf_ray_state state[PACKET]; /* of a model along rays */
  sf_ray_events events;
} worker;

/* The block's samples, in ray order, to the rays of one picture. */
static void composite(worker *w, int picture)
{
  const int step = w->steps - w->pictures + picture;
  const bool last = picture == w->pictures - 1;
  const float *sigma = w->block->sigma[step], *colour = w->block->colour[step];
  for (int l = 0; l < w->fill; l++) {
    ray_state *r = &w->ray[w->owner[l]];
    ray_light *light = &r->light[picture];
    if (light->transmittance < r->march.stop) continue;
    const float delta = w->intervals.length[w->lattice[l]];
    float behind = light->transmittance * expf(-sigma[l] * delta), weight = light->transmittance - behind;
    for (int a = 0; a < 3; a++) light->rgb[a] += weight * colour[a * SF_BLOCK + l];
    light->transmittance = behind;
    if (!last) continue;
    r->depth += weight * sf_march_distance(&r->march, w->lattice[l]);
    r->samples += 1;
    if (w->net->view.along) sf_count_lane(&w->net->view, w->block, 0, l, w->events.spikes);
  }
}

/* Evaluates the block that was filled and composites its samples. */
static void flush(worker *w)
{
  if (!w->fill) return;
  for (int l = w->fill; l < SF_BLOCK; l++) { /* spikes of every lane choose between events and dense products */
    for (int a = 0; a < 3; a++) w->x[a * SF_BLOCK + l] = w->x[a * SF_BLOCK];
    for (int i = 0; i < SF_DIR_FEATURES; i++) w->block->sh[i * SF_BLOCK + l] = w->block->sh[i * SF_BLOCK];
  }
  const float *table = sf_model_param(w->model, SF_P_GRID);
  for (int level = 0; level < w->model->config.levels; level++)
    w->kernels->grid_forward(&w->model->level[level], table, w->x, w->block->f + 2 * level * SF_BLOCK);
  w->block->lanes = w->fill;
  w->block->from = w->steps - w->pictures;
  if (w->net->view.along)
    w->kernels->along_forward(w->net, w->block, w->scratch);
  else
    w->kernels->forward(w->net, w->block, w->steps, 0, w->scratch);
  for (int i = 0; i < w->pictures; i++) composite(w, i);
  w->fill = 0;
  w->block->first = 0;
}

static void add_sample(worker *w, int ray, int n, const float x[3])
{
  const int l = w->fill++;
  for (int a = 0; a < 3; a++) w->x[a * SF_BLOCK + l] = x[a];
  for (int i = 0; i < SF_DIR_FEATURES; i++) w->block->sh[i * SF_BLOCK + l] = w->ray[ray].sh[i];
  w->owner[l] = ray;
  w->lattice[l] = n;
  w->block->state[l] = &w->state[ray];
  w->block->first |= (uint64_t)w->ray[ray].fresh << l;
  w->ray[ray].fresh = false;
  if (w->fill == SF_BLOCK) flush(w);
}

/* Whether a picture has light left for the ray's next sample. */
static bool goes_on(const worker *w, const ray_state *r)
{
  if (r->next < 0) return false;
  for (int i = 0; i < w->pictures; i++)
    if (r->light[i].transmittance >= r->march.stop) return true;
  return false;
}

static void render_packet(worker *w, int count)
{
  for (int alive = 1; alive;) {
    alive = 0;
    for (int i = 0; i < count; i++) {
      ray_state *r = &w->ray[i];
      for (int burst = 0; burst < BURST && goes_on(w, r); burst++) {
        float x[3];
        int n = sf_march_next(&r->march, r->next, x);
        r->next = n < 0 ? -1 : n + 1;
        if (n >= 0) add_sample(w, i, n, x);
      }
      alive |= goes_on(w, r);
    }
    flush(w);
  }
}

static worker *worker_create(const sf_model *model, const sf_net_words *net, int steps, int pictures)
{
  worker *w = sf_aligned_alloc(sizeof *w);
  if (!w) return NULL;
  w->model = model;
  w->kernels = sf_kernels_select(NULL);
  w->net = net;
  w->steps = steps, w->pictures = pictures;
  w->block = sf_aligned_alloc(sizeof *w->block);
  w->scratch = sf_aligned_alloc(sizeof *w->scratch);
  return w;
}

static void worker_free(worker *w)
{
  if (!w) return;
  free(w->block);
  free(w->scratch);
  free(w);
}

static void begin_packet(worker *w, const float *origin, const float *direction, int count)
{
  for (int i = 0; i < count; i++) {
    const float *o = origin + 3 * i, *d = direction + 3 * i;
    w->ray[i] = (ray_state){.march = sf_march_begin(w->model, &w->intervals, o, d, 0.5f), .fresh = true};
    for (int k = 0; k < w->pictures; k++) w->ray[i].light[k].transmittance = 1;
    sf_sh4(d, w->ray[i].sh);
    sf_scales_round_direction(&w->model->scales, w->ray[i].sh, SF_DIR_FEATURES);
  }
}

/* The packet's rays, from number `first` of `all` on. */
static void end_packet(worker *w, size_t first, size_t all, int count, const float background[3], float *rgb,
                       float *depth, float *alpha, float *samples)
{
  for (int i = 0; i < count; i++) {
    const ray_state *r = &w->ray[i];
    for (int k = 0; k < w->pictures; k++)
      for (int a = 0; a < 3; a++)
        rgb[3 * ((size_t)k * all + first + i) + a] = r->light[k].rgb[a] + r->light[k].transmittance * background[a];
    if (depth) depth[first + i] = r->depth;
    if (alpha) alpha[first + i] = 1 - r->light[w->pictures - 1].transmittance;
    if (samples) samples[first + i] = r->samples;
    w->events.rays += r->samples > 0, w->events.samples += (uint64_t)r->samples;
  }
}

/* As sf_render_counted, with steps in 1..T. rgb [pictures][count][3]: after steps - pictures + 1 to steps steps. */
static sf_status render(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                        int pictures, const float background[3], float *rgb, float *depth, float *alpha, float *samples,
                        sf_ray_events *events)
{
  if (sf_model_decodes(model)) /* its weights are known before it decodes */
    return sf_render_tensorf(model, origin, direction, count, steps, pictures, background, rgb, depth, alpha, samples,
                             events);
  sf_steps intervals;
  SF_TRY(sf_march_steps(&intervals, model, 1));
  sf_net_words *net = sf_aligned_alloc(sizeof *net);
  if (!net) return sf_fail(SF_E_MEMORY, "render: no memory for the weights");
  const sf_net_view view = sf_net_view_of(model);
  sf_kernels_select(NULL)->prepare(&view, net);
  int failed = 0;
#pragma omp parallel reduction(| : failed)
  {
    worker *w = worker_create(model, net, steps, pictures);
    failed = !w || !w->block || !w->scratch;
    if (!failed) w->intervals = intervals;
#pragma omp for schedule(dynamic, 1)
    for (size_t first = 0; first < count; first += PACKET) {
      if (failed) continue;
      const int n = (int)(count - first < PACKET ? count - first : PACKET);
      begin_packet(w, origin + 3 * first, direction + 3 * first, n);
      render_packet(w, n);
      end_packet(w, first, count, n, background, rgb, depth, alpha, samples);
    }
#pragma omp critical
    if (w) sf_events_add(events, &w->events);
    worker_free(w);
  }
  free(net);
  return failed ? sf_fail(SF_E_MEMORY, "render: no memory for a block of samples") : sf_ok();
}

sf_status sf_render_counted(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                            const float background[3], float *rgb, float *depth, float *alpha, float *samples,
                            sf_ray_events *events)
{
  if (steps < 0 || steps > model->config.steps)
    return sf_fail(SF_E_RANGE, "render: %d steps, the model has %d", steps, model->config.steps);
  return render(model, origin, direction, count, steps ? steps : model->t_r, 1, background, rgb, depth, alpha, samples,
                events);
}

sf_status sf_render_rays(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                         const float background[3], float *rgb, float *depth, float *alpha, float *samples)
{
  sf_ray_events events = {0};
  return sf_render_counted(model, origin, direction, count, steps, background, rgb, depth, alpha, samples, &events);
}

sf_status sf_render_prefixes(const sf_model *model, const float *origin, const float *direction, size_t count,
                             const float background[3], float *rgb)
{
  sf_ray_events events = {0};
  const int steps = model->config.steps;
  return render(model, origin, direction, count, steps, steps, background, rgb, NULL, NULL, NULL, &events);
}
