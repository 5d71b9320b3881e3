/* One ray in double precision and through the core, point by point. */
#include "bounds/picture_ray.h"
#include "energy/energy.h"
#include "base/rng.h"
#include "src/fx/march.h"
#include "src/fx/tensorf.h"
#include <stdlib.h>
#include <string.h>

enum { INPUTS_MAX = SF_DIR_MAX > SF_FEATURE_MAX ? SF_DIR_MAX : SF_FEATURE_MAX };

/* Which samples the net sees, and the light that is left. */
typedef struct light {
  uint64_t taken;
  double left; /* LSB of Q.20 */
  bool ended;
} light;

/* A point of the lattice. */
typedef struct point {
  int32_t n;
  uint32_t core[3]; /* position; of the core */
  double pos[3];    /* of the row */
  bool traced;      /* what follows is this point's */
  int16_t fq[INPUTS_MAX];
  fx_out fixed;
} point;

typedef struct picture_tracer {
  const sf_exact *exact; /* the row's blocks */
  const sf_exact *real;  /* all blocks; NULL in all rows but the first */
  fx_ray ray;
  double unit[3];                       /* direction */
  double real_dir[SF_EXACT_DIRECTIONS]; /* unrounded direction features, LSB */
  double dir[SF_EXACT_DIRECTIONS];      /* the row's */
  double base[SF_LANES];                /* hash grid: their current */
  fx_trace trace;                       /* the core's at the point */
} picture_tracer;

struct picture_tracer *picture_tracer_create(const sf_exact *exact, const sf_exact *real)
{
  picture_tracer *t = calloc(1, sizeof *t);
  if (t) t->exact = exact, t->real = real;
  return t;
}

void picture_pixel(const sf_picture_job *job, uint64_t i, int *x, int *y)
{
  *x = (int)sf_random_below(job->seed, 1, i, (uint64_t)job->view->camera.width);
  *y = (int)sf_random_below(job->seed, 2, i, (uint64_t)job->view->camera.height);
}

/* ---- the direction ---- */

static void grid_direction(picture_tracer *t, const float direction[3])
{
  float sh[SF_DIR_FEATURES];
  sf_sh4(direction, sh);
  sf_scales_round_direction(&t->exact->model->scales, sh, SF_DIR_FEATURES); /* as a fine-tuned model sees them */
  for (int j = 0; j < SF_DIR_FEATURES; j++) {
    t->real_dir[j] = sh[j] / t->exact->scene->units.dir_scale;
    t->dir[j] = sf_exact_is(t->exact, SF_EXACT_DIRECTION) ? t->real_dir[j] : t->ray.dir[j];
  }
  sf_exact_direction(t->exact, t->dir, t->base);
}

/* The core's come with every sample, and are the same at all. */
static void planes_direction(picture_tracer *t)
{
  const fx_tensorf *field = &t->exact->scene->tensorf;
  const uint32_t anywhere[3] = {0};
  const int n = sf_exact_planes_direction(t->exact, t->unit, t->real_dir);
  int16_t x[SF_DIR_MAX];
  fx_tensorf_encode(field, anywhere, t->ray.unit, x, NULL);
  for (int i = 0; i < n; i++) {
    const int at = field->features + i + (i < 3 ? 0 : 2 * field->features * field->feature_freqs);
    t->dir[i] = sf_exact_is(t->exact, SF_EXACT_DIRECTION) ? t->real_dir[i] : x[at];
  }
}

