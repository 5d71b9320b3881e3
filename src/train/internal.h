/* What the files of the trainer share. */
#ifndef SF_TRAIN_INTERNAL_H
#define SF_TRAIN_INTERNAL_H
#include "base/memory.h"
#include "render/march.h"
#include "render/view.h"
#include "base/rng.h"
#include "ranks/ranks.h"
#include "train/train.h"

/* Work is cut into GROUPS parts that do not depend on the number of threads and ranks; each part adds up its own
 * gradient in sample order and the parts are added in order: same seed, same bits, any number of threads and ranks. */
enum { GROUPS = 16, BUNDLE_BLOCKS = 1024 / SF_BLOCK, RAYS_MAX = 1 << 15, RAYS_MIN = 64 };

/* A bundle is closed before it has more samples than this: what two threads keep for their backward passes (12 kB a
 * sample) then fits the last-level cache. A single ray may have more, up to BUNDLE_BLOCKS. */
enum { BUNDLE_FILL = 512 };

/* Streams of the counter-based generator. */
enum {
  RNG_INIT = 1,
  RNG_PIXEL,
  RNG_JITTER,
  RNG_BACKGROUND,
  RNG_OCCUPANCY,
  RNG_OCCUPANCY_JITTER,
  RNG_PROBE,
  RNG_REVIVE,
  RNG_PREFIX
};

typedef struct sf_ray {
  float origin[3], direction[3], target[3], background[3]; /* target: composited on background */
  int first, count;                                        /* its samples: lanes first .. first + count - 1 */
  int lane;                                                /* the first one, counted from the start of the batch */
  int from, left, looked; /* in compaction: where the ray's samples were; that nobody has looked at; of this round */
} sf_ray;

/* Whole rays whose samples fill at most BUNDLE_BLOCKS blocks. */
typedef struct sf_bundle {
  int ray, rays;     /* range of rays */
  int block, blocks; /* range of blocks */
} sf_bundle;

typedef struct sf_batch {
  int rays, marched, samples; /* samples in occupied space, and those of them that light reaches */
  int bundles, blocks, block_capacity;
  sf_ray *ray;                        /* [RAYS_MAX] */
  sf_bundle *bundle;                  /* [RAYS_MAX] */
  uint64_t (*hit)[SF_STEPS_MAX / 64]; /* [RAYS_MAX] lattice points of a ray in occupied cells, a bit each */
  float *x;                           /* [blocks][3][SF_BLOCK] positions in [0,1] */
  float *f, *df;                      /* [blocks][features][SF_BLOCK] */
  float *delta;                       /* [blocks][SF_BLOCK] lengths of the samples' intervals, model units */
  float *spare_x, *spare_delta;       /* for compaction */
  float *sigma;                       /* [blocks][T][SF_BLOCK] in compaction: densities of a round's samples */
  float (*depth)[SF_T_MAX];           /* [RAYS_MAX] the logarithm of the light that is left, after each step */
  int *count;                         /* [RAYS_MAX] of the rays' samples, on their way between ranks */
} sf_batch;

/* What one iteration trains: weights of the loss's terms. Prefixes count from 1. */
typedef struct sf_loss_plan {
  int steps;              /* unrolled, forward and backward */
  bool full;              /* all T steps: every prefix's error is measured, and C_T and C_{t_r} are compared */
  float weight[SF_T_MAX]; /* of each prefix's squared error */
  int regular_at;         /* the prefix with the norm, cosine and sparsity terms, and L_opaque */
  int t_f, t_c, t_r;      /* around t^; in a full iteration */
  double d;               /* t^ - t_f */
  float inverse_rays;
  float stop;       /* a ray ends where less of its light is left: the logarithm of that share */
  float distortion; /* weight of L_distortion, 0 = off */
  float opaque;     /* price of a sample in a ray's tail (L_opaque), 0 = off */
  float extra;      /* weight of L_extra, 0 = off */
  float charge;     /* of reads of weights, 0 = off */
  float distill;    /* weight of L_distill */
  float k_sigma, k_colour;
} sf_loss_plan;

