/* The fixed-point core: the specification that rtl/ mirrors. Integers only, the same bits on
 * every machine. Formats are those of arch.def; rounding is fx_rshift_round everywhere.
 *
 * Layers (n_in -> n_out; sizes are run-time state up to arch.def):
 *   D1  f[32]   -> 128   MAC, spiking      constant current, computed once per sample
 *   D2  spikes  -> 16    AC, integrating   i(t)[0] drives the density, i(t)[1..15] >> H_SHIFT = h(t)
 *   C1  d | h   -> 128   MAC, spiking      the d part once per ray, the h part at every step
 *   C2  spikes  -> 128   AC, spiking
 *   C3  spikes  -> 3     AC, integrating   j(t) drives the colour
 * In input mode radix the currents of D2, C2 and C3 are weighed into one of all T steps, sum of 2^(T-1-t) i(t)
 * (fx_weigh), which stands for 2^T - 1 of them; h is the mean, >> H_SHIFT (fx_weighed_h).
 *
 * A decoder is a net of the last three layers: D1 and D2 have no inputs and no outputs, and all of
 * C1's inputs, up to SF_DIR_MAX, are constant ones that come anew with every sample. It has no density: sigma is 0.
 */
#ifndef SF_FX_FX_H
#define SF_FX_FX_H
#include "base/arch.h"
#include "base/event.h"
#include "base/status.h"
#include "fx/layers.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* radix: spikes are binary digits, the most significant first: a spike of step t of T is worth
 * 2^(T-1-t) / (2^T - 1), all of them 1. A layer waits for all steps of its inputs, and its neurons take their currents
 * once. Nothing leaks; tables are read once, behind the last step. */
typedef enum { FX_HYBRID, FX_DECAY, FX_NODECAY, FX_RADIX } fx_input_mode;

/* Bits of the membrane below the LSB of the layer's current. Of radix, C2's holds the mean current of as many steps as
 * there may be. */
static inline int fx_layer_frac(int layer, int32_t mode)
{
  if (layer != FX_C2) return 0;
  return mode == FX_RADIX ? SF_T_MAX : SF_AC_FRAC;
}

/* Bits of a layer's state. What radix adds up in D2 and C3 are currents: fx_weigh. */
static inline int fx_layer_state_bits(int layer, int32_t mode)
{
  return mode == FX_RADIX && !fx_layer_fires(layer) ? SF_MEMBRANE_BITS : fx_layer_table[layer].state_bits;
}

/* One layer. Weights are stored by presynaptic neuron: w[i * SF_LANES + o] is the weight from
 * input i to output o; row i is the fan-out of i and one word of the weight memory. Lanes
 * >= n_out are zero. C1's rows are the n_dir direction rows first, then the n_h rows of h.
 * `bias`: 0 for none; else one more row, w[n_in], belongs to an input that is always active: with the value `bias`,
 * 1..2047, in C1, and as a spike at every step in C2 and C3 (bias = 1). D1 and D2 have none.
 * `theta` is in membrane LSB (so it carries the membrane's fraction bits) and must be >= 1 for
 * the spiking layers D1, C1, C2 (of radix also < 2^22: then rails change no spike); for D2 and C3, `k` is the leak of
 * the density and colour integrator. */
typedef struct fx_layer {
  int32_t n_in, n_out;
  int32_t k;     /* U1.12, 0..4096 */
  int32_t theta; /* 1..2^23-1; 0 in D2 and C3 */
  int32_t bias;  /* C1: 0..2047; C2, C3: 0 or 1 */
  int8_t *w;     /* [n_in + (bias != 0)][SF_LANES] */
} fx_layer;

/* The largest |h| that D2's weights allow, whatever fires: what fx_scene_check holds against INPUT_BITS. */
int fx_largest_h(const fx_layer *d2);

/* Rows of weights. */
static inline int fx_layer_rows(const fx_layer *layer)
{
  return layer->n_in + (layer->bias != 0);
}

