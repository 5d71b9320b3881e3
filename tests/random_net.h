/* Random nets and samples for tests of the fixed-point core's mirror: sizes, modes, leaks, thresholds and weights over
 * their whole ranges, extremes more often than chance would. */
#ifndef SF_TESTS_RANDOM_NET_H
#define SF_TESTS_RANDOM_NET_H
#include "fx/fx.h"
#include "base/rng.h"
#include <stdlib.h>
#include <string.h>

typedef struct random_source {
  uint64_t seed, next;
} random_source;

static inline int64_t draw(random_source *r, int64_t low, int64_t high)
{
  return low + (int64_t)sf_random_below(r->seed, 0, r->next++, (uint64_t)(high - low + 1));
}

/* kind 0 uniform, 1 +127, 2 -127, 3 alternating, 4 zero, 5 sparse, 6 small */
static inline int8_t draw_weight(random_source *r, int kind, int i, int o)
{
  switch (kind) {
  case 1:
    return 127;
  case 2:
    return -127;
  case 3:
    return (i + o) & 1 ? -127 : 127;
  case 4:
    return 0;
  case 5:
    return draw(r, 0, 7) ? 0 : (int8_t)draw(r, -127, 127);
  case 6:
    return (int8_t)draw(r, -9, 9);
  default:
    return (int8_t)draw(r, -127, 127);
  }
}

static inline void draw_weights(random_source *r, fx_layer *layer, int kind)
{
  const int rows = fx_layer_rows(layer);
  memset(layer->w, 0, (size_t)rows * SF_LANES);
  for (int i = 0; i < rows; i++)
    for (int o = 0; o < layer->n_out; o++) layer->w[i * SF_LANES + o] = draw_weight(r, kind, i, o);
}

static inline int32_t draw_leak(random_source *r)
{
  const int64_t kind = draw(r, 0, 9);
  return kind == 0 ? 0 : kind == 1 ? 4096 : kind == 2 ? 1 : kind == 3 ? 4095 : (int32_t)draw(r, 0, 4096);
}

/* Around the currents' own size, so that some neurons fire; sometimes all, sometimes none. */
static inline int32_t draw_theta(random_source *r, int64_t typical)
{
  const int64_t kind = draw(r, 0, 11);
  if (kind == 0) return 1;
  if (kind == 1) return (1 << 23) - 1;
  const int64_t theta = typical * draw(r, 1, 300) / 100;
  return (int32_t)(theta < 1 ? 1 : theta > (1 << 23) - 1 ? (1 << 23) - 1 : theta);
}

typedef struct random_net {
  fx_net net;
  int8_t weights[SF_LAYERS][((SF_DIR_MAX > SF_LANES ? SF_DIR_MAX : SF_LANES) + 1) * SF_LANES]; /* biases behind */
} random_net;

static inline void net_sizes(fx_net *net, int n_feature, int hidden, int n_h, int n_dir, int hidden2, int hidden3)
{
  const int in[SF_LAYERS] = {n_feature, hidden, n_dir + n_h, hidden2, hidden3};
  const int out[SF_LAYERS] = {hidden, n_h + 1, hidden2, hidden3, 3};
  for (int l = 0; l < SF_LAYERS; l++) net->layer[l].n_in = in[l], net->layer[l].n_out = out[l];
}

static inline void bind_weights(random_net *n)
{
  for (int l = 0; l < SF_LAYERS; l++) n->net.layer[l].w = n->weights[l];
}

/* Of each of C1, C2 and C3 with an even chance; C1's value at its rails more often than chance would. */
static inline void draw_biases(random_source *r, fx_net *net)
{
  const int64_t kind = draw(r, 0, 7);
  net->layer[FX_C1].bias = kind == 0 ? 1 : kind == 1 ? 2047 : kind < 4 ? (int32_t)draw(r, 1, 2047) : 0;
  net->layer[FX_C2].bias = (int32_t)draw(r, 0, 1);
  net->layer[FX_C3].bias = (int32_t)draw(r, 0, 1);
}

static inline void random_net_fill(random_net *n, random_source *r, bool extreme);

