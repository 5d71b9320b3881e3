/* PATA's losses of one ray and their gradients with respect to every prefix's density and colour.
 * Batch norms of the paper are means over rays here, so that rays stay independent (docs/model.md). */
#include "render/composite.h"
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const float g0 = 5e-5f, g1 = 5e-2f, g2 = 1e-6f;
static const float tail_log = -0.10536052f; /* ln 0.9: the tail of a ray begins where less light is left */

sf_status sf_ray_work_create(sf_ray_work *w, int samples)
{
  size_t n = (size_t)samples, total = n * (SF_T_MAX * 8 + 6 * 3 + 2);
  float *at = w->memory = sf_aligned_alloc(total * sizeof(float));
  if (!at) return sf_fail(SF_E_MEMORY, "train: no memory for a ray of %d samples", samples);
  for (int t = 0; t < SF_T_MAX; t++) {
    w->sigma[t] = at, at += n;
    w->dsigma[t] = at, at += n;
    w->colour[t] = at, at += 3 * n;
    w->dcolour[t] = at, at += 3 * n;
  }
  for (int i = 0; i < 6; i++) w->spare[i] = at, at += 3 * n;
  w->place = at, w->span = at + n;
  return sf_ok();
}

/* A prefix of the ray as composited. */
typedef struct image {
  float rgb[3], behind;
  float *weight;
} image;

static image composite(const sf_ray *ray, int prefix, const float *delta, sf_ray_work *w, float *weight)
{
  image im = {.weight = weight};
  im.behind = sf_composite_weights(ray->count, w->sigma[prefix - 1], delta, weight);
  sf_composite_colour(ray->count, weight, w->colour[prefix - 1], im.behind, ray->background, im.rgb);
  return im;
}

