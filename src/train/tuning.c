/* Fine-tuning for few bits: the nets run with weights on the grid that the exporter will round to, and the gradient of
 * a rounded weight moves the weight behind it (straight-through; Bengio et al. 2013, Jacob et al. 2018). So do leaks
 * and the field's entries where they are narrower than the core's. */
#include "train/internal.h"
#include <math.h>
#include <string.h>

/* Thresholds are integers of the membrane: C2's has more bits than its current. */
static void round_thresholds(sf_model *m)
{
  static const int layer[3] = {0, 2, 3};
  const int frac[3] = {0, 0, m->config.mode == SF_RADIX ? SF_T_MAX : SF_AC_FRAC};
  for (int i = 0; i < 3; i++) {
    if (!sf_model_has(m, sf_layer_weights[layer[i]])) continue;
    const float lsb = ldexpf(m->scales.lsb.current[layer[i]], -frac[i]);
    m->config.theta[i] = lsb * fmaxf(1, nearbyintf(m->config.theta[i] / lsb));
  }
}

sf_status sf_tuning_start(sf_trainer *t)
{
  round_thresholds(&t->model);
  t->options.fixed_steps = t->model.t_r;
  t->rounded = sf_aligned_alloc(t->model.size * sizeof *t->rounded);
  if (t->rounded) return sf_ok();
  return sf_fail(SF_E_MEMORY, "train: no memory for %zu rounded parameters", t->model.size);
}

void sf_tuning_round(sf_trainer *t)
{
  if (sf_tuning(t)) sf_scales_round(&t->model, t->rounded);
}

sf_model sf_tuning_nets(const sf_trainer *t)
{
  sf_model seen = t->model;
  if (sf_tuning(t)) seen.value = t->rounded;
  return seen;
}

sf_model sf_tuning_field(const sf_trainer *t)
{
  sf_model seen = t->model;
  if (sf_scales_narrow_field(&t->model.scales)) seen.value = t->rounded;
  return seen;
}

void sf_train_prepare(sf_trainer *t)
{
  const sf_model seen = sf_tuning_nets(t);
  const sf_net_view view = sf_net_view_of(&seen);
  t->kernels->prepare(&view, t->net);
}