/* y = sat(rshift_round(current * mul, shift) + bias): a current to the argument of a table.
 * mul 0..65535, shift 0..31, bias in the result's LSB. */
typedef struct fx_scale {
  int32_t mul, shift, bias;
} fx_scale;

typedef struct fx_net {
  fx_layer layer[SF_LAYERS];
  int32_t mode;        /* fx_input_mode */
  int32_t steps;       /* t_r: time steps to unroll, 1..SF_T_MAX */
  fx_scale exp_in;     /* D2 current 0 -> log2 of density per box edge, Q.LOG_FRAC: fx_net_scale */
  fx_scale sigmoid_in; /* C3 current   -> sigmoid argument, Q.LOG_FRAC */
} fx_net;

/* Without a density net: C1, C2 and C3 alone. */
static inline bool fx_net_decodes(const fx_net *net)
{
  return net->layer[FX_D1].n_out == 0;
}

/* Whether the tables of D2 and C3 are read at step t. */
static inline bool fx_net_reads_tables(const fx_net *net, int t)
{
  return net->mode != FX_RADIX || t == net->steps - 1;
}

/* Inputs of C1: those that come from D2 (h), at every step or of radix once, and before them the constant ones. */
static inline int fx_net_h(const fx_net *net)
{
  return fx_net_decodes(net) ? 0 : net->layer[FX_D2].n_out - 1;
}
static inline int fx_net_constants(const fx_net *net)
{
  return net->layer[FX_C1].n_in - fx_net_h(net);
}

/* The numbers that a driver programs, which hang on the steps in radix mode: there a sum of all steps (fx_weigh) stands
 * for 2^steps - 1 currents. The scale is exp_in or sigmoid_in for what its table is asked: a step's current, or that
 * sum. The threshold is theta, but in C2, whose current is 1 - 2^-steps of the mean, as much of theta, rounded. */
fx_scale fx_net_scale(const fx_net *net, const fx_scale *scale);
int32_t fx_net_theta(const fx_net *net, int layer);

/* The first layer that the net has. */
static inline int fx_net_first_layer(const fx_net *net)
{
  return fx_net_decodes(net) ? FX_C1 : FX_D1;
}

/* Whether C1's constant inputs come with every sample, not once per ray. Then the net counts no rays: the caller does.
 */
static inline bool fx_net_constants_per_sample(const fx_net *net)
{
  return fx_net_decodes(net);
}

/* Those of C1's constant inputs that belong to the ray: harmonics of its direction. */
static inline int fx_net_harmonics(const fx_net *net)
{
  return fx_net_constants_per_sample(net) ? 0 : fx_net_constants(net);
}

/* What every sample brings: features, or the inputs of a decoder. At most SF_DIR_MAX. */
static inline int fx_net_inputs(const fx_net *net)
{
  return net->layer[fx_net_first_layer(net)].n_in;
}

/* Multiresolution hash grid (Mueller et al. 2022), 2 features per entry.
 * Position in level l: pos = (x * (res[l] - 1) rounded to Q.8) + 1/2, as torch-ngp: see fx/grid.c. */
enum { FX_LEVELS_MAX = 16, FX_GRID_FEATURES = 2 };
typedef struct fx_grid {
  int32_t levels;
  int32_t scale_q16[FX_LEVELS_MAX]; /* (res - 1) in Q16.16: pos = x * scale + 0.5 */
  int32_t stride[FX_LEVELS_MAX];    /* points per axis of a dense level; 0 = hashed */
  int32_t log2_size[FX_LEVELS_MAX]; /* hashed: log2 of entries */
  int64_t offset[FX_LEVELS_MAX];    /* first entry of the level */
  int64_t entries;                  /* of all levels */
  int32_t shift[FX_LEVELS_MAX];     /* f = sat12(rshift_round(sum entry * w_Q16, shift)); 0..31 */
  int8_t *table;                    /* [entries][2] */
} fx_grid;

