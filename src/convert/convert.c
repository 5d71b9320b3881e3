/* Conversion: balanced thresholds, and one sample through integrate-and-fire neurons. */
#include "convert/internal.h"
#include "base/rng.h"
#include "render/march.h"
#include "snn/plif.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES_MOST = 8192 };
_Static_assert((int)SF_DECODER_MAX >= (int)SF_FEATURE_MAX, "convert_point has room for the features of a hash grid");

/* ---- rays ---- */

sf_status convert_pick(const sf_dataset *views, uint64_t seed, uint64_t index, convert_ray *ray)
{
  int pictures = 0;
  for (int v = 0; v < views->count; v++) pictures += views->view[v].image.rgba != NULL;
  if (!pictures) return sf_fail(SF_E_FORMAT, "%s: no view with a picture", views->path);
  int chosen = (int)sf_random_below(seed, 0, index, (uint64_t)pictures), v = 0;
  while (!views->view[v].image.rgba || chosen-- > 0) v++;
  const sf_image *image = &views->view[v].image;
  const uint64_t pixel = sf_random_below(seed, 1, index, (uint64_t)image->width * (uint64_t)image->height);
  const uint64_t width = (uint64_t)image->width;
  sf_dataset_ray(views, &views->view[v], (float)(pixel % width) + 0.5f, (float)(pixel / width) + 0.5f, ray->origin,
                 ray->direction);
  const uint16_t *p = image->rgba + 4 * pixel;
  const float alpha = p[3] / 65535.0f;
  for (int c = 0; c < 3; c++) ray->truth[c] = p[c] / 65535.0f * alpha + 1 - alpha;
  sf_sh4(ray->direction, ray->sh);
  return sf_ok();
}

bool convert_read(const sf_model *twin, const convert_ray *ray, const float x[3], float transmittance, float length,
                  convert_point *point)
{
  if (!sf_model_decodes(twin)) {
    sf_grid_features(twin, x, point->in);
    return true;
  }
  const sf_tensorf *field = &twin->config.tensorf;
  float appearance[SF_APPEARANCE_MAX];
  point->sigma = sf_tensorf_sigma(field, sf_tensorf_density_feature(twin, x));
  if (transmittance * (1 - expf(-point->sigma * length)) <= (float)field->weight_stop) return false;
  sf_tensorf_appearance(twin, x, appearance);
  sf_tensorf_encode(field, appearance, ray->direction, point->in);
  return true;
}

/* ---- thresholds ---- */

typedef struct activations {
  float *value[SF_CONVERTED_LAYERS]; /* [SAMPLES_MOST][hidden] */
  int samples;
} activations;

/* Those of the samples of one ray. */
static void collect(const sf_model *twin, int first, const sf_steps *steps, const convert_ray *ray, sf_net_trace *trace,
                    activations *a)
{
  static const int layer[SF_CONVERTED_LAYERS] = {0, 2, 3};
  const sf_march march = sf_march_begin(twin, steps, ray->origin, ray->direction, 0.5f);
  const size_t hidden = (size_t)twin->config.hidden;
  convert_point p;
  float x[3], colour[3], transmittance = 1;
  for (int n = sf_march_next(&march, 0, x); n >= 0 && transmittance > march.stop && a->samples < SAMPLES_MOST;
       n = sf_march_next(&march, n + 1, x)) {
    if (convert_read(twin, ray, x, transmittance, steps->length[n], &p)) {
      sf_net_sample(twin, p.in, ray->sh, 1, &p.sigma, colour, trace);
      for (int l = first; l < SF_CONVERTED_LAYERS; l++)
        for (size_t i = 0; i < hidden; i++)
          a->value[l][(size_t)a->samples * hidden + i] = fmaxf(trace->current[layer[l]][0][i], 0);
      a->samples++;
    }
    transmittance *= expf(-p.sigma * steps->length[n]);
  }
}

static int compare(const void *a, const void *b)
{
  const float x = *(const float *)a, y = *(const float *)b;
  return (x > y) - (x < y);
}