/* One of T prefixes, in place of all. Few steps cost least: t is drawn with a chance of 1/t over the sum of all 1/t.
 * The weight of its squared error makes the mean that of the mean over all prefixes. */
int sf_prefix_draw(uint64_t seed, int64_t iteration, int T, float *weight);
/* Is the prefix composited? */
static inline bool sf_loss_needs(const sf_loss_plan *p, int prefix)
{
  return p->full || p->weight[prefix - 1] > 0;
}
/* The prefixes before it, 0 for that of one step, are not composited. */
static inline int sf_loss_from(const sf_loss_plan *p)
{
  int from = 0;
  while (from < p->steps - 1 && !sf_loss_needs(p, from + 1)) from++;
  return from;
}

typedef struct sf_loss_sums {
  double prefix[SF_T_MAX]; /* squared error of the prefixes that are composited */
  double regular, distortion, tail, extra_floor, extra_ceil, distill;
  double g_sigma_leak, g_colour_leak; /* of L_extra's decay factors, with respect to k */
} sf_loss_sums;
/* Of an iteration whose sums are means over its rays: the loss but for L_charge. e_tau: sum of the neurons' e^tau. */
double sf_loss_total(const sf_loss_plan *plan, const sf_loss_sums *mean, double e_tau);

/* Work arrays of one ray: prefix outputs and their gradients, [T][n] and [T][n][3]; `spare` for the loss. */
typedef struct sf_ray_work {
  float *sigma[SF_T_MAX], *colour[SF_T_MAX], *dsigma[SF_T_MAX], *dcolour[SF_T_MAX], *spare[6];
  float *place, *span; /* [n] distances from the camera and lengths of the samples' intervals, for L_distortion */
  float *memory;
} sf_ray_work;
sf_status sf_ray_work_create(sf_ray_work *work, int samples);
/* delta[ray->count]: lengths of the samples' intervals. */
void sf_loss_ray(const sf_loss_plan *plan, const sf_ray *ray, const float *delta, sf_ray_work *work,
                 sf_loss_sums *sums);

/* Samples nearer to their camera than this learn slower; model units, 0: none do. */
float sf_near_camera(const sf_dataset *data, const sf_train_options *options);
/* The square of a sample's distance from its camera, model units. x: its position in [0,1]^3, axes `stride` apart. */
float sf_squared_distance(const sf_trainer *t, const sf_ray *ray, const float *x, int stride);
/* The weight in [0,1] of the gradients of a sample of the ray. x: its position in [0,1]^3, axes `stride` apart. */
float sf_near_weight(const sf_trainer *t, const sf_ray *ray, const float *x, int stride);
/* Weighs the gradients of the ray's densities and colours. x: positions in blocks of [3][block]; lane: the ray's first.
 */
void sf_near_slow(const sf_trainer *t, const sf_loss_plan *p, const sf_ray *ray, const float *x, int lane, int block,
                  sf_ray_work *w);

/* L_distortion: what its distances are measured in, model units: the cameras' mean distance, at least 1;
 * in NDC the box's depth. */
float sf_distortion_unit(const sf_dataset *data);
/* The ray's place and span; x, lane and block as above. delta[ray->count]: lengths of the samples' intervals. */
void sf_distortion_place(const sf_trainer *t, const sf_ray *ray, const float *x, int lane, int block,
                         const float *delta, sf_ray_work *w);
/* Of a ray of n samples: its value; adds scale times its gradient to dsigma[n]. behind: the light that is left. */
double sf_distortion_add(int n, const float *weight, float behind, const float *delta, float scale, sf_ray_work *w,
                         float *dsigma);

