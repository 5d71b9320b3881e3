/* What the benchmarks of core and accelerator work on. */
#ifndef SF_TESTS_BENCH_RIG_H
#define SF_TESTS_BENCH_RIG_H
#include "src/fx/core.h"

enum { RIG_STEPS = 3, RIG_RAY = 8 /* samples per ray */ };

/* A scene of the full size with random weights; every spiking layer fires at the same rate. */
typedef struct rig {
  fx_scene scene;
  fx_core *core;
  fx_block *block;
  fx_scratch *scratch;
  fx_ray ray[FX_BLOCK / RIG_RAY]; /* directions alone */
  int32_t base[FX_BLOCK][SF_LANES];
} rig;

/* rate: spikes per neuron and step. kernels: as fx_core_open. */
sf_status rig_open(rig *r, const char *kernels, double rate);
/* The same of a decoder with biases: random inputs in block->constant, no grid, no rays. */
sf_status rig_open_decoder(rig *r, int inputs, int steps, double rate);
void rig_close(rig *r);
void rig_random_positions(fx_block *b, uint64_t stream);
#endif
