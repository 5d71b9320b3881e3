/* The float model on file, its settled scales, and its nets. */
#ifndef SF_SNN_MODEL_H
#define SF_SNN_MODEL_H
#include "field/model.h"

/* model.safetensors: the tensors above by name, "occupancy", metadata config + t_star + t_r. Every load check names
 * file and tensor. A checkpoint holds further tensors (optimiser) that this ignores. */
sf_status sf_model_load(sf_model *model, const char *path);
/* The model alone; atomic. */
sf_status sf_model_save(const sf_model *model, const char *path);
/* The same in parts, for files that hold more: metadata, and SF_P_COUNT + 2 tensors at most (how many). */
void sf_model_describe(const sf_model *model, cJSON *metadata);
int sf_model_tensors(const sf_model *model, sf_tensor *list);

/* All LSBs 1. */
void sf_scales_clear(sf_scales *scales);
/* Value of one LSB of input `input` of layer D1 D2 C1 C2 C3 (1 for spikes). */
double sf_scales_input(const sf_model *model, int layer, int input);
/* Weights, biases, basis matrix and leaks of model->value rounded to its settled scales, into value (laid out alike,
 * may be the same); the field's entries where they are narrow, else value keeps what it has of them. */
void sf_scales_round(const sf_model *model, float *value);
/* Entries are narrower than the core's: they are rounded as weights are. */
bool sf_scales_narrow_field(const sf_scales *scales);
/* Spherical harmonics, or a decoder's direction and encodings, to multiples of their LSB, as the accelerator gets them;
 * as they are while nothing is settled. */
void sf_scales_round_direction(const sf_scales *scales, float *value, int count);
/* Steps of a decoder's features, and of its other inputs; 0: they are as they are. */
float sf_scales_feature_step(const sf_scales *scales);
float sf_scales_direction_step(const sf_scales *scales);
/* Step to whose multiples h is rounded down once the scales are settled, as the accelerator does; 0: h is not. */
float sf_scales_h_step(const sf_scales *scales);

/* Float nets, one sample, scalar and obvious: the oracle. in: the features of a hash grid, or a decoder's inputs; sh:
 * the spherical harmonics, which a decoder does not read. Outputs for every prefix 1..steps: sigma[steps] per model
 * unit (not written by a decoder), colour[steps][3]. trace: per-layer currents and spikes for calibration, or NULL. */
typedef struct sf_net_trace {
  float current[SF_LAYERS][SF_T_MAX][SF_LANES];  /* what enters each neuron, layers D1 D2 C1 C2 C3 */
  float membrane[SF_LAYERS][SF_T_MAX][SF_LANES]; /* before fire and reset; integrators: after */
  uint8_t spike[SF_LAYERS][SF_T_MAX][SF_LANES];
} sf_net_trace;
void sf_net_sample(const sf_model *model, const float *in, const float *sh, int steps, float *sigma, float *colour,
                   sf_net_trace *trace);

/* Renders `count` rays on all threads through the vector kernels, the first `steps` steps (0 = t_r).
 * origin, direction [count][3]; rgb [count][3], depth, alpha, samples [count] (each may be NULL but rgb).
 * samples: those that the nets see; of TensoRF, those that the decoder sees.
 * background: 3 floats. Empty space is skipped; rays stop where the light is gone (sf_opaque). */
sf_status sf_render_rays(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                         const float background[3], float *rgb, float *depth, float *alpha, float *samples);
/* The pictures after 1..T steps: rgb [T][count][3], each as sf_render_rays has it. */
sf_status sf_render_prefixes(const sf_model *model, const float *origin, const float *direction, size_t count,
                             const float background[3], float *rgb);

/* What the rays of a model along rays cost: those that meet a sample, their samples, and the spikes of D1, C1, C2
 * there.
 */
typedef struct sf_ray_events {
  uint64_t rays, samples, spikes[3];
} sf_ray_events;
void sf_events_add(sf_ray_events *to, const sf_ray_events *events);
/* The same, which counts. events: added to; other models: without spikes. */
sf_status sf_render_counted(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                            const float background[3], float *rgb, float *depth, float *alpha, float *samples,
                            sf_ray_events *events);
#endif