/* What one of the GROUPS parts of a batch adds up. */
typedef struct sf_group {
  void *grad; /* sf_backbone.grad_bytes, floats */
  sf_loss_sums sums;
  double spikes[3], neurons; /* of the first block of each bundle */
  double fired[3], lanes;    /* there: neurons that fired at any step, samples */
  bool wild;                 /* a gradient of the field that is not finite, or far too large */
} sf_group;

/* Work arrays of one thread. */
typedef struct sf_worker {
  void *block; /* [BUNDLE_BLOCKS] of sf_backbone.block_bytes */
  sf_net_scratch *scratch;
  sf_ray_state state; /* of a net along rays: the ray at hand */
  sf_ray_work ray;
  float *dsigma, *dcolour; /* [BUNDLE_BLOCKS][T][SF_BLOCK], [..][3*SF_BLOCK] */
} sf_worker;

/* Of the spiking layers D1, C1, C2. */
typedef struct sf_health {
  int run[3];     /* counts in a row: of silence (negative) or of saturation (positive) */
  int revived[3]; /* times */
  int quiet[3];   /* neurons without a spike, at the last count */
} sf_health;

/* The search for t*: averages over its recent full iterations (search.c). */
typedef struct sf_search {
  int state, measured;     /* sf_search_state; full iterations so far */
  double fast[2], slow[2]; /* of the averages: sums of the measurements' weights, and of their squares */
  double prefix[SF_T_MAX]; /* fast: squared error of every prefix */
  double ratio, ratio2;    /* fast: M_T / M_smooth, and its square */
  double slope, level;     /* slow: slope of the curve of prefixes, and their mean error */
  double slope2, slope_level, level2;
  double firing[3], samples_per_frame, rays_per_sample; /* fast */
  double at;                                            /* share of the search at the last measurement */
  double mark, mark_at, moved; /* t* of a quarter of the search ago, where that was, and how far it moved in one */
} sf_search;

/* Of --charge (charge.c): averages over its recent iterations. */
typedef struct sf_charge {
  double error, reads; /* squared error of what is trained; reads of weights per sample. 0: nothing measured yet */
} sf_charge;

/* Of --opaque (charge.c) and --undecoded (vm_batch.c): averages over recent iterations. */
typedef struct sf_tail {
  double error, samples; /* squared error of what is trained; samples of a ray. 0: nothing measured yet */
} sf_tail;

struct sf_vm; /* vm.h */
struct sf_probes;

/* How a field and its net are trained. The rest of the trainer does not ask which field it trains. */
typedef struct sf_backbone {
  float growth;                       /* of features from the start of a run to the size that neurons are scaled for */
  bool settles;                       /* its lattice may keep a stride of 2 for good: sf_batch_settle */
  sf_status (*create)(sf_trainer *t); /* memory; the model is there */
  void (*destroy)(sf_trainer *t);
  void (*init)(sf_trainer *t); /* the field of a new run, and the nets but for what sf_init_parameters does */
  /* Before an iteration: what is empty, how fine the field is; steps: of the prefix that decides what is empty. */
  sf_status (*begin)(sf_trainer *t, int steps);
  sf_status (*draw)(sf_trainer *t); /* rays and their samples */
  /* Of sf_gradient_run: before the bundles; forward, losses and backward of one bundle; what the ranks' bundles left of
   * the field's gradient, to all ranks; the groups' sum to t->grad. */
  sf_status (*prepare)(sf_trainer *t, const struct sf_loss_plan *plan);
  void (*bundle)(sf_trainer *t, const struct sf_loss_plan *plan, const struct sf_bundle *bundle,
                 struct sf_worker *worker, struct sf_group *group);
  sf_status (*share)(sf_trainer *t);
  void (*collect)(sf_trainer *t, const void *grad);
  size_t block_bytes, grad_bytes;          /* of a block of samples with its activations; of a group's gradient */
  int ray_samples;                         /* that a ray may have */
  sf_status (*check)(const sf_trainer *t); /* the field's gradient is finite */
  void (*update)(sf_trainer *t);           /* Adam on field and nets; clears t->grad */
  /* The inputs of probe `index` at x in [0,1]^3; random numbers of `stream` from `base` on. */
  void (*probe)(const sf_trainer *t, uint64_t stream, uint64_t base, const float x[3], int index,
                struct sf_probes *probes);
} sf_backbone;
/* Of a group's gradient, filled up to whole lines of the cache. */
static inline size_t sf_group_floats(const sf_backbone *b)
{
  return (b->grad_bytes + 63) / 64 * 64 / sizeof(float);
}
extern const sf_backbone sf_backbone_ingp, sf_backbone_tensorf;