static sf_status begin(picture_tracer *t, const sf_picture_job *job, uint64_t i)
{
  int x, y;
  float origin[3], direction[3];
  picture_pixel(job, i, &x, &y);
  sf_dataset_ray(job->data, job->view, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  SF_TRY(sf_pixel_ray(job->scene, job->data, job->view, x, y, &t->ray));
  for (int a = 0; a < 3; a++) t->unit[a] = direction[a];
  if (t->exact->planes)
    planes_direction(t);
  else
    grid_direction(t, direction);
  return sf_ok();
}

/* ---- one point ---- */

static void locate(const picture_tracer *t, int32_t n, point *p)
{
  const fx_scene *scene = t->exact->scene;
  p->n = n, p->traced = false;
  for (int a = 0; a < 3; a++) {
    p->core[a] = (uint32_t)(fx_ray_at(scene, &t->ray, n, a) >> (FX_RAY_FRAC - SF_POS_FRAC));
    p->pos[a] = p->core[a];
    if (!sf_exact_is(t->exact, SF_EXACT_LATTICE)) continue;
    const double stretch = t->exact->planes ? scene->units.stretch[a] : 1;
    const double at = ldexp((double)t->ray.origin[a], SF_POS_FRAC - FX_RAY_FRAC) +
                      t->unit[a] * stretch * sf_exact_distance(t->exact, n);
    p->pos[a] = fmin(fmax(at, 0), 16777215);
  }
}

static bool occupied(const fx_scene *scene, const double pos[3], int32_t n)
{
  int64_t p[3];
  for (int a = 0; a < 3; a++) p[a] = (int64_t)ldexp(pos[a], FX_RAY_FRAC - SF_POS_FRAC);
  return fx_occupied(scene, p, n);
}

/* The core's inputs, spikes and outputs here. */
static void trace_core(picture_tracer *t, point *p)
{
  const fx_scene *scene = t->exact->scene;
  int32_t base[SF_LANES];
  if (p->traced) return;
  p->traced = true;
  if (t->exact->planes)
    fx_tensorf_encode(&scene->tensorf, p->core, t->ray.unit, p->fq, NULL);
  else
    fx_grid_features(&scene->grid, p->core, p->fq, NULL);
  fx_net_next(&scene->net, t->ray.dir, true, p->fq, base, &p->fixed, &t->trace, NULL);
}

static void inputs(const sf_exact *e, const double *dir, const point *p, double *f)
{
  if (e->planes)
    sf_exact_planes_inputs(e, p->pos, dir, f);
  else
    sf_exact_features(e, p->pos, f);
}

static void net(const picture_tracer *t, const point *p, sf_exact_out *out)
{
  double f[INPUTS_MAX], base[SF_LANES];
  inputs(t->exact, t->dir, p, f);
  if (t->exact->planes) sf_exact_direction(t->exact, f, base);
  sf_exact_sample(t->exact, f, t->exact->planes ? base : t->base, out);
}

/* ---- errors of currents ---- */

/* One current of the core against float weights and inputs; x real and xq as the core has it. */
typedef struct current_error {
  double error, bound;
} current_error;

static void add_product(current_error *c, double w, double x, double wq, double xq)
{
  c->error += w * x - wq * xq;
  c->bound += fabs(xq) * fabs(w - wq) + fabs(w) * fabs(x - xq);
}

static void add_current(sf_current_row *row, current_error c)
{
  const double size = fabs(c.error);
  if (row->currents == 0 || size > row->measured) row->measured = size, row->bound = c.bound;
  if (size > 0) row->ratio = fmax(row->ratio, (size - 1e-6) / c.bound);
  row->rms += size * size;
  row->currents++;
}

/* Input i of a layer at a step: real, and as the core has it. */
static void input(const picture_tracer *t, int l, int step, int i, const double *f, const int16_t *fq, double *x,
                  double *xq)
{
  const fx_layer *layer = &t->exact->scene->net.layer[l];
  const int h = i - SF_DIR_FEATURES, before = l == FX_D2 ? FX_D1 : l - 1;
  if (i == layer->n_in) {
    *x = *xq = layer->bias;
  } else if (l == FX_D1 || (l == FX_C1 && t->exact->planes)) {
    *x = f[i], *xq = fq[i];
  } else if (l != FX_C1) {
    *x = *xq = (double)(t->trace.spikes[before][step][i / 64] >> i % 64 & 1);
  } else if (h < 0) {
    *x = t->real_dir[i], *xq = t->ray.dir[i];
  } else {
    *x = ldexp(t->trace.current[FX_D2][step][1 + h], -SF_H_SHIFT), *xq = floor(*x);
    if (t->exact->model->scales.weight_bits) *x = *xq;
  }
}

/* A layer whose inputs do not change with the step has one current. */
static int steps_of(const picture_tracer *t, int l)
{
  return l == FX_D1 || (l == FX_C1 && t->exact->planes) ? 1 : t->exact->scene->net.steps;
}

static void add_layers(const picture_tracer *t, const point *p, sf_current_row row[SF_LAYERS])
{
  const fx_net *net = &t->exact->scene->net;
  double f[INPUTS_MAX];
  inputs(t->real, t->real_dir, p, f);
  for (int l = fx_net_first_layer(net); l < SF_LAYERS; l++)
    for (int step = 0; step < steps_of(t, l); step++) {
      current_error c[SF_LANES] = {{0}};
      for (int i = 0; i < fx_layer_rows(&net->layer[l]); i++) {
        double x, xq;
        input(t, l, step, i, f, p->fq, &x, &xq);
        if (x == 0 && xq == 0) continue;
        for (int o = 0; o < net->layer[l].n_out; o++)
          add_product(&c[o], t->real->w[l][i * SF_LANES + o], x, net->layer[l].w[i * SF_LANES + o], xq);
      }
      for (int o = 0; o < net->layer[l].n_out; o++) add_current(&row[l], c[o]);
    }
}

/* ---- the ray ---- */

static void count_flips(const picture_tracer *t, const sf_exact_out *out, picture_ray *r)
{
  const fx_net *net = &t->exact->scene->net;
  for (int s = 0; s < FX_SPIKING; s++) {
    const int l = fx_spiking_layers[s];
    r->decisions[l] += (uint64_t)net->layer[l].n_out * (uint64_t)net->steps;
    for (int step = 0; step < net->steps; step++)
      for (int w = 0; w < SF_SPIKE_WORDS; w++)
        r->flips[l] += (uint64_t)__builtin_popcountll(t->trace.spikes[l][step][w] ^ out->spikes[l][step][w]);
  }
}

/* The sample at which light fell from `left` to `behind`: does the net see it? */
static bool take(const picture_tracer *t, light *l, double behind, double weight_stop)
{
  const fx_scene *scene = t->exact->scene;
  const bool taken = !t->exact->planes || l->left - behind > weight_stop;
  l->left = behind;
  l->taken += taken;
  l->ended = behind <= scene->trans_stop || l->taken >= (uint64_t)scene->max_samples;
  return taken;
}

static bool core_takes(picture_tracer *t, point *p, light *l, fx_pixel *pixel)
{
  const fx_scene *scene = t->exact->scene;
  uint32_t sigma;
  const double core[3] = {p->core[0], p->core[1], p->core[2]};
  if (l->ended || !occupied(scene, core, p->n)) return false;
  if (t->exact->planes) {
    sigma = fx_tensorf_density(&scene->tensorf, p->core, NULL);
  } else {
    trace_core(t, p);
    sigma = p->fixed.sigma;
  }
  fx_composite_weight(pixel, sigma, fx_delta(scene, p->n), 0);
  return take(t, l, pixel->transmittance, scene->tensorf.weight_stop);
}

/* The sample of the row's ray: its part of the colour, and its flips. */
static bool row_takes(picture_tracer *t, point *p, light *l, picture_ray *r, double colour[3])
{
  sf_exact_out out;
  double sigma;
  if (l->ended || !occupied(t->exact->scene, p->pos, p->n)) return false;
  if (t->exact->planes) {
    sigma = sf_exact_planes_sigma(t->exact, p->pos);
  } else {
    net(t, p, &out);
    sigma = out.sigma;
  }
  const double left = l->left, behind = sf_exact_behind(t->exact, p->n, left, sigma);
  if (!take(t, l, behind, t->exact->weight_stop)) return false;
  if (t->exact->planes) net(t, p, &out);
  for (int o = 0; o < 3; o++) colour[o] += (left - behind) * out.colour[o];
  trace_core(t, p);
  count_flips(t, &out, r);
  if (t->real) add_layers(t, p, r->current);
  return true;
}

static void march(picture_tracer *t, picture_ray *r, double colour[3])
{
  const fx_scene *scene = t->exact->scene;
  light row = {.left = 1 << SF_TRANS_FRAC}, core = row;
  fx_pixel pixel;
  fx_composite_begin(&pixel);
  for (int32_t n = 0; n < t->ray.count && !(row.ended && core.ended); n++) {
    point p;
    locate(t, n, &p);
    const bool by_core = core_takes(t, &p, &core, &pixel), by_row = row_takes(t, &p, &row, r, colour);
    r->points += by_core || by_row;
    r->sample_flips += by_core != by_row;
  }
  r->samples = row.taken;
  for (int o = 0; o < 3; o++) colour[o] += row.left * scene->background[o];
}

sf_status picture_trace(picture_tracer *t, const sf_picture_job *job, uint64_t i, picture_ray *r)
{
  double colour[3] = {0};
  fx_pixel core;
  SF_TRY(begin(t, job, i));
  march(t, r, colour);
  for (int o = 0; o < 3; o++) r->rgb[o] = fmin(ldexp(colour[o], -SF_TRANS_FRAC - SF_COLOUR_FRAC), 1);
  if (t->exact->mask) return sf_ok();
  SF_TRY(fx_render_ray(job->scene, &t->ray, NULL, NULL, &core, NULL));
  for (int o = 0; o < 3; o++)
    if (colour[o] != (double)core.colour[o])
      return sf_fail(SF_E_DIFFERENCE, "%s: ray %llu: the evaluation with no block replaced is %.0f, the core's %.0f",
                     job->name, (unsigned long long)i, colour[o], (double)core.colour[o]);
  return sf_ok();
}
