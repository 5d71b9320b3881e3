/* What each block of the fixed-point core costs: the same rays with one block at a time in double precision. */
#include "bounds/picture_ray.h"
#include <stdlib.h>
#include <string.h>

/* Of a hash grid, of TensoRF; NULL: it has no such block. */
static const char *const block_name[SF_EXACT_BLOCKS][2] = {
    [SF_EXACT_LATTICE] = {"ray lattice: positions, step", "ray lattice: positions, step"},
    [SF_EXACT_POSITION] = {"grid: position and feature", "position between grid points"},
    [SF_EXACT_PLANE] = {NULL, "plane value"},
    [SF_EXACT_PRODUCT] = {NULL, "appearance: products"},
    [SF_EXACT_ENTRIES] = {"grid: int8 entries", "density: int8 planes and lines"},
    [SF_EXACT_APPEARANCE] = {NULL, "appearance: int8 planes and lines"},
    [SF_EXACT_ACTIVATION] = {NULL, "density: argument, activation, scale"},
    [SF_EXACT_BASIS] = {NULL, "basis matrix: int8 entries"},
    [SF_EXACT_FEATURE] = {NULL, "features"},
    [SF_EXACT_WAVES] = {NULL, "sines and cosines of features"},
    [SF_EXACT_D1] = {"D1 weights", NULL},
    [SF_EXACT_D2] = {"D2 weights", NULL},
    [SF_EXACT_C1] = {"C1 weights", "C1 weights and biases"},
    [SF_EXACT_C2] = {"C2 weights", "C2 weights and biases"},
    [SF_EXACT_C3] = {"C3 weights", "C3 weights and biases"},
    [SF_EXACT_DIRECTION] = {"direction features", "direction, its sines and cosines"},
    [SF_EXACT_H] = {sf_h_text, NULL},
    [SF_EXACT_LEAK] = {"leak k and threshold", "leak k and threshold"},
    [SF_EXACT_MEMBRANE] = {"membranes", "membranes"},
    [SF_EXACT_EXP2] = {"2^y and its argument", NULL},
    [SF_EXACT_SIGMOID] = {"sigmoid and its argument", "sigmoid and its argument"},
    [SF_EXACT_INTEGRATOR] = {"output integrators", "output integrator"},
    [SF_EXACT_COMPOSITE] = {"exp(-x), transmittance", "exp(-x), weight, transmittance"},
    [SF_EXACT_DECODE] = {NULL, "weight test: every sample decoded"},
};

/* NULL: the field has no such row. */
static const char *name_of(const fx_scene *scene, int row)
{
  if (row == 0) return "none: the fixed-point core";
  return row == SF_EXACT_ROWS - 1 ? "all: the float model" : block_name[row - 1][scene->backbone == FX_TENSORF];
}

/* The float model leaves out light samples, too. */
static uint32_t mask_of(const fx_scene *scene, int row)
{
  uint32_t all = 0;
  for (int id = 0; id < SF_EXACT_DECODE; id++) all |= (uint32_t)(name_of(scene, 1 + id) != NULL) << id;
  return row == 0 ? 0 : row == SF_EXACT_ROWS - 1 ? all : 1u << (row - 1);
}

