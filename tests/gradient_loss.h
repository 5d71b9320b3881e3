/* The trainer's loss of one iteration: the losses of a ray as docs/model.md has them, over the batch as it was drawn.
 */
#ifndef SF_TESTS_GRADIENT_LOSS_H
#define SF_TESTS_GRADIENT_LOSS_H
#include "gradient_oracle.h"

/* ---- the losses of a ray ---- */

typedef struct oracle_image {
  dual rgb[3], weight[RAY_SAMPLES];
} oracle_image;

static inline void oracle_composite(const oracle_ray *ray, const dual *sigma, const dual (*colour)[3],
                                    const float *background, oracle_image *im)
{
  dual light = 1;
  memset(im->rgb, 0, sizeof im->rgb);
  for (int s = 0; s < ray->count; s++) {
    const dual left = light * cexp(-sigma[s] * ray->delta[s]);
    im->weight[s] = light - left;
    light = left;
    for (int c = 0; c < 3 && colour; c++) im->rgb[c] += im->weight[s] * colour[s][c];
  }
  for (int c = 0; c < 3 && background; c++) im->rgb[c] += light * (double)background[c];
}

static inline dual oracle_norm(const dual *x, int n)
{
  dual sum = 0;
  for (int i = 0; i < n; i++) sum += x[i] * x[i];
  return creal(sum) > 0 ? csqrt(sum) : 0;
}

static inline dual oracle_error(const dual a[3], const dual b[3])
{
  const dual d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / 3;
}

/* 5e-5 ||C - gt|| + 5e-2 (1 - cos(C, gt)) + 1e-6 sum log(1 + 2 sigma). */
static inline dual oracle_regular(const oracle_ray *ray, int step, const oracle_image *im, const dual gt[3])
{
  dual sum = 5e-5 * csqrt(3 * oracle_error(im->rgb, gt)), dot = 0;
  for (int c = 0; c < 3; c++) dot += im->rgb[c] * gt[c];
  const dual a = oracle_norm(im->rgb, 3), b = oracle_norm(gt, 3);
  if (creal(a) >= 1e-3 && creal(b) >= 1e-3) sum += 5e-2 * (1 - dot / (a * b));
  for (int s = 0; s < ray->count; s++) sum += 1e-6 * clog(1 + 2 * ray->sigma[step][s]);
  return sum;
}

/* What is left of the way to opaque, of each sample where less than nine tenths of the light are left. The light in
 * front of the first is a constant, and slopes are weighed by alpha. */
static inline dual oracle_tail(const oracle_ray *ray, int step, double stop)
{
  const double tail = log(0.9);
  dual light = 0, sum = 0;
  for (int s = 0; s < ray->count && creal(light) > stop; s++) {
    if (creal(light) < tail) sum += (light - stop) / (tail - stop);
    const dual depth = ray->sigma[step][s] * ray->delta[s];
    const double alpha = creal(light) < tail ? 1 - exp(-creal(depth)) : 0;
    light -= creal(depth) + alpha * (depth - creal(depth));
  }
  return creal(light) > stop + 1e-3 ? 0 : sum;
}

/* Mip-NeRF 360, eq. 15, pair by pair: sum w w |s - s| of the middles, and a third of sum w^2 (end - start). */
static inline dual oracle_distortion(const oracle_ray *ray, const oracle_image *im)
{
  dual sum = 0;
  for (int i = 0; i < ray->count; i++) {
    const double *a = ray->edge[i];
    sum += im->weight[i] * im->weight[i] * (a[1] - a[0]) / 3;
    for (int j = 0; j < ray->count; j++) {
      const double *b = ray->edge[j];
      sum += im->weight[i] * im->weight[j] * fabs((a[0] + a[1]) / 2 - (b[0] + b[1]) / 2);
    }
  }
  return sum;
}

