/* What each block of the fixed-point core costs: the same rays with one block at a time in double precision. */
#include "energy/energy.h"
#include "base/rng.h"
#include "bounds/exact.h"
#include "src/fx/march.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const block_name[SF_EXACT_ROWS] = {"none: the fixed-point core",
                                                      "ray lattice: positions, step",
                                                      "grid: position and feature",
                                                      "grid: int8 entries",
                                                      "D1 weights",
                                                      "D2 weights",
                                                      "C1 weights",
                                                      "C2 weights",
                                                      "C3 weights",
                                                      "direction features",
                                                      sf_h_text,
                                                      "leak k and threshold",
                                                      "membranes",
                                                      "2^y and its argument",
                                                      "sigmoid and its argument",
                                                      "output integrators",
                                                      "exp(-x), transmittance",
                                                      "all: the float model"};

/* All that one ray yields. */
typedef struct ray_result {
  double rgb[3];
  uint64_t samples, flips[SF_LAYERS], decisions[SF_LAYERS];
  sf_current_row current[SF_LAYERS];
  sf_status status;
} ray_result;

/* One ray of one row. */
typedef struct tracer {
  const sf_exact *exact; /* the row's blocks */
  const sf_exact *real;  /* all blocks, for the errors of currents; NULL in all rows but the first */
  fx_ray ray;
  double dir[FX_SH]; /* unrounded direction features, LSB */
  double unit[3];    /* direction */
  int32_t core_base[SF_LANES];
  double base[SF_LANES];
  fx_trace trace;
} tracer;

static void ray_pixel(const sf_picture_job *job, uint64_t i, int *x, int *y)
{
  *x = (int)sf_random_below(job->seed, 1, i, (uint64_t)job->view->camera.width);
  *y = (int)sf_random_below(job->seed, 2, i, (uint64_t)job->view->camera.height);
}

