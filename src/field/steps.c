/* The intervals of a ray: torch-ngp's recurrence dt = clamp(t * dt_gamma, dt_min, dt_max). */
#include "field/field.h"
#include <math.h>

void sf_steps_equal(sf_steps *s, const sf_tensorf *f, int stride)
{
  *s = (sf_steps){.stride = stride,
                  .lattice = SF_STEPS_MAX,
                  .near = f->near,
                  .far = f->far,
                  .shortest = sf_tensorf_step(f),
                  .count = SF_STEPS_MAX / stride};
  for (int a = 0; a < 3; a++) s->low[a] = f->box[0][a], s->high[a] = f->box[1][a];
  for (int n = 0; n < s->count; n++) {
    s->length[n] = s->shortest * (float)stride;
    s->start[n] = (float)n * s->length[n];
  }
}

sf_status sf_steps_growing(sf_steps *s, const sf_config *config, int stride)
{
  const float root3 = 1.7320508f, bound = (float)config->bound;
  const int cascades = sf_config_cascades(config);
  *s = (sf_steps){.stride = stride,
                  .lattice = config->lattice * config->bound,
                  .low = {-bound, -bound, -bound},
                  .high = {bound, bound, bound},
                  .near = SF_NEAR,
                  .far = INFINITY,
                  .shortest = 2 * root3 / (float)config->lattice,
                  .growing = config->dt_gamma > 0};
  const float shortest = s->shortest * (float)stride, longest = 2 * root3 * bound / (float)config->occ_res;
  for (float start = 0; start < 2 * root3 * bound && s->count < s->lattice; s->count++) {
    if (s->count == SF_STEPS_MAX)
      return sf_fail(SF_E_RANGE,
                     "model config: bound = %d with dt_gamma = %g and lattice = %d: %d steps end at %g of %g",
                     config->bound, (double)config->dt_gamma, config->lattice, SF_STEPS_MAX, (double)start,
                     (double)(2 * root3 * bound));
    const int n = s->count;
    const float step = (float)stride * fminf(((float)SF_NEAR + start) * config->dt_gamma, longest);
    s->start[n] = s->growing ? start : (float)n * shortest;
    s->length[n] = s->growing ? fmaxf(step, shortest) : shortest;
    while (s->cascade[n] < cascades - 1 && s->length[n] >= (float)(2 << s->cascade[n]) / (float)config->occ_res)
      s->cascade[n]++;
    start = s->start[n] + s->length[n];
  }
  return sf_ok();
}