/* The field of TensoRF (Chen et al. 2022): density and appearance as sums of products of a plane and a line, in
 * three pairs: planes over the axes (x,y), (x,z), (y,z), lines along z, y, x. Grid points are at the ends of the box:
 * position p of an axis is p * (res - 1), Q.8, rounded half up; linear weights are exact. Plane and line of a component
 * share the LSB of their product, which is one for all components of the density.
 * Equations and widths: fx/tensorf.c. */
enum { FX_PAIRS = 3, FX_COMPONENTS_MAX = 64, FX_TENSORF_RES_MAX = 2048, FX_APPEARANCE_MAX = 32, FX_FREQS_MAX = 4 };
typedef enum { FX_SOFTPLUS, FX_RELU } fx_activation;
typedef struct fx_factors {
  int32_t components[FX_PAIRS]; /* 1..FX_COMPONENTS_MAX */
  int8_t *plane[FX_PAIRS];      /* [res of its second axis][res of its first axis][components] */
  int8_t *line[FX_PAIRS];       /* [res of its axis][components] */
} fx_factors;

typedef struct fx_tensorf {
  int32_t res[3]; /* grid points per axis, 1..FX_TENSORF_RES_MAX */
  fx_factors density, appearance;
  int32_t activation;  /* fx_activation */
  fx_scale density_in; /* sum of products (Q.16 of their LSB) -> argument of the activation, Q.LOG_FRAC; shift 0..40 */
  fx_scale sigma_out;  /* activation, Q.20 -> density per box edge, U16.12; bias 0, shift 0..40 */
  int32_t weight_stop; /* a sample of at most this weight takes its light, but is not decoded; Q.TRANS_FRAC */
  int32_t features;    /* of the appearance, 1..FX_APPEARANCE_MAX */
  int8_t *basis;       /* [appearance components][FX_APPEARANCE_MAX]: feature sums = products * basis */
  fx_scale feature_in; /* feature sum -> feature, int12; bias 0, shift 0..40 */
  fx_scale phase_in; /* feature sum -> the same as an angle in turns, Q.16, whole turns dropped; bias 0, shift 0..40 */
  int32_t feature_freqs, view_freqs; /* sines and cosines of 1, 2, 4 ... times a value; 0..FX_FREQS_MAX */
  int32_t encoding_frac;             /* LSB of directions, sines and cosines: 2^-encoding_frac, 0..FX_DIR_FRAC_MAX */
} fx_tensorf;

typedef enum { FX_INGP, FX_TENSORF } fx_backbone;

/* Steps that grow: interval n is length(n) = clamp(rshift_round((near + start(n)) * gamma, 24), 1, longest) lattice
 * steps long, start(n+1) = start(n) + length(n), all Q16.16. Filled by fx_scene_allocate. */
enum { FX_STEPS_MAX = 1024 };
typedef struct fx_steps {
  int32_t count;                   /* lattice points that a ray may have */
  int64_t at_q16[FX_STEPS_MAX];    /* from sample 0 to sample n (middle to middle), lattice steps */
  int32_t delta_q24[FX_STEPS_MAX]; /* length in box edges */
  uint8_t cascade[FX_STEPS_MAX];   /* the finest whose cells are longer than the interval */
} fx_steps;

/* What the integers of a scene mean in real units: for quant/, which makes them and the rays, and for reports and files
 * that translate integers back. No arithmetic of the core reads them; in src/fx only real.c does, for the file.
 *   box = (world * to_box_scale + to_box_offset) * stretch, per axis, world in model units
 * Of TensoRF alone: stretch (where the box has unequal edges, lengths are in the longest), near and far. */
typedef struct fx_units {
  double to_box_scale, to_box_offset[3];
  double model_scale; /* model units per world unit of the data that it was trained on; 0: unknown */
  double data_scale, data_bound, data_ndc; /* sf_space of that data: without --scale, proposed, 0 or 1; 0: unknown */
  double data_views, data_poses, data_picture; /* the same; 0: unknown */
  double stretch[3];
  double near, far; /* rays begin and end at these distances from their origins, model units */
  double dir_scale; /* value of one LSB of the direction features: 2^-frac, 0 <= frac <= FX_DIR_FRAC_MAX */
  double feature_scale[FX_LEVELS_MAX]; /* value of one LSB of a level's features, for reports */
  double current_scale[SF_LAYERS];     /* value of one LSB of each layer's current; 0 = unknown */
} fx_units;

