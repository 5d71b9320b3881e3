/* Weights of a model for the kernels. */
#ifndef SF_RENDER_VIEW_H
#define SF_RENDER_VIEW_H
#include "snn/kernels.h"

sf_net_view sf_net_view_of(const sf_model *model);
#endif
