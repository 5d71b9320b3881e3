/* TensoRF's field: vector-matrix products (Chen et al. 2022) interpolated in integers, the density's activation, and
 * the decoder's inputs.
 *
 *   position  p = rshift_round(pos * (res - 1), 16) per axis, Q.8: point p >> 8, g = p & 255; g = 0 at the last point
 *   plane     P = rshift_round(sum of entry * weight, 8), Q.8: the four weights (256 - g or g) * (256 - h or h) are
 *             exact and sum to 65536; |P| <= 127 * 2^8
 *   line      L = entry * (256 - g) + next * g, Q.8, exact; |L| <= 127 * 2^8
 *   density   sum of P * L over all components, exact in Q.16: 3 * 64 products below 2^30, so s39
 *             y = sat24(rshift_round(sum * mul, shift) + bias)
 *             sigma = usat28(rshift_round(activation(y) * mul, shift))
 *   features  x = rshift_round(P * L, 15) per component, s16: |x| <= 32258
 *             sum of x * basis, exact: 192 * 32258 * 127 < 2^30
 *             feature = sat12(rshift_round(sum * mul, shift)); its angle in turns by another such factor, modulo 1
 *   inputs    features, direction, sin and cos of 2^k times each feature (all sines, then all cosines; value by value,
 *             k = 0 first), then of each axis of the direction: TensoRF's order
 *
 * All sums are of integers, so their order does not matter.
 * Mirror: rtl/sf_planes.sv */
#include "src/fx/unit.h"
#include "src/fx/round.h"
#include "src/fx/tensorf_isa.h"
#include "src/fx/nofloat.h"

enum { READS_PLANE = 4, READS_LINE = 2, PRODUCTS = READS_PLANE + READS_LINE + 1 };
enum { TURNS_PER_UNIT_Q16 = 41722, PHASE_ONE = 1 << FX_PHASE_BITS }; /* 2^16 * 4 / (2 pi): Q1.14 radians to turns */

const int fx_pair_axes[FX_PAIRS][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};

const fx_vm fx_vm_portable = {vm_density, vm_features};

int fx_factors_components(const fx_factors *factors)
{
  return factors->components[0] + factors->components[1] + factors->components[2];
}

static void count_field(fx_counts *counts, const fx_factors *factors, int features)
{
  const uint64_t n = (uint64_t)fx_factors_components(factors);
  counts->grid_bytes += n * (READS_PLANE + READS_LINE);
  counts->field_mac += n * (PRODUCTS + (uint64_t)features);
}

/* sum * mul / 2^shift + bias: |sum| < 2^38, so below 2^54. */
static int64_t scaled(int64_t sum, const fx_scale *scale)
{
  return fx_rshift_round(sum * scale->mul, scale->shift) + scale->bias;
}

static int16_t to_input(int64_t exact, uint64_t *saturated)
{
  const int64_t kept = exact > FX_INPUT_MAX ? FX_INPUT_MAX : exact < -FX_INPUT_MAX ? -FX_INPUT_MAX : exact;
  *saturated += kept != exact;
  return (int16_t)kept;
}

uint32_t fx_tensorf_activate(const fx_tensorf *field, int64_t sum)
{
  const int32_t y = (int32_t)fx_sat(scaled(sum, &field->density_in), FX_ACTIVATION_BITS);
  const uint32_t activated = field->activation == FX_RELU ? fx_relu(y) : fx_softplus(y);
  return (uint32_t)fx_usat(scaled(activated, &field->sigma_out), SF_SIGMA_BITS);
}

void fx_tensorf_count_density(const fx_tensorf *field, fx_counts *counts)
{
  if (!counts) return;
  counts->field_samples++;
  count_field(counts, &field->density, 0);
}

uint32_t fx_vm_sigma(const fx_tensorf *field, const fx_vm *vm, const uint32_t pos[3], fx_counts *counts)
{
  fx_tensorf_count_density(field, counts);
  return fx_tensorf_activate(field, vm->density(field, pos));
}

uint32_t fx_tensorf_density(const fx_tensorf *field, const uint32_t pos[3], fx_counts *counts)
{
  return fx_vm_sigma(field, &fx_vm_portable, pos, counts);
}

int fx_tensorf_products(const fx_tensorf *field, const uint32_t pos[3], int16_t *x)
{
  return vm_products(field, pos, x);
}

int fx_tensorf_density_products(const fx_tensorf *field, const uint32_t pos[3], int32_t *product)
{
  const vm_place p = vm_find(field->res, pos);
  int n = 0;
  for (int pair = 0; pair < FX_PAIRS; n += field->density.components[pair++])
    vm_pair(&field->density, pair, field->res, &p, product + n);
  return n;
}

/* value in Q1.14 to the LSB of the encodings; 1.0 at the finest LSB is one too many for int12. */
static int16_t encoded(const fx_tensorf *field, int32_t value)
{
  const int64_t rounded = fx_rshift_round(value, FX_UNIT_FRAC - field->encoding_frac);
  return (int16_t)(rounded > FX_INPUT_MAX ? FX_INPUT_MAX : rounded < -FX_INPUT_MAX ? -FX_INPUT_MAX : rounded);
}

/* x[2 * n * freqs]: all sines, then all cosines. Returns their end. */
static int16_t *waves(const fx_tensorf *field, const uint32_t *phase, int n, int freqs, int16_t *x)
{
  int16_t *cosine = x + n * freqs;
  for (int i = 0; i < n; i++)
    for (int k = 0; k < freqs; k++) {
      x[i * freqs + k] = encoded(field, fx_sine(phase[i] << k));
      cosine[i * freqs + k] = encoded(field, fx_sine((phase[i] << k) + PHASE_ONE / 4));
    }
  return cosine + n * freqs;
}

void fx_tensorf_encode(const fx_tensorf *field, const uint32_t pos[3], const int16_t unit[3], int16_t *x,
                       fx_counts *counts)
{
  fx_vm_encode(field, &fx_vm_portable, pos, unit, x, counts);
}

void fx_vm_encode(const fx_tensorf *field, const fx_vm *vm, const uint32_t pos[3], const int16_t unit[3], int16_t *x,
                  fx_counts *counts)
{
  const int n = field->features;
  int32_t sum[FX_APPEARANCE_MAX];
  uint32_t phase[FX_APPEARANCE_MAX], turn[3];
  uint64_t saturated = 0;
  vm->features(field, pos, sum);
  for (int f = 0; f < n; f++) {
    x[f] = to_input(scaled(sum[f], &field->feature_in), &saturated);
    phase[f] = (uint32_t)scaled(sum[f], &field->phase_in);
  }
  for (int axis = 0; axis < 3; axis++) {
    x[n + axis] = encoded(field, unit[axis]);
    turn[axis] = (uint32_t)fx_rshift_round((int64_t)unit[axis] * TURNS_PER_UNIT_Q16, 16);
  }
  waves(field, turn, 3, field->view_freqs, waves(field, phase, n, field->feature_freqs, x + n + 3));
  if (!counts) return;
  counts->saturated_features += saturated;
  count_field(counts, &field->appearance, n);
}

int fx_tensorf_inputs(const fx_tensorf *field)
{
  return field->features * (1 + 2 * field->feature_freqs) + 3 * (1 + 2 * field->view_freqs);
}
