/* Layout of the float model. */
#include "base/memory.h"
#include "field/field.h"
#include "field/layout.h"
#include <stdlib.h>
#include <string.h>

const int sf_layer_weights[SF_LAYERS] = {SF_P_D1, SF_P_D2, SF_P_C1, SF_P_C2, SF_P_C3};
const int sf_layer_bias[SF_LAYERS] = {-1, -1, SF_P_C1_BIAS, SF_P_C2_BIAS, SF_P_C3_BIAS};

/* The layers that the field's net has. */
static void lay_out_net(const sf_config *c, const sf_field *field, sf_param param[SF_P_COUNT])
{
  const int64_t hidden = c->hidden, inputs = field->inputs(c);
  const int64_t in_c1 = sf_field_decoded(field) ? inputs : SF_DIR_FEATURES + SF_GEO_FEATURES;
  const int64_t in[SF_LAYERS] = {inputs, hidden, in_c1, hidden, hidden};
  const int64_t out[SF_LAYERS] = {hidden, SF_DENSITY_OUT, hidden, hidden, 3};
  for (int l = 0; l < SF_LAYERS; l++) {
    if (field->weights[l])
      param[sf_layer_weights[l]] = (sf_param){.name = field->weights[l], .shape = {out[l], in[l]}, .dims = 2};
    if (field->bias[l]) param[sf_layer_bias[l]] = (sf_param){.name = field->bias[l], .shape = {out[l]}, .dims = 1};
  }
  param[SF_P_LEAK] = (sf_param){.name = "leak", .shape = {SF_LAYERS, 1}, .dims = 1};
}

/* Offsets and sizes of the parts whose names and shapes are there. */
static void place_params(sf_model *m)
{
  for (int i = 0; i < SF_P_COUNT; i++) {
    sf_param *p = &m->param[i];
    p->offset = m->size;
    p->size = p->name != NULL;
    for (int d = 0; d < p->dims; d++) p->size *= (size_t)p->shape[d];
    m->size += (p->size + 15) / 16 * 16;
  }
}

sf_status sf_model_lay_out(sf_model *m, const sf_config *config)
{
  memset(m, 0, sizeof *m);
  SF_TRY(sf_config_check(config));
  m->config = *config;
  const sf_field *field = sf_field_of(config);
  field->lay_out(m, m->param);
  lay_out_net(config, field, m->param);
  place_params(m);
  return sf_ok();
}

sf_status sf_model_allocate(sf_model *m)
{
  const sf_config *config = &m->config;
  size_t bytes = m->size * sizeof(float), cells = sf_config_cells(config);
  m->value = sf_aligned_alloc(bytes);
  m->occupancy = malloc(cells / 8);
  if (!m->value || !m->occupancy) {
    sf_model_free(m);
    return sf_fail(SF_E_MEMORY, "model: no memory for %zu parameters", bytes / sizeof(float));
  }
  memset(m->occupancy, 0xff, cells / 8);
  m->t_star = (float)config->steps;
  m->t_r = config->steps;
  return sf_ok();
}

sf_status sf_model_create(sf_model *m, const sf_config *config)
{
  SF_TRY(sf_model_lay_out(m, config));
  return sf_model_allocate(m);
}

void sf_model_free(sf_model *m)
{
  free(m->value);
  free(m->occupancy);
  memset(m, 0, sizeof *m);
}
