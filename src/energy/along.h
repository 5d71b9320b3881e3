/* Energy of float nets that have no fixed-point scene. */
#ifndef SF_ENERGY_ALONG_H
#define SF_ENERGY_ALONG_H
#include "energy/energy.h"
#include "snn/model.h"

/* Paper ledger of what sf_render_counted counted. A model along rays: the products of D1's inputs and of h once a
 * sample, of a hash grid's directions once a ray, and an addition for every synapse behind a spike. The ReLU twin: a
 * product for every synapse, once a sample. Other models: as if they had no spikes. */
fx_cost sf_float_cost(const sf_model *model, const sf_ray_events *events);
#endif
