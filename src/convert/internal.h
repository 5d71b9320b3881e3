/* What both parts share: random rays, and the samples along one. */
#ifndef SF_CONVERT_INTERNAL_H
#define SF_CONVERT_INTERNAL_H
#include "convert/convert.h"

/* A random pixel of a view with a picture: its ray, and its colour over white. SF_E_FORMAT: no view has one. */
typedef struct convert_ray {
  float origin[3], direction[3], truth[3], sh[SF_DIR_FEATURES];
} convert_ray;
sf_status convert_pick(const sf_dataset *views, uint64_t seed, uint64_t index, convert_ray *ray);

/* What a net reads of the sample at x, in [0,1]^3, and the density per model unit if the field knows it by itself. */
typedef struct convert_point {
  float in[SF_DECODER_MAX], sigma;
} convert_point;
/* False: the net does not see it, because its weight is too small. Only a field that knows its densities can tell. */
bool convert_read(const sf_model *twin, const convert_ray *ray, const float x[3], float transmittance, float length,
                  convert_point *point);
#endif
