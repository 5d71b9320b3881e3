/* Calibration samples: where the float field and nets are asked, and what they say. */
#include "base/rng.h"
#include "src/quant/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 4096, BLOCK = 32 };

/* From the model alone: sizes[l] inputs and outputs of layer l; 0 where the net has no such layer. */
typedef struct sizes {
  size_t n_in[SF_LAYERS], n_out[SF_LAYERS];
} sizes;

static sizes sizes_of(const sf_model *model)
{
  sizes s = {0};
  for (int l = 0; l < SF_LAYERS; l++) {
    if (!sf_model_has(model, sf_layer_weights[l])) continue;
    s.n_out[l] = (size_t)model->param[sf_layer_weights[l]].shape[0];
    s.n_in[l] = (size_t)model->param[sf_layer_weights[l]].shape[1];
  }
  return s;
}

/* Rows of spikes that a sample has. */
static size_t trains_of(const sf_calibration *c)
{
  return c->digits ? 1 : (size_t)c->steps;
}

static sf_status allocate(sf_calibration *c, const sizes *s)
{
  const size_t samples = (size_t)c->samples;
  bool ok = (c->pos = calloc(samples * 3, sizeof *c->pos)) &&
            (c->f = calloc(samples, (size_t)c->features * sizeof *c->f)) &&
            (c->constant = calloc(samples, (size_t)c->constants * sizeof *c->constant));
  for (int l = 0; l < SF_LAYERS && ok; l++) {
    const size_t rows = samples * (size_t)c->per_sample[l];
    if (!rows) continue;
    ok = (c->target[l] = calloc(rows, s->n_out[l] * sizeof(float))) != NULL;
    if (ok && fx_layer_fires(l)) ok = (c->spikes[l] = calloc(samples * trains_of(c), s->n_out[l])) != NULL;
  }
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "quantiser: no memory for %d calibration samples", c->samples);
}

void sf_calibration_free(sf_calibration *c)
{
  free(c->pos), free(c->f), free(c->constant);
  for (int l = 0; l < SF_LAYERS; l++) free(c->target[l]), free(c->spikes[l]);
  memset(c, 0, sizeof *c);
}

static void draw_direction(float *direction, uint64_t seed, uint64_t stream, int sample)
{
  const float z = 2 * sf_random_float(seed, stream, (uint64_t)sample * 2) - 1;
  const float angle = 6.2831853f * sf_random_float(seed, stream, (uint64_t)sample * 2 + 1);
  const float r = sqrtf(fmaxf(0, 1 - z * z));
  direction[0] = r * cosf(angle), direction[1] = r * sinf(angle), direction[2] = z;
}

static void keep_digits(sf_calibration *c, const sizes *s, const sf_net_trace *trace, size_t sample)
{
  for (int l = 0; l < SF_LAYERS; l++)
    for (size_t o = 0, at = sample * s->n_out[l]; o < s->n_out[l]; o++, at++)
      for (int t = 0, value = 1 << (c->digits - 1); t < c->digits; t++, value /= 2) {
        if (fx_layer_fires(l)) c->spikes[l][at] += (uint8_t)(value * (trace->spike[l][t][o] != 0));
        if (!fx_layer_fires(l)) c->target[l][at] += (float)value * trace->current[l][t][o];
        if (t == 0 && fx_layer_fires(l))
          c->target[l][at] = trace->current[l][t][o] * (float)(fx_layer_reads_spikes(l) ? 2 * value - 1 : 1);
      }
}

static void keep_steps(sf_calibration *c, const sizes *s, const sf_net_trace *trace, size_t sample)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    const size_t n = s->n_out[l], rows = (size_t)c->per_sample[l], steps = (size_t)c->steps;
    for (size_t t = 0; t < rows; t++)
      memcpy(c->target[l] + (sample * rows + t) * n, trace->current[l][t], n * sizeof(float));
    for (size_t t = 0; t < steps && c->spikes[l]; t++)
      memcpy(c->spikes[l] + (sample * steps + t) * n, trace->spike[l][t], n);
  }
}

static void run_sample(sf_calibration *c, const sf_model *model, const sf_field_quantiser *field, const sizes *s,
                       int sample, uint64_t seed, sf_net_trace *trace)
{
  float x[3], direction[3];
  sf_calibration_position(c->pos + (size_t)sample * 3, x);
  draw_direction(direction, seed, field->direction_stream, sample);
  memset(trace, 0, sizeof *trace);
  field->sample(model, x, direction, c->steps, c->f + (size_t)sample * (size_t)c->features,
                c->constant + (size_t)sample * (size_t)c->constants, trace);
  (c->digits ? keep_digits : keep_steps)(c, s, trace, (size_t)sample);
}

static sf_status run_samples(sf_calibration *c, const sf_model *model, const sf_field_quantiser *field, const sizes *s,
                             uint64_t seed)
{
  bool ok = true;
#pragma omp parallel
  {
    sf_net_trace *trace = malloc(sizeof *trace);
#pragma omp for schedule(static, BLOCK)
    for (int sample = 0; sample < c->samples; sample++)
      if (trace) run_sample(c, model, field, s, sample, seed, trace);
    if (!trace) {
#pragma omp atomic write
      ok = false;
    }
    free(trace);
  }
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "quantiser: no memory for a calibration trace");
}

sf_status sf_calibrate(sf_calibration *c, const sf_model *model, int steps, uint64_t seed)
{
  const sf_field_quantiser *field = sf_field_quantiser_of(model);
  const sizes s = sizes_of(model);
  const size_t h = s.n_out[FX_D2] ? s.n_out[FX_D2] - 1 : 0;
  *c = (sf_calibration){.samples = SAMPLES,
                        .steps = steps,
                        .digits = model->config.mode == SF_RADIX ? steps : 0,
                        .features = field->features(model),
                        .constants = (int)(s.n_in[FX_C1] - h)};
  for (int l = 0; l < SF_LAYERS; l++) c->per_sample[l] = !s.n_out[l] ? 0 : c->digits || (l == FX_C1 && !h) ? 1 : steps;
  SF_TRY(allocate(c, &s));
  SF_TRY(field->draw(c, model, seed));
  return run_samples(c, model, field, &s, seed);
}
