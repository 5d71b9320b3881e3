/* Event counters of the nets; the definition of each event is in fx.h. */
#ifndef SF_FX_COUNT_H
#define SF_FX_COUNT_H
#include "fx/fx.h"

/* All that the counters of any number of samples follow from. */
typedef struct fx_firing {
  uint64_t samples;
  uint64_t spikes[FX_SPIKING][SF_T_MAX];
  uint64_t fresh[FX_SPIKING][SF_T_MAX]; /* neurons that fired for the first time in their sample */
} fx_firing;

static inline void fx_firing_sum(fx_firing *sum, const fx_firing *more)
{
  uint64_t *to = (uint64_t *)sum;
  const uint64_t *from = (const uint64_t *)more;
  for (size_t i = 0; i < sizeof *sum / sizeof *to; i++) to[i] += from[i];
}

void fx_count_rays(fx_counts *counts, const fx_net *net, uint64_t rays);
void fx_count_firing(fx_counts *counts, const fx_net *net, const fx_firing *firing);

/* MACs of one ray that has a sample, and of one sample. */
uint64_t fx_macs_of_ray(const fx_net *net);
uint64_t fx_macs_of_sample(const fx_net *net);
#endif
