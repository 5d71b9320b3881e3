/* What streams through a block while its nets are recorded: samples through sf_top, or rays through sf_ray_top. */
#ifndef SF_SIM_ACTIVITY_FLOW_H
#define SF_SIM_ACTIVITY_FLOW_H
#include "sim/lockstep.h"
#include "sim/sim.h"

typedef struct sf_flow {
  sf_dut *dut;              /* programmed, nothing sent yet; dut->received counts what came out of `items` */
  uint64_t items;           /* samples or rays; at least 1 */
  uint64_t rays, samples;   /* samples: those of the core */
  uint64_t lookups, misses; /* of the field's cache, after compare; of samples 0 */
  /* Streams all items. Its cycles begin with the first one at the input and end with the last result. */
  sf_status (*run)(struct sf_flow *flow);
  /* After run. SF_E_DIFFERENCE: a result or a counter is not the core's. */
  sf_status (*compare)(struct sf_flow *flow);
  void (*close)(struct sf_flow *flow);
} sf_flow;

/* The first `rays` rays of the loaded lockstep, which must outlive the flow. *flow is NULL after a failure. A run
 * without a sample is SF_E_FORMAT. */
sf_status sf_flow_samples(sf_flow **flow, const sf_lockstep *lockstep, const sf_dut_options *options);
/* Each ray is a tile of its own: its cache begins empty. */
sf_status sf_flow_rays(sf_flow **flow, const sf_lockstep *lockstep, const sf_dut_options *options);

/* Ray number `ray` of the lockstep; SF_E_STOPPED when the program is interrupted. */
sf_status sf_flow_ray(const sf_lockstep *lockstep, int ray, fx_ray *out);
sf_status sf_flow_empty(const sf_lockstep *lockstep);
#endif
