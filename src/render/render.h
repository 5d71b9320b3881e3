/* Rendering of one backbone, behind sf_render_rays. */
#ifndef SF_RENDER_RENDER_H
#define SF_RENDER_RENDER_H
#include "snn/model.h"

/* As sf_render_rays, with steps in 1..T. */
sf_status sf_render_tensorf(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                            const float background[3], float *rgb, float *depth, float *alpha, float *samples);
#endif