struct sf_trainer {
  const sf_backbone *backbone;
  struct sf_vm *vm; /* TensoRF's; NULL */
  sf_train_options options;
  const sf_dataset *data;
  const sf_kernels *kernels;
  sf_model model;
  sf_net_words *net;               /* of the current parameters, for the kernels; TensoRF: part of vm */
  float *grad, *moment1, *moment2; /* [model.size] */
  float *rounded;                  /* in fine-tuning: what sf_scales_round rounds, [model.size], else NULL */
  float *average;                  /* of `averaged` snapshots, [model.size]; NULL before the first */
  int averaged;
  float *density;        /* occupancy's running density times the width of its cascade's cells, [sf_config_cells] */
  sf_steps intervals;    /* of this iteration's stride */
  float near_camera;     /* sf_near_camera */
  float distortion_unit; /* sf_distortion_unit */
  sf_batch batch;
  sf_group group[GROUPS];
  float *grads;           /* the groups', one after another; of ranks twice as many behind them, for their sum */
  size_t *edge, *in_edge; /* [ranks + 1], for sf_ranks_share and sf_ranks_exchange */
  sf_worker *worker;
  int workers;
  int64_t iteration, stage_start;
  int stage, rays, stride;
  double seconds, progress, stage_progress, last_step; /* last_step: seconds of the last iteration */
  sf_search search;
  double firing[3]; /* spikes per neuron and step of D1, C1, C2, last iteration */
  double row_reads; /* of a sample, last iteration */
  sf_charge charge;
  sf_tail tail;
  double occupied, epoch; /* epoch: passes over the training pixels in this stage */
  sf_health health;
  int64_t samples; /* through the nets, over the run */
};

/* At the start of stage II. */
void sf_search_begin(sf_trainer *trainer);
/* After a full iteration: ratio = M_T / M_smooth; at: share of the search that is done. Moves t*. */
void sf_search_update(sf_trainer *trainer, const sf_loss_sums *mean, double ratio, double at);
void sf_search_end(sf_trainer *trainer);
sf_search_report sf_search_now(const sf_trainer *trainer);
/* Of a frame at so many steps by the firing that was measured, mJ; and what that saves of the twin's, as a share. */
double sf_search_energy(const sf_trainer *trainer, double steps);
double sf_search_saving(const sf_trainer *trainer, double steps);

/* Before the backward pass: what a neuron that fires at any step is charged with. */
void sf_charge_begin(sf_trainer *trainer, const sf_loss_plan *plan);
/* After it: any[3], shares of D1, C1, C2 that fired at any step. */
void sf_charge_measured(sf_trainer *trainer, const double any[3]);
/* After an iteration whose plan charges. */
void sf_charge_update(sf_trainer *trainer, double error);

/* What L_opaque charges for a sample of a ray. */
float sf_tail_price(const sf_trainer *trainer);
/* After an iteration. */
void sf_tail_update(sf_trainer *trainer, double error);

sf_status sf_batch_create(sf_batch *batch, int samples, int features);
void sf_batch_free(sf_batch *batch);
/* The ray of a random pixel of a random view; a function of seed and index. Gives the pixel, which is on its way from
 * memory. */
