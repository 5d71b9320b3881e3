/* For the tests of the audit: rays through the box. */
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
#endif
