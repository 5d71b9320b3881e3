/* Light that a ray gathers comes from one place. L_distortion of Mip-NeRF 360 (Barron et al., CVPR 2022, eq. 15),
 *   sum_ij w_i w_j |s_i - s_j| + 1/3 sum_i w_i^2 h_i,
 * charges a ray whose weights w lie apart: in clouds before a surface, and in surfaces that are soft. s is a sample's
 * distance from its camera and h the length of its interval, where the cameras' mean distance from the centre is 1.
 * Mip-NeRF 360 measures both by 1 / distance, which lets what is far away stay soft. */
#include "render/composite.h"
#include "scene/scene.h"
#include "train/internal.h"
#include <math.h>

float sf_distortion_unit(const sf_dataset *data)
{
  return data->ndc ? 2 * data->scale : (float)fmax(sf_dataset_distance(data), 1);
}

void sf_distortion_place(const sf_trainer *t, const sf_ray *ray, const float *x, int lane, int block,
                         const float *delta, sf_ray_work *w)
{
  for (int s = 0; s < ray->count; s++, lane++) {
    const float *at = x + (size_t)(lane / block) * 3 * block + lane % block;
    w->place[s] = sqrtf(sf_squared_distance(t, ray, at, block)) / t->distortion_unit;
    w->span[s] = delta[s] / t->distortion_unit;
  }
}

/* Places ascend, so of sample i the sum over j of w_j |s_i - s_j| follows from sums over those before and behind it. */
double sf_distortion_add(int n, const float *weight, float behind, const float *delta, float scale, sf_ray_work *w,
                         float *dsigma)
{
  const float *s = w->place;
  float *g = w->spare[5];
  double all = 0, all_s = 0, before = 0, before_s = 0, value = 0;
  for (int i = 0; i < n; i++) all += weight[i], all_s += (double)weight[i] * s[i];
  for (int i = 0; i < n; i++) {
    const double here = weight[i], here_s = here * s[i];
    const double apart = s[i] * before - before_s + (all_s - before_s - here_s) - s[i] * (all - before - here);
    value += here * (apart + here * w->span[i] / 3);
    g[i] = scale * (float)(2 * apart + 2.0 / 3 * here * w->span[i]);
    before += here, before_s += here_s;
  }
  sf_composite_backward(n, weight, behind, delta, g, 0, dsigma);
  return value;
}
