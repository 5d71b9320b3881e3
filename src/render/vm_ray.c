#include "render/vm_ray.h"
#include <math.h>

enum { BURST = 16 }; /* densities of so many samples at once: most rays end soon behind the surface */

int sf_vm_ray(const sf_kernels *k, const sf_vm_field *density, const sf_march *march, sf_vm_samples s,
              float *transmittance)
{
  int count = 0, word = 0;
  uint64_t points = 0; /* left of the last word */
  *transmittance = 1;
  while (points || word < SF_RAY_SAMPLES / 64) {
    int found = count;
    while (found < count + BURST && (points || word < SF_RAY_SAMPLES / 64)) {
      if (!points) points = k->march(march, word++);
      for (; points && found < count + BURST; points &= points - 1, found++) {
        const int n = 64 * (word - 1) + __builtin_ctzll(points);
        sf_march_at(march, n, s.x + 3 * found);
        if (s.lattice) s.lattice[found] = n;
      }
    }
    k->vm_density(density, s.x + 3 * count, found - count, s.sigma + count, s.slope + count);
    for (; count < found; count++) {
      if (*transmittance < march->stop) return count;
      const float behind = *transmittance * expf(-s.sigma[count] * march->steps->length[0]);
      s.weight[count] = *transmittance - behind;
      *transmittance = behind;
    }
  }
  return count;
}

sf_vm_direction sf_vm_encode_direction(const sf_model *model, const float direction[3])
{
  sf_vm_direction d = {0};
  sf_tensorf alone = model->config.tensorf;
  alone.features = 0;
  sf_tensorf_encode(&alone, d.value, direction, d.value);
  sf_scales_round_direction(&model->scales, d.value, 3 + 6 * alone.view_freqs);
  return d;
}

void sf_vm_put_direction(const sf_tensorf *f, const sf_vm_direction *d, float *in, int lane)
{
  float *at = in + f->features * SF_BLOCK + lane;
  for (int i = 0; i < 3 + 6 * f->view_freqs; i++, at += SF_BLOCK) {
    if (i == 3) at += 2 * f->features * f->feature_freqs * SF_BLOCK;
    *at = d->value[i];
  }
}
