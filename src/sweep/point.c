/* One point of a sweep: a model at some widths against its float field and against the picture. */
#include "energy/energy.h"
#include "base/clock.h"
#include "golden/golden.h"
#include "sweep/sweep.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const sf_axis sf_axes[SF_AXES] = {
    [SF_AXIS_WEIGHT] = {"weight_bits", "w", {"weights, bits", "weights and basis matrix, bits"}},
    [SF_AXIS_FEATURE] = {"feature_bits", "f", {"inputs f d h, bits", NULL}},
    [SF_AXIS_GRID] = {"grid_bits", "g", {"grid entries, bits", "entries of planes and lines, bits"}},
    [SF_AXIS_LEAK] = {"leak_bits", "k", {"leak, fraction bits", "leak, fraction bits"}},
    [SF_AXIS_AC_FRAC] = {"ac_frac", "m", {"C2 membrane, fraction bits", "C2 membrane, fraction bits"}},
    [SF_AXIS_H_SHIFT] = {"h_shift", "h", {"h = current >> n", NULL}},
    [SF_AXIS_TRANS_FRAC] = {"trans_frac", "a", {"transmittance, fraction bits", "transmittance, fraction bits"}},
    [SF_AXIS_TABLE] = {"field_size", "n", {"hash table, log2 entries", "planes, points along the longest axis"}},
    [SF_AXIS_STEPS] = {"t", "t", {"time steps", "time steps"}},
};

const sf_point_figure sf_point_figures[SF_POINT_FIGURES] = {
    [SF_POINT_PSNR_TRUTH] = {"psnr_truth_db", "picture, dB", "PSNR against the picture, dB", "%.2f"},
    [SF_POINT_PSNR_FLOAT] = {"psnr_float_db", "float, dB", "PSNR against float, dB", "%.2f"},
    [SF_POINT_LOSS] = {"loss_db", "lost, dB", "lost against float, dB", "%.2f"},
    [SF_POINT_EXCESS] = {"excess_squared_error", "excess", "squared error less float's", "%.1e"},
    [SF_POINT_MAX_ERROR] = {"max_error_of_255", "error, /255", "largest error, of 255", "%.1f"},
    [SF_POINT_ENERGY] = {"energy_mj", "energy, mJ", "energy, mJ (paper ledger)", "%.3g"},
    [SF_POINT_ENERGY_H_ONCE] = {"energy_h_once_mj", "h once, mJ", "energy, mJ (h once)", "%.3g"},
    [SF_POINT_ENERGY_H_SPIKES] = {"energy_h_spikes_mj", "h spikes, mJ", "energy, mJ (h as spikes)", "%.3g"},
    [SF_POINT_ENERGY_ANN] = {"energy_ann_mj", "ReLU, mJ", "energy, mJ (ReLU twin)", "%.3g"},
    [SF_POINT_BYTES] = {"packed_bytes", "bytes", "packed model, bytes", "%.0f"},
    [SF_POINT_TRAFFIC] = {"traffic_gbit", "moved, Gbit", "moved per frame, Gbit", "%.3g"},
    [SF_POINT_CLIPPED_FEATURES] = {"clipped_features", "clipped f", "clipped features", "%.0f"},
    [SF_POINT_CLIPPED_DENSITY] = {"clipped_density", "clipped sigma", "clipped densities", "%.0f"},
    [SF_POINT_CLIPPED_STATES] = {"clipped_states", "clipped v, c", "clipped membranes and colours", "%.0f"},
    [SF_POINT_SAMPLES] = {"samples", "samples", "samples", "%.0f"},
    [SF_POINT_SPEED] = {"samples_per_second", "samples/s", "samples/s", "%.0f"},
};

typedef struct bench {
  const sf_point_options *options;
  sf_model model;
  sf_dataset data;
  const sf_view *view;
  fx_scene scene;
  fx_core *core;
  sf_quant_report report;
  sf_golden fixed;
  float *truth, *real; /* [pixels][3], of the picture and of the float field */
  size_t pixels;
  fx_counts counts;
  double seconds;
} bench;

static void bench_free(bench *b)
{
  free(b->truth), free(b->real);
  sf_golden_free(&b->fixed);
  fx_core_close(b->core);
  fx_scene_free(&b->scene);
  sf_dataset_free(&b->data);
  sf_model_free(&b->model);
}

