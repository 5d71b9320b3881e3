/* One sample through both nets, with what happened on the way. */
#ifndef SF_FX_NET_H
#define SF_FX_NET_H
#include "fx/fx.h"

typedef struct fx_events {
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS]; /* bitmaps, of D1, C1, C2 */
  uint64_t saturated[SF_LAYERS];
} fx_events;

/* fx_net_sample without the counting. trace may be NULL; its spikes are left to the caller. */
void fx_net_events(const fx_net *net, const int16_t *f, const int32_t *base, fx_out *out, fx_events *events,
                   fx_trace *trace);
#endif
