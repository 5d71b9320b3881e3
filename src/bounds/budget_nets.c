/* Error budget: currents, membranes and integrators. Derivations: docs/fixed-point.md. */
#include "quant/quant.h"
#include "bounds/budget_blocks.h"
#include "src/fx/unit.h"
#include <string.h>

/* ---- nets ---- */

enum { ROWS = (SF_DIR_MAX > SF_LANES ? SF_DIR_MAX : SF_LANES) + 1 /* the bias */ };

typedef struct small_net {
  fx_net net;
  int8_t w[SF_LAYERS][ROWS * SF_LANES];
} small_net;

/* theta about the size of the currents, so that a part fires; i counts weights at the rails too. */
static void make_net(small_net *n, uint64_t i, bool decoder)
{
  const int32_t in[SF_LAYERS] = {32, SF_LANES, decoder ? SF_DIR_MAX : 31, SF_LANES, SF_LANES};
  const int32_t out[SF_LAYERS] = {SF_LANES, 16, SF_LANES, SF_LANES, 3};
  const int32_t bias[SF_LAYERS] = {0, 0, (int32_t)budget_pick(29, i, 1, FX_INPUT_MAX), 1, 1};
  static const int32_t theta[SF_LAYERS] = {300000, 0, 200000, 60000, 0};
  const int64_t limit = i % 4 == 3 ? 126 : 1;
  memset(n, 0, sizeof *n);
  for (int l = decoder ? FX_C1 : FX_D1; l < SF_LAYERS; l++) {
    const int32_t k = (int32_t)budget_pick(30, i * 8 + (uint64_t)l, 0, FX_LEAK_ONE);
    n->net.layer[l] = (fx_layer){in[l], out[l], k, theta[l], decoder ? bias[l] : 0, n->w[l]};
    for (int r = 0; r < fx_layer_rows(&n->net.layer[l]); r++)
      for (int o = 0; o < out[l]; o++) {
        const int64_t any = budget_pick(31 + (uint64_t)l, i << 14 | (uint64_t)(r * SF_LANES + o), -127, 127);
        n->w[l][r * SF_LANES + o] = (int8_t)(limit > 1 ? (any < 0 ? -127 : 127) : any);
      }
  }
  n->net.steps = SF_T_MAX;
  n->net.mode = (int32_t)(i % 3);
  n->net.exp_in = n->net.sigmoid_in = (fx_scale){40000, 14, 0};
}

/* Input i of a layer at step t; the last one is the bias'. */
static double input_of(const fx_net *net, int l, int t, int i, const int16_t *f, const int16_t *dir,
                       const fx_trace *trace)
{
  const int before = l == FX_D2 ? FX_D1 : l - 1, constants = fx_net_constants(net);
  if (i == net->layer[l].n_in) return net->layer[l].bias;
  if (l == FX_D1) return f[i];
  if (l != FX_C1) return (double)(trace->spikes[before][t][i / 64] >> i % 64 & 1);
  if (fx_net_decodes(net)) return f[i];
  return i < constants ? dir[i] : floor(ldexp(trace->current[FX_D2][t][1 + i - constants], -SF_H_SHIFT));
}

/* The sums that the layers hand on, against sums in double (exact to 2^53) over the spikes that fell. No error is
 * allowed; beyond the 24 bits of a membrane C1's is at their end. */
static void check_currents(sf_budget_row *row, const fx_net *net, const int16_t *f, const int16_t *dir,
                           const fx_trace *trace)
{
  for (int t = 0; t < net->steps; t++)
    for (int l = fx_net_first_layer(net); l < SF_LAYERS; l++) {
      const fx_layer *layer = &net->layer[l];
      double sum[SF_LANES] = {0};
      for (int i = 0; i < fx_layer_rows(layer); i++) {
        const double x = input_of(net, l, t, i, f, dir, trace);
        for (int o = 0; o < layer->n_out; o++) sum[o] += x * layer->w[i * SF_LANES + o];
      }
      for (int o = 0; o < layer->n_out; o++)
        budget_add(row, trace->current[l][t][o] - fmin(fmax(sum[o], -FX_MEMBRANE_MAX - 1), FX_MEMBRANE_MAX), 0);
    }
}

static void currents(sf_budget_row *row, uint64_t samples, bool decoder)
{
  small_net n;
  fx_trace trace;
  for (uint64_t i = 0; row->inputs < samples; i++) {
    int16_t f[SF_DIR_MAX], dir[FX_SH];
    int32_t base[SF_LANES];
    fx_out out;
    make_net(&n, i, decoder);
    for (uint64_t j = 0; j < (decoder ? SF_DIR_MAX : SF_FEATURE_MAX); j++)
      f[j] = (int16_t)(i % 5 ? budget_pick(40, i << (decoder ? 8 : 6) | j, -FX_INPUT_MAX, FX_INPUT_MAX) : FX_INPUT_MAX);
    for (uint64_t j = 0; j < FX_SH; j++) dir[j] = (int16_t)budget_pick(41, i << 6 | j, -FX_INPUT_MAX, FX_INPUT_MAX);
    fx_net_next(&n.net, dir, true, f, base, &out, &trace, NULL);
    check_currents(row, &n.net, f, dir, &trace);
  }
}

void sf_budget_currents(sf_budget_row *row, uint64_t samples)
{
  currents(row, samples, false);
}

void sf_budget_decoder_currents(sf_budget_row *row, uint64_t samples)
{
  currents(row, samples, true);
}

