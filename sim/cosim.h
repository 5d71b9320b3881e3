/* The fixed-point core and the accelerator in lockstep, on the samples of real rays, in chunks. Outputs, spike bitmaps,
 * membranes, rows and every counter have to be equal. */
#ifndef SF_SIM_COSIM_H
#define SF_SIM_COSIM_H
#include "sim/replay.h"

typedef struct sf_cosim sf_cosim;

typedef struct sf_cosim_totals {
  fx_counts core, rtl;
  uint64_t samples, spikes; /* that the counts belong to; spikes: bits set in the bitmaps */
  uint64_t cycles, busy, stalls, layer_busy[SF_LAYERS];
} sf_cosim_totals;

void sf_cosim_totals_add(sf_cosim_totals *sum, const sf_cosim_totals *more);

/* Where the first difference is. `ray` is the number given to sf_cosim_ray, `sample` counts from 0 along the ray.
 * what.wire NULL: the accelerator gave no result, the status says how. */
typedef struct sf_cosim_place {
  bool found;
  uint64_t ray;
  uint64_t sample;
  bool exact; /* false: somewhere in the chunk of samples that begins here; single samples do not show the difference
                 again */
  sf_difference what;
} sf_cosim_place;

sf_status sf_cosim_open(sf_cosim **cosim, const fx_scene *scene, const sf_dut_options *options);
/* SF_E_DIFFERENCE when core and accelerator disagree; then sf_cosim_where says where. */
sf_status sf_cosim_ray(sf_cosim *cosim, uint64_t number, const fx_ray *ray);
/* Compares the samples that still wait for their chunk to fill. */
sf_status sf_cosim_finish(sf_cosim *cosim);
const sf_cosim_totals *sf_cosim_sum(const sf_cosim *cosim);
const sf_cosim_place *sf_cosim_where(const sf_cosim *cosim);
/* After a difference: all samples of its chunk up to it. sf_replay_shrink finds fewer. */
void sf_cosim_replay(const sf_cosim *cosim, sf_replay *replay);
void sf_cosim_close(sf_cosim *cosim);
#endif