/* Scene box [0,1)^3. Cascade c of its occupancy grids has occ_res^3 cells in the middle 2^(c - log2_bound) of the box:
 * bit ((c*res + z)*res + y)*res + x, LSB first. A sample looks in the finest one that holds it, at least
 * steps->cascade.
 */
typedef struct fx_scene {
  int32_t backbone; /* fx_backbone: grid and both nets, or tensorf and the decoder (C1, C2, C3 of net). A decoder behind
                       no field (FX_INGP, no levels) is for the nets' functions: it has no rays, and no file holds it */
  fx_net net;
  fx_grid grid;
  fx_tensorf tensorf;
  int32_t occ_res;    /* cells per axis, power of two, <= 256 */
  int32_t log2_bound; /* 0..6: there are this many cascades more than one */
  uint8_t *occupancy; /* (log2_bound + 1) * occ_res^3 / 8 bytes */
  int32_t step_q24;   /* a lattice step, the shortest distance between samples, in box edges, Q0.24 */
  int32_t gamma_q24;  /* growth of the steps, 0..2^21; 0: all are one lattice step */
  int32_t near_q16;   /* where gamma_q24 > 0: lattice steps of the near plane, and the longest step, Q16.16 */
  int32_t longest_q16;
  fx_steps *steps;       /* NULL where gamma_q24 is 0 */
  int32_t max_samples;   /* per ray, 1..1024 */
  int32_t trans_stop;    /* stop once transmittance <= this, Q.TRANS_FRAC */
  int32_t background[3]; /* Q0.16, 65536 = 1.0 */
  fx_units units;
  void *owner; /* backing storage of w, table, occupancy; fx_scene_free releases it */
} fx_scene;

/* Points of a ray: Q24.40. Its direction: each axis Q1.14. LSB of the direction features: 2^-frac. */
enum { FX_RAY_FRAC = 40, FX_UNIT_FRAC = 14, FX_UNIT_ONE = 1 << FX_UNIT_FRAC };
enum { FX_DIR_FRAC_MAX = 11, FX_SH = 16 /* harmonics */ };

/* A ray in box units: p(n) = (origin + n * step) >> 16 in Q0.24 is sample n, 0 <= n < count (with growing steps
 * at_q16[n] instead of n, product >> 16); sample positions are inside [0, 2^24) on every axis. Made by quant/ (the only
 * bridge). */
typedef struct fx_ray {
  int64_t origin[3], step[3]; /* Q24.FX_RAY_FRAC */
  int32_t count;              /* lattice points in the box, 0 = misses */
  int32_t first_q16;          /* distance from the camera to sample 0 in lattice steps, Q16.16 */
  int16_t unit[3];            /* direction, unit length but for rounding, Q1.14 */
  int16_t dir[FX_SH];         /* its spherical harmonics (fx_sh), LSB dir_scale */
} fx_ray;

/* Events, counted per layer and time step. What is one event, exactly:
 *   mac     D1: n_in*n_out per sample, at step 0. C1: n_dir*n_out per ray that has a sample (step 0 of its first
 *           sample) + n_h*n_out per step, of radix at step 0 alone; of a decoder n_in*n_out per sample, at step 0.
 *           Zero inputs count too
 *   sop     D2, C2, C3: (firing presynaptic neurons at step t) * n_out; biases are no MAC and no SOP
 *   spikes  D1, C1, C2: neurons that fired at step t
 *   updates D1, C1, C2: n_out per step; D2: 1 per step (density integrator); C3: 3 per step. Radix: D2 n_out per
 *           step; C2 2*n_out per step, n_out at the last: its neurons add up T sums and fire T times, the first time
 *           with the last sum
 *   weight  bytes read, 1 per weight: D1 n_in*n_out at step 0; C1 as its MACs; C2 as its SOPs; D2, C3: n_out for
 *           each presynaptic neuron active at ANY step, at the first step at which it fired; biases n_out more: C1 with
 *           its constant inputs, C2 at every step, C3 at step 0
 *   state_r / state_w  bytes of membrane: updates*3 (D1, C1, C2) or updates*4 (D2, C3); the first update reads nothing
 *   special exp (D2: 1 per step) and sigmoid (C3: 3 per step) evaluations; of radix at the last step alone
 * A decoder has none in D1 and D2. */
