/* Calibration of a TensoRF model: points where its decoder is asked, and what the float field and decoder do there. */
#include "base/rng.h"
#include "src/quant/tensorf.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 4096, TRIES = 2048, BLOCK = 32 };
enum { STREAM_PLACE = 111, STREAM_DIRECTION };
static const float SEEN = 0.01f; /* opacity of one sample */

static sf_status allocate(sf_vm_calibration *c)
{
  const size_t n = (size_t)c->samples, rows = n * (size_t)c->steps, hidden = (size_t)c->hidden;
  c->pos = calloc(n * 3, sizeof *c->pos);
  c->direction = calloc(n * 3, sizeof *c->direction);
  c->features = calloc(n * (size_t)c->n_features, sizeof *c->features);
  c->inputs = calloc(n * (size_t)c->n_inputs, sizeof *c->inputs);
  c->current[0] = calloc(n * hidden, sizeof(float));
  c->current[1] = calloc(rows * hidden, sizeof(float));
  c->current[2] = calloc(rows * 3, sizeof(float));
  for (int l = 0; l < 2; l++) c->spikes[l] = calloc(rows * hidden, 1);
  if (c->pos && c->direction && c->features && c->inputs && c->current[0] && c->current[1] && c->current[2] &&
      c->spikes[0] && c->spikes[1])
    return sf_ok();
  return sf_fail(SF_E_MEMORY, "quantiser: no memory for %d calibration samples", c->samples);
}

void sf_vm_calibration_free(sf_vm_calibration *c)
{
  free(c->pos), free(c->direction), free(c->features), free(c->inputs);
  for (int l = 0; l < 3; l++) free(c->current[l]);
  for (int l = 0; l < 2; l++) free(c->spikes[l]);
  memset(c, 0, sizeof *c);
}

static bool occupied(const sf_model *model, const uint32_t pos[3])
{
  const uint64_t res = (uint64_t)model->config.occ_res;
  uint64_t cell = 0;
  for (int axis = 2; axis >= 0; axis--) cell = cell * res + (pos[axis] * res >> SF_POS_FRAC);
  return model->occupancy[cell >> 3] >> (cell & 7) & 1;
}

static float opacity(const sf_model *model, const uint32_t pos[3])
{
  const sf_tensorf *field = &model->config.tensorf;
  float x[3];
  sf_vm_position(pos, x);
  return 1 - expf(-sf_tensorf_sigma(field, sf_tensorf_density_feature(model, x)) * sf_tensorf_step(field));
}

/* A point that is seen; failing that an occupied one, failing that any. */
static void draw_position(const sf_model *model, uint64_t seed, int sample, uint32_t *pos)
{
  int rank = -1;
  for (int i = 0; i < TRIES && rank < 2; i++) {
    uint32_t at[3];
    for (int axis = 0; axis < 3; axis++)
      at[axis] = (uint32_t)sf_random_below(
          seed, STREAM_PLACE, ((uint64_t)sample * TRIES + (uint64_t)i) * 3 + (uint64_t)axis, 1 << SF_POS_FRAC);
    const int now = !occupied(model, at) ? 0 : opacity(model, at) < SEEN ? 1 : 2;
    if (now <= rank) continue;
    rank = now;
    memcpy(pos, at, sizeof at);
  }
}

static void draw_direction(float *direction, uint64_t seed, int sample)
{
  const float z = 2 * sf_random_float(seed, STREAM_DIRECTION, (uint64_t)sample * 2) - 1;
  const float angle = 6.2831853f * sf_random_float(seed, STREAM_DIRECTION, (uint64_t)sample * 2 + 1);
  const float r = sqrtf(fmaxf(0, 1 - z * z));
  direction[0] = r * cosf(angle), direction[1] = r * sinf(angle), direction[2] = z;
}

static void keep_trace(sf_vm_calibration *c, const sf_net_trace *trace, size_t sample)
{
  const size_t hidden = (size_t)c->hidden;
  memcpy(c->current[0] + sample * hidden, trace->current[FX_C1][0], hidden * sizeof(float));
  for (size_t t = 0; t < (size_t)c->steps; t++) {
    const size_t row = sample * (size_t)c->steps + t;
    memcpy(c->current[1] + row * hidden, trace->current[FX_C2][t], hidden * sizeof(float));
    memcpy(c->current[2] + row * 3, trace->current[FX_C3][t], 3 * sizeof(float));
    memcpy(c->spikes[0] + row * hidden, trace->spike[FX_C1][t], hidden);
    memcpy(c->spikes[1] + row * hidden, trace->spike[FX_C2][t], hidden);
  }
}

static void run_sample(sf_vm_calibration *c, const sf_model *model, int sample, uint64_t seed, sf_net_trace *trace)
{
  float x[3], colour[SF_T_MAX * 3];
  float *features = c->features + (size_t)sample * (size_t)c->n_features,
        *direction = c->direction + (size_t)sample * 3, *inputs = c->inputs + (size_t)sample * (size_t)c->n_inputs;
  draw_position(model, seed, sample, c->pos + (size_t)sample * 3);
  draw_direction(direction, seed, sample);
  sf_vm_position(c->pos + (size_t)sample * 3, x);
  sf_tensorf_appearance(model, x, features);
  sf_tensorf_encode(&model->config.tensorf, features, direction, inputs);
  memset(trace, 0, sizeof *trace);
  sf_net_sample(model, inputs, NULL, c->steps, NULL, colour, trace);
  keep_trace(c, trace, (size_t)sample);
}

sf_status sf_vm_calibrate(sf_vm_calibration *c, const sf_model *model, int steps, uint64_t seed)
{
  const sf_tensorf *field = &model->config.tensorf;
  bool ok = true;
  *c = (sf_vm_calibration){.samples = SAMPLES,
                           .steps = steps,
                           .hidden = model->config.hidden,
                           .n_features = field->features,
                           .n_inputs = sf_tensorf_inputs(field)};
  SF_TRY(allocate(c));
#pragma omp parallel
  {
    sf_net_trace *trace = malloc(sizeof *trace);
#pragma omp for schedule(static, BLOCK)
    for (int sample = 0; sample < c->samples; sample++)
      if (trace) run_sample(c, model, sample, seed, trace);
    if (!trace) {
#pragma omp atomic write
      ok = false;
    }
    free(trace);
  }
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "quantiser: no memory for a calibration trace");
}