static sf_status load(bench *b)
{
  const sf_point_options *o = b->options;
  SF_TRY(sf_model_load(&b->model, o->model));
  const sf_dataset_options how = {.scale = b->model.config.scale, .limit = o->view + 1};
  SF_TRY(sf_dataset_load(&b->data, o->data, o->split, &how));
  SF_TRY(sf_space_check(&b->model.config.space, o->model, &b->data));
  sf_dataset_warn(stderr, "sf_point", &b->data, NULL);
  if (o->view >= b->data.count)
    return sf_fail(SF_E_USAGE, "view %d is out of range: %s has %d %s views", o->view, o->data, b->data.count,
                   o->split);
  b->view = &b->data.view[o->view];
  if (!b->view->image.rgba)
    return sf_fail(SF_E_UNSUPPORTED, "%s: %s view %s has no picture to compare with", o->data, o->split, b->view->name);
  SF_TRY(sf_quantise_report(&b->scene, &b->model, o->model, &o->quant, &b->report));
  SF_TRY(fx_core_open(&b->core, &b->scene, NULL));
  const int width = b->view->camera.width / o->every, height = b->view->camera.height / o->every;
  if (width < 1 || height < 1)
    return sf_fail(SF_E_USAGE, "%s: view %s has fewer than %d pixels along an axis", o->data, b->view->name, o->every);
  SF_TRY(sf_golden_create(&b->fixed, width, height, SF_PLANES));
  b->pixels = (size_t)width * (size_t)height;
  b->truth = malloc(b->pixels * 3 * sizeof(float)), b->real = malloc(b->pixels * 3 * sizeof(float));
  return b->truth && b->real ? sf_ok() : sf_fail(SF_E_MEMORY, "%s: no memory for %zu pixels", o->data, b->pixels);
}

/* Pixel i of those that are rendered. */
static void place(const bench *b, size_t i, int *x, int *y)
{
  const int every = b->options->every;
  *x = (int)(i % (size_t)b->fixed.width) * every + every / 2;
  *y = (int)(i / (size_t)b->fixed.width) * every + every / 2;
}

static void read_truth(bench *b)
{
  for (size_t i = 0; i < b->pixels; i++) {
    int x, y;
    place(b, i, &x, &y);
    const uint16_t *p = b->view->image.rgba + 4 * ((size_t)y * (size_t)b->view->image.width + (size_t)x);
    const float alpha = (float)p[3] / 65535;
    for (size_t c = 0; c < 3; c++)
      b->truth[3 * i + c] = (float)p[c] / 65535 * alpha + b->options->quant.background[c] * (1 - alpha);
  }
}

static sf_status render_float(bench *b)
{
  float *origin = malloc(b->pixels * 6 * sizeof *origin);
  if (!origin) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu rays", b->options->data, b->pixels);
  float *direction = origin + 3 * b->pixels;
  for (size_t i = 0; i < b->pixels; i++) {
    int x, y;
    place(b, i, &x, &y);
    sf_dataset_ray(&b->data, b->view, (float)x + 0.5f, (float)y + 0.5f, origin + 3 * i, direction + 3 * i);
  }
  const sf_status status = sf_render_rays(&b->model, origin, direction, b->pixels, b->scene.net.steps,
                                          b->options->quant.background, b->real, NULL, NULL, NULL);
  free(origin);
  return status;
}

typedef struct row_space {
  fx_ray *ray;
  fx_pixel *pixel;
  fx_cost *cost;
} row_space;

static sf_status fill_row(bench *b, int row, const row_space *space, fx_counts *sum)
{
  const size_t n = (size_t)b->fixed.width, first = (size_t)row * n;
  for (size_t i = 0; i < n; i++) {
    int x, y;
    place(b, first + i, &x, &y);
    SF_TRY(sf_pixel_ray(&b->scene, &b->data, b->view, x, y, &space->ray[i]));
  }
  SF_TRY(fx_render_rays(b->core, space->ray, n, space->pixel, space->cost, sum));
  for (size_t i = 0; i < n; i++) sf_golden_set(&b->fixed, first + i, &space->pixel[i], &space->cost[i], 1);
  return sf_ok();
}

static sf_status fixed_row(bench *b, int row, fx_counts *sum)
{
  const size_t n = (size_t)b->fixed.width;
  const row_space space = {malloc(n * sizeof *space.ray), malloc(n * sizeof *space.pixel),
                           malloc(n * sizeof *space.cost)};
  const sf_status status = space.ray && space.pixel && space.cost ? fill_row(b, row, &space, sum)
                                                                  : sf_fail(SF_E_MEMORY, "no memory for %zu rays", n);
  free(space.ray), free(space.pixel), free(space.cost);
  return status;
}