typedef union fx_layer_counts {
  uint64_t event[SF_EVENTS][SF_T_MAX]; /* by sf_event_id */
  struct {
#define SF_EVENT_MEMBER(id, name, title, unit, fj) uint64_t name[SF_T_MAX];
    SF_EVENT_TABLE(SF_EVENT_MEMBER)
#undef SF_EVENT_MEMBER
  }; /* the same by name */
} fx_layer_counts;

typedef struct fx_counts {
  fx_layer_counts layer[SF_LAYERS];
  uint64_t samples, rays; /* through the net; rays with at least one sample (of a decoder the caller's to count) */
  uint64_t grid_bytes;    /* hash-grid bytes read */
  uint64_t march_steps;   /* lattice points tested against the occupancy grid */
  uint64_t saturated[SF_LAYERS];         /* saturation events: membranes, or exp/sigmoid accumulators for D2/C3 */
  uint64_t saturated_samples[SF_LAYERS]; /* samples with at least one of them */
  uint64_t saturated_features;
  uint64_t field_samples; /* TensoRF: points whose density was read; `samples` went on through the decoder */
  uint64_t field_mac;     /* products of the VM field: per component 4 of the plane, 2 of the line, 1 of both, and the
                             basis matrix; its bytes of planes and lines are in grid_bytes */
} fx_counts;

void fx_counts_add(fx_counts *sum, const fx_counts *more);

/* Everything a lockstep comparison needs of one sample. */
typedef struct fx_trace {
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS]; /* D1, C1, C2: bit n%64 of word n/64 = neuron n fired */
  int32_t membrane[SF_LAYERS][SF_T_MAX][SF_LANES];      /* before fire and reset; D2 [0], C3 [0..2]: accumulator, after,
                                                           or of radix the sum of currents so far */
  int32_t current[SF_LAYERS][SF_T_MAX][SF_LANES];       /* the exact sum, without C2's fraction bits; of radix in C2
                                                           that of all steps (fx_weigh), the same at every step */
} fx_trace;

/* What neuron n of a layer keeps behind a step: its membrane after the reset. */
static inline int32_t fx_membrane_left(const fx_net *net, const fx_trace *trace, int layer, int step, int n)
{
  const bool fired = trace->spikes[layer][step][n / 64] >> n % 64 & 1;
  return trace->membrane[layer][step][n] - (fired ? fx_net_theta(net, layer) : 0);
}

typedef struct fx_out {
  uint32_t sigma;     /* U16.12 per box edge */
  uint32_t colour[3]; /* U4.16 */
} fx_out;

/* The first 16 real spherical harmonics of a direction, LSB 2^-frac (0 <= frac <= FX_DIR_FRAC_MAX): within 1 LSB of
 * the real ones of the unrounded unit vector at any frac. Defined for every input: see fx/sh.c. */
void fx_sh(const int16_t unit[3], int frac, int16_t dir[FX_SH]);

/* The current of C1's constant inputs, dir[fx_net_constants], and of its bias: computed once per ray, of a decoder once
 * per sample. base[SF_LANES]: exact, within 2^26. Counts C1's d MACs and the ray; of a decoder nothing, fx_net_sample
 * does. */
void fx_net_direction(const fx_net *net, const int16_t *dir, int32_t *base, fx_counts *counts);