const uint16_t *sf_batch_ray(const sf_trainer *trainer, uint64_t index, sf_ray *ray);
/* The ray's target: the pixel, composited with its alpha on this ray's background. */
void sf_batch_target(const sf_trainer *trainer, uint64_t index, const uint16_t *pixel, sf_ray *ray);
/* Draws and marches `trainer->rays` rays; packs them into bundles. */
sf_status sf_batch_draw(sf_trainer *trainer);
/* Number of rays of the next iteration, from the samples of this one. */
void sf_batch_adapt(sf_trainer *trainer);
int sf_batch_most(const sf_trainer *t); /* rays of an iteration */
/* Share of a run after which its lattice is the model's: what is rendered has the intervals that were trained. */
static const double sf_lattice_settles = 0.5;
/* Makes the stride of now, but at most 2, the model's own: lattice / stride, dt_gamma * stride. TensoRF's step follows
 * from its grids: there the stride goes back to 1. */
void sf_batch_settle(sf_trainer *trainer);
/* How many times shorter intervals are once they are settled than now. */
int sf_batch_finer(const sf_trainer *trainer);
/* The most blocks that so many samples take, however they are packed: a bundle and the next have more than BUNDLE_FILL,
 * or it has more than half of that. Where samples leave, bundles move, and blocks may become more. */
int sf_batch_blocks(int samples);
/* Bundles of the rays' samples as they are counted now. */
void sf_batch_pack(sf_batch *batch);
/* Drops the samples behind which the light is gone (sf_opaque) in every prefix that the plan trains, as rendering
 * does: nothing of them would be seen or learned. Finds the features of the others. */
sf_status sf_batch_compact(sf_trainer *trainer, const sf_loss_plan *plan);

/* ---- parts of an iteration on ranks (share.c); all of it where the trainer is alone ---- */

/* The parts first .. end - 1 of GROUPS that are this rank's. */
void sf_share_parts(const sf_trainer *trainer, int *first, int *end);
/* What rank i has of n things that are cut into GROUPS parts: start(i) .. start(i + 1) - 1. */
static inline int sf_share_start(const sf_trainer *t, int rank, int n)
{
  const int part = GROUPS * rank / sf_ranks_size(t->options.ranks);
  return (int)((int64_t)n * part / GROUPS);
}
/* Rays, blocks, or lanes of the ranks' bundles, each cut into parts, to t->edge. */
void sf_share_rays(sf_trainer *trainer);
void sf_share_blocks(sf_trainer *trainer);
/* Elements [count] of which each rank has the slice that t->edge says, to all. */
sf_status sf_share(sf_trainer *trainer, void *data, size_t size);
/* After the bundles: the sums of all groups, and of ranks all groups' gradients added to the first. */
sf_status sf_share_groups(sf_trainer *trainer);
/* After an iteration: rank 0's clock, and from time to time whether the ranks' models are equal still. */
sf_status sf_share_end(sf_trainer *trainer);
/* Before the first: refuses ranks with other pictures, checkpoints or kernels. */
sf_status sf_share_begin(sf_trainer *trainer, const char *resume);

/* Work arrays of the threads and groups. Free them even after a failure. */
sf_status sf_workers_create(sf_trainer *trainer);
void sf_workers_free(sf_trainer *trainer);
/* Forward, losses and backward of the batch, bundle by bundle: adds the nets' gradient to trainer->grad and leaves what
 * the field's needs. mean: losses per ray. */
sf_status sf_gradient_run(sf_trainer *trainer, const sf_loss_plan *plan, sf_loss_sums *mean, double firing[3]);
/* L_extra's part in the leaks: adds to trainer->grad what the integrators' decay factors get from `sums`, and the slope
 * of the neurons' e^tau; returns the sum of e^tau. */
double sf_gradient_leaks(sf_trainer *trainer, const sf_loss_plan *plan, const sf_loss_sums *sums);
sf_status sf_init_parameters(sf_trainer *trainer);