static float dot3(const float *a, const float *b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double squared_error(const float *a, const float *b)
{
  double sum = 0;
  for (int c = 0; c < 3; c++) sum += (double)(a[c] - b[c]) * (a[c] - b[c]);
  return sum / 3;
}

/* Spreads the gradient of a prefix's rgb to its samples. */
static void push(const sf_ray *ray, int prefix, const float *delta, const image *im, const float grgb[3],
                 sf_ray_work *w)
{
  const int n = ray->count;
  float *g = w->spare[5], *dcolour = w->dcolour[prefix - 1];
  const float *colour = w->colour[prefix - 1];
  for (int s = 0; s < n; s++) {
    g[s] = dot3(grgb, colour + 3 * s);
    for (int c = 0; c < 3; c++) dcolour[3 * s + c] += im->weight[s] * grgb[c];
  }
  sf_composite_backward(n, im->weight, im->behind, delta, g, dot3(grgb, ray->background), w->dsigma[prefix - 1]);
}

static void add_mse(const sf_ray *ray, const image *im, float weight, float grgb[3])
{
  for (int c = 0; c < 3; c++) grgb[c] += weight * 2 / 3 * (im->rgb[c] - ray->target[c]);
}

/* g0 ||C - gt||_2 + g1 (1 - cos(C, gt)); returns the value. */
static double add_regular(const sf_ray *ray, const image *im, float inverse_rays, float grgb[3])
{
  const float *rgb = im->rgb, *gt = ray->target;
  float norm = sqrtf((float)(3 * squared_error(rgb, gt)));
  double value = g0 * norm;
  if (norm > 1e-6f)
    for (int c = 0; c < 3; c++) grgb[c] += inverse_rays * g0 * (rgb[c] - gt[c]) / norm;
  float a = sqrtf(dot3(rgb, rgb)), b = sqrtf(dot3(gt, gt));
  if (a < 1e-3f || b < 1e-3f) return value; /* the angle of black is undefined */
  float cosine = dot3(rgb, gt) / (a * b);
  for (int c = 0; c < 3; c++) grgb[c] -= inverse_rays * g1 * (gt[c] / (a * b) - cosine * rgb[c] / (a * a));
  return value + g1 * (1 - cosine);
}

/* g2 sum log(1 + 2 sigma). */
static double add_sparsity(int n, const float *sigma, float inverse_rays, float *dsigma)
{
  double value = 0;
  for (int s = 0; s < n; s++) {
    value += log1pf(2 * sigma[s]);
    dsigma[s] += inverse_rays * g2 * 2 / (1 + 2 * sigma[s]);
  }
  return g2 * value;
}

/* The tail of a ray that becomes opaque: samples where less than nine tenths of the light are left, in a surface and
 * behind it. Each counts by what is left of the way from there to opaque, 1 down to 0. What lies before the tail is
 * held constant, so nothing thickens in front of a surface. The slope of a sample is weighed by its alpha, so what is
 * empty is not filled. */
static double add_tail(float stop, int n, const float *sigma, const float *delta, float weight, float *dsigma)
{
  const float way = tail_log - stop;
  float light = 0; /* its logarithm */
  double value = 0;
  int first = -1, end = 0;
  for (; end < n && light > stop; end++) {
    if (first < 0 && light < tail_log) first = end;
    if (first >= 0) value += (light - stop) / way;
    light -= delta[end] * sigma[end];
  }
  /* The last sample counts as opaque also where the kernels round its density otherwise than for sf_batch_compact. */
  if (first < 0 || light > stop + 1e-3f) return 0;
  for (int s = first; s < end; s++)
    dsigma[s] += weight * delta[s] * (float)(end - 1 - s) / way * expm1f(-sigma[s] * delta[s]);
  return value;
}

static float norm(int n, const float *x)
{
  double sum = 0;
  for (int i = 0; i < n; i++) sum += (double)x[i] * x[i];
  return (float)sqrt(sum);
}

/* ||w tail|| / ||W|| + ||c tail|| / ||C_T|| of prefix t, whose gradient is scaled by `weight`. */
static double add_extra(const sf_loss_plan *plan, const sf_ray *ray, const float *delta, int t, const image *full,
                        float weight, sf_ray_work *w, sf_loss_sums *sums)
{
  const int n = ray->count, T = plan->steps, left = T - t;
  const float keep_s = powf(1 - plan->k_sigma, (float)left), keep_c = powf(1 - plan->k_colour, (float)left);
  float *tail = w->spare[1], *wt = w->spare[2], *g = w->spare[3], *gs = w->spare[4];
  if (left == 0) return 0;
  const float *full_s = w->sigma[T - 1], *part_s = w->sigma[t - 1];
  const float *full_c = w->colour[T - 1], *part_c = w->colour[t - 1];
  double value = 0;
  for (int s = 0; s < n; s++) tail[s] = fmaxf(full_s[s] - keep_s * part_s[s], 0);
  float behind = sf_composite_weights(n, tail, delta, wt);
  const float a = norm(n, wt), b = norm(n, full->weight);
  if (a > 1e-8f && b > 1e-4f) {
    value += a / b;
    memset(gs, 0, n * sizeof *gs);
    for (int s = 0; s < n; s++) g[s] = weight * wt[s] / (a * b);
    sf_composite_backward(n, wt, behind, delta, g, 0, gs);
    for (int s = 0; s < n; s++) {
      if (tail[s] == 0) continue;
      w->dsigma[T - 1][s] += gs[s];
      w->dsigma[t - 1][s] -= keep_s * gs[s];
      sums->g_sigma_leak += (double)gs[s] * part_s[s] * left * powf(1 - plan->k_sigma, (float)(left - 1));
    }
    for (int s = 0; s < n; s++) g[s] = -weight * a * full->weight[s] / (b * b * b);
    sf_composite_backward(n, full->weight, full->behind, delta, g, 0, w->dsigma[T - 1]);
  }
  float ct[3] = {0}, part[3] = {0};
  for (int s = 0; s < n; s++)
    for (int c = 0; c < 3; c++) {
      ct[c] += full->weight[s] * (full_c[3 * s + c] - keep_c * part_c[3 * s + c]);
      part[c] += full->weight[s] * part_c[3 * s + c];
    }
  const float na = norm(3, ct), nb = norm(3, full->rgb);
  if (na < 1e-8f || nb < 1e-3f) return value;
  float gt[3], gfull[3];
  for (int c = 0; c < 3; c++) {
    gt[c] = weight * ct[c] / (na * nb);
    gfull[c] = -weight * na * full->rgb[c] / (nb * nb * nb);
  }
  for (int s = 0; s < n; s++) {
    g[s] = 0;
    for (int c = 0; c < 3; c++) {
      g[s] += gt[c] * (full_c[3 * s + c] - keep_c * part_c[3 * s + c]);
      w->dcolour[T - 1][3 * s + c] += full->weight[s] * gt[c];
      w->dcolour[t - 1][3 * s + c] -= keep_c * full->weight[s] * gt[c];
    }
  }
  sums->g_colour_leak += dot3(gt, part) * left * powf(1 - plan->k_colour, (float)(left - 1));
  sf_composite_backward(n, full->weight, full->behind, delta, g, 0, w->dsigma[T - 1]);
  push(ray, T, delta, full, gfull, w);
  return value + na / nb;
}

/* L_distill between C_T and C_{t_r}: both are pulled (the paper detaches neither). */
static void add_distillation(const sf_loss_plan *p, const image *full, const image *im, float gfull[3], float grgb[3],
                             sf_loss_sums *sums)
{
  sums->distill += squared_error(im->rgb, full->rgb);
  for (int c = 0; c < 3; c++) {
    const float g = p->distill * p->inverse_rays * 2 / 3 * (im->rgb[c] - full->rgb[c]);
    grgb[c] += g;
    gfull[c] -= g;
  }
}

/* The terms that hang on prefix t alone. */
static void add_prefix(const sf_loss_plan *p, const sf_ray *ray, const float *delta, int t, const image *im,
                       float grgb[3], sf_ray_work *w, sf_loss_sums *sums)
{
  sums->prefix[t - 1] += squared_error(im->rgb, ray->target);
  add_mse(ray, im, p->inverse_rays * p->weight[t - 1], grgb);
  if (t != p->regular_at) return;
  sums->regular += add_regular(ray, im, p->inverse_rays, grgb);
  sums->regular += add_sparsity(ray->count, w->sigma[t - 1], p->inverse_rays, w->dsigma[t - 1]);
  if (p->distortion > 0)
    sums->distortion += sf_distortion_add(ray->count, im->weight, im->behind, delta, p->distortion * p->inverse_rays, w,
                                          w->dsigma[t - 1]);
  if (p->opaque > 0)
    sums->tail += add_tail(p->stop, ray->count, w->sigma[t - 1], delta, p->opaque * p->inverse_rays, w->dsigma[t - 1]);
}

void sf_loss_ray(const sf_loss_plan *p, const sf_ray *ray, const float *delta, sf_ray_work *w, sf_loss_sums *sums)
{
  const int T = p->steps;
  for (int t = 0; t < T; t++) {
    memset(w->dsigma[t], 0, ray->count * sizeof(float));
    memset(w->dcolour[t], 0, 3 * ray->count * sizeof(float));
  }
  const image full = composite(ray, T, delta, w, w->spare[0]);
  float gfull[3] = {0};
  for (int t = 1; t < T; t++) {
    if (!sf_loss_needs(p, t)) continue;
    const image im = composite(ray, t, delta, w, w->spare[1]);
    float grgb[3] = {0};
    add_prefix(p, ray, delta, t, &im, grgb, w, sums);
    if (p->full && t == p->t_r && p->distill > 0) add_distillation(p, &full, &im, gfull, grgb, sums);
    push(ray, t, delta, &im, grgb, w);
  }
  add_prefix(p, ray, delta, T, &full, gfull, w, sums);
  push(ray, T, delta, &full, gfull, w);
  if (!p->full || p->extra == 0) return;
  const float scale = p->extra * p->inverse_rays;
  sums->extra_floor += add_extra(p, ray, delta, p->t_f, &full, scale * (float)(1 - p->d), w, sums);
  if (p->t_c != p->t_f) sums->extra_ceil += add_extra(p, ray, delta, p->t_c, &full, scale * (float)p->d, w, sums);
}

double sf_loss_total(const sf_loss_plan *p, const sf_loss_sums *mean, double e_tau)
{
  double loss = mean->regular + p->distortion * mean->distortion + p->opaque * mean->tail;
  for (int t = 0; t < p->steps; t++) loss += p->weight[t] * mean->prefix[t];
  if (!p->full) return loss;
  const double extra = (1 - p->d) * mean->extra_floor + p->d * mean->extra_ceil + e_tau;
  return loss + p->distill * mean->distill + p->extra * extra;
}