static sf_status trace_rays(const sf_picture_job *job, const sf_exact *exact, const sf_exact *real, picture_ray *result)
{
  memset(result, 0, job->rays * sizeof *result);
#pragma omp parallel
  {
    struct picture_tracer *t = picture_tracer_create(exact, real);
#pragma omp for schedule(dynamic, 8)
    for (uint64_t i = 0; i < job->rays; i++)
      result[i].status = t ? picture_trace(t, job, i, &result[i]) : sf_fail(SF_E_MEMORY, "no memory for a ray");
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
  picture_pixel(job, i, &x, &y);
  const uint16_t *p = job->view->image.rgba + 4 * ((size_t)y * (size_t)job->view->image.width + (size_t)x);
  const double alpha = p[3] / 65535.0;
  return p[o] / 65535.0 * alpha + job->scene->background[o] / 65536.0 * (1 - alpha);
}

static sf_exact_row summarise(const sf_picture_job *job, const picture_ray *result, const picture_ray *fixed)
{
  sf_exact_row row = {.psnr_truth = NAN};
  double squares = 0, truth = 0;
  for (uint64_t i = 0; i < job->rays; i++) {
    for (int o = 0; o < 3; o++) {
      squares += pow(result[i].rgb[o] - fixed[i].rgb[o], 2);
      if (job->view->image.rgba) truth += pow(result[i].rgb[o] - photograph(job, i, o), 2);
    }
    for (int l = 0; l < SF_LAYERS; l++) row.flips[l] += result[i].flips[l], row.decisions[l] += result[i].decisions[l];
    row.sample_flips += result[i].sample_flips, row.points += result[i].points;
  }
  row.psnr = psnr(squares, 3 * job->rays);
  if (job->view->image.rgba) row.psnr_truth = psnr(truth, 3 * job->rays);
  return row;
}

static void sum_currents(const sf_picture_job *job, const picture_ray *result, sf_picture_budget *budget)
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

static sf_status make_row(const sf_picture_job *job, int row, picture_ray *result, picture_ray *fixed,
                          sf_picture_budget *budget)
{
  sf_exact exact, real = {0};
  SF_TRY(sf_exact_open(&exact, job->scene, job->model, mask_of(job->scene, row)));
  sf_status status =
      row == 0 ? sf_exact_open(&real, job->scene, job->model, mask_of(job->scene, SF_EXACT_ROWS - 1)) : sf_ok();
  if (status.code == SF_OK) status = trace_rays(job, &exact, row == 0 ? &real : NULL, result);
  sf_exact_close(&exact), sf_exact_close(&real);
  SF_TRY(status);
  if (row == 0) {
    memcpy(fixed, result, job->rays * sizeof *fixed);
    sum_currents(job, result, budget);
  }
  budget->row[row] = summarise(job, result, fixed);
  budget->row[row].block = name_of(job->scene, row);
  return sf_ok();
}

static bool same_grid(const sf_model *model, const fx_scene *scene)
{
  const sf_config *c = &model->config;
  const fx_layer *l = scene->net.layer;
  return l[FX_D1].n_in == 2 * c->levels && l[FX_D1].n_out == c->hidden && l[FX_D2].n_out == SF_DENSITY_OUT &&
         l[FX_C1].n_in == SF_DIR_FEATURES + SF_GEO_FEATURES &&
         2 * scene->grid.entries == (int64_t)model->param[SF_P_GRID].size;
}

static bool same_planes(const sf_model *model, const fx_scene *scene)
{
  const sf_tensorf *a = &model->config.tensorf;
  const fx_tensorf *b = &scene->tensorf;
  bool same = a->features == b->features && a->feature_freqs == b->feature_freqs && a->view_freqs == b->view_freqs &&
              (a->activation == SF_RELU) == (b->activation == FX_RELU);
  for (int i = 0; i < 3; i++)
    same = same && a->resolution[i] == b->res[i] && a->density[i] == b->density.components[i] &&
           a->appearance[i] == b->appearance.components[i];
  return same;
}

static bool same_sizes(const sf_model *model, const fx_scene *scene)
{
  const fx_layer *l = scene->net.layer;
  const bool planes = scene->backbone == FX_TENSORF, biases = l[FX_C1].bias && l[FX_C2].bias && l[FX_C3].bias;
  return model->config.net == SF_NET_SNN && planes == sf_model_decodes(model) && planes == biases &&
         l[FX_C1].n_out == model->config.hidden && l[FX_C2].n_out == model->config.hidden &&
         (planes ? same_planes : same_grid)(model, scene);
}

int sf_other_weights(const sf_model *model, const fx_scene *scene)
{
  if (!same_sizes(model, scene)) return -1;
  for (int l = fx_net_first_layer(&scene->net); l < SF_LAYERS; l++)
    if (scene->units.current_scale[l] > 0 && !sf_exact_resembles(scene, model, l)) return l;
  return -1;
}

sf_status sf_picture_budget_check(const sf_picture_job *job)
{
  const fx_net *net = &job->scene->net;
  if (!same_sizes(job->model, job->scene))
    return sf_fail(SF_E_UNSUPPORTED, "%s: its sizes are not those of the model it is compared with", job->name);
  for (int i = fx_net_first_layer(net); i < SF_LAYERS; i++)
    if (!(job->scene->units.current_scale[i] > 0))
      return sf_fail(SF_E_UNSUPPORTED, "%s: the unit of layer %s is not known", job->name, fx_layer_name(i));
  const int other = sf_other_weights(job->model, job->scene);
  return other < 0
             ? sf_ok()
             : sf_fail(SF_E_UNSUPPORTED, "%s: the weights of layer %s are not those of the model it is compared with",
                       job->name, fx_layer_name(other));
}

sf_status sf_picture_budget_make(const sf_picture_job *job, sf_picture_budget *budget)
{
  *budget = (sf_picture_budget){.rays = job->rays};
  SF_TRY(sf_picture_budget_check(job));
  int rows = 0, done = 0;
  for (int row = 0; row < SF_EXACT_ROWS; row++) rows += name_of(job->scene, row) != NULL;
  picture_ray *result = calloc(2 * job->rays, sizeof *result);
  if (!result) return sf_fail(SF_E_MEMORY, "no memory for %llu rays", (unsigned long long)job->rays);
  sf_status status = sf_ok();
  for (int row = 0; row < SF_EXACT_ROWS && status.code == SF_OK; row++) {
    if (!name_of(job->scene, row)) continue;
    status = job->tick && !job->tick(job->user, done, rows)
                 ? sf_fail(SF_E_STOPPED, "stopped after %d of %d pictures", done, rows)
                 : make_row(job, row, result, result + job->rays, budget);
    done++;
  }
  free(result);
  return status;
}