static float threshold_of(float *value, size_t n, double percentile)
{
  if (!n) return 1;
  qsort(value, n, sizeof *value, compare);
  const size_t place = (size_t)ceil(percentile / 100 * (double)n);
  const float threshold = value[place ? place - 1 : 0];
  return threshold > 0 ? threshold : 1;
}

static sf_status balance_on(sf_converted *net, const sf_dataset *views, int rays, double percentile, uint64_t seed,
                            sf_net_trace *trace, activations *a)
{
  sf_steps steps;
  SF_TRY(sf_march_steps(&steps, net->model, 1));
  for (int i = 0; i < rays; i++) {
    convert_ray ray;
    SF_TRY(convert_pick(views, seed, (uint64_t)i, &ray));
    collect(net->model, net->first, &steps, &ray, trace, a);
  }
  if (!a->samples) return sf_fail(SF_E_FORMAT, "%s: no ray of %d meets the scene", views->path, rays);
  const size_t n = (size_t)a->samples * (size_t)net->model->config.hidden;
  for (int l = net->first; l < SF_CONVERTED_LAYERS; l++) net->threshold[l] = threshold_of(a->value[l], n, percentile);
  return sf_ok();
}

static sf_status balance(sf_converted *net, const sf_dataset *views, int rays, double percentile, uint64_t seed)
{
  const size_t each = (size_t)SAMPLES_MOST * (size_t)net->model->config.hidden;
  float *memory = malloc(SF_CONVERTED_LAYERS * each * sizeof *memory);
  sf_net_trace *trace = malloc(sizeof *trace);
  sf_status status = sf_fail(SF_E_MEMORY, "no memory for activations");
  if (memory && trace) {
    activations a = {{memory, memory + each, memory + 2 * each}, 0};
    status = balance_on(net, views, rays, percentile, seed, trace, &a);
  }
  free(memory), free(trace);
  return status;
}

/* ---- weights ---- */

/* to[i][o] = the parameter's [o][first + i]. */
static void transpose(const sf_model *m, int id, int first, int n_in, float *to)
{
  const int n_out = (int)m->param[id].shape[0], stride = (int)m->param[id].shape[1];
  const float *from = sf_model_param(m, id);
  for (int i = 0; i < n_in; i++)
    for (int o = 0; o < n_out; o++) to[i * n_out + o] = from[o * stride + first + i];
}

static sf_status lay_out(sf_converted *net)
{
  const int hidden = net->model->config.hidden;
  const size_t h = (size_t)hidden;
  net->memory = malloc(h * (SF_DENSITY_OUT + SF_GEO_FEATURES + h + 3) * sizeof *net->memory);
  if (!net->memory) return sf_fail(SF_E_MEMORY, "no memory for a converted net");
  net->d2 = net->memory, net->c1 = net->d2 + h * SF_DENSITY_OUT, net->c2 = net->c1 + h * SF_GEO_FEATURES;
  net->c3 = net->c2 + h * h;
  if (!net->first) {
    transpose(net->model, SF_P_D2, 0, hidden, net->d2);
    transpose(net->model, SF_P_C1, SF_DIR_FEATURES, SF_GEO_FEATURES, net->c1);
  }
  transpose(net->model, SF_P_C2, 0, hidden, net->c2);
  transpose(net->model, SF_P_C3, 0, hidden, net->c3);
  return sf_ok();
}

sf_status sf_convert(sf_converted *net, const sf_model *twin, const sf_dataset *views, int rays, double percentile,
                     uint64_t seed)
{
  *net = (sf_converted){.model = twin, .first = sf_model_decodes(twin)};
  if (twin->config.net != SF_NET_ANN) return sf_fail(SF_E_USAGE, "the model is no ReLU twin: train it with --net ann");
  sf_status status = lay_out(net);
  if (!status.code) status = balance(net, views, rays, percentile, seed);
  if (status.code) sf_converted_free(net);
  return status;
}

void sf_converted_free(sf_converted *net)
{
  free(net->memory);
  *net = (sf_converted){0};
}

/* ---- one sample ---- */

