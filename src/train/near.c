/* Samples near a camera learn slower. Rays diverge, so a cell at distance d meets 1/d^2 as many of a camera's rays as
 * one at distance 1, and what is near a camera is seen by few others. Without this, clouds settle there that explain
 * one picture and hide the scene from the views between the cameras. The gradients of a sample's density and colours
 * are weighed by min(1, d^2 / D^2) (Philip and Deschaintre, "Floaters No More: Radiance Field Gradient Scaling for
 * Improved Near-Camera Training", EGSR 2023; there D = 1). */
#include "scene/scene.h"
#include "train/internal.h"

float sf_near_camera(const sf_dataset *data, const sf_train_options *options)
{
  const bool none = data->ndc || options->objective == SF_OBJECTIVE_PAPER;
  return none ? 0 : (float)(options->near_camera * sf_dataset_distance(data));
}

float sf_squared_distance(const sf_trainer *t, const sf_ray *ray, const float *x, int stride)
{
  const sf_steps *box = &t->intervals;
  float away = 0;
  for (int a = 0; a < 3; a++) {
    const float d = box->low[a] + x[a * stride] * (box->high[a] - box->low[a]) - ray->origin[a];
    away += d * d;
  }
  return away;
}

float sf_near_weight(const sf_trainer *t, const sf_ray *ray, const float *x, int stride)
{
  const float weight = sf_squared_distance(t, ray, x, stride) / (t->near_camera * t->near_camera);
  return weight < 1 ? weight : 1;
}

void sf_near_slow(const sf_trainer *t, const sf_loss_plan *p, const sf_ray *ray, const float *x, int lane, int block,
                  sf_ray_work *w)
{
  const bool shared = sf_model_decodes(&t->model); /* one density for all prefixes */
  for (int s = 0; s < ray->count && t->near_camera > 0; s++, lane++) {
    const float weight = sf_near_weight(t, ray, x + (size_t)(lane / block) * 3 * block + lane % block, block);
    if (weight >= 1) break; /* the next ones are farther away */
    if (shared) w->dsigma[0][s] *= weight;
    for (int step = 0; step < p->steps; step++) {
      if (!sf_loss_needs(p, step + 1)) continue;
      if (!shared) w->dsigma[step][s] *= weight;
      for (int c = 0; c < 3; c++) w->dcolour[step][3 * s + c] *= weight;
    }
  }
}
