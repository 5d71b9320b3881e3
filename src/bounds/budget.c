/* Error budget of the units: every block of the core against double precision, each error over its derived bound.
 * The derivations are in docs/fixed-point.md, row by row. */
#include "quant/quant.h"
#include "base/rng.h"
#include "bounds/exact.h"
#include "src/fx/unit.h"
#include <math.h>
#include <string.h>

static void add(sf_budget_row *row, double error, double bound)
{
  const double size = fabs(error), ratio = size == 0 ? 0 : size / bound;
  if (row->inputs == 0 || size > row->measured) row->measured = size, row->bound = bound;
  row->ratio = fmax(row->ratio, ratio);
  row->inputs++;
}

static int64_t pick(uint64_t stream, uint64_t index, int64_t low, int64_t high)
{
  return low + (int64_t)sf_random_below(20, stream, index, (uint64_t)(high - low + 1));
}

static double uniform(uint64_t stream, uint64_t index)
{
  return 2 * (double)sf_random_float(20, stream, index) - 1;
}

/* ---- rays ---- */

typedef struct real_ray {
  double origin[3], direction[3], first, step; /* box units; distances in model units */
} real_ray;

/* The lattice in real numbers, clipped to the box behind the near plane. */
static real_ray clip(const float o[3], const float d[3], double step)
{
  const double length = sqrt((double)d[0] * d[0] + (double)d[1] * d[1] + (double)d[2] * d[2]);
  real_ray r = {.step = step, .first = 0.2};
  for (int a = 0; a < 3; a++) {
    r.origin[a] = o[a] * 0.5 + 0.5, r.direction[a] = d[a] / length * 0.5;
    r.first = fmax(r.first, fmin(-r.origin[a] / r.direction[a], (1 - r.origin[a]) / r.direction[a]));
  }
  r.first += step / 2;
  return r;
}

/* ideal: against the lattice whose step is not rounded to Q0.24. */
static void ray(sf_budget_row *row, uint64_t i, bool ideal)
{
  const int lattice = i % 2 ? 1024 : (int)pick(1, i, 16, 1024);
  fx_scene scene = {.units.to_box_scale = 0.5, .units.to_box_offset = {0.5, 0.5, 0.5}, .units.dir_scale = 0x1p-10};
  const double step = sqrt(3.0) / lattice; /* box units */
  scene.step_q24 = (int32_t)nearbyint(ldexp(step, SF_DELTA_FRAC));
  float o[3], d[3];
  for (uint64_t a = 0; a < 3; a++) {
    o[a] = (float)(3 * uniform(2 + a, i));
    d[a] = (float)uniform(5 + a, i) - o[a];
  }
  fx_ray fixed;
  if (sf_fx_ray_make(&scene, o, d, &fixed).code != SF_OK || fixed.count == 0) return;
  const real_ray real = clip(o, d, 2 * (ideal ? step : ldexp(scene.step_q24, -SF_DELTA_FRAC)));
  const double skipped = nearbyint(fixed.first_q16 / 65536.0 - real.first / real.step); /* points cut off in front */
  for (int32_t n = 0; n < fixed.count; n += n < 8 || n >= fixed.count - 8 ? 1 : 7)
    for (int a = 0; a < 3; a++) {
      const int64_t at = (fixed.origin[a] + n * fixed.step[a]) >> 16;
      const double exact = real.origin[a] + real.direction[a] * (real.first + (n + skipped) * real.step);
      const double bound = 1 + (n + 1 + skipped) * 0x1p-17 + 0x1p-10;
      add(row, (double)at - ldexp(exact, SF_POS_FRAC), ideal ? bound + (n + 1 + skipped) / 2 : bound);
    }
}

/* Some rays have no lattice point: the next one instead. */
static void some_rays(sf_budget_row *row, uint64_t samples, bool ideal)
{
  for (uint64_t without = 0; row->inputs < samples;) {
    const uint64_t before = row->inputs;
    ray(row, before + without, ideal);
    without += row->inputs == before;
  }
}

static void rays(sf_budget_row *row, uint64_t samples)
{
  some_rays(row, samples, false);
}

static void rays_ideal(sf_budget_row *row, uint64_t samples)
{
  some_rays(row, samples, true);
}

/* ---- grid ---- */

