/* Weights of a model as the kernels read them, and features of one block. */
#ifndef SF_RENDER_VIEW_H
#define SF_RENDER_VIEW_H
#include "snn/kernels.h"

sf_net_view sf_net_view_of(const sf_model *model);

/* Aligned for vectors; NULL when there is no memory. */
void *sf_aligned_alloc(size_t bytes);
#endif