/* Adds the current, fires, and adds to `next` what every spike brings there. Returns the spikes. */
static int fire(float *v, const float *current, int count, float threshold, const float *rows, int n_out, float *next)
{
  int spikes = 0;
  for (int i = 0; i < count; i++) {
    v[i] += current[i];
    if (v[i] < threshold) continue;
    v[i] -= threshold;
    spikes++;
    for (int o = 0; o < n_out; o++) next[o] += threshold * rows[i * n_out + o];
  }
  return spikes;
}

/* out[count]: the layer's biases, or zeros. */
static void begin(const sf_model *m, int bias, int count, float *out)
{
  memset(out, 0, (size_t)count * sizeof *out);
  if (sf_model_has(m, bias)) memcpy(out, sf_model_param(m, bias), (size_t)count * sizeof *out);
}

/* Adds what does not change: out[o] += sum over n_in inputs. */
static void constant(const sf_model *m, int id, const float *in, int n_in, float *out)
{
  const int n_out = (int)m->param[id].shape[0], stride = (int)m->param[id].shape[1];
  const float *w = sf_model_param(m, id);
  for (int o = 0; o < n_out; o++)
    for (int i = 0; i < n_in; i++) out[o] += w[o * stride + i] * in[i];
}

void sf_converted_sample(const sf_converted *net, const float *in, const float *sh, int points, const int *steps,
                         sf_converted_output *output)
{
  const sf_model *m = net->model;
  const int hidden = m->config.hidden, n_h = net->first ? 0 : SF_GEO_FEATURES;
  const int n_in = (int)m->param[net->first ? SF_P_C1 : SF_P_D1].shape[1];
  float v[SF_CONVERTED_LAYERS][SF_LANES], d1[SF_LANES] = {0}, base[SF_LANES], sum[4] = {0};
  uint64_t sops = 0;
  for (int l = 0; l < SF_CONVERTED_LAYERS; l++)
    for (int i = 0; i < hidden; i++) v[l][i] = net->threshold[l] / 2;
  if (!net->first) constant(m, SF_P_D1, in, n_in, d1);
  begin(m, SF_P_C1_BIAS, hidden, base);
  constant(m, SF_P_C1, net->first ? in : sh, net->first ? n_in : SF_DIR_FEATURES, base);
  for (int t = 1, p = 0; p < points; t++) {
    float out[SF_DENSITY_OUT] = {0}, current[SF_LANES], next[SF_LANES], colour[3];
    if (!net->first)
      sops += (uint64_t)fire(v[0], d1, hidden, net->threshold[0], net->d2, SF_DENSITY_OUT, out) * SF_DENSITY_OUT;
    memcpy(current, base, (size_t)hidden * sizeof *current);
    begin(m, SF_P_C2_BIAS, hidden, next);
    begin(m, SF_P_C3_BIAS, 3, colour);
    for (int a = 0; a < n_h; a++)
      for (int i = 0; i < hidden; i++) current[i] += out[1 + a] * net->c1[a * hidden + i];
    sops += (uint64_t)fire(v[1], current, hidden, net->threshold[1], net->c2, hidden, next) * (uint64_t)hidden;
    sops += (uint64_t)fire(v[2], next, hidden, net->threshold[2], net->c3, 3, colour) * 3;
    sum[0] += out[0];
    for (int c = 0; c < 3; c++) sum[1 + c] += colour[c];
    for (; p < points && steps[p] == t; p++) {
      output[p] = (sf_converted_output){.sigma = expf(sum[0] / (float)t), .sops = sops};
      for (int c = 0; c < 3; c++) output[p].colour[c] = sf_sigmoid(sum[1 + c] / (float)t);
    }
  }
}

uint64_t sf_converted_macs(const sf_model *twin, int steps)
{
  const uint64_t h = (uint64_t)twin->config.hidden, n_in = (uint64_t)twin->param[SF_P_C1].shape[1];
  if (sf_model_decodes(twin)) return steps ? h * n_in : h * (n_in + h + 3);
  const uint64_t f = (uint64_t)twin->param[SF_P_D1].shape[1];
  if (!steps) return h * (f + SF_DENSITY_OUT + SF_DIR_FEATURES + SF_GEO_FEATURES + h + 3);
  return h * (f + SF_DIR_FEATURES + SF_GEO_FEATURES * (uint64_t)steps);
}