enum { DENSE_STRIDE = 10, DENSE = DENSE_STRIDE * DENSE_STRIDE * DENSE_STRIDE, HASH_BITS = 9, GRID_SHIFT = 12 };

typedef struct small_grid {
  fx_grid grid;
  int8_t table[DENSE + (1 << HASH_BITS)][FX_GRID_FEATURES];
} small_grid;

/* A dense level whose entries alternate between the rails (the steepest field there is) and a random hashed one. */
static void make_grid(small_grid *g)
{
  g->grid = (fx_grid){.levels = 2,
                      .scale_q16 = {(7 << 16) + 4321, (39 << 16) + 999},
                      .stride = {DENSE_STRIDE, 0},
                      .log2_size = {0, HASH_BITS},
                      .offset = {0, DENSE},
                      .entries = DENSE + (1 << HASH_BITS),
                      .shift = {GRID_SHIFT, GRID_SHIFT},
                      .table = g->table[0]};
  for (int i = 0; i < DENSE + (1 << HASH_BITS); i++) {
    const int odd = (i + i / DENSE_STRIDE + i / DENSE_STRIDE / DENSE_STRIDE) & 1;
    g->table[i][0] = i < DENSE ? (odd ? -127 : 127) : (int8_t)pick(10, (uint64_t)i, -127, 127);
    g->table[i][1] = (int8_t)pick(11, (uint64_t)i, -127, 127);
  }
}

/* Trilinear interpolation in real numbers, in units of an entry. */
static double real_feature(const fx_grid *g, int level, const uint32_t pos[3], int which)
{
  double sum = 0, part[3];
  uint32_t base[3];
  for (int a = 0; a < 3; a++) {
    const double p = ldexp(pos[a], -SF_POS_FRAC) * ldexp(g->scale_q16[level], -16) + 0.5;
    base[a] = (uint32_t)floor(p), part[a] = p - base[a];
  }
  for (uint32_t corner = 0; corner < 8; corner++) {
    double w = 1;
    for (int a = 0; a < 3; a++) w *= corner >> a & 1 ? part[a] : 1 - part[a];
    sum += w * g->table[sf_exact_entry(g, level, base, corner) * FX_GRID_FEATURES + which];
  }
  return sum;
}

/* Anywhere, at the ends of the box, or just before 1/512 behind a grid point on every axis: the largest rounding where
 * the field is steepest. */
static uint32_t grid_position(const fx_grid *g, uint64_t i, uint64_t axis)
{
  const uint32_t last = (1 << SF_POS_FRAC) - 1;
  if (i % 3 == 0) return (uint32_t)pick(12 + axis, i, 0, last);
  if (i % 3 == 1 && i % 11 == axis) return i & 8 ? 0 : last;
  const int level = (int)(i >> 4 & 1), scale = g->scale_q16[level];
  const double point = (double)pick(12 + axis, i, 1, (scale >> 16) - 1);
  return (uint32_t)floor(ldexp((point - 0.5 + 1.0 / 512) / ldexp(scale, -16), SF_POS_FRAC));
}

static void grid(sf_budget_row *row, uint64_t samples)
{
  small_grid g = {0};
  const double bound = 254 * 3 / 512.0 + 4 * 0.5 * 254 / 65536 + ldexp(0.5, GRID_SHIFT - 16);
  make_grid(&g);
  for (uint64_t i = 0; row->inputs < samples; i++) {
    uint32_t pos[3];
    int16_t f[4];
    for (uint64_t a = 0; a < 3; a++) pos[a] = grid_position(&g.grid, i, a);
    fx_grid_features(&g.grid, pos, f, NULL);
    for (int n = 0; n < 4; n++)
      add(row, ldexp(f[n], GRID_SHIFT - 16) - real_feature(&g.grid, n / 2, pos, n % 2), bound);
  }
}

/* A constant field: corner weights sum to 65536 exactly, so that only the last rounding is left. */
static void feature(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  small_grid g = {0};
  make_grid(&g);
  for (int value = -127; value <= 127; value++)
    for (int shift = 5; shift < 32; shift++) {
      const double exact = ldexp(value, 16 - shift);
      const uint32_t pos[3] = {(uint32_t)value * 65521u & 0xffffff, 12345678, (uint32_t)shift << 18};
      int16_t f[4];
      if (fabs(exact) > FX_INPUT_MAX) continue;
      memset(g.table, value, sizeof g.table);
      g.grid.shift[0] = g.grid.shift[1] = shift;
      fx_grid_features(&g.grid, pos, f, NULL);
      add(row, f[0] - exact, 0.5);
    }
}

