#include "energy/energy.h"
#include <string.h>

sf_status sf_counts_compare(const fx_counts *a, const char *a_name, const fx_counts *b, const char *b_name)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    if (memcmp(&a->layer[l], &b->layer[l], sizeof a->layer[l]) == 0) continue;
    for (int t = 0; t < SF_T_MAX; t++)
      for (int e = 0; e < SF_EVENTS; e++) {
        uint64_t x = a->layer[l].event[e][t], y = b->layer[l].event[e][t];
        if (x != y)
          return sf_fail(SF_E_DIFFERENCE, "%s of layer %s at step %d: %s %llu, %s %llu", sf_events[e].title,
                         fx_layer_name(l), t, a_name, (unsigned long long)x, b_name, (unsigned long long)y);
      }
  }
  if (a->samples == b->samples) return sf_ok();
  return sf_fail(SF_E_DIFFERENCE, "samples: %s %llu, %s %llu", a_name, (unsigned long long)a->samples, b_name,
                 (unsigned long long)b->samples);
}