/* A decoder: n_in constant inputs. extreme: as random_net_make, its sizes, too, but for n_in. */
static inline void random_decoder_make(random_net *n, random_source *r, int n_in, bool extreme)
{
  memset(n, 0, sizeof *n);
  bind_weights(n);
  fx_layer *l = n->net.layer;
  l[FX_C1].n_in = n_in;
  l[FX_C1].n_out = l[FX_C2].n_in = extreme && draw(r, 0, 1) ? (int)draw(r, 1, SF_LANES) : SF_LANES;
  l[FX_C2].n_out = l[FX_C3].n_in = extreme && draw(r, 0, 1) ? (int)draw(r, 1, SF_LANES) : SF_LANES;
  l[FX_C3].n_out = 3;
  if (extreme)
    draw_biases(r, &n->net);
  else
    l[FX_C1].bias = 1000, l[FX_C2].bias = l[FX_C3].bias = 1;
  random_net_fill(n, r, extreme);
}

/* extreme: weights, leaks and thresholds from the corners too; else a net that behaves like a trained one. */
static inline void random_net_make(random_net *n, random_source *r, bool extreme)
{
  memset(n, 0, sizeof *n);
  bind_weights(n);
  fx_net *net = &n->net;
  const bool full = draw(r, 0, 2) == 0 || !extreme;
  const int n_h = full ? 15 : (int)draw(r, 0, 15);
  net_sizes(net, full ? 32 : 2 * (int)draw(r, 1, 16), full ? SF_LANES : (int)draw(r, 1, SF_LANES), n_h,
            full ? 16 : (int)draw(r, n_h ? 0 : 1, 16), full ? SF_LANES : (int)draw(r, 1, SF_LANES),
            full ? SF_LANES : (int)draw(r, 1, SF_LANES));
  if (extreme) draw_biases(r, net);
  random_net_fill(n, r, extreme);
}

/* Thresholds of radix end earlier. */
static inline void random_net_limit(fx_net *net)
{
  const int32_t highest = (1 << 22) - 1;
  for (int l = 0; net->mode == FX_RADIX && l < SF_LAYERS; l++)
    if (net->layer[l].theta > highest) net->layer[l].theta = highest;
}

/* Weights and all else but the sizes. Thresholds go with the width of the currents' sum. */
static inline void random_net_fill(random_net *n, random_source *r, bool extreme)
{
  fx_net *net = &n->net;
  const int64_t wide = net->layer[FX_C1].n_in > 32 ? 2 : 1;
  const int64_t typical[SF_LAYERS] = {fx_net_decodes(net) ? 0 : 300000, 0, wide * 200000, 100000, 0};
  for (int l = 0; l < SF_LAYERS; l++) {
    fx_layer *layer = &net->layer[l];
    draw_weights(r, layer, extreme && draw(r, 0, 1) ? (int)draw(r, 0, 6) : 0);
    layer->k = extreme ? draw_leak(r) : (int32_t)draw(r, 1000, 3000);
    if (typical[l]) layer->theta = extreme ? draw_theta(r, typical[l]) : (int32_t)typical[l];
  }
  net->mode = extreme ? (int32_t)draw(r, FX_HYBRID, FX_RADIX) : FX_HYBRID;
  random_net_limit(net);
  net->steps = extreme ? (int32_t)draw(r, 1, SF_T_MAX) : 3;
  net->exp_in =
      (fx_scale){(int32_t)draw(r, 0, 65535), (int32_t)draw(r, extreme ? 0 : 8, 16), (int32_t)draw(r, -20000, 20000)};
  net->sigmoid_in = (fx_scale){(int32_t)draw(r, 0, 65535), (int32_t)draw(r, extreme ? 0 : 8, 16), 0};
}

/* kind 0 uniform, 1 upper rail, 2 lower rail, 3 zero */
static inline void draw_values(random_source *r, int16_t *value, int n, bool extreme)
{
  const int64_t kind = extreme ? draw(r, 0, 7) : 7;
  for (int i = 0; i < n; i++)
    value[i] = kind == 1 ? 2047 : kind == 2 ? -2047 : kind == 3 ? 0 : (int16_t)draw(r, -2047, 2047);
}
#endif
