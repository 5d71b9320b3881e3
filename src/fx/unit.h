/* The arithmetic units of the accelerator as pure functions. Each has a combinational RTL module of the same
 * name (fx_plif_step <-> sf_plif, fx_exp2 <-> sf_exp2, fx_sigmoid <-> sf_sigmoid, fx_integrate_* <-> sf_integrate,
 * fx_grid_weights <-> sf_grid_weight). */
#ifndef SF_FX_UNIT_H
#define SF_FX_UNIT_H
#include "fx/fx.h"

enum { FX_MEMBRANE_MAX = (1 << (SF_MEMBRANE_BITS - 1)) - 1, FX_LEAK_ONE = 1 << SF_LEAK_FRAC };
enum { FX_INPUT_MAX = (1 << (SF_INPUT_BITS - 1)) - 1, FX_TRANS_ONE = 1 << SF_TRANS_FRAC };
enum { FX_EXP2_BITS = SF_LOG_FRAC + 6, FX_SIGMOID_BITS = SF_LOG_FRAC + 4 }; /* arguments: [-32, 32) and [-8, 8) */

/* One neuron, one step. v: s24 after the last reset (ignored when `first`); current: s24 in membrane LSB.
 * membrane: before fire and reset; v: after. Of radix the caller gives the current at the first step and 0 behind it.
 * Only no-decay and radix can saturate. */
typedef struct fx_plif {
  int32_t v, membrane;
  bool spike, saturated;
} fx_plif;
fx_plif fx_plif_step(int32_t v, int32_t current, int32_t k, int32_t theta, int32_t mode, bool first);

/* fx_plif_step over lanes 0..n-1, one leak and threshold. spikes: bitmap, rewritten whole. membrane[n] (before
 * reset) may be NULL. Returns the number of saturations. */
int fx_plif_layer(int32_t *v, const int32_t *current, int n, const fx_layer *layer, int32_t mode, bool first,
                  uint64_t spikes[SF_SPIKE_WORDS], int32_t *membrane);

/* 2^y, y in Q.LOG_FRAC (s18) -> U16.12, saturating at 2^28 - 1 from y = 16.0 on. */
uint32_t fx_exp2(int32_t y);
/* exp(-tau), tau Q.TRANS_FRAC unsigned -> Q.TRANS_FRAC, 1 << TRANS_FRAC at 0. */
uint32_t fx_exp_neg(uint64_t tau);
/* 1 / (1 + exp(-x)), x in Q4.12 (s16) -> Q0.16, 0..65535. */
uint32_t fx_sigmoid(int32_t x);

/* TensoRF's density activations, y s24 Q.12 -> unsigned Q.ACTIVATION_FRAC: log(1 + e^y), max(y, 0). */
enum { FX_ACTIVATION_FRAC = 20, FX_ACTIVATION_BITS = SF_LOG_FRAC + 12 };
uint32_t fx_softplus(int32_t y);
uint32_t fx_relu(int32_t y);
/* sin of a phase in turns: bits above PHASE_BITS are whole turns. Q1.14. */
enum { FX_PHASE_BITS = 16 };
int32_t fx_sine(uint32_t phase);

/* Table arguments: sat(rshift_round(current * mul, shift) + bias). |current| < 2^15, so the product is s32; of radix
 * |current| < 2^23 (fx_weigh), and it is s40. */
int32_t fx_exp2_argument(int32_t current, const fx_scale *scale);    /* s18, Q.12 */
int32_t fx_sigmoid_argument(int32_t current, const fx_scale *scale); /* s16, Q.12 */

/* Trilinear weights, Q0.16, of the corners of a cell; g[3]: place in the cell, 0..255. Bit 0 of the index = x + 1, bit
 * 1 = y + 1, bit 2 = z + 1. They sum to 65536. */
enum { FX_GRID_CORNERS = 8 };
void fx_grid_weights(const int32_t g[3], int32_t weight[FX_GRID_CORNERS]);

/* Leaky integrators without reset; acc is ignored when `first`. saturated (never NULL) counts up. */
uint32_t fx_integrate_density(uint32_t acc, uint32_t e, int32_t k, int32_t mode, bool first, uint64_t *saturated);
uint32_t fx_integrate_colour(uint32_t acc, uint32_t s, int32_t k, int32_t mode, bool first, uint64_t *saturated);

/* Radix: an output's currents of the steps so far, of which each weighs half of the one before. The first step begins
 * with 0. |current| < 2^15 and at most 8 steps: |sum| <= 32639 * 255 < 2^23. */
static inline int32_t fx_weigh(int32_t sum, int32_t current)
{
  return 2 * sum + current;
}

/* Radix: h of such a sum: its mean, rounded to 2^-steps of the current's LSB, then down by SF_H_SHIFT. */
int32_t fx_weighed_h(int32_t sum, int steps);
#endif
