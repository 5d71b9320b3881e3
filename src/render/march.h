/* Marching a ray through the scene box [-1,1]^3 over the occupied cells of the occupancy grid. */
#ifndef SF_RENDER_MARCH_H
#define SF_RENDER_MARCH_H
#include "spikefield/model.h"

typedef struct sf_march {
  const uint8_t *occupancy;
  int res;
  float origin[3], direction[3];
  sf_lattice lattice;
} sf_march;

/* stride >= 1 coarsens the lattice; jitter in [0,1) places the samples inside their interval (0.5 = centre). */
sf_march sf_march_begin(const sf_model *model, const float origin[3], const float direction[3], int stride,
                        float jitter);

/* Position of lattice point n in [0,1]^3. */
void sf_march_at(const sf_march *march, int n, float x[3]);

/* Next lattice point >= n in an occupied cell, or -1. x: its position in [0,1]^3. */
int sf_march_next(const sf_march *march, int n, float x[3]);

static inline float sf_march_distance(const sf_march *march, int n)
{
  return march->lattice.first + (float)n * march->lattice.step;
}
#endif
