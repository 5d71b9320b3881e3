/* Rendering of one backbone, behind sf_render_rays. */
#ifndef SF_RENDER_RENDER_H
#define SF_RENDER_RENDER_H
#include "snn/kernels.h"

/* Spikes of the block's lane, a net along rays. first: 0, or 1 of a decoder. */
void sf_count_lane(const sf_net_view *net, const sf_block *block, int first, int lane, uint64_t spikes[3]);

/* As sf_render_counted, with steps in 1..T. rgb [pictures][count][3]: after steps - pictures + 1 to
 * steps steps. */
sf_status sf_render_tensorf(const sf_model *model, const float *origin, const float *direction, size_t count, int steps,
                            int pictures, const float background[3], float *rgb, float *depth, float *alpha,
                            float *samples, sf_ray_events *events);
#endif