static sf_status begin(tracer *t, const sf_picture_job *job, uint64_t i)
{
  int x, y;
  float origin[3], direction[3], sh[SF_DIR_FEATURES];
  double dir[FX_SH];
  ray_pixel(job, i, &x, &y);
  sf_dataset_ray(job->data, job->view, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
  SF_TRY(sf_pixel_ray(job->scene, job->data, job->view, x, y, &t->ray));
  sf_sh4(direction, sh);
  sf_scales_round_direction(&job->model->scales, sh, SF_DIR_FEATURES); /* as a fine-tuned model sees them */
  for (int a = 0; a < 3; a++) t->unit[a] = direction[a];
  for (int j = 0; j < SF_DIR_FEATURES; j++) {
    t->dir[j] = sh[j] / job->scene->units.dir_scale;
    dir[j] = sf_exact_is(t->exact, SF_EXACT_DIRECTION) ? t->dir[j] : t->ray.dir[j];
  }
  sf_exact_direction(t->exact, dir, t->base);
  fx_net_direction(&job->scene->net, t->ray.dir, t->core_base, NULL);
  return sf_ok();
}

/* Sample n: the core's position, and the row's. */
static void position(const tracer *t, int32_t n, uint32_t core[3], double pos[3])
{
  for (int a = 0; a < 3; a++) {
    core[a] = (uint32_t)(fx_ray_at(t->exact->scene, &t->ray, n, a) >> (FX_RAY_FRAC - SF_POS_FRAC));
    pos[a] = core[a];
    if (!sf_exact_is(t->exact, SF_EXACT_LATTICE)) continue;
    const double at =
        ldexp((double)t->ray.origin[a], SF_POS_FRAC - FX_RAY_FRAC) + t->unit[a] * sf_exact_distance(t->exact, n);
    pos[a] = fmin(fmax(at, 0), 16777215);
  }
}

static bool occupied(const fx_scene *scene, const double pos[3], int32_t n)
{
  int64_t p[3];
  for (int a = 0; a < 3; a++) p[a] = (int64_t)ldexp(pos[a], FX_RAY_FRAC - SF_POS_FRAC);
  return fx_occupied(scene, p, n);
}

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
static void input(const tracer *t, int l, int step, int i, const double *f, const int16_t *fq, double *x, double *xq)
{
  const int h = i - SF_DIR_FEATURES, before = l == FX_D2 ? FX_D1 : l - 1;
  if (l == FX_D1) {
    *x = f[i], *xq = fq[i];
  } else if (l != FX_C1) {
    *x = *xq = (double)(t->trace.spikes[before][step][i / 64] >> i % 64 & 1);
  } else if (h < 0) {
    *x = t->dir[i], *xq = t->ray.dir[i];
  } else {
    *x = ldexp(t->trace.current[FX_D2][step][1 + h], -SF_H_SHIFT), *xq = floor(*x);
    if (t->exact->model->scales.weight_bits) *x = *xq;
  }
}

static void add_layers(const tracer *t, const double pos[3], const int16_t *fq, sf_current_row row[SF_LAYERS])
{
  const fx_net *net = &t->exact->scene->net;
  double f[SF_FEATURE_MAX];
  sf_exact_features(t->real, pos, f);
  for (int l = 0; l < SF_LAYERS; l++)
    for (int step = 0; step < (l == FX_D1 ? 1 : net->steps); step++) {
      current_error c[SF_LANES] = {{0}};
      for (int i = 0; i < net->layer[l].n_in; i++) {
        double x, xq;
        input(t, l, step, i, f, fq, &x, &xq);
        if (x == 0 && xq == 0) continue;
        for (int o = 0; o < net->layer[l].n_out; o++)
          add_product(&c[o], t->real->w[l][i * SF_LANES + o], x, net->layer[l].w[i * SF_LANES + o], xq);
      }
      for (int o = 0; o < net->layer[l].n_out; o++) add_current(&row[l], c[o]);
    }
}

static void count_flips(const tracer *t, const sf_exact_out *out, ray_result *r)
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

static void evaluate(tracer *t, const uint32_t core[3], const double pos[3], sf_exact_out *out, ray_result *r)
{
  const fx_scene *scene = t->exact->scene;
  double f[SF_FEATURE_MAX];
  int16_t fq[SF_FEATURE_MAX];
  fx_out ignored;
  sf_exact_features(t->exact, pos, f);
  sf_exact_sample(t->exact, f, t->base, out);
  fx_grid_features(&scene->grid, core, fq, NULL);
  fx_net_sample(&scene->net, fq, t->core_base, &ignored, &t->trace, NULL);
  count_flips(t, out, r);
  if (t->real) add_layers(t, pos, fq, r->current);
}

static void march(tracer *t, ray_result *r, double colour[3])
{
  const fx_scene *scene = t->exact->scene;
  double transmittance = 1 << SF_TRANS_FRAC;
  for (int32_t n = 0; n < t->ray.count; n++) {
    uint32_t core[3];
    double pos[3];
    sf_exact_out out;
    position(t, n, core, pos);
    if (!occupied(scene, pos, n)) continue;
    evaluate(t, core, pos, &out, r);
    const double behind = sf_exact_behind(t->exact, n, transmittance, out.sigma);
    for (int o = 0; o < 3; o++) colour[o] += (transmittance - behind) * out.colour[o];
    transmittance = behind;
    r->samples++;
    if (transmittance <= scene->trans_stop || r->samples >= (uint64_t)scene->max_samples) break;
  }
  for (int o = 0; o < 3; o++) colour[o] += transmittance * scene->background[o];
}

static sf_status trace_ray(tracer *t, const sf_picture_job *job, uint64_t i, ray_result *r)
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

static sf_status trace_rays(const sf_picture_job *job, const sf_exact *exact, const sf_exact *real, ray_result *result)
{
  memset(result, 0, job->rays * sizeof *result);
#pragma omp parallel
  {
    tracer *t = calloc(1, sizeof *t);
    if (t) t->exact = exact, t->real = real;
#pragma omp for schedule(dynamic, 8)
    for (uint64_t i = 0; i < job->rays; i++)
      result[i].status = t ? trace_ray(t, job, i, &result[i]) : sf_fail(SF_E_MEMORY, "no memory for a ray");
    free(t);
  }
  for (uint64_t i = 0; i < job->rays; i++) SF_TRY(result[i].status);
  return sf_ok();
}

static double psnr(double squares, uint64_t n)
{
  return squares > 0 ? -10 * log10(squares / (double)n) : (double)INFINITY;
}

static double photograph(const sf_picture_job *job, uint64_t i, int o)
{
  int x, y;
  ray_pixel(job, i, &x, &y);
  const uint16_t *p = job->view->image.rgba + 4 * ((size_t)y * (size_t)job->view->image.width + (size_t)x);
  const double alpha = p[3] / 65535.0;
  return p[o] / 65535.0 * alpha + job->scene->background[o] / 65536.0 * (1 - alpha);
}

static sf_exact_row summarise(const sf_picture_job *job, const ray_result *result, const ray_result *fixed)
{
  sf_exact_row row = {.psnr_truth = NAN};
  double squares = 0, truth = 0;
  for (uint64_t i = 0; i < job->rays; i++) {
    for (int o = 0; o < 3; o++) {
      squares += pow(result[i].rgb[o] - fixed[i].rgb[o], 2);
      if (job->view->image.rgba) truth += pow(result[i].rgb[o] - photograph(job, i, o), 2);
    }
    for (int l = 0; l < SF_LAYERS; l++) row.flips[l] += result[i].flips[l], row.decisions[l] += result[i].decisions[l];
  }
  row.psnr = psnr(squares, 3 * job->rays);
  if (job->view->image.rgba) row.psnr_truth = psnr(truth, 3 * job->rays);
  return row;
}

static void sum_currents(const sf_picture_job *job, const ray_result *result, sf_picture_budget *budget)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    sf_current_row *sum = &budget->current[l];
    for (uint64_t i = 0; i < job->rays; i++) {
      const sf_current_row *one = &result[i].current[l];
      if (one->measured >= sum->measured) sum->measured = one->measured, sum->bound = one->bound;
      sum->ratio = fmax(sum->ratio, one->ratio);
      sum->rms += one->rms, sum->currents += one->currents;
    }
    sum->rms = sum->currents ? sqrt(sum->rms / (double)sum->currents) : 0;
  }
  for (uint64_t i = 0; i < job->rays; i++) budget->samples += result[i].samples;
}

