/* The numbers of a model as a core of few bits has them. */
#include "snn/plif.h"
#include <math.h>
#include <string.h>

void sf_scales_clear(sf_scales *s)
{
  for (int i = 0; i < SF_SCALES; i++) ((float *)&s->lsb)[i] = 1;
}

double sf_scales_input(const sf_model *model, int layer, int input)
{
  const sf_scales *s = &model->scales;
  if (layer == 0) return s->lsb.feature[input / 2];
  if (layer != 2) return 1;
  if (sf_model_decodes(model)) return input < model->config.tensorf.features ? s->lsb.feature[0] : s->lsb.direction;
  return input < SF_DIR_FEATURES ? s->lsb.direction : ldexp(s->lsb.current[1], SF_H_SHIFT);
}

bool sf_scales_narrow_field(const sf_scales *s)
{
  return s->weight_bits && s->grid_bits < SF_GRID_BITS;
}

static float rounded(float value, double step, double limit)
{
  return (float)(step * fmax(-limit, fmin(limit, nearbyint(value / step))));
}

/* Weights and bias: the bias is the weight of one more input. */
static void round_layer(const sf_model *m, int layer, float *value)
{
  const sf_scales *s = &m->scales;
  const sf_param *p = &m->param[sf_layer_weights[layer]];
  const double limit = sf_symmetric_max(s->weight_bits);
  for (int64_t in = 0; in < p->shape[1]; in++) {
    const double step = s->lsb.current[layer] / sf_scales_input(m, layer, (int)in);
    for (int64_t out = 0; out < p->shape[0]; out++) {
      const size_t at = p->offset + (size_t)(out * p->shape[1] + in);
      value[at] = rounded(m->value[at], step, limit);
    }
  }
  if (sf_layer_bias[layer] < 0 || !sf_model_has(m, sf_layer_bias[layer])) return;
  const sf_param *b = &m->param[sf_layer_bias[layer]];
  const double step = s->lsb.current[layer] / (layer == 2 ? (double)s->lsb.bias : 1);
  for (size_t i = b->offset; i < b->offset + b->size; i++) value[i] = rounded(m->value[i], step, limit);
}

static void round_basis(const sf_model *m, float *value)
{
  const sf_param *p = &m->param[SF_P_BASIS];
  const size_t columns = (size_t)p->shape[1];
  for (size_t i = 0; i < p->size; i++) {
    const double lsb = ldexp(m->scales.lsb.product[1][i % columns], -SF_PRODUCT_SHIFT);
    value[p->offset + i] =
        rounded(m->value[p->offset + i], m->scales.lsb.basis / lsb, sf_symmetric_max(m->scales.weight_bits));
  }
}

/* k to leak_bits; where that is 0 or 1 the logit stays finite and rounds to the same again. */
static void round_leaks(const sf_model *m, float *value)
{
  const double one = ldexp(1, m->scales.leak_bits);
  const size_t first = m->param[SF_P_LEAK].offset;
  for (size_t i = first; i < first + SF_LAYERS; i++) {
    const double k = nearbyint(one / (1 + exp(-(double)m->value[i])));
    value[i] = k <= 0 ? -SF_LEAK_LIMIT : k >= one ? SF_LEAK_LIMIT : (float)log(k / (one - k));
  }
}

static void round_levels(const sf_model *m, float *value)
{
  const size_t table = m->param[SF_P_GRID].offset;
#pragma omp parallel for schedule(dynamic, 1)
  for (int l = 0; l < m->config.levels; l++) {
    const size_t first = table + 2 * m->level[l].offset;
    for (size_t i = first; i < first + 2 * (size_t)m->level[l].entries; i++)
      value[i] = rounded(m->value[i], m->scales.lsb.entry[l], sf_symmetric_max(m->scales.grid_bits));
  }
}

/* A plane or a line; first: its first component among those of all modes. */
static void round_factor(const sf_model *m, int id, int first, float *value)
{
  const sf_param *p = &m->param[id];
  const int64_t n = p->shape[p->dims - 1], points = (int64_t)p->size / n;
  const bool appearance = id >= SF_P_APP_PLANE;
  double step[SF_COMPONENTS_MAX];
  for (int c = 0; c < n; c++) {
    const double plane = m->scales.lsb.plane[appearance][first + c];
    step[c] = p->dims == 3 ? plane : m->scales.lsb.product[appearance][first + c] / plane;
  }
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < points; i++)
    for (int64_t c = 0; c < n; c++) {
      const size_t at = p->offset + (size_t)(i * n + c);
      value[at] = rounded(m->value[at], step[c], sf_symmetric_max(m->scales.grid_bits));
    }
}

static void round_factors(const sf_model *m, float *value)
{
  const sf_tensorf *f = &m->config.tensorf;
  for (int mode = 0, density = 0, appearance = 0; mode < 3; mode++) {
    for (int line = 0; line <= 3; line += 3) {
      round_factor(m, SF_P_DENSITY_PLANE + line + mode, density, value);
      round_factor(m, SF_P_APP_PLANE + line + mode, appearance, value);
    }
    density += f->density[mode], appearance += f->appearance[mode];
  }
}

void sf_scales_round(const sf_model *m, float *value)
{
  const bool planes = sf_model_has(m, SF_P_BASIS);
  for (int layer = 0; layer < SF_LAYERS; layer++)
    if (sf_model_has(m, sf_layer_weights[layer])) round_layer(m, layer, value);
  if (planes) round_basis(m, value);
  if (m->scales.leak_bits < SF_LEAK_FRAC)
    round_leaks(m, value);
  else if (value != m->value)
    memcpy(value + m->param[SF_P_LEAK].offset, sf_model_param(m, SF_P_LEAK), SF_LAYERS * sizeof *value);
  if (!sf_scales_narrow_field(&m->scales)) return;
  if (planes)
    round_factors(m, value);
  else
    round_levels(m, value);
}

float sf_scales_h_step(const sf_scales *s)
{
  return s->weight_bits ? ldexpf(s->lsb.current[1], SF_H_SHIFT) : 0;
}

float sf_scales_feature_step(const sf_scales *s)
{
  return s->weight_bits ? s->lsb.feature[0] : 0;
}

float sf_scales_direction_step(const sf_scales *s)
{
  return s->weight_bits ? s->lsb.direction : 0;
}

void sf_scales_round_direction(const sf_scales *s, float *value, int count)
{
  for (int i = 0; i < count; i++) value[i] = sf_round_input(value[i], sf_scales_direction_step(s));
}
