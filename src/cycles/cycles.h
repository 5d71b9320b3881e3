/* Cycle model of the accelerator: the control of rtl/sf_core.sv and its neighbours with counts in place of bitmaps, so
 * that whole frames get latency, frames per second and utilisation. Equal to the RTL's cycle counter when the streams
 * never make it wait (tests/test_rtl.c). It begins where features come in: the encoder of a hash grid, its cache and
 * its memory are not in it, and tests/bench_field.c measures what they add to a frame. Of TensoRF planes.h has them. */
#ifndef SF_CYCLES_CYCLES_H
#define SF_CYCLES_CYCLES_H
#include "fx/fx.h"

/* How much hardware a build of the accelerator has (parameters of rtl/sf_top.sv). Results do not depend on it. */
typedef struct sf_engine {
  int macs;          /* multipliers of D1 and C1, and lanes that are worked on at once */
  int neurons;       /* neuron units, at most macs */
  int steps_at_once; /* steps of C2 that are summed up side by side: 1, 2, 4 or 8 */
} sf_engine;

static const sf_engine sf_engine_default = {SF_MACS, SF_NEURONS, SF_STEPS_AT_ONCE};

/* What the engine's time depends on, of one sample: the steps at which each neuron of D1, C1, C2 fired, bit t for step
 * t. */
typedef struct sf_cycle_sample {
  bool first;                     /* of a new ray: brings a direction */
  uint64_t first_beat, last_beat; /* clock cycles at which its packet comes; 0: without a gap behind the one before */
  uint8_t fired[FX_SPIKING][SF_LANES];
} sf_cycle_sample;

typedef struct sf_cycle_totals {
  uint64_t samples, cycles; /* cycles: from the first beat in until the last beat out is gone */
  uint64_t busy[SF_LAYERS]; /* cycles in which the layer added up a row */
  uint64_t any_busy;        /* cycles in which one of them did */
  uint64_t waits;           /* cycles in which D1 had no sample */
  uint64_t stalls;          /* cycles in which the sums of D2 or C3 waited for the readout */
} sf_cycle_totals;

typedef struct sf_cycle_model sf_cycle_model;

/* For nets of these sizes, on a build of this size. NULL when out of memory. */
sf_cycle_model *sf_cycle_model_create(const fx_net *net, const sf_engine *engine);
/* trace: of fx_net_sample on the net. */
sf_cycle_sample sf_cycle_sample_make(const fx_net *net, const fx_trace *trace, bool first);
/* The sample follows the ones before without a gap. */
void sf_cycle_model_add(sf_cycle_model *model, const sf_cycle_sample *sample);
/* Until the block is empty. More samples may follow, as after a pause. */
void sf_cycle_model_drain(sf_cycle_model *model);
const sf_cycle_totals *sf_cycle_model_totals(const sf_cycle_model *model);
void sf_cycle_model_free(sf_cycle_model *model);

/* Samples of rays, one ray behind the other; zero it first. */
typedef struct sf_cycle_record {
  sf_cycle_sample *at;
  size_t count, room;
} sf_cycle_record;
/* The ray through the portable core; its samples are added. */
sf_status sf_cycle_record_ray(sf_cycle_record *record, const fx_scene *scene, const fx_ray *ray);
/* A sample with the trace of fx_net_sample. */
sf_status sf_cycle_record_add(sf_cycle_record *record, const fx_net *net, const fx_trace *trace, bool first);
void sf_cycle_record_free(sf_cycle_record *record);

/* From sums alone: what the multipliers of D1 and C1, or the busiest layer fed by spikes, need for their rows. */
uint64_t sf_cycles_least(const fx_net *net, const fx_counts *counts, const sf_engine *engine);
/* Of a dense net of the same sizes: every weight of a sample once, SF_LANES a cycle. */
uint64_t sf_cycles_dense(const fx_net *net);
#endif
