/* The float model: hash grid, spiking density and colour nets (or their ReLU twin), time budget t*.
 * One flat vector holds every trained number; `param` names its parts. */
#ifndef SF_SNN_MODEL_H
#define SF_SNN_MODEL_H
#include "base/arch.h"
#include "base/io.h"
#include "scene/scene.h"
#include "base/status.h"
#include "field/tensorf.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum { SF_HYBRID, SF_DECAY, SF_NODECAY } sf_input_mode; /* equal to fx_input_mode */
typedef enum { SF_NET_SNN, SF_NET_ANN } sf_net_kind;
typedef enum { SF_INGP, SF_TENSORF } sf_backbone_kind;

typedef struct sf_config {
  int32_t net;                                     /* sf_net_kind */
  int32_t mode;                                    /* sf_input_mode */
  int32_t steps;                                   /* T, 1..SF_T_MAX; 1 for the ANN */
  int32_t levels, log2_hash, base_res, finest_res; /* hash grid, 2 features per entry */
  int32_t hidden;                                  /* neurons of a spiking layer, multiple of 16, <= SF_LANES */
  float theta[3];                                  /* thresholds of D1, C1, C2 */
  float scale;        /* model units = world units * scale; the scene box is [-bound, bound]^3 model units */
  int32_t lattice;    /* the shortest step is 2 sqrt(3) / lattice model units */
  int32_t occ_res;    /* occupancy cells per axis of a cascade */
  int32_t bound;      /* 1, 2, 4, ... 64; 1: objects */
  float dt_gamma;     /* steps are distance * dt_gamma, at least the shortest; 0: all are the shortest. 0..1/8 */
  int32_t backbone;   /* sf_backbone_kind */
  sf_tensorf tensorf; /* of SF_TENSORF; levels .. finest_res, lattice, bound and dt_gamma are INGP's */
} sf_config;

/* Occupancy grids, one inside the other: cascade c covers [-2^c, 2^c]^3, the last one the box. */
static inline int sf_config_cascades(const sf_config *c)
{
  return 1 + __builtin_ctz((unsigned)c->bound);
}
static inline size_t sf_config_cells(const sf_config *c) /* of all cascades */
{
  return (size_t)sf_config_cascades(c) * (size_t)c->occ_res * (size_t)c->occ_res * (size_t)c->occ_res;
}

/* Parts of the parameter vector, in this order. Matrices are [out][in] as in torch.
 *   grid.table [entries][2]; density.w1 [hidden][2*levels]; density.w2 [16][hidden];
 *   colour.w3 [hidden][16 + 15] (16 spherical harmonics, then h); colour.w4 [hidden][hidden]; colour.w5 [3][hidden];
 *   leak [5]: logits w of k = sigmoid(w): D1, density integrator, C1, C2, colour integrator */
typedef enum { SF_P_GRID, SF_P_W1, SF_P_W2, SF_P_W3, SF_P_W4, SF_P_W5, SF_P_LEAK, SF_P_COUNT } sf_param_id;
typedef struct sf_param {
  const char *name;
  size_t offset, size; /* in floats; offsets are multiples of 16 */
  int64_t shape[3];
  int dims;
} sf_param;

enum { SF_PARAMS_MAX = SF_V_COUNT };

enum { SF_DIR_FEATURES = 16, SF_DENSITY_OUT = 16, SF_GEO_FEATURES = 15 };

typedef struct sf_grid_level {
  float scale;      /* pos = x * scale + 0.5, x in [0,1] */
  uint32_t stride;  /* points per axis of a dense level, 0 = hashed */
  uint32_t entries; /* of this level */
  size_t offset;    /* first entry */
} sf_grid_level;

/* What the exporter rounds to, once it is settled; fine-tuning learns weights for it. */
typedef struct sf_scales {
  int32_t weight_bits;            /* weights within +-(2^(weight_bits-1) - 1), 2..SF_WEIGHT_BITS; 0: not settled */
  struct sf_lsb {                 /* values of one LSB, > 0 */
    float entry[16], feature[16]; /* grid entries and features of a level */
    float direction;              /* spherical harmonics */
    float current[SF_LAYERS];     /* currents: weight = integer * current / LSB of its input */
  } lsb;
} sf_scales;
enum { SF_SCALES = sizeof(struct sf_lsb) / sizeof(float) };

typedef struct sf_model {
  sf_config config;
  sf_param param[SF_PARAMS_MAX]; /* by sf_param_id, or by tensorf.h's SF_V_... */
  int params;                    /* how many there are */
  size_t size;                   /* floats in value */
  float *value;                  /* [size], 64-byte aligned, owned */
  sf_grid_level level[16];
  float t_star;       /* 1..T; T where no budget was learned */
  int32_t t_r;        /* round(t_star): steps at inference */
  uint8_t *occupancy; /* sf_config_cells / 8 bytes, bit ((cascade*res + z)*res + y)*res + x, owned */
  sf_scales scales;
} sf_model;

sf_config sf_config_default(void);
/* A box of this half edge with what goes with it: the growth of steps (1/128, none at 1) and the finest resolution
 * (2048 * bound, at most 32768: positions have 24 bits in fixed point, places within a cell 8). */
