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

/* Compares in the order in which a sample passes through the layers, whenever the hardware showed each. Returns false
 * with the first difference. "row": the row of presynaptic neuron `neuron` was added up in this layer on one side only.
 * Without a trace (NULL), rows and membranes are not compared. */
bool sf_compare_sample(const fx_net *net, const fx_trace *core, const fx_out *core_out, const sf_dut_result *result,
                       const sf_dut_trace *trace, sf_difference *difference);
/* Events per layer and step, samples, rays. */
bool sf_compare_counts(const fx_counts *core, const fx_counts *dut, uint64_t cycle, sf_difference *difference);
/* Compares counts of whole rays and returns a status. A decoder counts no rays, because its rays have no directions. */
sf_status sf_compare_ray_counts(const fx_net *net, const fx_counts *core, const fx_counts *rtl);
sf_status sf_compare_pixel(const fx_pixel *core, const fx_pixel *rtl, uint64_t cycle);
#endif