/* ---- direction ---- */

/* coefficient * u * q with q = one + the sum of products of two axes, as fx/sh.c has it. */
typedef struct harmonic {
  double coefficient;
  int u; /* axis; 3: none */
  double one, xx, yy, zz, xy, yz, xz;
} harmonic;

static const harmonic harmonics[FX_SH] = {
    {.coefficient = 0.28209479177387814, .u = 3, .one = 1},
    {.coefficient = 0.48860251190291987, .u = 1, .one = 1},
    {.coefficient = 0.48860251190291987, .u = 2, .one = 1},
    {.coefficient = 0.48860251190291987, .u = 0, .one = 1},
    {.coefficient = 1.0925484305920792, .u = 3, .xy = 1},
    {.coefficient = 1.0925484305920792, .u = 3, .yz = 1},
    {.coefficient = 0.31539156525251999, .u = 3, .one = -1, .zz = 3},
    {.coefficient = 1.0925484305920792, .u = 3, .xz = 1},
    {.coefficient = 0.54627421529603959, .u = 3, .xx = 1, .yy = -1},
    {.coefficient = 0.59004358992664352, .u = 1, .yy = 1, .xx = -3},
    {.coefficient = 1.4453057213202769, .u = 2, .xy = 2},
    {.coefficient = 0.45704579946446572, .u = 1, .one = 1, .zz = -5},
    {.coefficient = 0.3731763325901154, .u = 2, .one = -3, .zz = 5},
    {.coefficient = 0.45704579946446572, .u = 0, .one = 1, .zz = -5},
    {.coefficient = 1.4453057213202769, .u = 2, .xx = 1, .yy = -1},
    {.coefficient = 0.59004358992664352, .u = 0, .xx = 1, .yy = -3},
};

/* In real units, without the last rounding: axes off by 2^-15, products by 2^-16, coefficient and a by 2^-17. */
static double direction_bound(const harmonic *h, const double v[3])
{
  const double x = v[0], y = v[1], z = v[2], u = h->u < 3 ? v[h->u] : 1;
  const double q =
      h->one + h->xx * x * x + h->yy * y * y + h->zz * z * z + h->xy * x * y + h->yz * y * z + h->xz * x * z;
  double slope[3] = {u * (2 * h->xx * x + h->xy * y + h->xz * z), u * (2 * h->yy * y + h->xy * x + h->yz * z),
                     u * (2 * h->zz * z + h->yz * y + h->xz * x)};
  if (h->u < 3) slope[h->u] += q;
  const double products = fabs(h->xx) + fabs(h->yy) + fabs(h->zz) + fabs(h->xy) + fabs(h->yz) + fabs(h->xz),
               second_order = 0x1p-26;
  return h->coefficient *
             ((fabs(slope[0]) + fabs(slope[1]) + fabs(slope[2])) * 0x1p-15 + fabs(u) * products * 0x1p-16) +
         fabs(q) * (fabs(u) + 1) * 0x1p-17 + second_order;
}

/* At the finest LSB; towards the poles and the diagonals too, where harmonics are steepest. */
static void direction(sf_budget_row *row, uint64_t samples)
{
  const double float_error = 0x1p-10; /* of sf_sh4, in LSB */
  for (uint64_t i = 0; row->inputs < samples; i++) {
    double v[3], length = 0;
    for (uint64_t a = 0; a < 3; a++) {
      v[a] = uniform(60 + a, i) * (i % 4 == 1 + a ? 1 : i % 4 ? 0.01 : 1) + (i % 16 == 4);
      length += v[a] * v[a];
    }
    if (length < 1e-6) continue;
    int16_t unit[3], fixed[FX_SH];
    float real[FX_SH];
    for (int a = 0; a < 3; a++) {
      v[a] /= sqrt(length);
      unit[a] = (int16_t)lrint(ldexp(v[a], FX_UNIT_FRAC));
    }
    sf_sh4((const float[]){(float)v[0], (float)v[1], (float)v[2]}, real);
    fx_sh(unit, FX_DIR_FRAC_MAX, fixed);
    for (int n = 0; n < FX_SH; n++)
      add(row, fixed[n] - ldexp((double)real[n], FX_DIR_FRAC_MAX),
          0.5 + ldexp(direction_bound(&harmonics[n], v), FX_DIR_FRAC_MAX) + float_error);
  }
}

