/* The float model: a field (hash grid, or planes and lines) that feeds a net (spiking layers, or their ReLU twin), and
 * the time budget t*. One flat vector holds every trained number; `param` names its parts. */
#ifndef SF_FIELD_MODEL_H
#define SF_FIELD_MODEL_H
#include "base/arch.h"
#include "base/io.h"
#include "base/status.h"
#include "field/tensorf.h"
#include "scene/scene.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Equal to fx_input_mode, but for the last: a step's spikes weigh half of those of the step before. */
typedef enum { SF_HYBRID, SF_DECAY, SF_NODECAY, SF_RADIX } sf_input_mode;
typedef enum { SF_NET_SNN, SF_NET_ANN } sf_net_kind;
typedef enum { SF_INGP, SF_TENSORF } sf_backbone_kind; /* which field: sf_field_of() */

typedef struct sf_config {
  int32_t net;   /* sf_net_kind */
  int32_t mode;  /* sf_input_mode */
  int32_t steps; /* T, 1..SF_T_MAX; 1 for the ANN and along rays */
  int32_t along; /* 1: the samples of a ray are the steps, membranes pass from one to the next (SpikingNeRF) */
  int32_t levels, log2_hash, base_res, finest_res; /* hash grid, 2 features per entry */
  int32_t hidden;                                  /* neurons of a spiking layer, multiple of 16, <= SF_LANES */
  float theta[3];                                  /* thresholds of D1, C1, C2 */
  float scale;        /* model units = world units * scale; the scene box is [-bound, bound]^3 model units */
  int32_t lattice;    /* the shortest step is 2 sqrt(3) / lattice model units */
  int32_t occ_res;    /* occupancy cells per axis of a cascade */
  int32_t bound;      /* 1, 2, 4, ... 64; 1: objects */
  float dt_gamma;     /* steps are distance * dt_gamma, at least the shortest; 0: all are the shortest. 0..1/8 */
  double stop;        /* a ray ends where less of its light is left: its transmittance. 1e-6..0.05 */
  int32_t backbone;   /* sf_backbone_kind */
  sf_tensorf tensorf; /* the planes; levels .. finest_res, lattice, bound and dt_gamma are the hash grid's */
  sf_space space;     /* of the data that it learned from */
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

/* Parts of the parameter vector, in this order. Matrices are [out][in] as in torch. A model has those of its field and
 * of its net; the others have no name and size 0. H: hidden. hash grid: table [entries][2]; planes: three of each,
 * [rows along the second axis][columns along the first][components]; lines [points][components]; basis
 * [features][products]; net:    D1 [H][features]; D2 [16][H]; C1 [H][16 + 15] (16 spherical harmonics, then h), of a
 * decoder [H][inputs]; C2 [H][H]; C3 [3][H]; a decoder's layers have biases [outputs], and it has no D1 and D2; leak
 * [5]: logits w of k = sigmoid(w): D1, density integrator, C1, C2, colour integrator (a decoder uses three) */
typedef enum {
  SF_P_GRID,
  SF_P_DENSITY_PLANE,
  SF_P_DENSITY_LINE = SF_P_DENSITY_PLANE + 3,
  SF_P_APP_PLANE = SF_P_DENSITY_LINE + 3,
  SF_P_APP_LINE = SF_P_APP_PLANE + 3,
  SF_P_BASIS = SF_P_APP_LINE + 3,
  SF_P_D1,
  SF_P_D2,
  SF_P_C1,
  SF_P_C1_BIAS,
  SF_P_C2,
  SF_P_C2_BIAS,
  SF_P_C3,
  SF_P_C3_BIAS,
  SF_P_LEAK,
  SF_P_COUNT
} sf_param_id;
enum { SF_P_NETS = SF_P_BASIS }; /* from here on parameters learn at the nets' rate */
typedef struct sf_param {
  const char *name;    /* NULL: the model has none */
  size_t offset, size; /* in floats; offsets are multiples of 16 */
  int64_t shape[3];
  int dims;
} sf_param;

/* Layers D1 D2 C1 C2 C3 by their parameters; -1: the layer never has a bias. */
extern const int sf_layer_weights[SF_LAYERS], sf_layer_bias[SF_LAYERS];

enum { SF_DIR_FEATURES = 16, SF_DENSITY_OUT = 16, SF_GEO_FEATURES = 15 };

typedef struct sf_grid_level {
  float scale;      /* pos = x * scale + 0.5, x in [0,1] */
  uint32_t stride;  /* points per axis of a dense level, 0 = hashed */
  uint32_t entries; /* of this level */
  size_t offset;    /* first entry */
} sf_grid_level;

/* What the exporter rounds to, once it is settled; fine-tuning learns weights for it. */
enum { SF_GRID_BITS = 8, SF_PRODUCTS_MAX = 3 * SF_COMPONENTS_MAX };
/* The basis matrix reads products of a plane's and a line's integers in so much finer steps. */
enum { SF_PRODUCT_SHIFT = 1 };
typedef struct sf_scales {
  int32_t weight_bits;            /* weights within +-(2^(weight_bits-1) - 1), 2..SF_WEIGHT_BITS; 0: not settled */
  int32_t grid_bits;              /* entries of the field alike, 2..SF_GRID_BITS */
  int32_t leak_bits;              /* fraction bits of k, 4..SF_LEAK_FRAC */
  struct sf_lsb {                 /* values of one LSB, > 0 */
    float entry[16], feature[16]; /* grid entries and features of a level; TensoRF: feature[0] */
    float direction;              /* spherical harmonics, or a decoder's directions and encodings */
    float current[SF_LAYERS];     /* currents: weight = integer * current / LSB of its input */
    /* TensoRF alone: C1's input that is always one; what the basis matrix gives; of the density (0) and the appearance
     * (1) each component's plane, and its product with the line. */
    float bias, basis, plane[2][SF_PRODUCTS_MAX], product[2][SF_PRODUCTS_MAX];
  } lsb;
} sf_scales;
enum { SF_SCALES = sizeof(struct sf_lsb) / sizeof(float) };

/* Largest logit of a leak in training, ln 999: tau within 1.001 .. 1000. */
#define SF_LEAK_LIMIT 6.9067548f

typedef struct sf_model {
  sf_config config;
  sf_param param[SF_P_COUNT]; /* by sf_param_id */
  size_t size;                /* floats in value */
  float *value;               /* [size], 64-byte aligned, owned */
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
/* Does it have the parameter? */
static inline bool sf_model_has(const sf_model *m, int id)
{
  return m->param[id].name != NULL;
}
/* The net is a decoder: the field gives the density itself, and C1 reads nothing that changes with the step. */
static inline bool sf_model_decodes(const sf_model *m)
{
  return !sf_model_has(m, SF_P_D1);
}

/* The intervals of a ray from where it enters the box (or from the near plane at 0.2): the same for every ray and every
 * consumer. Interval n begins at distance start[n] from there and is length[n] long: clamp((0.2 + start) * dt_gamma,
 * shortest, longest), longest = 2 sqrt(3) bound / occ_res (torch-ngp, but for rays that enter from outside: there the
 * distance to the camera is not that to the box). */
enum { SF_STEPS_MAX = 1024 };
enum { SF_LATTICE_MIN = 16 };
enum { SF_BLOCK_CELLS = 8 };                    /* of a block along an axis: those of one byte of the occupancy */
enum { SF_BLOCK_BYTES = 7 * 32 * 32 * 32 / 8 }; /* 7 cascades of 256 cells an axis */
#define SF_STOP_MIN 1e-6                        /* of stop: fixed point holds 2^-20 */
#define SF_STOP_MAX 0.05
#define SF_GAMMA_MAX 0.125f /* of dt_gamma */
typedef struct sf_steps {
  int32_t count, stride, lattice;   /* stride: this many of the scene's intervals are one */
  float low[3], high[3], near, far; /* the box, and the part of a ray that counts */
  float shortest;                   /* of the scene */
  bool growing;
  float start[SF_STEPS_MAX], length[SF_STEPS_MAX];
  uint8_t cascade[SF_STEPS_MAX]; /* the finest whose cells are longer than the interval */
  bool blocks;                   /* block is known: sf_march_steps */
  uint8_t block[SF_BLOCK_BYTES]; /* of 8 x 8 x 8 cells, in the order of the cells: one is occupied */
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
#endif