static sf_status make_row(const sf_picture_job *job, int row, ray_result *result, ray_result *fixed,
                          sf_picture_budget *budget)
{
  const uint32_t all = (1u << SF_EXACT_BLOCKS) - 1;
  const uint32_t mask = row == 0 ? 0 : row == SF_EXACT_ROWS - 1 ? all : 1u << (row - 1);
  sf_exact exact, real = {0};
  if (job->tick && !job->tick(job->user, row))
    return sf_fail(SF_E_STOPPED, "stopped after %d of %d pictures", row, SF_EXACT_ROWS);
  SF_TRY(sf_exact_open(&exact, job->scene, job->model, mask));
  sf_status status = row == 0 ? sf_exact_open(&real, job->scene, job->model, all) : sf_ok();
  if (status.code == SF_OK) status = trace_rays(job, &exact, row == 0 ? &real : NULL, result);
  sf_exact_close(&exact), sf_exact_close(&real);
  SF_TRY(status);
  if (row == 0) {
    memcpy(fixed, result, job->rays * sizeof *fixed);
    sum_currents(job, result, budget);
  }
  budget->row[row] = summarise(job, result, fixed);
  budget->row[row].block = block_name[row];
  return sf_ok();
}

sf_status sf_picture_budget_check(const sf_picture_job *job)
{
  const sf_config *c = &job->model->config;
  const fx_layer *l = job->scene->net.layer;
  const bool same = c->net == SF_NET_SNN && l[FX_D1].n_in == 2 * c->levels && l[FX_D1].n_out == c->hidden &&
                    l[FX_D2].n_out == SF_DENSITY_OUT && l[FX_C1].n_in == SF_DIR_FEATURES + SF_GEO_FEATURES &&
                    l[FX_C1].n_out == c->hidden && l[FX_C2].n_out == c->hidden &&
                    2 * job->scene->grid.entries == (int64_t)job->model->param[SF_P_GRID].size;
  if (!same)
    return sf_fail(SF_E_UNSUPPORTED, "%s: its sizes are not those of the model it is compared with", job->name);
  for (int i = 0; i < SF_LAYERS; i++)
    if (!(job->scene->units.current_scale[i] > 0))
      return sf_fail(SF_E_UNSUPPORTED, "%s: the unit of layer %s is not known", job->name, fx_layer_name(i));
  for (int i = 0; i < SF_LAYERS; i++)
    if (!sf_exact_resembles(job->scene, job->model, i))
      return sf_fail(SF_E_UNSUPPORTED, "%s: the weights of layer %s are not those of the model it is compared with",
                     job->name, fx_layer_name(i));
  return sf_ok();
}

sf_status sf_picture_budget_make(const sf_picture_job *job, sf_picture_budget *budget)
{
  *budget = (sf_picture_budget){.rays = job->rays};
  SF_TRY(sf_picture_budget_check(job));
  ray_result *result = calloc(2 * job->rays, sizeof *result);
  if (!result) return sf_fail(SF_E_MEMORY, "no memory for %llu rays", (unsigned long long)job->rays);
  sf_status status = sf_ok();
  for (int row = 0; row < SF_EXACT_ROWS && status.code == SF_OK; row++)
    status = make_row(job, row, result, result + job->rays, budget);
  free(result);
  return status;
}
