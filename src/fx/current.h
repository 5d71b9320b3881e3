/* Currents: exact sums of weight rows. */
#ifndef SPIKEFIELD_FX_CURRENT_H
#define SPIKEFIELD_FX_CURRENT_H
#include "spikefield/fx.h"

/* acc[o] += x[i] * w[i][o] over n_in rows, o < n. |x| <= 2047, n_in <= 32: |acc| < 2^23. */
void fx_current_mac(int32_t *acc, const int8_t *w, const int16_t *x, int n_in, int n);
/* acc[o] = sum of w[i][o] over the rows whose bit is set, o < n. At most 128 rows: |acc| <= 16256. */
void fx_current_spikes(int32_t *acc, const int8_t *w, const uint64_t spikes[2], int n);
#endif
