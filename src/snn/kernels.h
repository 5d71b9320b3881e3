/* Vector kernels of the nets: forward and backward of one block of samples through all steps.
 *
 * A block is SF_BLOCK samples side by side: every array is [row][SF_BLOCK], one row per neuron or
 * feature, so that one vector holds the same neuron of neighbouring samples. What a block keeps for its
 * backward pass stays in the L2/L3 cache. kernels_isa.c is compiled once per instruction set; the
 * portable build is the oracle of the others (they contract multiply-adds, so last bits differ). */
#ifndef SF_SNN_KERNELS_H
#define SF_SNN_KERNELS_H
#include "snn/model.h"

enum { SF_BLOCK = 64 };

/* The nets of a model. Matrices are [out][in] like the parameters. */
typedef struct sf_net_view {
  const float *w1, *w2, *w3, *w4, *w5;
  float k[SF_LAYERS]; /* D1, density integrator, C1, C2, colour integrator */
  float theta[3];
  float h_step;    /* h is rounded down to its multiples; 0: it is not */
  float charge[3]; /* of backward: what a sample costs more for each neuron of D1, C1, C2 that fires at any step; all 0:
                      nothing */
  int hidden, features, mode, relu;
  int along; /* the samples of a ray are its steps */
} sf_net_view;

/* The nets as one instruction set's kernels read them: weights in operand words (gemm_isa.h), each matrix also
 * transposed for the backward pass; h has 16 columns here, the first (the density current) with zero weight. */
typedef struct sf_net_words {
  uint32_t w1[SF_LANES * 32], w2[SF_DENSITY_OUT * SF_LANES], w3d[SF_LANES * 16], w3h[SF_LANES * 16],
      w4[SF_LANES * SF_LANES], w5[4 * SF_LANES];
  uint32_t w1t[32 * SF_LANES], w2t[SF_LANES * SF_DENSITY_OUT], w3ht[16 * SF_LANES], w4t[SF_LANES * SF_LANES],
      w5t[SF_LANES * 4];
  /* w2t and w4t for the products with spikes, as lookup_isa.h or event_isa.h lays them out. */
  float w2_spikes[SF_LANES * 4 * SF_DENSITY_OUT], w4_spikes[SF_LANES * 4 * SF_LANES];
  /* Of a net along rays: what one input adds, a row each; h's is transposed, too: [hidden][16]. */
  float w2_rows[SF_LANES * SF_DENSITY_OUT], w3h_rows[16 * SF_LANES], h_rows[SF_LANES * 16],
      w4_rows[SF_LANES * SF_LANES], w5_rows[SF_LANES * 16];
  sf_net_view view; /* last: it would push the arrays off their alignment */
} sf_net_words;

/* Gradients, laid out like the parameters but padded: w1 has rows of features rounded up to 16; w3 has rows of 32, the
 * 16 directions, one scratch column, then h. `leak` is the gradient of the logits w of k = sigmoid(w). */
typedef struct sf_net_grad {
  float w1[SF_LANES * 32], w2[SF_DENSITY_OUT * SF_LANES], w3[SF_LANES * 32], w4[SF_LANES * SF_LANES], w5[4 * SF_LANES];
  float w2t[SF_LANES * SF_DENSITY_OUT], w4t[SF_LANES * SF_LANES]; /* more of w2 and w4, transposed: [in][out] */
  float leak[SF_LAYERS];
} sf_net_grad;

/* Of one ray of a net along rays: membranes of D1, C1, C2 after the reset, on their way to the next sample. */
typedef struct sf_ray_state {
  float v[3][SF_LANES];
} sf_ray_state;

/* What the forward pass of one block leaves: prefix outputs, and the membranes before fire for backward. */
/* Radix mode: i and j are what the spikes of each prefix add up to; m1[0] is the current of D1, m3 and m4 those of C1
 * and C2 in each prefix; s3 is not used. */
typedef struct sf_block {
  int lanes; /* that hold samples: the others are not charged */
  int from; /* radix mode: the first prefix that is wanted, 0 for that of one step. Those before it are not written, and
               their gradients not read */
  float f[2 * 16 * SF_BLOCK], sh[SF_DIR_FEATURES * SF_BLOCK];
  float i[SF_T_MAX][SF_DENSITY_OUT * SF_BLOCK], j[SF_T_MAX][4 * SF_BLOCK];
  float sigma[SF_T_MAX][SF_BLOCK], colour[SF_T_MAX][3 * SF_BLOCK]; /* prefixes 1..T */
  float m1[SF_T_MAX][SF_LANES * SF_BLOCK], m3[SF_T_MAX][SF_LANES * SF_BLOCK], m4[SF_T_MAX][SF_LANES * SF_BLOCK];
  uint64_t s3[SF_T_MAX][SF_LANES]; /* spikes of C1, a bit per lane */
  /* Of a net along rays, filled by the caller: which lanes begin a ray, and each lane's ray. Its samples are
   * neighbours, in order, and may go on in the next block. i, m1, m3 and m4 are [lane][row] there. */
  uint64_t first;
  sf_ray_state *state[SF_BLOCK];
} sf_block;