/* ---- nets ---- */

typedef struct small_net {
  fx_net net;
  int8_t w[SF_LAYERS][SF_LANES * SF_LANES];
} small_net;

/* theta about the size of the currents, so that a part fires; i counts weights at the rails too. */
static void make_net(small_net *n, uint64_t i)
{
  static const int32_t in[SF_LAYERS] = {32, SF_LANES, 31, SF_LANES, SF_LANES};
  static const int32_t out[SF_LAYERS] = {SF_LANES, 16, SF_LANES, SF_LANES, 3};
  static const int32_t theta[SF_LAYERS] = {300000, 0, 200000, 60000, 0};
  const int64_t limit = i % 4 == 3 ? 126 : 1;
  memset(n, 0, sizeof *n);
  for (int l = 0; l < SF_LAYERS; l++) {
    n->net.layer[l] =
        (fx_layer){in[l], out[l], (int32_t)pick(30, i * 8 + (uint64_t)l, 0, FX_LEAK_ONE), theta[l], 0, n->w[l]};
    for (int r = 0; r < in[l]; r++)
      for (int o = 0; o < out[l]; o++) {
        const int64_t any = pick(31 + (uint64_t)l, i << 14 | (uint64_t)(r * SF_LANES + o), -127, 127);
        n->w[l][r * SF_LANES + o] = (int8_t)(limit > 1 ? (any < 0 ? -127 : 127) : any);
      }
  }
  n->net.steps = SF_T_MAX;
  n->net.mode = (int32_t)(i % 3);
  n->net.exp_in = n->net.sigmoid_in = (fx_scale){40000, 14, 0};
}

/* The sums that the layers hand on, against sums in double (exact to 2^53) over the spikes that fell. */
static void check_currents(sf_budget_row *row, const fx_net *net, const int16_t *f, const int16_t *dir,
                           const fx_trace *trace)
{
  for (int t = 0; t < net->steps; t++)
    for (int l = 0; l < SF_LAYERS; l++) {
      const fx_layer *layer = &net->layer[l];
      const int before = l == FX_D2 ? FX_D1 : l - 1;
      for (int o = 0; o < layer->n_out; o++) {
        double sum = 0;
        for (int i = 0; i < layer->n_in; i++) {
          const int h = i - FX_SH;
          const double x = l == FX_D1   ? f[i]
                           : l != FX_C1 ? (double)(trace->spikes[before][t][i / 64] >> i % 64 & 1)
                           : h < 0      ? dir[i]
                                        : floor(ldexp(trace->current[FX_D2][t][1 + h], -SF_H_SHIFT));
          sum += x * layer->w[i * SF_LANES + o];
        }
        add(row, trace->current[l][t][o] - sum, 0x1p-1022); /* none is allowed: any error is over its bound */
      }
    }
}

static void currents(sf_budget_row *row, uint64_t samples)
{
  small_net n;
  fx_trace trace;
  for (uint64_t i = 0; row->inputs < samples; i++) {
    int16_t f[SF_FEATURE_MAX], dir[FX_SH];
    int32_t base[SF_LANES];
    fx_out out;
    make_net(&n, i);
    for (uint64_t j = 0; j < SF_FEATURE_MAX; j++)
      f[j] = (int16_t)(i % 5 ? pick(40, i << 6 | j, -FX_INPUT_MAX, FX_INPUT_MAX) : FX_INPUT_MAX);
    for (uint64_t j = 0; j < FX_SH; j++) dir[j] = (int16_t)pick(41, i << 6 | j, -FX_INPUT_MAX, FX_INPUT_MAX);
    fx_net_direction(&n.net, dir, base, NULL);
    fx_net_sample(&n.net, f, base, &out, &trace, NULL);
    check_currents(row, &n.net, f, dir, &trace);
  }
  row->bound = 0;
}

/* Every current of D2 (all spikes but one of weight 127 and one of the rest), seen through C1 with a weight of 1. */
static void h_floor(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  small_net n;
  fx_trace trace;
  const int16_t f[SF_FEATURE_MAX] = {1}, dir[FX_SH] = {0};
  int32_t base[SF_LANES];
  fx_out out;
  make_net(&n, 0);
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
    add(row, trace.current[FX_C1][0][0] - ldexp(current, -SF_H_SHIFT), 1 - ldexp(1, -SF_H_SHIFT));
  }
}

