/* What rays of a net along rays cost. */
#include "render/render.h"

void sf_count_lane(const sf_net_view *net, const sf_block *b, int first, int lane, uint64_t spikes[3])
{
  const float *const membrane[3] = {b->m1[0], b->m3[0], b->m4[0]};
  for (int l = first; l < 3; l++) {
    const float *m = membrane[l] + lane * net->hidden;
    for (int i = 0; i < net->hidden; i++) spikes[l] += m[i] >= net->theta[l];
  }
}

void sf_events_add(sf_ray_events *to, const sf_ray_events *events)
{
  to->rays += events->rays, to->samples += events->samples;
  for (int l = 0; l < 3; l++) to->spikes[l] += events->spikes[l];
}
