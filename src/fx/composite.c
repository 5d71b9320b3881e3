/* Volume rendering in integers. The weights telescope: w_i = Tr_i - Tr_(i+1), so their sum and the remaining
 * transmittance are 1 exactly, for every ray and every rounding.
 * Mirror: rtl/sf_composite.sv */
#include "src/fx/unit.h"
#include "src/fx/round.h"
#include "src/fx/nofloat.h"

enum { TAU_SHIFT = SF_SIGMA_FRAC + SF_DELTA_FRAC - SF_TRANS_FRAC };
enum { COLOUR_SUM_FRAC = SF_TRANS_FRAC + SF_COLOUR_FRAC, UNIT = (1 << 16) - 1 };

void fx_composite_begin(fx_pixel *pixel)
{
  *pixel = (fx_pixel){.transmittance = FX_TRANS_ONE};
}

uint32_t fx_composite_weight(fx_pixel *pixel, uint32_t sigma, int32_t delta_q24, uint64_t distance_q16)
{
  const int64_t tau = fx_rshift_round((int64_t)sigma * delta_q24, TAU_SHIFT); /* 28 + 24 bits */
  const int64_t product = (int64_t)pixel->transmittance * fx_exp_neg((uint64_t)tau);
  const uint32_t after = (uint32_t)fx_rshift_round(product, SF_TRANS_FRAC);
  const uint32_t weight = pixel->transmittance - after;
  pixel->depth += weight * distance_q16;
  pixel->weight_sum += weight;
  pixel->transmittance = after;
  return weight;
}

void fx_composite_colour(fx_pixel *pixel, uint32_t weight, const uint32_t colour[3])
{
  for (int o = 0; o < 3; o++) pixel->colour[o] += (uint64_t)weight * colour[o];
  pixel->samples++;
}

void fx_composite_add(fx_pixel *pixel, const fx_out *sample, int32_t delta_q24, uint64_t distance_q16)
{
  const uint32_t weight = fx_composite_weight(pixel, sample->sigma, delta_q24, distance_q16);
  fx_composite_colour(pixel, weight, sample->colour);
}

void fx_composite_end(fx_pixel *pixel, const int32_t *background_q16)
{
  for (int o = 0; o < 3; o++) pixel->colour[o] += (uint64_t)pixel->transmittance * (uint32_t)background_q16[o];
}

static uint32_t to_unit(uint64_t value, int shift)
{
  const int64_t rounded = fx_rshift_round((int64_t)value, shift);
  return rounded > UNIT ? UNIT : (uint32_t)rounded;
}

void fx_pixel_rgba(const fx_pixel *pixel, uint32_t rgba[4])
{
  for (int o = 0; o < 3; o++) rgba[o] = to_unit(pixel->colour[o], COLOUR_SUM_FRAC - 16);
  rgba[3] = to_unit(pixel->weight_sum, SF_TRANS_FRAC - 16);
}
