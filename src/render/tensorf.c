/* Rendering of a TensoRF model: a ray's weights come from its densities alone, so the samples that count are known
 * before the decoder sees any; they fill blocks across rays. */
#include "base/memory.h"
#include "render/render.h"
#include "render/view.h"
#include "render/vm_ray.h"
#include <stdlib.h>
#include <string.h>

enum { PACKET = 256 };

typedef struct worker {
  const sf_model *model;
  const sf_kernels *kernels;
  sf_vm_field density, appearance;
  const sf_decoder_words *decoder; /* of all workers */
  sf_decoder_block *block;
  sf_net_scratch *scratch;
  sf_vm_samples samples;
  sf_steps intervals;
  int steps, pictures, fill; /* a picture after each of the last steps */
  size_t picture;            /* numbers of one */
  float x[3 * SF_BLOCK], weight[SF_BLOCK];
  float *owner[SF_BLOCK]; /* the ray's colour in the first picture */
  sf_ray_state state;     /* of a model along rays: the ray at hand */
  sf_ray_events events;
} worker;

/* Lanes that hold no sample become the first: spikes of every lane choose between events and dense products. */
static void pad(worker *w)
{
  const int products = w->decoder->view.products, inputs = sf_tensorf_inputs(&w->model->config.tensorf);
  float *product = w->block->product, *in = w->block->in;
  for (int l = w->fill; l < SF_BLOCK; l++) {
    memcpy(product + (size_t)l * (size_t)products, product, (size_t)products * sizeof *product);
    for (int i = 0; i < inputs; i++) in[i * SF_BLOCK + l] = in[i * SF_BLOCK];
  }
}

static void flush(worker *w)
{
  if (!w->fill) return;
  w->kernels->vm_products(&w->appearance, w->x, w->fill, w->block->product, w->decoder->view.products);
  pad(w);
  const sf_net_view *net = &w->decoder->net.view;
  w->block->net.lanes = w->fill;
  w->block->net.from = w->steps - w->pictures;
  if (net->along)
    w->kernels->decoder_along_forward(w->decoder, w->block, w->scratch);
  else
    w->kernels->decoder_forward(w->decoder, w->block, w->steps, 0, w->scratch);
  for (int i = 0; i < w->pictures; i++) {
    const float *colour = w->block->net.colour[w->steps - w->pictures + i];
    for (int l = 0; l < w->fill; l++)
      for (int c = 0; c < 3; c++) w->owner[l][(size_t)i * w->picture + c] += w->weight[l] * colour[c * SF_BLOCK + l];
  }
  for (int l = 0; l < w->fill && net->along; l++) sf_count_lane(net, &w->block->net, 1, l, w->events.spikes);
  w->fill = 0;
  w->block->net.first = 0;
}

/* One ray; what it needs of the decoder comes with a later flush. depth, alpha, samples: NULL or one number each;
 * samples: those that the decoder sees. */
static void render_ray(worker *w, const float *origin, const float *direction, const float background[3], float *rgb,
                       float *depth, float *alpha, float *samples)
{
  const sf_tensorf *f = &w->model->config.tensorf;
  const sf_march march = sf_march_begin(w->model, &w->intervals, origin, direction, 0.5f);
  const sf_vm_direction encoded = sf_vm_encode_direction(w->model, direction);
  float behind, far = 0;
  int decoded = 0;
  const int n = sf_vm_ray(w->kernels, &w->density, &march, w->samples, &behind);
  for (int i = 0; i < w->pictures; i++)
    for (int c = 0; c < 3; c++) rgb[(size_t)i * w->picture + c] = behind * background[c];
  for (int s = 0; s < n; s++) {
    far += w->samples.weight[s] * sf_march_distance(&march, w->samples.lattice[s]);
    if (w->samples.weight[s] <= (float)f->weight_stop) continue;
    w->block->net.first |= (uint64_t)!decoded++ << w->fill;
    w->block->net.state[w->fill] = &w->state;
    memcpy(w->x + 3 * w->fill, w->samples.x + 3 * s, 3 * sizeof(float));
    w->weight[w->fill] = w->samples.weight[s];
    w->owner[w->fill] = rgb;
    sf_vm_put_direction(f, &encoded, w->block->in, w->fill);
    if (++w->fill == SF_BLOCK) flush(w);
  }
  if (depth) *depth = far;
  if (alpha) *alpha = 1 - behind;
  if (samples) *samples = (float)decoded;
  w->events.rays += decoded > 0, w->events.samples += (uint64_t)decoded;
}

static void worker_free(worker *w)
{
  if (!w) return;
  free(w->block);
  free(w->scratch);
  free(w->samples.x);
  free(w->samples.lattice);
  free(w);
}

static worker *worker_create(const sf_model *model, const sf_decoder_words *decoder, int steps, int pictures,
                             size_t picture)
{
  worker *w = sf_aligned_alloc(sizeof *w);
  if (!w) return NULL;
  w->model = model;
  w->steps = steps, w->pictures = pictures, w->picture = picture;
  w->kernels = sf_kernels_select(NULL);
  w->density = sf_vm_field_of(model, false);
  w->appearance = sf_vm_field_of(model, true);
  w->decoder = decoder;
  w->block = sf_aligned_alloc(sizeof *w->block);
  w->scratch = sf_aligned_alloc(sizeof *w->scratch);
  float *at = sf_aligned_alloc(6 * SF_RAY_SAMPLES * sizeof *at);
  w->samples = (sf_vm_samples){at, at + 3 * SF_RAY_SAMPLES, at + 4 * SF_RAY_SAMPLES, at + 5 * SF_RAY_SAMPLES,
                               malloc(SF_RAY_SAMPLES * sizeof(int))};
  if (!w->block || !w->scratch || !at || !w->samples.lattice) {
    worker_free(w);
    return NULL;
  }
  if (sf_march_steps(&w->intervals, model, 1).code) {
    worker_free(w);
    return NULL;
  }
  return w;
}

sf_status sf_render_tensorf(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                            int pictures, const float background[3], float *rgb, float *depth, float *alpha,
                            float *samples, sf_ray_events *events)
{
  sf_decoder_words *decoder = sf_aligned_alloc(sizeof *decoder);
  if (!decoder) return sf_fail(SF_E_MEMORY, "render: no memory for the weights");
  const sf_decoder_view view = sf_decoder_view_of(model);
  sf_kernels_select(NULL)->decoder_prepare(&view, decoder);
  int failed = 0;
#pragma omp parallel reduction(| : failed)
  {
    worker *w = worker_create(model, decoder, steps, pictures, 3 * count);
    failed = !w;
#pragma omp for schedule(dynamic, 1)
    for (size_t first = 0; first < count; first += PACKET) {
      if (failed) continue;
      for (size_t i = first; i < count && i < first + PACKET; i++)
        render_ray(w, origin + 3 * i, direction + 3 * i, background, rgb + 3 * i, depth ? depth + i : NULL,
                   alpha ? alpha + i : NULL, samples ? samples + i : NULL);
      flush(w);
    }
#pragma omp critical
    if (w) sf_events_add(events, &w->events);
    worker_free(w);
  }
  free(decoder);
  return failed ? sf_fail(SF_E_MEMORY, "render: no memory for a block of samples") : sf_ok();
}
