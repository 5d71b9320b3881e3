/* Initial parameters. The ReLU twin starts as torch-ngp; a spiking net's weights are scaled layer by layer until the
 * currents of random samples have the spread that makes neurons fire (after Mishkin & Matas 2016). */
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

sf_status sf_probes_create(sf_probes *p, const sf_config *config)
{
  p->features = 2 * config->levels;
  p->f = malloc((size_t)PROBES * p->features * sizeof *p->f);
  p->sh = malloc(PROBES * SF_DIR_FEATURES * sizeof *p->sh);
  p->trace = calloc(1, sizeof *p->trace);
  if (p->f && p->sh && p->trace) return sf_ok();
  sf_probes_free(p);
  return sf_fail(SF_E_MEMORY, "train: no memory for %d probes", PROBES);
}

void sf_probes_free(sf_probes *p)
{
  free(p->f);
  free(p->sh);
  free(p->trace);
  memset(p, 0, sizeof *p);
}

/* A cell of the first byte with occupied ones, from a random byte on; any cell where all are empty. */
static size_t occupied_cell(const sf_trainer *t, uint64_t stream, uint64_t index)
{
  const size_t bytes = sf_config_cells(&t->model.config) / 8;
  const uint8_t *occupancy = t->model.occupancy;
  size_t byte = sf_random_below(t->options.seed, stream, index, bytes), bit = index % 8;
  for (size_t i = 0; i < bytes && !occupancy[byte]; i++) byte = (byte + 1) % bytes;
  for (int i = 0; i < 8 && !(occupancy[byte] >> bit & 1); i++) bit = (bit + 1) % 8;
  return 8 * byte + bit;
}

void sf_probes_draw(const sf_trainer *t, uint64_t stream, int count, sf_probes *p)
{
  for (int i = 0; i < count; i++) {
    const uint64_t base = ((uint64_t)t->iteration * PROBES + i) * 5, seed = t->options.seed;
    const size_t cell = occupied_cell(t, stream, base);
    const float *pose = t->data->view[sf_random_below(seed, stream, base + 1, t->data->count)].camera.to_world;
    float place[3], x[3], d[3], length = 0;
    for (int a = 0; a < 3; a++) place[a] = sf_random_float(seed, stream, base + 2 + a);
    sf_occupancy_point(&t->model.config, cell, place, x);
    for (int a = 0; a < 3; a++) {
      d[a] = (float)t->model.config.bound * (2 * x[a] - 1) - pose[4 * a + 3];
      length += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++) d[a] /= sqrtf(length) + 1e-9f;
    sf_grid_features(&t->model, x, p->f + i * p->features);
    sf_sh4(d, p->sh + i * SF_DIR_FEATURES);
  }
}

void sf_probe(const sf_model *m, const sf_probes *p, int index, int steps)
{
  float sigma[SF_T_MAX], colour[3 * SF_T_MAX];
  sf_net_sample(m, p->f + index * p->features, p->sh + index * SF_DIR_FEATURES, steps, sigma, colour, p->trace);
}

static void fill_uniform(const sf_trainer *t, sf_param_id id, float bound, uint64_t stream, uint64_t base)
{
  const sf_param *p = &t->model.param[id];
  float *value = t->model.value + p->offset;
  for (size_t i = 0; i < p->size; i++)
    value[i] = bound * (2 * sf_random_float(t->options.seed, stream, base + p->offset + i) - 1);
}

void sf_layer_redraw(sf_trainer *t, sf_param_id id, uint64_t stream)
{
  fill_uniform(t, id, 1 / sqrtf((float)t->model.param[id].shape[1]), stream, (uint64_t)t->iteration << 32);
}

/* Root mean square of layer currents over the probes at their first step. */
static double current_rms(const sf_model *m, const sf_probes *p, int layer, int outputs)
{
  double sum = 0;
  for (int i = 0; i < PROBES; i++) {
    sf_probe(m, p, i, 1);
    for (int o = 0; o < outputs; o++) sum += pow(p->trace->current[layer][0][o], 2);
  }
  return sqrt(sum / (PROBES * (double)outputs));
}

void sf_layer_scale(sf_trainer *t, sf_param_id id, const sf_probes *probes)
{
  const sf_config *c = &t->model.config;
  const struct {
    int layer, outputs;
    double target;
  } plan[] = {[SF_P_W1] = {0, c->hidden, c->theta[0]},
              [SF_P_W2] = {1, SF_DENSITY_OUT, 0.5},
              [SF_P_W3] = {2, c->hidden, c->theta[1]},
              [SF_P_W4] = {3, c->hidden, c->theta[2]},
              [SF_P_W5] = {4, 3, 0.5}};
  const double rms = current_rms(&t->model, probes, plan[id].layer, plan[id].outputs);
  if (!(rms > 1e-12 && rms < 1e12)) return; /* silent input: no scale helps */
  float *w = sf_model_param(&t->model, id);
  for (size_t i = 0; i < t->model.param[id].size; i++) w[i] *= (float)(plan[id].target / rms);
}

sf_status sf_init_parameters(sf_trainer *t)
{
  const bool ann = t->model.config.net == SF_NET_ANN;
  fill_uniform(t, SF_P_GRID, ann ? 1e-4f : 0.1f, RNG_INIT, 0);
  for (int id = SF_P_W1; id <= SF_P_W5; id++) sf_layer_redraw(t, id, RNG_INIT);
  if (ann) return sf_ok();
  sf_probes probes;
  SF_TRY(sf_probes_create(&probes, &t->model.config));
  sf_probes_draw(t, RNG_PROBE, PROBES, &probes);
  for (int id = SF_P_W1; id <= SF_P_W5; id++) sf_layer_scale(t, id, &probes);
  sf_probes_free(&probes);
  return sf_ok();
}
