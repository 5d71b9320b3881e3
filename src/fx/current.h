/* Currents: exact sums of weight rows. */
#ifndef SF_FX_CURRENT_H
#define SF_FX_CURRENT_H
#include "fx/fx.h"

/* acc[o] += x[i] * w[i][o] over n_in rows, o < n. |x| <= 2047, n_in <= 161: |acc| < 2^26. */
void fx_current_mac(int32_t *acc, const int8_t *w, const int16_t *x, int n_in, int n);
/* acc[o] = bias[o] (NULL: 0) + sum of w[i][o] over the rows whose bit is set, o < n. At most 257 rows: |acc| < 2^15.
 */
void fx_current_spikes(int32_t *acc, const int8_t *w, const uint64_t spikes[SF_SPIKE_WORDS], const int8_t *bias, int n);
#endif