/* ---- membranes and integrators ---- */

/* The product's high part is exact: d and d + 4096 round alike, so 4096 differences times 4097 leaks are all. */
static void charge(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (int32_t k = 0; k <= FX_LEAK_ONE; k++)
    for (int32_t d = -2048; d < 2048; d++)
      add(row, fx_plif_step(0, d, k, FX_MEMBRANE_MAX, FX_DECAY, false).membrane - d * (double)k / FX_LEAK_ONE, 0.5);
}

static void integrate_density(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  uint64_t saturated = 0;
  for (int32_t k = 0; k <= FX_LEAK_ONE; k++)
    for (uint32_t e = 0; e < 4096; e++)
      add(row, fx_integrate_density(0, e, k, FX_DECAY, false, &saturated) - e * (double)k / FX_LEAK_ONE, 0.5);
}

static void integrate_colour(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  uint64_t saturated = 0;
  for (int32_t k = 0; k <= FX_LEAK_ONE; k++)
    for (uint32_t s = 0; s < 4096; s++)
      add(row, fx_integrate_colour(0, s, k, FX_DECAY, false, &saturated) - s * (double)k / FX_LEAK_ONE, 0.5);
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
  return i % 4 == 0 ? 1 : (int32_t)pick(50, i, 0, i % 4 == 1 ? 64 : FX_LEAK_ONE);
}

static void membranes(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const int mode = (int)(i / 4 % 3);
    const int32_t k = hard_leak(i), theta = i % 4 == 0 ? 2055 : (int32_t)pick(51, i, 1, 500000);
    const int32_t constant = i % 8 == 0 ? 2056 : (int32_t)pick(52, i, -1000000, 1000000);
    int32_t v = 0;
    double real = 0, bound = 0;
    for (int t = 0; t < SF_T_MAX; t++) {
      const int32_t in = i & 16 ? (int32_t)pick(53, i * 8 + (uint64_t)t, -1000000, 1000000) : constant;
      const fx_plif step = fx_plif_step(v, in, k, theta, mode, t == 0);
      real = real_charge(real, in, (double)k / FX_LEAK_ONE, mode, t);
      bound = error_after(bound, (double)k / FX_LEAK_ONE, mode, t);
      if (step.saturated) break;
      if (bound > 0) add(row, step.membrane - real, bound);
      real -= step.spike ? theta : 0; /* the spike that fell: flips are the picture's matter */
      v = step.v;
    }
  }
}

static void integrators(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const bool colour = i & 1;
    const int mode = (int)(i / 4 % 3);
    const int32_t k = hard_leak(i / 2);
    const int64_t limit = colour ? 65535 : (1 << 24) - 1;
    uint32_t acc = 0;
    double real = 0, bound = 0;
    for (int t = 0; t < SF_T_MAX; t++) {
      const uint32_t in = i % 8 < 2 ? 2056 : (uint32_t)pick(54, i * 8 + (uint64_t)t, 0, limit);
      uint64_t saturated = 0;
      acc = (colour ? fx_integrate_colour : fx_integrate_density)(acc, in, k, mode, t == 0, &saturated);
      real = real_charge(real, in, (double)k / FX_LEAK_ONE, mode, t);
      bound = error_after(bound, (double)k / FX_LEAK_ONE, mode, t);
      if (saturated) break;
      if (bound > 0) add(row, acc - real, bound);
    }
  }
}

/* ---- tables ---- */

static void argument(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const fx_scale scale = {(int32_t)pick(60, i, 0, 65535), (int32_t)pick(61, i, 0, 31), 0};
    for (int32_t c = -SF_LANES * 127; c <= SF_LANES * 127; c += 1 + (int32_t)(i % 64)) {
      const double exact = ldexp((double)c * scale.mul, -scale.shift);
      if (fabs(exact) < 32767) add(row, fx_sigmoid_argument(c, &scale) - exact, 0.5);
      if (fabs(exact) < 131071) add(row, fx_exp2_argument(c, &scale) - exact, 0.5);
    }
  }
}

static const double EXP2_RELATIVE = 9.77e-7;

