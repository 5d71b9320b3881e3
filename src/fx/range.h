/* Inside src/fx: a field of a scene and its range. */
#ifndef SF_FX_RANGE_H
#define SF_FX_RANGE_H
#include "fx/fx.h"

static inline sf_status in_range(const char *path, const char *owner, const char *field, int64_t value, int64_t low,
                                 int64_t high)
{
  if (value >= low && value <= high) return sf_ok();
  return sf_fail(SF_E_RANGE, "%s: %s.%s is %lld, expected %lld..%lld", path, owner, field, (long long)value,
                 (long long)low, (long long)high);
}
#endif
