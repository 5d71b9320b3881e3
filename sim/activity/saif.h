/* Files of a run's activity for power tools. */
#ifndef SF_SIM_ACTIVITY_SAIF_H
#define SF_SIM_ACTIVITY_SAIF_H
#include "sim/activity/wave.h"
#include <stdio.h>

/* Backward SAIF 2.0 (IEEE 1801, annex on SAIF): T0, T1, TX, TC of every bit, by instance; ports stand among the nets.
 * depth: levels of the hierarchy, 0 = all. unit_ps: picoseconds of one unit of time. */
void sf_saif_write(FILE *out, const sf_wave *wave, int depth, uint64_t unit_ps);

/* VCD of the same nets. sf_vcd_open writes the header and takes the wave's changes from then on. */
typedef struct sf_vcd {
  FILE *out;
  const sf_wave *wave;
  uint64_t unit_ps, time;
  bool *shown; /* signals within the depth */
} sf_vcd;
sf_status sf_vcd_open(sf_vcd *vcd, FILE *out, sf_wave *wave, int depth, uint64_t unit_ps);
/* The last time stamp. */
void sf_vcd_close(sf_vcd *vcd);
#endif
