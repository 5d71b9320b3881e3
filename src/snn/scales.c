/* Weights on the grid of a core of few bits. */
#include "snn/model.h"
#include <math.h>

double sf_scales_input(const sf_scales *s, int layer, int input)
{
  if (layer == 0) return s->lsb.feature[input / 2];
  if (layer == 2) return input < SF_DIR_FEATURES ? s->lsb.direction : ldexp(s->lsb.current[1], SF_H_SHIFT);
  return 1;
}

void sf_scales_round(const sf_model *model, float *value)
{
  const sf_scales *s = &model->scales;
  const double limit = (1 << (s->weight_bits - 1)) - 1;
  for (int layer = 0; layer < SF_LAYERS; layer++) {
    const sf_param *p = &model->param[sf_layer_weights[layer]];
    for (int64_t in = 0; in < p->shape[1]; in++) {
      const double step = s->lsb.current[layer] / sf_scales_input(s, layer, (int)in);
      for (int64_t out = 0; out < p->shape[0]; out++) {
        const size_t at = p->offset + (size_t)(out * p->shape[1] + in);
        value[at] = (float)(step * fmax(-limit, fmin(limit, nearbyint(model->value[at] / step))));
      }
    }
  }
}

float sf_scales_h_step(const sf_scales *s)
{
  return s->weight_bits ? ldexpf(s->lsb.current[1], SF_H_SHIFT) : 0;
}

void sf_scales_round_direction(const sf_scales *s, float sh[SF_DIR_FEATURES])
{
  for (int i = 0; i < SF_DIR_FEATURES && s->weight_bits; i++)
    sh[i] = s->lsb.direction * nearbyintf(sh[i] / s->lsb.direction);
}
