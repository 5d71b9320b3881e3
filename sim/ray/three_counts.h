/* The same rays counted three times: by the core, by the accelerator, from the spike bitmaps. */
#ifndef SF_SIM_RAY_THREE_COUNTS_H
#define SF_SIM_RAY_THREE_COUNTS_H
#include "energy/energy.h"
#include "sim/dut.h"

typedef struct sf_three_job {
  const fx_scene *scene;
  const uint64_t *index; /* the rays */
  int rays;
  sf_status (*ray)(void *user, uint64_t index, fx_ray *ray);
  void (*name)(void *user, uint64_t index, char *text, size_t size); /* of a ray, for messages */
  bool (*tick)(void *user, int done);                                /* false stops; may be NULL */
  void *user;
  sf_dut_options dut;
  fx_cache_shape cache;                         /* as in sf_measure_job */
  uint64_t (*tile)(void *user, uint64_t index); /* as in sf_measure_job */
} sf_three_job;

/* The caller sets `wanted` of counts; everything else is set here. Each sample goes through core and accelerator.
 * Outputs, spike bitmaps and, after each ray, all counters are compared. So a difference names ray, sample, layer, step
 * and event, and for a spike the neuron. A difference is no failure: it is in counts->agreement, for the report. */
sf_status sf_three_counts_run(const sf_three_job *job, sf_three_counts *counts);
#endif
