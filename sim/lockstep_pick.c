/* Which pixels a lockstep run looks through: a function of its seed. */
#include "sim/lockstep.h"
#include "base/rng.h"

enum { STREAM_VIEW = 1, STREAM_X, STREAM_Y };
_Static_assert((int)STREAM_Y < (int)SF_LOCKSTEP_STREAM, "streams are apart");

sf_lockstep_pixel sf_lockstep_pick(const sf_lockstep *l, uint64_t ray)
{
  const uint64_t seed = l->options.seed;
  sf_lockstep_pixel p = {.view = (int)sf_random_below(seed, STREAM_VIEW, ray, (uint64_t)l->data.count)};
  const sf_camera *camera = &l->data.view[p.view].camera;
  p.x = (int)sf_random_below(seed, STREAM_X, ray, (uint64_t)camera->width);
  p.y = (int)sf_random_below(seed, STREAM_Y, ray, (uint64_t)camera->height);
  return p;
}
