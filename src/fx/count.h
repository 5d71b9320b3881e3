/* Event counters of the nets; the definition of each event is in fx.h. */
#ifndef SPIKEFIELD_FX_COUNT_H
#define SPIKEFIELD_FX_COUNT_H
#include "spikefield/fx.h"

void fx_count_direction(fx_counts *counts, const fx_net *net);
/* spikes[layer][step]: bitmaps of one sample. */
void fx_count_sample(fx_counts *counts, const fx_net *net, const uint64_t spikes[SF_LAYERS][SF_T_MAX][2]);
#endif