static void exp2_all(sf_budget_row *row, uint64_t samples, bool high)
{
  (void)samples;
  for (int32_t y = -(1 << (FX_EXP2_BITS - 1)); y < 16 << SF_LOG_FRAC; y++) {
    const double exact = ldexp(exp2(ldexp(y, -SF_LOG_FRAC)), SF_SIGMA_FRAC), error = fx_exp2(y) - exact;
    if ((exact >= 0x1p20) != high) continue;
    const double bound = 0.5 + EXP2_RELATIVE * exact, unit = high ? exact * 1e-6 : 1;
    add(row, error / unit, bound / unit);
  }
}

static void exp2_low(sf_budget_row *row, uint64_t samples)
{
  exp2_all(row, samples, false);
}

static void exp2_high(sf_budget_row *row, uint64_t samples)
{
  exp2_all(row, samples, true);
}

static void sigmoid(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (int32_t x = -(1 << (FX_SIGMOID_BITS - 1)); x < 1 << (FX_SIGMOID_BITS - 1); x++)
    add(row, fx_sigmoid(x) - 65536 / (1 + exp(-ldexp(x, -SF_LOG_FRAC))), 1.78);
}

static const double EXP_NEG_BOUND = 1.85;

static void exp_neg(sf_budget_row *row, uint64_t samples)
{
  (void)samples;
  for (uint32_t tau = 0; tau <= 32u << SF_TRANS_FRAC; tau++)
    add(row, fx_exp_neg(tau) - FX_TRANS_ONE * exp(-ldexp(tau, -SF_TRANS_FRAC)), EXP_NEG_BOUND);
}

/* ---- compositing ---- */

static void alpha(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; row->inputs < samples; i++) {
    const fx_out out = {.sigma = (uint32_t)pick(70, i, 0, ((int64_t)1 << pick(71, i, 1, SF_SIGMA_BITS)) - 1)};
    const int32_t delta = (int32_t)pick(72, i, 1, (int64_t)1 << pick(73, i, 1, SF_DELTA_FRAC));
    fx_pixel pixel;
    fx_composite_begin(&pixel);
    fx_composite_add(&pixel, &out, delta, 0);
    const double tau = ldexp(out.sigma, -SF_SIGMA_FRAC) * ldexp(delta, -SF_DELTA_FRAC);
    add(row, pixel.weight_sum + FX_TRANS_ONE * expm1(-tau), EXP_NEG_BOUND + 0.5);
  }
}

/* One ray of up to 1024 samples; half of them thin and uniform, where errors of one sign add up. `bound` of the
 * transmittance runs along: e' = a e + (T + e) (1.85 + 0.5) + 0.5; of the colour it is sum e |c - c before|. */
static void composite(sf_budget_row *row, uint64_t i, bool colour)
{
  const bool thin = i & 1;
  const int n = thin ? 1024 : (int)pick(80, i, 1, 300), bits = (int)pick(81, i, 4, SF_SIGMA_BITS);
  const int32_t delta = (int32_t)pick(82, i, 1, 1 << 18), white[3] = {65536, 65536, 65536};
  double trans = 1, sum = 0, e = 0, sum_bound = 0, before = 0;
  fx_out out = {.sigma = (uint32_t)pick(83, i, 0, ((int64_t)1 << bits) - 1)};
  fx_pixel pixel;
  fx_composite_begin(&pixel);
  for (int s = 0; s < n; s++) {
    const uint64_t at = i << 10 | (uint64_t)s;
    if (!thin) out.sigma = (uint32_t)pick(84, at, 0, ((int64_t)1 << bits) - 1);
    if (thin) out.sigma = (uint32_t)(ldexp((double)pick(85, i, 1, 4000), 16 - 2) / delta); /* tau below 4000 LSB */
    out.colour[0] = thin ? (s < n / 2 ? 65535 : 0) : (uint32_t)pick(86, at, 0, 65535);
    fx_composite_add(&pixel, &out, delta, 0);
    const double a = exp(-ldexp(out.sigma, -SF_SIGMA_FRAC) * ldexp(delta, -SF_DELTA_FRAC));
    const double c = ldexp(out.colour[0], -SF_COLOUR_FRAC);
    if (s > 0) sum_bound += e * fabs(c - before);
    e = a * e + (trans + ldexp(e, -SF_TRANS_FRAC)) * (EXP_NEG_BOUND + 0.5) + 0.5;
    sum += trans * (1 - a) * c, trans *= a, before = c;
  }
  fx_composite_end(&pixel, white);
  sum_bound += e * fabs(1 - before);
  if (colour)
    add(row, ldexp((double)pixel.colour[0], -SF_TRANS_FRAC) - 65536 * (sum + trans), sum_bound / 16);
  else
    add(row, pixel.transmittance - FX_TRANS_ONE * trans, e);
}

