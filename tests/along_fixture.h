/* A naive net along rays: it carries its membranes from sample to sample. */
#ifndef SF_TESTS_ALONG_FIXTURE_H
#define SF_TESTS_ALONG_FIXTURE_H
#include "float_fixture.h"
#include "snn/plif.h"
#include <string.h>

/* Every layer fires, and none always. */
static inline void drive(sf_model *m)
{
  static const struct {
    int id;
    float gain;
  } by[] = {{SF_P_D1, 4}, {SF_P_C1, 3}, {SF_P_C2, 3}};
  for (int k = 0; k < 3; k++)
    for (size_t i = 0; i < m->param[by[k].id].size; i++) sf_model_param(m, by[k].id)[i] *= by[k].gain;
}

typedef struct naive {
  const sf_model *m;
  float v[3][SF_LANES];
  int before; /* samples of this ray */
  uint64_t spikes[3];
} naive;

static inline void naive_fire(naive *n, int layer, const float *current, float *s)
{
  static const int leak_of[3] = {0, 2, 3};
  const sf_config *c = &n->m->config;
  const float k = sf_sigmoid(sf_model_param(n->m, SF_P_LEAK)[leak_of[layer]]), theta = c->theta[layer];
  for (int i = 0; i < c->hidden; i++) {
    const float v = n->before ? n->v[layer][i] : 0;
    const float h = sf_plif_charge((sf_input_mode)c->mode, n->before, k, v, current[i]);
    s[i] = h >= theta ? 1 : 0;
    n->v[layer][i] = h - s[i] * theta;
    n->spikes[layer] += h >= theta;
  }
}

static inline void naive_multiply(const sf_model *m, int id, int first, int n_in, const float *in, float *out)
{
  const int columns = (int)m->param[id].shape[1];
  for (int o = 0; o < m->param[id].shape[0]; o++)
    for (int i = 0; i < n_in; i++) out[o] += sf_model_param(m, id)[o * columns + first + i] * in[i];
}

static inline void naive_bias(const sf_model *m, int id, float *out)
{
  for (size_t i = 0; i < m->param[id].size; i++) out[i] += sf_model_param(m, id)[i];
}

/* in: features, or a decoder's inputs; sh: harmonics, of a hash grid. */
static inline void naive_sample(naive *n, const float *in, const float *sh, float *sigma, float colour[3])
{
  const sf_model *m = n->m;
  const int hidden = m->config.hidden;
  float s[SF_LANES], i[SF_DENSITY_OUT] = {0}, current[SF_LANES] = {0}, j[3] = {0};
  if (sf_model_decodes(m)) {
    naive_multiply(m, SF_P_C1, 0, sf_tensorf_inputs(&m->config.tensorf), in, current);
  } else {
    naive_multiply(m, SF_P_D1, 0, 2 * m->config.levels, in, current);
    naive_fire(n, 0, current, s);
    naive_multiply(m, SF_P_D2, 0, hidden, s, i);
    *sigma = expf(i[0]);
    memset(current, 0, sizeof current);
    naive_multiply(m, SF_P_C1, 0, SF_DIR_FEATURES, sh, current);
    naive_multiply(m, SF_P_C1, SF_DIR_FEATURES, SF_GEO_FEATURES, i + 1, current);
  }
  naive_bias(m, SF_P_C1_BIAS, current);
  naive_fire(n, 1, current, s);
  memset(current, 0, sizeof current);
  naive_multiply(m, SF_P_C2, 0, hidden, s, current);
  naive_bias(m, SF_P_C2_BIAS, current);
  naive_fire(n, 2, current, s);
  naive_multiply(m, SF_P_C3, 0, hidden, s, j);
  naive_bias(m, SF_P_C3_BIAS, j);
  for (int c = 0; c < 3; c++) colour[c] = sf_sigmoid(j[c]);
  n->before++;
}
#endif
