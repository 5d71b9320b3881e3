/* One sample: the fixed-point core against what the accelerator showed. */
#ifndef SF_SIM_COMPARE_H
#define SF_SIM_COMPARE_H
#include "sim/dut.h"

/* layer, step, neuron are -1 where they do not apply. */
typedef struct sf_difference {
  int layer, step, neuron;
  const char *wire; /* "spike", "row", "membrane", "sigma", "colour" or a counter's name */
  int64_t expected, actual;
  uint64_t cycle;
} sf_difference;

/* In the order in which a sample passes through the layers, whenever the hardware showed each; false and the first
 * difference when there is one. "row": presynaptic neuron `neuron` was or was not added up in this layer. trace may be
 * NULL: no rows and membranes.
 */
bool sf_compare_sample(const fx_net *net, const fx_trace *core, const fx_out *core_out, const sf_dut_result *result,
                       const sf_dut_trace *trace, sf_difference *difference);
/* Events per layer and step, samples, rays. */
bool sf_compare_counts(const fx_counts *core, const fx_counts *dut, uint64_t cycle, sf_difference *difference);
/* The same of whole rays, as a status. A decoder, whose rays have no directions, counts no rays. */
sf_status sf_compare_ray_counts(const fx_net *net, const fx_counts *core, const fx_counts *rtl);
sf_status sf_compare_pixel(const fx_pixel *core, const fx_pixel *rtl, uint64_t cycle);
#endif