/* Fine-tuning: the model's scales are settled. */
static inline bool sf_tuning(const sf_trainer *t)
{
  return t->model.scales.weight_bits > 0;
}
static const double sf_tuning_rate = 0.1; /* of the learning rates */
/* Settles what fine-tuning does not learn. */
sf_status sf_tuning_start(sf_trainer *trainer);
/* Before an iteration: brings what is rounded up to the parameters. */
void sf_tuning_round(sf_trainer *trainer);
/* The model as the forward pass sees it, its nets or its field alone. */
sf_model sf_tuning_nets(const sf_trainer *trainer);
sf_model sf_tuning_field(const sf_trainer *trainer);
/* Brings trainer->net up to the parameters. */
void sf_train_prepare(sf_trainer *trainer);

/* Samples in occupied cells, seen from the training cameras, for the scalar nets. */
enum { PROBES = 256 };
typedef struct sf_probes {
  int features;
  float *f, *sh; /* [PROBES][features], [PROBES][16]; TensoRF: the decoder's inputs, nothing */
  sf_net_trace *trace;
} sf_probes;
sf_status sf_probes_create(sf_probes *probes, const sf_trainer *trainer);
void sf_probes_free(sf_probes *probes);
/* The first `count`; a function of seed, stream and iteration. */
void sf_probes_draw(const sf_trainer *trainer, uint64_t stream, int count, sf_probes *probes);
/* Runs probe `index`, leaving probes->trace. */
void sf_probe(const sf_model *model, const sf_probes *probes, int index, int steps);
/* New random weights; weights scaled until the currents of all PROBES have the threshold as root mean square. */
void sf_layer_redraw(sf_trainer *trainer, int layer, uint64_t stream);
void sf_layer_scale(sf_trainer *trainer, int layer, const sf_probes *probes);
/* Parameter `id` uniform in +-bound. */
void sf_init_uniform(const sf_trainer *trainer, int id, float bound, uint64_t stream, uint64_t base);

/* After the update: leaks back into range. */
void sf_health_leaks(sf_trainer *trainer);
/* Every 64 iterations: revives a layer that was silent or saturated for long; event: -1 it was silent, 1 saturated, 0
 * nothing. */
sf_status sf_health_check(sf_trainer *trainer, int event[3]);
sf_status sf_occupancy_update(sf_trainer *trainer, int steps);
/* The point of cell `cell` at `place` in [0,1]^3 of it, as a position in [0,1]^3 of the box. */
void sf_occupancy_point(const sf_config *config, size_t cell, const float place[3], float x[3]);

/* The nets' weights and leaks are finite and of a size that a net can have. */
sf_status sf_parameters_check(const sf_trainer *trainer);
/* After an iteration: takes a snapshot when one is due; at the end of the run the mean becomes the model. */
sf_status sf_average_update(sf_trainer *trainer, double progress_before);
sf_status sf_average_reserve(sf_trainer *trainer);
/* Lanes of block `index` that hold samples, where a bundle has so many. */
static inline int sf_block_lanes(int lanes, int index)
{
  const int left = lanes - index * SF_BLOCK;
  return left < 0 ? 0 : left < SF_BLOCK ? left : SF_BLOCK;
}
/* Tells the blocks how many of their lanes hold samples, and of a net along rays, where its rays begin. Returns the
 * bundle's lanes that hold samples. */
int sf_mark_lanes(const sf_trainer *t, const sf_loss_plan *p, const sf_bundle *bundle, sf_worker *worker);
/* to[rows][columns] += from[rows][ld]. */
void sf_matrix_add(float *to, const float *from, int rows, int columns, int ld);
/* to[rows][columns] += the transpose of from[columns][rows]. */
void sf_matrix_add_transposed(float *to, const float *from, int rows, int columns);
/* Adds the spikes of spiking layers `first`..2 in the first `lanes` lanes of a block. */
void sf_count_spikes(const sf_trainer *t, int first, int steps, const sf_block *block, int lanes, sf_group *group);
sf_status sf_checkpoint_load(sf_trainer *trainer, const char *path);
#endif
