/* Inside src/fx: whether a scene can be computed with. */
#ifndef SF_FX_CHECK_H
#define SF_FX_CHECK_H
#include "fx/fx.h"

/* Sizes alone: everything that memory is allocated and indexed by. */
sf_status fx_check_sizes(const fx_scene *scene, const char *path);
#endif