/* TensoRF's appearance and decoder. basis [features][columns]; products: columns rounded up to 16. Of `net`, w4 and w5,
 * the leaks and thresholds of C1, C2 and the colour integrator, hidden, mode and relu count. */
typedef struct sf_decoder_view {
  sf_net_view net;
  const float *w1, *b1, *b2, *b3, *basis;
  int inputs, features, feature_freqs, columns, products;
  float feature_step, encoding_step; /* to whose multiples C1's inputs are rounded; 0: they are not */
} sf_decoder_view;

typedef struct sf_decoder_words {
  sf_net_words net;
  uint32_t w1[SF_LANES * SF_DECODER_MAX], w1t[SF_DECODER_MAX * SF_LANES];
  uint32_t basis[SF_APPEARANCE_MAX * SF_DECODER_MAX], basist[SF_DECODER_MAX * SF_APPEARANCE_MAX];
  float b2[SF_LANES * SF_BLOCK], b3[4 * SF_BLOCK]; /* in every lane */
  sf_decoder_view view;
} sf_decoder_words;

/* Rows of w1: inputs, the bias, zeros up to a multiple of 16; of basis: products. Of `net`, w4, w4t, w5 and leak. */
typedef struct sf_decoder_grad {
  sf_net_grad net;
  float w1[SF_LANES * SF_DECODER_MAX], basis[SF_APPEARANCE_MAX * SF_DECODER_MAX], b2[SF_LANES], b3[4];
} sf_decoder_grad;

/* A block of samples that reach the decoder. The caller fills product, and of `in` the rows of the direction and its
 * encodings, [inputs][SF_BLOCK] as sf_tensorf_encode orders them. */
typedef struct sf_decoder_block {
  sf_block net;                             /* j, colour, m3, m4, s3 */
  float product[SF_BLOCK * SF_DECODER_MAX]; /* [SF_BLOCK][products] */
  float product_rows[SF_DECODER_MAX * SF_BLOCK];
  float in[SF_DECODER_MAX * SF_BLOCK];
} sf_decoder_block;

/* Three planes and three lines, and the activation of a density field (tensorf.h). */
typedef struct sf_vm_field {
  const float *plane[3], *line[3];
  int resolution[3], channels[3];
  int relu;
  float shift, distance_scale;
} sf_vm_field;

/* A ray among the occupancy grids of a model, as sf_march_begin makes it (render/march.h). */
typedef struct sf_march {
  const sf_steps *steps; /* must outlive it */
  const uint8_t *occupancy;
  int res, cascades;
  float jitter, origin[3], direction[3];
  float scale[3], offset[3]; /* position in [0,1]^3 = model units * scale + offset */
  float way[3];              /* along the ray from face to face of the box; 0: it never gets there */
  sf_lattice lattice;
  float stop; /* it ends where less light is left */
} sf_march;

enum { SF_ROWS_MAX = (int)SF_LANES > (int)SF_DECODER_MAX ? (int)SF_LANES : (int)SF_DECODER_MAX }; /* of a product */

/* Working memory of one thread. Words: operands of the next product, paired over rows or over lanes. */
typedef struct sf_net_scratch {
  uint32_t rows[SF_ROWS_MAX * SF_BLOCK], lanes[SF_ROWS_MAX * SF_BLOCK], spikes[SF_ROWS_MAX * SF_BLOCK];
  uint32_t t[SF_BLOCK * SF_ROWS_MAX];                                              /* transposed: [SF_BLOCK][rows] */
  float g1[SF_LANES * SF_BLOCK], g3[SF_LANES * SF_BLOCK], g4[SF_LANES * SF_BLOCK]; /* carries of the membranes */
  float sum1[SF_LANES * SF_BLOCK], sum3[SF_LANES * SF_BLOCK]; /* forward: the currents that are constant over t */
  float leak[SF_LAYERS][SF_BLOCK];
  float fired[3][SF_LANES * SF_BLOCK]; /* steps at which neurons of D1, C1, C2 fire, where they are charged */
  /* Forward, where all spikes are looked up: those of C1, and what they add to C2's current. */
  uint64_t fired3[SF_T_MAX][SF_LANES];
  float currents[SF_T_MAX * SF_LANES * SF_BLOCK]; /* [T][hidden][SF_BLOCK] */
  sf_ray_state carry; /* backward along rays: gradient of the membranes, on their way to the sample before; zeros
                         between two rays */
} sf_net_scratch;

