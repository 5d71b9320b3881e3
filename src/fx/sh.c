/* Real spherical harmonics up to degree 3 (16 values), torch-ngp's order and signs: sf_sh4 in integers.
 * Mirror: rtl/sf_sh.sv
 *
 *   u, v     in {1, x, y, z}, Q1.14; axes beyond +-1 are clamped, so no width below can be exceeded by any input
 *   uv     = rshift_round(u * v, 13)                        Q.15
 *   q        a sum of such products (row by row below), |q| <= 4: s18 in Q.15
 *   a      = rshift_round(coefficient * u, 14)              Q.16, |a| < 1.5: s18
 *   dir[i] = sat12(rshift_round(a * q, 31 - frac))          LSB 2^-frac, |a * q| < 2^35
 *
 * Every value is (coefficient * u) * q: two products of one 18 x 18 multiplier. Of a unit vector |dir| < 3/4, so only
 * inputs that are none can saturate. Error bound: docs/fixed-point.md. */
#include "src/fx/round.h"
#include "src/fx/unit.h"
#include "src/fx/nofloat.h"

enum { COEFFICIENT_FRAC = 16, PRODUCT_FRAC = 15 };

typedef enum { AXIS_X, AXIS_Y, AXIS_Z, AXIS_ONE } axis;

typedef struct harmonic {
  int32_t coefficient; /* Q.16 */
  axis u;
} harmonic;

static const harmonic harmonics[FX_SH] = {
    {18487, AXIS_ONE}, {-32021, AXIS_Y},   {32021, AXIS_Z},   {-32021, AXIS_X}, {71601, AXIS_ONE}, {-71601, AXIS_ONE},
    {20670, AXIS_ONE}, {-71601, AXIS_ONE}, {35801, AXIS_ONE}, {38669, AXIS_Y},  {94720, AXIS_Z},   {29953, AXIS_Y},
    {24456, AXIS_Z},   {29953, AXIS_X},    {94720, AXIS_Z},   {-38669, AXIS_X},
};

static int32_t product(int32_t u, int32_t v)
{
  return (int32_t)fx_rshift_round((int64_t)u * v, 2 * FX_UNIT_FRAC - PRODUCT_FRAC);
}

/* The factors q of all harmonics. */
static void factors(const int32_t v[3], int32_t q[FX_SH])
{
  const int32_t one = 1 << PRODUCT_FRAC, x = v[0], y = v[1], z = v[2];
  const int32_t xx = product(x, x), yy = product(y, y), zz = product(z, z);
  const int32_t xy = product(x, y), yz = product(y, z), xz = product(x, z);
  q[0] = q[1] = q[2] = q[3] = one;
  q[4] = xy, q[5] = yz, q[6] = 3 * zz - one, q[7] = xz, q[8] = xx - yy;
  q[9] = yy - 3 * xx, q[10] = 2 * xy, q[11] = one - 5 * zz, q[12] = 5 * zz - 3 * one, q[13] = one - 5 * zz;
  q[14] = xx - yy, q[15] = xx - 3 * yy;
}

void fx_sh(const int16_t unit[3], int frac, int16_t dir[FX_SH])
{
  int32_t v[4] = {[AXIS_ONE] = FX_UNIT_ONE}, q[FX_SH];
  for (int i = 0; i < 3; i++)
    v[i] = unit[i] > FX_UNIT_ONE ? FX_UNIT_ONE : unit[i] < -FX_UNIT_ONE ? -FX_UNIT_ONE : unit[i];
  factors(v, q);
  for (int i = 0; i < FX_SH; i++) {
    const int64_t a = fx_rshift_round((int64_t)harmonics[i].coefficient * v[harmonics[i].u], FX_UNIT_FRAC);
    const int64_t value = fx_rshift_round(a * q[i], COEFFICIENT_FRAC + PRODUCT_FRAC - frac);
    dir[i] = (int16_t)(value > FX_INPUT_MAX ? FX_INPUT_MAX : value < -FX_INPUT_MAX ? -FX_INPUT_MAX : value);
  }
}
