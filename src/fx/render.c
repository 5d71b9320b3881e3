/* One ray, sample by sample: the oracle of rays.c and rays_tensorf.c. */
#include "src/fx/cache.h"
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

/* Samples whose densities were read, and whose appearances were not: see cache.h. */
typedef struct decoder {
  const fx_scene *scene;
  const fx_ray *ray;
  fx_net_fn eval;
  void *user;
  const fx_watch *watch;
  fx_pixel *pixel;
  fx_counts *counts;
  uint32_t pos[FX_AHEAD + 1][3], weight[FX_AHEAD + 1]; /* weight 0: is not decoded */
  unsigned first, last;                                /* those between wait */
} decoder;

static sf_status decode_oldest(decoder *d)
{
  const unsigned i = d->first++ % (FX_AHEAD + 1);
  int16_t x[SF_DIR_MAX];
  fx_out out;
  if (!d->weight[i]) return sf_ok();
  fx_tensorf_encode(&d->scene->tensorf, d->pos[i], d->ray->unit, x, d->counts);
  tell(d->watch, FX_READ_APPEARANCE, d->pos[i]);
  if (d->counts) d->counts->rays += d->pixel->samples == 0;
  SF_TRY(d->eval(d->user, d->ray, d->pixel->samples == 0, x, &out));
  fx_composite_colour(d->pixel, d->weight[i], out.colour);
  return sf_ok();
}

/* Room for one more sample, whose density was read. */
static void wait_for(decoder *d, const uint32_t pos[3], uint32_t weight)
{
  const unsigned i = d->last++ % (FX_AHEAD + 1);
  tell(d->watch, FX_READ_DENSITY, pos);
  for (int axis = 0; axis < 3; axis++) d->pos[i][axis] = pos[axis];
  d->weight[i] = weight;
}

static sf_status make_room(decoder *d)
{
  return d->last - d->first > FX_AHEAD ? decode_oldest(d) : sf_ok();
}

/* Densities that are read before it is known that the ray ends at n. */
static sf_status read_behind(decoder *d, int32_t n)
{
  uint32_t pos[3];
  for (int i = 0; i < FX_AHEAD && (n = fx_march_next(d->scene, d->ray, n + 1, pos, NULL)) >= 0; i++) {
    SF_TRY(make_room(d));
    fx_tensorf_count_density(&d->scene->tensorf, d->counts);
    wait_for(d, pos, 0);
  }
  return sf_ok();
}

static sf_status render_tensorf(const fx_scene *scene, const fx_ray *ray, fx_net_fn eval, void *user,
                                const fx_watch *watch, fx_pixel *pixel, fx_counts *counts)
{
  decoder d = {scene, ray, eval, user, watch, pixel, counts, {{0}}, {0}, 0, 0};
  uint32_t pos[3];
  int32_t decoded = 0;
  for (int32_t n = fx_march_next(scene, ray, 0, pos, counts); n >= 0;
       n = fx_march_next(scene, ray, n + 1, pos, counts)) {
    SF_TRY(make_room(&d));
    const uint32_t weight = fx_tensorf_weight(scene, &fx_vm_portable, ray, n, pos, pixel, counts);
    wait_for(&d, pos, weight);
    decoded += weight > 0;
    if (pixel->transmittance <= (uint32_t)scene->trans_stop || decoded >= scene->max_samples) {
      SF_TRY(read_behind(&d, n));
      break;
    }
  }
  while (d.first != d.last) SF_TRY(decode_oldest(&d));
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
