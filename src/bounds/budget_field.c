/* Error budget: from a ray to features and harmonics. Derivations: docs/fixed-point.md. */
#include "quant/quant.h"
#include "bounds/budget_blocks.h"
#include "bounds/exact_field.h"
#include "src/fx/unit.h"
#include <string.h>

/* ---- rays ---- */

typedef struct real_ray {
  double origin[3], direction[3], first, step; /* box units; distances in model units */
} real_ray;

/* The lattice in real numbers, clipped to the box behind the near plane. */
static real_ray clip(const fx_units *units, double near, const float o[3], const float d[3], double step)
{
  const double length = sqrt((double)d[0] * d[0] + (double)d[1] * d[1] + (double)d[2] * d[2]);
  real_ray r = {.step = step, .first = near};
  for (int a = 0; a < 3; a++) {
    r.origin[a] = (o[a] * 0.5 + 0.5) * units->stretch[a], r.direction[a] = d[a] / length * 0.5 * units->stretch[a];
    r.first = fmax(r.first, fmin(-r.origin[a] / r.direction[a], (1 - r.origin[a]) / r.direction[a]));
  }
  r.first += step / 2;
  return r;
}

/* Every other ray is one of TensoRF: in a box of unequal edges, behind any near plane. */
static fx_scene ray_scene(uint64_t i, double *near)
{
  fx_scene scene = {.units.to_box_scale = 0.5, .units.to_box_offset = {0.5, 0.5, 0.5}, .units.dir_scale = 0x1p-10};
  const bool vm = i >> 1 & 1;
  scene.backbone = vm ? FX_TENSORF : FX_INGP;
  for (uint64_t a = 0; a < 3; a++)
    scene.units.stretch[a] = vm && a != i % 3 ? ldexp((double)budget_pick(8 + a, i, 256, 1024), -8) : 1;
  *near = vm ? ldexp((double)budget_pick(8, i, 0, 512), -8) : 0.2;
  scene.units.near = *near, scene.units.far = 1e3;
  return scene;
}

/* ideal: against the lattice whose step is not rounded to Q0.24. */
static void ray(sf_budget_row *row, uint64_t i, bool ideal)
{
  const int lattice = i % 2 ? 1024 : (int)budget_pick(1, i, 16, 1024);
  const double step = sqrt(3.0) / lattice; /* box units */
  double near;
  fx_scene scene = ray_scene(i, &near);
  scene.step_q24 = (int32_t)nearbyint(ldexp(step, SF_DELTA_FRAC));
  float o[3], d[3];
  for (uint64_t a = 0; a < 3; a++) {
    o[a] = (float)(3 * budget_uniform(2 + a, i));
    d[a] = (float)budget_uniform(5 + a, i) - o[a];
  }
  fx_ray fixed;
  if (sf_fx_ray_make(&scene, o, d, &fixed).code != SF_OK || fixed.count == 0) return;
  const real_ray real = clip(&scene.units, near, o, d, 2 * (ideal ? step : ldexp(scene.step_q24, -SF_DELTA_FRAC)));
  const double skipped = nearbyint(fixed.first_q16 / 65536.0 - real.first / real.step); /* points cut off in front */
  for (int32_t n = 0; n < fixed.count; n += n < 8 || n >= fixed.count - 8 ? 1 : 7)
    for (int a = 0; a < 3; a++) {
      const int64_t at = (fixed.origin[a] + n * fixed.step[a]) >> 16;
      const double exact = real.origin[a] + real.direction[a] * (real.first + (n + skipped) * real.step);
      const double bound = 1 + (n + 1 + skipped) * 0x1p-17 + 0x1p-10;
      const double drift = (n + 1 + skipped) / 2 * scene.units.stretch[a];
      budget_add(row, (double)at - ldexp(exact, SF_POS_FRAC), ideal ? bound + drift : bound);
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

void sf_budget_rays(sf_budget_row *row, uint64_t samples)
{
  some_rays(row, samples, false);
}

void sf_budget_rays_ideal(sf_budget_row *row, uint64_t samples)
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
    g->table[i][0] = i < DENSE ? (odd ? -127 : 127) : (int8_t)budget_pick(10, (uint64_t)i, -127, 127);
    g->table[i][1] = (int8_t)budget_pick(11, (uint64_t)i, -127, 127);
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
  if (i % 3 == 0) return (uint32_t)budget_pick(12 + axis, i, 0, last);
  if (i % 3 == 1 && i % 11 == axis) return i & 8 ? 0 : last;
  const int level = (int)(i >> 4 & 1), scale = g->scale_q16[level];
  const double point = (double)budget_pick(12 + axis, i, 1, (scale >> 16) - 1);
  return (uint32_t)floor(ldexp((point - 0.5 + 1.0 / 512) / ldexp(scale, -16), SF_POS_FRAC));
}

void sf_budget_grid(sf_budget_row *row, uint64_t samples)
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
      budget_add(row, ldexp(f[n], GRID_SHIFT - 16) - real_feature(&g.grid, n / 2, pos, n % 2), bound);
  }
}

/* A constant field: corner weights sum to 65536 exactly, so that only the last rounding is left. */
void sf_budget_feature(sf_budget_row *row, uint64_t samples)
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
      budget_add(row, f[0] - exact, 0.5);
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
void sf_budget_direction(sf_budget_row *row, uint64_t samples)
{
  const double float_error = 0x1p-10; /* of sf_sh4, in LSB */
  for (uint64_t i = 0; row->inputs < samples; i++) {
    double v[3], length = 0;
    for (uint64_t a = 0; a < 3; a++) {
      v[a] = budget_uniform(60 + a, i) * (i % 4 == 1 + a ? 1 : i % 4 ? 0.01 : 1) + (i % 16 == 4);
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
      budget_add(row, fixed[n] - ldexp((double)real[n], FX_DIR_FRAC_MAX),
                 0.5 + ldexp(direction_bound(&harmonics[n], v), FX_DIR_FRAC_MAX) + float_error);
  }
}
