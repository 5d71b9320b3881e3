/* The Verilated accelerator behind a C interface. It is programmed only through firmware/'s driver over its
 * AXI4-Lite port; samples and results travel over its AXI4-Stream ports. */
#ifndef SF_SIM_DUT_H
#define SF_SIM_DUT_H
#include "fx/fx.h"

typedef struct sf_dut sf_dut;
typedef struct sf_dut_options {
  uint64_t seed;       /* of stalls and random reset values */
  int stall_percent;   /* chance per cycle of a bubble on input and of back-pressure on output, 0..90 */
  const char *wave;    /* FST file to write, or NULL */
  int wave_from;       /* the waveform begins when sample wave_from of a run is due at the input */
  const char *plusarg; /* passed to the simulation, or NULL */
  int memory_latency;  /* of sf_ray_top's memory, in cycles; 0: at random for each line */
} sf_dut_options;

typedef struct sf_dut_sample {
  const fx_ray *ray;
  bool first;       /* first sample of its ray: the direction is sent with it */
  const int16_t *f; /* [n_feature]; of a decoder, whose rays have no directions, [fx_net_constants] */
} sf_dut_sample;

/* What the accelerator showed of one sample. */
typedef struct sf_dut_result {
  fx_out out;
  uint64_t spikes[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS]; /* as fx_trace; from the tap port */
  uint64_t tap_cycle[SF_LAYERS][SF_T_MAX]; /* clock cycle of each tap beat; D2 and C3 have one, at step 0 */
  bool stalled[SF_LAYERS][SF_T_MAX];       /* a bubble or back-pressure since the layer\'s last beat */
  uint64_t cycle;                          /* clock cycle at which the result left */
} sf_dut_result;

sf_status sf_dut_open(sf_dut **dut, const fx_scene *scene, const sf_dut_options *options);
/* Streams n samples in and n results out, overlapping as the hardware allows. A hang is an error that names the cycle.
 */
sf_status sf_dut_run(sf_dut *dut, const sf_dut_sample *sample, int n, sf_dut_result *result);
int sf_dut_received(const sf_dut *dut); /* results of the last run, the one that failed included */
/* More of the same samples, for a comparison that names the cause: membranes after reset (D1, C1, C2) and the
 * presynaptic rows that were added up (C2 per step; D2 and C3 of all steps together, at step 0). */
typedef struct sf_dut_trace {
  int32_t membrane[SF_LAYERS][SF_T_MAX][SF_LANES];
  uint64_t rows[SF_LAYERS][SF_T_MAX][SF_SPIKE_WORDS];
} sf_dut_trace;
sf_status sf_dut_run_traced(sf_dut *dut, const sf_dut_sample *sample, int n, sf_dut_result *result,
                            sf_dut_trace *trace);
/* After a run: clocks some more cycles. A result in one of them is an error. */
sf_status sf_dut_quiet(sf_dut *dut);
/* The accelerator's own counters, read through the CSR block (grid, march and saturation fields stay 0 unless the
 * hardware has them). */
sf_status sf_dut_counts(sf_dut *dut, fx_counts *counts, uint64_t *cycles, uint64_t *busy, uint64_t *stalls);
/* [SF_LAYERS], as of the last sf_dut_counts: cycles in which each layer added up rows. */
const uint64_t *sf_dut_layer_busy(const sf_dut *dut);
sf_status sf_dut_clear_counts(sf_dut *dut);
uint64_t sf_dut_cycle(const sf_dut *dut);
void sf_dut_close(sf_dut *dut);
#endif
