/* Weights, activations and gradients as operand words of the products.
 * Included by kernels_isa.c only. */
#ifndef SF_SNN_WORDS_ISA_H
#define SF_SNN_WORDS_ISA_H
#include "snn/gemm_isa.h"
#if defined(__AVX512F__)
#include "snn/event_isa.h"
#else
#include "snn/lookup_isa.h"
#endif

enum { B = SF_BLOCK, IN3 = SF_DIR_FEATURES + SF_GEO_FEATURES, BW = B / PAIR };

/* Whether every product of a net with spikes is looked up. */
static inline bool looked_up(const sf_net_view *net)
{
  return LOOKUP && !net->relu;
}

/* Weights [rows][columns] (row stride ld) as words [rows][padded / PAIR], zero beyond `columns`. */
static void pack_matrix(const float *w, int row, int column, int rows, int columns, int padded, uint32_t *out)
{
  word *to = words(out);
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < padded; c += PAIR) {
      const int d = c + PAIR - 1;
      *to++ = pair(c < columns ? w[r * row + c * column] : 0, d < columns ? w[r * row + d * column] : 0);
    }
}

/* Weights [rows][columns] for the products with `columns` spikes. */
static void prepare_transposed(const float *w, int rows, int columns, float *out)
{
  float t[SF_LANES * SF_LANES];
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++) t[c * rows + r] = w[r * columns + c];
  prepare_spikes(t, rows, columns, rows, out);
}

/* Layers C2 and C3, which both backbones have. */
static void prepare_hidden(const sf_net_view *v, sf_net_words *n)
{
  const int hidden = v->hidden;
  pack_matrix(v->w4, hidden, 1, hidden, hidden, hidden, n->w4);
  pack_matrix(v->w5, hidden, 1, 3, hidden, hidden, n->w5); /* the fourth row stays zero */
  pack_matrix(v->w4, 1, hidden, hidden, hidden, hidden, n->w4t);
  pack_matrix(v->w5, 1, hidden, hidden, 3, 4, n->w5t);
  prepare_transposed(v->w4, hidden, hidden, n->w4_spikes);
  for (int r = 0; r < hidden && v->along; r++) {
    for (int c = 0; c < hidden; c++) n->w4_rows[r * hidden + c] = v->w4[c * hidden + r];
    for (int c = 0; c < 16; c++) n->w5_rows[16 * r + c] = c < 3 ? v->w5[c * hidden + r] : 0;
  }
}

static void prepare(const sf_net_view *v, sf_net_words *n)
{
  const int hidden = v->hidden, features = v->features;
  float h[SF_LANES * 16] = {0};
  for (int r = 0; r < hidden; r++)
    memcpy(h + 16 * r + 1, v->w3 + IN3 * r + SF_DIR_FEATURES, SF_GEO_FEATURES * sizeof *h);
  memset(n, 0, sizeof *n);
  n->view = *v;
  pack_matrix(v->w1, features, 1, hidden, features, features, n->w1);
  pack_matrix(v->w2, hidden, 1, SF_DENSITY_OUT, hidden, hidden, n->w2);
  pack_matrix(v->w3, IN3, 1, hidden, SF_DIR_FEATURES, SF_DIR_FEATURES, n->w3d);
  pack_matrix(h, 16, 1, hidden, 16, 16, n->w3h);
  pack_matrix(v->w1, 1, features, features, hidden, hidden, n->w1t);
  pack_matrix(v->w2, 1, hidden, hidden, SF_DENSITY_OUT, SF_DENSITY_OUT, n->w2t);
  pack_matrix(h, 1, 16, 16, hidden, hidden, n->w3ht);
  if (LOOKUP) prepare_transposed(v->w2, SF_DENSITY_OUT, hidden, n->w2_spikes);
  prepare_hidden(v, n);
  for (int r = 0; r < hidden && v->along; r++)
    for (int c = 0; c < 16; c++) {
      n->w2_rows[16 * r + c] = v->w2[c * hidden + r];
      n->h_rows[16 * r + c] = n->w3h_rows[c * hidden + r] = h[16 * r + c];
    }
}

/* Words of neighbouring rows: x[rows][B] -> [rows / PAIR][B]. Where a word holds one number these are the numbers
 * themselves. Else they are written to `room`. */
static inline const word *row_words(const float *x, int rows, uint32_t *room)
{
  if (PAIR == 1) return operands(x);
  word *out = words(room);
  for (int r = 0; r < rows; r += PAIR, out += B)
    for (int l = 0; l < B; l++) out[l] = pair(x[r * B + l], x[(r + PAIR - 1) * B + l]);
  return words(room);
}

/* Words of lanes l and l + B/2: x[rows][B] -> [rows][BW], likewise. */
static inline const word *lane_words(const float *x, int rows, uint32_t *room)
{
  if (PAIR == 1) return operands(x);
  word *out = words(room);
  for (int r = 0; r < rows; r++, x += B, out += BW)
    for (int l = 0; l < BW; l++) out[l] = pair(x[l], x[l + B - BW]);
  return words(room);
}

/* Activations (spikes, or ReLU for the twin) of membranes before fire, as words of rows. */
static inline void activation_rows(const sf_net_view *net, int layer, int rows, const float *restrict h,
                                   word *restrict out)
{
  const float theta = net->theta[layer];
  for (int r = 0; r < rows; r += PAIR, out += B) {
    const float *x = h + r * B, *y = h + (r + PAIR - 1) * B;
    if (net->relu)
      for (int l = 0; l < B; l++) out[l] = pair(x[l] > 0 ? x[l] : 0, y[l] > 0 ? y[l] : 0);
    else
      for (int l = 0; l < B; l++) out[l] = spike_pair(x[l], y[l], theta);
  }
}

/* The same as words of lanes. */
static inline void activation_lanes(const sf_net_view *net, int layer, int rows, const float *restrict h,
                                    word *restrict out)
{
  const float theta = net->theta[layer];
  for (int r = 0; r < rows; r++, h += B, out += BW) {
    const float *y = h + B - BW;
    if (net->relu)
      for (int l = 0; l < BW; l++) out[l] = pair(h[l] > 0 ? h[l] : 0, y[l] > 0 ? y[l] : 0);
    else
      for (int l = 0; l < BW; l++) out[l] = spike_pair(h[l], y[l], theta);
  }
}
#endif