void sf_config_bound(sf_config *config, int bound);
sf_status sf_config_check(const sf_config *config);
/* Allocates, lays out and zeroes; occupancy all ones. */
sf_status sf_model_create(sf_model *model, const sf_config *config);
void sf_model_free(sf_model *model);
static inline float *sf_model_param(const sf_model *m, int id)
{
  return m->value + m->param[id].offset;
}

/* model.safetensors: the tensors above by name, "occupancy", metadata config + t_star + t_r. Every load check names
 * file and tensor. A checkpoint holds further tensors (optimiser) that this ignores. */
sf_status sf_model_load(sf_model *model, const char *path);
/* The model alone; atomic. */
sf_status sf_model_save(const sf_model *model, const char *path);
/* The same in parts, for files that hold more: metadata, and model->params + 2 tensors at most (how many). */
void sf_model_describe(const sf_model *model, cJSON *metadata);
int sf_model_tensors(const sf_model *model, sf_tensor *list);
/* Leaks, SF_LAYERS of them. */
float *sf_model_leak(const sf_model *model);

/* Value of one LSB of input `input` of layer D1 D2 C1 C2 C3 (1 for spikes). */
double sf_scales_input(const sf_scales *scales, int layer, int input);
/* The five weight matrices of model->value rounded to its settled scales, into value (laid out alike, may be the same).
 */
void sf_scales_round(const sf_model *model, float *value);
/* Spherical harmonics to multiples of their LSB, as the accelerator gets them; as they are while nothing is settled. */
void sf_scales_round_direction(const sf_scales *scales, float sh[SF_DIR_FEATURES]);
/* Step to whose multiples h is rounded down once the scales are settled, as the accelerator does; 0: h is not. */
float sf_scales_h_step(const sf_scales *scales);

/* The intervals of a ray from where it enters the box (or from the near plane at 0.2): the same for every ray and every
 * consumer. Interval n begins at distance start[n] from there and is length[n] long: clamp((0.2 + start) * dt_gamma,
 * shortest, longest), longest = 2 sqrt(3) bound / occ_res (torch-ngp, but for rays that enter from outside: there the
 * distance to the camera is not that to the box). */
enum { SF_STEPS_MAX = 1024 };
enum { SF_LATTICE_MIN = 16 };
#define SF_GAMMA_MAX 0.125f /* of dt_gamma */
typedef struct sf_steps {
  int32_t count, stride, lattice;   /* stride: this many of the scene's intervals are one */
  float low[3], high[3], near, far; /* the box, and the part of a ray that counts */
  float shortest;                   /* of the scene */
  bool growing;
  float start[SF_STEPS_MAX], length[SF_STEPS_MAX];
  uint8_t cascade[SF_STEPS_MAX]; /* the finest whose cells are longer than the interval */
} sf_steps;
/* TensoRF: equal steps of sf_tensorf_step in the field's own box between its near and far distance.
 * SF_E_RANGE when SF_STEPS_MAX intervals do not reach across the box. */
sf_status sf_steps_make(sf_steps *steps, const sf_config *config, int stride);

/* The part of a ray that is in the box: the centre of interval n is at distance first + start[n] + length[n] / 2 -
 * shortest / 2. count = 0: the ray misses. */
typedef struct sf_lattice {
  float first;
  int32_t count;
} sf_lattice;
sf_lattice sf_ray_lattice(const sf_steps *steps, const float origin[3], const float direction[3]);

/* Hash-grid features at x in [0,1]^3, scalar and obvious: the oracle of the vector kernels. f[2*levels]. */
void sf_grid_features(const sf_model *model, const float x[3], float *f);
/* Real spherical harmonics of degree 4 (16 values) of a unit vector, torch-ngp's order and signs. */
void sf_sh4(const float direction[3], float out[16]);

/* Float nets, one sample, scalar and obvious: the oracle. Outputs for every prefix 1..steps; currents optional.
 * sigma[steps] per model unit, colour[steps][3]. trace: per-layer currents and spikes for calibration, or NULL. */
typedef struct sf_net_trace {
  float current[SF_LAYERS][SF_T_MAX][SF_LANES];  /* what enters each neuron, layers D1 D2 C1 C2 C3 */
  float membrane[SF_LAYERS][SF_T_MAX][SF_LANES]; /* before fire and reset; integrators: after */
  uint8_t spike[SF_LAYERS][SF_T_MAX][SF_LANES];
} sf_net_trace;
void sf_net_sample(const sf_model *model, const float *f, const float *sh, int steps, float *sigma, float *colour,
                   sf_net_trace *trace);

/* Renders `count` rays on all threads through the vector kernels, the first `steps` steps (0 = t_r).
 * origin, direction [count][3]; rgb [count][3], depth, alpha, samples [count] (each may be NULL but rgb).
 * samples: those that the nets see; of TensoRF, those that the decoder sees.
 * background: 3 floats. Empty space is skipped; rays stop where the light is gone (sf_opaque). */
sf_status sf_render_rays(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                         const float background[3], float *rgb, float *depth, float *alpha, float *samples);
#endif
