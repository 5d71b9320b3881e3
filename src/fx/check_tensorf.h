/* Inside src/fx: the ranges of a TensoRF scene's field. */
#ifndef SF_FX_CHECK_TENSORF_H
#define SF_FX_CHECK_TENSORF_H
#include "fx/fx.h"

sf_status fx_check_tensorf_sizes(const fx_tensorf *field, int inputs, const char *path); /* inputs: of the decoder */
sf_status fx_check_tensorf(const fx_tensorf *field, const char *path);                   /* the rest */
#endif