/* Every current of D2 (all spikes but one of weight 127 and one of the rest), seen through C1 with a weight of 1. */
void sf_budget_h_floor(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  small_net n;
  fx_trace trace;
  const int16_t f[SF_FEATURE_MAX] = {1}, dir[FX_SH] = {0};
  int32_t base[SF_LANES];
  fx_out out;
  make_net(&n, 0, false);
  memset(n.w, 0, sizeof n.w);
  n.net.steps = 1, n.net.mode = FX_HYBRID;
  n.net.layer[FX_D1].theta = 1;
  memset(n.w[FX_D1], 1, SF_LANES);
  n.w[FX_C1][FX_SH * SF_LANES] = 1;
  fx_net_direction(&n.net, dir, base, NULL);
  for (int32_t current = -SF_LANES * 127; current <= SF_LANES * 127; current++) {
    int32_t rest = current;
    for (int i = 0; i < SF_LANES; i++) {
      const int32_t w = rest > 127 ? 127 : rest < -127 ? -127 : rest;
      n.w[FX_D2][i * SF_LANES + 1] = (int8_t)w, rest -= w;
    }
    fx_net_sample(&n.net, f, base, &out, &trace, NULL);
    budget_add(row, trace.current[FX_C1][0][0] - ldexp(current, -SF_H_SHIFT), 1 - ldexp(1, -SF_H_SHIFT));
  }
}

/* ---- membranes and integrators ---- */

/* The product's high part is exact: d and d + 4096 round alike, so 4096 differences times 4097 leaks are all. */
void sf_budget_charge(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (int32_t k = 0; k <= FX_LEAK_ONE; k++)
    for (int32_t d = -2048; d < 2048; d++)
      budget_add(row, fx_plif_step(0, d, k, FX_MEMBRANE_MAX, FX_DECAY, false).membrane - d * (double)k / FX_LEAK_ONE,
                 0.5);
}

void sf_budget_integrate_density(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  uint64_t saturated = 0;
  for (int32_t k = 0; k <= FX_LEAK_ONE; k++)
    for (uint32_t e = 0; e < 4096; e++)
      budget_add(row, fx_integrate_density(0, e, k, FX_DECAY, false, &saturated) - e * (double)k / FX_LEAK_ONE, 0.5);
}

void sf_budget_integrate_colour(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  uint64_t saturated = 0;
  for (int32_t k = 0; k <= FX_LEAK_ONE; k++)
    for (uint32_t s = 0; s < 4096; s++)
      budget_add(row, fx_integrate_colour(0, s, k, FX_DECAY, false, &saturated) - s * (double)k / FX_LEAK_ONE, 0.5);
}

static double real_charge(double v, double in, double k, int mode, int t)
{
  if (t == 0 && mode == FX_HYBRID) return in;
  const double old = t == 0 ? 0 : v;
  return mode == FX_NODECAY ? old - old * k + in : old + (in - old) * k;
}

/* e' <= (1 - k) e + 1/2, with no rounding where the step is exact. */
static double error_after(double before, double k, int mode, int t)
{
  const bool exact = t == 0 && mode != FX_DECAY;
  return (1 - k) * before + (exact ? 0 : 0.5);
}

/* A leak of one LSB and a difference that stays just above half of it rounds up at every step. */
static int32_t hard_leak(uint64_t i)
{
  return i % 4 == 0 ? 1 : (int32_t)budget_pick(50, i, 0, i % 4 == 1 ? 64 : FX_LEAK_ONE);
}

void sf_budget_membranes(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const int mode = (int)(i / 4 % 3);
    const int32_t k = hard_leak(i), theta = i % 4 == 0 ? 2055 : (int32_t)budget_pick(51, i, 1, 500000);
    const int32_t constant = i % 8 == 0 ? 2056 : (int32_t)budget_pick(52, i, -1000000, 1000000);
    int32_t v = 0;
    double real = 0, bound = 0;
    for (int t = 0; t < SF_T_MAX; t++) {
      const int32_t in = i & 16 ? (int32_t)budget_pick(53, i * 8 + (uint64_t)t, -1000000, 1000000) : constant;
      const fx_plif step = fx_plif_step(v, in, k, theta, mode, t == 0);
      real = real_charge(real, in, (double)k / FX_LEAK_ONE, mode, t);
      bound = error_after(bound, (double)k / FX_LEAK_ONE, mode, t);
      if (step.saturated) break;
      if (bound > 0) budget_add(row, step.membrane - real, bound);
      real -= step.spike ? theta : 0; /* the spike that fell: flips are the picture's matter */
      v = step.v;
    }
  }
}

void sf_budget_integrators(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const bool colour = i & 1;
    const int mode = (int)(i / 4 % 3);
    const int32_t k = hard_leak(i / 2);
    const int64_t limit = colour ? 65535 : (1 << 24) - 1;
    uint32_t acc = 0;
    double real = 0, bound = 0;
    for (int t = 0; t < SF_T_MAX; t++) {
      const uint32_t in = i % 8 < 2 ? 2056 : (uint32_t)budget_pick(54, i * 8 + (uint64_t)t, 0, limit);
      uint64_t saturated = 0;
      acc = (colour ? fx_integrate_colour : fx_integrate_density)(acc, in, k, mode, t == 0, &saturated);
      real = real_charge(real, in, (double)k / FX_LEAK_ONE, mode, t);
      bound = error_after(bound, (double)k / FX_LEAK_ONE, mode, t);
      if (saturated) break;
      if (bound > 0) budget_add(row, acc - real, bound);
    }
  }
}
