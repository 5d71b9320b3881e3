/* Initial parameters. Weights are scaled layer by layer until the currents of random samples have the spread that makes
 * neurons fire (after Mishkin & Matas 2016). The ReLU twin starts in the same way: with the small weights of torch's
 * linear layers it learns late, and the comparison would be of the starts. */
#include "field/field.h"
#include "train/internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

sf_status sf_probes_create(sf_probes *p, const sf_trainer *t)
{
  p->features = sf_field_of(&t->model.config)->inputs(&t->model.config);
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
    float place[3], x[3];
    for (int a = 0; a < 3; a++) place[a] = sf_random_float(seed, stream, base + 2 + a);
    sf_occupancy_point(&t->model.config, cell, place, x);
    t->backbone->probe(t, stream, base, x, i, p);
  }
}

void sf_probe(const sf_model *m, const sf_probes *p, int index, int steps)
{
  float sigma[SF_T_MAX], colour[3 * SF_T_MAX];
  const float *f = p->f + index * p->features;
  sf_net_sample(m, f, p->sh + index * SF_DIR_FEATURES, steps, sigma, colour, p->trace);
}

void sf_init_uniform(const sf_trainer *t, int id, float bound, uint64_t stream, uint64_t base)
{
  const sf_param *p = &t->model.param[id];
  float *value = t->model.value + p->offset;
  for (size_t i = 0; i < p->size; i++)
    value[i] = bound * (2 * sf_random_float(t->options.seed, stream, base + p->offset + i) - 1);
}

void sf_layer_redraw(sf_trainer *t, int layer, uint64_t stream)
{
  const int id = sf_layer_weights[layer];
  sf_init_uniform(t, id, 1 / sqrtf((float)t->model.param[id].shape[1]), stream, (uint64_t)t->iteration << 32);
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

void sf_layer_scale(sf_trainer *t, int layer, const sf_probes *probes)
{
  const sf_config *c = &t->model.config;
  const int id = sf_layer_weights[layer];
  const double target[SF_LAYERS] = {c->theta[0], 0.5, c->theta[1], c->theta[2], 0.5};
  const double rms = current_rms(&t->model, probes, layer, (int)t->model.param[id].shape[0]);
  if (!(rms > 1e-12 && rms < 1e12)) return; /* silent input: no scale helps */
  float *w = sf_model_param(&t->model, id);
  for (size_t i = 0; i < t->model.param[id].size; i++) w[i] *= (float)(target[layer] / rms);
}

sf_status sf_init_parameters(sf_trainer *t)
{
  t->backbone->init(t);
  for (int layer = 0; layer < SF_LAYERS; layer++)
    if (sf_model_has(&t->model, sf_layer_weights[layer])) sf_layer_redraw(t, layer, RNG_INIT);
  sf_probes probes;
  SF_TRY(sf_probes_create(&probes, t));
  sf_probes_draw(t, RNG_PROBE, PROBES, &probes);
  for (int i = 0; i < PROBES * probes.features; i++) probes.f[i] *= t->backbone->growth;
  for (int layer = 0; layer < SF_LAYERS; layer++)
    if (sf_model_has(&t->model, sf_layer_weights[layer])) sf_layer_scale(t, layer, &probes);
  sf_probes_free(&probes);
  return sf_ok();
}