/* What steps behind prefix t add: ||w(tail)|| / ||W|| + ||tail of C|| / ||C_T||. */
static inline dual oracle_extra(const oracle *o, const oracle_ray *ray, int t, const oracle_image *full)
{
  const int last = o->plan->steps - 1, left = o->plan->steps - t;
  if (!left) return 0;
  const bool decodes = sf_model_decodes(&o->t->model);
  const dual keep_s = decodes ? 1 : cpow(1 - leak(o, 1), left), keep_c = cpow(1 - leak(o, 4), left);
  static dual tail[RAY_SAMPLES];
  static oracle_image part;
  dual sum = 0, colour[3] = {0};
  for (int s = 0; s < ray->count; s++) {
    tail[s] = positive(ray->sigma[last][s] - keep_s * ray->sigma[t - 1][s]);
    for (int c = 0; c < 3; c++)
      colour[c] += full->weight[s] * (ray->colour[last][s][c] - keep_c * ray->colour[t - 1][s][c]);
  }
  oracle_composite(ray, tail, NULL, NULL, &part);
  const dual a = oracle_norm(part.weight, ray->count), b = oracle_norm(full->weight, ray->count);
  if (creal(a) > 1e-8 && creal(b) > 1e-4) sum += a / b;
  const dual na = oracle_norm(colour, 3), nb = oracle_norm(full->rgb, 3);
  if (creal(na) >= 1e-8 && creal(nb) >= 1e-3) sum += na / nb;
  return sum;
}

static inline dual oracle_losses(const oracle *o, const sf_ray *pixel, const oracle_ray *ray)
{
  const sf_loss_plan *p = o->plan;
  const int T = p->steps;
  static oracle_image full, im;
  const dual gt[3] = {pixel->target[0], pixel->target[1], pixel->target[2]};
  dual sum = 0;
  oracle_composite(ray, ray->sigma[T - 1], ray->colour[T - 1], pixel->background, &full);
  for (int t = 1; t <= T; t++) {
    if (!sf_loss_needs(p, t)) continue;
    oracle_composite(ray, ray->sigma[t - 1], ray->colour[t - 1], pixel->background, &im);
    sum += (double)p->weight[t - 1] * oracle_error(im.rgb, gt);
    if (t == p->regular_at)
      sum += oracle_regular(ray, t - 1, &im, gt) + (double)p->opaque * oracle_tail(ray, t - 1, p->stop) +
             (double)p->distortion * oracle_distortion(ray, &im);
    if (p->full && t == p->t_r) sum += (double)p->distill * oracle_error(im.rgb, full.rgb);
  }
  if (p->full && p->extra > 0)
    sum += p->extra * ((1 - p->d) * oracle_extra(o, ray, p->t_f, &full) + p->d * oracle_extra(o, ray, p->t_c, &full));
  return sum;
}

/* ---- the batch as it was drawn ---- */

static inline double oracle_away(const oracle *o, const sf_ray *from, const double x[3])
{
  const sf_steps *box = &o->t->intervals;
  double away = 0;
  for (int a = 0; a < 3; a++) {
    const double at = (double)box->low[a] + x[a] * ((double)box->high[a] - (double)box->low[a]);
    away += pow(at - (double)from->origin[a], 2);
  }
  return sqrt(away);
}

/* The interval of a sample at x, whose length is known. */
static inline void oracle_edges(const oracle *o, const sf_ray *from, const double x[3], oracle_ray *ray, int s)
{
  for (int end = 0; end < 2; end++)
    ray->edge[s][end] = (oracle_away(o, from, x) + (end - 0.5) * ray->delta[s]) / (double)o->t->distortion_unit;
}

/* A sample near a camera learns slower: x is its position. Where its loss stands is unchanged. */
static inline void oracle_slow(const oracle *o, const sf_ray *from, const double x[3], oracle_ray *ray, int s)
{
  const double weight = pow(oracle_away(o, from, x) / (double)o->t->near_camera, 2);
  if (!(weight < 1)) return;
  if (o->slowed) ++*o->slowed;
  for (int t = 0; t < o->plan->steps; t++) {
    ray->sigma[t][s] = with_slope(creal(ray->sigma[t][s]), weight, ray->sigma[t][s]);
    for (int c = 0; c < 3; c++)
      ray->colour[t][s][c] = with_slope(creal(ray->colour[t][s][c]), weight, ray->colour[t][s][c]);
  }
}