/* One sample through both nets. f[n_feature] int12, of a decoder NULL; base from fx_net_direction. trace and counts may
 * be NULL. C1's current is the exact sum saturated to the 24 bits of a membrane, which only a decoder's can exceed;
 * that is one saturation event of its lane and sample. */
void fx_net_sample(const fx_net *net, const int16_t *f, const int32_t *base, fx_out *out, fx_trace *trace,
                   fx_counts *counts);

/* fx_net_direction where it is due, then fx_net_sample. f[fx_net_inputs], of a density net its features, of a decoder
 * its inputs; base[SF_LANES] is the caller's and stays along a ray. dir is read for the first sample of a ray; a
 * decoder needs none. */
void fx_net_next(const fx_net *net, const int16_t *dir, bool first, const int16_t *f, int32_t *base, fx_out *out,
                 fx_trace *trace, fx_counts *counts);

/* Grid features of one position. pos[3] Q0.24, f[2*levels]. counts may be NULL. */
void fx_grid_features(const fx_grid *grid, const uint32_t *pos, int16_t *f, fx_counts *counts);

/* TensoRF: density per box edge (U16.12) and the decoder's inputs of one position. pos[3] Q0.24; unit: direction,
 * Q1.14. x[fx_tensorf_inputs]: features, direction, then sines and cosines of both: see fx/tensorf.c. counts may be
 * NULL. */
uint32_t fx_tensorf_density(const fx_tensorf *field, const uint32_t pos[3], fx_counts *counts);
void fx_tensorf_encode(const fx_tensorf *field, const uint32_t pos[3], const int16_t unit[3], int16_t *x,
                       fx_counts *counts);
int fx_tensorf_inputs(const fx_tensorf *field);
int64_t fx_tensorf_bytes(const fx_tensorf *field); /* planes, lines and basis matrix */
/* What the basis matrix multiplies, for its fit: x[appearance components], Q.1 of the LSB of a product; how many. */
int fx_tensorf_products(const fx_tensorf *field, const uint32_t pos[3], int16_t *x);
/* The products whose sum is the density's, Q.16 of their LSB: product[density components]; how many. */
int fx_tensorf_density_products(const fx_tensorf *field, const uint32_t pos[3], int32_t *product);

/* Position of lattice point n on an axis, Q24.40; the length of its interval in box edges, Q0.24; its distance from the
 * camera in lattice steps, Q16.16. */
static inline int64_t fx_ray_at(const fx_scene *scene, const fx_ray *ray, int32_t n, int axis)
{
  return ray->origin[axis] + (scene->steps ? ray->step[axis] * scene->steps->at_q16[n] >> 16 : n * ray->step[axis]);
}
static inline int32_t fx_delta(const fx_scene *scene, int32_t n)
{
  return scene->steps ? scene->steps->delta_q24[n] : scene->step_q24;
}
static inline uint64_t fx_distance(const fx_scene *scene, const fx_ray *ray, int32_t n)
{
  return (uint64_t)(scene->steps ? scene->steps->at_q16[n] : (int64_t)n << 16) + (uint32_t)ray->first_q16;
}

/* Next lattice point >= n whose cell is occupied, or -1. Writes its position. */
int32_t fx_march_next(const fx_scene *scene, const fx_ray *ray, int32_t n, uint32_t *pos, fx_counts *counts);
/* The cell of the occupancy grids, all cascades one behind the other, that point n of the ray looks in. */
int64_t fx_march_cell(const fx_scene *scene, const fx_ray *ray, int32_t n);

