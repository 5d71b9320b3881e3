/* Cycle model of the accelerator: the control of rtl/sf_core.sv and its neighbours with counts in place of bitmaps, so
 * that whole frames get latency, frames per second and utilisation. Equal to the RTL's cycle counter when the streams
 * never make it wait (tests/test_rtl.c). */
#ifndef SF_CYCLES_CYCLES_H
#define SF_CYCLES_CYCLES_H
#include "fx/fx.h"

/* What the engine's time depends on, of one sample: pairs of weight rows, that is the larger of the numbers of even and
 * of odd neurons that fired; for D2 and C3 at any step, for C2 at each. 0..LANES/2. */
typedef struct sf_cycle_sample {
  bool first; /* of a new ray: brings a direction */
  uint8_t d2, c3, c2[SF_T_MAX];
} sf_cycle_sample;

typedef struct sf_cycle_totals {
  uint64_t samples, cycles; /* cycles: from the first beat in until the last beat out is gone */
  uint64_t busy[SF_LAYERS]; /* cycles in which the layer added up a row */
  uint64_t any_busy;        /* cycles in which one of them did */
  uint64_t waits;           /* cycles in which D1 had no sample */
  uint64_t stalls;          /* cycles in which the sums of D2 or C3 waited for the readout */
} sf_cycle_totals;

typedef struct sf_cycle_model sf_cycle_model;

/* For nets of these sizes. NULL when out of memory. */
sf_cycle_model *sf_cycle_model_create(const fx_net *net);
/* trace: of fx_net_sample on the net. */
sf_cycle_sample sf_cycle_sample_make(const fx_net *net, const fx_trace *trace, bool first);
/* The sample follows the ones before without a gap. */
void sf_cycle_model_add(sf_cycle_model *model, const sf_cycle_sample *sample);
/* Until the block is empty. More samples may follow, as after a pause. */
void sf_cycle_model_drain(sf_cycle_model *model);
const sf_cycle_totals *sf_cycle_model_totals(const sf_cycle_model *model);
void sf_cycle_model_free(sf_cycle_model *model);

/* From sums alone: what the busiest layer needs for its rows. The model's cycles are about a tenth more, because even
 * and odd neurons do not fire in pairs and the busiest layer changes from sample to sample. */
uint64_t sf_cycles_least(const fx_net *net, const fx_counts *counts);
/* Of a dense net of the same sizes: every weight of a sample once, SF_LANES a cycle. */
uint64_t sf_cycles_dense(const fx_net *net);
#endif
