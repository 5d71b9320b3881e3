/* Inside src/bounds: one ray of a picture, beside the core's. */
#ifndef SF_BOUNDS_PICTURE_RAY_H
#define SF_BOUNDS_PICTURE_RAY_H
#include "bounds/exact.h"

/* All that one ray yields. */
typedef struct picture_ray {
  double rgb[3];
  uint64_t samples, flips[SF_LAYERS], decisions[SF_LAYERS], sample_flips, points;
  sf_current_row current[SF_LAYERS];
  sf_status status;
} picture_ray;

/* Pixel of ray i. */
void picture_pixel(const sf_picture_job *job, uint64_t i, int *x, int *y);
/* What a thread needs; free() it. NULL without memory. `real`: all blocks, for the errors of currents, or NULL. */
struct picture_tracer *picture_tracer_create(const sf_exact *exact, const sf_exact *real);
/* With no block replaced the ray must be the core's: SF_E_DIFFERENCE. */
sf_status picture_trace(struct picture_tracer *tracer, const sf_picture_job *job, uint64_t i, picture_ray *result);
#endif
