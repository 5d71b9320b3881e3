/* Currents, event-driven: one weight row per nonzero value or firing neuron, nothing for silent ones.
 * Mirror: rtl/sf_values.sv (values), rtl/sf_sums.sv (spikes)
 *
 * Sums are exact in any order. Rows are handled 16 lanes at a time and loops have a constant trip count, so that
 * the compiler keeps the accumulators of a strip in registers. */
#include "src/fx/current.h"
#include "src/fx/nofloat.h"

enum { STRIP = 16 };

static void mac_row(int32_t *restrict acc, const int8_t *restrict w, int16_t x, int n)
{
  for (int o = 0; o < n; o++) acc[o] += (int32_t)x * w[o];
}

void fx_current_mac(int32_t *acc, const int8_t *w, const int16_t *x, int n_in, int n)
{
  for (int i = 0; i < n_in; i++)
    if (x[i]) mac_row(acc, w + (size_t)i * SF_LANES, x[i], n);
}

static int list_spikes(uint8_t *index, const uint64_t spikes[SF_SPIKE_WORDS])
{
  int count = 0;
  for (int word = 0; word < SF_SPIKE_WORDS; word++)
    for (uint64_t bits = spikes[word]; bits; bits &= bits - 1)
      index[count++] = (uint8_t)(word * 64 + __builtin_ctzll(bits));
  return count;
}

void fx_current_spikes(int32_t *acc, const int8_t *w, const uint64_t spikes[SF_SPIKE_WORDS], const int8_t *bias, int n)
{
  uint8_t index[SF_LANES];
  const int count = list_spikes(index, spikes);
  for (int o = 0; o < n; o += STRIP) {
    int16_t sum[STRIP] = {0}; /* 257 * 127 < 2^15 */
    for (int lane = 0; bias && lane < STRIP; lane++) sum[lane] = bias[o + lane];
    for (int i = 0; i < count; i++) {
      const int8_t *row = w + (size_t)index[i] * SF_LANES + o;
      for (int lane = 0; lane < STRIP; lane++) sum[lane] = (int16_t)(sum[lane] + row[lane]);
    }
    for (int lane = 0; lane < STRIP; lane++) acc[o + lane] = sum[lane];
  }
}