static sf_status render_fixed(bench *b)
{
  sf_status failed = sf_ok();
  const double start = sf_seconds();
#pragma omp parallel for schedule(dynamic)
  for (int row = 0; row < b->fixed.height; row++) {
    fx_counts sum = {0};
    const sf_status status = fixed_row(b, row, &sum);
#pragma omp critical(sf_point)
    {
      fx_counts_add(&b->counts, &sum);
      if (status.code != SF_OK) failed = status;
    }
  }
  b->seconds = sf_seconds() - start;
  return failed;
}

/* ---- bits moved ---- */

static int signed_bits(int64_t largest)
{
  int bits = 1;
  for (; largest > 0; largest >>= 1) bits++;
  return bits;
}

/* Bits that hold every state of a layer at these widths. */
static int state_bits(const bench *b, int layer)
{
  const sf_quant_widths *w = &b->report.widths;
  const int64_t rows = (int64_t)fx_layer_rows(&b->scene.net.layer[layer]) * ((1 << (w->weight_bits - 1)) - 1);
  return !fx_layer_fires(layer)         ? fx_layer_state_bits(layer, b->scene.net.mode)
         : fx_layer_reads_spikes(layer) ? signed_bits(rows << fx_layer_frac(layer, b->scene.net.mode))
                                        : signed_bits(rows * ((1 << (w->feature_bits - 1)) - 1));
}

/* Events of the audit, each with the width that it has here; the audit itself counts whole bytes of the accelerator. */
static double traffic_bits(const bench *b)
{
  const sf_quant_widths *w = &b->report.widths;
  double bits = (double)b->counts.grid_bytes * w->grid_bits;
  for (int l = 0; l < SF_LAYERS; l++)
    for (int t = 0; t < b->scene.net.steps; t++) {
      const fx_layer_counts *c = &b->counts.layer[l];
      bits += (double)c->weight[t] * w->weight_bits;
      const double read = c->state_w[t] ? (double)c->state_r[t] / (double)c->state_w[t] : 0;
      bits += (double)c->updates[t] * state_bits(b, l) * (1 + read); /* written, and read but for the first time */
    }
  return bits;
}

/* ---- figures ---- */

static int field_size(const sf_config *c)
{
  const int32_t *points = c->tensorf.resolution;
  int most = 0;
  for (int i = 0; i < 3; i++) most = points[i] > most ? points[i] : most;
  return c->backbone == SF_TENSORF ? most : c->log2_hash;
}

static void set_axes(const bench *b, sf_point *point)
{
  const sf_quant_widths *w = &b->report.widths;
  const int axis[SF_AXES] = {[SF_AXIS_WEIGHT] = w->weight_bits,    [SF_AXIS_FEATURE] = w->feature_bits,
                             [SF_AXIS_GRID] = w->grid_bits,        [SF_AXIS_LEAK] = w->leak_bits,
                             [SF_AXIS_AC_FRAC] = SF_AC_FRAC,       [SF_AXIS_H_SHIFT] = SF_H_SHIFT,
                             [SF_AXIS_TRANS_FRAC] = SF_TRANS_FRAC, [SF_AXIS_TABLE] = field_size(&b->model.config),
                             [SF_AXIS_STEPS] = b->scene.net.steps};
  const char *slash = strrchr(b->options->model, '/');
  size_t used = 0;
  point->backbone = b->model.config.backbone;
  point->steps_max = b->model.config.steps;
  snprintf(point->model, sizeof point->model, "%s", slash ? slash + 1 : b->options->model);
  for (int i = 0; i < SF_AXES; i++) {
    if (!sf_axes[i].title[point->backbone]) continue;
    point->axis[i] = axis[i];
    used += (size_t)snprintf(point->name + used, sizeof point->name - used, "%s%s%d", i ? "-" : "", sf_axes[i].letter,
                             axis[i]);
  }
}

static double largest_error(const float *a, const float *b, size_t n)
{
  double largest = 0;
  for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs((double)a[i] - b[i]));
  return largest;
}

