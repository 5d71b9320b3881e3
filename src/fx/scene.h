/* Bytes of a scene's field and occupancy. */
#ifndef SF_FX_SCENE_H
#define SF_FX_SCENE_H
#include "fx/fx.h"

uint64_t fx_grid_bytes(const fx_grid *grid); /* read for one sample */
size_t fx_occupancy_bytes(const fx_scene *scene);
#endif
