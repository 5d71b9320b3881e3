/* One ray, sample by sample: the oracle of rays.c and rays_tensorf.c. */
#include "src/fx/tensorf.h"
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
  fx_net_next(c->net, ray->dir, first, f, c->base, out, NULL, c->counts);
  return sf_ok();
}

static void tell(const fx_watch *watch, fx_read what, const uint32_t pos[3])
{
  if (watch) watch->read(watch->user, what, pos);
}

static sf_status render_ingp(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user,
                             const fx_watch *watch, fx_pixel *pixel, fx_counts *counts)
{
  uint32_t pos[3];
  for (int32_t n = fx_march_next(scene, ray, 0, pos, counts); n >= 0;
       n = fx_march_next(scene, ray, n + 1, pos, counts)) {
    int16_t f[FX_LEVELS_MAX * FX_GRID_FEATURES];
    fx_out out;
    fx_grid_features(&scene->grid, pos, f, counts);
    tell(watch, FX_READ_GRID, pos);
    SF_TRY(eval(user, ray, pixel->samples == 0, f, &out));
    fx_composite_add(pixel, &out, fx_delta(scene, n), fx_distance(scene, ray, n));
    if (pixel->transmittance <= (uint32_t)scene->trans_stop) break;
    if (pixel->samples >= (uint32_t)scene->max_samples) break;
  }
  return sf_ok();
}

uint32_t fx_tensorf_weight(const fx_scene *scene, const fx_vm *vm, const fx_ray *ray, int32_t n, const uint32_t pos[3],
                           fx_pixel *pixel, fx_counts *counts)
{
  const uint32_t sigma = fx_vm_sigma(&scene->tensorf, vm, pos, counts);
  const uint32_t weight = fx_composite_weight(pixel, sigma, fx_delta(scene, n), fx_distance(scene, ray, n));
  return weight > (uint32_t)scene->tensorf.weight_stop ? weight : 0;
}

static sf_status render_tensorf(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user,
                                const fx_watch *watch, fx_pixel *pixel, fx_counts *counts)
{
  uint32_t pos[3];
  for (int32_t n = fx_march_next(scene, ray, 0, pos, counts); n >= 0;
       n = fx_march_next(scene, ray, n + 1, pos, counts)) {
    const uint32_t weight = fx_tensorf_weight(scene, &fx_vm_portable, ray, n, pos, pixel, counts);
    tell(watch, FX_READ_DENSITY, pos);
    if (weight) {
      int16_t x[SF_DIR_MAX];
      fx_out out;
      fx_tensorf_encode(&scene->tensorf, pos, ray->unit, x, counts);
      tell(watch, FX_READ_APPEARANCE, pos);
      if (counts) counts->rays += pixel->samples == 0;
      SF_TRY(eval(user, ray, pixel->samples == 0, x, &out));
      fx_composite_colour(pixel, weight, out.colour);
    }
    if (pixel->transmittance <= (uint32_t)scene->trans_stop) break;
    if (pixel->samples >= (uint32_t)scene->max_samples) break;
  }
  return sf_ok();
}

sf_status fx_render_watched(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user, const fx_watch *watch,
                            fx_pixel *pixel, fx_counts *counts)
{
  core own = {.net = &scene->net, .counts = counts};
  if (!eval) eval = eval_core, user = &own;
  fx_composite_begin(pixel);
  SF_TRY((scene->backbone == FX_TENSORF ? render_tensorf : render_ingp)(scene, ray, eval, user, watch, pixel, counts));
  fx_composite_end(pixel, scene->background);
  return sf_ok();
}

sf_status fx_render_ray(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user, fx_pixel *pixel,
                        fx_counts *counts)
{
  return fx_render_watched(scene, ray, eval, user, NULL, pixel, counts);
}