static void transmittance(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; i < samples / 64 + 1; i++) composite(row, i, false);
}

static void pixel(sf_budget_row *row, uint64_t samples)
{
  for (uint64_t i = 0; i < samples / 64 + 1; i++) composite(row, i, true);
}

/* ---- the table ---- */

/* clang-format off */
static const struct block {
  const char *name, *unit, *bites;
  bool exhaustive;
  void (*measure)(sf_budget_row *row, uint64_t samples);
} blocks[SF_BUDGET_BLOCKS] = {
    [SF_BUDGET_RAY] = {"ray: sample position", "LSB of Q0.24", "far below a grid cell: nowhere", false, rays},
    [SF_BUDGET_STEP] = {"ray: with its step rounded", "LSB of Q0.24", "end of long rays: DELTA_FRAC", false, rays_ideal},
    [SF_BUDGET_GRID] = {"grid: interpolation", "LSB of an entry", "edges between cells of fine levels", false, grid},
    [SF_BUDGET_FEATURE] = {"grid: feature f", "LSB of int12", "spikes of D1: INPUT_BITS", true, feature},
    [SF_BUDGET_DIRECTION] = {"direction features", "LSB of 2^-11", "spikes of C1, once per ray", false, direction},
    [SF_BUDGET_CURRENT] = {"currents, all layers: sums", "LSB of a current", "exact", false, currents},
    [SF_BUDGET_H] = {"h = i >> 3", "LSB of h", "spikes of C1: H_SHIFT", true, h_floor},
    [SF_BUDGET_CHARGE] = {"membrane: one leak product", "LSB of s24", "spikes at the threshold", true, charge},
    [SF_BUDGET_MEMBRANE] = {"membrane: after 8 steps", "LSB of s24", "C2, whose current has AC_FRAC bits", false, membranes},
    [SF_BUDGET_ARGUMENT] = {"argument of the tables", "LSB of Q.12", "relative error of density: LOG_FRAC", false, argument},
    [SF_BUDGET_EXP2] = {"2^y below 256", "LSB of U16.12", "thin media: SIGMA_FRAC", true, exp2_low},
    [SF_BUDGET_EXP2_HIGH] = {"2^y from 256 on", "1e-6 of the value", "surfaces: opaque anyway", true, exp2_high},
    [SF_BUDGET_SIGMOID] = {"sigmoid", "LSB of Q0.16", "colour: 1/256 of an 8-bit level per LSB", true, sigmoid},
    [SF_BUDGET_DENSITY] = {"density integrator: one step", "LSB of U16.12", "thin media", true, integrate_density},
    [SF_BUDGET_COLOUR] = {"colour integrator: one step", "LSB of Q4.16", "colour", true, integrate_colour},
    [SF_BUDGET_INTEGRATORS] = {"integrators: after 8 steps", "LSB of either", "thin media, colour", false, integrators},
    [SF_BUDGET_EXP_NEG] = {"exp(-x)", "LSB of Q.20", "thin media on long rays: TRANS_FRAC", true, exp_neg},
    [SF_BUDGET_ALPHA] = {"alpha of one sample", "LSB of Q.20", "thin media on long rays: TRANS_FRAC", false, alpha},
    [SF_BUDGET_TRANSMITTANCE] = {"transmittance of a ray", "LSB of Q.20", "errors of one sign in uniform fog", false, transmittance},
    [SF_BUDGET_PIXEL] = {"pixel, density and colour given", "LSB of Q0.16", "fog with a change of colour", false, pixel},
};
/* clang-format on */

sf_budget_row sf_budget_measure(sf_budget_id id, uint64_t samples)
{
  const struct block *b = &blocks[id];
  sf_budget_row row = {.block = b->name, .unit = b->unit, .bites = b->bites, .exhaustive = b->exhaustive};
  b->measure(&row, samples);
  return row;
}