/* Density and colour of the samples of ray r; what their firing is charged with. */
static inline dual oracle_grid_ray(const oracle *o, int r, oracle_ray *ray)
{
  const sf_batch *b = &o->t->batch;
  const sf_ray *from = &b->ray[r];
  float sh[SF_DIR_FEATURES];
  dual sum = 0, feature[2 * 16];
  oracle_layer layer[3];
  sf_sh4(from->direction, sh);
  sf_scales_round_direction(&o->t->model.scales, sh, SF_DIR_FEATURES);
  ray->count = from->count;
  for (int s = 0; s < ray->count; s++) {
    const int lane = from->lane + s;
    double x[3];
    for (int a = 0; a < 3; a++) x[a] = b->x[(lane / SF_BLOCK * 3 + a) * SF_BLOCK + lane % SF_BLOCK];
    ray->delta[s] = b->delta[lane];
    oracle_grid(o, x, feature);
    if (o->t->model.config.along)
      oracle_nets_along(o, feature, sh, s, layer, ray, s);
    else
      sum += oracle_nets(o, feature, sh, ray, s);
    oracle_edges(o, from, x, ray, s);
    oracle_slow(o, from, x, ray, s);
  }
  return sum;
}

static inline dual oracle_planes_ray(const oracle *o, int r, oracle_ray *ray)
{
  const sf_vm *vm = o->t->vm;
  const sf_vm_ray_samples *from = &vm->ray[r];
  dual sum = 0, in[SF_DECODER_MAX];
  oracle_layer layer[3];
  int decoded = 0;
  ray->count = from->count;
  for (int s = 0; s < ray->count; s++) {
    double x[3];
    for (int a = 0; a < 3; a++) x[a] = vm->part[from->part].x[3 * (from->first + s) + a];
    ray->delta[s] = o->t->intervals.length[0];
    const dual sigma = oracle_density(o, x);
    for (int t = 0; t < o->plan->steps; t++) {
      ray->sigma[t][s] = sigma;
      memset(ray->colour[t][s], 0, sizeof ray->colour[t][s]);
    }
    if (o->t->batch.hit[r][s / 64] >> s % 64 & 1) {
      oracle_inputs(o, x, o->t->batch.ray[r].direction, in);
      if (o->t->model.config.along)
        oracle_decoder_along(o, in, decoded++, layer, ray, s);
      else
        sum += oracle_decoder(o, in, ray, s);
    }
    oracle_edges(o, &o->t->batch.ray[r], x, ray, s);
    oracle_slow(o, &o->t->batch.ray[r], x, ray, s);
  }
  return sum;
}

/* Total variation of the planes: of each axis twice the mean square of neighbours' differences. */
static inline dual oracle_variation(const oracle *o)
{
  dual sum = 0;
  for (int id = SF_P_DENSITY_PLANE; id < SF_P_BASIS; id++) {
    const sf_param *p = &o->t->model.param[id];
    const int64_t rows = p->shape[0], columns = p->shape[1], n = p->shape[2];
    dual down = 0, right = 0;
    if (p->dims != 3) continue;
    for (int64_t r = 0; r < rows; r++)
      for (int64_t i = 0; i < columns * n; i++) {
        const dual here = parameter(o, id, (size_t)(r * columns * n + i));
        const dual below = r + 1 < rows ? parameter(o, id, (size_t)((r + 1) * columns * n + i)) - here : 0;
        const dual after = i < (columns - 1) * n ? parameter(o, id, (size_t)(r * columns * n + i + n)) - here : 0;
        down += below * below;
        right += after * after;
      }
    sum += 2 * (down / (double)((rows - 1) * columns * n) + right / (double)(rows * (columns - 1) * n));
  }
  return sum;
}

/* The whole loss of an iteration. variation: weight of the planes' total variation. */
static inline dual oracle_loss(const oracle *o, double variation)
{
  static oracle_ray ray;
  const sf_trainer *t = o->t;
  const bool decodes = sf_model_decodes(&t->model);
  dual sum = 0, fired = 0;
  for (int r = 0; r < t->batch.rays; r++) {
    fired += decodes ? oracle_planes_ray(o, r, &ray) : oracle_grid_ray(o, r, &ray);
    sum += oracle_losses(o, &t->batch.ray[r], &ray);
  }
  sum *= (double)o->plan->inverse_rays;
  const int spiking[3] = {0, 2, 3};
  for (int l = decodes; l < 3 && o->plan->extra > 0; l++) sum += (double)o->plan->extra * cexp(1 / leak(o, spiking[l]));
  if (variation > 0) sum += variation * oracle_variation(o);
  return sum + fired;
}
#endif