typedef struct sf_adam {
  double lr, beta1, beta2, epsilon;
  int64_t step; /* 1, 2, ... */
  float l1;     /* gradient of |value|; 0 = none, and what has no gradient stays as it is */
} sf_adam;

typedef struct sf_kernels {
  const char *name;
  /* Once per change of the parameters. */
  void (*prepare)(const sf_net_view *view, sf_net_words *net);
  /* Forward through `steps` steps of block->f and block->sh. keep: for how many of them backward will be called. */
  void (*forward)(const sf_net_words *net, sf_block *block, int steps, int keep, sf_net_scratch *scratch);
  /* Density prefix `steps` only: block->sigma[steps-1]. */
  void (*density)(const sf_net_words *net, sf_block *block, int steps, sf_net_scratch *scratch);
  /* Adds to grad; df[features][SF_BLOCK]. dsigma[T][SF_BLOCK] and dcolour[T][3*SF_BLOCK]: gradients of the prefixes. */
  void (*backward)(const sf_net_words *net, const sf_block *block, int steps, const float *dsigma, const float *dcolour,
                   float *df, sf_net_grad *grad, sf_net_scratch *scratch);
  /* Hash grid, one level, one block: x[3][SF_BLOCK] in [0,1] -> out[2][SF_BLOCK]; backward adds to the table's
   * gradient. */
  void (*grid_forward)(const sf_grid_level *level, const float *table, const float *x, float *out);
  void (*grid_backward)(const sf_grid_level *level, const float *x, const float *dout, float *dtable);
  /* Bit n: point 64 word + n of the ray is in an occupied cell. These are the points that sf_march_next finds, with any
   * instruction set. */
  uint64_t (*march)(const sf_march *march, int word);
  /* TensoRF. x[n][3] in [0,1]^3 of the box. Density per model unit and its slope, by the feature, of n samples;
   * products [n][ld], ld >= the components of all modes, zeros behind them. */
  void (*vm_density)(const sf_vm_field *field, const float *x, int n, float *sigma, float *slope);
  void (*vm_products)(const sf_vm_field *field, const float *x, int n, float *product, int ld);
  /* Adds the gradient of at most 16 components of one mode, from `first` on, samples in order. g[n][ld]: the first of
   * them at g[0]; ld = 0: one gradient per sample, of the sum of all. Writes to no other component. */
  void (*vm_backward)(const sf_vm_field *field, int mode, int first, int count, const float *x, int n, const float *g,
                      int ld, float *dplane, float *dline);
  void (*decoder_prepare)(const sf_decoder_view *view, sf_decoder_words *decoder);
  void (*decoder_forward)(const sf_decoder_words *decoder, sf_decoder_block *block, int steps, int keep,
                          sf_net_scratch *scratch);
  /* Adds to grad; dproduct[SF_BLOCK][products]. dcolour[T][3*SF_BLOCK]. */
  void (*decoder_backward)(const sf_decoder_words *decoder, sf_decoder_block *block, int steps, const float *dcolour,
                           float *dproduct, sf_decoder_grad *grad, sf_net_scratch *scratch);
  /* Nets along rays: one step per sample. Blocks of a ray in order; backward from the last to the first. Outputs and
   * their gradients are those of prefix 1; density: block->sigma[0] alone. */
  void (*along_density)(const sf_net_words *net, sf_block *block, sf_net_scratch *scratch);
  void (*along_forward)(const sf_net_words *net, sf_block *block, sf_net_scratch *scratch);
  void (*along_backward)(const sf_net_words *net, const sf_block *block, const float *dsigma, const float *dcolour,
                         float *df, sf_net_grad *grad, sf_net_scratch *scratch);
  void (*decoder_along_forward)(const sf_decoder_words *decoder, sf_decoder_block *block, sf_net_scratch *scratch);
  void (*decoder_along_backward)(const sf_decoder_words *decoder, sf_decoder_block *block, const float *dcolour,
                                 float *dproduct, sf_decoder_grad *grad, sf_net_scratch *scratch);
  /* value[n] -= ...; clears grad. m, v: moments. */
  void (*adam)(const sf_adam *adam, size_t n, float *value, float *grad, float *m, float *v);
} sf_kernels;

/* "portable", "avx2", "avx512", "avx512bf16" and "amx" (weights and gradients rounded to bfloat16, membranes and sums
 * fp32), or NULL for the best of this CPU that does not round; NULL when this CPU or build lacks it. */
const sf_kernels *sf_kernels_select(const char *name);
/* The fastest for training on this CPU. */
const sf_kernels *sf_kernels_training(void);
#endif
