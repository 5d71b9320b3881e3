/* For the tests of the audit: rays through the box; a net that can be counted by hand. */
#ifndef SF_TESTS_AUDIT_FIXTURE_H
#define SF_TESTS_AUDIT_FIXTURE_H
#include "tests/fx_fixture.h"

/* A ray along x at a random place; one of seven misses the box. */
static inline void audit_ray(uint64_t index, fx_ray *ray)
{
  memset(ray, 0, sizeof *ray);
  if (index % 7 == 3) return; /* misses the box */
  for (int axis = 1; axis < 3; axis++)
    ray->origin[axis] = (int64_t)sf_random_below(9, (uint64_t)axis, index, 1 << 24) << 16;
  ray->step[0] = (int64_t)800000 << 16, ray->unit[0] = 1 << 14;
  ray->count = 20;
  fixture_inputs(8, index, ray->dir, FX_SH, 1024);
}

/* A net small enough to count by hand: 4 -> 3 -> 3 (1 density, 2 h); 3 d + 2 h -> 4 -> 5 -> 3. */
static inline fx_net small_net(void)
{
  fx_net net = {.steps = 2, .mode = FX_HYBRID};
  static const int size[SF_LAYERS][2] = {{4, 3}, {3, 3}, {5, 4}, {4, 5}, {5, 3}};
  for (int l = 0; l < SF_LAYERS; l++) net.layer[l].n_in = size[l][0], net.layer[l].n_out = size[l][1];
  return net;
}

typedef uint64_t bitmaps[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS];
static const bitmaps small_spikes = {[FX_D1] = {{0x5}, {0x3}}, [FX_C1] = {{0x0}, {0xa}}, [FX_C2] = {{0x1f}, {0x10}}};
#endif
