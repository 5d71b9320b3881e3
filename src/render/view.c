#include "render/view.h"
#include "snn/plif.h"
#include <string.h>

sf_net_view sf_net_view_of(const sf_model *m)
{
  sf_net_view v = {.w1 = sf_model_param(m, SF_P_W1),
                   .w2 = sf_model_param(m, SF_P_W2),
                   .w3 = sf_model_param(m, SF_P_W3),
                   .w4 = sf_model_param(m, SF_P_W4),
                   .w5 = sf_model_param(m, SF_P_W5),
                   .h_step = sf_scales_h_step(&m->scales),
                   .hidden = m->config.hidden,
                   .features = 2 * m->config.levels,
                   .mode = m->config.mode,
                   .relu = m->config.net == SF_NET_ANN};
  for (int i = 0; i < SF_LAYERS; i++) v.k[i] = sf_sigmoid(sf_model_param(m, SF_P_LEAK)[i]);
  memcpy(v.theta, m->config.theta, sizeof v.theta);
  return v;
}