static void set_quality(const bench *b, const float *fixed, double *figure)
{
  const size_t n = 3 * b->pixels;
  figure[SF_POINT_PSNR_TRUTH] = sf_psnr(fixed, b->truth, n);
  figure[SF_POINT_PSNR_FLOAT] = sf_psnr(fixed, b->real, n);
  const double real = sf_psnr(b->real, b->truth, n);
  figure[SF_POINT_LOSS] = real - figure[SF_POINT_PSNR_TRUTH];
  figure[SF_POINT_EXCESS] = pow(10, -figure[SF_POINT_PSNR_TRUTH] / 10) - pow(10, -real / 10);
  figure[SF_POINT_MAX_ERROR] = 255 * largest_error(fixed, b->real, n);
}

static sf_status set_costs(const bench *b, double *figure)
{
  sf_ledger ledger;
  const fx_counts *c = &b->counts;
  const double pixels = (double)b->view->camera.width * b->view->camera.height, mj = 1e-12 * pixels / (double)b->pixels;
  SF_TRY(sf_ledger_make(&b->scene.net, c, &ledger));
  figure[SF_POINT_ENERGY] = (double)ledger.spiking_fj * mj;
  figure[SF_POINT_ENERGY_H_ONCE] = (double)ledger.h_once_fj * mj;
  figure[SF_POINT_ENERGY_H_SPIKES] = (double)ledger.h_spikes_fj * mj;
  figure[SF_POINT_ENERGY_ANN] = (double)ledger.ann_fj * mj;
  figure[SF_POINT_BYTES] = (double)b->report.packed_bytes;
  figure[SF_POINT_TRAFFIC] = traffic_bits(b) * 1e3 * mj;
  figure[SF_POINT_CLIPPED_FEATURES] = (double)c->saturated_features;
  figure[SF_POINT_CLIPPED_DENSITY] = (double)c->saturated[FX_D2];
  figure[SF_POINT_CLIPPED_STATES] =
      (double)(c->saturated[FX_D1] + c->saturated[FX_C1] + c->saturated[FX_C2] + c->saturated[FX_C3]);
  figure[SF_POINT_SAMPLES] = (double)c->samples;
  figure[SF_POINT_SPEED] = b->seconds > 0 ? (double)c->samples / b->seconds : 0;
  return sf_ok();
}

static sf_status measure(bench *b, sf_point *point)
{
  SF_TRY(load(b));
  read_truth(b);
  SF_TRY(render_float(b));
  SF_TRY(render_fixed(b));
  float *fixed = malloc(b->pixels * 3 * sizeof *fixed);
  if (!fixed) return sf_fail(SF_E_MEMORY, "%s: no memory for %zu pixels", b->options->data, b->pixels);
  for (size_t i = 0; i < b->pixels; i++)
    for (size_t c = 0; c < 3; c++) fixed[3 * i + c] = sf_golden_real(&b->fixed, SF_PLANE_R + (int)c)[i];
  set_axes(b, point);
  set_quality(b, fixed, point->figure);
  free(fixed);
  return set_costs(b, point->figure);
}

sf_status sf_point_measure(sf_point *point, const sf_point_options *options)
{
  bench b = {.options = options};
  *point = (sf_point){0};
  const sf_status status = measure(&b, point);
  bench_free(&b);
  return status;
}

cJSON *sf_point_json(const sf_point *point)
{
  cJSON *json = cJSON_CreateObject();
  cJSON_AddStringToObject(json, "name", point->name);
  cJSON_AddStringToObject(json, "model", point->model);
  cJSON_AddNumberToObject(json, "T", point->steps_max);
  cJSON_AddStringToObject(json, "backbone", sf_field_of(&(sf_config){.backbone = point->backbone})->name);
  for (int i = 0; i < SF_AXES; i++)
    if (sf_axes[i].title[point->backbone]) cJSON_AddNumberToObject(json, sf_axes[i].name, point->axis[i]);
  for (int i = 0; i < SF_POINT_FIGURES; i++) sf_json_add_real(json, sf_point_figures[i].name, point->figure[i]);
  return json;
}

void sf_point_print(FILE *out, const sf_point *point)
{
  fprintf(out, "%s, %s\n", point->name, point->model);
  for (int i = 0; i < SF_AXES; i++) {
    const char *title = sf_axes[i].title[point->backbone];
    if (title) fprintf(out, "  %-37s %d\n", title, point->axis[i]);
  }
  for (int i = 0; i < SF_POINT_FIGURES; i++)
    fprintf(out, "  %-37s ", sf_point_figures[i].title), fprintf(out, sf_point_figures[i].format, point->figure[i]),
        fputc('\n', out);
}
