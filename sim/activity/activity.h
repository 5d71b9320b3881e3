/* Activity of a co-simulated run for power tools: SAIF and VCD of the cycles in which samples or rays stream, from the
 * first at the input to the last result. Programming and the reading of counters are left out. */
#ifndef SF_SIM_ACTIVITY_ACTIVITY_H
#define SF_SIM_ACTIVITY_ACTIVITY_H
#include "sim/lockstep.h"

/* The block that is run: sf_top takes samples, sf_ray_top takes rays. */
typedef enum { SF_ACTIVITY_SAMPLES, SF_ACTIVITY_RAYS } sf_activity_block;

typedef struct sf_activity_options {
  sf_activity_block block;
  const char *saif, *vcd; /* files to write; NULL: not */
  uint64_t first, last;   /* cycles of the stream, the first is 0; last UINT64_MAX: to its end */
  int depth;              /* levels of the hierarchy, 0 = all */
  double clock_mhz;       /* a cycle is two times half a period, rounded to picoseconds */
} sf_activity_options;

typedef struct sf_activity_report {
  uint64_t rays, samples;                /* samples: through the nets, and equal to the core's */
  uint64_t lookups, misses;              /* of the field's cache, equal to the core's; of sf_top 0 */
  uint64_t cycles, bits, toggles, quiet; /* of the window; all levels; quiet: bits without a toggle */
  uint64_t clock_toggles;                /* of the net clk_i of the top */
} sf_activity_report;

/* "FIRST,LAST". */
sf_status sf_activity_window(const char *text, sf_activity_options *options);
/* Rays, seed and stalls are those of the loaded lockstep, all of them on one accelerator; its tick shows progress by
 * sum.samples. SF_E_DIFFERENCE when the accelerator's outputs, spikes or counters are not the core's, or of rays its
 * pixels or counters: no file is written then. */
sf_status sf_activity_run(sf_lockstep *lockstep, const sf_activity_options *options, sf_activity_report *report);
cJSON *sf_activity_json(const sf_activity_options *options, const sf_activity_report *report);
void sf_activity_print(FILE *out, const sf_activity_options *options, const sf_activity_report *report);
#endif
