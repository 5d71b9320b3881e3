/* The two halves of sf_model_create: a file's tensors are checked against the layout before memory is asked for. */
#ifndef SF_FIELD_LAYOUT_H
#define SF_FIELD_LAYOUT_H
#include "field/model.h"

/* Checks the configuration and lays out the parameters; no memory. */
sf_status sf_model_lay_out(sf_model *model, const sf_config *config);
sf_status sf_model_allocate(sf_model *model);
#endif
