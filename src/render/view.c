#include "render/view.h"
#include "snn/plif.h"
#include <string.h>

sf_net_view sf_net_view_of(const sf_model *m)
{
  sf_net_view v = {.w1 = sf_model_param(m, SF_P_D1),
                   .w2 = sf_model_param(m, SF_P_D2),
                   .w3 = sf_model_param(m, SF_P_C1),
                   .w4 = sf_model_param(m, SF_P_C2),
                   .w5 = sf_model_param(m, SF_P_C3),
                   .h_step = sf_scales_h_step(&m->scales),
                   .hidden = m->config.hidden,
                   .features = 2 * m->config.levels,
                   .mode = m->config.mode,
                   .relu = m->config.net == SF_NET_ANN,
                   .along = m->config.along};
  for (int i = 0; i < SF_LAYERS; i++) v.k[i] = sf_sigmoid(sf_model_param(m, SF_P_LEAK)[i]);
  memcpy(v.theta, m->config.theta, sizeof v.theta);
  return v;
}

sf_decoder_view sf_decoder_view_of(const sf_model *m)
{
  const sf_tensorf *f = &m->config.tensorf;
  sf_decoder_view v = {.net = {.w4 = sf_model_param(m, SF_P_C2),
                               .w5 = sf_model_param(m, SF_P_C3),
                               .hidden = m->config.hidden,
                               .mode = m->config.mode,
                               .relu = m->config.net == SF_NET_ANN,
                               .along = m->config.along},
                       .w1 = sf_model_param(m, SF_P_C1),
                       .b1 = sf_model_param(m, SF_P_C1_BIAS),
                       .b2 = sf_model_param(m, SF_P_C2_BIAS),
                       .b3 = sf_model_param(m, SF_P_C3_BIAS),
                       .basis = sf_model_param(m, SF_P_BASIS),
                       .inputs = sf_tensorf_inputs(f),
                       .features = f->features,
                       .feature_freqs = f->feature_freqs,
                       .columns = sf_tensorf_products(f),
                       .feature_step = sf_scales_feature_step(&m->scales),
                       .encoding_step = sf_scales_direction_step(&m->scales),
                       .products = (sf_tensorf_products(f) + 15) / 16 * 16};
  for (int i = 0; i < SF_LAYERS; i++) v.net.k[i] = sf_sigmoid(sf_model_param(m, SF_P_LEAK)[i]);
  memcpy(v.net.theta, m->config.theta, sizeof v.net.theta);
  return v;
}

sf_vm_field sf_vm_field_of(const sf_model *m, bool appearance)
{
  const sf_tensorf *f = &m->config.tensorf;
  const int first = appearance ? SF_P_APP_PLANE : SF_P_DENSITY_PLANE;
  sf_vm_field v = {.relu = f->activation == SF_RELU, .shift = f->shift, .distance_scale = f->distance_scale};
  for (int i = 0; i < 3; i++) {
    v.plane[i] = sf_model_param(m, first + i);
    v.line[i] = sf_model_param(m, first + 3 + i);
    v.resolution[i] = f->resolution[i];
    v.channels[i] = appearance ? f->appearance[i] : f->density[i];
  }
  return v;
}
