/* Weights of a model for the kernels. */
#ifndef SF_RENDER_VIEW_H
#define SF_RENDER_VIEW_H
#include "snn/kernels.h"

sf_net_view sf_net_view_of(const sf_model *model);
/* Of a TensoRF model: the decoder; the density or the appearance field. */
sf_decoder_view sf_decoder_view_of(const sf_model *model);
sf_vm_field sf_vm_field_of(const sf_model *model, bool appearance);
#endif
