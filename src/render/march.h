/* Marching a ray through the scene box over the occupied cells of the occupancy grids. */
#ifndef SF_RENDER_MARCH_H
#define SF_RENDER_MARCH_H
#include "snn/kernels.h"

/* sf_steps_make, and where the model is empty: marches skip blocks of 8 x 8 x 8 empty cells. They find the same points
 * as with the intervals of sf_steps_make alone. To be called again when the occupancy has changed. */
sf_status sf_march_steps(sf_steps *steps, const sf_model *model, int stride);

/* jitter in [0,1) places the samples inside their interval (0.5 = centre). */
sf_march sf_march_begin(const sf_model *model, const sf_steps *steps, const float origin[3], const float direction[3],
                        float jitter);

/* Position of point n in [0,1]^3. */
void sf_march_at(const sf_march *march, int n, float x[3]);

/* Next point >= n in an occupied cell, or -1. x: its position in [0,1]^3. The cell is that of the finest cascade which
 * holds the point and whose cells are longer than the interval. */
int sf_march_next(const sf_march *march, int n, float x[3]);

static inline float sf_march_distance(const sf_march *march, int n)
{
  return march->lattice.first + march->steps->length[n] * march->jitter + march->steps->start[n];
}
#endif