/* Compositing of one ray, front to back. Conservation: weight_sum + transmittance == 1 << TRANS_FRAC, always. */
typedef struct fx_pixel {
  uint64_t colour[3];                 /* Q8.36: sum of w (Q.20) * c (Q4.16) */
  uint64_t depth;                     /* sum of w * (distance in lattice steps, Q16.16) */
  uint32_t weight_sum, transmittance; /* Q.20 */
  uint32_t samples;                   /* whose colour was added */
} fx_pixel;
void fx_composite_begin(fx_pixel *pixel);
void fx_composite_add(fx_pixel *pixel, const fx_out *sample, int32_t delta_q24, uint64_t distance_q16);
/* The same in two parts: the weight that the sample has, then its colour, which may be left out. */
uint32_t fx_composite_weight(fx_pixel *pixel, uint32_t sigma, int32_t delta_q24, uint64_t distance_q16);
void fx_composite_colour(fx_pixel *pixel, uint32_t weight, const uint32_t colour[3]);
void fx_composite_end(fx_pixel *pixel, const int32_t *background_q16);

/* Pixel to raw integers of the golden image: RGB Q0.16 clamped to 0..65535, alpha Q0.16. */
void fx_pixel_rgba(const fx_pixel *pixel, uint32_t rgba[4]);

/* Called for every sample of fx_render_ray in place of fx_net_sample, when not NULL. `first` is true for the
 * first sample of the ray; f[fx_net_inputs]. The RTL backend and co-simulation plug in here; a non-OK status ends the
 * ray. */
typedef sf_status (*fx_net_fn)(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out);

/* What fx_render_watched tells of: the field is read at a position. Of a sample of TensoRF first the density, then the
 * appearance where the sample is decoded. */
typedef enum { FX_READ_GRID, FX_READ_DENSITY, FX_READ_APPEARANCE } fx_read;
typedef struct fx_watch {
  void (*read)(void *user, fx_read what, const uint32_t pos[3]);
  void *user;
} fx_watch;

/* One ray: march, features, nets, compositing. eval NULL: fx_net_sample. Background included. */
sf_status fx_render_ray(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user, fx_pixel *pixel,
                        fx_counts *counts);
/* The same; watch may be NULL. The field is read before eval is called for the sample. */
sf_status fx_render_watched(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user, const fx_watch *watch,
                            fx_pixel *pixel, fx_counts *counts);

/* ---- many rays at once ---- */

/* A scene made ready for the vector kernels, which give the same bits as the functions above on every machine. It must
 * outlive the core and stay as it is; what fx_scene_check refuses is refused. One core serves any number of threads.
 * kernels: "portable", "avx2", "avx512vnni", "amx", or NULL for the best that this CPU has; SF_E_UNSUPPORTED when it
 * lacks the named one. */
typedef struct fx_core fx_core;
sf_status fx_core_open(fx_core **core, const fx_scene *scene, const char *kernels);
void fx_core_close(fx_core *core); /* NULL is fine */
const char *fx_core_kernels(const fx_core *core);

/* What one ray cost: events summed over layers and steps. */
typedef struct fx_cost {
  uint64_t macs, sops, spikes;
} fx_cost;

/* fx_render_ray for rays[n]: pixels[n]; costs[n] and counts (which it adds to) may be NULL. SF_E_MEMORY. */
sf_status fx_render_rays(const fx_core *core, const fx_ray *rays, size_t n, fx_pixel *pixels, fx_cost *costs,
                         fx_counts *counts);

/* Refuses a scene that breaks a rule above, naming the field (`path` is only for the message). */
sf_status fx_scene_check(const fx_scene *scene, const char *path);

/* Zeroed weights, table and occupancy for the sizes already set (which it checks); owner is set. */
sf_status fx_scene_allocate(fx_scene *scene, const char *path);

/* .snn files: safetensors with integer tensors and metadata (format version, scales, t_r). What is 0 in most scenes
 * (the biases, log2_bound, growing steps, model_scale, data_*) is in the metadata only where it is not 0. */
sf_status fx_scene_load(fx_scene *scene, const char *path);
sf_status fx_scene_load_memory(fx_scene *scene, const void *data, size_t size,
                               const char *name);                 /* a file's contents */
sf_status fx_scene_save(const fx_scene *scene, const char *path); /* SF_E_UNSUPPORTED for a decoder behind no field */
void fx_scene_free(fx_scene *scene);
#endif
