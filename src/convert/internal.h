/* What both parts share: random rays, and the samples along one. */
#ifndef SF_CONVERT_INTERNAL_H
#define SF_CONVERT_INTERNAL_H
#include "convert/convert.h"

/* A random pixel of a view with a picture: its ray, and its colour over white. SF_E_FORMAT: no view has one. */
typedef struct convert_ray {
  float origin[3], direction[3], truth[3], sh[SF_DIR_FEATURES];
} convert_ray;
sf_status convert_pick(const sf_dataset *views, uint64_t seed, uint64_t index, convert_ray *ray);
#endif
