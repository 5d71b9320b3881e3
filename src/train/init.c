/* Initial parameters. The ReLU twin starts as torch-ngp; a spiking net's weights are scaled layer by layer until the
 * currents of random samples have the spread that makes neurons fire (after Mishkin & Matas 2016). */
#include "snn/plif.h"
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PROBES = 256 };

static void fill_uniform(const sf_trainer *t, sf_param_id id, float bound)
{
  const sf_param *p = &t->model.param[id];
  float *value = t->model.value + p->offset;
  for (size_t i = 0; i < p->size; i++)
    value[i] = bound * (2 * sf_random_float(t->options.seed, RNG_INIT, p->offset + i) - 1);
}

/* Root mean square of layer currents over the probes at their first step. */
static double current_rms(const sf_model *m, const float *f, const float *sh, int layer, int outputs,
                          sf_net_trace *trace)
{
  double sum = 0;
  for (int p = 0; p < PROBES; p++) {
    float sigma[SF_T_MAX], colour[3 * SF_T_MAX];
    sf_net_sample(m, f + p * 2 * m->config.levels, sh + p * SF_DIR_FEATURES, 2 < m->config.steps ? 2 : m->config.steps,
                  sigma, colour, trace);
    for (int o = 0; o < outputs; o++) sum += pow(trace->current[layer][0][o], 2);
  }
  return sqrt(sum / (PROBES * (double)outputs));
}

static void scale_layer(sf_trainer *t, sf_param_id id, double factor)
{
  const sf_param *p = &t->model.param[id];
  for (size_t i = 0; i < p->size; i++) t->model.value[p->offset + i] *= (float)factor;
}

static void calibrate(sf_trainer *t, const float *f, const float *sh, sf_net_trace *trace)
{
  const sf_config *c = &t->model.config;
  const struct {
    sf_param_id id;
    int layer, outputs;
    double target;
  } plan[] = {{SF_P_W1, 0, c->hidden, c->theta[0]},
              {SF_P_W2, 1, SF_DENSITY_OUT, 0.5},
              {SF_P_W3, 2, c->hidden, c->theta[1]},
              {SF_P_W4, 3, c->hidden, c->theta[2]},
              {SF_P_W5, 4, 3, 0.5}};
  for (size_t i = 0; i < sizeof plan / sizeof *plan; i++) {
    double rms = current_rms(&t->model, f, sh, plan[i].layer, plan[i].outputs, trace);
    if (rms > 1e-12) scale_layer(t, plan[i].id, plan[i].target / rms);
  }
}

sf_status sf_init_parameters(sf_trainer *t)
{
  sf_model *m = &t->model;
  const bool ann = m->config.net == SF_NET_ANN;
  fill_uniform(t, SF_P_GRID, ann ? 1e-4f : 0.1f);
  for (int id = SF_P_W1; id <= SF_P_W5; id++) fill_uniform(t, id, 1 / sqrtf((float)m->param[id].shape[1]));
  if (ann) return sf_ok();
  const int features = 2 * m->config.levels;
  float *f = malloc((size_t)PROBES * features * sizeof *f), *sh = malloc(PROBES * SF_DIR_FEATURES * sizeof *sh);
  sf_net_trace *trace = calloc(1, sizeof *trace);
  const bool ok = f && sh && trace;
  if (ok) {
    for (int p = 0; p < PROBES; p++) {
      float x[3], d[3], length = 0;
      for (int a = 0; a < 3; a++) {
        x[a] = sf_random_float(t->options.seed, RNG_INIT, (1ull << 40) + 6 * p + a);
        d[a] = sf_random_float(t->options.seed, RNG_INIT, (1ull << 40) + 6 * p + 3 + a) - 0.5f;
        length += d[a] * d[a];
      }
      for (int a = 0; a < 3; a++) d[a] /= sqrtf(length) + 1e-9f;
      sf_grid_features(m, x, f + p * features);
      sf_sh4(d, sh + p * SF_DIR_FEATURES);
    }
    calibrate(t, f, sh, trace);
  }
  free(f);
  free(sh);
  free(trace);
  return ok ? sf_ok() : sf_fail(SF_E_MEMORY, "train: no memory for the initial probes");
}
