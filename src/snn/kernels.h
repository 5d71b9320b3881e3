/* Vector kernels of the nets: forward and backward of one block of samples through all steps.
 *
 * A block is SF_BLOCK samples side by side: every array is [row][SF_BLOCK], one row per neuron or
 * feature, so that one vector holds the same neuron of neighbouring samples. What a block keeps for its
 * backward pass stays in the L2/L3 cache. kernels_isa.c is compiled once per instruction set; the
 * portable build is the oracle of the others (they contract multiply-adds, so last bits differ). */
#ifndef SF_SNN_KERNELS_H
#define SF_SNN_KERNELS_H
#include "spikefield/model.h"

enum { SF_BLOCK = 64 };

/* The nets of a model. Matrices are [out][in] like the parameters. */
typedef struct sf_net_view {
  const float *w1, *w2, *w3, *w4, *w5;
  float k[SF_LAYERS]; /* D1, density integrator, C1, C2, colour integrator */
  float theta[3];
  float h_step; /* h is rounded down to its multiples; 0: it is not */
  int hidden, features, mode, relu;
} sf_net_view;

/* The nets as one instruction set's kernels read them: weights in operand words (gemm_isa.h), each matrix also
 * transposed for the backward pass; h has 16 columns here, the first (the density current) with zero weight. */
typedef struct sf_net_words {
  uint32_t w1[SF_LANES * 32], w2[SF_DENSITY_OUT * SF_LANES], w3d[SF_LANES * 16], w3h[SF_LANES * 16],
      w4[SF_LANES * SF_LANES], w5[4 * SF_LANES];
  uint32_t w1t[32 * SF_LANES], w2t[SF_LANES * SF_DENSITY_OUT], w3ht[16 * SF_LANES], w4t[SF_LANES * SF_LANES],
      w5t[SF_LANES * 4];
  float w4_slice[SF_LANES / 64][(SF_LANES + 1) * 64]; /* w4t as the operands' values, for events: 64 outputs a slice, a
                                                         row of zeros after the last */
  sf_net_view view;                                   /* last: it would push the arrays off their alignment */
} sf_net_words;

/* Gradients, laid out like the parameters but padded: w1 has rows of features rounded up to 16; w3 has rows of 32, the
 * 16 directions, one scratch column, then h. `leak` is the gradient of the logits w of k = sigmoid(w). */
typedef struct sf_net_grad {
  float w1[SF_LANES * 32], w2[SF_DENSITY_OUT * SF_LANES], w3[SF_LANES * 32], w4[SF_LANES * SF_LANES], w5[4 * SF_LANES];
  float w4t[SF_LANES * SF_LANES]; /* more of w4, transposed: [in][out] */
  float leak[SF_LAYERS];
} sf_net_grad;

/* What the forward pass of one block leaves: prefix outputs, and the membranes before fire for backward. */
typedef struct sf_block {
  float f[2 * 16 * SF_BLOCK], sh[SF_DIR_FEATURES * SF_BLOCK];
  float i[SF_T_MAX][SF_DENSITY_OUT * SF_BLOCK], j[SF_T_MAX][4 * SF_BLOCK];
  float sigma[SF_T_MAX][SF_BLOCK], colour[SF_T_MAX][3 * SF_BLOCK]; /* prefixes 1..T */
  float m1[SF_T_MAX][SF_LANES * SF_BLOCK], m3[SF_T_MAX][SF_LANES * SF_BLOCK], m4[SF_T_MAX][SF_LANES * SF_BLOCK];
  uint64_t s3[SF_T_MAX][SF_LANES]; /* spikes of C1, a bit per lane */
} sf_block;

/* Working memory of one thread. Words: operands of the next product, paired over rows or over lanes. */
typedef struct sf_net_scratch {
  uint32_t rows[SF_LANES * SF_BLOCK], lanes[SF_LANES * SF_BLOCK], spikes[SF_LANES * SF_BLOCK];
  uint32_t t[SF_BLOCK * SF_LANES];                                                 /* transposed: [SF_BLOCK][rows] */
  float g1[SF_LANES * SF_BLOCK], g3[SF_LANES * SF_BLOCK], g4[SF_LANES * SF_BLOCK]; /* carries of the membranes */
  float sum1[SF_LANES * SF_BLOCK], sum3[SF_LANES * SF_BLOCK]; /* forward: the currents that are constant over t */
  float leak[SF_LAYERS][SF_BLOCK];
} sf_net_scratch;

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
} sf_kernels;

/* "portable", "avx2", "avx512", "avx512bf16" (weights and gradients rounded to bfloat16, membranes and sums fp32), or
 * NULL for the best of this CPU that does not round; NULL when this CPU or build lacks it. */
const sf_kernels *sf_kernels_select(const char *name);
/* The fastest for training on this CPU. */
const sf_kernels *sf_kernels_training(void);
#endif
