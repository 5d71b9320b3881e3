#include "src/fx/unit.h"
#include "src/fx/nofloat.h"

/* The fixed-point core as an fx_net_fn. */
typedef struct core {
  const fx_net *net;
  int32_t base[SF_LANES];
  fx_counts *counts;
} core;

static sf_status eval_core(void *user, const fx_ray *ray, bool first, const int16_t *f, fx_out *out)
{
  core *c = user;
  if (first) fx_net_direction(c->net, ray->dir, c->base, c->counts);
  fx_net_sample(c->net, f, c->base, out, NULL, c->counts);
  return sf_ok();
}

sf_status fx_render_ray(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user, fx_pixel *pixel,
                        fx_counts *counts)
{
  core own = {.net = &scene->net, .counts = counts};
  if (!eval) eval = eval_core, user = &own;
  fx_composite_begin(pixel);
  uint32_t pos[3];
  for (int32_t n = fx_march_next(scene, ray, 0, pos, counts); n >= 0;
       n = fx_march_next(scene, ray, n + 1, pos, counts)) {
    int16_t f[FX_LEVELS_MAX * FX_GRID_FEATURES];
    fx_out out;
    fx_grid_features(&scene->grid, pos, f, counts);
    SF_TRY(eval(user, ray, pixel->samples == 0, f, &out));
    fx_composite_add(pixel, &out, scene->step_q24, ((uint64_t)n << 16) + (uint32_t)ray->first_q16);
    if (pixel->transmittance <= (uint32_t)scene->trans_stop) break;
    if (pixel->samples >= (uint32_t)scene->max_samples) break;
  }
  fx_composite_end(pixel, scene->background);
  return sf_ok();
}
